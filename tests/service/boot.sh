#!/usr/bin/env bash
# boot.sh TREE: systemd as process 1 over the Debian in TREE, in namespaces of its own (mounts, processes, network, cgroups).
# Runs until it is killed; nothing of it is left then.
set -euo pipefail
tree=$1 cgroup=tactiled-service-test
hierarchies=()
if [ "$(stat -fc %T /sys/fs/cgroup)" = cgroup2fs ]; then
    folders=(/sys/fs/cgroup)
else  # version 1: no cpu controller, which would refuse SCHED_FIFO
    folders=(/sys/fs/cgroup/systemd /sys/fs/cgroup/devices)
    hierarchies=(systemd devices)
fi
for folder in "${folders[@]}"; do
    mkdir -p "$folder/$cgroup"
    echo $$ >"$folder/$cgroup/cgroup.procs"
done
exec unshare --pid --mount --net --uts --ipc --cgroup --fork --kill-child --propagation private bash -c '
    set -e; tree=$1; shift
    mount --bind "$tree" "$tree"; cd "$tree"
    mount -t proc proc proc; mount -t sysfs -o ro sysfs sys
    mount -t tmpfs -o mode=755 tmpfs run; mount -t tmpfs tmpfs tmp
    if [ $# = 0 ]; then
        mount -t cgroup2 cgroup2 sys/fs/cgroup
    else
        mount -t tmpfs tmpfs sys/fs/cgroup
        for hierarchy; do
            mkdir sys/fs/cgroup/$hierarchy
            option=$hierarchy; [ $hierarchy != systemd ] || option=none,name=systemd
            mount -t cgroup -o $option cgroup sys/fs/cgroup/$hierarchy
        done
    fi
    mount -t tmpfs -o mode=755 tmpfs dev
    mkdir dev/shm dev/pts; mount -t tmpfs -o mode=1777 tmpfs dev/shm; mount -t devpts -o newinstance,ptmxmode=666 devpts dev/pts
    ln -s pts/ptmx dev/ptmx; ln -s /proc/self/fd dev/fd
    for node in "null c 1 3" "zero c 1 5" "full c 1 7" "random c 1 8" "urandom c 1 9" "tty c 5 0"; do mknod -m 666 dev/$node; done
    mknod -m 666 dev/kmsg c 1 11; mknod -m 666 dev/mem c 1 1; mknod -m 666 dev/disk b $(stat -c "0x%t 0x%T" "$(findmnt -no SOURCE / | grep ^/dev || echo /dev/loop0)" | (read major minor; echo $((major)) $((minor))))
    [ ! -c /dev/ttyS0 ] || { mknod -m 660 dev/ttyS0 c 4 64; chroot . chown root:dialout /dev/ttyS0; }
    ip link set lo up
    mkdir -p old; pivot_root . old; umount -l /old; rmdir /old
    exec env -i container=tactiled-test PATH=/usr/sbin:/usr/bin:/sbin:/bin /lib/systemd/systemd --unit=multi-user.target --show-status=0
' _ "$tree" "${hierarchies[@]}"
