#!/usr/bin/env python3
"""Slip on real recordings: eFlesh's 69 sequences of five magnetometers, of which 52 were pulled. Leave one sequence out, four
rules beside each other, each with its threshold or weights from the other 68 alone:

    change    sum over the magnetometers of their tangential fields' ranges, one threshold
    logistic  logistic regression on the range of each channel            (plain numpy, ridge)
    load      the rule by which decoupling/grasp sees a load come on: shear off its beginning by so many of its own noises,
              which needs no calibration; one threshold
    within    the same of each magnetometer for itself, and against what it was at most 50 steps before: a pull comes on within
              1.8 s, what a skin creeps does not; one threshold. Any span from 30 to 150 steps is right as often.

Not shown: a sequence is one state, not an onset with a time, at 28 steps a second, without a press. The slip
detector itself looks for falls within 7 ms of shear over press and cannot run on it.

    slip_real.py slip_sequences.csv
"""
import argparse
import csv

import numpy as np


def read(path):
    sequences, pulled = {}, {}
    with open(path) as file:
        for row in csv.DictReader(file):
            key = row["sequence"]
            sequences.setdefault(key, []).append([float(row[f"B{k}"]) for k in range(1, 16)])
            pulled[key] = int(row["pulled"])
    fields = [np.array(rows).reshape(-1, 5, 3) for rows in sequences.values()]
    return fields, np.array([pulled[key] for key in sequences])


def load(field, first=20, window=10):
    """Largest shear of all taxels from where it began, means of `window` steps, in noises of the first steps."""
    shear = field[:, :, :2].sum(axis=1)
    noise = max(np.diff(shear[:first], axis=0).std() / np.sqrt(2 * window), 1e-9)
    means = np.array([shear[i:i + window].mean(axis=0) for i in range(0, len(shear) - window + 1, window)])
    return np.linalg.norm(means - means[0], axis=1).max() / noise


def load_within(field, span=5, window=10):
    """Largest change of the shear, summed over the taxels, between means of `window` steps that are at most `span` apart."""
    means = np.array([field[i:i + window, :, :2].mean(axis=0) for i in range(0, len(field) - window + 1, window)])
    return max(np.linalg.norm(means[d:] - means[:-d], axis=2).sum(axis=1).max() for d in range(1, span + 1))


def best_threshold(values, labels):
    """Returns the middle one of the thresholds with the most right results."""
    order = np.sort(values)
    cuts = np.concatenate([[order[0] - 1], (order[1:] + order[:-1]) / 2])
    right = np.array([((values > cut) == labels).mean() for cut in cuts])
    best = cuts[right == right.max()]
    return best[len(best) // 2]


def by_threshold(values, labels):
    right = 0
    for out in range(len(values)):
        kept = np.arange(len(values)) != out
        right += (values[out] > best_threshold(values[kept], labels[kept] == 1)) == (labels[out] == 1)
    return right


def by_logistic(features, labels, ridge=1.0):
    right = 0
    for out in range(len(labels)):
        kept = np.arange(len(labels)) != out
        mean, sd = features[kept].mean(axis=0), features[kept].std(axis=0) + 1e-12
        x = np.column_stack([np.ones(len(labels)), (features - mean) / sd])
        w = np.zeros(x.shape[1])
        for _ in range(50):  # Newton
            p = 1 / (1 + np.exp(-np.clip(x[kept] @ w, -30, 30)))
            penalty = ridge * np.r_[0, np.ones(len(w) - 1)]
            hessian = x[kept].T * (p * (1 - p)) @ x[kept] + np.diag(penalty + 1e-9)
            w -= np.linalg.solve(hessian, x[kept].T @ (p - labels[kept]) + penalty * w)
        right += (x[out] @ w > 0) == (labels[out] == 1)
    return right


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences")
    fields, labels = read(parser.parse_args().sequences)
    n = len(labels)
    features = np.array([np.ptp(f, axis=0).ravel() for f in fields])
    changes = np.array([np.ptp(f[:, :, :2], axis=0).sum() for f in fields])
    loads = np.array([load(f) for f in fields])
    within = np.array([load_within(f) for f in fields])
    print(f"{n} sequences, {labels.sum()} pulled; always the more frequent answer: {100 * max(labels.mean(), 1 - labels.mean()):.1f} %\n")
    print("| rule, leave one sequence out | right | % |\n|---|---|---|")
    for name, right in (("change, one threshold", by_threshold(changes, labels)),
                        ("logistic regression", by_logistic(features, labels)),
                        ("load, one threshold", by_threshold(loads, labels)),
                        ("load within 1.8 s, one threshold", by_threshold(within, labels))):
        print(f"| {name} | {right} of {n} | {100 * right / n:.1f} |")
    for name, values in (("change", changes), ("load", loads), ("load within 1.8 s", within)):
        rest, pulled = np.sort(values[labels == 0])[::-1], np.sort(values[labels == 1])
        above = (rest > pulled[0]).sum()
        print(f"\n{name}: {above} of the others lie above the least pulled one, which is {pulled[0] / rest[above]:.2f} times the next")


if __name__ == "__main__":
    main()
