#!/bin/sh
# The lessons: each one has the parts that it must have; what lessons/README.md says of them is what stands in them;
# tags, functions and files that they name exist. With LONG=1 or PROGRAMS=1 each also builds without a warning and runs
# once with SHORT=1.
#
#   sh tests/check_lessons.sh        in the project's top directory; CC, CFLAGS and EXTRA are respected
#
# `make lessons` runs them with all their samples and compares what they print.

set -u
header=pathtracer.h
dir=build/check_lessons
passed=0
failed=0

rm -rf "$dir"
mkdir -p "$dir" build/lessons || exit 1

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

none() # LABEL TEXT: the text, of what is wrong, is empty
{
    [ -z "$2" ]
    check $? "$1"
    [ -z "$2" ] || echo "$2" | sed 's/^/       /' | head -n 10
}

lessons=$(sh lessons/course.sh names)
[ -n "$lessons" ]
check $? "there are lessons: $(echo "$lessons" | wc -l | tr -d ' ')"

# ---- the text ------------------------------------------------------------------------------------

# The parts of the head comment in their order, none of them unknown, and the exercises at the end.
parts_of() # FILE PARTS
{
    awk -v parts="$2" '
        FNR == 1 {
            n = split("Lesson QUESTION IDEA " parts " BUILD PRINTS WORDS HEADER SOURCES Before", want, " ")
            k = 1
            known = " QUESTION IDEA SLIDES EXACT REFERENCE PHOTO PICTURE PLOT BUILD RUN PRINTS WORDS HEADER SOURCES "
        }
        k <= n && match($0, "^[/ *]*" want[k] "[: ]|^[/ *]*" want[k] "$") { k++ }
        /^   [A-Z][A-Z]+( |$)/ && !index(known, " " $1 " ") { print FILENAME ": no part of a lesson: " $1 }
        /#define PATHTRACER_IMPLEMENTATION/ { exit }
        END { if (k <= n) print FILENAME ": no " want[k] " where it is expected" }' "$1"
    grep -qE '^[/ *]*EXERCISES' "$1" || echo "$1: no EXERCISES"
}

wrong=
demanding=
for name in $lessons; do
    file=lessons/$name.c
    number=${name%%_*}
    parts=
    case $number in
    19 | 25) most=240 ;; # a whole tree, a whole path tracer
    *) most=220 ;;
    esac
    demanding="$demanding $name"
    [ ! -f "lessons/img/$name.png" ] || parts=PICTURE
    [ ! -f "lessons/img/$name.svg" ] || parts="$parts PLOT"
    text=$(parts_of "$file" "$parts")
    [ -z "$text" ] || wrong="$wrong$text
"
    title=$(sh lessons/course.sh title "$name")
    case $title in
    "Lesson $number: "?*) ;;
    *) wrong="$wrong$file: its first line has no title 'Lesson $number: ...'
" ;;
    esac
    [ -n "$(sh lessons/course.sh extract "$name")" ] || wrong="$wrong$file: no function my_...
"
    lines=$(wc -l < "$file")
    [ "$lines" -le $most ] || wrong="$wrong$file: $lines lines
"
    [ -f "lessons/img/$name.png" ] || [ -f "lessons/img/$name.svg" ] || wrong="$wrong$file: no picture in lessons/img
"
done
none 'each lesson has its parts, a title, a function my_... and a picture' "$wrong"

# What a reader of the page sees as items, at whatever depth.
wrong=
for name in $lessons; do
    number=${name%%_*}
    items=$(awk -v begin="<!-- lesson $number -->" -v end="<!-- end of lesson $number -->" '
        $0 == begin { inside = 1 }
        $0 == end { exit }
        inside && /^\*\*/ { listed = /^\*\*Exercises\.\*\*/ }
        listed && /^ *([0-9]+[.)]|[-+*]) / { printf "%s ", $0 ~ /^ / ? "(" $1 ")" : $1 }' lessons/README.md)
    [ "$items" = '1. 2. 3. ' ] || wrong="$wrong lesson $number: $items
"
done
none 'each lesson shows three exercises, 1 2 3' "$wrong"

# The words of a list are used: in the lesson's text on the page, or in what is said there for the class.
wrong=
for name in $demanding; do
    number=${name%%_*}
    awk -v begin="<!-- lesson $number -->" '
        $0 == begin { inside = 1; next }
        inside && /^<!-- (lesson|more)/ { exit }
        inside && /^\*\*/ { listed = /^\*\*Words/ }
        inside && !listed' lessons/README.md | tr '\n' ' ' | tr 'A-Z' 'a-z' | sed 's/  */ /g; s/colour/color/g' > "$dir/text"
    sh lessons/course.sh words_of "$name" | cut -f 1 | tr 'A-Z' 'a-z' > "$dir/words"
    while IFS= read -r word; do
        grep -qF -e "$word" "$dir/text" || wrong="$wrong lesson $number: $word
"
    done < "$dir/words"
done
none 'the words of a lesson are used in it' "$wrong"

# shellcheck disable=SC2086
wrong=$(sh lessons/course.sh words_of $demanding | awk -F '\t' '
    { english = tolower($1); chinese = $2; sub(/\(.*/, "", chinese) }
    english in other && other[english] != chinese { print english ": " other[english] ", " chinese }
    chinese in term && term[chinese] != english { print chinese ": " term[chinese] ", " english }
    { other[english] = chinese; term[chinese] = english }')
none 'a word is called the same in all lessons, in both languages' "$wrong"

wrong=
for number in $(echo "$lessons" | cut -c 1-2 | sort | uniq -d); do wrong="$wrong two lessons $number"; done
none 'no number is used twice' "$wrong"

# shellcheck disable=SC2086
cited=$(cd lessons && cat $(echo "$lessons" | sed 's/$/.c/') README.md)
wrong=
for tag in $(echo "$cited" | grep -oE '\[PT-[0-9]+[a-z]?\]' | sort -u); do
    grep -qF "   $tag " $header || wrong="$wrong $tag"
done
for name in $(echo "$cited" | grep -oE '\b(pt_[a-z0-9_]*[a-z0-9]|PT_[A-Z0-9_]*[A-Z0-9])\b' | sort -u); do
    grep -q "\\b$name" $header || wrong="$wrong $name"
done
for key in $(echo "$cited" | grep -oE '\[[A-Z][a-z][a-z][0-9][0-9]\]' | sort -u); do
    grep -qF "       $key " $header || wrong="$wrong $key"
done
none 'sections, functions and sources that are named are in the header' "$wrong"

wrong=
for name in $(echo "$cited" | grep -oE '\b[0-9][0-9]_[a-z0-9_]+\.c\b' | sort -u); do
    [ -f "lessons/$name" ] || wrong="$wrong $name"
done
for name in $(grep -oE '\]\([a-z0-9_./-]+\)' lessons/README.md | sed 's/](\(.*\))/\1/' | sort -u); do
    [ -e "lessons/$name" ] || wrong="$wrong $name"
done
none 'files that are named exist' "$wrong"

sh lessons/course.sh text "$dir/README.md" && diff lessons/README.md "$dir/README.md" > "$dir/diff"
none 'lessons/README.md has the titles, ideas, code and words of the lessons (make course writes them anew)' \
    "$(head -n 10 "$dir/diff")"

# ---- the programs --------------------------------------------------------------------------------

programs=$lessons
[ -n "${LONG-}${PROGRAMS-}" ] || programs=
for name in $programs; do
    if ! sh lessons/course.sh quick "$name" '' "$dir/$name" > "$dir/$name.cc" 2>&1; then
        check 1 "$name builds"
        head -n 5 "$dir/$name.cc"
        continue
    fi
    (cd "$dir" && SHORT=1 "./$name" > "$name.out" 2>&1 < /dev/null)
    status=$?
    verdict=$(grep -E "^lesson ${name%%_*}: [0-9]+ passed, 0 failed\$" "$dir/$name.out")
    [ ! -s "$dir/$name.cc" ] && [ $status = 0 ] && [ -n "$verdict" ] && [ -n "$(ls "$dir/$name".p?? 2> /dev/null)" ]
    check $? "$name builds without a warning, runs and writes its picture: ${verdict#lesson }"
    head -n 5 "$dir/$name.cc"
    grep '^FAIL' "$dir/$name.out"
    rm -f "$dir/$name" "$dir/$name".p??
done

echo "check_lessons: $passed passed, $failed failed"
[ $failed = 0 ]
