#!/usr/bin/env bash
# sanitizers.sh: every unit test under address and undefined-behaviour sanitizers; run.sh takes those that read bytes of others.
set -euo pipefail
cd "$(dirname "$0")/.."
jobs=${TESTS_JOBS:-$(nproc)}
cmake --preset asan -DTACTILED_TESTS=ON -DTACTILED_NUMBERS_FROM= >/dev/null
cmake --build --preset asan -j "$jobs" --target unit_tests
exec ctest --test-dir build/asan -L 'bytes|numbers' -j "$jobs" --output-on-failure
