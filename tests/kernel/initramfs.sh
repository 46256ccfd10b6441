#!/usr/bin/env bash
# initramfs.sh KERNEL_FOLDER OUT.cpio: the constant part of the test machine: busybox, python3, ip and can-utils,
# kernel modules.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
kernel=$1 out=$2 version=$(cat "$1/done")
root=$(mktemp -d); trap 'rm -rf "$root"' EXIT
mkdir -p "$root"/{bin,sbin,usr/bin,usr/sbin,proc,sys,dev,tmp,run,root,etc,mod}

cp /bin/busybox "$root/bin/"
for applet in $(/bin/busybox --list-full); do
    mkdir -p "$root/$(dirname "$applet")"
    [ -e "$root/$applet" ] || ln -s /bin/busybox "$root/$applet"
done
rm -f "$root"/{bin,sbin,usr/bin}/ip  # busybox's knows no CAN
echo 'root:x:0:0:root:/root:/bin/sh' >"$root/etc/passwd"
echo 'root:x:0:' >"$root/etc/group"
"$here/program.sh" "$root" ip candump cansend cangen isotpsend isotprecv /usr/bin/python3
python=$(basename "$(realpath /usr/bin/python3)")  # python3.11, python3.13
mkdir -p "$root/usr/lib/$python"
tar -C "/usr/lib/$python" -c --exclude=test --exclude=idlelib --exclude='config-*' --exclude=lib2to3 --exclude=ensurepip \
    --exclude=pydoc_data --exclude=distutils . | tar -C "$root/usr/lib/$python" -x
"$here/program.sh" "$root" "/usr/lib/$python"/lib-dynload/*.so

# modules.order: a line a module with its parameters, in the order of loading
add_module() {
    local name=$1; shift
    modprobe -d "$kernel/kernel" -S "$version" --show-depends "$name" | awk '$1 == "insmod" {print $2}' | while read -r file; do
        local base; base=$(basename "${file%.xz}")
        [ -e "$root/mod/$base" ] && continue
        case $file in *.xz) xz -dc "$file" >"$root/mod/$base" ;; *) cp "$file" "$root/mod/" ;; esac  # Debian 13 compresses them
        strip --strip-debug "$root/mod/$base"
        if [ "${base//-/_}" = "${name//-/_}.ko" ]; then echo "$base $*"; else echo "$base"; fi >>"$root/modules.order"
    done
}
for name in configfs vcan can-raw can-isotp i2c-dev vhci-hcd i2c-tiny-usb gs_usb kvaser_pci xhci-pci ftdi_sio; do add_module "$name"; done
add_module i2c-stub chip_addr=0x48,0x28,0x2a
if [ -e "$kernel/module/gpio-sim.ko" ]; then
    cp "$kernel/module/gpio-sim.ko" "$root/mod/"; strip --strip-debug "$root/mod/gpio-sim.ko"; echo gpio-sim.ko >>"$root/modules.order"
else
    add_module gpio-sim
fi

cp "$here/init" "$root/init"
(cd "$root" && find . -print0 | cpio --null -o -H newc --quiet) >"$out"
