#!/usr/bin/env python3
"""Damaged channels of made skins (made_skins.py) that nobody sees, by one program or by several in one run.

    damaged_skins.py [--seeds 1,2] [--methods matrix,quadratic,rbf] [--one-session] [BINARY_DIR ...]

Each skin is calibrated on two sessions, or on the first of them; the rows of a third one are decoupled as they are, and with each channel in turn stuck at its
first value, at half gain about its rest, drifting by 30 % of its range, exchanged with the next channel, and dead (0). Wrong: rows that
are GOOD and moved by more than 10 % of a component's full scale, mean over channels and kinds. Lost: undamaged rows that are not GOOD.
"""
import argparse
import csv
import os
import statistics
import subprocess
import sys
import tempfile

import rows_alone

HERE = os.path.dirname(os.path.abspath(__file__))
KINDS = ("stuck", "half", "drift", "exchanged", "dead")
LABELS = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
REST = 20  # rows at the begin of a recording


class Recording:
    def __init__(self, path):
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
        self.labels = [name for name in rows[0] if name in LABELS]
        self.names = [name for name in rows[0] if name not in LABELS and name not in ("t_s", "session")]
        self.times = [row["t_s"] for row in rows]
        self.channels = [[float(row[name]) for name in self.names] for row in rows]
        self.full_scale = [max(abs(float(row[name])) for row in rows) for name in self.labels]
        columns = list(zip(*self.channels))
        self.width = [max(column) - min(column) for column in columns]
        self.rest = [statistics.mean(column[:REST]) for column in columns]


def damaged(kind, recording, width, k):
    rows = [list(row) for row in recording.channels]
    for i, row in enumerate(rows):
        if kind == "stuck":
            row[k] = recording.channels[0][k]
        elif kind == "half":
            row[k] = recording.rest[k] + 0.5 * (row[k] - recording.rest[k])
        elif kind == "drift":
            row[k] += (1 if k % 2 == 0 else -1) * 0.3 * width[k] * i / (len(rows) - 1)
        elif kind == "exchanged":
            other = (k + 1) % len(row)
            row[k], row[other] = row[other], row[k]
        else:
            row[k] = 0.0
    return rows


def run(*words):
    done = subprocess.run(words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, timeout=120)
    if done.returncode != 0:
        sys.exit(f"{' '.join(words)}: {done.stderr[-300:]}")


def decoupled(tool, folder, recording, rows):
    """Quality and components of each row."""
    with open(folder + "/in.csv", "w") as file:
        file.write(",".join(["t_s", *recording.names]) + "\n")
        for t_s, row in zip(recording.times, rows):
            file.write(",".join([t_s, *(f"{number:.9g}" for number in row)]) + "\n")
    run(tool, "decouple", *rows_alone.alone(tool), "--calibration", folder + "/c.toml", "--in", folder + "/in.csv", "--out", folder + "/out.csv")
    with open(folder + "/out.csv", newline="") as file:
        return [(row["quality"], [float(row[name] or "nan") for name in recording.labels]) for row in csv.DictReader(file)]


def judge(tool, folder, at, method, recorded):
    """Percent wrong by kind, and percent lost."""
    fitted, unseen = Recording(f"{at}_{recorded}.csv"), Recording(at + "_unseen.csv")
    run(tool, "calibrate", "--model", "generic", "--method", method, "--in", f"{at}_{recorded}.csv", "--channels", ",".join(fitted.names),
        "--out", folder + "/c.toml", "--force")
    sound = decoupled(tool, folder, unseen, unseen.channels)
    n = len(sound)
    wrong = {}
    for kind in KINDS:
        counts = []
        for k in range(len(unseen.names)):
            damage = decoupled(tool, folder, unseen, damaged(kind, unseen, fitted.width, k))
            counts.append(sum(quality == "good" and not all(abs(a - b) <= 0.1 * scale for a, b, scale in zip(was, now, fitted.full_scale))
                              for (_, was), (quality, now) in zip(sound, damage)))
        wrong[kind] = 100 * statistics.mean(counts) / n
    return wrong, 100 * sum(quality != "good" for quality, _ in sound) / n


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--seeds", default="1,2")
    arguments.add_argument("--methods", default="matrix,quadratic,rbf")
    arguments.add_argument("--one-session", action="store_true")
    arguments.add_argument("binary_dirs", nargs="*", default=["build/release/bin"])
    asked = arguments.parse_args()
    tools = [os.path.abspath(folder) + "/tactilectl" for folder in asked.binary_dirs]
    all_wrong, all_lost = [[] for _ in tools], [[] for _ in tools]
    print("seed skin       method    for each program: wrong, by kind (" + " ".join(KINDS) + "), lost; %")
    with tempfile.TemporaryDirectory() as folder:
        for seed in asked.seeds.split(","):
            run(sys.executable, HERE + "/made_skins.py", "--seed", seed, "--out", folder)
            for name in sorted(file[:-8] for file in os.listdir(folder) if file.endswith("_fit.csv")):
                for method in asked.methods.split(","):
                    line = f"{seed:4} {name:10} {method:9}"
                    for i, tool in enumerate(tools):
                        wrong, lost = judge(tool, folder, f"{folder}/{name}", method, "one" if asked.one_session else "fit")
                        all_wrong[i].append(statistics.mean(wrong.values()))
                        all_lost[i].append(lost)
                        line += f" | {all_wrong[i][-1]:5.2f} ({' '.join(f'{share:.1f}' for share in wrong.values())}) {lost:5.2f}"
                    print(line, flush=True)
    for i, tool in enumerate(tools):
        print(f"all {i + 1}: wrong {statistics.mean(all_wrong[i]):.2f} lost {statistics.mean(all_lost[i]):.2f} "
              f"most lost {max(all_lost[i]):.2f}")


if __name__ == "__main__":
    main()
