#!/usr/bin/env bash
# chroot.sh: functions that make a Debian in a folder and run commands in it; build.sh sources this file.
# They need root, debootstrap and this machine's apt settings.

skip() { echo "build.sh: $*" >&2; exit 77; }  # cannot be done here, and why

# make_base SUITE BASE: a bare Debian (minbase: no compiler, no tools) in the folder BASE, made once.
make_base() {
    local suite=$1 base=$2 mirror
    [ ! -e "$base/bootstrapped" ] || return 0
    [ -e "/usr/share/debootstrap/scripts/$suite" ] || skip "this debootstrap does not know $suite"
    rm -rf "$base"
    mkdir -p "$(dirname "$base")"
    mirror=$(sed -n 's/^URIs: *//p; s/^deb \(\[[^]]*\] \)\?\(http[^ ]*\).*/\2/p' /etc/apt/sources.list.d/*.sources /etc/apt/sources.list \
        2>/dev/null | head -n 1 || true)
    mirror=${mirror:-http://deb.debian.org/debian}
    debootstrap --variant=minbase --include=ca-certificates "$suite" "$base" "$mirror" >"$base.log" 2>&1 ||
        skip "debootstrap of $suite failed, no network? $base.log"
    rm -f "$base"/etc/apt/sources.list.d/*
    echo "deb $mirror $suite main" >"$base/etc/apt/sources.list"
    cp -a /etc/apt/apt.conf.d/. "$base/etc/apt/apt.conf.d/"  # a proxy, if this machine has one
    rm -f "$base"/etc/apt/apt.conf.d/*docker*                # they delete what is downloaded
    cp -aL /usr/local/share/ca-certificates/. "$base/usr/local/share/ca-certificates/" 2>/dev/null || true
    cp /etc/resolv.conf /etc/hosts "$base/etc/"
    chroot "$base" update-ca-certificates >/dev/null 2>&1
    printf '#!/bin/sh\nexit 101\n' >"$base/usr/sbin/policy-rc.d" && chmod +x "$base/usr/sbin/policy-rc.d"
    touch "$base/bootstrapped"
}

# copy_sources TREE: copies the project as it is here into the home folder of root in TREE. Earlier builds there are kept.
copy_sources() {
    local project=$1/root/project
    mkdir -p "$project"
    find "$project" -mindepth 1 -maxdepth 1 ! -name build -exec rm -rf {} +
    tar -C "$here" --exclude=./build --exclude=./.git --exclude=./.cache -cf - . | tar -C "$project" -xf -
}

# inside TREE COMMAND...: runs it in TREE's project. The mounts end with it.
inside() {
    # shellcheck disable=SC2016
    unshare --mount --propagation private bash -c '
        tree=$1; shift
        mount --rbind /dev "$tree/dev" && mount -t tmpfs tmpfs "$tree/dev/shm" && mount -t proc proc "$tree/proc" &&
            mount --rbind /sys "$tree/sys" || exit 77
        exec env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 \
            DEBIAN_FRONTEND=noninteractive chroot "$tree" bash -c "cd /root/project && exec \"\$@\"" _ "$@"' _ "$@"
}
