#!/usr/bin/env bash
# boot.sh FOLDER OVERLAY COMMAND...: starts the test machine with the tree OVERLAY on top, runs COMMAND in it, ends with its status.
# FOLDER holds vmlinux and base.cpio. MEMORY_MB=512 LIMIT_S=600 ICOUNT=shift=3,sleep=off QEMU_WORDS="..." may be set.
# ICOUNT: its clock counts instructions, 8 ns each (125 million a second), and goes on at once where it has nothing to do (sleep=off): on a slow
# or busy host a test takes longer and finds the same. Without sleep=off it waits in the host's time; ICOUNT= is the host's clock altogether.
# It is QEMU's emulation on purpose: where /dev/kvm exists it need not work, and a test machine is to be the same everywhere.
set -euo pipefail
ICOUNT=${ICOUNT-shift=3,sleep=off}
folder=$1 overlay=$2; shift 2
{ echo '#!/bin/sh'; echo 'cd /project'; printf 'exec'; printf ' %q' "$@"; echo; } >"$overlay/job"; chmod +x "$overlay/job"
initrd=$(mktemp); trap 'rm -f "$initrd"' EXIT
cp "$folder/base.cpio" "$initrd"
(cd "$overlay" && find . -print0 | cpio --null -o -H newc --quiet) >>"$initrd"  # Linux unpacks one after the other
read -ra words <<<"${QEMU_WORDS:-}"
status=0
timeout -k 5 "${LIMIT_S:-600}" qemu-system-x86_64 -nodefaults -no-user-config -display none -no-reboot -M q35,accel=tcg -cpu max -smp 1 \
    -m "${MEMORY_MB:-512}" -kernel "$folder/vmlinux" -initrd "$initrd" -serial stdio -device isa-debug-exit,iobase=0xf4,iosize=0x04 \
    -append "console=ttyS0 quiet panic=-1 rdinit=/init nokaslr mitigations=off no_timer_check tsc=reliable audit=0 apparmor=0" \
    ${ICOUNT:+-icount "$ICOUNT"} "${words[@]}" </dev/null || status=$?
if [ $status = 124 ] || [ $status = 137 ]; then echo "boot.sh: ended after ${LIMIT_S:-600} s"; exit 124; fi
[ $((status & 1)) = 1 ] && exit $((status >> 1))
echo "boot.sh: the machine ended without a status ($status)"; exit 125
