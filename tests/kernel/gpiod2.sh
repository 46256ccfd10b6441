#!/usr/bin/env bash
# gpiod2.sh [NAME...]: the tests of run.sh (gpio, unless named) with libgpiod 2, which Debian 12 has as a backport only: it is fetched and
# unpacked into build/, nothing is installed. Another build of the programs, build/gpiod2, is linked against it.
set -euo pipefail
project=$(cd "$(dirname "$0")/../.." && pwd); folder=$project/build/gpiod2-debian
pc=$folder/usr/lib/$(uname -m)-linux-gnu/pkgconfig
if [ ! -e "$pc/libgpiod.pc" ]; then
    mkdir -p "$folder"/{state/lists/partial,cache/archives/partial,packages}; cd "$folder"
    suite=$(. /etc/os-release; echo "$VERSION_CODENAME")-backports
    echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian $suite main" >sources.list
    # apt with lists and archives of its own: the machine's stay as they are
    apt=(apt-get -q -o "Dir::State=$folder/state" -o Dir::State::status=/dev/null -o "Dir::Cache=$folder/cache" -o "Dir::Etc::SourceList=$folder/sources.list"
         -o Dir::Etc::SourceParts=- -o APT::Sandbox::User=root)
    "${apt[@]}" update
    (cd packages && "${apt[@]}" download libgpiod3 libgpiod-dev)
    for package in packages/*.deb; do dpkg -x "$package" .; done
    sed -i "s#^prefix=.*#prefix=$folder/usr#" "$pc/libgpiod.pc"
    rm -rf state cache packages
fi
cd "$project"
[ -e build/gpiod2/CMakeCache.txt ] || PKG_CONFIG_PATH=$pc cmake --preset release -B build/gpiod2 -DTACTILED_TESTS=ON >/dev/null
grep '^GPIOD_VERSION' build/gpiod2/CMakeCache.txt
[ $# = 0 ] && set -- gpio
TACTILED_PRESET=gpiod2 exec tests/kernel/run.sh "$@"
