#!/usr/bin/env bash
# run.sh: installs what is missing, builds release, and shows a pick task live: a simulated gripper closes, lifts, weighs and
# sorts objects as a program commands it through Modbus, beside a recorded real skin. No hardware. Ctrl-C or q ends it.
# Without a terminal it prints a line a pick and ends after three.
#   PICKS=10 ./node/run.sh     prints lines and ends after ten
set -euo pipefail
cd "$(dirname "$0")/.."

if [ -z "${TACTILED_BUILT:-}" ]; then  # set: use existing programs
    ./node/install-packages.sh build demo
    [ -e build/release/build.ninja ] || cmake --preset release -DTACTILED_TESTS=OFF >/dev/null
    cmake --build --preset release --target tactiled tactilectl tactiled-web
fi

bin=build/release/bin
mkdir -p build/demo
# Root has /run/tactiled and a session has $XDG_RUNTIME_DIR; without either, use a folder that only this user can
# write to.
if [ "$(id -u)" != 0 ] && [ -z "${XDG_RUNTIME_DIR:-}" ] && [ -z "${TACTILED_RUNTIME_DIR:-}" ]; then
    export TACTILED_RUNTIME_DIR=$PWD/build/demo/run
    echo "In other terminals: export TACTILED_RUNTIME_DIR=$TACTILED_RUNTIME_DIR"
fi
children=()
end() {
    trap - INT TERM EXIT
    for child in "${children[@]}"; do  # the daemon first
        kill -TERM "$child" 2>/dev/null && wait "$child" || true
    done
    rm -f build/demo/left build/demo/right
}
trap end EXIT
trap 'exit 0' INT TERM
rm -f build/demo/left build/demo/right

# In a terminal Ctrl-C reaches every process: end() stops player and daemon instead, in order.
setsid "$bin/tactilectl" play --in config/demo/skin_session2.csv --pty build/demo/skin --format lines --sequence --crc16 \
    --speed 4 --loop 2>build/demo/play-skin.log & children+=($!)
setsid "$bin/tactiled" --config config/pick.toml 2>build/demo/tactiled.log & daemon=$!
children=("$daemon" "${children[@]}")
# 3: there is no daemon of that name yet.
for _ in $(seq 100); do
    status=0; "$bin/tactilectl" status >/dev/null 2>&1 || status=$?
    [ $status != 3 ] && break
    kill -0 "$daemon" 2>/dev/null || break
    sleep 0.05
done
if ! kill -0 "$daemon" 2>/dev/null; then cat build/demo/tactiled.log; exit 1; fi
/usr/bin/python3 node/demo/demo.py build/demo 1502 ${PICKS:-}
