#!/usr/bin/env python3
"""Do two builds give the same results?

    tests/same_results.py BASE_BIN NEW_BIN [--within 1e-15] [--only fits,forces,recordings,registers,grasps,texts] [--keep FOLDER]

Compares calibrations, forces, replayed recordings, register dumps and grasps bit for bit, and lists differences of texts. The exit status
is 1 where a result differs by more than --within of full scale. Method auto of `decouple` is left out: it measures times.
"""
import argparse
import concurrent.futures
import pathlib
import sys
import tempfile
import time

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "system"), str(HERE / "scenes")]

from same import daemons, grasps, numbers, texts  # noqa: E402
from same.outcome import Outcome  # noqa: E402

PARTS = ("fits", "forces", "recordings", "registers", "grasps", "texts")


def print_table(outcomes, seconds):
    print(f"{'what':44} {'compared':>10} {'differ':>8}  greatest, of full scale")
    for o in outcomes:
        note = "" if o.judged else "  (listed only)"
        print(f"{o.what:44} {o.compared:10} {o.differ:8}  {o.greatest:.2g}{note}")
    for o in outcomes:
        if o.first:
            print(f"first difference in {o.what}: {o.first}")
    print(f"{seconds:.0f} s")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("base", type=pathlib.Path)
    parser.add_argument("new", type=pathlib.Path)
    parser.add_argument("--within", type=float, default=0, help="difference that is allowed, of full scale")
    parser.add_argument("--only", default=",".join(PARTS), help="parts, with commas: " + " ".join(PARTS))
    parser.add_argument("--keep", type=pathlib.Path, help="the folder for all files, instead of a temporary one")
    args = parser.parse_args()
    base, new, parts = args.base.resolve(), args.new.resolve(), args.only.split(",")
    begun = time.monotonic()
    outcomes = []

    def outcome(what, judged=True):
        outcomes.append(Outcome(what, judged))
        return outcomes[-1]

    with tempfile.TemporaryDirectory(prefix="same-") as temporary, concurrent.futures.ThreadPoolExecutor(2) as pool:
        folder = args.keep or pathlib.Path(temporary)
        folder.mkdir(exist_ok=True)
        messages = outcome("messages of calibrate and decouple", judged=False)
        if "fits" in parts or "forces" in parts:
            made = numbers.Calibrations(base, folder).compare(new, pool, outcome("calibrations, lines"), messages)
            print(f"calibrations: {len(made)}, {time.monotonic() - begun:.0f} s", flush=True)
        if "forces" in parts:
            signals = numbers.Signals(base, folder).collect(pool)
            numbers.compare_forces(base, new, folder, pool, made, signals, outcome("decouple, cells"), messages)
            print(f"forces: {time.monotonic() - begun:.0f} s", flush=True)
        if "recordings" in parts or "registers" in parts:
            daemons.compare(base, new, parts, outcome)
            print(f"daemons: {time.monotonic() - begun:.0f} s", flush=True)
        if "grasps" in parts:
            grasps.compare(base, new, folder, pool, outcome)
            print(f"grasps: {time.monotonic() - begun:.0f} s", flush=True)
        if "texts" in parts:
            texts.compare(base, new, folder, outcome)
    print_table(outcomes, time.monotonic() - begun)
    return 1 if any(o.judged and o.greatest > args.within for o in outcomes) or not all(o.compared for o in outcomes if o.judged) else 0


if __name__ == "__main__":
    sys.exit(main())
