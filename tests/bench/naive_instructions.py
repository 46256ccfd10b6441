#!/usr/bin/env python3
"""Instructions a sample of our methods and of the naive ones of tests/bench/naive, counted by cachegrind: two runs of different length,
the difference divided.

    naive_instructions.py [path of against_naive]
"""
import pathlib
import subprocess
import sys
import tempfile

import counted

BENCH = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "build/release/bin/against_naive").resolve()
SHORT, LONG = 256, 512

with tempfile.TemporaryDirectory() as folder:
    subprocess.run([BENCH, "--save", folder], check=True)
    print("| method | ours | naive | times |\n|---|---|---|---|")
    for path in sorted(pathlib.Path(folder).glob("*.toml")):
        name = path.stem.replace("-", "/")
        ours, naive = (counted.a_step(lambda samples: [BENCH, "--count", folder, name, who, samples], SHORT, LONG)
                       for who in ("ours", "naive"))
        print(f"| {name} | {ours:.0f} | {naive:.0f} | {naive / ours:.1f} |", flush=True)
