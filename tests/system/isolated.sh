#!/bin/sh
# isolated.sh COMMAND...: runs it with ports and pseudo terminals of its own, where root may have that. Else a daemon whose device is
# gone could open the pseudo terminal of another test, because the kernel gives its number again.
set -e
if [ "${1:-}" = inside ]; then
    shift
    ip link set lo up
    mount -t devpts -o newinstance,ptmxmode=0666,mode=0620,gid=5 devpts /dev/pts
    exec "$@"
fi
if [ "$(id -u)" = 0 ] && unshare --mount --net "$0" inside sh -c 'exec 3<>/dev/ptmx' 2>/dev/null; then
    exec unshare --mount --net "$0" inside "$@"
fi
exec "$@"
