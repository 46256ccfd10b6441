#!/usr/bin/env python3
"""Sensors whose physics the simulator does not have: calibrations, mistakes in sessions, and damage at use time. Needs numpy.

    other_sensors.py methods  [--kinds strain,diodes,...] [--seeds 41,42] [--methods matrix,quadratic,rbf]
    other_sensors.py sessions [--kinds ...] [--seeds ...]     a session turned, standardised, or with two channels exchanged
    other_sensors.py damage   [--kinds ...] [--seeds ...] [--methods matrix,quadratic]

kinds    strain (8 gauges of a cell, dead weights), diodes (12 photodiodes, exponential), resistors (9 force-sensing
         resistors in dividers, press only), barometers (6)
Two sessions of 1,200 rows (`sessions`: four) are calibrated, a further one is judged after a tare in its first second. Each
session has gains that differ by 1 % and zeros by 1 % of the range (sd); `--drift 0.03` sets both.
methods  prints for each component the error in % of full scale, the share within 1 sd, beyond 5 sd, median sd over error
sessions prints whether `calibrate` accepts each set of sessions, and which it names; `right` has no mistake
damage   prints rows that are GOOD and off by more than 10 % of full scale, in %: mean over the channels (worst)
"""
import argparse
import csv
import pathlib
import re
import subprocess
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).parents[2]
CTL = ROOT / "build/release/bin/tactilectl"
RATE_HZ = 50


def low_pass(x, share):
    y, state = np.empty_like(x), x[0]
    for i, value in enumerate(x):
        state = state + share * (value - state)
        y[i] = state
    return y


class Sensor:
    """`full_scale` in N; the press is the last component and negative. readings() returns channels for loads."""
    components = ("fx", "fy", "fz")

    def loads(self, rng, n):
        loads, i = np.zeros((n, len(self.full_scale))), 2 * RATE_HZ
        while i < n - 5:
            m = min(int(rng.uniform(1.5, 6) * RATE_HZ), n - i)
            shape = np.sin(np.pi * np.arange(m) / m) ** rng.uniform(0.4, 1)
            wave = 1 + 0.4 * np.sin(2 * np.pi * rng.uniform(0.2, 1) * np.arange(m)[:, None] / RATE_HZ + rng.uniform(0, 6, len(self.full_scale)))
            load = rng.uniform(-0.7, 0.7, len(self.full_scale)) * wave * shape[:, None] * self.full_scale
            load[:, -1] = -np.abs(load[:, -1])
            limit = 0.8 * np.abs(load[:, -1:]) * self.full_scale[:-1] / self.full_scale[-1]  # friction
            load[:, :-1] = np.clip(load[:, :-1], -limit, limit)
            loads[i:i + m] = load
            i += m + int(rng.uniform(0.3, 1.5) * RATE_HZ)
        return loads


class Strain(Sensor):
    full_scale = np.array([50.0, 50.0, 100.0])

    def __init__(self, rng):
        gains = rng.normal(size=(8, 3))
        self.gains = gains / np.linalg.norm(gains, axis=0) * 1e6 / self.full_scale
        self.squares = rng.normal(size=(8, 3)) * 6e2 / self.full_scale**2
        self.zeros, self.noise = rng.uniform(-4e5, 4e5, 8), rng.uniform(60, 200)

    def loads(self, rng, n):
        loads, i = np.zeros((n, 3)), 2 * RATE_HZ
        while i < n:
            m = int(rng.uniform(1.5, 4) * RATE_HZ)
            loads[i:i + m] = rng.uniform(-1, 1, 3) * self.full_scale
            i += m
        return low_pass(loads, 0.2)

    def readings(self, rng, loads):
        drift = low_pass(np.cumsum(rng.normal(size=len(loads))) * 3, 0.01)
        return self.zeros + loads @ self.gains.T + loads**2 @ self.squares.T + drift[:, None] + rng.normal(size=(len(loads), 8)) * self.noise


class Diodes(Sensor):
    full_scale = np.array([8.0, 8.0, 15.0])

    def __init__(self, rng):
        self.angle = np.arange(12) * 2 * np.pi / 12 + 0.1 * rng.normal(size=12)
        self.share, self.dark = rng.uniform(0.5, 1, 12), rng.uniform(600, 1400, 12)
        self.cross = rng.normal(size=(12, 3)) * 0.15

    def readings(self, rng, loads):
        f = loads / self.full_scale
        depth = -f[:, 2:] * (0.7 + 0.3 * self.share) + f @ self.cross.T
        depth -= 0.55 * self.share * (f[:, :1] * np.cos(self.angle) + f[:, 1:2] * np.sin(self.angle))
        ambient = rng.normal() * 8 + low_pass(rng.normal(size=len(f)) * 20, 0.003)
        return np.clip(self.dark * np.exp(0.8 * depth) + ambient[:, None] * self.share + rng.normal(size=depth.shape) * 3, 0, 4095)


class Resistors(Sensor):
    components, full_scale = ("fz",), np.array([20.0])

    def __init__(self, rng):
        self.at = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 2)
        self.gain, self.power = rng.uniform(0.7, 1.3, 9), rng.uniform(0.85, 1, 9)

    def readings(self, rng, loads):
        place = low_pass(rng.normal(size=(len(loads), 2)), 0.01) * 0.5
        near = np.exp(-((self.at[None] - place[:, None]) ** 2).sum(-1) / 1.28)
        press = np.maximum(-loads * near / near.sum(1, keepdims=True) * 9 - 0.15, 0)
        press = 0.96 * press + 0.048 * low_pass(press, 0.2 / RATE_HZ)  # creep
        resistance = self.gain * 8e3 / np.maximum(press, 1e-4) ** self.power + 200
        return 4095 * 4700 / (4700 + resistance) + rng.normal(size=press.shape) * 2


class Barometers(Sensor):
    full_scale = np.array([5.0, 5.0, 15.0])

    def __init__(self, rng):
        angle = np.arange(6) * np.pi / 3 + 0.15 * rng.normal(size=6)
        self.gains = rng.uniform(1500, 2500, (6, 3)) * np.stack([np.cos(angle), np.sin(angle), -np.ones(6)], 1)
        self.zeros = 101300 + rng.normal(size=6) * 150

    def readings(self, rng, loads):
        pressure = loads @ self.gains.T
        pressure = pressure + 0.1 * pressure**2 / 3e4
        return self.zeros + 0.93 * pressure + 0.07 * low_pass(pressure, 0.5 / RATE_HZ) + rng.normal(size=pressure.shape) * 6


KINDS = {"strain": Strain, "diodes": Diodes, "resistors": Resistors, "barometers": Barometers}


def recordings(kind, seed, sessions, drift, n=1200):
    """Returns the sensor and (channels, loads) of each session; the last one is for judging."""
    rng = np.random.default_rng(seed)
    sensor, made = KINDS[kind](rng), []
    for _ in range(sessions + 1):
        loads = sensor.loads(rng, n)
        channels = sensor.readings(rng, loads)
        width, rest = np.ptp(channels, axis=0), np.median(channels[:RATE_HZ], axis=0)
        channels = rest + (channels - rest) * (1 + drift * rng.normal(size=len(width))) + width * drift * rng.normal(size=len(width))
        made.append((channels, loads))
    return sensor, made, rng


def write(path, sensor, made, rng=None):
    """With labels and sessions if `rng` is given."""
    channels = [f"c{i + 1}" for i in range(made[0][0].shape[1])]
    with open(path, "w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["t_s", *channels] + ([f"{c}_N" for c in sensor.components] + ["session"] if rng else []))
        for s, (values, loads) in enumerate(made):
            for i, (row, load) in enumerate(zip(values, loads)):
                label = load + rng.normal(size=len(load)) * 0.004 * sensor.full_scale if rng else []
                out.writerow([f"{1000 * s + i / RATE_HZ:.3f}", *(f"{v:.9g}" for v in row), *(f"{v:.6g}" for v in label)] + ([s + 1] if rng else []))


def calibrate(folder, method, path):
    out = folder / f"{method}.toml"
    run = subprocess.run([CTL, "calibrate", "--model", "generic", "--method", method, "--in", path, "--out", out, "--force"],
                         capture_output=True, text=True)
    return (out if run.returncode == 0 else None), run.stderr.strip()


def decoupled(folder, calibration, sensor, channels, loads):
    """Returns errors relative to full scale, their sd, and which rows are GOOD."""
    write(folder / "use.csv", sensor, [(channels, loads)])
    subprocess.run([CTL, "decouple", "--calibration", calibration, "--in", folder / "use.csv", "--out", folder / "forces.csv", "--tare-s", "1"],
                   check=True, capture_output=True)
    rows = list(csv.DictReader(open(folder / "forces.csv")))
    column = lambda name: np.array([float(r[name] or "nan") for r in rows])
    error = np.stack([column(f"{c}_N") for c in sensor.components], 1) - loads
    sd = np.stack([column(f"sd_{c}_N") for c in sensor.components], 1)
    return error / sensor.full_scale, sd / sensor.full_scale, np.array([r["quality"].startswith("good") for r in rows])


def methods(args, folder, kind, seed):
    sensor, made, rng = recordings(kind, seed, 2, args.drift)
    write(folder / "rows.csv", sensor, made[:-1], rng)
    for method in args.methods:
        calibration, said = calibrate(folder, method, folder / "rows.csv")
        if calibration is None:
            print(f"{kind} {seed} {method}: refused: {said.splitlines()[-1][:160]}")
            continue
        error, sd, good = decoupled(folder, calibration, sensor, *made[-1])
        e, s = error[good], sd[good]
        text = ", ".join(f"{c} {100 * np.sqrt((e[:, k]**2).mean()):.2f} {100 * (abs(e[:, k]) <= s[:, k]).mean():.0f} "
                         f"{100 * (abs(e[:, k]) > 5 * s[:, k]).mean():.1f} {np.median(s[:, k]) / np.sqrt((e[:, k]**2).mean()):.2f}"
                         for k, c in enumerate(sensor.components)) if good.any() else "none"
        print(f"{kind} {seed} {method}: GOOD {100 * good.mean():.1f} %; {text}", flush=True)


def mistakes():
    def turned(sensor, channels, loads):
        order = [1, 0, 2] if len(sensor.components) == 3 else [0]
        signs = np.array([1, -1, 1]) if len(order) == 3 else np.array([-1])
        return channels, loads[:, order] * signs

    def standardised(sensor, channels, loads):
        return (channels - channels.mean(0)) / channels.std(0), loads

    def exchanged(sensor, channels, loads):
        return channels[:, [3, 1, 2, 0, *range(4, channels.shape[1])]], loads
    return {"right": lambda sensor, *made: made, "turned": turned, "standardised": standardised, "exchanged": exchanged}


def sessions(args, folder, kind, seed):
    for name, change in mistakes().items():
        for odd in (1, 3):
            sensor, made, rng = recordings(kind, seed, 4, args.drift)
            made[odd - 1] = change(sensor, *made[odd - 1])
            write(folder / "rows.csv", sensor, made[:-1], rng)
            calibration, said = calibrate(folder, "matrix", folder / "rows.csv")
            named = re.search(r"sessions? ([\d, and]+) contradicts?", said)
            print(f"{kind} {seed} {name}, session {odd}: {'calibrated' if calibration else 'refused'}, names {named.group(1) if named else 'none'}", flush=True)
            if name == "right":
                break


def damage(args, folder, kind, seed):
    sensor, made, rng = recordings(kind, seed, 2, args.drift)
    write(folder / "rows.csv", sensor, made[:-1], rng)
    (channels, loads), n = made[-1], made[-1][0].shape[1]
    rest, width = np.median(channels[:RATE_HZ], axis=0), np.ptp(channels, axis=0)
    kinds = {"at rest": lambda x, k: rest[k], "half gain": lambda x, k: rest[k] + (x - rest[k]) / 2, "turned round": lambda x, k: 2 * rest[k] - x,
             "shifted by 20 %": lambda x, k: x + 0.2 * width[k]}
    for method in args.methods:
        calibration, said = calibrate(folder, method, folder / "rows.csv")
        if calibration is None:
            print(f"{kind} {seed} {method}: refused: {said.splitlines()[-1][:160]}")
            continue
        text = calibration.read_text()
        error, _, good = decoupled(folder, calibration, sensor, channels, loads)
        print(f"{kind} {seed} {method}: {'curved domain' if 'curved' in text else 'no curved domain'}; undamaged GOOD {100 * good.mean():.1f} %, "
              f"wrong {100 * (good & (abs(error) > 0.1).any(1)).mean():.1f} %", flush=True)
        for name, change in kinds.items():
            wrong = []
            for k in range(n):
                spoiled = channels.copy()
                spoiled[RATE_HZ:, k] = change(spoiled[RATE_HZ:, k], k)  # after the tare
                error, _, good = decoupled(folder, calibration, sensor, spoiled, loads)
                wrong.append(100 * (good & (abs(error) > 0.1).any(1)).mean())
            print(f"  {name}: {np.mean(wrong):.1f} ({max(wrong):.0f})", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["methods", "sessions", "damage"])
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--seeds", default="41,42")
    parser.add_argument("--methods", default="")
    parser.add_argument("--drift", type=float, default=0.01)
    args = parser.parse_args()
    args.methods = (args.methods or ("matrix,quadratic" if args.what == "damage" else "matrix,quadratic,rbf")).split(",")
    with tempfile.TemporaryDirectory() as folder:
        for kind in args.kinds.split(","):
            for seed in args.seeds.split(","):
                globals()[args.what](args, pathlib.Path(folder), kind, int(seed))


if __name__ == "__main__":
    main()
