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
    local preset=$1 numbers=; shift
    stage "building in build/$preset: $*"
    [ "$preset" = release ] || numbers=$PWD/build/release
    cmake --preset "$preset" -DTACTILED_TESTS=ON -DTACTILED_NUMBERS_FROM="$numbers" >/dev/null
    # chrt --idle: a compiler runs where a test beside it leaves the processor free.
    chrt --idle 0 cmake --build --preset "$preset" -j "$jobs" --target "$@"
}
build release shipped_tests kernel_tools

# Most of the shipped programs' tests wait for what other programs do: the compiler uses that time. Scenes, faults in
# simulated time and the checks of the text give way to the tests whose daemon must be in time. A machine under QEMU,
# whose clock is its own, gives way, too: with less of a processor it takes longer and finds the same.
beside() { # LOG PREFIX... -- CTEST_OPTION...: in the background
    local log=build/$1-tests.log prefix=(); shift
    while [ "$1" != -- ]; do prefix+=("$1"); shift; done; shift
    "${prefix[@]}" ctest --test-dir build/release --no-tests=error --output-on-failure "$@" >"$log" 2>&1 &
}
beside release -- -L 'system|guard' -j $((2 * jobs)); release_tests=$!
beside other nice -n 19 -- -LE 'bytes|numbers|kernel|system|guard' -E NOT_BUILT -j "$jobs"; other_tests=$!
beside kernel chrt --idle 0 -- -L kernel; kernel_tests=$!
trap 'cat build/*-tests.log; pkill -P "$release_tests,$other_tests,$kernel_tests"; kill "$release_tests" "$other_tests" "$kernel_tests"' EXIT  # a build failed

status=0
build release number_tests
build asan sanitized_tests
build tsan node_test modbus_test
stage "the rest of the shipped programs' tests"
failed_beside=()
wait "$release_tests" || failed_beside+=(release)
wait "$other_tests" || failed_beside+=(other)
wait "$kernel_tests" || failed_beside+=(kernel)
trap - EXIT
cat build/*-tests.log
if [ ${#failed_beside[@]} != 0 ]; then
    stage "what failed beside the compilers, once more without them"
    # By name: numbers and --rerun-failed are no longer those of the list that ran.
    failed=$(for each in "${failed_beside[@]}"; do sed -n 's/^[[:space:]]*[0-9]* - \(.*\) ([A-Za-z ]*).*$/\1/p' "build/$each-tests.log"; done | paste -sd'|')
    ctest --test-dir build/release -R "^($failed)\$" -j "$jobs" --no-tests=error --output-on-failure || status=1
fi
stage "units as shipped"
ctest --test-dir build/release -L numbers -j "$jobs" --output-on-failure || status=1
stage "units under sanitizers"
ctest --test-dir build/asan -L bytes -j "$jobs" --output-on-failure || status=1
ctest --test-dir build/tsan -R '^(node|modbus)\.' -j "$jobs" --output-on-failure || status=1
stage "the end"
exit $status
