#!/usr/bin/env python3
"""The share of damaged readings that calibrate states as GOOD and wrong, against the measured one on rows that it has not seen.

    damaged_channels.py [--sets skin,shear,tongs,table,hair,capacitive,made] [--count 12] [--methods matrix,quadratic,rbf] BIN [OLD_BIN]
    damaged_channels.py --file labelled.csv BIN
    damaged_channels.py --stretches --sets made BIN

Each recording is calibrated on the first two thirds of its rows. In the last third, with --stretches in every third of 30 stretches
of the time, one channel is damaged: stuck at the value of an
earlier row, at half gain, drifting by 30 % of its range over the rows, exchanged with another channel, or dead at its zero. Printed
for each kind, as a mean over the channels, in %: stated / measured; measured is the share of the rows that are GOOD without damage,
in which a component moves by more than 10 % of full scale and the sample stays GOOD. The readings are made here and estimated by
`tactilectl decouple`; nothing of the product's own damage is used. Then the share of the undamaged rows that are GOOD. An OLD_BIN
whose calibrations state nothing is measured alone. `made` are recordings of made_recordings.py. The models table, hair and
capacitive are simulated: calibrated on one course of their scene, damaged in another.
"""
import argparse
import csv
import json
import lzma
import math
import pathlib
import random
import re
import statistics
import subprocess
import sys
import tempfile

import rows_alone

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
LABELS = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
KINDS = ("stuck", "half_gain", "drifting", "exchanged", "zero")
ROWS = 400  # rows of the last third, evenly
METHOD = {"table": "auto", "hair": "auto", "capacitive": "quadratic"}  # the others of `capacitive` take minutes


def rows_of(path):
    with (lzma.open(path, "rt") if path.suffix == ".xz" else open(path, newline="", encoding="utf-8")) as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def write(path, rows):
    with open(path, "w", newline="", encoding="utf-8") as file:
        out = csv.DictWriter(file, rows[0].keys())
        out.writeheader()
        out.writerows(rows)


def simulated(model, seed, tactilectl, folder):
    """Labelled rows of the scene on which `tradeoff` calibrates the model; another seed is another course of it."""
    scene = ROOT / f"config/scenes/tradeoff_{model}_calibrate.toml"
    subprocess.run([tactilectl, "simulate", "--scene", scene, "--seed", str(seed), "--out", folder / "s.csv", "--truth",
                    folder / "t.csv"], check=True, capture_output=True)
    rows = [signal | {label: truth[label] for label in LABELS[:3]}
            for signal, truth in zip(rows_of(folder / "s.csv"), rows_of(folder / "t.csv"))]
    return rows[::max(1, len(rows) // 6000)]


def recordings(given, tactilectl, folder):
    """Yields name, model, the rows to calibrate on and those to damage, of each recording."""
    def split(name, rows):
        last = [(i * 30 // len(rows) % 3 == 2) if given.stretches else i >= len(rows) * 2 // 3 for i in range(len(rows))]
        return (name, "generic", [row for row, is_last in zip(rows, last) if not is_last],
                [row for row, is_last in zip(rows, last) if is_last])
    if given.file:
        yield split(given.file.stem, rows_of(given.file))
        return
    data = ROOT / "tests/data"
    for name in given.sets.split(","):
        if name == "skin":
            yield split(name, rows_of(data / "eflesh/normal_labelled.csv"))
        elif name == "shear":
            yield split(name, rows_of(data / "eflesh/shear_labelled.csv.xz"))
        elif name == "tongs":
            yield split(name, rows_of(data / "tongs/train_labelled.csv.xz"))
        elif name == "made":
            maker = pathlib.Path(__file__).with_name("made_recordings.py")
            subprocess.run([sys.executable, maker, folder, "--seed", str(given.seed), "--count", str(given.count)], check=True,
                           stdout=subprocess.DEVNULL)
            for path in sorted(folder.glob("*_fit.csv")):
                yield split("made " + path.stem[:3], rows_of(path))
        else:
            yield name, name, simulated(name, 1, tactilectl, folder), simulated(name, 2, tactilectl, folder)


def damaged(kind, rows, i, k, channels, zero, span, chance):
    """Returns row i with its channel k damaged."""
    row, name = dict(rows[i]), channels[k]
    value = float(row[name])
    if kind == "stuck":
        row[name] = rows[chance.randrange(max(1, i))][name]
    elif kind == "half_gain":
        row[name] = zero[k] + (value - zero[k]) / 2
    elif kind == "drifting":
        row[name] = value + 0.3 * span[k] * (i + 1) / len(rows)
    elif kind == "exchanged" and len(channels) > 1:
        other = chance.choice([each for each in channels if each != name])
        row[name], row[other] = row[other], row[name]
    elif kind == "zero":
        row[name] = zero[k]
    return row


def estimated(tactilectl, calibration, rows, folder):
    write(folder / "in.csv", rows)
    subprocess.run([tactilectl, "decouple", *rows_alone.alone(tactilectl), "--calibration", calibration, "--in", folder / "in.csv", "--out", folder / "out.csv"],
                   check=True, capture_output=True)
    return rows_of(folder / "out.csv")


def judge(tactilectl, model, seen, unseen, method, folder):
    """Returns (stated, measured, GOOD): for each kind the mean over the channels, or the reason why there is no calibration."""
    unseen = [unseen[i * len(unseen) // ROWS] for i in range(ROWS)] if len(unseen) > ROWS else unseen
    write(folder / "seen.csv", seen)
    done = subprocess.run([tactilectl, "calibrate", "--model", model, "--method", method, "--in", folder / "seen.csv", "--out",
                           folder / "c.toml", "--force", "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        return done.stderr.strip().splitlines()[-1]
    report = json.loads(done.stdout)
    text = (folder / "c.toml").read_text()
    zero = [float(x) for x in re.search(r"^zero = \[(.*?)\]", text, re.M | re.S)[1].split(",")]
    channels = report["channels"]
    unseen = [row for row in unseen if all(row[name] for name in channels)]
    labels = {label: c["full_scale"] for c in report["components"] for label in LABELS if label.startswith(c["name"] + "_")}
    span = [max(float(r[c]) for r in seen if r[c]) - min(float(r[c]) for r in seen if r[c]) for c in channels]
    sound = estimated(tactilectl, folder / "c.toml", unseen, folder)
    good = [i for i, row in enumerate(sound) if row["quality"] == "good"]
    if not good:
        return "no undamaged row of the last third is GOOD"
    measured, chance = {}, random.Random(5)
    for kind in KINDS:
        shares = []
        for k in range(len(channels)):
            off = estimated(tactilectl, folder / "c.toml",
                            [damaged(kind, unseen, i, k, channels, zero, span, chance) for i in range(len(unseen))], folder)
            shares.append(statistics.fmean(
                off[i]["quality"] == "good" and any(abs(float(off[i][c]) - float(sound[i][c])) > 0.1 * scale for c, scale in labels.items())
                for i in good))
        measured[kind] = statistics.fmean(shares)
    stated = report.get("undetected_damage")
    return {kind: stated[kind]["mean"] if stated else math.nan for kind in KINDS}, measured, len(good) / len(sound)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bins", nargs="+", type=pathlib.Path)
    parser.add_argument("--file", type=pathlib.Path)
    parser.add_argument("--sets", default="skin,shear,tongs,table,hair,capacitive,made")
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--stretches", action="store_true")
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--methods", default="matrix,quadratic,rbf")
    given = parser.parse_args()
    differences = []
    with tempfile.TemporaryDirectory() as kept, tempfile.TemporaryDirectory() as scratch:
        for name, model, seen, unseen in recordings(given, given.bins[0] / "tactilectl", pathlib.Path(kept)):
            for method in given.methods.split(",") if model == "generic" else [METHOD[model]]:
                for program in given.bins:
                    found = judge(program / "tactilectl", model, seen, unseen, method, pathlib.Path(scratch))
                    head = f"{name:11} {method:10}" + (f" {program}" if len(given.bins) > 1 else "")
                    if isinstance(found, str):
                        print(f"{head} {found}", flush=True)
                        continue
                    stated, measured, good = found
                    print(head, "  ".join(f"{kind} {100 * stated[kind]:.1f}/{100 * measured[kind]:.1f}" for kind in KINDS),
                          f" GOOD {100 * good:.1f}", flush=True)
                    differences += [(abs(stated[kind] - measured[kind]), f"{name} {method} {kind}") for kind in KINDS
                                    if math.isfinite(stated[kind])]
    if differences:
        far = [d for d in differences if d[0] > 0.05]
        print(f"{len(differences)} shares: stated within 5 points {100 * (1 - len(far) / len(differences)):.1f} %, "
              f"mean difference {100 * statistics.fmean(d[0] for d in differences):.1f} points, "
              f"largest {100 * max(differences)[0]:.1f} ({max(differences)[1]})")


if __name__ == "__main__":
    main()
