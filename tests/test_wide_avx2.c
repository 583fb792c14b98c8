/* test_wide_avx2.c: the checks of test_wide.c with lanes of AVX2 and fused multiply-adds, where compiler and machine have
   them. Nothing outside of test_wide.c is compiled for them, so that other machines get as far as to say so. */

#if defined(__GNUC__) && defined(__x86_64__)

#if defined(__AVX2__) && defined(__FMA__)
#define WIDE_MACHINE 1 /* -march=native and its like */
#else
#define WIDE_MACHINE (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
#if defined(__clang__)
#include <immintrin.h>
#define __AVX2__ 1 /* what [PT-00] looks at; the attribute does not define it */
#define __FMA__ 1
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma")
#endif
#define WIDE_POP
#endif

#define WIDE_PROGRAM "test_wide_avx2"
#include "test_wide.c"

#ifdef WIDE_POP
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif

#else
#include <stdio.h>
#define WIDE_MACHINE 0
static int wide(int argc, char **argv) { return argc + (argv != 0); }
#endif

int main(int argc, char **argv)
{
    if (WIDE_MACHINE) return wide(argc, argv);
    printf("skip   no AVX2 and FMA here\ntest_wide_avx2: 0 passed, 0 failed\n");
    return 0;
}
