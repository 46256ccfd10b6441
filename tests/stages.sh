# Functions of run.sh: stages with their durations, work beside the tests of programs, results.
mkdir -p build
rm -f build/last-run build/failed-tests build/*-tests.log build/*-output.log
commit=$(git rev-parse HEAD 2>/dev/null || echo unknown)
[ -z "$(git status --porcelain 2>/dev/null)" ] || commit+=+changes
load() { cut -d' ' -f1-3 /proc/loadavg; }
began=$(date -u +%FT%TZ) load_at_begin=$(load) durations=() stage_began=0 stage_name= beside=

stage() { # NAME: ends the stage before
    [ -z "$stage_name" ] || durations+=("$((SECONDS - stage_began)) s $stage_name")
    stage_name=$1 stage_began=$SECONDS
    echo "run.sh: $((SECONDS / 60)) min $((SECONDS % 60)) s: $1"
}

# Runs commands in the background, in a session of their own with the least weight. Linux divides the processor between sessions
# before it looks at nice values (autogroup), and a kernel thread of ordinary weight carries the bytes of a pseudo terminal: a
# compiler in the session of a test delays them by 100 ms and more.
aside() { # COMMANDS
    export -f build tests load
    export jobs commit
    setsid bash -euo pipefail -c "
        { echo 19 >/proc/self/autogroup || renice -n 19 \$\$; } >/dev/null 2>&1
        $1" >build/beside.log 2>&1 &
    beside=$!
    trap 'kill -- "-$beside" 2>/dev/null || true; finish aborted' EXIT
}
wait_for_aside() {
    { echo 0 >"/proc/$beside/autogroup"; } 2>/dev/null || true  # nothing needs to be in time any more; only root may
    local status=0
    wait "$beside" || status=$?
    trap 'finish aborted' EXIT
    cat build/beside.log
    [ $status = 0 ] || [ -s build/failed-tests ] || { echo "run.sh: a build failed" >&2; exit 1; }
}

tests() { # LOG PRESET CTEST_OPTION...: once; what fails is kept with the commit and the load
    local log=build/$1-tests.log preset=$2 status=0; shift 2
    ctest --test-dir "build/$preset" --no-tests=error --output-on-failure "$@" >"$log" 2>&1 || status=$?
    cat "$log"
    cp "build/$preset/Testing/Temporary/LastTest.log" "${log%-tests.log}-output.log"
    [ $status = 0 ] || tests/ledger.py failed "${log%-tests.log}-output.log" "$commit" "$(load)" >>build/failed-tests
    return $status
}

finish() { # [aborted]: prints and writes the result, and exits
    trap - EXIT
    stage end
    local result=passed counts
    [ ! -s build/failed-tests ] || result=failed
    [ "${1:-}" != aborted ] || result=aborted
    counts=$(tests/ledger.py count build/*-output.log)
    {
        echo "commit $commit"
        echo "result $result"
        echo "began $began, load $load_at_begin; ended $(date -u +%FT%TZ), load $(load)"
        echo "tests $counts"
        echo "processor time of this run: $(times | tail -n 1)"
        printf '%s\n' "${durations[@]}"
    } | tee build/last-run
    if [ -s build/failed-tests ]; then
        echo "These tests failed. Add the lines to tests/failed.tsv; tests/README.md says what follows:"
        cat build/failed-tests
    fi
    [ $result = passed ] || exit 1
    exit 0
}
