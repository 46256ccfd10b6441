#!/usr/bin/env bash
# coverage.sh: which branches of parsers, quality and save paths the unit tests and some of the programs' tests take; without those
# that exceptions make (gcov_as_written.py: nothing that a person wrote) and those of assertions. Needs gcovr, strace.
# PLAIN=1: with what exceptions make, as gcovr alone counts.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v gcovr >/dev/null || { echo "coverage.sh: apt-get install gcovr" >&2; exit 1; }
/usr/bin/python3 tests/gcov_as_written_test.py 2>/dev/null || { echo "coverage.sh: gcov_as_written_test.py fails: this compiler's gcov tells other things" >&2; exit 1; }
cmake --preset coverage >/dev/null
cmake --build --preset coverage -j "${TESTS_JOBS:-$(nproc)}" --target config_test drivers_test modbus_test shm_test threads_test node_test tactiled tactilectl follow reader_cxx17 no_memory
find build/coverage -name '*.gcda' -delete
for program in config drivers modbus shm threads node; do (cd build/coverage && ./bin/${program}_test >/dev/null); done
status=0
run() {  # FOLDER/NAME of a script, which of its tests
    local log=build/coverage/${1#*/}.log
    TACTILED_BIN=$PWD/build/coverage/bin /usr/bin/python3 "tests/${1}_test.py" "${@:2}" >"$log" 2>&1 || { echo "coverage.sh: $1 failed, see $log" >&2; status=1; }
}
for script in reload save daemon modbus_rtu modbus_hostile auto teach record; do run system/$script; done
run faults/memory NoMemory.test_a_reload_changes_all_or_nothing  # not a start: libgcov itself ends badly without memory
gcov=$PWD/tests/gcov_as_written.py
[ -z "${PLAIN:-}" ] || gcov=gcov
gcovr build/coverage/{config,drivers/CMakeFiles/drivers.dir,node/CMakeFiles/node_core.dir,node/CMakeFiles/interfaces.dir} --root . --object-directory build/coverage --gcov-executable "$gcov" --gcov-ignore-parse-errors --exclude-throw-branches --exclude-unreachable-branches --branches --sort-uncovered \
    --exclude-branches-by-pattern ".*assert\(.*" \
    --filter 'config/(options|config|calibration|problems|network_address|text_file|grasp|gpio)\.cpp' --filter 'drivers/wire/.*' \
    --filter 'node/(quality|objects|method_costs|reload)\.cpp' --filter 'node/modbus/(responder|connection|controls|controls_commands|controls_write|rtu|allow_list|teaching)\.cpp' "$@"
exit $status
