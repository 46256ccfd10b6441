#!/usr/bin/env bash
# install-packages.sh [build] [bridges] [demo] [tests] [browser] [kernel] [packaging]: installs the Debian packages that are
# missing. If all are installed, it needs neither network nor root.
set -euo pipefail

build=(g++ cmake ninja-build pkg-config ccache libmodbus-dev libgpiod-dev libsystemd-dev libfmt-dev libcli11-dev libtomlplusplus-dev
    libeigen3-dev libceres-dev nlohmann-json3-dev libboost-dev liblz4-dev libzstd-dev zlib1g-dev libmicrohttpd-dev)
bridges=(libmosquitto-dev cyclonedds-dev cyclonedds-tools)
demo=(mbpoll python3)
tests=(git mold libgtest-dev librapidcheck-dev mbpoll python3 python3-pymodbus python3-serial-asyncio procps strace
    socat nmap tshark python3-jsonschema python3-prometheus-client
    python3-lz4 python3-zstandard python3-numpy hunspell hunspell-en-us hunspell-en-gb mosquitto mosquitto-clients openssl)
browser=(chromium chromium-driver python3-selenium)
kernel=(qemu-system-x86 busybox-static iproute2 can-utils cpio kmod python3 binutils libelf-dev make gcc xz-utils zstd)
packaging=(help2man dpkg-dev file)
# These check the format and the code by this version only, which Debian 13 no longer has; Fast DDS has
# another interface there.
[ "$(. /etc/os-release && echo "${VERSION_ID:-}")" = 13 ] || tests+=(clang-format-14 clang-tidy-14 libfastrtps-dev)
command -v node >/dev/null || tests+=(nodejs)

wanted=()

for list in "$@"; do
    declare -n packages=$list
    wanted+=("${packages[@]}")
done
missing=()
for package in "${wanted[@]}"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

if [ "$(id -u)" = 0 ]; then as_root=(); else as_root=(sudo); fi
if [ ${#as_root[@]} -gt 0 ] && ! command -v sudo >/dev/null; then
    echo "There is no sudo. As root: apt-get update && apt-get install --no-install-recommends ${missing[*]}" >&2
    exit 1
fi
echo "Installing ${missing[*]} and what they need" >&2
export DEBIAN_FRONTEND=noninteractive
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
