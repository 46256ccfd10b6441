#!/usr/bin/env bash
# program.sh ROOT PROGRAM...: copies programs to ROOT/usr/bin, and the libraries that they name to ROOT, each at its own path. Of a
# library (.so) only what it names.
set -euo pipefail
root=$1; shift
for program in "$@"; do
    [ -e "$program" ] || program=$(command -v "$program")
    [ "${program##*.}" = so ] || install -D "$(realpath "$program")" "$root/usr/bin/$(basename "$program")"
    ldd "$program" | awk '/=> \// {print $3} $1 ~ /^\// {print $1}' | while read -r library; do
        [ -e "$root$library" ] || install -D "$(realpath "$library")" "$root$library"
    done
done
