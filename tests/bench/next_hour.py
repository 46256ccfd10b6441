#!/usr/bin/env python3
"""Claims of calibrations, and their errors in the time after them, on made recordings of sensors that drift.

    next_hour.py [--methods matrix,quadratic,rbf] [--seed 77] [--count 100] BIN [OTHER_BIN]
    next_hour.py --folder FOLDER [--only 007,010] [--each] BIN [OTHER_BIN]

made_recordings.py makes pairs NNN_fit.csv, which is calibrated, and NNN_later.csv, the time after it with the true loads. A claim is
the held-out error; the sd is that of each row, and the sd that grows is hypot(sd, zero_rate_per_h x hours since the
calibration), as the daemon states it. Several builds are judged on the same files.
"""
import argparse
import csv
import json
import math
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile

import rows_alone

COMPONENTS = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def rates_of(calibration):
    """Returns the rates that the daemon takes: the sd where no drift was seen."""
    text = calibration.read_text()
    found = re.search(r"^zero_rate_per_h = \[(.*)\]", text, re.M) or re.search(r"^sd = \[(.*)\]", text, re.M)
    return [float(each) for each in found[1].split(",")]


def one(program, fit, later, method):
    """For each component: claimed, true rms (fractions of full scale), rows: within 1 sd, with growth, GOOD, GOOD beyond 5 sd, with growth."""
    with tempfile.TemporaryDirectory() as folder:
        calibration, forces = pathlib.Path(folder) / "calibration.toml", pathlib.Path(folder) / "forces.csv"
        tactilectl = [pathlib.Path(program) / "tactilectl"]
        done = subprocess.run(tactilectl + ["calibrate", "--model", "generic", "--method", method, "--in", fit, "--out", calibration,
                                            "--json"], capture_output=True, text=True)
        if done.returncode != 0:
            return fit.name, method, done.stderr.strip().splitlines()[-1:], {}, ""
        report = json.loads(done.stdout)
        subprocess.run(tactilectl + ["decouple", *rows_alone.alone(tactilectl[0]), "--calibration", calibration, "--in", later, "--out", forces], check=True,
                       capture_output=True)
        truth, estimates, rates = rows_of(later), rows_of(forces), rates_of(calibration)
        end_s, result = float(truth[0]["t_s"]), {}
        for i, component in enumerate(report["components"]):
            label = next(c for c in COMPONENTS if c.startswith(component["name"] + "_"))
            rate = rates[i]
            tally = [0] * 5
            squares = 0.0
            for row, estimate in zip(truth, estimates):
                if not estimate[label] or not estimate["sd_" + label]:
                    continue
                error, sd = abs(float(estimate[label]) - float(row[label])), float(estimate["sd_" + label])
                grown = math.hypot(sd, rate * (float(row["t_s"]) - end_s) / 3600)
                good = estimate["quality"] == "good"
                squares += error * error
                for k, holds in enumerate((error <= sd, error <= grown, good, good and error > 5 * sd, good and error > 5 * grown)):
                    tally[k] += holds
            n, scale = len(truth), component["full_scale"]
            result[component["name"]] = (component["held_out_rms"] / scale, math.sqrt(squares / n) / scale, *[k / n for k in tally])
        how = re.search(r'^validation = "(.*)"', calibration.read_text(), re.M)
        return fit.name, method, report["warnings"], result, how[1] if how else ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bins", nargs="+")
    parser.add_argument("--folder", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--methods", default="matrix")
    parser.add_argument("--only", default="")
    parser.add_argument("--each", action="store_true", help="also a line for each recording")
    given = parser.parse_args()
    if given.folder:
        return judge(given, given.folder)
    with tempfile.TemporaryDirectory() as folder:
        maker = pathlib.Path(__file__).with_name("made_recordings.py")
        subprocess.run([sys.executable, maker, folder, "--seed", str(given.seed), "--count", str(given.count)], check=True,
                       stdout=subprocess.DEVNULL)
        judge(given, pathlib.Path(folder))


def judge(given, folder):
    fits = [f for f in sorted(folder.glob("*_fit.csv")) if not given.only or f.name.split("_")[0] in given.only.split(",")]
    for method in given.methods.split(","):
        for program in given.bins:
            done = [one(program, f, f.with_name(f.name.replace("_fit", "_later")), method) for f in fits]
            every = [values for _, _, _, result, _ in done for values in result.values()]
            for name, _, warnings, result, how in done:
                if given.each:
                    print(name[:3], how, " ".join(f"{c} {100 * v[0]:.2f}/{100 * v[1]:.2f}%" for c, v in result.items()), len(warnings),
                          *(warnings if not result else []))
            ratios = sorted(v[0] / v[1] for v in every if math.isfinite(v[0]))
            mean = [100 * statistics.fmean(v[k] for v in every) for k in range(2, 7)]
            good = max(mean[2], 1e-9)
            print(f"{program} {method}: {sum(bool(r) for _, _, _, r, _ in done)} of {len(done)} calibrated; claimed over true: median "
                  f"{statistics.median(ratios):.2f}, quartiles {ratios[len(ratios) // 4]:.2f} {ratios[3 * len(ratios) // 4]:.2f}, "
                  f"5 % {ratios[len(ratios) // 20]:.2f}, "
                  f"within 1 sd {mean[0]:.1f} % (grown {mean[1]:.1f}); GOOD {mean[2]:.1f} %, of these beyond 5 sd "
                  f"{100 * mean[3] / good:.2f} % (grown {100 * mean[4] / good:.2f})")


if __name__ == "__main__":
    main()
