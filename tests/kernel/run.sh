#!/usr/bin/env bash
# run.sh [--built] [NAME[:CLASS[.TEST]]...]...: the tests tests/kernel/NAME_test.py (all, without a name; whole, or
# the ones that are named), each in a machine of its own: Debian's kernel with CAN, I2C, GPIO and USB under QEMU, the
# daemon's release build in it. --built: packages and programs are there. TACTILED_PRESET=asan takes that build, with
# sanitizers; KERNEL_TEST="NAME=VALUE ..." is the test's environment.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd); project=$(cd "$here/../.." && pwd)
preset=${TACTILED_PRESET:-release} folder=$project/build/kernel
built=; if [ "${1:-}" = --built ]; then built=yes; shift; fi
if [ -n "$built" ] && ! command -v qemu-system-x86_64 >/dev/null; then echo "run.sh: left out: node/install-packages.sh kernel"; exit 77; fi
bin=$project/build/$preset/bin
speed=3  # speed of the machine's processor: 2^3 ns an instruction
guard=; if [ "$preset $(uname -m)" = "release x86_64" ]; then guard=rtguard; fi  # if tests/guard supports the machine
if [ "$preset" = asan ]; then  # programs of three times the size, at a third of the speed
    export MEMORY_MB=${MEMORY_MB:-1536} LIMIT_S=${LIMIT_S:-900}
    KERNEL_TEST="PATIENCE=4 ${KERNEL_TEST:-}" speed=1
fi
tools=$project/build/release/bin  # the tests' instruments and emulated devices, as fast as they can be
if [ -z "$built" ]; then
    "$project/node/install-packages.sh" build kernel
    for each in release "$preset"; do
        [ -e "$project/build/$each/CMakeCache.txt" ] || cmake --preset "$each" -S "$project" -DTACTILED_TESTS=ON >/dev/null
    done
    cmake --build "$project/build/$preset" -j "$(nproc)" --target tactiled gpio_edges $guard
    cmake --build "$project/build/release" -j "$(nproc)" --target tactilectl kernel_tools
fi

status=0
"$here/kernel.sh" "$folder/$(uname -m)" || status=$?
if [ $status = 77 ]; then
    [ -e "$folder/$(uname -m)/done" ] || { echo "run.sh: Debian's kernel is not to be had: no network, or apt-get update"; exit 77; }
    echo "run.sh: goes on with the kernel that is there"
elif [ $status != 0 ]; then
    echo "run.sh: kernel.sh failed"; exit 1
fi
folder=$folder/$(uname -m)
base=$folder/base.cpio
if [ ! -e "$base" ] || [ -n "$(find "$here"/{init,initramfs.sh,program.sh} -newer "$base")" ]; then "$here/initramfs.sh" "$folder" "$base"; fi

overlay=$(mktemp -d); trap 'rm -rf "$overlay"' EXIT
root=$overlay/project
mkdir -p "$root/build/release/bin"
tar c -C "$project" --exclude=__pycache__ tests/kernel tests/system node/python config | tar x -C "$root"  # a test beside writes into __pycache__
for program in "$bin"/{tactiled,gpio_edges} "$tools"/{tactilectl,tactilectl-lab,usbip_i2c,usbip_can,link_feeder}; do
    "$here/program.sh" "$overlay" "$program"
    mv "$overlay/usr/bin/${program##*/}" "$root/build/release/bin/"
    strip --strip-debug "$root/build/release/bin/${program##*/}"  # the whole system is in the machine's memory
done
if [ -n "$guard" ]; then
    "$here/program.sh" "$overlay" "$bin/../tests/guard/librtguard.so"
    install -D "$bin/../tests/guard/librtguard.so" "$root/build/release/tests/guard/librtguard.so"
fi

failed=()
if [ $# = 0 ]; then
    set -- $(cd "$here" && ls ./*_test.py | sed 's#^\./##; s#_test.py$##')
    # without the guard it has nothing to check; the rates are those of the shipped programs
    if [ -z "$guard" ]; then set -- $(printf '%s\n' "$@" | grep -v -e '^guard$' -e '^four_links$'); fi
fi
for wanted in "$@"; do
    name=${wanted%%:*} test=${wanted#"$name"} test=${test//:/ }
    echo "== $name"
    began=$SECONDS
    # A test's own hardware stands in its lines "# QEMU: "; HOST is a folder for the sockets to host.py.
    host=$(mktemp -d); host_pid=
    words=$(sed -n "s/^# QEMU: //p" "$here/${name}_test.py" | sed "s#HOST/#$host/#g" | tr '\n' ' ')
    clock=shift=$speed,sleep=off  # boot.sh
    case $words in
        *control.sock*) /usr/bin/python3 "$here/host.py" "$host" & host_pid=$! clock=shift=3 ;;  # the host's cable takes the host's time
        *-smp*) clock= ;;  # with it two processors would share the instructions of one
    esac
    ICOUNT=${ICOUNT-$clock} QEMU_WORDS=$words "$here/boot.sh" "$folder" "$overlay" env ${KERNEL_TEST:-} python3 "tests/kernel/${name}_test.py" -v $test || failed+=("$name")
    [ -z "$host_pid" ] || kill "$host_pid" 2>/dev/null || true
    rm -rf "$host"
    echo "== $name: $((SECONDS - began)) s"
done
[ ${#failed[@]} = 0 ] || { echo "failed: ${failed[*]}"; exit 1; }
