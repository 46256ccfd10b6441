#!/usr/bin/env python3
"""Bounds for the figures of calibration_holds.py: no calibration from these recordings does better. Needs python3-numpy.

    calibration_bounds.py [--tactilectl build/release/bin/tactilectl]

drift    the least error that any linear map of the channels has on the rows it was fitted to, each channel off by 1 % of its range
swapped  1 % of the labels of the tongs swapped at random: share that is named by rules that know the errors of the true labels and name
         0.5 % of the good rows. The rules measure the error of a row in the metric of the inner 90 % of all errors: the error, the error
         less the median of three rows before and after, and both of them relative to the errors of 15 rows before and after
"""
import argparse
import pathlib
import subprocess
import tempfile

import numpy
from calibration_holds import number
from real_data import COMPONENTS, DATA, ROOT, rows_of, write

SEEDS = 20


def table(rows, columns):
    return numpy.array([[number(row[c]) for c in columns] for row in rows])


def drift():
    all_rows = rows_of(DATA / "eflesh/normal_labelled.csv")
    for session in "12":
        rows = [r for r in all_rows if r["session"] == session and r["fz_N"]]
        channels, force = table(rows, [c for c in rows[0] if c[0] == "B"]), table(rows, ["fz_N"])[:, 0]
        zeros = numpy.diag((0.01 * (channels.max(0) - channels.min(0))) ** 2)
        x, y, n = channels - channels.mean(0), force - force.mean(), len(rows)
        best = numpy.linalg.solve(x.T @ x / n + zeros, x.T @ y / n)
        rms = numpy.sqrt(numpy.mean((x @ best - y) ** 2) + best @ zeros @ best)
        print(f"skin, press, session {session}: best linear map {100 * rms / numpy.abs(force).max():.2f} %")


def median_around(values, k):
    padded = numpy.pad(values, ((k, k), (0, 0)), mode="edge")
    around = numpy.delete(numpy.lib.stride_tricks.sliding_window_view(padded, 2 * k + 1, axis=0), k, axis=2)
    return numpy.median(around, axis=2)


def squares(values, metric):
    return numpy.einsum("ij,jk,ik->i", values, metric, values)


def metric_of_inner(values):
    metric = numpy.linalg.inv(numpy.cov(values.T))
    for _ in range(5):
        size = squares(values, metric)
        metric = numpy.linalg.inv(numpy.cov(values[size < numpy.quantile(size, 0.9)].T))
    return metric


def named_share(error, labels, local):
    """Returns the share of swapped labels whose error exceeds that of 99.5 % of the true ones."""
    scale = numpy.maximum(median_around(numpy.abs(error), 15), numpy.median(numpy.abs(error), 0) / 2) if local else numpy.ones_like(error)
    metric = metric_of_inner(error / scale)
    limit = numpy.quantile(squares(error / scale, metric), 0.995)
    full_scale, rng, named, swaps = numpy.abs(labels).max(0), numpy.random.default_rng(5), 0, 0
    for _ in range(SEEDS):
        chosen = rng.choice(len(labels), len(labels) // 100 // 2 * 2, replace=False)
        for here, there in ((chosen[::2], chosen[1::2]), (chosen[1::2], chosen[::2])):
            step = labels[there] - labels[here]
            counts = (numpy.abs(step) > 0.05 * full_scale).any(1)
            named += (squares((error[here] - step) / scale[here], metric)[counts] > limit).sum()
            swaps += counts.sum()
    return named / swaps


def swapped(tactilectl, folder):
    rows = rows_of(DATA / "tongs/train_labelled.csv.xz")
    rows = rows[:len(rows) // 2]
    write(rows, folder / "train.csv")
    labels = table(rows, COMPONENTS)
    for method in ("quadratic", "rbf"):
        subprocess.run([tactilectl, "calibrate", "--model", "generic", "--method", method, "--in", folder / "train.csv", "--out",
                        folder / "c.toml", "--force"], check=True, capture_output=True)
        subprocess.run([tactilectl, "decouple", "--calibration", folder / "c.toml", "--in", folder / "train.csv", "--out", folder / "f.csv"], check=True)
        error = table(rows_of(folder / "f.csv"), COMPONENTS) - labels
        for name, values in (("error", error), ("error less those around", error - median_around(error, 3))):
            for local in (False, True):
                print(f"soft tongs, {method}, {name}{', relative to those around' if local else ''}: "
                      f"{100 * named_share(values, labels, local):.0f} % named", flush=True)


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--tactilectl", default=ROOT / "build/release/bin/tactilectl")
    given = arguments.parse_args()
    drift()
    with tempfile.TemporaryDirectory() as name:
        swapped(given.tactilectl, pathlib.Path(name))
