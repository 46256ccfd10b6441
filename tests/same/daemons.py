"""Recordings of base's daemon, replayed by both builds: each sample, and the registers while nothing changes."""
import csv
import io
import json
import math
import pathlib
import shutil
import subprocess
import tempfile
import time

from pymodbus.client import ModbusTcpClient

import daemon as rig  # tests/system/daemon.py
from grasp_test import config_of
from same.numbers import ROOT, Calibrations, ctl
from same.outcome import compare_csv

# Registers with times, ages and counts of frames: two runs of one build differ in them.
TIMES = {"SEQ": "number of the frame", "SEQ_END": "number of the frame", "HEARTBEAT": "counts 100 ms", "AGE_MS": "age", "AGE_BOUND": "age", "TIME": "clock",
         "CYCLE_WORST": "a duration", "SINCE_LIFT": "a duration", "RATE": "measured", "BLINK": "from HEARTBEAT",
         "LOST": "frames that a loaded machine lost", "WARN": "late cycles of a loaded machine", "PEAK": "may have begun before the first frame"}
REST_s = 0.5  # a value that is constant for so long is not between two loads
MIN_CHANGED = 40  # registers; where fewer change, the recording was not played
STILL = """
format = 1
title = "Holds"
rate_Hz = 250
[body]
mass_kg = {mass_kg}
friction = 1.0
{sensors}
"""
HOLD, PRESS = '\n[[motion]]\ndo = "hold"\nfor_s = {}\n', '\n[[motion]]\ndo = "press"\nto_N = {}\nin_s = 0.3\ncourse = "smooth"\n'
SHEAR = '\n[[motion]]\ndo = "shear"\nto_N = {}\nin_s = 0.3\n'
DEMO = """
[[link]]
name = "usb0"
driver = "uart"
device = "{folder}/skin"
path = "direct"
format = "lines"
channels = 15
sequence = true
checksum = true
simulated = true

[[link]]
name = "usb1"
driver = "uart"
device = "{folder}/table"
path = "direct"
format = "cobs"
simulated = true

[[sensor]]
name = "skin"
link = "usb0"
model = "generic"
calibration = "CALIBRATION/skin_eflesh.toml"
stale_ms = 350

[[sensor]]
name = "table"
link = "usb1"
counts_per_unit = 1e9
model = "table"
calibration = "CALIBRATION/table_documents.toml"
stale_ms = 100
""".replace("CALIBRATION", str(ROOT / "config/calibration"))


def still_configuration(folder, hair):
    """Three jaws with hair, a table sensor and a capacitive one, without noise, that hold loads for a second each."""
    scenes = {
        "jaws": [PRESS.format(0.837), HOLD.format(1.5), '\n[[motion]]\ndo = "lift"\ndirection_deg = 270\nacceleration_m_s2 = 0.5\n', HOLD.format(2),
                 '\n[[motion]]\ndo = "release"\nin_s = 0.3\n'],
        "table": [PRESS.format(0.4), HOLD.format(1.5), SHEAR.format(0.2), HOLD.format(1.5), PRESS.format(0.9), HOLD.format(1.5)],
        "pad": [PRESS.format(3), HOLD.format(1.5), PRESS.format(8), HOLD.format(1.5), SHEAR.format(0.5), HOLD.format(1.5)],
    }
    sensors = {"jaws": "".join(f'[[sensor]]\nname = "jaw{i + 1}"\nmodel = "hair"\nfull_scale_N = 0.34\nshare = 0.33333333\nturn_deg = {90 * i}\n'
                               for i in range(3)),
               "table": '[[sensor]]\nname = "plate"\nmodel = "table"\n', "pad": '[[sensor]]\nname = "pad"\nmodel = "capacitive"\n'}
    for name, motions in scenes.items():
        text = STILL.format(mass_kg=0.0569, sensors=sensors[name]) + HOLD.format(2) + "".join(motions) + HOLD.format(2)
        (folder / f"{name}.toml").write_text(text)
    config = config_of(folder / "jaws.toml", hair)[0].replace('[[link]]\n', '[[link]]\neffects = "none"\n').replace('objects = "objects.toml"\n', "")
    for name, sensor, model, calibration in (("table", "plate", "table", "table_documents"), ("pad", "pad", "capacitive", "capacitive_documents")):
        config += (f'\n[[link]]\nname = "{name}"\ndriver = "sim"\neffects = "none"\nscene = "{folder}/{name}.toml"\n\n[[sensor]]\nname = "{sensor}"\n'
                   f'link = "{name}"\nmodel = "{model}"\ncalibration = "{ROOT}/config/calibration/{calibration}.toml"\n')
        if model == "capacitive":
            config += 'channels = ["C1", "C2", "C3", "C4", "Cn"]\n'
    return config


class Recording:
    """A configuration on base's daemon and what its recorder kept. The files stay until close()."""

    def __init__(self, base, config, seconds, players=()):
        self.base, self.seconds, self.players = base, seconds, players
        self.daemon = rig.Daemon(config)
        self.folder, self.file = self.daemon.folder, self.daemon.folder / "recorded.mcap"

    def make(self):
        rig.BIN = self.base
        self.daemon.start()
        recorder = subprocess.Popen([self.base / "tactilectl", "record", self.file, "--config", self.daemon.config, "--node", self.daemon.name,
                                     "--seconds", str(self.seconds)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        rig.wait_for(self.file.exists, "the recording")
        for words in self.players:
            self.daemon.play(*(str(word).replace("{folder}", str(self.folder)) for word in words))
        said = recorder.communicate(timeout=self.seconds + 30)[0]
        assert recorder.returncode == 0, said
        self.daemon.__exit__()

    def close(self):
        self.daemon.__exit__()
        shutil.rmtree(self.folder)

    def sensors(self):
        return [sensor.split('name = "')[1].split('"')[0] for sensor in self.daemon.config.read_text().split("[[sensor]]")[1:]]

    def compare_replay(self, new, outcome, name):
        """Every field of every sample against the recorded one, in both builds; the forces of both as text, too."""
        for build in (self.base, new):
            done = ctl(build, "replay", self.file, "--config", self.daemon.config, "--json")
            if not done.stdout:
                outcome.add(1, 1, math.inf, f"{name}: {done.stderr.strip()}")
                continue
            for sensor in json.loads(done.stdout)["sensors"]:
                differ = sensor["compared"] - sensor["equal"]
                where = "base" if build == self.base else "new"
                # The greatest difference is that of the forces below; what they do not show counts as one of full scale.
                outcome.add(sensor["compared"], differ, 0, f"{name} {sensor['name']} ({where}): {sensor['first_difference']}" if differ else "")
                outcome.frames = getattr(outcome, "frames", 0) + sensor["frames"]
        for sensor in self.sensors():
            outs = []
            for build in (self.base, new):
                outs.append(self.folder / f"{sensor}.{len(outs)}.csv")
                ctl(build, "replay", self.file, "--config", self.daemon.config, "--sensor", sensor, "--out", outs[-1])
            if not all(out.exists() for out in outs):
                outcome.add(1, 1, math.inf, f"{name} {sensor}: no forces")
                continue
            before = outcome.greatest
            compare_csv(outcome, *outs, f"{name} {sensor}")
            if outcome.differ and outcome.greatest == before == 0:
                outcome.greatest = 1.0


def blocks_of(build):
    """[(function, address, count, [name, ...])] of all registers that can be read, and bits."""
    entries = {}
    for row in csv.DictReader(io.StringIO(ctl(build, "map", "--format", "csv").stdout)):
        function = {"coil": 1, "discrete input": 2}.get(row["kind"], 4 if row["number_3xxxx"] else 3)
        for k in range(int(row["registers"])):
            sensor = f" of sensor {row['sensor']}" if row["sensor"] else ""
            entries[function, int(row["address"]) + k] = f"{row['name']}{sensor} at {int(row['address']) + k}"
    blocks = []
    for (function, address), name in sorted(entries.items()):
        last = blocks[-1] if blocks else None
        if last and last[0] == function and last[1] + last[2] == address and last[2] < 100:
            blocks[-1] = (function, last[1], last[2] + 1, [*last[3], name])
        else:
            blocks.append((function, address, 1, [name]))
    beyond = [f" of sensor {n} " for n in range(6, 16)]  # five are configured
    return [b for b in blocks if not any(word in b[3][0] for word in beyond)]


def dump(client, blocks):
    values = {}
    for function, address, count, names in blocks:
        read = {1: client.read_coils, 2: client.read_discrete_inputs, 3: client.read_holding_registers, 4: client.read_input_registers}[function]
        answer = read(address, count, slave=1)
        got = [f"exception {answer.exception_code}"] * count if answer.isError() else answer.bits[:count] if function < 3 else answer.registers
        values.update({(function, name): value for name, value in zip(names, got) if name.split()[0] not in TIMES})
    return values


def watch(recording, build, blocks):
    """Plays the recording on a daemon of the build. {register: [(value, seconds that it stayed), ...]}, in the order of time."""
    rig.BIN = build
    daemon = recording.daemon
    (daemon.folder / "tactiled.log").unlink(missing_ok=True)  # start() waits for a line in it
    daemon.start()
    client = ModbusTcpClient("127.0.0.1", port=daemon.port)
    rig.wait_for(client.connect, "the Modbus server")
    runs = {}
    begun = time.monotonic()
    while (now_s := time.monotonic() - begun) < recording.seconds + 1:
        for name, value in dump(client, blocks).items():
            run = runs.setdefault(name, [])
            if not run or run[-1][0] != value:
                run.append([value, now_s, now_s])
            run[-1][2] = now_s
        time.sleep(0.005)
    client.close()
    daemon.__exit__()
    return {name: [(value, end_s - begin_s) for value, begin_s, end_s in run] for name, run in runs.items()}


def not_found(runs, others):
    """Returns the number of constant values in `runs`, and those that are not in `others`, in the same order. A busy
    machine may report a change later, and other values between two constant ones."""
    rested = [value for value, seconds in runs if seconds >= REST_s]
    missing, at = [], 0
    values = [value for value, _ in others]
    for value in rested:
        if value in values[at:]:
            at = values.index(value, at)
        else:
            missing.append(value)
    return len(rested), missing


def compare_registers(recording, new, outcome):
    text = recording.daemon.config.read_text()
    links = text.split("[[link]]")
    replayed = [links[0]]
    for part in links[1:]:
        name = part.split('name = "')[1].split('"')[0]
        rest = part[part.index("\n[["):] if "\n[[" in part else ""
        replayed.append(f'\nname = "{name}"\ndriver = "replay"\nlink = "{name}"\nfile = "{recording.file}"\n' + rest)
    recording.daemon.config.write_text("[[link]]".join(replayed))
    blocks = blocks_of(recording.base)
    try:
        base, other = (watch(recording, build, blocks) for build in (recording.base, new))
    except AssertionError as log:
        outcome.add(1, 1, math.inf, f"a daemon did not start: {log}")
        return
    for name in sorted(base.keys() | other.keys()):
        for runs, others, build in ((base, other, "new"), (other, base, "base")):
            rested, missing = not_found(runs.get(name, []), others.get(name, []))
            outcome.add(rested, len(missing), 1.0 if missing else 0, f"{name[1]}: {missing[0]} was not read from {build}" if missing else "")
    changed = sum(len(runs) > 1 for runs in base.values())
    if changed < MIN_CHANGED:
        outcome.add(1, 1, math.inf, f"only {changed} registers changed while the recording played:\n{recording.daemon.log()}")
    print(f"registers: {len(base)} of {sum(b[2] for b in blocks)} compared where they rested for {REST_s} s, "
          f"{changed} of them changed; left out: " + ", ".join(f"{name} ({why})" for name, why in TIMES.items()))


def compare(base, new, parts, outcome):
    folder = pathlib.Path(tempfile.mkdtemp(prefix="same-daemons-"))
    fits = Calibrations(base, folder)
    fits.scenes("calibrate_hair.toml")
    hair = folder / "hair.toml"
    done = ctl(base, "calibrate", *fits.jobs["calibrate_hair-sum_diff"], "--out", hair)
    assert done.returncode == 0, done.stderr
    demo = ROOT / "config/demo"
    recordings = {}
    if "recordings" in parts:
        recordings["demo"] = Recording(base, DEMO, 8, (
            ("--in", demo / "skin_session2.csv", "--pty", "{folder}/skin", "--format", "lines", "--sequence", "--checksum", "--speed", 4),
            ("--in", demo / "table_demo.csv", "--pty", "{folder}/table", "--format", "cobs", "--bits", 32, "--counts-per-unit", "1e9")))
        recordings["grasp"] = Recording(base, config_of(ROOT / "config/scenes/grasp_egg.toml", hair)[0].replace('objects = "objects.toml"\n', ""), 6)
    if "registers" in parts:
        recordings["still"] = Recording(base, still_configuration(folder, hair), 12)
    try:
        for recording in recordings.values():
            recording.make()
        if "recordings" in parts:
            samples = outcome("replayed recordings, samples and cells")
            for name, recording in recordings.items():
                recording.compare_replay(new, samples, name)
        if "registers" in parts:
            compare_registers(recordings["still"], new, outcome("registers at rest"))
    finally:
        for recording in recordings.values():
            recording.close()
        shutil.rmtree(folder)
