#!/usr/bin/env bash
# fetch_npm.sh: puts the packages that are pinned in package-lock.json, into build/npm/node_modules. Uses npm if it is
# installed, else python3, because Debian's nodejs comes without npm. Exit status: 0 the packages are there, 75 the
# registry cannot be reached, else 1 (for instance a wrong checksum).
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
target=$(cd "$here/../../.." && pwd)/build/npm
modules=$target/node_modules

if [ -d "$modules/jsmodbus" ] && [ -d "$modules/modbus-serial" ] && [ -d "$modules/@mcap/core" ] && [ -d "$modules/@foxglove/rosmsg" ] &&
    cmp -s "$here/package-lock.json" "$target/package-lock.json"; then
    exit 0
fi
rm -rf "$target"
mkdir -p "$target"
if ! command -v npm >/dev/null; then
    exec python3 "$here/fetch_npm.py" "$target"
fi

cp "$here/package.json" "$here/package-lock.json" "$target"
cd "$target"
limits=(--fetch-retries=1 --fetch-timeout=20000)  # ms
if npm ci --omit=optional --ignore-scripts --no-audit --no-fund "${limits[@]}" >npm.log 2>&1; then
    exit 0
fi
cat npm.log >&2
rm -rf "$modules"
no_network='ENOTFOUND|EAI_AGAIN|ECONN|ETIMEDOUT|ENETUNREACH|EHOSTUNREACH|ERR_SOCKET_TIMEOUT|network timeout'
grep -Eq "$no_network" npm.log && exit 75
exit 1
