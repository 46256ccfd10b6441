#!/usr/bin/env python3
"""Time of `tactilectl calibrate` on big recordings, and of scikit-learn's boosted trees on the same rows.

    fit_seconds.py [--runs 3] [--tactilectl FILE]

`rbf`: the tongs' training rows, 15 channels and 3 forces; fewer rows are taken evenly. `matrix`: 100,000 made rows of 8 channels.
The time is that of the whole command (reading, fit, hold-outs, monitor, damage): the smallest of the runs, in seconds of the
processor (all threads, kernel included) and of the clock. Another load on the machine makes the latter greater. The exponent
is the slope of log(processor seconds) over log(rows). Errors are root mean squares on the tongs' test rows in % of full scale.
The trees (HistGradientBoostingRegressor, one for each force, as they come, on one thread, because several wait for each other
in a loop) are left out where scikit-learn (python3-sklearn) is not installed.
"""
import argparse
import math
import os
import pathlib
import random
import resource
import subprocess
import sys
import tempfile
import time

import rows_alone
from real_data import ROOT, number, rows_of, split, write

LABELS = ("fx_N", "fy_N", "fz_N")
ROWS = (1000, 3000, 10000, 20500)


def make_straight(path, n=100_000, seed=3):
    """Random walks of three loads on eight channels that bend a little."""
    rng = random.Random(seed)
    mix = [[rng.gauss(0, 1) for _ in LABELS] for _ in range(8)]
    speed, load = [0.0] * 3, [0.0] * 3
    with open(path, "w") as file:
        print("t_s", *(f"c{k}" for k in range(8)), *LABELS, sep=",", file=file)
        for i in range(n):
            for c in range(3):
                speed[c] = 0.98 * speed[c] + 0.2 * rng.gauss(0, 1)
                load[c] += 0.1 * (speed[c] - load[c])
            channels = (sum(a * math.tanh(x) for a, x in zip(row, load)) + 0.01 * rng.gauss(0, 1) for row in mix)
            print(f"{0.01 * i:.2f}", *(f"{c:.5f}" for c in channels), *(f"{10 * x:.5f}" for x in load), sep=",", file=file)


def processor_s(who):
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


def least(runs, work, who):
    """Returns the smallest (processor, clock) seconds of the runs."""
    taken = []
    for _ in range(runs):
        processor, clock = processor_s(who), time.monotonic()
        work()
        taken.append((processor_s(who) - processor, time.monotonic() - clock))
    return min(t[0] for t in taken), min(t[1] for t in taken)


def errors_of(estimates, test, scale):
    return "  ".join(f"{label[:2]} {100 * math.sqrt(sum((e - t) ** 2 for e, t in zip(estimates[label], test[label])) / len(test[label])) / scale[label]:.2f} %"
                     for label in LABELS)


def trees(channels, train, test, scale, runs):
    os.environ["OMP_NUM_THREADS"] = "1"  # before OpenMP is loaded
    try:
        from sklearn.ensemble import HistGradientBoostingRegressor
    except ImportError:
        print("trees: scikit-learn is not installed (python3-sklearn)")
        return
    seen = [[number(row[k]) for k in channels] for row in train]
    unseen = [[number(row[k]) for k in channels] for row in test]
    labels = {label: [number(row[label]) for row in train] for label in LABELS}
    fitted = {}

    def fit():
        for label in LABELS:
            fitted[label] = HistGradientBoostingRegressor().fit(seen, labels[label])

    processor, clock = least(runs, fit, resource.RUSAGE_SELF)
    estimates = {label: list(fitted[label].predict(unseen)) for label in LABELS}
    print(f"trees {len(train):6} rows: {processor:6.2f} s of the processor, {clock:6.2f} s; "
          + errors_of(estimates, {label: [number(row[label]) for row in test] for label in LABELS}, scale))


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--runs", type=int, default=3)
    arguments.add_argument("--tactilectl", default=ROOT / "build/release/bin/tactilectl")
    given = arguments.parse_args()
    train, test = split("tongs")
    channels = [name for name in train[0] if name.startswith("p")]
    train, test = ([{k: row[k] for k in ("t_s", *channels, *LABELS)} for row in rows] for rows in (train, test))
    scale = {label: max(abs(number(row[label])) for row in train) for label in LABELS}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)

        def calibrate(method, recording):
            subprocess.run([given.tactilectl, "calibrate", "--model", "generic", "--method", method, "--in", recording, "--out",
                            folder / "calibration.toml", "--force"], check=True, capture_output=True)

        points = []
        for n in ROWS:
            write([train[i * len(train) // n] for i in range(n)], folder / "rows.csv")
            processor, clock = least(given.runs, lambda: calibrate("rbf", folder / "rows.csv"), resource.RUSAGE_CHILDREN)
            points.append((math.log(n), math.log(processor)))
            print(f"rbf   {n:6} rows: {processor:6.2f} s of the processor, {clock:6.2f} s", flush=True)
        write(test, folder / "test.csv")
        subprocess.run([given.tactilectl, "decouple", *rows_alone.alone(given.tactilectl), "--calibration", folder / "calibration.toml", "--in", folder / "test.csv", "--out",
                        folder / "forces.csv"], check=True, capture_output=True)
        forces = rows_of(folder / "forces.csv")
        print(f"rbf   {ROWS[-1]:6} rows: " + errors_of({label: [number(row[label]) for row in forces] for label in LABELS},
                                                       {label: [number(row[label]) for row in test] for label in LABELS}, scale))
        points = points[1:]
        x, y = (sum(p[k] for p in points) / len(points) for k in (0, 1))
        print(f"rbf exponent from {ROWS[1]} rows on: "
              f"{sum((a - x) * (b - y) for a, b in points) / sum((a - x) ** 2 for a, _ in points):.2f}")
        make_straight(folder / "straight.csv")
        processor, clock = least(given.runs, lambda: calibrate("matrix", folder / "straight.csv"), resource.RUSAGE_CHILDREN)
        print(f"matrix 100000 rows: {processor:6.2f} s of the processor, {clock:6.2f} s", flush=True)
    trees(channels, train, test, scale, given.runs)


if __name__ == "__main__":
    sys.exit(main())
