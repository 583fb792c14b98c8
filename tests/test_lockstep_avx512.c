/* test_lockstep_avx512.c: those checks of test_lockstep.c that could differ with the lanes, with lanes of AVX-512,
   where compiler and machine have them. Nothing outside of test_lockstep.c is compiled for them, so that other machines get as
   far as to say so. */

#if defined(__GNUC__) && defined(__x86_64__)

#if defined(__AVX512F__) && defined(__AVX512DQ__) && defined(__AVX2__) && defined(__FMA__)
#define LOCK_MACHINE 1 /* -march=native and its like */
#else
#define LOCK_MACHINE (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
#if defined(__clang__)
#include <immintrin.h>
#define __AVX2__ 1 /* what [PT-00] and [PT-11b] look at; the attribute does not define them */
#define __FMA__ 1
#define __AVX512F__ 1
#define __AVX512DQ__ 1
#pragma clang attribute push(__attribute__((target("avx2,fma,avx512f,avx512dq"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma,avx512f,avx512dq")
#endif
#define LOCK_POP
#endif

#define LOCK_PROGRAM "test_lockstep_avx512"
#define LOCK_LANES 2
#define LOCK_WIDTH 16
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
    printf("skip   no AVX-512 here\ntest_lockstep_avx512: 0 passed, 0 failed\n");
    return 0;
}
