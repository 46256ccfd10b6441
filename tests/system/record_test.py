#!/usr/bin/env python3
"""tactilectl record and replay, and driver "replay": recorded data are restored bit for bit, and an independent
reader agrees."""
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402
from modbus_interop_test import INTEROP, fetch_javascript  # noqa: E402

sys.dont_write_bytecode = True
sys.path[:0] = [str(INTEROP), str(ROOT / "node/python")]
import read_mcap  # noqa: E402
import tactiled  # noqa: E402

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
stale_ms = 2000
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
        """One recording for all tests, from the daemon's start, so that filters and sequence begin with the file."""
        daemon = Daemon(LINK + SENSOR)
        cls.addClassCleanup(shutil.rmtree, daemon.folder)
        cls.addClassCleanup(daemon.__exit__)
        cls.daemon, cls.file = daemon, daemon.folder / "pick.mcap"
        daemon.start()
        cls.recorder = subprocess.Popen([BIN / "tactilectl", "record", cls.file, "--config", daemon.config, "--json", "--node", daemon.name],
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        wait_for(cls.file.exists, "the file")
        time.sleep(0.1)
        daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", daemon.folder / "dev", "--format", "cobs", "--counts-per-unit", "1e9", "--bits", "32",
                    "--rate", RATE_Hz, "--loop")
        with tactiled.open(daemon.name) as node:
            wait_for(lambda: node.latest("table").sequence > 2.5 * RATE_Hz, "samples")
        cls.recorder.send_signal(signal.SIGINT)
        out, cls.errors = cls.recorder.communicate(timeout=60)
        cls.said = json.loads(out)

    def test_loses_nothing_and_says_how_much_there_is(self):
        self.assertEqual((self.recorder.returncode, self.errors, self.said["lost"]), (0, "", 0))
        self.assertEqual(self.said["bytes"], self.file.stat().st_size)
        self.assertGreater(self.said["messages"], 4 * 2 * RATE_Hz)

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
        self.assertGreater(said["sensors"][0]["equal"], 0.5 * self.said["messages"] / 4)

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
            self.assertEqual(seen["attachments"], 3 if indexed else 0)  # the configuration, again under its path, the
                                                                        # calibration
            self.assertEqual(seen["channels"][f"/{node}/table/wrench"]["messages"], seen["channels"][f"/{node}/table/sample"]["messages"])
            self.assertEqual(seen["channels"][f"/{node}/table/quality"]["messages"], seen["channels"][f"/{node}/table/sample"]["messages"])
            self.judge(*(seen["first"][f"/{node}/{topic}"] for topic in ("link/usb0/frames", "table/sample", "table/wrench", "table/quality")))

    def test_the_layout_for_foxglove_shows_what_a_recording_has(self):
        fetch_javascript()
        env = {**os.environ, "NODE_PATH": str(ROOT / "build/npm/node_modules")}
        seen = json.loads(subprocess.run(["node", INTEROP / "read_mcap.js", self.file], capture_output=True, text=True, timeout=60, env=env, check=True).stdout)
        layout = json.loads((ROOT / "config/foxglove_layout.json").read_text())
        demo = tomllib.loads((ROOT / "config/demo.toml").read_text())
        panels = layout["configById"]
        paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])] + [panels["RawMessages!sample"]["topicPath"]]
        for path in paths:
            _, node, sensor, rest = path.split("/")
            kind, *keys = re.findall(r"\w+", rest)
            self.assertEqual(node, demo["node"]["name"])
            self.assertIn(sensor, [each["name"] for each in demo["sensor"]])
            value = next(message for message in seen["first"][f"/{self.daemon.name}/table/{kind}"] if message.get("quality", 2) != 3)
            for key in keys:
                value = value[int(key) if key.isdigit() else key]
        self.assertGreater(len(paths), 8)

        def names(tree):
            return {tree} if isinstance(tree, str) else names(tree["first"]) | names(tree["second"])
        self.assertEqual(names(layout["layout"]), set(panels))

    def judge(self, frames, samples, wrenches, qualities):
        """This calibration states no standard deviation, so all is UNCERTAIN. Compares the messages, decoded by the
        definitions in the file, with the result of replay."""
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
        for sample, quality in zip(samples, qualities):
            self.assertEqual((sample["quality"], sample["reasons"], sample["stamp"]), (quality["quality"], quality["reasons"], quality["stamp"]))
            self.assertTrue(quality["text"].startswith(("", "good", "uncertain:", "bad:")[quality["quality"]]), quality)
        self.assertTrue(all(0 <= quality["age_bound_s"] < 0.5 for quality in qualities[-100:]), qualities[-1])
        for sample, w in zip(samples, wrenches):
            if sample["quality"] == 3:
                self.assertIsNone(w["wrench"]["force"]["z"])
        for sample, w in zip(of_frames, [w for w, s in zip(wrenches, samples) if s["quality"] != 3]):
            self.assertEqual(sample["quality"], 2)
            self.assertEqual(sample["force_s_n"], [w["wrench"]["force"][axis] for axis in "xyz"])
            self.assertEqual(w["header"]["frame_id"], "table")
            self.assertEqual(sample["stamp"], w["header"]["stamp"])
        stamp = wrenches[0]["header"]["stamp"]
        self.assertLess(abs(stamp.get("sec", 0) - time.time()), 300)

    def test_replay_needs_no_configuration_beside_the_file(self):
        """Also if none of its files is on the disk any more, and if the daemon reported to record which one it has
        read."""
        alone = self.daemon.folder / "alone.mcap"
        self.assertEqual(tactilectl("record", alone, "--seconds", 1, "--node", self.daemon.name).stderr, "")
        for file in (self.file, alone):
            away = self.daemon.folder / "tactiled.toml.away"
            self.daemon.config.rename(away)
            try:
                done = tactilectl("replay", file, "--json", cwd="/")
            finally:
                away.rename(self.daemon.config)
            sensor = json.loads(done.stdout)["sensors"][0]
            self.assertEqual((done.returncode, sensor["first_difference"]), (0, ""), done.stdout + done.stderr)
            self.assertGreater(sensor["compared"], RATE_Hz // 2)
        cut = self.daemon.folder / "short.mcap"
        cut.write_bytes(self.file.read_bytes()[:len(self.file.read_bytes()) // 2])
        self.assertEqual(tactilectl("replay", cut, cwd="/").returncode, 0)

    def test_replay_of_a_file_without_a_configuration_says_what_to_do(self):
        """The configuration is removed from the file: --config is then required, and a file on the disk is not used."""
        bare = self.daemon.folder / "bare.mcap"
        bare.write_bytes(self.file.read_bytes().replace(b"tactiled.toml", b"tactiled.tomm"))
        done = tactilectl("replay", bare)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--config", done.stderr)

    def test_compressed_recordings_are_smaller_and_replay_to_the_last_bit(self):
        plain = None
        for kind in ("none", "lz4", "zstd"):
            file = self.daemon.folder / f"{kind}.mcap"
            said = json.loads(tactilectl("record", file, "--seconds", 1, "--compression", kind, "--json", "--node", self.daemon.name).stdout)
            seen = read_mcap.read(file)
            self.assertEqual((seen["messages"], seen["compression"]), (said["messages"], ["" if kind == "none" else kind]))
            self.assertEqual(seen["topics"][f"/{self.daemon.name}/table/wrench"], seen["topics"][f"/{self.daemon.name}/table/sample"])
            self.assertEqual(len(seen["attachments"]), 3)
            done = tactilectl("replay", file, "--json")
            sensor = json.loads(done.stdout)["sensors"][0]
            self.assertEqual((done.returncode, sensor["first_difference"], json.loads(done.stdout)["why"]), (0, "", ""), kind + done.stdout + done.stderr)
            each = file.stat().st_size / sensor["frames"]
            plain = plain or each
            if kind != "none":
                self.assertLess(each, 0.8 * plain)
            damaged = bytearray(file.read_bytes())
            for at in range(len(damaged) // 3, 2 * len(damaged) // 3, 997):
                damaged[at] ^= 1
            file.write_bytes(damaged)
            self.assertRegex(tactilectl("replay", file).stderr, "wrong CRC|do not fit|end is missing")

    def test_csv_has_every_sample_of_the_recording(self):
        file = self.daemon.folder / "with.mcap"
        said = json.loads(tactilectl("record", file, "--seconds", 1, "--csv", "--json", "--node", self.daemon.name).stdout)
        rows = (self.daemon.folder / "with.table.csv").read_text().splitlines()
        self.assertTrue(rows[0].startswith("t_s,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm,sd_fx_N,sd_fy_N,sd_fz_N,quality"), rows[0])
        # A frame, and for its sample the complete sample, the wrench and the quality.
        self.assertAlmostEqual(len(rows) - 1, said["messages"] / 4, delta=3)
        self.assertGreater(len(rows), RATE_Hz // 2)

    def test_a_full_disk_ends_the_recording_and_nothing_else(self):
        small = self.daemon.folder / "small.mcap"
        limited = subprocess.run(["prlimit", "--fsize=1000000", BIN / "tactilectl", "record", small, "--seconds", "20", "--node", self.daemon.name],
                                 capture_output=True, text=True, timeout=60, preexec_fn=lambda: signal.signal(signal.SIGXFSZ, signal.SIG_IGN))
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
            wait_for(lambda: sensor()["sensors"][0]["quality"].startswith(("good", "uncertain")), "a value")
            wait_for(lambda: abs((sensor()["sensors"][0]["rate_Hz"] or 0) - RATE_Hz) < 0.1 * RATE_Hz, "the rate of the recording")
            status = sensor()
            self.assertIs(status["simulated"], True)
            self.assertEqual(status["links"][0]["lost"], 0)


if __name__ == "__main__":
    unittest.main()
