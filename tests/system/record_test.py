#!/usr/bin/env python3
"""tactilectl record and replay, and driver "replay": what was recorded comes back bit for bit, and an independent reader agrees."""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402
from modbus_interop_test import INTEROP, fetch_javascript  # noqa: E402

LINK = """
[[link]]
name = "usb0"
driver = "uart"
device = "{folder}/dev"
path = "direct"
format = "cobs"
"""
SENSOR = """
[[sensor]]
name = "table"
link = "usb0"
model = "table"
calibration = "ROOT/config/calibration/table_documents.toml"
counts_per_unit = 1e9
filter_hz = 50
""".replace("ROOT", str(ROOT))
REPLAY = """
[[link]]
name = "usb0"
driver = "replay"
file = "{folder}/back.mcap"
at_end = "again"
"""
RATE_Hz = 1000


def tactilectl(*words, **kinds):
    return subprocess.run([BIN / "tactilectl", *map(str, words)], capture_output=True, text=True, timeout=60, **kinds)


class Record(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """One recording for all: from the daemon's start, so that filters and sequence begin where the file begins."""
        daemon = Daemon(LINK + SENSOR)
        cls.addClassCleanup(shutil.rmtree, daemon.folder)
        cls.addClassCleanup(daemon.__exit__)
        cls.daemon, cls.file = daemon, daemon.folder / "pick.mcap"
        daemon.start()
        cls.recorder = subprocess.Popen([BIN / "tactilectl", "record", cls.file, "--config", daemon.config, "--json", "--node", daemon.name],
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        wait_for(cls.file.exists, 5, "the file")
        time.sleep(0.1)
        daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", daemon.folder / "dev", "--format", "cobs", "--counts-per-unit", "1e9", "--bits", "32",
                    "--rate", RATE_Hz, "--loop")
        time.sleep(3)
        cls.recorder.send_signal(signal.SIGINT)
        out, cls.errors = cls.recorder.communicate(timeout=10)
        cls.said = json.loads(out)

    def test_loses_nothing_and_says_how_much_there_is(self):
        self.assertEqual((self.recorder.returncode, self.errors, self.said["lost"]), (0, "", 0))
        self.assertEqual(self.said["bytes"], self.file.stat().st_size)
        self.assertGreater(self.said["messages"], 3 * 2 * RATE_Hz)

    def test_replay_gives_the_same_samples_to_the_last_bit(self):
        done = tactilectl("replay", self.file, "--config", self.daemon.config, "--json")
        sensor = json.loads(done.stdout)["sensors"][0]
        self.assertEqual((done.returncode, sensor["first_difference"]), (0, ""), done.stdout + done.stderr)
        self.assertGreater(sensor["frames"], 2 * RATE_Hz)
        self.assertEqual((sensor["compared"], sensor["equal"]), (sensor["frames"], sensor["frames"]))

    def test_replay_with_another_method_says_where_it_differs(self):
        other = self.daemon.folder / "other.toml"
        other.write_text(self.daemon.config.read_text().replace("filter_hz = 50", "filter_hz = 51"))
        done = tactilectl("replay", self.file, "--config", other)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stdout, r"first difference: sample \d+: force_S_N")

    def test_a_recording_from_a_running_daemon_is_compared_before_the_filter(self):
        late = self.daemon.folder / "late.mcap"
        self.assertEqual(tactilectl("record", late, "--seconds", 1, "--node", self.daemon.name).returncode, 0)
        done = tactilectl("replay", late, "--config", self.daemon.config, "--json")
        sensor = json.loads(done.stdout)["sensors"][0]
        self.assertEqual((done.returncode, sensor["first_difference"]), (0, ""), done.stdout)
        self.assertEqual(sensor["before_tare_and_filter"], sensor["compared"])
        self.assertGreater(sensor["compared"], RATE_Hz // 2)

    def test_a_link_of_another_name_compares_nothing_and_is_not_well(self):
        other = self.daemon.folder / "renamed.toml"
        other.write_text(self.daemon.config.read_text().replace('"usb0"', '"usb9"'))
        self.assertEqual(tactilectl("replay", self.file, "--config", other).returncode, 1)

    def test_a_cut_file_keeps_all_but_its_last_chunk_and_says_so(self):
        cut = self.daemon.folder / "cut.mcap"
        whole = self.file.read_bytes()
        cut.write_bytes(whole[:len(whole) * 2 // 3])
        done = tactilectl("replay", cut, "--config", self.daemon.config, "--json")
        said = json.loads(done.stdout)
        self.assertEqual(done.returncode, 0)
        self.assertIn("its end is missing", said["why"])
        self.assertGreater(said["sensors"][0]["equal"], 0.5 * self.said["messages"] / 3)

    def test_an_independent_reader_finds_every_message_and_the_forces(self):
        fetch_javascript()
        env = {**os.environ, "NODE_PATH": str(ROOT / "build/npm/node_modules")}
        for file, indexed in ((self.file, True), (self.daemon.folder / "end.mcap", False)):
            if not indexed:
                file.write_bytes(self.file.read_bytes()[:-100])
            read = subprocess.run(["node", INTEROP / "read_mcap.js", file], capture_output=True, text=True, timeout=60, env=env)
            self.assertEqual(read.returncode, 0, read.stderr)
            seen = json.loads(read.stdout)
            self.assertEqual(seen["indexed"], indexed)
            self.assertEqual(sum(channel["messages"] for channel in seen["channels"].values()), self.said["messages"])
            self.assertEqual(seen["schemas"]["geometry_msgs/msg/WrenchStamped"], "ros2msg")
            node = self.daemon.name
            self.assertEqual(seen["channels"][f"/{node}/table/sample"]["metadata"]["model"], "table")
            self.assertEqual(seen["channels"][f"/{node}/link/usb0/frames"]["encoding"], "cdr")
            self.assertEqual(seen["attachments"], 1 if indexed else 0)
            self.judge(*(seen["first"][f"/{node}/{topic}"] for topic in ("link/usb0/frames", "table/sample", "table/wrench_uncertain")))
            for bad in seen["first"].get(f"/{node}/table/wrench", []):
                self.assertIsNone(bad["wrench"]["force"]["z"])

    def judge(self, frames, samples, wrenches):
        """This calibration states no deviation, so all is UNCERTAIN. What was decoded by the definitions in the file, against what replay makes of the frames."""
        forces = self.daemon.folder / "forces.csv"
        tactilectl("replay", self.file, "--config", self.daemon.config, "--out", forces)
        rows = [[float(cell) if cell else None for cell in line.split(",")[1:4]] for line in forces.read_text().splitlines()[1:]]
        of_frames = [sample for sample in samples if sample["quality"] != 3]
        self.assertGreater(len(of_frames), 150)
        for sample, row in zip(of_frames, rows):
            self.assertEqual([round(v, 12) for v in sample["force_s_n"]], [round(v, 12) for v in row])
        self.assertEqual([s["device_sequence"] for s in of_frames[:100]], [f["sequence"] for f in frames[:100]])
        self.assertEqual([s["t_ns"] for s in of_frames[:100]], [f["t_ns"] for f in frames[:100]])
        self.assertEqual({len(frame["channel"]) for frame in frames}, {8})
        for sample, w in zip(of_frames, wrenches):
            self.assertEqual(sample["quality"], 2)
            self.assertEqual(sample["force_s_n"], [w["wrench"]["force"][axis] for axis in "xyz"])
            self.assertEqual(w["header"]["frame_id"], "table")
            self.assertEqual(sample["stamp"], w["header"]["stamp"])
        stamp = wrenches[0]["header"]["stamp"]
        self.assertLess(abs(stamp.get("sec", 0) - time.time()), 300)

    def test_a_full_disk_ends_the_recording_and_nothing_else(self):
        small = self.daemon.folder / "small.mcap"
        limited = subprocess.run(["prlimit", "--fsize=1000000", BIN / "tactilectl", "record", small, "--seconds", "20", "--node", self.daemon.name],
                                 capture_output=True, text=True, timeout=40, preexec_fn=lambda: signal.signal(signal.SIGXFSZ, signal.SIG_IGN))
        self.assertEqual(limited.returncode, 1)
        self.assertIn("recorded so far", limited.stderr)
        self.assertTrue(json.loads(self.daemon.ctl("status", "--json").stdout)["sensors"][0]["quality"].startswith(("good", "uncertain")))
        done = tactilectl("replay", small, "--config", self.daemon.config, "--json")
        self.assertGreater(json.loads(done.stdout)["sensors"][0]["frames"], 20)

    def test_refuses_to_replace_a_file_and_a_daemon_that_is_not_there(self):
        again = tactilectl("record", self.file, "--node", self.daemon.name)
        self.assertEqual(again.returncode, 2)
        self.assertIn("--overwrite", again.stderr)
        self.assertEqual(tactilectl("record", self.daemon.folder / "x.mcap", "--node", "nobody").returncode, 3)
        self.assertEqual(tactilectl("replay", self.daemon.config, "--config", self.daemon.config).returncode, 2)

    def test_the_driver_plays_it_into_another_daemon_as_simulated(self):
        with Daemon(REPLAY + SENSOR) as other:
            shutil.copy(self.file, other.folder / "back.mcap")
            other.start()

            def sensor():
                return json.loads(other.ctl("status", "--json").stdout)
            wait_for(lambda: sensor()["sensors"][0]["quality"].startswith(("good", "uncertain")), 5, "a value")
            time.sleep(1.2)
            status = sensor()
            self.assertIs(status["simulated"], True)
            self.assertEqual(status["links"][0]["lost"], 0)
            self.assertAlmostEqual(status["sensors"][0]["rate_Hz"], RATE_Hz, delta=0.1 * RATE_Hz)


if __name__ == "__main__":
    unittest.main()
