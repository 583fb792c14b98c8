#!/bin/sh
# The course as a whole: runs the lessons, makes lessons/README.md from them, tries their exercises.
#
#   sh lessons/course.sh run [NN ...]         runs build/lessons/NN_name of each lesson, its output in build/lessons/;
#                                             a line for each; fails if one fails, or prints not what README.md shows
#                                             (but for the last column, seconds)
#   sh lessons/course.sh write [NN ...]       runs them, then writes the generated parts of lessons/README.md and
#                                             copies the pictures to lessons/img/
#   sh lessons/course.sh text FILE            writes lessons/README.md as the sources want it to FILE, without running:
#                                             what the lessons print is taken from README.md
#   sh lessons/course.sh exercises [NN ...]   builds each lesson with -DEX=1, -DEX=2, ... and runs it with SHORT=1
#   sh lessons/course.sh quick NAME FLAGS PROGRAM   builds a lesson against the header compiled once
#
# In the project's top directory, after `make` has built the programs. CC, CFLAGS, EXTRA and WARN are respected.
#
# What is generated stands between <!-- lesson NN --> and <!-- end of lesson NN -->, and so for contents and words;
# what is written by hand around it stays. A lesson without a place in README.md gets one, in order.

set -u
LC_ALL=C
export LC_ALL
CC=${CC:-cc}
CFLAGS=${CFLAGS:--O2}
EXTRA=${EXTRA:-}
WARN=${WARN:--Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wdouble-promotion -Wstrict-prototypes -Wmissing-prototypes}
build=build/lessons
readme=lessons/README.md
mkdir -p $build lessons/img || exit 1

# Names of all lessons, or of those with the numbers given: 01_first_image ...
names()
{
    for path in lessons/[0-9][0-9]_*.c; do
        [ -f "$path" ] || continue
        name=${path#lessons/}
        name=${name%.c}
        if [ $# = 0 ]; then echo "$name"; fi
        for number in "$@"; do
            case $name in "$number"_*) echo "$name" ;; esac
        done
    done
}

# ---- running -------------------------------------------------------------------------------------

# The last column of a row is seconds, which differ from run to run: a number with three decimals.
mask() { sed 's/  *[0-9][0-9]*\.[0-9][0-9][0-9]$/ #/' "$@"; }

# What README.md shows of lesson NN.
shown()
{
    [ -f $readme ] && awk -v begin="<!-- lesson $1 -->" -v end="<!-- end of lesson $1 -->" '
        $0 == begin { inside = 1 }
        $0 == end { exit }
        inside && /^<!-- printed -->$/ { printed = 1; next }
        printed && /^```text$/ { body = 1; next }
        body && /^```$/ { exit }
        body' $readme
}

# The sample in the head comment, for `sample NAME`: each of its lines is one that the program prints, "..." apart.
sample()
{
    awk -v wanted=PRINTS "$head_comment"'
        END { for (i = 1; i <= count; i++) if (text[i] !~ /^ *(\.\.\.|\[\.\.\.\])? *$/) print text[i] }' "lessons/$1.c"
}

squeeze() { mask | sed 's/  */ /g; s/^ //; s/ $//'; }

# The CPU seconds of the children of a subshell, from the two lines of `times`.
cpu_of() { awk 'NR == 2 { for (i = 1; i <= 2; i++) { split($i, part, /[ms]/); s += 60 * part[1] + part[2] } printf "%.2f", s }' "$1"; }

run()
{
    bad=0
    total=0
    for name in $(names "$@"); do
        number=${name%%_*}
        log=$build/$name
        if [ ! -x "$log" ]; then
            echo "$name: was not built"
            bad=$((bad + 1))
            continue
        fi
        (
            cd $build || exit 1
            "./$name" > "$name.out" 2>&1 < /dev/null
            status=$?
            times > "$name.times"
            exit $status
        )
        status=$?
        verdict=$(grep -E '^lesson [0-9]+: [0-9]+ passed, [0-9]+ failed$' "$log.out" | tail -n 1)
        : > "$log.bad"
        [ $status = 0 ] || echo "exit status $status" >> "$log.bad"
        [ -n "$verdict" ] || echo "no line 'lesson $number: N passed, N failed'" >> "$log.bad"
        grep '^FAIL' "$log.out" >> "$log.bad"
        if [ "${COMPARE:-1}" = 1 ]; then
            shown "$number" | mask > "$log.shown"
            mask "$log.out" > "$log.masked"
            if ! cmp -s "$log.shown" "$log.masked"; then
                echo "prints not what $readme shows (< shown, > printed; make course writes it anew):" >> "$log.bad"
                diff "$log.shown" "$log.masked" | head -n 6 >> "$log.bad"
            fi
        fi
        squeeze < "$log.out" > "$log.lines"
        sample "$name" | squeeze | while IFS= read -r line; do
            grep -qxF -e "$line" "$log.lines" || echo "the head comment shows what it does not print: $line"
        done >> "$log.bad"
        printf '%-24s %-34s %6s s%s\n' "$name" "${verdict:-no verdict}" "$(cpu_of "$log.times")" \
            "$([ -s "$log.bad" ] && echo '  FAIL')"
        sed 's/^/       /' "$log.bad"
        total=$((total + 1))
        [ ! -s "$log.bad" ] || bad=$((bad + 1))
    done
    echo "lessons: $((total - bad)) passed, $bad failed"
    [ $bad = 0 ] && [ $total -gt 0 ]
}

# ---- making README.md ----------------------------------------------------------------------------

# awk: the lines of section `wanted` of the head comment, in text[1..count] without their common indentation.
head_comment='
    function indent_of(s) { match(s, /^ */); return RLENGTH }
    FNR == 1 {
        inside = 1; section = ""; count = 0; base = 999
        sections = "QUESTION|IDEA|SLIDES|EXACT|REFERENCE|PHOTO|PICTURE|PLOT|BUILD|RUN|PRINTS|WORDS|HEADER|SOURCES|EXERCISES|Before"
    }
    inside {
        line = $0
        closes = index(line, "*/")
        if (closes) line = substr(line, 1, closes - 1)
        sub(/^\/\*/, "  ", line)
        sub(/^ \*( |$)/, "   ", line)
        sub(/[ \t\r]+$/, "", line)
        if (match(line, "^ *(" sections "):?( |$)")) {
            section = line
            sub(/^ */, "", section)
            sub(/[: ].*/, "", section)
            at = index(line, section)
            line = substr("                    ", 1, at - 1 + length(section)) substr(line, at + length(section))
            if (match(line, /^ *:/)) line = substr(line, 1, RLENGTH - 1) " " substr(line, RLENGTH + 1)
        }
        if (section == wanted && (count || line !~ /^ *$/)) {
            text[++count] = line
            if (line !~ /^ *$/ && indent_of(line) < base) base = indent_of(line)
        }
        if (closes) {
            inside = 0
            while (count && text[count] ~ /^ *$/) count--
            for (i = 1; i <= count; i++) text[i] = substr(text[i], base + 1)
        }
    }
'

# awk: a line of text with its marks of Markdown escaped; at its start also those of lists, headings and quotes, and
# "2. " or "2) ", which would become an item.
markdown='
    function escape(s) {
        gsub(/[\\*<|]/, "\\\\&", s)
        if (match(s, /^[0-9]+[.)] /)) s = substr(s, 1, RLENGTH - 2) "\\" substr(s, RLENGTH - 1)
        else if (s ~ /^([-+#] |>)/) s = "\\" s
        return s
    }
'

# Prose with its deeper lines as code.
prose() # NAME SECTION
{
    awk -v wanted="$2" "$markdown$head_comment"'
        function fence(open) { if (open != code) { if (open) print ""; print open ? "```text" : "```\n"; code = open } }
        END {
            for (i = 1; i <= count; i++) {
                if (text[i] ~ /^ *$/) {
                    for (j = i; j <= count && text[j] ~ /^ *$/; j++) ;
                    if (code && text[j] !~ /^  /) fence(0)
                    else print ""
                } else if (text[i] ~ /^  /) { fence(1); print substr(text[i], 3) }
                else { fence(0); print escape(text[i]) }
            }
            fence(0)
        }' "lessons/$1.c" | cat -s
}

title() { sed -n '1,3s/^[/ *]*\(Lesson [0-9][0-9]*:.*\)$/\1/p' "lessons/$1.c" | sed 's/ *\*\/ *$//; s/[. ]*$//' | head -n 1; }

# The functions my_... with the comments above them, and what else of the file they use, in its order: constants, types,
# small functions. Their names are found among the words of the code: those that a line at file level declares.
extract() # NAME
{
    awk '
        # Code without its comments, strings, characters and members.
        function bare(s,    i, j) {
            gsub(/"([^"\\]|\\.)*"/, "\"\"", s)
            gsub(/\047([^\047\\]|\\.)*\047/, "0", s)
            gsub(/(->|\.)[a-z_]+/, "", s) # a member has a name of its own
            while ((i = index(s, "/*")) > 0) {
                j = index(substr(s, i + 2), "*/")
                s = substr(s, 1, i - 1) " " (j ? substr(s, i + j + 3) : "")
            }
            return s
        }
        function depth_of(s,    opened) { opened = gsub(/[({]/, "&", s); return opened - gsub(/[)}]/, "&", s) }
        function declare(word) { if (word != "" && !(word in owner)) owner[word] = items }

        # The names that an item declares: a function, an enumeration, a type, or variables.
        function names_of(s,    n, i, part) {
            if (s ~ /^#define /) { sub(/^#define +/, "", s); sub(/[^A-Za-z0-9_].*/, "", s); declare(s); return }
            if (s ~ /^enum/) {
                sub(/^[^{]*[{]/, "", s)
                n = split(s, part, /[,}]/)
                for (i = 1; i <= n; i++) { sub(/=.*/, "", part[i]); gsub(/[^A-Za-z0-9_]/, "", part[i]); declare(part[i]) }
                return
            }
            if (s !~ /^typedef/ && match(s, /^[A-Za-z0-9_ *]*\(/) && s !~ /^[^(]*=/ && substr(s, RLENGTH + 1, 1) != "*") {
                s = substr(s, 1, RLENGTH - 1); sub(/.*[ *]/, "", s); declare(s); return
            }
            if (match(s, /\(\*(const )?[A-Za-z0-9_]+/)) { # a pointer to a function
                s = substr(s, RSTART, RLENGTH); sub(/.*[ *]/, "", s); declare(s); return
            }
            while (gsub(/[{][^{}]*[}]|\[[^][]*\]|\([^()]*\)/, "", s)) ;
            n = split(s, part, /[,;]/)
            for (i = 1; i <= n; i++) { sub(/ *=.*/, "", part[i]); sub(/.*[ *]/, "", part[i]); declare(part[i]) }
        }
        function take(i,    n, k, word) {
            if (taken[i]++) return
            n = split(code[i], word, /[^A-Za-z0-9_]+/)
            for (k = 1; k <= n; k++) if (word[k] in owner) take(owner[word[k]])
        }

        /^#include "pathtracer.h"/ { inside = 1; next }
        /^\/\* EXERCISES/ { exit }
        !inside { next }
        open == 0 && !started && /^\/\*/ { comment = ""; commenting = 1 }
        commenting { comment = comment $0 "\n"; if (index($0, "*/")) commenting = 0; next }
        !started && /^ *$/ { comment = ""; next }
        !started && /^#/ && !/^#define / { next }
        !started { started = 1; text[++items] = comment; comment = "" }
        {
            text[items] = text[items] $0 "\n"
            line = $0 ~ /^#(if|el|en)/ ? "" : bare($0)
            code[items] = code[items] line "\n"
            open += depth_of(line)
            if (open == 0 && (line ~ /[;}] *$/ || line ~ /^#define/)) {
                names_of(code[items])
                mine[items] = code[items] ~ /^[a-z][^=;{]*[ *]my_[a-z0-9_]+\(/
                function_at[items] = code[items] ~ /[)]\n?[ ]*[{]/ && code[items] ~ /[}][ \n]*$/
                started = 0
            }
        }
        END {
            for (i = 1; i <= items; i++) if (mine[i]) take(i)
            for (i = 1; i <= items; i++) {
                if (!taken[i]) continue
                sub(/, MISTAKE = [^}]*[}]/, " }", text[i]) # for the end of main alone
                if (shown++ && (function_at[i] || function_at[last] || text[i] ~ /^\/\*/)) print ""
                printf "%s", text[i]
                last = i
            }
        }' "lessons/$1.c"
}

# The items count up from 1 and begin in one column; any other number at the start of a line is text.
exercises_of() # NAME
{
    awk "$markdown"'
        /EXERCISES/ && /^[\/ *]*EXERCISES/ { inside = 1; count = 0; next }
        inside {
            closes = index($0, "*/")
            if (closes) $0 = substr($0, 1, closes - 1)
            match($0, /^[ \t]*\*?[ \t]*/)
            column = RLENGTH
            $0 = substr($0, column + 1)
            sub(/[ \t\r]+$/, "")
            if ((count == 0 || column == first) && match($0, "^\\(?" (count + 1) "[).]( |$)")) {
                first = column
                print ++count ". " escape(substr($0, RLENGTH + 1))
            } else if (count && $0 != "") print "   " escape($0)
            if (closes) inside = 0
        }' "lessons/$1.c"
}

# The words of the lessons given, one a line: English TAB Chinese TAB number.
words_of() # NAME...
{
    for name in "$@"; do
        awk -v wanted=WORDS -v number="${name%%_*}" "$head_comment"'
            END {
                for (i = 1; i <= count; i++) all = all " " text[i]
                n = split(all, word, /[;,]|\. /)
                for (i = 1; i <= n; i++) {
                    if (!match(word[i], /[\200-\377]/)) continue
                    english = substr(word[i], 1, RSTART - 1)
                    chinese = substr(word[i], RSTART)
                    gsub(/^[ .:]+|[ (]+$/, "", english)
                    gsub(/[ .]+$/, "", chinese)
                    if (english != "") printf "%s\t%s\t%s\n", english, chinese, number
                }
            }' "lessons/$name.c"
    done
}

# The parts that only some lessons have, in the order of the head comment.
asides() # NAME
{
    awk '/^[ *]*(EXACT|SLIDES|REFERENCE|PHOTO)[: ]/ { sub(/^[ *]*/, ""); sub(/[: ].*/, ""); print }
        /\*\// { exit }' "lessons/$1.c"
}

# A picture with what the head comment says of it: for those who do not see it, and below it.
picture() # NAME KIND SECTION
{
    [ -f "lessons/img/$1.$2" ] || return 0
    caption=$(prose "$1" "$3")
    plain=$(awk -v wanted="$3" "$head_comment"'
        END {
            for (i = 1; i <= count; i++) {
                gsub(/["*|<]|\\|\[|\]/, "", text[i]) # no marks there
                printf "%s%s", (i > 1 ? " " : ""), text[i]
            }
        }' "lessons/$1.c")
    printf '![%s](img/%s)\n\n' "${plain:-$(title "$1")}" "$1.$2"
    [ -z "$caption" ] || printf '*%s*\n\n' "$caption"
}

section() # NAME OUTPUT
{
    name=$1
    echo
    echo "## $(title "$name")"
    echo
    echo "**Question.** $(prose "$name" QUESTION)"
    echo
    prose "$name" IDEA
    echo
    for part in $(asides "$name"); do
        case $part in
        EXACT) title_of_part='Exact values' ;;
        SLIDES) title_of_part='The slides' ;;
        REFERENCE) title_of_part='The reference' ;;
        PHOTO) title_of_part='And a photograph' ;;
        esac
        echo "**$title_of_part.** $(prose "$name" "$part")"
        echo
    done
    picture "$name" png PICTURE
    picture "$name" svg PLOT
    echo "[$name.c]($name.c) prints:"
    echo
    echo '<!-- printed -->'
    echo '```text'
    cat "$2"
    echo '```'
    echo
    if [ -n "$(extract "$name")" ]; then
        echo '<details><summary>The code</summary>'
        echo
        echo '```c'
        extract "$name"
        echo '```'
        echo
        echo '</details>'
        echo
    fi
    echo '**Exercises.**'
    echo
    exercises_of "$name"
    echo
    echo "**Words.** $(prose "$name" WORDS)"
    echo
    echo "**In the header.** $(prose "$name" HEADER)"
    echo
    echo "**Further reading.** $(prose "$name" SOURCES)"
    echo
}

contents()
{
    echo
    echo '| | lesson | question |'
    echo '| --- | --- | --- |'
    for name in $(names); do
        heading=$(title "$name")
        anchor=$(echo "$heading" | tr 'A-Z ' 'a-z-' | sed 's/[^a-z0-9_-]//g')
        echo "| ${name%%_*} | [${heading#*: }](#$anchor) | $(prose "$name" QUESTION | tr '\n' ' ' | sed 's/ *$//') |"
    done
    echo
}

words()
{
    echo
    echo '| English | 中文 | lessons |'
    echo '| --- | --- | --- |'
    # shellcheck disable=SC2046
    words_of $(names) | sort -f -t '	' -k1,1 -k3,3 | awk -F '\t' '
        function flush() { if (english != "") print "| " english " | " chinese " | " numbers " |" }
        function plain(s) { sub(/\(.*/, "", s); return s } # a word with and without a remark is one word
        tolower($1) == tolower(english) {
            if (index(numbers, $3) == 0) numbers = numbers ", " $3
            if (index(chinese, plain($2)) == 0) chinese = chinese ", " $2
            next
        }
        { flush(); english = $1; chinese = $2; numbers = $3 }
        END { flush() }'
    echo
}

# README.md with its generated parts made anew, to standard output. What the lessons named have printed is taken from
# build/lessons/, that of the others from README.md.
assemble() # NAME...
{
    fresh=" $* "
    parts=$build/parts
    rm -rf $parts
    mkdir -p $parts
    list=
    for name in $(names); do
        number=${name%%_*}
        list="$list $number"
        case $fresh in
        *" $name "*) cp $build/"$name".out $parts/out ;;
        *) shown "$number" > $parts/out ;;
        esac
        section "$name" $parts/out | cat -s > $parts/"$number"
    done
    contents > $parts/contents
    words > $parts/words
    known=$(sed -n 's/^<!-- lesson \([0-9][0-9]\) -->$/\1/p' $readme | tr '\n' ' ')
    awk -v parts=$parts -v list="$list" -v known="$known" '
        function insert(file,    line) { while ((getline line < file) > 0) print line; close(file) }
        function whole(number) {
            print "<!-- lesson " number " -->"
            insert(parts "/" number)
            print "<!-- end of lesson " number " -->"
            print ""
        }
        function news_before(number,    i) { # lessons without a place so far
            for (i = 1; i <= count; i++)
                if (!(lesson[i] in done) && !(lesson[i] in placed) && lesson[i] < number) { whole(lesson[i]); done[lesson[i]] = 1 }
        }
        BEGIN {
            count = split(list, lesson, " ")
            for (i = 1; i <= count; i++) present[lesson[i]] = 1
            n = split(known, place, " ")
            for (i = 1; i <= n; i++) placed[place[i]] = 1
        }
        /^<!-- more lessons -->$/ { news_before("99") }
        /^<!-- lesson [0-9][0-9] -->$/ {
            news_before($3)
            print
            if ($3 in present) { insert(parts "/" $3); skipping = "<!-- end of lesson " $3 " -->" }
            next
        }
        /^<!-- (contents|words) -->$/ { print; insert(parts "/" $2); skipping = "<!-- end of " $2 " -->"; next }
        $0 == skipping { skipping = "" }
        skipping == "" { print }
        END { if (skipping != "") { print "no line " skipping > "/dev/stderr"; exit 1 } }' $readme
}

write()
{
    COMPARE=0 run "$@" || return 1
    for name in $(names "$@"); do
        for kind in png svg; do
            [ ! -f $build/"$name".$kind ] || cp $build/"$name".$kind lessons/img/
        done
    done
    # shellcheck disable=SC2046
    assemble $(names "$@") > $build/README.md && mv $build/README.md $readme && echo "wrote $readme"
}

# ---- exercises -----------------------------------------------------------------------------------

# A lesson built against the header compiled once, which takes a tenth of the time. One that defines switches of
# its own is built whole.
quick() # NAME FLAGS PROGRAM
{
    base="$CC -std=c99 -ffp-contract=off $CFLAGS $EXTRA -I. -pthread"
    if grep -q '^#define PT_[A-Z]' "lessons/$1.c"; then
        # shellcheck disable=SC2086
        $base $WARN $2 "lessons/$1.c" -o "$3" -lm
        return
    fi
    stamp="$base $(cksum pathtracer.h)"
    if [ ! -f $build/header.o ] || [ "$stamp" != "$(cat $build/header.stamp 2> /dev/null)" ]; then
        printf '#define PATHTRACER_IMPLEMENTATION\n#include "pathtracer.h"\n' > $build/header.c
        # shellcheck disable=SC2086
        $base -c $build/header.c -o $build/header.o || return 1
        echo "$stamp" > $build/header.stamp
    fi
    # shellcheck disable=SC2086
    $base $WARN -DPTI_IMPLEMENTED $2 "lessons/$1.c" $build/header.o -o "$3" -lm
}

# The numbers of a lesson's exercises: those it compares EX with.
numbers_of() { grep -oE '\bEX == [0-9]+' "lessons/$1.c" | awk '$3 > 0 { print $3 }' | sort -nu; }

exercises()
{
    mkdir -p $build/ex
    good=0
    bad=0
    for name in $(names "$@"); do
        for ex in $(numbers_of "$name"); do
            program=$build/ex/${name}_ex$ex
            if ! quick "$name" "-DEX=$ex" "$program" > "$program.cc" 2>&1; then verdict='does not compile'
            elif [ -s "$program.cc" ]; then verdict='compiles with warnings'
            elif (cd $build/ex && SHORT=1 "./${name}_ex$ex" > "${name}_ex$ex.out" 2>&1 < /dev/null); then verdict=
            else verdict="exit status $?"; fi
            if [ -z "$verdict" ]; then
                good=$((good + 1))
                mark='ok    '
                verdict=$(grep -E '^lesson [0-9]+: |^exercise |noticed' "$program.out" | tail -n 2 | tr '\n' ';' | sed 's/;$//; s/;/; /')
            else
                bad=$((bad + 1))
                mark='FAIL  '
            fi
            echo "$mark $name -DEX=$ex: $verdict"
            case $mark in FAIL*) head -n 5 "$program.cc"; grep -E '^FAIL|^exercise' "$program.out" 2> /dev/null ;; esac
            rm -f "$program"
        done
    done
    echo "exercises: $good passed, $bad failed"
    [ $bad = 0 ] && [ $good -gt 0 ]
}

case ${1-} in
run | write | exercises) "$@" ;;
text) assemble > "$2" ;;
quick) shift; quick "$@" ;;
title | numbers_of | extract | words_of) "$@" ;;
names) shift; names "$@" ;;
*)
    echo 'usage: course.sh run | write | exercises [NN ...]; course.sh text FILE' >&2
    exit 2
    ;;
esac
