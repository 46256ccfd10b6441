#!/usr/bin/env python3
"""A sensor whose readings lag behind the force: calibrate measures by how much, and each sample has the time of its force."""
import csv
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, Daemon  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

DELAY_S, RATE_HZ = 0.023, 500
CONFIG = """
[[link]]
name = "usb0"
driver = "uart"
device = "{folder}/skin"
format = "lines"
channels = 2

[[sensor]]
name = "skin"
link = "usb0"
model = "generic"
calibration = "{folder}/skin.toml"
stale_ms = STALE
"""


def force(t_s):
    return math.sin(7 * t_s) + 0.3 * math.sin(31 * t_s), -4 - 2 * math.sin(5 * t_s) - math.sin(23 * t_s)


def write(path, rows):
    """rows: (t_s, what the sensor feels, what the reference says), each (fx, fz)."""
    noise = random.Random(3)
    with open(path, "w") as file:
        file.write("t_s,A,B,fx_N,fz_N\n")
        for t_s, felt, said in rows:
            a, b = 300 * felt[0] + 20 * felt[1], 250 * felt[1] - 10 * felt[0]
            file.write(f"{t_s},{a + noise.gauss(0, 1):.6g},{b + noise.gauss(0, 1):.6g},{said[0]:.9g},{said[1]:.9g}\n")


class Delay(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        made = random.Random(5)
        held = [(made.uniform(-1.3, 1.3), made.uniform(-7, -0.5)) for _ in range(60)]
        write(self.folder / "held.csv", [(i / 50, held[i // 5], held[i // 5]) for i in range(300)])
        write(self.folder / "moving.csv", [(t, force(t - DELAY_S), force(t)) for t in (i / RATE_HZ for i in range(3000))])

    def calibrate(self, out, moving, *words):
        return subprocess.run([BIN / "tactilectl", "calibrate", "--model", "generic", "--in", self.folder / "held.csv", "--out",
                               out, "--moving", moving, *words], capture_output=True, text=True)

    def test_it_is_measured_and_taken_off_the_time_of_each_sample(self):
        done = self.calibrate(self.folder / "skin.toml", self.folder / "moving.csv", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        delay = json.loads(done.stdout)["delay"]
        self.assertAlmostEqual(delay["delay_s"], DELAY_S, delta=5 * delay["sd_s"] + 1e-5)
        self.assertLess(delay["sd_s"], 2e-4)

        subprocess.run([BIN / "tactilectl", "decouple", "--calibration", self.folder / "skin.toml", "--in",
                        self.folder / "moving.csv", "--out", self.folder / "forces.csv"], check=True)
        with open(self.folder / "forces.csv") as file:
            rows = list(csv.DictReader(file))
        for i in range(100, 3000, 100):
            t_s = float(rows[i]["t_s"])
            self.assertAlmostEqual(t_s, i / RATE_HZ - delay["delay_s"], places=9)
            for name, true in zip(("fx_N", "fz_N"), force(t_s)):
                self.assertAlmostEqual(float(rows[i][name]), true, delta=0.05)  # 1.5 N apart at the time of the reading

        with Daemon(CONFIG.replace("STALE", "1000")) as d:
            (d.folder / "skin.toml").write_bytes((self.folder / "skin.toml").read_bytes())
            played = [line.split(",")[:3] for line in (self.folder / "moving.csv").read_text().splitlines()]
            (d.folder / "played.csv").write_text("".join(",".join(row) + "\n" for row in played))
            d.play("--in", d.folder / "played.csv", "--pty", d.folder / "skin", "--format", "lines", "--rate", RATE_HZ, "--loop")
            d.start()
            with tactiled.open(d.name).follow("skin", 1) as follower:
                late = [(s.t_published_ns - s.t_ns) * 1e-9 for s in (next(follower) for _ in range(500)) if s.quality == tactiled.GOOD]
            self.assertGreater(len(late), 100)
            self.assertGreaterEqual(min(late), delay["delay_s"] - 1e-9)
            self.assertLess(min(late), delay["delay_s"] + 0.02)

    def test_what_cannot_be_is_refused(self):
        skin = self.folder / "skin.toml"
        write(self.folder / "still.csv", [(i / 50, held, held) for i, held in enumerate([(0.5, -3)] * 300)])
        for moving, said in ((self.folder / "still.csv", "still.csv tells no delay: the force changes in 0 rows"), (self.folder / "nowhere.csv", "nowhere.csv")):
            done = self.calibrate(skin, moving)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn(said, done.stderr)
            self.assertFalse(skin.exists())
        done = self.calibrate(self.folder / "moving.csv", self.folder / "moving.csv")
        self.assertEqual(done.returncode, 2)
        self.assertIn("would replace this file", done.stderr)

        self.assertEqual(self.calibrate(skin, self.folder / "moving.csv").returncode, 0)
        config = self.folder / "tactiled.toml"
        for stale_ms, status in ((20, 1), (30, 0)):
            config.write_text(CONFIG.replace("STALE", str(stale_ms)).replace("{folder}", str(self.folder)))
            done = subprocess.run([BIN / "tactilectl", "check", config], capture_output=True, text=True)
            self.assertEqual(done.returncode, status, done.stderr)
            self.assertEqual("stale_ms = 20: the readings lag 23 ms behind" in done.stderr, status == 1, done.stderr)


if __name__ == "__main__":
    unittest.main()
