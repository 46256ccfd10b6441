#!/usr/bin/env python3
"""Calibrates on real recordings, decouples what the calibration has not seen, and prints the errors.

    real_data.py [--methods matrix,quadratic,rbf,mlp,auto] [set ...]        sets: normal shear tongs

Errors are root mean squares in % of the full scale (the greatest load of the calibration's rows), per axis; `within` is the share
of errors within the standard deviation that was given with each sample (68 % would be right). Rows beyond the domain count, too.
"""
import argparse
import csv
import lzma
import math
import pathlib
import subprocess
import sys
import tempfile
import time

import rows_alone

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
DATA = ROOT / "tests" / "data"
COMPONENTS = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")


def rows_of(path):
    opened = lzma.open(path, "rt") if path.suffix == ".xz" else open(path)
    with opened as file:
        return list(csv.DictReader(file))


def split(name):
    """The rows to calibrate on and those to judge by: as the makers of the recordings split them."""
    if name == "normal":
        rows = rows_of(DATA / "eflesh/normal_labelled.csv")
        return [r for r in rows if r["session"] == "1"], [r for r in rows if r["session"] == "2"]
    if name == "shear":
        rows = rows_of(DATA / "eflesh/shear_labelled.csv.xz")
        at = len(rows) * 4 // 5
        return rows[:at], rows[at:]
    return rows_of(DATA / "tongs/train_labelled.csv.xz"), rows_of(DATA / "tongs/test_labelled.csv.xz")


def write(rows, path):
    with open(path, "w", newline="") as file:
        out = csv.DictWriter(file, rows[0].keys())
        out.writeheader()
        out.writerows(rows)


def number(text):
    return float(text) if text else math.nan


def judge(name, method, tactilectl, folder):
    train, test = split(name)
    write(train, folder / "train.csv")
    write(test, folder / "test.csv")
    begun = time.monotonic()
    done = subprocess.run([tactilectl, "calibrate", "--model", "generic", "--method", method, "--force", "--in", folder / "train.csv", "--out",
                           folder / "calibration.toml"], capture_output=True, text=True)
    took = time.monotonic() - begun
    if done.returncode != 0:
        print(f"{name:7} {method:10} refused: {done.stderr.strip()}")
        return
    subprocess.run([tactilectl, "decouple", *rows_alone.alone(tactilectl), "--calibration", folder / "calibration.toml", "--in", folder / "test.csv", "--out",
                    folder / "forces.csv"], check=True)
    forces = rows_of(folder / "forces.csv")
    parts = []
    for label in COMPONENTS:
        if label not in train[0]:
            continue
        full_scale = max(abs(number(r[label])) for r in train if r[label])
        errors = [(number(f[label]) - number(r[label]), number(f.get("sd_" + label, ""))) for f, r in zip(forces, test) if r[label]]
        known = [(e, sd) for e, sd in errors if math.isfinite(e)]
        if len(known) != len(errors):
            parts.append(f"{len(errors) - len(known)} rows BAD")
        rms = math.sqrt(sum(e * e for e, _ in known) / len(known))
        within = sum(abs(e) <= sd for e, sd in known) / len(known)
        stated = any(math.isfinite(sd) for _, sd in known)  # forces.csv has none for moments
        parts.append(f"{label[:2]} {100 * rms / full_scale:5.2f} %" + (f" ({100 * within:3.0f} %)" if stated else ""))
    print(f"{name:7} {method:10} {'  '.join(parts)}  [{took:.1f} s]", flush=True)


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--methods", default="matrix,quadratic,rbf,mlp")
    arguments.add_argument("--tactilectl", default=ROOT / "build/release/bin/tactilectl")
    arguments.add_argument("sets", nargs="*", default=[])
    given = arguments.parse_args()
    print("set     method     axis: rms error in % of full scale (share within one standard deviation)")
    with tempfile.TemporaryDirectory() as folder:
        for name in given.sets or ("normal", "shear", "tongs"):
            for method in given.methods.split(","):
                judge(name, method, given.tactilectl, pathlib.Path(folder))


if __name__ == "__main__":
    sys.exit(main())
