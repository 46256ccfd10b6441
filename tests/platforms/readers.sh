#!/usr/bin/env bash
# readers.sh BIN [EMULATOR]: the readers in C and C++17 follow a daemon that plays a recording, all four programs from the folder
# BIN and through EMULATOR (qemu-aarch64-static). It uses the demo's names: build/demo and node "gripper", with the segment in build/demo/run.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=$1 run=${2:-}
mkdir -p build/demo
export TACTILED_RUNTIME_DIR=$PWD/build/demo/run
children=()
trap 'kill "${children[@]}" 2>/dev/null || true; wait' EXIT
for link in skin table; do
    case $link in
        skin) words=(--in config/demo/skin_session2.csv --format lines --sequence --checksum --speed 4) ;;
        table) words=(--in config/demo/table_demo.csv --format cobs --bits 32 --counts-per-unit 1e9) ;;
    esac
    $run "$bin/tactilectl-lab" play --pty "build/demo/$link" --loop "${words[@]}" 2>"build/demo/play-$link.log" & children+=($!)
done
for _ in $(seq 200); do [ -e build/demo/skin ] && [ -e build/demo/table ] && break; sleep 0.1; done
$run "$bin/tactiled" --config config/demo.toml 2>build/demo/tactiled.log & children=($! "${children[@]}")
for _ in $(seq 200); do [ -e "$TACTILED_RUNTIME_DIR/tactiled.gripper" ] && break; sleep 0.1; done
status=0
samples=$($run "$bin/follow" gripper skin 10 | wc -l) || status=1
echo "follow (C11): $samples samples"
[ "$samples" -gt 100 ] || status=1
echo "reader_cxx17: $($run "$bin/reader_cxx17" gripper skin 10 | tail -n 1)" || status=1
[ $status = 0 ] || cat build/demo/tactiled.log
exit $status
