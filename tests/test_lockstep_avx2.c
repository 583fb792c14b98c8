/* test_lockstep_avx2.c: those checks of test_lockstep.c that could differ with the lanes, with lanes of AVX2 and FMA,
   where compiler and machine have them. Nothing outside of test_lockstep.c is compiled for them, so that other machines get as
   far as to say so. */

#if defined(__GNUC__) && defined(__x86_64__)

#if defined(__AVX512F__)
#undef __AVX512F__ /* of -march=native: what [PT-11b] looks at */
#endif
#if defined(__AVX2__) && defined(__FMA__)
#define LOCK_MACHINE 1 /* -march=native and its like */
#else
#define LOCK_MACHINE (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
#if defined(__clang__)
#include <immintrin.h>
#define __AVX2__ 1 /* what [PT-00] looks at; the attribute does not define it */
#define __FMA__ 1
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma")
#endif
#define LOCK_POP
#endif

#define LOCK_PROGRAM "test_lockstep_avx2"
#define LOCK_LANES 2
#define LOCK_WIDTH 8
#include "test_lockstep.c"

#ifdef LOCK_POP
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif

#else
#include <stdio.h>
#define LOCK_MACHINE 0
static int lockstep(int argc, char **argv) { return argc + (argv != 0); }
#endif

int main(int argc, char **argv)
{
    if (LOCK_MACHINE) return lockstep(argc, argv);
    printf("skip   no AVX2 and FMA here\ntest_lockstep_avx2: 0 passed, 0 failed\n");
    return 0;
}
