#!/bin/sh
# Hits and misses do not depend on how the program was optimised: the decisions of tests/stress.c against exact whole
# numbers (triangles, shared edges, spheres, boxes, a closed mesh) with every compiler at hand, at all levels, with the
# machine's own instructions and with fused multiply-adds wherever the compiler likes; in float and in double.
#
#   sh tests/check_flags.sh        in the project's top directory, JOBS (2) at a time; .ci/run calls it

set -u
dir=build/check_flags
rm -rf "$dir"
mkdir -p "$dir" || exit 1

# One line of the list: NAME COMPILER FLAGS. Its verdict goes to NAME.out.
cat > "$dir/one" << 'END'
name=$1
shift
groups='triangles shared_edges spheres boxes closed_mesh hostile_numbers'
dir=build/check_flags
if ! "$@" -std=c99 -I. -Itests tests/test_stress.c -o "$dir/$name" -lm -pthread > "$dir/$name.cc" 2>&1; then
    { echo "FAIL   $*: does not compile"; head -n 5 "$dir/$name.cc"; } > "$dir/$name.out"
elif "$dir/$name" $groups > "$dir/$name.run" 2>&1; then
    echo "ok     $*" > "$dir/$name.out"
else
    { echo "FAIL   $*"; grep FAIL "$dir/$name.run" | head -n 5; } > "$dir/$name.out"
fi
END

n=10
for cc in gcc clang; do
    if ! command -v $cc > /dev/null 2>&1; then
        echo "skip   $cc is not installed" >&2
        continue
    fi
    for real in -UPT_DOUBLE -DPT_DOUBLE; do
        for flags in '-O0' '-O1 -ffp-contract=fast' '-O3 -ffp-contract=fast' '-O3 -march=native -ffp-contract=fast' \
            '-O2 -march=native -ffp-contract=off'; do
            n=$((n + 1))
            echo "run$n $cc $real $flags"
        done
    done
done > "$dir/list"
xargs -P "${JOBS:-2}" -L 1 sh "$dir/one" < "$dir/list"
cat "$dir"/run*.out
passed=$(grep -c '^ok' "$dir"/run*.out | awk -F: '{ n += $NF } END { print n + 0 }')
wanted=$(wc -l < "$dir/list")
echo "$passed passed, $((wanted - passed)) failed"
[ "$passed" = "$wanted" ] && [ "$passed" -gt 0 ]
