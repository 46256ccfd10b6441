#!/usr/bin/env bash
# coverage.sh: which branches of parsers, quality and save paths the unit tests take; without those that only an exception takes. Needs gcovr.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v gcovr >/dev/null || { echo "coverage.sh: apt-get install gcovr" >&2; exit 1; }
cmake --preset coverage >/dev/null
cmake --build --preset coverage -j "${TESTS_JOBS:-$(nproc)}" --target config_test drivers_test modbus_test node_test
find build/coverage -name '*.gcda' -delete
for program in config drivers modbus node; do (cd build/coverage && ./bin/${program}_test >/dev/null); done
gcovr --root . --object-directory build/coverage --exclude-throw-branches --exclude-unreachable-branches --branches --sort-uncovered \
    --filter 'config/(options|config|calibration|problems|network_address|text_file|grasp|gpio)\.cpp' --filter 'drivers/wire/.*' \
    --filter 'node/(quality|objects|method_costs|reload)\.cpp' --filter 'node/modbus/(responder|connection|controls|controls_write|rtu|allow_list|teaching)\.cpp' "$@"
