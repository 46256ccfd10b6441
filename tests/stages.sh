# shellcheck shell=bash
# Functions of run.sh: stages with their durations, work beside the tests of programs, results.
mkdir -p build
exec 9>build/run.lock
flock -n 9 || { echo "run.sh: another run works in this folder" >&2; exit 1; }
rm -f build/last-run build/failed-tests build/*-tests.xml
commit=unknown
look_up_commit() { # once git is installed
    commit=$(git rev-parse HEAD || echo unknown)
    [ -z "$(git status --porcelain)" ] || commit+=+changes
}
load() { cut -d' ' -f1-3 /proc/loadavg; }
began=$(date -u +%FT%TZ) load_at_begin=$(load) durations=() stage_began=0 stage_name='' beside='' running='' result='' own_session=setsid

stage() { # NAME: ends the stage before
    [ -z "$stage_name" ] || durations+=("$((SECONDS - stage_began)) s $stage_name")
    stage_name=$1 stage_began=$SECONDS
    echo "run.sh: $((SECONDS / 60)) min $((SECONDS % 60)) s: $1"
}

# Runs commands that take only what the tests of programs leave of the processor: a task of SCHED_IDLE gives way whenever another
# one wakes up. This holds among tasks of one group. Linux makes each session a group (autogroup), in which a compiler delays the
# kernel thread that carries the bytes of a pseudo terminal by up to 200 ms. Root therefore turns autogroup off for this run. Without
# that right the commands run first, alone. One run at a time
# has the machine, because both would set autogroup; a run in another container is not seen.
autogroup=/proc/sys/kernel/sched_autogroup_enabled
if [ -w $autogroup ]; then
    exec 8<$autogroup
    flock -n 8 || { echo "run.sh: waits for another run on this machine"; flock 8; }
fi
autogroup_before=$(cat $autogroup 2>/dev/null || echo 0)
aside() { # COMMANDS
    export -f build tests load
    export jobs commit
    if [ "$autogroup_before" != 0 ] && ! { echo 0 >$autogroup; } 2>/dev/null; then
        eval "$1"
        return
    fi
    setsid chrt --idle 0 bash -euo pipefail -c "$1" >build/beside.log 2>&1 &
    beside=$!
}
wait_for_aside() {
    local pid
    [ -n "$beside" ] || return 0
    for _ in 1 2 3; do  # the tests of programs have ended; several times, because a process may start another one meanwhile
        for pid in $(pgrep -s "$beside"); do chrt --all-tasks --other -p 0 "$pid" 2>/dev/null || true; done
    done
    aside_ended
}
aside_ended() {
    local status=0
    wait "$beside" || status=$?
    beside=''
    cat build/beside.log
    [ $status = 0 ] || { echo "run.sh: the work beside the tests failed, see above" >&2; exit 1; }
}
end() {
    local session
    for session in $beside $running; do pkill -KILL -s "$session" || true; done  # compilers have groups of their own, tests ignore TERM
    [ "$autogroup_before" = 0 ] || { echo "$autogroup_before" >$autogroup; } 2>/dev/null || true
    [ -n "$result" ] || finish aborted
}
trap end EXIT
trap 'exit 143' TERM INT HUP

tests() { # NAME PRESET CTEST_OPTION...: once; what fails is kept with the commit and the load
    local results=$PWD/build/$1-tests.xml status=0
    ${own_session:-} ctest --test-dir "build/$2" --no-tests=error --output-on-failure --output-junit "$results" \
        --test-output-size-passed 1000000 "${@:3}" 8>&- 9>&- &
    running=$!
    if [ -n "${beside:-}" ]; then  # a build that fails ends the run at once
        wait -n $running "$beside" || true
        kill -0 "$beside" 2>/dev/null || aside_ended
    fi
    wait $running || status=$?
    running=''
    [ $status = 0 ] || tests/ledger.py failed "$results" "$commit" "$(load)" "$1: ctest ended with $status" | tee -a tests/failed.tsv >>build/failed-tests
}

finish() { # [aborted]: prints and writes the result, and exits
    stage end
    times >build/times  # here and not in a pipe: a subshell has times of its own
    result=passed
    [ ! -s build/failed-tests ] || result=failed
    [ "${1:-}" != aborted ] || result=aborted
    {
        echo "commit $commit"
        echo "result $result"
        echo "began $began, load $load_at_begin; ended $(date -u +%FT%TZ), load $(load)"
        echo "tests $(find build -maxdepth 1 -name "*-tests.xml" | sort | xargs -r tests/ledger.py count)"
        echo "processor time $(tail -n 1 build/times)"
        printf '%s\n' "${durations[@]}"
    } | tee build/last-run
    if [ -s build/failed-tests ]; then
        find build -maxdepth 1 -name "*-tests.xml" | sort | xargs -r tests/ledger.py why || true
        echo "These tests failed. tests/failed.tsv has them now; commit it. tests/README.md says what follows:"
        cat build/failed-tests
    fi
    [ $result = passed ] || exit 1
    exit 0
}
