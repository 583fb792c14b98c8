#!/bin/sh
# What the documentation says is so: the program in README.md and in the header's first comment is
# examples/minimal.c, it compiles without a warning and writes out.ppm; versions, section tags, commands
# and switches that are named exist.
#
#   sh tests/check_docs.sh        in the project's top directory; CC, CFLAGS and EXTRA are respected

set -u
CC=${CC:-cc}
CFLAGS=${CFLAGS:--O2}
EXTRA=${EXTRA:-}
header=pathtracer.h
dir=build/check_docs
passed=0
failed=0

rm -rf "$dir"
mkdir -p "$dir" || exit 1

check() # STATUS LABEL: counts it
{
    if [ "$1" = 0 ]; then
        passed=$((passed + 1))
        echo "ok     $2"
    else
        failed=$((failed + 1))
        echo "FAIL   $2"
    fi
}

same() # LABEL FILE FILE
{
    diff "$2" "$3" > "$dir/diff"
    check $? "$1"
    [ ! -s "$dir/diff" ] || head -n 10 "$dir/diff"
}

# ---- the program ---------------------------------------------------------------------------------

# In the header: what is indented by seven blanks between the two titles.
awk '
    /^   A WHOLE PROGRAM/ { inside = 1; next }
    /^   CONTENTS/ { exit }
    inside && NF == 0 { if (begun) blank = blank "\n"; next }
    inside { printf "%s", blank; print substr($0, 8); blank = ""; begun = 1 }
' $header > "$dir/header.c"

# In README.md: the first block of C.
awk '/^```c$/ && !done { inside = 1; next } /^```/ { if (inside) done = 1; inside = 0 } inside' \
    README.md > "$dir/readme.c"

same "the program in the first comment of $header is examples/minimal.c" examples/minimal.c "$dir/header.c"
same 'the program in README.md is examples/minimal.c' examples/minimal.c "$dir/readme.c"

# shellcheck disable=SC2086
$CC $CFLAGS $EXTRA -std=c99 -Wall -Wextra -I. "$dir/readme.c" -o "$dir/readme" -lm -pthread \
    > "$dir/cc.out" 2>&1
check $? 'it compiles'
[ ! -s "$dir/cc.out" ]
check $? 'without a warning'
head -n 5 "$dir/cc.out"
(cd "$dir" && ./readme > readme.out 2>&1)
check $? 'it runs'
[ "$(head -c 15 "$dir/out.ppm" 2> /dev/null | tr '\n' ' ')" = 'P6 320 240 255 ' ] &&
    [ "$(wc -c < "$dir/out.ppm")" -eq $((15 + 320 * 240 * 3)) ]
check $? 'out.ppm is a whole picture of 320 x 240 pixels'
[ "$(grep -c '[0-9]' "$dir/readme.out")" -ge 2 ]
check $? 'it prints the table of error against run time'

# ---- versions ------------------------------------------------------------------------------------

macro() { awk -v name="$1" '$1 == "#define" && $2 == name { gsub(/"/, "", $3); print $3; exit }' $header; }

version=$(head -n 1 $header | sed -n 's/.* - v\([0-9][0-9.]*\) - .*/\1/p')
[ -n "$version" ]
check $? "the first line of $header says a version: $version"
[ "$(macro PT_VERSION_MAJOR).$(macro PT_VERSION_MINOR).$(macro PT_VERSION_PATCH)" = "$version" ]
check $? 'PT_VERSION_MAJOR, MINOR and PATCH are the same'
[ "$(macro PT_VERSION_STRING)" = "$version" ]
check $? 'PT_VERSION_STRING is the same'
newest=$(awk '
    /^#endif .*PATHTRACER_H/ { after = 1 }
    after && /^ *[0-9]+\.[0-9]+\.[0-9]+ \(/ { print $1; exit }' $header)
[ "$newest" = "$version" ]
check $? "the version history at the end begins with it"

# ---- names ---------------------------------------------------------------------------------------

# Tags: those of the table of contents have a banner in the implementation, and those without a letter one in the
# declarations, in the same order, and no banner is missing from the table. (07b and 11b may declare nothing.)
awk '
    /^   CONTENTS/ { inside = 1 }
    /^   SWITCHES/ { exit }
    inside && /^       \[PT-/ { print $1 }' $header > "$dir/contents"
for part in declarations implementation; do
    awk -v part=": $part" '
        /^\/\* =+$/ { open = NR }
        /^   \[PT-/ && open == NR - 1 && index($0, part) { print $1 }' $header > "$dir/banners"
    if [ $part = declarations ]; then grep -v '[a-z]]' "$dir/contents"; else cat "$dir/contents"; fi > "$dir/expected"
    if [ $part = declarations ]; then grep -v '[a-z]]' "$dir/banners" > "$dir/those"; else cp "$dir/banners" "$dir/those"; fi
    same "the table of contents and the banners agree: $part" "$dir/expected" "$dir/those"
done

# What is cited anywhere exists.
grep -ohE '\[PT-[0-9]+[a-z]?\]' README.md $header examples/*.c* examples/*/*.c tests/*.c tests/*.h |
    sort -u > "$dir/cited"
sort -u "$dir/contents" | comm -13 - "$dir/cited" > "$dir/unknown"
[ ! -s "$dir/unknown" ]
check $? 'every section that is cited exists'
cat "$dir/unknown"

# `make something` in README.md is a target; PT_SOMETHING there is in the header; so are files.
missing=
for target in $(grep -ohE '(^| |`)make [a-z][a-z-]*' README.md | awk '{ print $NF }' | sort -u); do
    grep -q "^$target:" Makefile || missing="$missing make $target,"
done
for name in $(grep -ohE '\bPT_[A-Z][A-Z0-9_]+' README.md | sort -u); do
    grep -q "\\b$name\\b" $header || missing="$missing $name,"
done
for name in $(grep -ohE '\bpt_[a-z0-9_]+' README.md | sort -u); do
    [ "$name" = pt_test ] || grep -q "\\b$name\\b" $header || missing="$missing $name,"
done
for path in $(grep -ohE '`(examples|tests|lessons|\.ci)/[A-Za-z0-9_./-]*`|\]\([a-z][A-Za-z0-9_./-]*\)' README.md |
    tr -d '`]()'); do
    [ -e "$path" ] || missing="$missing $path,"
done
[ -z "$missing" ]
check $? "the commands, names and files in README.md exist"
[ -z "$missing" ] || echo "       missing:${missing%,}"

# The switches of README.md are those of the header's table.
sed -n '/^   SWITCHES/,/^   CONVENTIONS/p' $header |
    grep -oE '^       PT[A-Z_]*|PT_(REALLOC|FREE)' | tr -d ' ' | sort -u > "$dir/switches"
grep -E '^\| ' README.md | grep -oE '`PT[A-Z_]*' | tr -d '`' | sort -u > "$dir/readme_switches"
same 'README.md lists the same switches as the header' "$dir/switches" "$dir/readme_switches"

echo "check_docs: $passed passed, $failed failed"
[ $failed = 0 ]
