#!/usr/bin/env python3
"""Instructions a sample of every decoupling method but mlp (whose fit takes an hour under valgrind), counted by cachegrind: two runs of
different length, the difference divided.

    decouple_instructions.py [path of decouple_bench]             the methods
    decouple_instructions.py --checks [path of decouple_bench]    the checks around a method: joint domain, latency, parity
"""
import pathlib
import re
import subprocess
import sys

CHECKS = "--checks" in sys.argv[1:]
PATHS = [word for word in sys.argv[1:] if word != "--checks"]
BENCH = pathlib.Path(PATHS[0] if PATHS else "build/release/bin/decouple_bench").resolve()
METHODS = ("generic/matrix generic/quadratic generic/rbf table/linear table/matrix table/nonlinear table/map hair/sum_diff "
           "hair/matrix hair/physics capacitive/quadratic capacitive/ratio capacitive/overlap piezo/fused").split()
SHORT, LONG = 1024, 3072


def instructions(method, samples):
    out = subprocess.run(["valgrind", "--tool=cachegrind", "--cachegrind-out-file=/dev/null", "--cache-sim=no", str(BENCH), "--only", method,
                          "--samples", str(samples)], capture_output=True, text=True, check=True).stderr
    return int(re.search(r"I\s+refs:\s+([\d,]+)", out).group(1).replace(",", ""))


def a_sample(method):
    return (instructions(method, LONG) - instructions(method, SHORT)) / (LONG - SHORT)


if CHECKS:
    for method, channels in (("sum_diff", 4), ("linear", 8), ("matrix", 15)):
        alone, joint, late, every = (a_sample(f"{which}/{method}") for which in ("alone", "joint", "late", "all"))
        print(f"{channels:2} channels: alone {alone:.0f}, joint domain {joint - alone:.0f}, latency {late - joint:.0f}, "
              f"parity {every - joint:.0f} instructions a sample", flush=True)
else:
    for name in METHODS:
        print(f"{name:20} {a_sample(name):10.0f} instructions a sample", flush=True)
