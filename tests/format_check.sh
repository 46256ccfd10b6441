#!/usr/bin/env bash
# Every source is as clang-format-14 writes it. By name and not by git: a checkout need not have it.
# Exit status 77: this system has no clang-format-14; other versions write some lines otherwise.
command -v clang-format-14 >/dev/null || { echo "format_check.sh: left out: no clang-format-14"; exit 77; }
cd "$(dirname "$0")/.." || exit 1
mapfile -t sources < <(find . \( -name build -o -name .git \) -prune -o \( -name '*.cpp' -o -name '*.hpp' -o -name '*.h' \) -print)
[ ${#sources[@]} -gt 100 ] || { echo "format_check.sh: found ${#sources[@]} sources"; exit 1; }
clang-format-14 --dry-run -Werror "${sources[@]}"
