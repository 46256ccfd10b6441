#!/usr/bin/env python3
"""Damages channels of a real recording that a calibration has not seen, and counts the values that are GOOD and wrong.

    damaged_channels.py [--methods matrix,quadratic,rbf,mlp] [--file FILE.csv] [--label fz_N] [--fit 1] [--judge 2]

The calibration is fitted on the rows of session --fit. In the rows of session --judge each channel in turn is damaged in five ways, and 40
random pairs of channels are exchanged. `wrong`: share of the rows that are GOOD and off by more than 10 % of full scale. `worst`: the
largest error of a GOOD row, in % of full scale.
"""
import argparse
import csv
import pathlib
import random
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def write(rows, path):
    with open(path, "w", newline="") as file:
        out = csv.DictWriter(file, rows[0].keys())
        out.writeheader()
        out.writerows(rows)


def kinds(channels, seen):
    """Name of a damage -> functions that damage a row; the rest of a channel is its median in the rows of the smallest loads."""
    rest, span = {}, {}
    for name in channels:
        values = sorted(float(row[name]) for row in seen)
        rest[name], span[name] = float(seen[0][name]), values[-1] - values[0]

    def each(change):
        return [lambda row, name=name: row.update({name: repr(change(name, float(row[name])))}) for name in channels]

    def exchange(a, b):
        return lambda row: row.update({a: row[b], b: row[a]})

    return {"undamaged": [lambda row: None],
            "at rest": each(lambda name, x: rest[name]), "at zero": each(lambda name, x: 0.0),
            "half gain": each(lambda name, x: x / 2), "turned round": each(lambda name, x: -x),
            "shifted by 20 %": each(lambda name, x: x + 0.2 * span[name]),
            "exchanged": [exchange(*random.Random(n).sample(channels, 2)) for n in range(40)]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", default=ROOT / "build/release/bin", type=pathlib.Path)
    parser.add_argument("--methods", default="matrix,quadratic,rbf,mlp")
    parser.add_argument("--file", default=ROOT / "tests/data/eflesh/normal_labelled.csv", type=pathlib.Path)
    parser.add_argument("--label", default="fz_N")
    parser.add_argument("--fit", default="1")
    parser.add_argument("--judge", default="2")
    args = parser.parse_args()
    rows = [row for row in rows_of(args.file) if row[args.label]]
    seen = sorted((row for row in rows if row["session"] == args.fit), key=lambda row: abs(float(row[args.label])))
    unseen = [row for row in rows if row["session"] == args.judge]
    channels = [name for name in rows[0] if name not in ("t_s", "session", "pose") and not name.endswith(("_N", "_Nm"))]
    full_scale = abs(float(seen[-1][args.label]))
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        write([row for row in rows if row["session"] == args.fit], folder / "fit.csv")
        for method in args.methods.split(","):
            done = subprocess.run([args.bin / "tactilectl", "calibrate", "--model", "generic", "--method", method, "--in",
                                   folder / "fit.csv", "--out", folder / f"{method}.toml"], capture_output=True, text=True)
            if done.returncode != 0:
                sys.exit(done.stderr)
            for name, damages in kinds(channels, seen).items():
                good = wrong = total = 0
                worst = 0.0
                for damage in damages:
                    damaged = [dict(row) for row in unseen]
                    for row in damaged:
                        damage(row)
                    write(damaged, folder / "damaged.csv")
                    subprocess.run([args.bin / "tactilectl", "decouple", "--calibration", folder / f"{method}.toml", "--in",
                                    folder / "damaged.csv", "--out", folder / "forces.csv"], check=True, capture_output=True)
                    for row, force in zip(unseen, rows_of(folder / "forces.csv")):
                        total += 1
                        if force["quality"] != "good":
                            continue
                        good += 1
                        error = abs(float(force[args.label]) - float(row[args.label])) / full_scale
                        worst = max(worst, error)
                        wrong += error > 0.1
                print(f"{method:10} {name:16} GOOD {100 * good / total:6.2f} %  wrong {100 * wrong / total:5.2f} %  worst {100 * worst:5.1f} %",
                      flush=True)


if __name__ == "__main__":
    main()
