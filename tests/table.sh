#!/bin/sh
# Writes tests/README.md to stdout: what the tests measured, as tables.
#
#   sh tests/table.sh LOG...      the logs of `make test`; `make test-table` does both
#
# Reads the lines that pt_test.h prints: the name of a test function, 'source', 'ok', 'FAIL', 'done'; and
# 'later TABLE N rows: REASON', exact values that wait for a part of the program which is not written yet.
# Checks of one function whose names differ by numbers, methods, samplers or colours alone share a row.

set -u

cat << 'END'
# What the tests measure

`make test-table` writes this file. `make test` compiles and runs everything that is listed here; its last
line is `N passed, N failed`. A program can be run alone, with the tests that are wanted:
`build/test/test_transport furnace`. `make test SEED=7` runs the statistical checks alone, with other random
numbers and a quarter of the samples; `make test-seeds` does so for 100 seeds.

A **deterministic** check compares with a tolerance. Here such checks are only counted, below each table.

A **statistical** check asks whether an estimate could come from a correct program. It is a row below, or has
a part in one:

| column | meaning |
|---|---|
| quantity | what is estimated; `(3)` after it: of three checks alike, the one with the largest z is shown |
| exact, source | the true value and where it comes from; "the other method" means that two estimates are compared |
| estimate, standard error | what was measured, and how far it scatters |
| z | their difference in standard errors, corrected for skewness; for counts, p of the chi-squared test |
| sees | the smallest bias that the check would have found with a probability of 90 %; of checks alike, that nearest to its bound |
| bound | if `sees` is above it the check fails: a check that cannot see an error is no check |
| s | CPU seconds, together |

All statistical checks of a run together fail by luck once in a million runs. That level is split evenly over
4096 checks, after Sidak: 1 - (1 - 1e-6)^(1/4096), which is 6.3 standard errors; means of randomisations use
Student's t. "Rejected" marks an estimator with a planted mistake, which passes only if it is found wrong.
Values too skewed for such a verdict make a check invalid, which is a failure. See `tests/pt_test.h`.

The seconds are those of one run on an ordinary two-core machine that had other work to do as well.
END

for log in "$@"; do
    echo "== $log"
    cat "$log"
done | awk -v words='(path|plain|light|sobol|independent|stratified|red|green|blue|inner|outer)' '
    function trim(s) { sub(/^ +/, "", s); sub(/ +$/, "", s); return s }
    function cell(s) { gsub(/\|/, "\\|", s); return s }
    # What checks have in common that are alike.
    function kind_of(name,  s) {
        s = " " name " "
        gsub(/[0-9.]+(e[-+]?[0-9]+)?/, "#", s)
        gsub(/[a-z]+=[-#]+/, "#", s)
        gsub("[ ,:=]+" words "([ ,:=]|$)", " ", s)
        gsub(/[ ,;:()=#-]+/, " ", s)
        return function_name "\t" trim(s)
    }
    function after(word,  s) { # the field behind a word in what follows the name
        s = " " rest
        if (!match(s, " " word " +")) return ""
        s = substr(s, RSTART + RLENGTH)
        sub(/ .*/, "", s)
        return s
    }
    function flush(  i, k, t) {
        if (program == "") return
        if (rows) {
            printf "\n## %s\n\n", program
            print "| quantity | exact | source | estimate | standard error | z | sees | bound | s |"
            print "|---|---|---|---|---|---|---|---|---|"
            for (i = 1; i <= rows; i++) {
                k = row[i]
                printf "| %s%s | %s | %s | %s | %s | %s%s | %s | %s | %.2f |\n", cell(name_of[k]), \
                    (number[k] > 1 ? " (" number[k] ")" : ""), exact[k], cell(source[k]), value[k], error[k], \
                    z[k], (rejected[k] ? " rejected" : ""), sees[k], bound[k], seconds[k]
                lines++
            }
        } else printf "\n## %s\n", program
        if (exactly != "") printf "\nDeterministic checks: %s.\n", exactly
        rows = 0; exactly = ""
        split("", number); split("", largest); split("", seconds); split("", sees); split("", saw)
    }
    /^== / {
        flush()
        program = $2
        sub(/.*\//, "", program); sub(/\.log$/, "", program)
        from = ""; function_name = ""
        next
    }
    /^[a-z_0-9]+$/ { function_name = $1; from = ""; next }
    /^source / { from = substr($0, 8); next }
    /^later / { later[++laters] = substr($0, 7); next }
    /^done / {
        sub(/:$/, "", $2)
        if ($3 > 0) exactly = exactly (exactly == "" ? "" : ", ") $2 " " $3
        next
    }
    /^[a-z_0-9]+: [0-9]+ passed, [0-9]+ failed$/ {
        if ($1 ~ /^check_/) exactly = $2 " passed"
        passed += $2; failed += $4
        next
    }
    match($0, / n [0-9]+ +(got|expected|distance) /) && /^(ok|FAIL) / {
        name = trim(substr($0, 6, RSTART - 6))
        rest = substr($0, RSTART)
        k = kind_of(name)
        if (!(k in number)) { row[++rows] = k; largest[k] = -1 }
        number[k]++
        all++
        spent = $NF == "s" ? $(NF - 1) : 0
        seconds[k] += spent
        if (rest ~ / got /) {
            this = after("z") + 0
            size = this < 0 ? -this : this
            seen = after("sees")
            match(rest, /\(bound [^)]+\)/)
            limit = substr(rest, RSTART + 7, RLENGTH - 8)
            part = limit + 0 > 0 ? seen / limit : seen / 1e6
            if (part > saw[k] + 0 || !(k in sees)) {
                percent = rest ~ / sees [^ ]+ %/ ? " %" : ""
                saw[k] = part
                sees[k] = seen percent
                bound[k] = limit + 0 > 0 ? limit percent : "-"
            }
            if (size <= largest[k]) next
            largest[k] = size
            name_of[k] = name; source[k] = from
            value[k] = after("got"); exact[k] = after("exact"); error[k] = after("se")
            z[k] = after("z"); rejected[k] = size > 6.5
        } else {
            match(rest, / \(?p [0-9.e+-]+/)
            p = substr(rest, RSTART, RLENGTH)
            sub(/.* /, "", p)
            size = 1 - p
            if (size <= largest[k]) next
            largest[k] = size
            name_of[k] = name; source[k] = from
            exact[k] = rest ~ / chi2 / ? "counts" : "uniform"
            value[k] = rest ~ / chi2 / ? "chi2 " after("chi2") " of " after("df") : "distance " after("distance")
            error[k] = bound[k] = sees[k] = "-"
            z[k] = "p " p; rejected[k] = p + 0 < 1e-9
            if (from == "") source[k] = "p-values under the null hypothesis are uniform"
        }
    }
    END {
        flush()
        if (laters) {
            print "\n## Exact values that are due later\n"
            for (i = 1; i <= laters; i++) print "- " later[i]
            print "-  MED 230 rows: media"
            print "-  VF-CUBE6 (the radiosity matrix of a cube): finite elements"
        }
        printf "\n%d statistical checks in %d rows; %d passed, %d failed\n", all, lines, passed, failed
    }'
