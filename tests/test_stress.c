/* test_stress.c: the short form of the stress suite; tests/stress.c says what it holds. */

#define PT_STATIC /* it looks at private functions: an implementation of its own */
#define STRESS_SHORT
#include "stress.c"
