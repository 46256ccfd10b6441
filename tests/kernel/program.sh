#!/usr/bin/env bash
# program.sh ROOT PROGRAM...: copies programs to ROOT/usr/bin, and the libraries that they name to ROOT, each at its own path if it is the system's. Of a
# library (.so) only what it names.
set -euo pipefail
root=$1; shift
for wanted in "$@"; do
    program=$wanted
    [ -e "$program" ] || program=$(command -v "$program") || { echo "program.sh: $wanted is not there: not built, or not installed"; exit 1; }
    [ "${program##*.}" = so ] || install -D "$(realpath "$program")" "$root/usr/bin/$(basename "$program")"
    ldd "$program" | awk '/=> \// {print $3} $1 ~ /^\// {print $1}' | while read -r library; do
        case $library in /lib*|/usr/lib*) to=$library ;; *) to=/usr/lib/${library##*/} ;; esac  # a build folder may lie where the machine has none
        [ -e "$root$to" ] || install -D "$(realpath "$library")" "$root$to"
    done
done
