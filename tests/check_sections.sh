#!/bin/sh
# Order is architecture: the header, cut off after any section of its implementation, still compiles, and
# no section calls a function that a later one defines. Also: no forward declarations of functions in the
# implementation, and functions that fit in the head.
#
#   sh tests/check_sections.sh [HEADER]     in the project's top directory; CC chooses the compiler
#
# How the order is seen: with PT_STATIC every function is static, and compilers warn of a static function
# that is used but never defined. What is unused may be warned of; that is left to the other checks.

set -u
CC=${CC:-cc}
header=${1:-pathtracer.h}
dir=build/check_sections
passed=0
failed=0

mkdir -p "$dir" || exit 1

ok() { passed=$((passed + 1)); echo "ok     $*"; }
bad() { failed=$((failed + 1)); echo "FAIL   $*"; }

compile() { # FILE: messages of the compiler
    # shellcheck disable=SC2086
    $CC -std=c99 $looks_only -Werror=implicit-function-declaration -DPT_STATIC -I. -c "$1" -o "$dir/cut.o" 2>&1
}

undefined='used but never defined|has internal linkage but is not defined'

# ---- can this compiler see it at all? ------------------------------------------------------------
cat > "$dir/control.c" <<'END'
static int later(void);
int first(void);
int first(void) { return later(); }
END
$CC -fsyntax-only -c "$dir/control.c" > /dev/null 2>&1 && looks_only=-fsyntax-only || looks_only=
compile "$dir/control.c" | grep -qE "$undefined" && sees_order=1 || sees_order=0
[ $sees_order = 1 ] || echo "note: $CC does not tell of functions that are used but not defined"

# ---- cut after each section ----------------------------------------------------------------------
# Lines on which the implementation of a section begins, with its tag.
banners=$(awk '
    /^\/\* =+$/ { open = NR; next }
    open == NR - 1 && /^   \[PT-[0-9]+[a-z]?\].*: implementation/ {
        print open " " substr($1, 2, length($1) - 2)
    }
' $header)
[ -n "$banners" ] || { bad "$header has no implementation sections"; banners=""; }

# The first $1 - 1 lines (all of it for 0), then what closes the #ifs and extern "C" blocks that are still
# open.
cut_before()
{
    awk -v cut="$1" '
        cut > 0 && NR >= cut { exit }
        { print }
        /^#[ \t]*if/ { depth++ }
        /^#[ \t]*endif/ { depth-- }
        /^extern "C" \{/ { braces++ }
        /^\}$/ && previous ~ /^#ifdef __cplusplus/ { braces-- }
        { previous = $0 }
        END {
            for (; braces > 0; braces--) print "#ifdef __cplusplus\n}\n#endif"
            for (; depth > 0; depth--) print "#endif"
        }' $header
}

check_cut() { # TAG LINE: LINE is where the next section begins, 0 for the end of the file
    cut_before "$2" > "$dir/cut_$1.c"
    messages=$(compile "$dir/cut_$1.c")
    if [ $? != 0 ]; then
        bad "cut off after [$1]: does not compile"
        echo "$messages" | grep -E 'error' | head -n 5
    elif echo "$messages" | grep -qE "$undefined"; then
        bad "cut off after [$1]: calls what a later section defines"
        echo "$messages" | grep -E "$undefined" | sort -u | head -n 20
    else
        ok "cut off after [$1]"
        rm -f "$dir/cut_$1.c"
    fi
}

tag=
for word in $(echo "$banners") 0; do
    case $word in
    PT-*) tag=$word ;;
    *) [ -z "$tag" ] || check_cut "$tag" "$word" ;;
    esac
done
rm -f "$dir/cut.o"

# ---- the text itself -----------------------------------------------------------------------------
# Forward declarations, lengths of functions, lines of sections. Relies on the house style: a function's
# closing brace, and its opening one unless the function is a single line, stand in the first column.
awk '
    function strip(s,    a, b) { # without comments; in_comment carries over to the next line
        if (in_comment) {
            b = index(s, "*/")
            comment = comment " " (b ? substr(s, 1, b + 1) : s)
            if (!b) return ""
            in_comment = 0
            s = substr(s, b + 2)
        }
        while ((a = index(s, "/*")) > 0) {
            b = index(substr(s, a + 2), "*/")
            if (a == 1) comment = ""
            comment = comment " " (b ? substr(s, a, b + 3) : substr(s, a))
            if (!b) { in_comment = 1; return substr(s, 1, a - 1) }
            s = substr(s, 1, a - 1) " " substr(s, a + b + 3)
        }
        return s
    }
    function name_of(text,    n) {
        n = text
        sub(/[ \t]*\(.*/, "", n)
        sub(/.*[ \t*]/, "", n)
        return n
    }
    function note(name, lines) {
        count++
        length_of[count] = lines
        if (lines > longest) { longest = lines; longest_name = name }
        if (lines > 80 && comment !~ /long:/) print "long", name, lines
        signature = ""; comment = ""
    }
    NR == FNR && /^\/\* =+$/ { open = NR }
    /^   \[PT-[0-9]+[a-z]?\].*: (declarations|implementation)/ && open == NR - 1 {
        tag = substr($1, 2, length($1) - 2)
        if (/: implementation/) implementation = 1
    }
    tag != "" { lines_of[tag]++; if (!(tag in seen)) { seen[tag] = 1; order[++tags] = tag } total++ }
    {
        code = strip($0)
        sub(/[ \t\r]+$/, "", code)
    }
    continued || code ~ /^#/ { continued = code ~ /\\$/; if (!body) signature = ""; next }
    body { if (code ~ /^\}/) { note(name_of(signature), NR - began + 1); body = 0 } next }
    code == "{" && signature ~ /\)$/ { body = 1; next }
    code ~ /^[A-Za-z_].*\).*\{.*\}$/ && code !~ /^(typedef|struct|enum|union)/ && code !~ /=/ {
        began = NR; note(name_of(code), 1); next
    }
    code ~ /^[A-Za-z_]/ && signature == "" { began = NR; signature = code }
    code ~ /^[ \t]/ && signature != "" { signature = signature " " code }
    code == "" && signature != "" && !in_comment { signature = "" }
    signature ~ /[;{}]$/ {
        if (implementation && signature ~ /\);$/ && signature !~ /^typedef/ && signature !~ /=/ &&
            name_of(signature) !~ /^[A-Z0-9_]+$/) print "forward", name_of(signature), began
        if (signature ~ /;$/) comment = ""
        signature = ""
    }
    END {
        for (i = 1; i <= count; i++) histogram[length_of[i]]++
        below = 0
        for (n = 1; n <= longest; n++) {
            below += histogram[n]
            if (!median && 2 * below >= count) median = n
            if (!ninety && 10 * below >= 9 * count) ninety = n
        }
        print "functions", count, median, ninety, longest, longest_name
        for (i = 1; i <= tags; i++) print "section", order[i], lines_of[order[i]]
        print "total", total
    }' $header > "$dir/text"

if grep -q '^forward' "$dir/text"; then
    bad 'the implementation declares functions ahead of their definition:'
    awk '/^forward/ { print "       " $2 " in line " $3 }' "$dir/text"
else
    ok 'no forward declarations in the implementation'
fi
if grep -q '^long' "$dir/text"; then
    bad 'functions of more than 80 lines whose comment gives no reason ("long: ..."):'
    awk '/^long/ { print "       " $2 ": " $3 " lines" }' "$dir/text"
else
    ok 'no function is longer than 80 lines without a reason'
fi
awk '/^functions/ { print $2 " functions: median " $3 " lines, 90 % at most " $4 ", longest " $5 " (" $6 ")" }
     /^section/ { row = row sprintf("%s %d  ", substr($2, 4), $3) }
     /^total/ { print "lines of sections: " row "together " $2 }' "$dir/text"

echo "check_sections: $passed passed, $failed failed"
[ $failed = 0 ]
