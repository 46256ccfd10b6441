#!/usr/bin/env python3
"""The stated uncertainty of simulated sensors in use. The unit of the statistics is the sensor.

    budget.py [--sensors 400] [--first 1] [--models table,hair,capacitive,generic] [--jobs 1] [--folder FOLDER] BIN [OTHER_BIN]

Each sensor has a serial, a creep and a hysteresis of its own. It is calibrated by the calibration scene of its model with other loads, and
then used: it has been pressed before, is tared at rest, gripped with forces of 3 to 100 % of full scale, held, changed, released and left at
rest. Rows are judged once their load has been held for the calibration's time to settle, because the sd of `tactilectl decouple` does not
include latency. Several builds are judged on the same recordings; with --folder these are kept.

A cell is a function in CELLS from the rows of a sensor to samples (error, sd, GOOD, load). Columns:
    within   share of the samples within 1 sd in %, mean over the sensors and its 95 % interval; it must touch 60 .. 76
    beyond   GOOD samples off by more than 5 sd, % of the GOOD ones, mean over the sensors; at most 0.5
    sd/rms   median sd over the rms of the errors, both over the sensors; and that of an oracle, whose sd is the rms of the errors of
             all sensors in each range of the estimated load
"""
import argparse
import bisect
import csv
import math
import multiprocessing
import pathlib
import random
import re
import statistics
import subprocess
import sys
import tempfile
import tomllib
import types
from dataclasses import dataclass

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/scenes"), str(ROOT / "node/python")]
import run  # noqa: E402
import tactiled_uncertainty as rules  # noqa: E402

FORCES = ("fx_N", "fy_N", "fz_N")
TARE_FOR_S = 0.7                    # times of a slower model
GRIPS_BEFORE, GRIPS = 3, 24         # before the tare, and after it
SMALLEST = 0.03                     # grip relative to full scale
SMALL = (0.03, 0.15)                # loads of contact, eggs and grip
AFTER_REST = 0.02                   # estimated load above the largest one since the last rest
ORACLE = (0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)


@dataclass(frozen=True)
class Model:
    scene: str      # calibration scene
    method: str
    press_N: float  # at full scale
    shear_N: float
    within_m: float
    slower: float   # times of a use
    width: float    # hysteresis of full scale in drivers/sim


MODELS = {"table": Model("calibrate_table", "linear", 1.2, 1.2, 0, 1, 0.0484),
          "hair": Model("calibrate_hair_rests", "matrix", 0.0565, 0.05, 0, 1, 0.02),
          "capacitive": Model("calibrate_capacitive_rests", "quadratic", 10, 1.1, 0, 4, 0.02),
          "generic": Model("calibrate_generic_rests", "quadratic", 10, 1.1, 1.2e-3, 4, 0.02)}


def motion(do, **keys):
    return f'[[motion]]\ndo = "{do}"\n' + "".join(f"{key} = {value:.6g}\n" for key, value in keys.items())


def grip(model, rng, size):
    """A grip of this size with up to three changes, and the release."""
    text = ""
    if model.within_m:
        r, angle = model.within_m * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
        text += motion("move", x_m=r * math.cos(angle), y_m=r * math.sin(angle))
    for _ in range(rng.randint(1, 4)):
        text += motion("press", to_N=size * model.press_N * rng.uniform(0.6, 1), in_s=model.slower * rng.uniform(0.05, 0.3))
        text += motion("shear", to_N=size * model.shear_N * rng.uniform(0, 0.8), direction_deg=rng.uniform(0, 360),
                       in_s=model.slower * rng.uniform(0.05, 0.2))
        text += motion("hold", for_s=model.slower * rng.uniform(0.2, 1))
    return text + motion("release", in_s=model.slower * 0.1)


def use_of(model, rng):
    """The motions of a use, and the time of its tare: the sensor has been pressed before."""
    text = motion("hold", for_s=0.5)
    for _ in range(GRIPS_BEFORE):
        text += grip(model, rng, rng.uniform(0.5, 1)) + motion("hold", for_s=model.slower * rng.uniform(0.3, 1))
    text += motion("hold", for_s=2 * model.slower)
    tare_s = sum(map(float, re.findall(r"^(?:in|for)_s = (.*)", text, re.M)))
    for _ in range(GRIPS):
        text += grip(model, rng, math.exp(rng.uniform(math.log(SMALLEST), 0)))
        text += motion("hold", for_s=model.slower * rng.uniform(0.6, 2))
    return text, tare_s


def scenes_of(model, seed, folder):
    """Paths of the calibration and the use of a sensor, and the time of the tare."""
    rng = random.Random(f"{model.scene} {seed}")
    text = (ROOT / f"config/scenes/{model.scene}.toml").read_text().replace('"../', f'"{ROOT}/config/')
    text = re.sub(r"^seed = .*\n", "", text, flags=re.M)
    text = text.replace("[[sensor]]\n", f"[[sensor]]\nserial = {1000 * seed}\n", 1)
    head, _, calibration = text.partition("[[motion]]")
    head += (f"[effects.creep]\namount = {0.02 * math.exp(rng.gauss(0, 0.3)):.4g}\ntime_s = {5 * math.exp(rng.gauss(0, 0.5)):.4g}\n"
             f"[effects.hysteresis]\nwidth = {model.width * math.exp(rng.gauss(0, 0.3)):.4g}\n")
    calibration = re.sub('do = "wander"', lambda _: f'do = "wander"\nseed = {rng.randrange(1, 10**6)}', "[[motion]]" + calibration)
    paths = folder / "calibrate.toml", folder / "use.toml"
    use, tare_s = use_of(model, rng)
    for path, motions in zip(paths, (calibration, use)):
        path.write_text(f"seed = {rng.randrange(1, 10**6)}\n{head}{motions}")
    return paths, tare_s


def simulated(scene, folder, channels):
    """[(t_us, cells of the channels, load)] with all effects."""
    signals, truth = folder / f"{scene.stem}_signals.csv", folder / f"{scene.stem}_truth.csv"
    run.run_ctl("simulate", "--scene", scene, "--effects", "all", "--out", signals)
    run.run_ctl("simulate", "--scene", scene, "--effects", run.WORLD, "--truth", truth)
    with truth.open() as file:
        load = {row["t_s"]: tuple(float(row[c]) for c in FORCES) for row in csv.DictReader(file)}
    with signals.open() as file:
        rows = csv.DictReader(file)
        names = channels or rows.fieldnames[1:]
        result = [(row["t_s"], [row[c] for c in names], load[row["t_s"]]) for row in rows]
    signals.unlink(), truth.unlink()
    return names, result


def settled(rows, count):
    """For each row, whether its load has been the same for `count` rows."""
    still, n, result = None, 0, []
    for _, _, load in rows:
        still, n = load, n + 1 if load == still else 0
        result.append(n >= count)
    return result


def make(job):
    """Writes labelled.csv, use.csv and truth.csv of a sensor."""
    name, seed, folder = job
    folder = folder / f"{name}_{seed}"
    if (folder / "truth.csv").exists():
        return
    folder.mkdir(parents=True, exist_ok=True)
    model = MODELS[name]
    scenes, tare_s = scenes_of(model, seed, folder)
    scene = tomllib.loads(scenes[0].read_text())
    told = scene.get("calibrate", {})
    count = round(told.get("settle_s", 0.05) * scene["rate_Hz"])
    for path, out in zip(scenes, ("labelled.csv", "use.csv")):
        names, rows = simulated(path, folder, told.get("channels"))
        is_settled = settled(rows, count)
        with (folder / out).open("w", newline="") as file:
            writer = csv.writer(file)
            if out == "labelled.csv":
                writer.writerow(["t_s", *names, *FORCES])
                writer.writerows([t, *cells, *load] for (t, cells, load), still in zip(rows, is_settled) if still)
            else:
                writer.writerow(["t_s", *names])
                writer.writerows([t, *cells] for t, cells, _ in rows)
    with (folder / "truth.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["after_tare_s", "settled", *FORCES])
        writer.writerows([f"{float(t) - tare_s:.6g}", int(still), *load] for (t, _, load), still in zip(rows, is_settled))


@dataclass
class Row:
    """A sample of a component. `whole`: that of all components, for tactiled_uncertainty; `hold`: number of the load."""
    t_s: float
    error: float  # tared
    sd: float
    good: bool
    load: float   # estimated, relative to the largest full scale
    peak: float   # the largest true load since the last rest
    settled: bool
    hold: int = 0
    whole: object = None
    errors: tuple = ()


def number(cell):
    return float(cell) if cell else math.nan


def tared_use(model, folder, out):
    """Writes the rows of the use from the beginning of its tare on."""
    with (folder / "truth.csv").open() as file:
        before = sum(float(row["after_tare_s"]) <= -TARE_FOR_S * model.slower for row in csv.DictReader(file))
    with (folder / "use.csv").open() as file:
        head, *lines = file
    out.write_text(head + "".join(lines[before:]))


def rows_of(folder, calibration, forces):
    """{component: [Row]}"""
    full_scale = tomllib.loads(calibration.read_text())["full_scale"]
    with forces.open() as file:
        estimates = list(csv.DictReader(line for line in file if not line.startswith("#")))
    with (folder / "truth.csv").open() as file:
        truth = list(csv.DictReader(file))[-len(estimates):]
    result, peak, hold, before = {c: [] for c in FORCES}, 0.0, 0, None
    budget_at = list(estimates[0]).index("noise_fx") if "noise_fx" in estimates[0] else None
    for e, row in zip(estimates, truth, strict=True):
        true = [float(row[c]) for c in FORCES]
        hold, before = hold + (true != before), true
        if not any(true):
            peak = 0.0
        peak = max(peak, math.hypot(*true) / max(full_scale))
        if not e["fz_N"] or float(row["after_tare_s"]) < 0:
            continue
        force = [number(e[c]) for c in FORCES]
        load = math.hypot(*force) / max(full_scale)
        errors, whole = tuple(f - f_true for f, f_true in zip(force, true)), None
        if budget_at is not None and row["settled"] == "1":
            sds = tuple(number(e["sd_" + c]) for c in FORCES)
            whole = types.SimpleNamespace(quality=1, force_S_N=tuple(force), sd_force_N=sds, sd_torque_Nm=(math.nan,) * 3, state=0, epoch=1, tare_count=1,
                                          budget=rules.budget_of(map(number, list(e.values())[budget_at:budget_at + 60])))
        for c, error, sd in zip(FORCES, errors, whole.sd_force_N if whole else (number(e["sd_" + c]) for c in FORCES)):
            result[c].append(Row(float(e["t_s"]), error, sd, e["quality"].startswith("good"), load, peak, row["settled"] == "1", hold,
                                 whole, errors))
    return result


# The cells. Means, differences, sums of sensors, magnitudes and directions belong here: each is a function from {component: [Row]}
# to {name: [(error, sd, GOOD, load)]}, with the rule for the sd that the reader of the samples would use.
def single(rows):
    return {c[:2]: [(r.error, r.sd, r.good, r.load) for r in own if r.settled] for c, own in rows.items()}


def small_after_rest(rows):
    """SMALL loads that have been the largest ones since the last rest."""
    return {c[:2]: [(r.error, r.sd, r.good, r.load) for r in own
                    if r.settled and SMALL[0] <= r.load <= SMALL[1] and r.peak <= r.load + AFTER_REST] for c, own in rows.items()}


def holds_of(own):
    """The settled rows of each load that was held, in the order of time."""
    holds = {}
    for r in own:
        if r.settled and r.whole:
            holds.setdefault(r.hold, []).append(r)
    return list(holds.values())


def mean_of(n):
    def cell(rows):
        result = {}
        for k, (c, own) in enumerate(rows.items()):
            result[c[:2]] = [(statistics.fmean(r.error for r in hold[i:i + n]), rules.sd_of_mean(hold[i].whole, k, n), hold[i].good, hold[i].load)
                             for hold in holds_of(own) for i in range(0, len(hold) - n + 1, n)]
        return result
    return cell


def difference(rows):
    """The middle of a hold minus the middle of the one before."""
    result = {}
    for k, (c, own) in enumerate(rows.items()):
        middles = [hold[len(hold) // 2] for hold in holds_of(own)]
        result[c[:2]] = [(b.error - a.error, rules.sd_of_difference(b.whole, a.whole, k), a.good and b.good, b.load)
                         for a, b in zip(middles, middles[1:])]
    return result


def magnitude(rows):
    result = []
    for r in next(iter(rows.values())):
        if r.settled and r.whole:
            value = rules.magnitude(r.whole)
            true = math.hypot(*(f - e for f, e in zip(r.whole.force_S_N, r.errors)))
            if not value.is_bound:
                result.append((value.value - true, value.sd, r.good, r.load))
    return {"|F|": result}


def bound_of_magnitude(rows):
    """Samples whose magnitude is a bound: an error of 0 where it holds, else infinite."""
    result = []
    for r in next(iter(rows.values())):
        if r.settled and r.whole and (value := rules.magnitude(r.whole)).is_bound:
            true = math.hypot(*(f - e for f, e in zip(r.whole.force_S_N, r.errors)))
            result.append((0.0 if true <= value.value else math.inf, 1.0, r.good, r.load))
    return {"|F|": result}


def direction(rows):
    result = []
    for r in next(iter(rows.values())):
        if r.settled and r.whole:
            unit, sd = rules.direction(r.whole)
            true = [f - e for f, e in zip(r.whole.force_S_N, r.errors)]
            if not math.isnan(sd) and math.hypot(*true) > 0:
                cosine = sum(u * t for u, t in zip(unit, true)) / math.hypot(*true)
                result.append((math.acos(max(-1.0, min(1.0, cosine))), sd, r.good, r.load))
    return {"angle": result}


def sum_of(sensors, are_like):
    """Sums over several sensors: of samples of like loads, or of any. A group of sensors counts as one."""
    groups = []
    n = len(sensors)
    for group in zip(*sensors):
        samples = []
        for i, first in enumerate(group[0]):
            chosen = [first]
            for other in group[1:]:
                if not other:
                    break
                chosen.append(min(other, key=lambda r: math.dist(r.whole.budget.load, first.whole.budget.load)) if are_like
                              else other[i % len(other)])
            if len(chosen) < n:
                continue
            for k, c in enumerate(FORCES):
                weight = tuple(1.0 if d == k else 0.0 for d in range(6))
                samples.append((c[:2], (sum(r.errors[k] for r in chosen), rules.sd_of_sum([r.whole for r in chosen], [weight] * n),
                                        all(r.good for r in chosen), first.load)))
        groups.append({c[:2]: [s for name, s in samples if name == c[:2]] for c in FORCES})
    return groups


SUMS = (2, 4, 16)
# With the cell whose errors the oracle knows.
CELLS = {"all loads": (single, "all loads"), "3 to 15 % after a rest": (small_after_rest, "all loads")}
CELLS |= {f"mean of {n}": (mean_of(n), "all loads") for n in (1, 10, 100)}
CELLS |= {"difference": (difference, "all loads"), "magnitude": (magnitude, None), "bound of it": (bound_of_magnitude, None),
          "direction": (direction, None)}


@dataclass
class Figures:
    """The figures that a sensor has in a cell."""
    within: float  # %
    beyond: float  # %
    sd: float      # median
    square: float  # mean, of the errors
    counts: list   # samples in each range of ORACLE
    squares: list  # sums of the squares of the errors there


def figures(samples):
    """Returns None if there are no samples."""
    samples = [s for s in samples if not math.isnan(s[1])]
    if not samples:
        return None
    good = [s for s in samples if s[2]]
    counts, squares = [0] * len(ORACLE), [0.0] * len(ORACLE)
    for error, _, _, load in samples:
        k = bisect.bisect_right(ORACLE, load) - 1
        counts[k] += 1
        squares[k] += error ** 2
    return Figures(100 * statistics.fmean(abs(s[0]) <= s[1] for s in samples),
                   100 * sum(abs(s[0]) > 5 * s[1] for s in good) / max(1, len(good)), statistics.median(s[1] for s in samples),
                   sum(squares) / len(samples), counts, squares)


def judge(job):
    """{(cell, component): figures} of a sensor by a build; a message if it is refused."""
    program, name, seed, folder = job
    folder, model = folder / f"{name}_{seed}", MODELS[name]
    told = tomllib.loads((folder / "calibrate.toml").read_text()).get("calibrate", {})
    words = [word for pair in told.get("set", []) for word in ("--set", pair)]
    words += ["--channel-unit", "pF" if name in ("capacitive", "generic") else "dR/R0"]
    if name == "generic":
        words += ["--channels", ",".join(told["channels"])]
    help_text = subprocess.run([pathlib.Path(program) / "tactilectl", "decouple", "--help"], capture_output=True, text=True).stdout
    more = ["--budget"] if "--budget " in help_text else []
    with tempfile.TemporaryDirectory() as temporary:
        calibration, forces = pathlib.Path(temporary) / "calibration.toml", pathlib.Path(temporary) / "forces.csv"
        use = pathlib.Path(temporary) / "use.csv"
        tared_use(model, folder, use)
        decouple = ["decouple", "--calibration", calibration, "--in", use, "--tare-s", f"{TARE_FOR_S * model.slower:g}", "--out", forces, *more]
        for command in (["calibrate", "--model", name, "--method", model.method, "--in", folder / "labelled.csv", "--out", calibration, *words],
                        decouple):
            if command is decouple and "--temperature-sd-K" in help_text:
                decouple += run.constant_temperature_words(calibration)
            done = subprocess.run([pathlib.Path(program) / "tactilectl", *command], capture_output=True, text=True)
            if done.returncode != 0:
                return f"{name} {seed}: {done.stderr.strip().splitlines()[-1]}"
        rows = rows_of(folder, calibration, forces)
        result = {(cell, c): figures(own) for cell, (function, _) in CELLS.items() for c, own in function(rows).items()}
        result["holds"] = [hold[len(hold) // 2] for hold in holds_of(next(iter(rows.values())))]  # all components
        return result


def interval(values):
    mean = statistics.fmean(values)
    half = 1.96 * statistics.stdev(values) / math.sqrt(len(values)) if len(values) > 1 else math.inf
    return mean, mean - half, mean + half


def oracle_sd(cell, known):
    """The median sd of the oracle for the samples of `cell`, if it knows the errors of `known`."""
    def sums(of, name):
        return [sum(each) for each in zip(*(getattr(f, name) for f in of))]
    squares, all_counts, counts = sums(known, "squares"), sums(known, "counts"), sums(cell, "counts")
    sds = sorted((math.sqrt(square / n), count) for square, n, count in zip(squares, all_counts, counts) if count)
    middle = sum(counts) / 2
    for sd, count in sds:
        middle -= count
        if middle <= 0:
            return sd
    return math.nan


def report(program, name, found):
    for refusal in (each for each in found if isinstance(each, str)):
        print(f"# {refusal}")
    found = [each for each in found if not isinstance(each, str)]
    holds = [each.pop("holds") for each in found]
    for n in SUMS:
        for are_like in (True, False):
            usable = [h for h in holds if h]
            if len(usable) < n:
                continue
            cell = f"sum of {n}, {'like' if are_like else 'any'} loads"
            for group in sum_of([usable[i::n][:len(usable) // n] for i in range(n)], are_like):
                found.append({(cell, c): figures(own) for c, own in group.items()})
    names = dict.fromkeys(key for each in found for key in each)
    for cell, component in names:
        own = [each[cell, component] for each in found if each.get((cell, component))]
        if not own:
            continue
        of_oracle = CELLS.get(cell, (None, None))[1]
        known = [each[of_oracle, component] for each in found if each.get((of_oracle, component))] or own
        mean, low, high = interval([f.within for f in own])
        beyond = statistics.fmean(f.beyond for f in own)
        rms = math.sqrt(statistics.fmean(f.square for f in own)) or math.nan  # of a bound: none
        verdict = ("" if low <= 76 and high >= 60 else " COVERAGE") + ("" if beyond <= 0.5 else " BEYOND")
        print(f"{program} {name} {component} {cell:24} {len(own):4} sensors: "
              f"within {mean:5.1f} ({low:5.1f} .. {high:5.1f}), beyond {beyond:5.2f}, "
              f"sd/rms {statistics.median(f.sd for f in own) / rms:5.2f}, oracle {oracle_sd(own, known) / rms:5.2f}{verdict}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bins", nargs="+")
    parser.add_argument("--sensors", type=int, default=400)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--models", default=",".join(MODELS))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=pathlib.Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or pathlib.Path(temporary)
        run.BIN = pathlib.Path(given.bins[0])
        seeds = range(given.first, given.first + given.sensors)
        with multiprocessing.Pool(given.jobs) as pool:
            for name in given.models.split(","):
                pool.map(make, [(name, seed, folder) for seed in seeds], 1)
                for program in given.bins:
                    report(program, name, pool.map(judge, [(program, name, seed, folder) for seed in seeds], 1))


if __name__ == "__main__":
    main()
