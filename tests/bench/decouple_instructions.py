#!/usr/bin/env python3
"""Instructions a sample of every decoupling method but mlp (whose fit takes an hour under valgrind), counted by cachegrind: two runs of
different length, the difference divided. Levels: decouple_bench.

    decouple_instructions.py [--only MODEL/METHOD] [--levels none,checks] [--plant slow] [--bench path of decouple_bench]
"""
import argparse
import concurrent.futures
import os
import pathlib

import counted

METHODS = ("generic/matrix generic/quadratic generic/rbf table/linear table/matrix table/nonlinear table/map hair/sum_diff "
           "hair/matrix hair/physics capacitive/quadratic capacitive/ratio capacitive/overlap piezo/fused").split()
SHORT, LONG = 1024, 17_408  # the set-up before them varies by half a million instructions


def a_sample(bench, method, level, plant=""):
    """The count, or None if the method lacks the level."""
    words = [bench, "--only", method, "--level", level, *(["--plant", plant] if plant else [])]
    return counted.a_step(lambda samples: [*words, "--samples", samples], SHORT, LONG)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--only", default=",".join(METHODS))
    arguments.add_argument("--levels", default="none,checks")
    arguments.add_argument("--plant", default="")
    arguments.add_argument("--bench", default="build/release/bin/decouple_bench")
    asked = arguments.parse_args()
    bench = pathlib.Path(asked.bench).resolve()
    pairs = [(method, level) for method in asked.only.split(",") for level in asked.levels.split(",")]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:  # counts do not depend on other work
        for (method, level), count in zip(pairs, pool.map(lambda pair: a_sample(bench, *pair, asked.plant), pairs)):
            if count is not None:
                print(f"{method} {level:8} {count:10.0f} instructions a sample", flush=True)


if __name__ == "__main__":
    main()
