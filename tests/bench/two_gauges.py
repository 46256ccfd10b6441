#!/usr/bin/env python3
"""The two-gauge grasper of Dargahi and Najarian (2004): the force and the place of one load from two strain gauges on a beam.

    two_gauges.py [--bin build/release/bin] [--origin-mm 40] [--all]

The strain at s is c F (x - s) for a force F at x, beyond both gauges: two readings, two unknowns. The recordings are made from this
formula with noise, calibrated with generic/matrix by `tactilectl calibrate` and judged with `tactilectl decouple` on another recording:
20 forces of 0.5 to 10 N at 7 places, each held for 40 readings. The bound of Cramer and Rao is the noise through the inverse of the
formula's Jacobian. --all prints each load. --origin-mm: the origin of S, from the clamp."""
import argparse
import csv
import math
import pathlib
import random
import subprocess
import sys
import tempfile

import rows_alone

S1_M, S2_M, STRAIN_PER_Nm, NOISE = 5e-3, 15e-3, 635e-6, 0.03e-6  # aluminium, 15 by 3 mm
FORCES_N = [0.5 * k for k in range(1, 21)]
PLACES_M = [5e-3 * k for k in range(5, 12)]  # from the clamp
ROWS, LIMIT = 40, 5


def strains(rng, force_N, x_m):
    return [STRAIN_PER_Nm * force_N * (x_m - s) + rng.gauss(0, NOISE) for s in (S1_M, S2_M)]


def bound_m(force_N, x_m):
    """The sd of x: d strain = c (x - s) dF + c F dx, solved for dx."""
    return NOISE / (STRAIN_PER_Nm * force_N * (S2_M - S1_M)) * math.hypot(x_m - S1_M, x_m - S2_M)


def bound_N():
    return math.sqrt(2) * NOISE / (STRAIN_PER_Nm * (S2_M - S1_M))


def write(path, loads, rng, origin_m, labelled):
    """Loads held for ROWS readings, and a rest before each seventh."""
    truth = []
    with path.open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["t_s", "G1", "G2", *(["fz_N", "my_Nm"] if labelled else [])])
        for n, (force_N, x_m) in enumerate(loads):
            for force in ([0] if n % 7 == 0 else []) + [force_N]:
                for _ in range(ROWS):
                    label = [-force, (x_m - origin_m) * force] if labelled else []
                    out.writerow([f"{len(truth) / 100:.2f}", *strains(rng, force, x_m), *label])
                    truth.append((force, x_m))
    return truth


def rms(values):
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan


def ctl(args, *words):
    done = subprocess.run([args.bin / "tactilectl", *map(str, words)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(done.stderr + done.stdout)


def number(cell):
    return float(cell) if cell else math.nan


def decoupled(args, folder, calibration, loads, rng):
    """The truth and the forces of a recording, row by row."""
    truth = write(folder / "signals.csv", loads, rng, args.origin_mm / 1e3, False)
    ctl(args, "decouple", *rows_alone.alone(args.bin / "tactilectl"), "--calibration", calibration, "--in", folder / "signals.csv", "--out", folder / "forces.csv")
    with (folder / "forces.csv").open() as file:
        return list(zip(truth, csv.DictReader(file), strict=True))


def judge(rows, origin_m, limit_N):
    """The figures of the rows with a force above limit_N."""
    force_errors, place_errors, to_bound, within, beyond, none, n = [], [], [], 0, 0, 0, 0
    for (force_N, x_m), row in rows:
        if force_N <= limit_N:
            continue
        n += 1
        force_errors.append(number(row["fz_N"]) + force_N)
        error, sd = number(row["cop_x_m"]) - (x_m - origin_m), number(row["sd_cop_x_m"])
        if math.isnan(error) or row["cop_y_m"]:
            none += 1
            continue
        place_errors.append(error)
        to_bound.append(error / bound_m(force_N, x_m))
        within += abs(error) <= sd
        beyond += abs(error) > 5 * sd
    return {"force": rms(force_errors), "place": rms(place_errors), "over_bound": rms(to_bound), "none": 100 * none / n,
            "within": 100 * within / max(1, len(place_errors)), "beyond": 100 * beyond / max(1, len(place_errors))}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bin", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parents[2] / "build/release/bin")
    parser.add_argument("--origin-mm", type=float, default=40, help="of S, from the clamp: the middle of the places")
    parser.add_argument("--all", action="store_true", help="print each load")
    args = parser.parse_args()
    args.bin = args.bin.resolve()
    origin_m, rng = args.origin_mm / 1e3, random.Random(5)
    loads = [(force, x) for x in PLACES_M for force in FORCES_N]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        shown = loads[:]
        rng.shuffle(shown)
        write(folder / "labelled.csv", shown, rng, origin_m, True)
        ctl(args, "calibrate", "--model", "generic", "--method", "matrix", "--channel-unit", "strain", "--in", folder / "labelled.csv",
            "--out", folder / "jaw.toml")
        rows = decoupled(args, folder, folder / "jaw.toml", loads, rng)
        if args.all:
            print("force_N  x_mm  rms of force_N  sd  rms of place_mm  sd  over the bound")
            for force_N, x_m in loads:
                own = [(t, row) for t, row in rows if t == (force_N, x_m)]
                one = judge(own, origin_m, 0)
                sd_N, sd_m = (rms([number(row[c]) for _, row in own]) for c in ("sd_fz_N", "sd_cop_x_m"))
                print(f"{force_N:7.1f} {x_m * 1e3:5.0f} {one['force']:14.4f} {sd_N:6.4f} {one['place'] * 1e3:13.4f} {sd_m * 1e3:7.4f} "
                      f"{one['over_bound']:8.2f}")
        all_rows = judge(rows, origin_m, 0)
        print(f"140 loads: force {all_rows['force'] * 1e3:.1f} mN rms, place {all_rows['place'] * 1e3:.4f} mm rms, "
              f"{all_rows['over_bound']:.3f} of the bound; within 1 sd {all_rows['within']:.1f} %, beyond 5 sd {all_rows['beyond']:.2f} %, "
              f"no place {all_rows['none']:.2f} %")
        faint = [(force * bound_N(), x) for x in PLACES_M for force in (1, 2, 3, 4, 6, 8, 10, 15)] * 2
        faint_rows = decoupled(args, folder, folder / "jaw.toml", faint, rng)
        for low, high in ((-1, 0), (0, 3.5), (3.5, 7), (7, 100)):
            own = [row for (force_N, _), row in faint_rows if low * bound_N() < force_N <= high * bound_N() + 1e-12]
            wrong = sum(bool(row["cop_x_m"]) != (-float(row["fz_N"]) > LIMIT * float(row["sd_fz_N"])) for row in own)
            print(f"press of {max(0, low):g} to {high:g} sd: {100 * sum(bool(row['cop_x_m']) for row in own) / len(own):.2f} % have a place, "
                  f"{wrong} against the limit")


if __name__ == "__main__":
    main()
