#!/usr/bin/env bash
# campaign.sh [SECONDS [TARGET...]]: builds the fuzz targets, gives each SECONDS (10) beside the corpus of the runs before, has it look
# for the bugs of targets.toml, and prints a table. Needs clang-14, libclang-rt-14-dev, llvm-14.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=${1:-10}; shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || mapfile -t targets < <(sed -n 's/^\[\(.*\)\]$/\1/p' tests/fuzz/targets.toml)
cmake --preset fuzz >/dev/null
cmake --build --preset fuzz -j "${TESTS_JOBS:-$(nproc)}" --target "${targets[@]/#/fuzz_}"
exec python3 tests/fuzz/campaign.py "$seconds" "${targets[@]}"
