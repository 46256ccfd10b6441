#!/usr/bin/env python3
"""Size, libraries and start of the programs that are shipped, of one or several builds in turn.

    /usr/bin/python3 tests/bench/programs.py build/release/bin [OTHER/bin]...

A start is `--version`, and of tactilectl `status` of a daemon that is not there, too: median of 50 of the wall clock and of the CPU time (user and
system) of the process. The builds take turns, so that what else runs disturbs all alike."""
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile
import time

STARTS = [("tactiled", "--version"), ("tactilectl", "--version"), ("tactilectl", "status", "--node", "nobody"), ("tactilectl-lab", "--version"),
          ("tactilectl", "play", "--help")]
ROUNDS = 50


def stripped_bytes(program):
    with tempfile.NamedTemporaryFile() as file:
        subprocess.run(["strip", "-o", file.name, program], check=True)
        return os.path.getsize(file.name)


def libraries(program):
    lines = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout.splitlines()
    return sorted(name for name in (pathlib.Path(line.split()[0]).name for line in lines) if not name.startswith(("linux-vdso", "ld-linux")))


def start(words):
    """Wall clock and CPU time, ms."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    return 1e3 * wall, 1e3 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def main(folders):
    for folder in folders:
        for name in ("tactiled", "tactilectl", "tactilectl-lab"):
            if (folder / name).exists():
                loaded = libraries(folder / name)
                print(f"{folder / name}: {stripped_bytes(folder / name):,} bytes stripped, {len(loaded)} libraries: {' '.join(loaded)}")
    tried = [(folder, words) for words in STARTS for folder in folders if (folder / words[0]).exists()]
    times = {pair: [] for pair in tried}
    for _ in range(ROUNDS):
        for folder, words in tried:
            times[folder, words].append(start([folder / words[0], *words[1:]]))
    for (folder, words), pairs in times.items():
        wall, cpu = (statistics.median(column) for column in zip(*pairs))
        print(f"{folder}: {' '.join(words)}: {wall:.1f} ms, CPU time {cpu:.1f} ms")


if __name__ == "__main__":
    main([pathlib.Path(word) for word in sys.argv[1:]])
