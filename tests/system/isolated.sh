#!/bin/sh
# isolated.sh COMMAND...: runs it with ports, pseudo terminals and processes of its own, where root may have that. Else a daemon whose
# device is gone could open the pseudo terminal of another test, because the kernel gives its number again. Processes that COMMAND leaves
# end with it, and it ends with isolated.sh. Without COMMAND it says whether this works here.
set -e
if [ "${1:-}" = inside ]; then
    shift
    ip link set lo up
    mount --make-private /proc  # the new mounts are seen nowhere else; the root of a chroot is no mount that could be private
    mount --make-private /dev/pts
    mount -t proc proc /proc
    mount -t devpts -o newinstance,ptmxmode=0666,mode=0620,gid=5 devpts /dev/pts
    exec "$@"
fi
own="--mount --propagation unchanged --net --pid --fork --kill-child"
works=no
if [ "$(id -u)" = 0 ] && unshare $own "$0" inside sh -c 'exec 3<>/dev/ptmx' 2>/dev/null; then works=yes; fi
[ $# -gt 0 ] || { echo "each test of a program has its own ports, terminals and processes: $works"; exit 0; }
[ $works = no ] || exec unshare $own "$0" inside "$@"
exec "$@"
