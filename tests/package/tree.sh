#!/usr/bin/env bash
# tree.sh TREE PACKAGES: a fresh Debian 12 in the folder TREE with these packages (a comma-separated list, "" = none) and
# nothing else, and the packages under test, not yet installed, in its /srv/deb. Debian's part is made once, in base beside TREE.
# Needs root, debootstrap and this machine's apt settings. Exit status 77: cannot be done here, and why.
set -euo pipefail
tree=$1 packages=$2
here=$(cd "$(dirname "$0")/../.." && pwd)
no() { echo "tree.sh: $*" >&2; exit 77; }
[ "$(id -u)" = 0 ] || no "needs root: it makes a Debian and changes into it"
command -v debootstrap >/dev/null || no "debootstrap is missing: apt install debootstrap"
ls "$here"/build/release/deb/tactiled_*.deb >/dev/null 2>&1 || no "no packages: cmake --build --preset release --target deb"

base=$(dirname "$tree")/base
if [ ! -e "$base/bootstrapped" ]; then
    rm -rf "$base"
    mirror=$(sed -n 's/^URIs: *//p; s/^deb \(\[[^]]*\] \)\?\(http[^ ]*\).*/\2/p' /etc/apt/sources.list.d/*.sources /etc/apt/sources.list \
        2>/dev/null | head -n 1 || true)
    debootstrap --variant=minbase --include=ca-certificates bookworm "$base" "${mirror:-http://deb.debian.org/debian}" >"$base.log" 2>&1 ||
        no "debootstrap failed, no network? $base.log"
    cp -a /etc/apt/apt.conf.d/. "$base/etc/apt/apt.conf.d/"  # a proxy, if this machine has one
    cp -aL /usr/local/share/ca-certificates/. "$base/usr/local/share/ca-certificates/" 2>/dev/null || true
    cp /etc/resolv.conf /etc/hosts "$base/etc/"
    chroot "$base" update-ca-certificates >/dev/null 2>&1
    printf '#!/bin/sh\nexit 101\n' >"$base/usr/sbin/policy-rc.d" && chmod +x "$base/usr/sbin/policy-rc.d"
    touch "$base/bootstrapped"
fi
if [ ! -e "$base/downloaded" ]; then  # once, so that the trees need no network
    mkdir -p "$base/srv/deb" && cp "$here"/build/release/deb/*.deb "$base/srv/deb/"
    chroot "$base" bash -c 'apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
        --download-only /srv/deb/*.deb systemd systemd-sysv dbus udev i2c-tools strace python3' >>"$base.log" 2>&1 ||
        no "downloading failed, no network? $base.log"
    rm -rf "$base/srv/deb"
    touch "$base/downloaded"
fi
rm -rf "$tree" && cp -a "$base" "$tree"
mkdir -p "$tree/srv/deb" && cp "$here"/build/release/deb/*.deb "$tree/srv/deb/"
[ -z "$packages" ] || chroot "$tree" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends ${packages//,/ } \
    >"$tree.log" 2>&1
