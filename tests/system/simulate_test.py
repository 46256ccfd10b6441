#!/usr/bin/env python3
"""tactilectl simulate: files and their bytes, the report, errors, and a scene through ptys into the daemon."""
import csv
import json
import math
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402
from report_test import Page  # noqa: E402

PRESS = ROOT / "config/scenes/press_ramp.toml"
SPEEDING_UP = ROOT / "config/scenes/speeding_up.toml"

ONE = """
format = 1
title = "one"
rate_Hz = 500
[[sensor]]
name = "left"
model = "table"
[[motion]]
do = "press"
to_N = 0.5
in_s = 0.1
[[motion]]
do = "shear"
to_N = 0.2
direction_deg = 30
in_s = 0.1
[[motion]]
do = "hold"
for_s = 0.2
[[motion]]
do = "release"
in_s = 0.1
"""
# Three times as long, so that a daemon reads it for a while; the second sensor at half the rate.
TWO = ONE + """
[[motion]]
do = "repeat"
last = 4
times = 3
[[sensor]]
name = "right"
model = "hair"
share = 0.02
every = 2
"""
LINK = """
[[link]]
name = "{sensor}"
driver = "uart"
device = "{folder}/{device}"
path = "direct"
baud = 921600
%s
"""
SENSOR = """
[[sensor]]
name = "{sensor}"
link = "{link}"
device = {number}
model = "generic"
calibration = "{folder}/{sensor}.toml"
counts_per_unit = {counts_per_unit}
stale_ms = 2000
"""


def simulate(*words, check=True, **more):
    command = [BIN / "tactilectl", "simulate", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, **more)
    if check:
        assert done.returncode == 0, done.stderr
    return done


def double_of(word):
    return struct.unpack("<d", int(word, 16).to_bytes(8, "little"))[0]


def table(path):
    with open(path) as file:
        return list(csv.DictReader(file))


class Files(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def scene(self, text, name="scene.toml"):
        path = self.folder / name
        path.write_text(text)
        return path

    def bytes_of(self, scene, effects):
        out, truth = self.folder / "s.csv", self.folder / "t.csv"
        simulate("--scene", scene, "--effects", effects, "--out", out, "--truth", truth)
        return out.read_bytes(), truth.read_bytes()

    def on(self, scene, effects="auto"):
        report = json.loads(simulate("--scene", scene, "--effects", effects, "--json").stdout)
        return [":".join(filter(None, (effect["name"], effect["level"]))) for effect in report["sensors"][0]["effects"]
                if effect["on"]]

    def test_the_same_scene_gives_the_same_bytes(self):
        for scene in (PRESS, self.scene(TWO)):
            for effects in ("auto", "all", "none"):
                with self.subTest(f"{scene.name} {effects}"):
                    self.assertEqual(self.bytes_of(scene, effects), self.bytes_of(scene, effects))
        names = self.on(PRESS) or ["none"]
        everything = [effect["name"] for effect in json.loads(simulate("--list", "--json").stdout)["effects"]]
        # Effects of a list never rest, unlike those of "auto".
        for asked, same in ((",".join(reversed(names)), ",".join(names)), (",".join(everything), "all")):
            self.assertTrue(self.bytes_of(PRESS, asked) == self.bytes_of(PRESS, same), asked)
        self.assertNotEqual(self.bytes_of(PRESS, "all")[0], self.bytes_of(PRESS, "none")[0])
        another = self.scene(PRESS.read_text().replace("format = 1\n", "format = 1\nseed = 2\n", 1))
        self.assertNotEqual(self.bytes_of(PRESS, "noise")[0], self.bytes_of(another, "noise")[0])

    def test_one_sensor_has_plain_columns_and_a_row_a_frame(self):
        scene, out, truth = self.scene(ONE), self.folder / "s.csv", self.folder / "t.csv"
        simulate("--scene", scene, "--effects", "none", "--out", out, "--truth", truth)
        signals, true = table(out), table(truth)
        self.assertEqual(list(signals[0]), ["t_s", *(f"R{k}" for k in range(1, 9))])
        self.assertEqual(list(true[0]), ["t_s", "fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm", "cop_x_m", "cop_y_m",
                                         "effects"])
        self.assertEqual([row["t_s"] for row in signals], [repr(k / 500) if k else "0" for k in range(250)])
        self.assertEqual([row["t_s"] for row in true], [row["t_s"] for row in signals])
        self.assertEqual(true[0]["cop_x_m"], "", "a centre of contact without a contact")
        self.assertEqual([row["effects"] for row in true], ["none"] + [""] * 249)
        held = true[120]
        self.assertAlmostEqual(float(held["fz_N"]), -0.5, delta=1e-12)
        self.assertAlmostEqual(float(held["fx_N"]), 0.2 * math.cos(math.pi / 6), delta=1e-12)
        self.assertAlmostEqual(float(held["fy_N"]), 0.2 * math.sin(math.pi / 6), delta=1e-12)
        self.assertEqual((held["mz_Nm"], held["cop_x_m"]), ("", "0"))
        # Numbers that read back to the same double: printing them again gives the same text.
        for row in signals[1:]:
            for name, cell in row.items():
                self.assertEqual(repr(float(cell)).removesuffix(".0"), cell, name)

    def test_several_sensors_have_prefixes_and_empty_cells(self):
        scene, out, truth = self.scene(TWO), self.folder / "s.csv", self.folder / "t.csv"
        simulate("--scene", scene, "--effects", "none", "--out", out, "--truth", truth)
        signals, true = table(out), table(truth)
        self.assertEqual(list(signals[0])[1:], [*(f"left.R{k}" for k in range(1, 9)), *(f"right.H{k}" for k in range(1, 5))])
        self.assertEqual(len(signals), 750)
        for k, row in enumerate(signals):
            self.assertNotIn("", [row["left.R1"]])
            self.assertEqual(row["right.H1"] == "", k % 2 == 1)
        self.assertEqual((true[0]["left.effects"], true[0]["right.effects"]), ("none", "none"))
        self.assertAlmostEqual(float(true[120]["right.fz_N"]), -0.01, delta=1e-12)

    def test_out_to_standard_output_feeds_the_next_verb(self):
        out = self.folder / "s.csv"
        simulate("--scene", PRESS, "--out", out)
        self.assertEqual(simulate("--scene", PRESS, "--out", "-").stdout.encode(), out.read_bytes())
        calibration = ROOT / "config/calibration/table_documents.toml"
        forces = subprocess.run([BIN / "tactilectl", "decouple", "--calibration", calibration, "--in", out],
                                capture_output=True, text=True)
        self.assertEqual(forces.returncode, 0, forces.stderr)
        self.assertEqual(len(forces.stdout.splitlines()), len(out.read_text().splitlines()))

    def test_the_report_has_each_effect_and_needs_nothing_else(self):
        listed = {e["name"]: e for e in json.loads(simulate("--list", "--json").stdout)["effects"]}
        for name in listed:
            self.assertRegex(simulate("--list").stdout, rf"(?m)^{name}: ")
        html = self.folder / "r.html"
        done = simulate("--scene", self.scene(TWO), "--report", html, "--json")
        text, report = html.read_text(), json.loads(done.stdout)
        page = Page(text.replace("<br>", ""))
        self.assertEqual(page.faults, [])
        self.assertEqual(page.seen["svg"], 2)
        self.assertFalse({"script", "link", "img"} & set(page.seen))
        self.assertNotRegex(text.replace("http://www.w3.org/2000/svg", ""), "(?i)http|url\\(|@import")
        self.assertEqual(report["schema"], 1)
        words = set(page.words)
        for sensor in report["sensors"]:
            effects = {e["name"]: e for e in sensor["effects"]}
            self.assertEqual(set(effects), {n for n, e in listed.items() if sensor["model"] in e["models"]})
            self.assertLessEqual(set(effects), words)
            self.assertLessEqual(sensor["difference_N"], sensor["guaranteed_N"] + 1e-12)
            self.assertLessEqual(sensor["guaranteed_N"], sensor["wanted_N"])
            self.assertIn(sensor["difference_N"], page.values)
            self.assertGreater(sensor["none_ns"], 0)
            self.assertLess(sensor["none_ns"], sensor["all_ns"])
            for name, effect in effects.items():
                self.assertIn(effect["why"], words)
                self.assertIn(effect["bound_N"], page.values)
                for force_N in effect["without_N"].values():
                    self.assertIn(force_N, page.values, name)
                if not effect["on"]:
                    self.assertEqual(effect["error_N"], effect["bound_N"])
                    self.assertEqual(effect["spent_ns"], 0)
                if effect["share_N"] is not None:
                    self.assertLessEqual(effect["share_N"], effect["bound_N"] * (1 + 1e-9) + 1e-12, name)

    def test_without_an_effect_the_force_is_off_by_what_the_report_says(self):
        """0.5 N on a skin that creeps by a tenth within its time: by the effect's equation, only fz changes."""
        scene = self.scene("""
format = 1
title = "held"
[[sensor]]
name = "left"
model = "table"
[[motion]]
do = "press"
to_N = 0.5
course = "at_once"
[[motion]]
do = "hold"
for_s = 4.9
[effects.creep]
amount = 0.1
time_s = 5
""")
        for effects in ("creep", "none"):
            report = json.loads(simulate("--scene", scene, "--effects", effects, "--json").stdout)
            creep = next(e for e in report["sensors"][0]["effects"] if e["name"] == "creep")
            expected = 0.5 * 0.05 * ((1 - math.exp(-1)) + (1 - math.exp(-0.1)))
            self.assertAlmostEqual(creep["without_N"]["fz_N"], expected, delta=2e-5)
            self.assertAlmostEqual(creep["without_N"]["fx_N"], 0, delta=1e-12)

    def test_another_seed_is_that_of_a_scene_with_it(self):
        out, other = self.folder / "a.csv", self.folder / "b.csv"
        simulate("--scene", self.scene(ONE), "--effects", "noise", "--seed", "7", "--out", out)
        simulate("--scene", self.scene(ONE.replace("format = 1", "format = 1\nseed = 7")), "--effects", "noise", "--out", other)
        self.assertEqual(out.read_bytes(), other.read_bytes())
        simulate("--scene", self.scene(ONE), "--effects", "noise", "--out", other)
        self.assertNotEqual(out.read_bytes(), other.read_bytes())

    def test_in_the_scene_that_speeds_up_effects_come_on_one_by_one(self):
        figure = self.folder / "f.svg"
        simulate("--scene", SPEEDING_UP, "--figure", figure)
        self.assertEqual(figure.read_bytes(), (ROOT / "drivers/sim/effects.svg").read_bytes(),
                         "write it anew: tactilectl simulate --scene config/scenes/speeding_up.toml "
                         "--figure drivers/sim/effects.svg")
        self.assertLess(figure.stat().st_size, 60_000)
        root = xml.etree.ElementTree.parse(figure).getroot()
        bars = [e.get("d") for e in root.iter("{http://www.w3.org/2000/svg}path") if e.get("fill-opacity")]
        begins = set(re.findall(r"M([\d.]+) ", bars[-1]))  # bars[0] is that of the legend
        listed = json.loads(simulate("--list", "--json").stdout)["effects"]
        self.assertGreaterEqual(len(begins), min(8, len(listed)), "effects come on at different times")

    def refuses(self, *words, says, status=2):
        done = simulate(*words, check=False)
        self.assertEqual(done.returncode, status, done.stderr)
        self.assertRegex(done.stderr, says)
        self.assertNotIn("terminate", done.stderr)

    def test_errors_say_what_to_type_instead(self):
        scene = self.scene(ONE)
        self.refuses(says="--scene")
        self.refuses("--scene", self.folder / "none.toml", says="none.toml")
        self.refuses("--scene", scene, "--effects", "crep", says='no effect "crep"; did you mean "creep"')
        out = self.folder / "a.csv"
        self.refuses("--scene", scene, "--effects", "creep,noyse", "--out", out, says='did you mean "noise"')
        bad = self.scene(ONE.replace("to_N = 0.5", "to_M = 0.5"), "bad.toml")
        self.refuses("--scene", bad, says=r"bad\.toml:\d+: .*to_N")
        self.refuses("--scene", scene, "--sensor", "lef", "--json", says='did you mean "left"')
        self.refuses("--scene", scene, "--out", out, "--truth", self.folder / "." / "a.csv", says="--out too")
        self.refuses("--scene", scene, "--out", scene, says="--scene too")
        self.refuses("--scene", scene, "--json", "--out", "-", says="standard output")
        self.refuses("--scene", scene, "--out", self.folder / "nowhere" / "a.csv", says="nowhere")
        two = self.scene(TWO, "two.toml")
        self.refuses("--scene", two, "--pty", self.folder / "p", says="2 times --pty")
        self.refuses("--scene", scene, "--pty", self.folder / "p", "--pty", self.folder / "q", says="2 times for 1 sensor")
        self.refuses("--scene", scene, "--format", "morse", says="morse")
        self.assertEqual(scene.read_text(), ONE)
        self.assertFalse(out.exists(), "a file was begun although the words were wrong")


class Ptys(unittest.TestCase):
    """The daemon opens the scene as serial ports; the forces that it publishes are those of signals.csv, to the last
    bit."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.scene = self.folder / "scene.toml"
        self.scene.write_text(TWO)
        simulate("--scene", self.scene, "--out", self.folder / "signals.csv")

    def calibration(self, path, channels):
        """fx = the first channel, fy = the second, fz = the third: published values equal the read ones."""
        rows = [[float(i == k) for i in range(len(channels))] for k in range(3)]
        path.write_text(f"""format = 1
model = "generic"
channels = {json.dumps(channels)}
channel_unit = "dR/R0"
components = ["fx", "fy", "fz"]
zero = {[0.0] * len(channels)}
matrix = {rows}
""")

    def run_through(self, link, counts_per_unit, devices, words):
        """devices: pty of each sensor. Returns a list of (fx, fy, fz) for each."""
        names = {"left": [f"R{k}" for k in range(1, 9)], "right": [f"H{k}" for k in range(1, 5)]}
        config = ""
        for device in dict.fromkeys(devices.values()):
            config += LINK.replace("{sensor}", device).replace("{device}", device) % link[device]
        for sensor, device in devices.items():
            number = 1 if len(set(devices.values())) == 1 and sensor == "right" else 0
            config += (SENSOR.replace("{sensor}", sensor).replace("{link}", device).replace("{number}", str(number))
                       .replace("{counts_per_unit}", repr(counts_per_unit)))
        with Daemon(config) as daemon:
            for sensor, channels in names.items():
                self.calibration(daemon.folder / f"{sensor}.toml", channels)
            ptys = [w for device in dict.fromkeys(devices.values()) for w in ("--pty", daemon.folder / device)]
            with open(self.folder / "simulate.log", "w") as log:
                player = subprocess.Popen([BIN / "tactilectl", "simulate", "--scene", self.scene, *ptys, *words], stderr=log)
            daemon.others.append(player)
            wait_for(lambda: all((daemon.folder / device).is_symlink() for device in devices.values()), "the ptys")
            daemon.start()
            followers = {}
            for sensor in devices:
                with open(self.folder / f"{sensor}.samples", "w") as file:
                    followers[sensor] = subprocess.Popen([BIN / "follow", daemon.name, sensor, "20"], stdout=file)
            self.assertEqual(player.wait(timeout=30), 0)
            wait_for(lambda: all(link["gone"] for link in json.loads(daemon.ctl("status", "--json").stdout)["links"]), "the end of the links: all before it was read")
            self.assertEqual(daemon.stop()[0], 0)
            seen = {}
            for sensor, follower in followers.items():
                self.assertEqual(follower.wait(timeout=60), 0)
                seen[sensor] = (self.folder / f"{sensor}.samples").read_text().splitlines()
            self.assertIn(" 0 dropped", (self.folder / "simulate.log").read_text())
            return seen

    def check(self, lines, sensor, columns, as_sent):
        rows = [row for row in table(self.folder / "signals.csv") if row[f"{sensor}.{columns[0]}"]]
        self.assertGreater(len(rows), 300)
        arrived = {}
        for line in lines:
            words = line.split()
            if len(words) >= 10 and int(words[5]) != 3:
                arrived[int(words[1])] = [double_of(word) for word in words[7:10]]
        self.assertEqual(sorted(arrived), list(range(len(rows))), f"frames of {sensor} lost")
        for k, row in enumerate(rows):
            sent = [as_sent(float(row[f"{sensor}.{column}"])) for column in columns]
            self.assertEqual(arrived[k], sent, f"{sensor} row {k}")

    def test_text_lines_one_pty_a_sensor(self):
        link = 'format = "lines"\nchannels = %d\nsequence = true\nchecksum = true\n'
        seen = self.run_through({"l": link % 8, "r": link % 4}, 1.0, {"left": "l", "right": "r"},
                                ["--format", "lines", "--sequence", "--checksum"])
        self.check(seen["left"], "left", ["R1", "R2", "R3"], float)
        self.check(seen["right"], "right", ["H1", "H2", "H3"], float)

    def test_binary_frames_all_sensors_on_one_pty(self):
        counts = 1e7
        seen = self.run_through({"bus": 'format = "cobs"\n'}, counts, {"left": "bus", "right": "bus"},
                                ["--format", "cobs", "--counts-per-unit", "1e7", "--time"])
        self.check(seen["left"], "left", ["R1", "R2", "R3"], lambda value: round(value * counts) / counts)
        self.check(seen["right"], "right", ["H1", "H2", "H3"], lambda value: round(value * counts) / counts)


if __name__ == "__main__":
    unittest.main(verbosity=2)
