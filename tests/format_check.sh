#!/usr/bin/env bash
# Every source is as clang-format-14 writes it.
cd "$(dirname "$0")/.." && git ls-files '*.cpp' '*.hpp' '*.h' | xargs clang-format-14 --dry-run -Werror
