#!/bin/sh
# isolated.sh COMMAND...: runs it with ports, pseudo terminals and processes of its own, where root may have that. Else a daemon whose
# device is gone could open the pseudo terminal of another test, because the kernel gives its number again. Processes that COMMAND leaves
# end with it, and it ends with isolated.sh.
set -e
if [ "${1:-}" = inside ]; then
    shift
    ip link set lo up
    mount -t proc proc /proc
    mount -t devpts -o newinstance,ptmxmode=0666,mode=0620,gid=5 devpts /dev/pts
    exec "$@"
fi
isolate="unshare --mount --net --pid --fork --kill-child $0 inside"
if [ "$(id -u)" = 0 ] && $isolate sh -c 'exec 3<>/dev/ptmx' 2>/dev/null; then
    exec $isolate "$@"
fi
exec "$@"
