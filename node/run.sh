#!/usr/bin/env bash
# run.sh: installs what is missing, builds release, and shows a pick task live: a simulated gripper closes, lifts, weighs and
# sorts objects as a program commands it through Modbus, beside a recorded real skin. No hardware. Ctrl-C or q ends it.
# Without a terminal it prints a line a pick and ends after three.
#   PICKS=10 ./node/run.sh     prints lines and ends after ten
#   PORT=1512 ./node/run.sh    serves Modbus at another port
#   PICKS=1 HOLD=20 ./node/run.sh     holds the last object for 20 s
set -euo pipefail
cd "$(dirname "$0")/.."
if [ $# != 0 ]; then
    sed -n '2,/^set/s/^# \?//p' node/run.sh
    [ "$1" = --help ] || { echo "node/run.sh: it takes no arguments: \"$1\"" >&2; exit 2; }
    exit 0
fi
if ! { mkdir -p build && [ -w build ]; }; then
    echo "node/run.sh: user $(id -un) may not write to $PWD/build: make a clone of your own" >&2
    exit 1
fi

if [ -z "${TACTILED_BUILT:-}" ]; then  # set: use existing programs
    ./node/install-packages.sh build demo
    [ -e build/release/build.ninja ] || cmake --preset release -DTACTILED_TESTS=OFF >/dev/null
    cmake --build --preset release --target tactiled tactilectl tactiled-web
fi

bin=build/release/bin port=${PORT:-1502} config=config/pick.toml
mkdir -p build/demo
exec 8>build/demo/lock
if ! flock -n 8; then
    echo "node/run.sh: a demo runs in this folder already: end it first (q or Ctrl-C)" >&2
    exit 1
fi
if (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null; then
    echo "node/run.sh: another program serves port $port: end it, or choose another one: PORT=$((port + 10)) ./node/run.sh" >&2
    exit 1
fi
if [ "$port" != 1502 ]; then  # the paths of a configuration are relative to its folder
    sed -e "s/127.0.0.1:1502/127.0.0.1:$port/" -e 's|"calibration/|"../../config/calibration/|' -e 's|"\.\./build/demo/|"|' \
        config/pick.toml >build/demo/pick.toml
    config=build/demo/pick.toml
fi
# Root has /run/tactiled and a session has $XDG_RUNTIME_DIR; without either, or where others may write to /run (some
# containers), use a folder that only this user can write to, and that no other user can replace.
trusted() {
    local path
    path=$(readlink -f "$1") || return 1
    while [ -z "$(find "$path" -maxdepth 0 -perm /022)" ]; do
        [ "$path" != / ] || return 0
        path=$(dirname "$path")
    done
    return 1
}
if [ "$(id -u)" = 0 ]; then users=/run; else users=${XDG_RUNTIME_DIR:-}; fi
if [ -z "${TACTILED_RUNTIME_DIR:-}" ] && { [ -z "$users" ] || ! trusted "$users"; }; then
    export TACTILED_RUNTIME_DIR=$PWD/build/demo/run
    # 90: the address of the control socket in it has at most 107 bytes
    if { [ ${#TACTILED_RUNTIME_DIR} -gt 90 ] || ! trusted build/demo; } && mkdir -p "${HOME:=/}/.cache" 2>/dev/null && trusted "$HOME/.cache"; then
        TACTILED_RUNTIME_DIR=$HOME/.cache/tactiled-demo  # a clone in /tmp, or one that a group may write to
    fi
    printf 'In other terminals: export TACTILED_RUNTIME_DIR=%q\n' "$TACTILED_RUNTIME_DIR"
fi
status=0
"$bin/tactilectl" status >/dev/null 2>&1 || status=$?
if [ $status != 3 ]; then  # exit status 3: none runs
    echo "node/run.sh: a daemon named \"gripper\" runs already: end it first (build/release/bin/tactilectl status has its pid)" >&2
    exit 1
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
setsid "$bin/tactilectl" play --in config/demo/skin_session2.csv --pty build/demo/skin --format lines --sequence --time --crc16 \
    --speed 4 --loop 2>build/demo/play-skin.log 8>&- & children+=($!)
setsid "$bin/tactiled" --config "$config" 2>build/demo/tactiled.log 8>&- & daemon=$!
children=("$daemon" "${children[@]}")
# 3: there is no daemon of that name yet.
for _ in $(seq 100); do
    status=0; "$bin/tactilectl" status >/dev/null 2>&1 || status=$?
    [ $status != 3 ] && break
    kill -0 "$daemon" 2>/dev/null || break
    sleep 0.05
done
if ! kill -0 "$daemon" 2>/dev/null; then
    sed 's/^<[0-7]>//' build/demo/tactiled.log >&2  # without the levels of the journal
    exit 1
fi
/usr/bin/python3 node/demo/demo.py build/demo "$port"
