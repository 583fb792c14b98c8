/* test_lockstep_plain.c: those checks of test_lockstep.c that could differ with the lanes, with lanes in plain C. */

#define PT_NO_INTRINSICS
#define LOCK_PROGRAM "test_lockstep_plain"
#define LOCK_MAIN 1
#define LOCK_LANES 0
#define LOCK_WIDTH 8
#include "test_lockstep.c"
