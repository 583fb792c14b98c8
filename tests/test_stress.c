/* test_stress.c: the short form of the stress suite; tests/stress.c says what it holds. */

#define STRESS_SHORT
#include "stress.c"
