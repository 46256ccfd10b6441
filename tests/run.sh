#!/usr/bin/env bash
# run.sh: installs what is missing, builds, and runs every test of the ordinary run (tests/README.md names the longer ones).
#   TESTS_JOBS=4 ./tests/run.sh     more at once
set -euo pipefail
cd "$(dirname "$0")/.."
jobs=${TESTS_JOBS:-$(nproc)}
stage() { echo "run.sh: $((SECONDS / 60)) min $((SECONDS % 60)) s: $*"; }

stage packages
./node/install-packages.sh build bridges tests kernel
# Root has /run/tactiled and a session $XDG_RUNTIME_DIR; where there is neither, a folder that only this user can write to.
[ "$(id -u)" = 0 ] || [ -n "${XDG_RUNTIME_DIR:-}" ] || { mkdir -p build; export TACTILED_RUNTIME_DIR=$PWD/build/run; }
build() { # preset targets...
    local preset=$1; shift
    stage "building in build/$preset: $*"
    cmake --preset "$preset" -DTACTILED_TESTS=ON >/dev/null  # run.sh may have configured it without
    # chrt --idle: a compiler runs where a test beside it leaves the processor free.
    chrt --idle 0 cmake --build --preset "$preset" -j "$jobs" --target "$@"
}
build release shipped_tests kernel_tools

# Most of the shipped programs' tests wait for what other programs do: the compiler uses that time.
ctest --test-dir build/release -LE 'bytes|numbers|kernel' -E NOT_BUILT -j $((2 * jobs)) --output-on-failure >build/release-tests.log 2>&1 &
release_tests=$!
# A machine under QEMU with a clock of its own: with less of a processor it takes longer and finds the same.
chrt --idle 0 ctest --test-dir build/release -L kernel --no-tests=error --output-on-failure >build/kernel-tests.log 2>&1 &
kernel_tests=$!
trap 'cat build/*-tests.log; pkill -P "$release_tests,$kernel_tests"; kill "$release_tests" "$kernel_tests"' EXIT  # a build failed

status=0
build release number_tests
build asan sanitized_tests
build tsan node_test modbus_test
stage "the rest of the shipped programs' tests"
beside_compilers=0
wait "$release_tests" || beside_compilers=1
kernel_beside=0
wait "$kernel_tests" || kernel_beside=1
trap - EXIT
cat build/kernel-tests.log build/release-tests.log
if [ $beside_compilers != 0 ]; then
    echo "run.sh: what failed beside the compilers, once more with the machine to itself:"
    # By name: numbers and --rerun-failed are no longer those of the list that ran.
    failed=$(sed -n 's/^[[:space:]]*[0-9]* - \(.*\) ([A-Za-z ]*).*$/\1/p' build/release-tests.log | paste -sd'|')
    ctest --test-dir build/release -R "^($failed)\$" --no-tests=error --output-on-failure || status=1
fi
if [ $kernel_beside != 0 ]; then
    stage "tests/kernel once more, with the machine to itself"
    ctest --test-dir build/release -L kernel --no-tests=error --output-on-failure || status=1
fi
stage "units as shipped"
ctest --test-dir build/release -L numbers -j "$jobs" --output-on-failure || status=1
stage "units under sanitizers"
ctest --test-dir build/asan -L bytes -j "$jobs" --output-on-failure || status=1
ctest --test-dir build/tsan -R '^(node|modbus)\.' -j "$jobs" --output-on-failure || status=1
stage "the end"
exit $status
