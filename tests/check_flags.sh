#!/bin/sh
# Hits and misses do not depend on how the program was optimised: the decisions of tests/stress.c against exact whole
# numbers (triangles, shared edges, spheres, boxes, a closed mesh) with every compiler at hand, at all levels, with the
# machine's own instructions and with fused multiply-adds wherever the compiler likes; in float and in double.
#
#   sh tests/check_flags.sh        in the project's top directory; .ci/run calls it

set -u
dir=build/check_flags
groups='triangles shared_edges spheres boxes closed_mesh hostile_numbers'
passed=0
failed=0
mkdir -p "$dir" || exit 1

# decisions COMPILER FLAGS...: builds and runs those groups; one check more or less
decisions()
{
    if ! "$@" -std=c99 -I. -Itests tests/test_stress.c -o "$dir/decisions" -lm -pthread > "$dir/cc.out" 2>&1; then
        failed=$((failed + 1))
        echo "FAIL   $*: does not compile"
        head -n 5 "$dir/cc.out"
        return
    fi
    # shellcheck disable=SC2086
    if "$dir/decisions" $groups > "$dir/run.out" 2>&1; then
        passed=$((passed + 1))
        echo "ok     $*"
    else
        failed=$((failed + 1))
        echo "FAIL   $*"
        grep FAIL "$dir/run.out" | head -n 5
    fi
}

for cc in gcc clang; do
    if ! command -v $cc > /dev/null 2>&1; then
        echo "skip   $cc is not installed"
        continue
    fi
    for real in -UPT_DOUBLE -DPT_DOUBLE; do
        for flags in '-O0' '-O1 -ffp-contract=fast' '-O2 -ffp-contract=off' '-O3 -ffp-contract=fast' \
            '-O3 -march=native -ffp-contract=fast' '-O2 -march=native -ffp-contract=off'; do
            # shellcheck disable=SC2086
            decisions $cc $real $flags
        done
    done
done
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
