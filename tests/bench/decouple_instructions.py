#!/usr/bin/env python3
"""Instructions a sample of every decoupling method but mlp (whose fit takes an hour under valgrind), counted by cachegrind: two runs of
different length, the difference divided.

    decouple_instructions.py [path of decouple_bench]
"""
import pathlib
import re
import subprocess
import sys

BENCH = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "build/release/bin/decouple_bench").resolve()
METHODS = ("generic/matrix generic/quadratic generic/rbf table/linear table/matrix table/nonlinear table/map hair/sum_diff "
           "hair/matrix hair/physics capacitive/quadratic capacitive/ratio capacitive/overlap piezo/fused").split()
SHORT, LONG = 1024, 3072


def instructions(method, samples):
    out = subprocess.run(["valgrind", "--tool=cachegrind", "--cachegrind-out-file=/dev/null", "--cache-sim=no", str(BENCH), "--only", method,
                          "--samples", str(samples)], capture_output=True, text=True, check=True).stderr
    return int(re.search(r"I\s+refs:\s+([\d,]+)", out).group(1).replace(",", ""))


for name in METHODS:
    print(f"{name:20} {(instructions(name, LONG) - instructions(name, SHORT)) / (LONG - SHORT):10.0f} instructions a sample", flush=True)
