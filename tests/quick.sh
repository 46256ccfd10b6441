#!/usr/bin/env bash
# quick.sh: checks the files that changed, in at most 90 s for one changed .cpp file and a warm build. tests/run.sh is the ordinary run.
#   tests/quick.sh [BASE]      against the commit BASE; without it, against the merge base with origin/main, or HEAD~1 if that is
#                              HEAD itself. Uncommitted and untracked files are included.
#   tests/quick.sh --install   writes a git hook that runs it before each push; git push --no-verify omits it once
# QUICK_BUILD names another build folder than build/release. TACTILED_MUST=1: a check that lacks a program fails.
set -euo pipefail
export LC_ALL=C.UTF-8
cd "$(dirname "$0")/.."
build=$(realpath -m "${QUICK_BUILD:-build/release}")
mark='# Written by tests/quick.sh --install.'

install_hook() {
    local hook; hook=$(git rev-parse --git-path hooks/pre-push)
    if [ -e "$hook" ] && ! grep -qxF "$mark" "$hook"; then
        echo "quick.sh: $hook exists and is not of quick.sh. To keep it, add this line to it: tests/quick.sh </dev/null" >&2
        exit 1
    fi
    mkdir -p "$(dirname "$hook")"
    # A commit before quick.sh can be pushed, too.
    printf '%s\n' '#!/bin/sh' "$mark" 'quick=$(git rev-parse --show-toplevel)/tests/quick.sh' '[ ! -x "$quick" ] || exec "$quick" </dev/null' >"$hook"
    chmod +x "$hook"
    echo "quick.sh: $hook runs tests/quick.sh before each push"
}

case ${1:-} in
--install) install_hook; exit ;;
-*) sed -n '2,6s/^# //p' "$0" >&2; exit 2 ;;
esac

if [ $# -gt 0 ]; then
    base=$1
else
    base=$(git merge-base origin/main HEAD 2>/dev/null || true)
    [ -n "$base" ] && [ "$base" != "$(git rev-parse HEAD)" ] || base=HEAD~1
fi
git rev-parse --verify --quiet "$base^{commit}" >/dev/null || { echo "quick.sh: there is no commit $base to compare with" >&2; exit 2; }
# With the deleted files, whose folders have tests.
mapfile -d '' -t changed < <(git diff -z --name-only --no-renames "$base"; git ls-files -z --others --exclude-standard)
present=()
for file in "${changed[@]}"; do [ ! -f "$file" ] || present+=("$file"); done
echo "quick.sh: ${#changed[@]} files changed since $(git log -1 --format='%h %s' "$base")"
[ ${#changed[@]} -gt 0 ] || exit 0

work=$(mktemp -d)
trap 'jobs -p | xargs -r kill 2>/dev/null; rm -rf "$work"' EXIT
failed=0
line() { # TENTHS NAME RESULT
    printf '%4d.%d s  %-16s %s\n' $(($1 / 10)) $(($1 % 10)) "$2" "$3"
}
check() { # NAME DETAIL COMMAND...: exit status 77 of the command: its last line names what is missing
    local name=$1 detail=$2 start=${EPOCHREALTIME/./} status=0 tenths; shift 2
    "$@" >"$work/output" 2>&1 </dev/null || status=$?
    tenths=$(((${EPOCHREALTIME/./} - start) / 100000))
    case $status in
    0) line $tenths "$name" "$detail" ;;
    77) line $tenths "$name" "skipped: $(tail -n 1 "$work/output")" ;;
    *) line $tenths "$name" "$detail: FAILED" ;;
    esac
    if [ $status = 77 ] && [ "${TACTILED_MUST:-}" != 1 ]; then return; fi
    if [ $status != 0 ]; then
        failed=$((failed + 1))
        { echo "---- $name"; cat "$work/output"; } >>"$work/failures"
    fi
}
select_files() { # ERE: the present files with such a name
    [ ${#present[@]} -eq 0 ] || printf '%s\n' "${present[@]}" | grep -E "$1" || true
}

# 1. The text
format() {
    command -v clang-format-14 >/dev/null || { echo "clang-format-14 is missing (node/install-packages.sh tests)"; return 77; }
    clang-format-14 --dry-run -Werror "$@"
}
shell_files() {
    local file
    for file in "${present[@]}"; do
        [[ $file != *.sh ]] && ! head -c 40 "$file" | head -n 1 | grep -aqE '^#!.*[ /](ba)?sh' || echo "$file"
    done
}
shell() {
    local file status=0
    for file in "$@"; do bash -n "$file" || status=1; done
    return $status
}
mapfile -t files < <(select_files '\.(cpp|hpp|h)$')
[ ${#files[@]} -eq 0 ] || check format "files: ${#files[@]}" format "${files[@]}"
mapfile -t files < <(select_files '\.py$')
[ ${#files[@]} -eq 0 ] || check python "files: ${#files[@]}" env PYTHONPYCACHEPREFIX="$work" python3 -m py_compile "${files[@]}"
mapfile -t files < <(shell_files)
[ ${#files[@]} -eq 0 ] || check shell "files: ${#files[@]}" shell "${files[@]}"
check includes "all files" tests/include_directions.py
check language "all files" tests/language_check.py
check prose "all files" tests/prose_check.py

# 2. The build, and the unit tests of the changed folders
mapfile -t code < <(printf '%s\n' "${changed[@]}" | grep -E '^(config|drivers|decoupling|node|tests/unit)/.*(\.(cpp|hpp|h|c)|/CMakeLists\.txt)$' || true)
compiled() { # FILE...: those that a command of the build compiles
    python3 - "$build/compile_commands.json" "$@" <<'PYTHON'
import json, os, sys
known = {os.path.realpath(entry["file"]) for entry in json.load(open(sys.argv[1]))}
print("\n".join(name for name in sys.argv[2:] if os.path.realpath(name) in known))
PYTHON
}
programs() { # the innermost folder of each file that has a program in tests/CMakeLists.txt
    local file part parts program
    for file in "${code[@]}"; do
        program=
        IFS=/ read -ra parts <<<"$(dirname "$file")"
        for part in "${parts[@]}"; do ! grep -q "^unit_test_program($part " tests/CMakeLists.txt || program=${part}_test; done
        [ -z "$program" ] || echo "$program"
    done | sort -u
}
build_targets() { # TARGET...: with each changed source, which need not be part of a unit test program
    local sources
    mapfile -t sources < <(compiled $(select_files '^(config|drivers|decoupling|node)/.*\.cpp$') | sed -e '/./!d' -e "s|.*|$PWD/&^|")
    [ $(($# + ${#sources[@]})) -gt 0 ] || return 0
    cmake --build "$build" --target "$@" "${sources[@]}"
}
[ "$(id -u)" = 0 ] || [ -n "${XDG_RUNTIME_DIR:-}" ] || { mkdir -p build; export TACTILED_RUNTIME_DIR=$PWD/build/run; }  # run.sh does the same
unit() { # PROGRAM: in parts, because most of the tests wait
    local parts=$((2 * $(nproc))) part status=0 running=()
    for ((part = 0; part < parts; ++part)); do
        GTEST_TOTAL_SHARDS=$parts GTEST_SHARD_INDEX=$part timeout 300 "$build/bin/$1" --gtest_brief=1 >"$work/part$part" 2>&1 &
        running+=($!)
    done
    for ((part = 0; part < parts; ++part)); do
        wait "${running[part]}" || { status=1; cat "$work/part$part"; }
    done
    return $status
}
if [ ${#code[@]} -gt 0 ]; then
    before=$failed
    check configure "$build" cmake -S . -B "$build" --preset release -DTACTILED_TESTS=ON -DTACTILED_WERROR=ON
    mapfile -t units < <(programs)
    [ "$failed" != "$before" ] || check build "${units[*]} and the changed files" build_targets "${units[@]}"
    if [ "$failed" = "$before" ]; then
        for program in "${units[@]}"; do check units "$program" unit "$program"; done
    fi
fi

# 3. clang-tidy, after the build, which makes the headers that it reads
analysed() { # the changed .cpp files of the product; for a changed header, a .cpp file that includes it
    local header source
    select_files '^(config|drivers|decoupling|node)/.*\.cpp$'
    select_files '^(config|drivers|decoupling|node)/.*\.(hpp|h)$' | while read -r header; do
        source=${header%.*}.cpp
        [ -f "$source" ] || source=$(grep -rlF --include='*.cpp' "#include \"${header#node/include/}\"" config drivers decoupling node | sort | head -n 1)
        [ -z "$source" ] || echo "$source"
    done
}
tidy() { # FILE...
    command -v clang-tidy-14 >/dev/null || { echo "clang-tidy-14 is missing (node/install-packages.sh tests)"; return 77; }
    # The commands without the precompiled headers of g++, which clang cannot read.
    sed -E 's/ (-fpch-preprocess|-Winvalid-pch|-include [^ ]*cmake_pch\.hxx)//g' "$build/compile_commands.json" >"$work/compile_commands.json"
    printf '%s\n' "$@" | xargs -P "$(nproc)" -n 1 clang-tidy-14 --quiet -p "$work" 2>"$work/messages" ||
        { grep -vE '^[0-9]+ (warnings?|errors?) ' "$work/messages"; return 1; }
}
if [ ${#code[@]} -gt 0 ] && [ -f "$build/compile_commands.json" ]; then
    mapfile -t files < <(compiled $(analysed | sort -u) | sed '/./!d')
    [ ${#files[@]} -eq 0 ] || check clang-tidy "${files[*]}" tidy "${files[@]}"
fi

line $((SECONDS * 10)) total "$failed checks failed"
[ "$failed" = 0 ] || { cat "$work/failures"; exit 1; }
