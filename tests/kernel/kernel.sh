#!/usr/bin/env bash
# kernel.sh FOLDER: Debian's own kernel for the test machine, unpacked there; nothing is installed. And the one module
# that Debian 12 does not ship, gpio-sim. FOLDER/done says for which version it was made. Exit status 77: the packages
# are not available.
set -euo pipefail
mkdir -p "$1"; folder=$(cd "$1" && pwd)
image=$(apt-cache depends linux-image-amd64 | awk '/Depends: linux-image/ {print $2; exit}')
[ -n "$image" ] || exit 77
version=${image#linux-image-}
[ "$(cat "$folder/done" 2>/dev/null)" = "$version" ] && exit 0
there=$folder folder=$folder.new  # keeps the old folder until the new one is complete
rm -rf "$folder"; mkdir -p "$folder"/{packages,kernel,headers,module}; cd "$folder"

series=$(cut -d. -f1,2 <<<"$version")  # 6.1 in Debian 12, 6.12 in Debian 13
readarray -t headers < <(apt-cache depends "linux-headers-$version" | awk '/Depends: linux-(headers|kbuild)-/ {print $2}')
headers+=("linux-headers-$version" "linux-source-$series")
# apt fetches as a user of its own, who may not write here
(cd packages && chmod 777 . && apt-get download -qq "$image" "${headers[@]}") || exit 77
dpkg -x packages/"$image"_*.deb kernel
for package in "${headers[@]}"; do dpkg -x packages/"$package"_*.deb headers; done
[ -e kernel/lib ] || ln -s usr/lib kernel/lib  # Debian 13 has its modules in /usr/lib
depmod -b "$folder/kernel" "$version"  # dpkg -x does not run it
# The headers' Makefile has one absolute path in it.
sed -i "s#^include /usr/src#include $folder/headers/usr/src#" "headers/usr/src/linux-headers-$version/Makefile"

source=linux-source-$series
tar xJf "headers/usr/src/$source.tar.xz" -C headers --strip-components=1 "$source"/drivers/gpio/{gpio-sim.c,gpiolib.h} \
    "$source/kernel/irq/irq_sim.c" "$source/scripts/extract-vmlinux"
# vmlinux starts without unpacking itself: seconds where each instruction is emulated.
sh headers/scripts/extract-vmlinux "kernel/boot/vmlinuz-$version" >vmlinux
if [ -z "$(find kernel/ -name 'gpio-sim.ko*')" ]; then
    cp headers/drivers/gpio/gpio-sim.c module/gpio-sim-main.c
    cp headers/drivers/gpio/gpiolib.h module/
    # CONFIG_IRQ_SIM is off in Debian's kernel: linked in. irq_to_desc() is no symbol for modules, generic_handle_irq() is.
    sed 's/handle_simple_irq(irq_to_desc(irqnum))/generic_handle_irq(irqnum)/' headers/kernel/irq/irq_sim.c >module/irq_sim.c
    printf 'obj-m := gpio-sim.o\ngpio-sim-y := gpio-sim-main.o irq_sim.o\n' >module/Makefile
    make -s -C "headers/usr/src/linux-headers-$version" M="$folder/module" CONFIG_DEBUG_INFO_BTF_MODULES= modules  # BTF needs pahole
fi
rm -rf packages
echo "$version" >done
cd "$there/.." && rm -rf "$there" && mv "$folder" "$there"
