#!/usr/bin/env bash
# build.sh [debian12|debian13|arm64|clang|readme12|readme13]...: builds the project where its users build it, with warnings as
# errors, in chroots that it makes in build/platforms. Without arguments: the first four.
#   debian12, debian13   everything with the g++ of that Debian; the unit tests run
#   arm64                everything cross-built in a Debian 12; the readers and the unit tests run under qemu-user
#   clang                everything with clang 14 of Debian 12
#   readme12, readme13   both commands of the main page in a bare Debian: ./node/run.sh and ./tests/run.sh
# A chroot keeps its packages and what it built for the next time; build.sh --clean deletes them all.
# Exit status: 0 all is well, 1 something failed, 77 it cannot run here. Needs root, debootstrap, the network; JOBS=n compilers at once.
set -euo pipefail
here=$(cd "$(dirname "$0")/../.." && pwd)
root=$here/build/platforms
jobs=${JOBS:-$(nproc)}
# shellcheck source=tests/platforms/chroot.sh
. "$here/tests/platforms/chroot.sh"

if [ "${1:-}" = --clean ]; then rm -rf --one-file-system "$root"; exit 0; fi
[ "$(id -u)" = 0 ] || skip "needs root: it makes a Debian and changes into it"
command -v debootstrap >/dev/null || skip "debootstrap is missing: apt install debootstrap"
unshare --mount true 2>/dev/null || skip "this machine allows no mount namespace"

say() { echo "build.sh: $((SECONDS / 60)) min $((SECONDS % 60)) s: $*"; }
unit='^(config|drivers|sim|decoupling|grasp|modbus|shm|threads|node|bridges|lab)\.'

# prepare SUITE TREE LIST PACKAGE...: TREE, made once, with a list of install-packages.sh (or "") and these packages.
prepare() {
    local suite=$1 tree=$2 list=$3; shift 3
    make_base "$suite" "$root/$suite.base"
    if [ ! -e "$tree/copied" ]; then
        rm -rf --one-file-system "$tree"
        cp -a "$root/$suite.base" "$tree"
        case $* in *:arm64*) chroot "$tree" dpkg --add-architecture arm64 ;; esac
        touch "$tree/copied"
    fi
    copy_sources "$tree"
    # shellcheck disable=SC2086
    { inside "$tree" ./node/install-packages.sh $list && inside "$tree" apt-get update -qq &&
        inside "$tree" apt-get install -y -qq --no-install-recommends "$@"; } >"$tree.log" 2>&1 ||
        skip "installing packages failed, no network? $tree.log"
}

# build TREE CMAKE_OPTION...: everything, release, warnings are errors.
build() {
    local tree=$1 failed=0; shift
    inside "$tree" cmake --preset release -DTACTILED_WERROR=ON -DTACTILED_TESTS=ON "$@" >>"$tree.log" 2>&1 || failed=1
    [ "$failed" = 1 ] || inside "$tree" cmake --build --preset release -j "$jobs" -- -k 0 >>"$tree.log" 2>&1 || failed=1
    [ "$failed" = 0 ] || grep -E 'error:|Error' "$tree.log" | sort | uniq -c | head -20
    return "$failed"
}

# units TREE [EXCEPT]: the unit tests, counted, without those whose name matches EXCEPT.
units() {
    inside "$1" env GTEST_FILTER="${2:-*}" ctest --test-dir build/release -R "$unit" -j "$jobs" >"$1.tests.log" 2>&1 || true
    sed -n '/tests passed\|The following tests FAILED/,$p' "$1.tests.log"
    grep -q '^100% tests passed' "$1.tests.log"
}

native() { # SUITE TREE
    prepare "$1" "$root/$2" build libgtest-dev librapidcheck-dev python3
    say "$2: building"
    build "$root/$2"
    say "$2: unit tests"
    units "$root/$2"
}
debian12() { native bookworm debian12; }
debian13() { native trixie debian13; }

clang() {
    prepare bookworm "$root/clang" build libgtest-dev librapidcheck-dev python3 clang-14
    say "clang: building"
    build "$root/clang" -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14
}

# Packages for the processor come from Debian for arm64, the headers and tools from Debian for this machine.
arm64() {
    local tree=$root/arm64
    prepare bookworm "$tree" "" crossbuild-essential-arm64 cmake ninja-build pkg-config ccache python3 qemu-user-static \
        libcli11-dev libeigen3-dev nlohmann-json3-dev \
        {libmodbus,libgpiod,libsystemd,libfmt,libtomlplusplus,libboost,libceres,libgtest,librapidcheck,zlib1g}-dev:arm64
    inside "$tree" mkdir -p build
    inside "$tree" aarch64-linux-gnu-gcc -D_GNU_SOURCE -Wall -Wextra -O2 -shared -fPIC tests/platforms/termios2.c -o build/termios2.so
    say "arm64: building"
    build "$tree" -DCMAKE_TOOLCHAIN_FILE=tests/platforms/arm64.cmake
    say "arm64: readers and unit tests under qemu-user"
    local failed=0
    inside "$tree" tests/platforms/readers.sh build/release/bin "qemu-aarch64-static -E LD_PRELOAD=/root/project/build/termios2.so" || failed=1
    # The simulator's longest comparisons take 20 minutes each through the emulator.
    units "$tree" '-Parts.*:Effects.*:Levels.*:Extent.*' || failed=1
    return "$failed"
}

readme() { # SUITE TREE
    make_base "$1" "$root/$1.base"
    rm -rf --one-file-system "${root:?}/$2"
    cp -a "$root/$1.base" "$root/$2"
    copy_sources "$root/$2"
    local failed=0
    say "$2: PICKS=2 ./node/run.sh"
    inside "$root/$2" env PICKS=2 ./node/run.sh >"$root/$2.demo.log" 2>&1 || failed=1
    say "$2: ./tests/run.sh"
    inside "$root/$2" ./tests/run.sh >"$root/$2.tests.log" 2>&1 || failed=1
    grep -E '^run.sh:|tests passed|Failed|warning:' "$root/$2.tests.log" || true
    return "$failed"
}
readme12() { readme bookworm readme12; }
readme13() { readme trixie readme13; }

if [ "${1:-}" = --one ]; then "$2"; exit; fi
[ $# -gt 0 ] || set -- debian12 debian13 arm64 clang
for what in "$@"; do
    case $what in debian12 | debian13 | arm64 | clang | readme12 | readme13) ;; *) echo "build.sh: unknown: $what" >&2; exit 2 ;; esac
done
worst=0
for what in "$@"; do
    status=0
    "$0" --one "$what" || status=$?  # a shell of its own, which ends at the first command that fails
    case $status in
        0) say "$what: passed" ;;
        77) say "$what: left out"; [ $worst != 0 ] || worst=77 ;;
        *) say "$what: FAILED: $root/$what*.log"; worst=1 ;;
    esac
done
exit $worst
