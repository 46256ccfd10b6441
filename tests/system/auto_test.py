#!/usr/bin/env python3
"""Method "auto" in the release daemon: three sensors that play one recording, and a CPU hog on the daemon's own CPU.

`hogged` has a budget of twice the measured time of its most accurate method; `impossible` has a budget that no method
meets; `roomy` has one that all methods meet, although the stored costs deny that. The test asserts properties that
hold on any machine: the direction of steps, their maximum number, the output of status, and that every sample equals,
to the last bit, the result of the method that it names for its row. Times are printed and not judged.
"""
import csv
import json
import math
import os
import pathlib
import random
import re
import subprocess
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

RATE_HZ, ROWS = 500, 600
SENSORS = ("hogged", "impossible", "roomy")
CHANNELS = ("c1", "c2", "c3")
HOG_S = 4
# A hog in the ordinary class copies 8 MB repeatedly; one above the pipeline takes 3 of 10 ms.
HOGS = {"ordinary": "b = bytearray(1 << 23)\nwhile True:\n    b = bytes(b)",
        "real-time": "import os, time\nos.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(90))\n"
                     "while True:\n    t = time.monotonic() + 0.003\n    while time.monotonic() < t: pass\n    time.sleep(0.007)"}


def write_recording(folder):
    """Writes labelled.csv, of a nonlinear sensor that saturates, and the same without labels."""
    made = random.Random(4)
    with open(folder / "labelled.csv", "w") as labelled, open(folder / "played.csv", "w") as played:
        labelled.write("t_s,c1,c2,c3,fx_N,fy_N,fz_N,session\n")
        played.write("t_s,c1,c2,c3\n")
        for row in range(ROWS):
            f = [made.uniform(-1, 1), made.uniform(-1, 1), made.uniform(-3, 0)]
            u = [f[0] + 0.2 * f[2], f[1] - 0.1 * f[2], 0.5 * f[2] + 0.05 * f[0] * f[1]]
            c = [round(1000 * math.tanh(0.5 * x) + made.gauss(0, 1)) for x in u]
            labelled.write(",".join(map(str, [row / RATE_HZ, *c, *f, "ab"[row * 2 // ROWS]])) + "\n")
            played.write(",".join(map(str, [row / RATE_HZ, *c])) + "\n")


def forces_by(method, folder):
    """Returns the forces of each row, by the code of `tactilectl decouple`."""
    out = folder / f"{method}.csv"
    subprocess.run([BIN / "tactilectl", "decouple", "--calibration", folder / "calibration.toml", "--method", method, "--in",
                    folder / "played.csv", "--out", out], check=True)
    with open(out) as file:
        return [tuple(float(row[c]) for c in ("fx_N", "fy_N", "fz_N")) for row in csv.DictReader(file)]


class Follower(threading.Thread):
    """Collects all samples of one sensor, in order."""

    def __init__(self, node, sensor):
        super().__init__(daemon=True)
        self.node, self.sensor, self.samples, self.ended, self.lost = node, sensor, [], threading.Event(), 0
        self.start()

    def run(self):
        with tactiled.open(self.node).follow(self.sensor, 1, from_oldest=True) as follower:
            # Continues to the sample that was the newest when the end was requested, however late.
            while not self.ended.is_set() or not self.samples or self.samples[-1].sequence < self.until:
                self.samples.append(next(follower))
            self.lost = follower.lost

    def close(self):
        with tactiled.open(self.node) as node:
            self.until = node.latest(self.sensor).sequence
        self.ended.set()
        self.join(30)
        assert not self.is_alive(), f"{self.sensor}: {len(self.samples)} samples read, {self.until} published"
        return [s for s in self.samples if s.quality in (tactiled.GOOD, tactiled.UNCERTAIN)]


class Auto(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemon = cls.enterClassContext(Daemon("[shm]\nhistory = 16384\n\n" + "".join(
            f'[[link]]\nname = "{name}"\ndriver = "uart"\ndevice = "{{folder}}/{name}.dev"\nformat = "cobs"\npath = "direct"\n\n'
            f'[[sensor]]\nname = "{name}"\nlink = "{name}"\nmodel = "generic"\ncalibration = "calibration.toml"\n'
            f'method = "auto"\nbudget_us = 100\nstale_ms = 10000\n\n' for name in SENSORS)))
        cls.folder = cls.daemon.folder
        cls.state = cls.folder / "state"
        cls.daemon.env["STATE_DIRECTORY"] = str(cls.state)
        write_recording(cls.folder)
        subprocess.run([BIN / "tactilectl", "calibrate", "--model", "generic", "--method", "auto", "--in",
                        cls.folder / "labelled.csv", "--out", cls.folder / "calibration.toml"], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for name in SENSORS:
            cls.daemon.play("--in", cls.folder / "played.csv", "--pty", cls.folder / f"{name}.dev", "--format", "cobs", "--rate",
                            RATE_HZ, "--loop")

    def costs(self, sensor):
        return self.state / f"{self.daemon.name}.{sensor}.costs.toml"

    def status(self):
        said = self.daemon.ctl("status", "--json")
        self.assertTrue(said.stdout, said)
        return {s["name"]: s.get("auto", {}) for s in json.loads(said.stdout)["sensors"]}

    def edit(self, path, pattern, replacement):
        text, times = re.subn(pattern, replacement, path.read_text())
        self.assertEqual(times, 1, (path, pattern))
        path.write_text(text)

    def begin(self):
        self.daemon.start()
        wait_for(lambda: all("now" in s for s in self.status().values()), "values of all sensors")

    def test_steps_down_over_budget_up_after_calm_and_every_sample_is_by_the_method_that_it_names(self):
        self.begin()
        first = self.status()["hogged"]
        front = [f["method"] for f in first["front"]]
        us = [f["measured_us"] for f in first["front"]]
        self.assertGreaterEqual(len(front), 2, first)
        self.assertEqual(us, sorted(us, reverse=True))
        self.assertEqual([f["sd_of_full_scale"] for f in first["front"]],
                         sorted(f["sd_of_full_scale"] for f in first["front"]))
        self.assertIn(front[0], first["began_with"])
        self.assertIn("method auto", self.daemon.ctl("status").stdout)
        self.daemon.stop()

        kept = self.costs("hogged").read_text()
        config = self.daemon.config.read_text().split('[[sensor]]\nname = "')
        for name, budget in (("hogged", 2 * us[0]), ("impossible", 0.01), ("roomy", 1e4)):
            config = [re.sub("budget_us = .*", f"budget_us = {budget:f}", part) if part.startswith(name + '"') else part
                      for part in config]
        self.daemon.config.write_text('[[sensor]]\nname = "'.join(config))
        methods = re.search(r"methods = \[(.*)\]", kept).group(1).replace('"', "").split(", ")
        for name, costs in (("impossible", (0.008, 0.004, 0.002, 0.001)), ("roomy", (8e4, 4e4, 2e4, 1.5e4))):
            # Methods that are not on the front get costs that exclude them from it.
            order = sorted(methods, key=lambda m: front.index(m) if m in front else -1)
            of = {m: costs[front.index(m)] if m in front else 1e6 for m in order}
            self.edit(self.costs(name), r"(?m)^us = .*", f"us = [{', '.join(f'{of[m]:f}' for m in methods)}]")

        self.begin()
        self.assertEqual(self.costs("hogged").read_text(), kept, "measured again")
        followers = {name: Follower(self.daemon.name, name) for name in SENSORS}
        began = self.status()
        self.assertEqual([f["method"] for f in began["roomy"]["front"]], front)
        self.assertIn("the fastest, for none is", began["roomy"]["began_with"])
        cpu = min(os.sched_getaffinity(self.daemon.process.pid))
        for thread in pathlib.Path(f"/proc/{self.daemon.process.pid}/task").iterdir():
            os.sched_setaffinity(int(thread.name), {cpu})
        spans = {"before": [time.monotonic_ns()]}
        time.sleep(1)
        for kind, code in HOGS.items():
            spans[kind] = [time.monotonic_ns()]
            hog = subprocess.Popen([sys.executable, "-c", code], preexec_fn=lambda: os.sched_setaffinity(0, {cpu}),
                                   stderr=subprocess.DEVNULL)
            time.sleep(HOG_S)
            refused = hog.poll() is not None
            hog.kill()
            hog.wait()
            spans[kind] += [time.monotonic_ns()] if not refused else []
        spans["before"].append(spans["ordinary"][0])
        wait_for(lambda: self.status()["roomy"]["steps_up"] >= 1, "the step up of the sensor with time enough")

        now = self.status()
        self.assertEqual(now["impossible"]["now"], front[-1])
        self.assertEqual(now["impossible"]["state"], "over-budget")
        self.assertEqual((now["impossible"]["steps_down"], now["impossible"]["steps_up"]), (len(front) - 1, 0))
        self.assertEqual(now["roomy"]["steps_down"], 0)
        self.assertNotEqual(now["roomy"]["now"], front[-1])
        self.assertLessEqual(now["hogged"]["steps_down"] + now["hogged"]["steps_up"], 17 * (len(front) - 1))
        truth = {m: forces_by(m, self.folder) for m in front}
        for name in SENSORS:
            self.check_samples(name, followers[name].close(), front, truth, spans if name == "hogged" else {})

    def check_samples(self, name, valued, front, truth, spans):
        self.assertGreater(len(valued), 5 * RATE_HZ)
        steps = 0
        for s in valued:
            by = (s.state >> 16 & 15) - 1
            self.assertIn(by, range(len(front)))
            self.assertEqual(s.raw_force_S_N, truth[front[by]][s.device_sequence % ROWS], (name, s))
            self.assertGreaterEqual(s.state >> 20, steps)
            steps = s.state >> 20
        if name == "impossible":
            self.assertTrue(all(s.state & tactiled.OVER_BUDGET for s in valued[-RATE_HZ:]))
            self.assertTrue(all(s.state & tactiled.STEPPED_DOWN for s in valued[-RATE_HZ:]))
        for span, ends in spans.items():
            if len(ends) < 2:
                print(f"{name}, hog {span}: refused here")
                continue
            part = [s for s in valued if ends[0] < s.t_ns < ends[1]]
            by = {m: sum((s.state >> 16 & 15) - 1 == i for s in part) for i, m in enumerate(front)}
            print(f"{name}, hog {span}: {len(part)} samples, by method {by}, "
                  f"steps {len({s.state >> 20 for s in part}) - 1 if part else 0}")


if __name__ == "__main__":
    unittest.main()
