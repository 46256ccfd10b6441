#!/usr/bin/env bash
# sanitizers.sh [asan|tsan]...: every unit test under a sanitizer; run.sh takes those that read bytes of others or share memory.
set -euo pipefail
cd "$(dirname "$0")/.."
jobs=${TESTS_JOBS:-$(nproc)}
[ $# != 0 ] || set -- asan tsan
for preset in "$@"; do
    cmake --preset "$preset" -DTACTILED_TESTS=ON >/dev/null
    cmake --build --preset "$preset" -j "$jobs" --target unit_tests
    ctest --test-dir "build/$preset" -L unit -j "$jobs" --output-on-failure
done
