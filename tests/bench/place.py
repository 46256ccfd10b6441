#!/usr/bin/env python3
"""Presses simulated sensors beside the places of their calibration, and counts the values that are GOOD and wrong.

    place.py [--seeds 10] [--first 9001] [--models hair,capacitive,table,generic] [--bin build/release/bin]

Each sensor is calibrated in the middle, and anywhere within a radius, by a calibration scene of config/scenes; loads held at a distance from the
middle, in a random direction, are then decoupled by every method of the calibration. A row is judged once its load has been held for the
calibration's time to settle. `wrong`: share of the rows that are GOOD and off by more than 5 sd in some component.
"""
import argparse
import csv
import math
import pathlib
import random
import re
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/scenes"))
import offline  # noqa: E402
import run  # noqa: E402

# calibration scene, radius of its places in m, largest press and shear of the loads in N, methods
SENSORS = {"hair": ("tradeoff_hair_calibrate", 0.3e-3, 0.05, 0.02, ("sum_diff", "matrix", "physics")),
           "capacitive": ("calibrate_capacitive", 1.6e-3, 8, 1, ("quadratic", "ratio", "overlap")),
           "table": ("tradeoff_table_calibrate_place", 0.5e-3, 1, 0.4, ("linear", "matrix", "nonlinear", "map")),
           "generic": ("tradeoff_generic_calibrate", 1.5e-3, 8, 1, ("matrix", "quadratic", "rbf"))}
DISTANCES = (0, 0.5, 1, 1.5, 2)  # relative to the radius
LOADS = 12


def calibrated(text, folder, method, radius, out):
    scene = folder / f"{out.stem}.scene.toml"
    scene.write_text(re.sub(r"within_m = \S+\n", "", text).replace('do = "wander"', f'do = "wander"\nwithin_m = {radius}'))
    try:
        run.calibrate(scene, method, out)
    except run.Refused as refused:
        print(f"# {out.stem}: {str(refused).strip().splitlines()[-1][:150]}", flush=True)
        return None
    return out


def judged(text, folder, press_N, shear_N, distance_m, hold_s, seed):
    """A scene: loads held at one place."""
    rng, head = random.Random(seed), text.partition("[[motion]]")[0]
    angle = rng.uniform(0, 2 * math.pi)
    motions = ['do = "hold"\nfor_s = 1', f'do = "move"\nx_m = {distance_m * math.cos(angle):.6g}\ny_m = {distance_m * math.sin(angle):.6g}']
    for _ in range(LOADS):
        motions += [f'do = "press"\nto_N = {rng.uniform(0.2, 1) * press_N:.6g}',
                    f'do = "shear"\nto_N = {rng.uniform(0, 1) * shear_N:.6g}\ndirection_deg = {rng.uniform(0, 360):.5g}',
                    f'do = "hold"\nfor_s = {2 * hold_s}']
    path = folder / f"judged_{seed}_{distance_m}.toml"
    path.write_text(head + "".join(f"[[motion]]\n{motion}\n" for motion in motions))
    return path


def rows_held(truth, name, settle):
    """Times in us of the rows whose load has been the same for `settle` rows."""
    still, count, held = None, 0, set()
    for t_us, load in truth[name].items():
        still, count = load, count + 1 if load == still else 0
        if count >= settle and t_us > 1_200_000:
            held.add(t_us)
    return held


def counts(calibration, method, signals, truth, held, folder):
    """Rows, GOOD ones, and GOOD ones beyond 5 sd."""
    out = folder / "forces.csv"
    run.run_ctl("decouple", "--calibration", calibration, "--method", method, *run.constant_temperature_words(calibration),
                "--in", signals, "--out", out)
    series = offline.tared(offline.read_forces(out))
    rows = good = wrong = 0
    for i, t_s in enumerate(series.t_s):
        t_us = round(t_s * 1e6)
        if t_us not in held:
            continue
        rows += 1
        if series.quality[i] != "good":
            continue
        good += 1
        wrong += any(abs(series.force[a][i] - truth[t_us][a]) > 5 * series.sd[a][i] for a in range(3) if not math.isnan(series.force[a][i]))
    return rows, good, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", default=ROOT / "build/release/bin", type=pathlib.Path)
    parser.add_argument("--seeds", default=10, type=int)
    parser.add_argument("--first", default=9001, type=int)
    parser.add_argument("--models", default=",".join(SENSORS))
    asked = parser.parse_args()
    run.BIN = asked.bin
    print("| method | calibrated | " + " | ".join(f"at {d:g} r: GOOD, wrong %" for d in DISTANCES) + " |")
    print("|---|---|" + "---|" * len(DISTANCES), flush=True)
    for name in asked.models.split(","):
        stem, radius, press_N, shear_N, methods = SENSORS[name]
        path = ROOT / f"config/scenes/{stem}.toml"
        text = path.read_text().replace('"../', f'"{ROOT}/config/')
        with tempfile.TemporaryDirectory() as temporary:
            folder = pathlib.Path(temporary)
            files = {(method, where): calibrated(text, folder, method, r, folder / f"{name}_{method}_{where.split()[0]}.toml")
                     for method in methods for where, r in (("middle", 0), (f"within r = {radius * 1e3:g} mm", radius))}
            total = {}
            scene = run.Scene(path)
            settle_s = scene.toml.get("calibrate", {}).get("settle_s", 0.05)
            sensor = scene.toml["sensor"][0]["name"]
            for seed in range(asked.first, asked.first + asked.seeds):
                for d in DISTANCES:
                    judged_path = judged(text, folder, press_N, shear_N, d * radius, max(0.1, settle_s), 10 * seed + int(2 * d))
                    signals = folder / "signals.csv"
                    run.run_ctl("simulate", "--scene", judged_path, "--effects", "all", "--seed", seed, "--out", signals)
                    truth = run.read_truth(run.truth_of(judged_path, folder), [sensor])
                    held = rows_held(truth, sensor, round(settle_s * scene.rate_Hz))
                    channels = scene.toml.get("calibrate", {}).get("channels")
                    if channels:  # the others are not calibrated
                        with open(signals) as file:
                            table = list(csv.DictReader(file))
                        with open(signals, "w", newline="") as file:
                            writer = csv.DictWriter(file, ["t_s", *channels], extrasaction="ignore")
                            writer.writeheader()
                            writer.writerows(table)
                    for key, calibration in files.items():
                        if calibration is not None:
                            one = counts(calibration, key[0], signals, truth[sensor], held, folder)
                            total[key, d] = tuple(map(sum, zip(total.get((key, d), (0, 0, 0)), one)))
            for key, calibration in files.items():
                if calibration is None:
                    continue
                cells = [f"{100 * g / max(1, n):.0f}, {100 * w / max(1, n):.1f}" for n, g, w in (total[key, d] for d in DISTANCES)]
                print(f"| {name}/{key[0]} | {key[1]} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
