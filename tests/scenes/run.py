#!/usr/bin/env python3
"""Every scene of config/scenes that has an [[expect]], through the daemon as it is shipped: driver "sim", a configuration
written here, the samples read back from shared memory and compared with what the scene applied. config/scenes/README.md has
the keys; a new test is a new scene, and no line here.

    run.py [--effects auto,all] [--jobs 4] [--scenes FOLDER] [NAME ...]
"""
import argparse
import csv
import fnmatch
import math
import multiprocessing
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import tomllib

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "system"))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402
from judge import AXES, NOT_JUDGED, Series, judge  # noqa: E402
from offline import TARE_S, tared  # noqa: E402

sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

SPEED, SPEED_WITH_MEMORY = 4, 1  # times real time; the memory of piezo is that of the clock
LATE_MS = 10000   # the machine may delay the daemon and this reader
MAX_SENSORS = 16  # for a daemon
QUALITY = {tactiled.GOOD: "good", tactiled.UNCERTAIN: "uncertain", tactiled.BAD: "bad"}


class Refused(Exception):
    """Why a scene cannot be judged."""


def run_ctl(*words):
    done = subprocess.run([BIN / "tactilectl", *map(str, words)], capture_output=True, text=True)
    if done.returncode != 0:
        raise Refused(f"tactilectl {' '.join(map(str, words))}: {done.stdout}{done.stderr}".strip())
    return done.stdout


# Effects on the load itself: friction, ridges, adhesion.
WORLD = "friction_limit,partial_slip,stick_slip,texture,adhesion"


def truth_of(scene_path, folder, *seed):
    """A file with the loads that each sensor of a scene is under."""
    truth = folder / f"{scene_path.stem}.truth.csv"
    run_ctl("simulate", "--scene", scene_path, "--effects", WORLD, "--truth", truth, *seed)
    return truth


def column(fields, sensor, name):
    """Columns of several sensors have the sensor's name before theirs."""
    return name if name in fields else f"{sensor}.{name}"


def read_truth(path, sensors):
    """{sensor: {microsecond of the scene: (fx, fy, fz)}}"""
    truth = {sensor: {} for sensor in sensors}
    with open(path) as file:
        rows = csv.reader(file)
        fields = next(rows)
        columns = {s: [fields.index(column(fields, s, c)) for c in ("fx_N", "fy_N", "fz_N")] for s in sensors}
        for row in rows:
            t_us = round(float(row[0]) * 1e6)
            for sensor, (x, y, z) in columns.items():
                if row[z]:
                    truth[sensor][t_us] = float(row[x]), float(row[y]), float(row[z])
    return truth


class Scene:
    def __init__(self, path):
        self.path = path
        self.toml = tomllib.loads(path.read_text())
        self.rate_Hz = self.toml.get("rate_Hz", 1000)
        self.sensors = {}  # name -> (number of the device, its table), arrays taken apart
        for table in self.toml["sensor"]:
            rows, columns = table.get("array", (1, 1))
            for row in range(rows):
                for column in range(columns):
                    name = f"{table['name']}_{row}_{column}" if "array" in table else table["name"]
                    self.sensors[name] = (len(self.sensors), table)
        self.expectations = [(name, expect) for expect in self.toml.get("expect", [])
                             for name in self.sensors if fnmatch.fnmatchcase(name, expect["sensor"])]
        for expect in self.toml.get("expect", []):
            if not fnmatch.filter(self.sensors, expect["sensor"]):
                raise Refused(f"no sensor {expect['sensor']}")
        if len(self.expectations) > MAX_SENSORS:
            raise Refused(f"{len(self.expectations)} expectations, a daemon has {MAX_SENSORS} sensors")


def calibrate(scene_path, method, out):
    """A calibration file from a calibration scene: its sensor with all effects, labelled with what the scene applied."""
    scene = Scene(scene_path)
    told = scene.toml.get("calibrate", {})
    sensor = scene.toml["sensor"][0]
    components = told.get("components", ["fx", "fy", "fz"])
    columns = [c + ("_N" if c[0] == "f" else "_Nm") for c in components]
    folder = out.parent / out.stem
    folder.mkdir()
    labelled, signals = folder / "labelled.csv", folder / "signals.csv"
    run_ctl("simulate", "--scene", scene_path, "--effects", "all", "--out", signals)
    with open(signals) as s, open(truth_of(scene_path, folder)) as t, open(labelled, "w") as file:
        applied = {row["t_s"]: row for row in csv.DictReader(t)}
        readings = csv.DictReader(s)
        channels = [c for c in readings.fieldnames[1:] if c in told.get("channels", [c])]
        writer = csv.writer(file)
        writer.writerow(["t_s", *channels, *columns])
        still, count, settle = None, 0, round(told.get("settle_s", 0.05) * scene.rate_Hz)
        for row in readings:
            label = [applied[row["t_s"]][c] for c in columns]
            still, count = label, count + 1 if label == still else 0
            if count < settle or float(row["t_s"]) < told.get("from_s", 0):
                continue
            writer.writerow([row["t_s"], *(row[c] for c in channels), *label])
    words = [word for pair in told.get("set", []) for word in ("--set", pair)]
    if "dummy_difference_K" in told:
        words += ["--dummy-difference-K", told["dummy_difference_K"], "--dummy-at-C", told["dummy_at_C"]]
    if "influence" in told:
        words += ["--influence", scene_path.parent / told["influence"]]
    model = told.get("model", sensor["model"])
    return run_ctl("calibrate", "--model", model, "--method", method, "--in", labelled, "--out", out, "--channel-unit",
                   {"piezo": "V, pF", "capacitive": "pF"}.get(model, "dR/R0"), *words)


def calibration_of(scene, expect, folder):
    """The path of the calibration that an expectation names."""
    name = expect["calibration"]
    if not name.startswith("scene:"):
        return (scene.path.parent / name).resolve()
    made = folder / f"{pathlib.Path(name[6:]).stem}-{expect['method']}.toml"
    if not made.exists():
        raise Refused(f"{name}: not calibrated")
    return made


def model_of(calibration):
    return tomllib.loads(calibration.read_text())["model"]


class Follow(threading.Thread):
    """All samples of one sensor of the daemon."""

    def __init__(self, node_name, sensor, until_number):
        super().__init__(daemon=True)
        self.node_name, self.sensor, self.until_number = node_name, sensor, until_number
        self.samples, self.lost = [], 0

    def run(self):
        with tactiled.open(self.node_name) as node:
            follower = node.follow(self.sensor, timeout=LATE_MS / 1e3, wait="sleep", from_oldest=True)
            for sample in follower:
                if sample.reasons & tactiled.DISCONNECTED and self.samples:
                    break
                if sample.reasons & (tactiled.NO_DATA_YET | tactiled.DAEMON_STOPPED):
                    continue
                self.samples.append(sample)
                if sample.device_sequence >= self.until_number:
                    break
            self.lost = follower.lost
            follower.close()


def play(scene, effects, speed, calibrations, truths):
    """Runs the daemon over the scene. Returns a Follow for each expectation."""
    text, last, uses, links = "", [], {}, set()
    for i, ((name, expect), calibration) in enumerate(zip(scene.expectations, calibrations)):
        device, table = scene.sensors[name]
        # Two sensors of a daemon cannot read the same channels: a second method has the scene on a second link.
        link = uses[name] = uses.get(name, -1) + 1
        if link not in links:
            links.add(link)
            text += (f'[[link]]\nname = "scene{link}"\ndriver = "sim"\nscene = "{scene.path}"\neffects = "{effects}"\n'
                     f'speed = {speed}\n\n')
        text += (f'[[sensor]]\nname = "e{i}"\nlink = "scene{link}"\ndevice = {device}\nmodel = "{model_of(calibration)}"\n'
                 f'calibration = "{calibration}"\nmethod = "{expect.get("method", "")}"\nchannels = {channels_of(table)}\n'
                 f'stale_ms = {LATE_MS}\n{constant_temperature(calibration)}\n')
        end_s = min(expect.get("to_s", 1e7), max(truths[name]) / 1e6)
        last.append(math.floor(end_s * scene.rate_Hz / table.get("every", 1)))
    text += "[shm]\nhistory = 16384\n"
    with Daemon(text, node=f"watchdog_ms = {LATE_MS}") as daemon:
        try:
            daemon.start()
            follows = [Follow(daemon.name, f"e{i}", end) for i, end in enumerate(last)]
            for follow in follows:
                follow.start()
            for follow in follows:
                follow.join()
        finally:
            shutil.rmtree(daemon.folder)
    return follows


def has_thermometer(calibration):
    return "temperature" in tomllib.loads(pathlib.Path(calibration).read_text())


def constant_temperature(calibration):
    """The keys of a sensor in a scene of one temperature. A calibration with coefficients and a thermometer needs none."""
    sd = "temperature_sd_K = 1e-4\n" if model_of(calibration) in ("table", "hair", "capacitive") else ""
    return "" if has_thermometer(calibration) else f"temperature_range_C = [23, 23]\n{sd}"


def constant_temperature_words(calibration):
    """The same for tactilectl decouple."""
    return [] if has_thermometer(calibration) else "--temperature-from-C 23 --temperature-to-C 23 --temperature-sd-K 1e-4".split()


def channels_of(table):
    """The names of a frame's channels, in their order: those of drivers/sim."""
    if table["model"] == "table":
        return [f"R{k}" for k in range(1, 9)]
    if table["model"] == "hair":
        return ["H1", "H2", "H3", "H4"] + (["H0"] if table.get("dummy") else [])
    return ["C1", "C2", "C3", "C4", "Cn"] + (["Vp"] if table.get("piezo_V_per_N", 1) > 0 else [])


def span_s(expect):
    return [min(expect.get(key, usual), 1e7) for key, usual in (("from_s", 0), ("to_s", 1e7))]


def row_of(scene, name, expect, series, truth, begin_s, end_s):
    """A row of the summary. `series` has the samples of all of the scene, `truth` its loads: {microsecond: (fx, fy, fz)}."""
    part = series.part(begin_s, end_s)
    at = [truth[round(t * 1e6)] for t in part.t_s]
    due = sum(round(begin_s * 1e6) <= t <= round(end_s * 1e6) for t in truth)
    share, errors, failures = judge(expect, part, [[force[axis] for force in at] for axis in AXES], due)
    counts = {word: part.quality.count(word) for word in QUALITY.values()}
    return {"scene": scene.path.stem, "sensor": name, "method": f"{pathlib.Path(expect['calibration'].split(':')[-1]).stem} "
            f"{expect.get('method', '')}", "share": share, "samples": due, "errors": errors, "within": expect["within_N"],
            "axes": (2,) if expect.get("press_only", False) else AXES, "failures": failures, "passed": not failures,
            "quality": " ".join(f"{word} {100 * n / max(1, len(part.t_s)):.0f} %" for word, n in counts.items() if n)}


def row_of_follow(scene, name, expect, follow, truth):
    """The samples that the daemon published."""
    every = scene.sensors[name][1].get("every", 1)
    begin_s, end_s = span_s(expect)
    if expect.get("tare", True):
        begin_s = max(begin_s, TARE_S[1])
    read, reasons = [], set()
    for sample in follow.samples:
        t_s = sample.device_sequence * every / scene.rate_Hz
        if round(t_s * 1e6) in truth:
            read.append((t_s, sample))
        if begin_s <= t_s <= end_s:
            reasons.update(sample.reasons_text)
    series = Series([t for t, _ in read], [[s.force_S_N[axis] for _, s in read] for axis in AXES],
                    [[s.sd_force_N[axis] for _, s in read] for axis in AXES], [QUALITY[s.quality] for _, s in read])
    row = row_of(scene, name, expect, tared(series) if expect.get("tare", True) else series, truth, begin_s, end_s)
    row["quality"] += "".join(f" {word}" for word in sorted(reasons))
    return {**row, "lost": follow.lost}


def run_scene(job):
    """One scene with one wish of effects. Returns rows of the summary, or a string that says why there are none."""
    path, effects, folder = job
    began = time.monotonic()
    try:
        scene = Scene(path)
        calibrations = [calibration_of(scene, expect, folder) for _, expect in scene.expectations]
        own = folder / f"{path.stem}-{effects}"
        own.mkdir()
        truths = read_truth(truth_of(path, own), {name for name, _ in scene.expectations})
        speed = SPEED_WITH_MEMORY if any(model_of(c) == "piezo" for c in calibrations) else SPEED
        for (name, expect) in scene.expectations:
            if expect.get("tare", True) and any(any(force) for t_us, force in truths[name].items() if t_us <= TARE_S[1] * 1e6):
                raise Refused(f"{name} is not at rest until {TARE_S[1]} s, so its zero is unknown; let the scene rest longer at first")
        follows = play(scene, effects, speed, calibrations, truths)
        rows = [row_of_follow(scene, name, expect, follow, truths[name])
                for (name, expect), follow in zip(scene.expectations, follows)]
        return effects, path.stem, [{**row, "took_s": time.monotonic() - began} for row in rows]
    except (Refused, OSError, AssertionError, KeyError, ValueError) as why:
        return effects, path.stem, f"{type(why).__name__}: {why}"


def run_calibration(job):
    path, method, folder = job
    try:
        return job, calibrate(path, method, folder / f"{path.stem}-{method}.toml"), True
    except (Refused, KeyError) as why:
        return job, f"{type(why).__name__}: {why}", False


def line_of(row):
    judged = [a in row["axes"] and row["within"][a] < NOT_JUDGED for a in AXES]
    worst = " ".join(f"{1e3 * (row['errors'][a]['worst'] or math.nan):7.1f}" if judged[a] else "      -" for a in AXES)
    within = " ".join(f"{1e3 * row['within'][a]:6.4g}" if judged[a] else "     -" for a in AXES)
    lost = f"  reader lost {row['lost']}" if row.get("lost") else ""
    return (f"{'ok  ' if row['passed'] else 'FAIL'} {row['scene']:24} {row['sensor']:10} {row['method']:34} "
            f"{row['samples']:6} {100 * row['share']:6.2f} {worst}  ({within})  {row['quality']}{lost}"
            f"{''.join('; ' + f for f in row['failures'])}")


def scenes_in(folder, names):
    """Paths of the scenes with an [[expect]], and the (scene, method) of the calibrations that they need."""
    scenes, calibrations = [], set()
    for path in sorted(folder.resolve().glob("*.toml")):
        expectations = tomllib.loads(path.read_text()).get("expect", [])
        if not expectations or names and path.stem not in names:
            continue
        scenes.append(path)
        calibrations |= {(path.parent / e["calibration"][6:], e["method"]) for e in expectations
                         if e["calibration"].startswith("scene:")}
    return scenes, sorted(calibrations)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="scenes by name; all by default")
    parser.add_argument("--effects", default="auto,all", help="wishes, with commas")
    parser.add_argument("--jobs", type=int, default=4, help="scenes at a time")
    parser.add_argument("--scenes", type=pathlib.Path, default=ROOT / "config/scenes")
    parser.add_argument("--keep", type=pathlib.Path, help="keep calibrations and truths in this folder")
    words = parser.parse_args()
    began, wishes = time.monotonic(), words.effects.split(",")
    folder = words.keep or pathlib.Path(tempfile.mkdtemp(prefix="tactiled-scenes-"))
    folder.mkdir(exist_ok=True)
    failures = []
    try:
        scenes, calibrations = scenes_in(words.scenes, words.names)
        with multiprocessing.Pool(words.jobs) as pool:
            jobs = [(path, method, folder) for path, method in calibrations]
            for (path, method, _), said, good in pool.imap(run_calibration, jobs):
                if not good:
                    failures.append(f"FAIL {path.stem} {method}: {said}")
                elif words.keep:
                    print(f"{path.stem} {method}\n{said}")
            calibrated_s = time.monotonic() - began
            jobs = [(path, effects, folder) for effects in wishes for path in scenes]
            results = {effects: [] for effects in wishes}
            for effects, name, rows in pool.imap_unordered(run_scene, jobs):
                results[effects].append((name, rows))
        for effects in wishes:
            print(f"\neffects {effects}: worst error in mN (allowed), of the samples between from_s and to_s")
            print(f"     {'scene':24} {'sensor':10} {'calibration, method':34} {'rows':>6} {'% in':>6} "
                  f"{'fx':>7} {'fy':>7} {'fz':>7}")
            for name, rows in sorted(results[effects]):
                if isinstance(rows, str):
                    failures.append(f"FAIL {effects} {name}: {rows}")
                    continue
                for row in rows:
                    print(line_of(row))
                    if not row["passed"]:
                        failures.append(line_of(row))
        print("", *failures, sep="\n")
        print(f"{len(scenes)} scenes, effects {words.effects}: {len(failures)} failed; {time.monotonic() - began:.0f} s, "
              f"{calibrated_s:.0f} of them for {len(calibrations)} calibrations")
    finally:
        if not words.keep:
            shutil.rmtree(folder)
    sys.exit(1 if failures or not scenes else 0)


if __name__ == "__main__":
    main()
