#!/usr/bin/env python3
"""Defects that the scenes must notice. Each scene of config/scenes with an [[expect]] runs without the daemon, with other
seeds than its own: no expectation may fail. Then each defect of judge.py is planted in the decoupled forces, and at least
three scenes must fail.

    defects.py [--seeds 20] [--effects auto] [--jobs 2] [NAME ...]
    defects.py --limits [NAME ...]     the largest errors over ten more seeds and the limits that follow, to be written into a scene
"""
import argparse
import math
import multiprocessing
import pathlib
import sys
import tempfile
import time

sys.dont_write_bytecode = True
from judge import AXES, DEFECTS, LIMITS, NOT_JUDGED  # noqa: E402
from offline import TARE_S, read_forces, signals_of, tared  # noqa: E402
from run import (ROOT, Refused, Scene, calibration_of, column, constant_temperature_words, model_of, read_truth,  # noqa: E402
                 row_of, run_calibration, run_ctl, scenes_in, span_s, truth_of)

NEEDED = 3            # scenes that each defect fails
FIRST_SEED = 1001     # judging seeds
FIRST_OTHER = 2001    # seeds that limits are made from
MARGIN = 1.3          # limit over largest measured error
DELAY_MS = {"capacitive_press": 50, "capacitive_shear": 50}  # converters that read the electrodes in turn; the daemon knows it


def played(job):
    """{number of the expectation: row without a defect, {defect: failures}} of a scene with a seed."""
    path, effects, seed, calibrations, with_defects = job
    scene, rows = Scene(path), []
    with tempfile.TemporaryDirectory(prefix="tactiled-defects-") as name:
        folder = pathlib.Path(name)
        truths = read_truth(truth_of(path, folder, "--seed", seed), {sensor for sensor, _ in scene.expectations})
        signals = signals_of(run_ctl, scene, effects, seed, folder)
        for sensor, expect in scene.expectations:
            calibration, forces = calibration_of(scene, expect, calibrations), folder / "forces.csv"
            method = ("--method", expect["method"]) if "method" in expect else ()
            run_ctl("decouple", "--each-row-alone", "--calibration", calibration, *method, *constant_temperature_words(calibration),
                    "--delay-ms", DELAY_MS.get(path.stem, 0), "--in", signals[sensor], "--out", forces)
            series = read_forces(forces)
            begin_s, end_s = span_s(expect)
            if expect.get("tare", True):
                series, begin_s = tared(series), max(begin_s, TARE_S[1])
            judged = {defect: row_of(scene, sensor, expect, plant(series), truths[sensor], begin_s, end_s)["failures"]
                      for defect, plant in DEFECTS.items()} if with_defects else {}
            rows.append((row_of(scene, sensor, expect, series, truths[sensor], begin_s, end_s), judged))
    return path.stem, effects, seed, rows


def limits(results):
    """Prints for each expectation what was measured and 1.3 times that, with the stated sd and the seeds' scatter."""
    gathered = {}
    for name, _, _, rows in results:
        for number, (row, _) in enumerate(rows):
            gathered.setdefault((name, number), []).append(row)
    for (name, number), rows in sorted(gathered.items()):
        print(f"{name} {number}: {rows[0]['sensor']} {rows[0]['method']}")
        for key, what in (("within_N", "most"), *LIMITS.items()):
            line = []
            for axis in AXES:
                values = [row["errors"][axis][what] for row in rows]
                if any(v is None for v in values) or axis not in rows[0]["axes"]:
                    line.append("      -")
                    continue
                most, mean = max(map(abs, values)), sum(values) / len(values)
                scatter = math.sqrt(sum((v - mean) ** 2 for v in values) / len(values))
                line.append(f"{MARGIN * most + 3 * scatter:7.2g}")
            print(f"    {key:14} {' '.join(line)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="scenes by name; all by default")
    parser.add_argument("--seeds", type=int, help="20; 10 for limits")
    parser.add_argument("--effects", default="auto")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scenes", type=pathlib.Path, default=ROOT / "config/scenes")
    parser.add_argument("--limits", action="store_true", help="measure, judge nothing")
    words = parser.parse_args()
    began = time.monotonic()
    scenes, needed = scenes_in(words.scenes, words.names)
    with tempfile.TemporaryDirectory(prefix="tactiled-defects-") as name, multiprocessing.Pool(words.jobs) as pool:
        calibrations = pathlib.Path(name)
        for (path, method, _), said, good in pool.imap(run_calibration, [(*job, calibrations) for job in needed]):
            if not good:
                sys.exit(f"{path.stem} {method}: {said}")
        first, count = (FIRST_OTHER, 10) if words.limits else (FIRST_SEED, 20)
        seeds = [first + k for k in range(words.seeds or count)]
        jobs = [(path, effects, seed, calibrations, seed == seeds[0] and not words.limits)
                for seed in seeds for effects in words.effects.split(",") for path in scenes]
        results = pool.map(played, jobs, chunksize=1)
    if words.limits:
        limits(results)
        return
    failed, noticed, axes_by = 0, {defect: set() for defect in DEFECTS}, 0
    for name, effects, seed, rows in results:
        for row, judged in rows:
            axes_by += 1
            if row["failures"]:
                failed += 1
                print(f"FAIL {name} {row['sensor']} {row['method']}, effects {effects}, seed {seed}: {'; '.join(row['failures'])}")
            for defect, failures in judged.items():
                if failures and not row["failures"]:
                    noticed[defect].add(name)
    for defect, names in noticed.items():
        bad = len(names) < NEEDED and not words.names
        failed += bad
        print(f"{'FAIL' if bad else 'ok  '} {defect:20} {len(names):3} scenes: {' '.join(sorted(names))}")
    print(f"{len(scenes)} scenes, {axes_by} judgements without a defect, {len(seeds)} seeds: {failed} failed; "
          f"{time.monotonic() - began:.0f} s")
    sys.exit(1 if failed or not scenes else 0)


if __name__ == "__main__":
    main()
