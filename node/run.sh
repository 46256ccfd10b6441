#!/usr/bin/env bash
# run.sh: installs what is missing, builds release, and runs the daemon with config/demo.toml. No hardware: two recorded
# sensors are played into ptys, which the daemon opens as it would open a serial port. Ctrl-C ends it.
#   SECONDS_TO_RUN=10 ./node/run.sh     ends by itself
set -euo pipefail
cd "$(dirname "$0")/.."

./node/install-packages.sh build demo
[ -e build/release/build.ninja ] || cmake --preset release -DTACTILED_TESTS=OFF >/dev/null
cmake --build --preset release --target tactiled tactilectl tactiled-web

bin=build/release/bin
mkdir -p build/demo
children=()
end() {
    trap - INT TERM EXIT
    for child in "${children[@]}"; do  # the daemon first
        kill -TERM "$child" 2>/dev/null && wait "$child" || true
    done
}
trap end EXIT
trap 'exit 0' INT TERM

# In a terminal Ctrl-C reaches every process: the players and the daemon are told by end() instead, in order.
setsid "$bin/tactilectl" play --in config/demo/skin_session2.csv --pty build/demo/skin --format lines --sequence --checksum \
    --speed 4 --loop 2>build/demo/play-skin.log & children+=($!)
setsid "$bin/tactilectl" play --in config/demo/table_demo.csv --pty build/demo/table --format cobs --bits 32 \
    --counts-per-unit 1e9 --loop 2>build/demo/play-table.log & children+=($!)
for _ in $(seq 100); do [ -e build/demo/skin ] && [ -e build/demo/table ] && break; sleep 0.05; done
setsid "$bin/tactiled" --config config/demo.toml 2>build/demo/tactiled.log & daemon=$!
children=("$daemon" "${children[@]}")
# 3: there is no daemon of that name yet
for _ in $(seq 100); do
    status=0; "$bin/tactilectl" status >/dev/null 2>&1 || status=$?
    [ $status != 3 ] && break
    kill -0 "$daemon" 2>/dev/null || break
    sleep 0.05
done
if ! kill -0 "$daemon" 2>/dev/null; then cat build/demo/tactiled.log; exit 1; fi

cat <<'EOF'
The daemon runs; its log is build/demo/tactiled.log. From another terminal:
    build/release/bin/tactilectl read skin --follow          forces from shared memory
    mbpoll -m tcp -p 1502 -t 3:hex -0 -r 0 -c 32 -1 127.0.0.1    the global block, as a PLC reads it
    build/release/bin/tactilectl map                         what each register means
EOF
sleep 1
if [ -n "${SECONDS_TO_RUN:-}" ]; then
    "$bin/tactilectl" top --count "$((SECONDS_TO_RUN * 2))" --interval 0.5 || true
else
    "$bin/tactilectl" top --interval 0.2 || true
fi
