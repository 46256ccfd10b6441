#!/usr/bin/env bash
# run.sh: installs what is missing, builds with warnings as errors, and runs every test of the ordinary run once. Any failure fails
# the run. tests/README.md names the longer runs. The result is in build/last-run, and failures also in build/failed-tests.
#   TESTS_JOBS=4 ./tests/run.sh     more compilers and computing tests at once
set -euo pipefail
cd "$(dirname "$0")/.."
jobs=${TESTS_JOBS:-$(nproc)}
. tests/stages.sh

stage packages
./node/install-packages.sh build bridges tests kernel
look_up_commit
# Root has /run/tactiled and a session $XDG_RUNTIME_DIR; where there is neither, a folder that only this user can write to.
[ "$(id -u)" = 0 ] || [ -n "${XDG_RUNTIME_DIR:-}" ] || { mkdir -p build; export TACTILED_RUNTIME_DIR=$PWD/build/run; }

stage "build the programs"
for preset in release asan tsan; do cmake --preset "$preset" -DTACTILED_TESTS=ON -DTACTILED_WERROR=ON -DTACTILED_MOLD=ON >/dev/null; done
build() { cmake --build --preset "$1" -j "$jobs" --target "$2"; }
build release system_tests

# Tests of the programs wait for most of their time, and their daemons must be in time. Compilers and tests that only compute
# take the rest of the processor.
stage "the programs' tests, and beside them all that computes"
aside 'build release computing_tests
    tests computing release -LE "system|unit|figures" -j "$jobs"
    build release shipped_unit_tests
    build asan address_unit_tests
    build tsan thread_unit_tests
    tests shipped release -L shipped -j "$jobs"'
tests/system/isolated.sh
tests programs release -L system -j 5
stage "the rest of it"
wait_for_aside

stage "unit tests that wait"
tests address asan -L address -j "$((2 * jobs))"
tests thread tsan -L thread -j "$((2 * jobs))"
finish
