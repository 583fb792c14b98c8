#!/bin/sh
# Runs a test program, or adds up the counts of several.
#
#   sh tests/run.sh one LOG COMMAND...
#       Runs the command with its output going to LOG and shows the output when the command has ended. Always
#       succeeds: the verdict is in LOG.
#   sh tests/run.sh sum LOG...
#       Prints one line for each log, the checks that failed, and 'N passed, N failed'; succeeds if nothing
#       failed.
#   sh tests/run.sh seeds FROM TO
#       Runs the statistical checks with each of these seeds, MAKE test SEED=n. Shows what failed, then which
#       checks are off on average over the seeds, and ends with 'N passed, N failed', a count of seeds and of
#       what is looked at over all of them.
#
# A test program ends its output with a line 'name: N passed, N failed'. One that prints no such line, or
# exits with a failure that it did not count, is itself a failed check.

set -u

one()
{
    log=$1
    shift
    "$@" > "$log.part" 2>&1
    status=$?
    echo "exit status $status" >> "$log.part"
    mv "$log.part" "$log"
    sed '$d' "$log"
}

sum()
{
    echo
    for log in "$@"; do
        if [ -f "$log" ]; then echo "== $log"; cat "$log"; else echo "== $log"; echo 'did not build'; fi
    done | awk '
        function close_log() {
            if (name == "") return
            if (!counted) {
                verdict = status == "" ? "did not build" : "ended with status " status " and no count"
                failed += 1
            } else {
                verdict = p " passed, " f " failed"
                if (f == 0 && status != 0) { verdict = verdict ", yet ended with status " status; f = 1 }
                passed += p
                failed += f
            }
            printf "%-18s %s\n", name, verdict
        }
        /^== / {
            close_log()
            name = $2
            sub(/.*\//, "", name); sub(/\.log$/, "", name)
            counted = 0; status = ""
            next
        }
        /^exit status [0-9]+$/ { status = $3; next }
        /^[a-z_0-9]+: [0-9]+ passed, [0-9]+ failed$/ { counted = 1; p = $2; f = $4; next }
        /FAIL/ { bad[++bads] = name ": " $0 }
        END {
            close_log()
            if (bads) printf "\n"
            for (i = 1; i <= bads; i++) print bad[i]
            printf "\n%d passed, %d failed\n", passed, failed
            exit failed != 0 || passed == 0
        }'
}

# One run for each seed; build/seeds/N.log has the lines of its checks.
seeds()
{
    dir=build/seeds
    rm -rf "$dir"
    mkdir -p "$dir" || exit 1
    passed=0
    failed=0
    seed=$1
    while [ "$seed" -le "$2" ]; do
        if ${MAKE:-make} test SEED="$seed" > "$dir/$seed.out" 2>&1; then
            passed=$((passed + 1))
        else
            failed=$((failed + 1))
        fi
        for log in build/test/test_*.log; do echo "== $log"; cat "$log"; done > "$dir/$seed.log"
        echo "seed $seed: $(tail -n 1 "$dir/$seed.out")"
        grep -E '^test_[a-z_0-9]+: .*FAIL' "$dir/$seed.out"
        seed=$((seed + 1))
    done
    over_seeds "$dir" $passed $failed
}

# The mean of z of one check over n seeds has the standard error 1 / sqrt n, so that small biases show that
# no single run can see: 6.5 of these is the level of a suite of some thousand checks. Only of checks whose
# line has a p that is not in parentheses: the error of a reference, say, is the same for all seeds.
over_seeds() # DIRECTORY PASSED FAILED
{
    cat "$1"/*.log | awk -v passed="$2" -v failed="$3" '
        /^== / { program = $2; sub(/.*\//, "", program); sub(/\.log$/, "", program); split("", times); next }
        match($0, /  p [0-9.e+-]+  /) && match($0, /^(ok|FAIL) .* z +[-+][0-9.]+/) {
            z = substr($0, 1, RLENGTH)
            sub(/.* z +/, "", z)
            z += 0 # a number from here on: text compares as text
            name = $0
            sub(/^(ok|FAIL) +/, "", name)
            sub(/ +n [0-9]+ +got .*/, "", name)
            name = program ": " name
            if (times[name]++) name = name " (" times[name] ")"
            if (z > 9) z = 9
            if (z < -9) z = -9
            count[name]++
            sum[name] += z
            square[name] += z * z
        }
        END {
            for (name in count) {
                n = count[name]
                if (n < 8) continue
                off = sum[name] / sqrt(n)
                size = off < 0 ? -off : off
                checks++
                over3 += size > 3
                all += off * off
                if (size > 6.5) {
                    bad++
                    print "FAIL  off by " off / sqrt(n) " standard errors on average of " n " seeds, " off \
                        " of that average: " name
                }
                if (size > worst) { worst = size; who = name }
            }
            if (checks) {
                printf "\nz over the seeds, of %d checks: rms %.3f, above 3: %d (by luck %.1f), worst %.1f: %s\n", \
                    checks, sqrt(all / checks), over3, 0.0027 * checks, worst, who
                if (bad) failed += bad; else passed++
            }
            printf "\n%d passed, %d failed\n", passed, failed
            exit failed != 0 || passed == 0
        }'
}

case ${1-} in
one | sum | seeds) "$@" ;;
*)
    echo 'usage: run.sh one LOG COMMAND... | run.sh sum LOG... | run.sh seeds FROM TO' >&2
    exit 2
    ;;
esac
