#!/bin/sh
# Runs a test program, or adds up the counts of several.
#
#   sh tests/run.sh one LOG COMMAND...
#       Runs the command with its output going to LOG and shows the output when the command has ended. Always
#       succeeds: the verdict is in LOG.
#   sh tests/run.sh sum LOG...
#       Prints one line for each log, the checks that failed, and 'N passed, N failed'; succeeds if nothing
#       failed.
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
        /^[a-z_]+: [0-9]+ passed, [0-9]+ failed$/ { counted = 1; p = $2; f = $4; next }
        /FAIL/ { bad[++bads] = name ": " $0 }
        END {
            close_log()
            if (bads) printf "\n"
            for (i = 1; i <= bads; i++) print bad[i]
            printf "\n%d passed, %d failed\n", passed, failed
            exit failed != 0 || passed == 0
        }'
}

case ${1-} in
one | sum) "$@" ;;
*)
    echo 'usage: run.sh one LOG COMMAND... | run.sh sum LOG...' >&2
    exit 2
    ;;
esac
