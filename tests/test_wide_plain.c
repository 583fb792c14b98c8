/* test_wide_plain.c: the checks of test_wide.c with lanes in plain C. */

#define PT_NO_INTRINSICS
#define WIDE_PROGRAM "test_wide_plain"
#define WIDE_MAIN 1
#include "test_wide.c"
