#!/usr/bin/env python3
"""tactilectl record and replay with arrays of taxels: the raw numbers, the results and the maps of taxels are in the file, and
replay restores them bit for bit."""
import csv
import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from array_device import ArrayDevice  # noqa: E402
from array_test import CURVED_M  # noqa: E402
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402
from mcap_bytes import with_checksums  # noqa: E402
from modbus_interop_test import INTEROP, fetch_javascript  # noqa: E402

sys.dont_write_bytecode = True
sys.path[:0] = [str(INTEROP), str(ROOT / "node/python")]
import read_mcap  # noqa: E402
import tactiled  # noqa: E402

DEAD, MISSING = 5, 17
FLOAT32 = 7


def tactilectl(*words, **kinds):
    return subprocess.run([BIN / "tactilectl", *map(str, words)], capture_output=True, text=True, timeout=60, **kinds)


class Cdr:
    """The numbers of a message, by the rules of CDR."""

    def __init__(self, data):
        self.data, self.at = data, 4

    def get(self, kind, count=1):
        size = struct.calcsize(kind)
        self.at += -(self.at - 4) % size
        values = struct.unpack_from(f"<{count}{kind}", self.data, self.at)
        self.at += size * count
        return values[0] if count == 1 else values

    def text(self):
        size = self.get("I")
        self.at += size
        return self.data[self.at - size:self.at - 1].decode()


def cloud_of(data):
    """Frame, height, width, and the values of each field of a PointCloud2."""
    cdr = Cdr(data)
    cdr.get("i"), cdr.get("I")
    frame, height, width = cdr.text(), cdr.get("I"), cdr.get("I")
    fields = [(cdr.text(), cdr.get("I"), cdr.get("B"), cdr.get("I")) for _ in range(cdr.get("I"))]
    cdr.get("B")
    step, row_step, size = cdr.get("I"), cdr.get("I"), cdr.get("I")
    assert (row_step, size) == (step * width, step * width * height)
    points = data[cdr.at:cdr.at + size]
    return frame, height, width, {name: [struct.unpack_from("<f" if kind == FLOAT32 else "<I", points, at + offset)[0] for at in range(0, size, step)]
                                  for name, offset, kind, _ in fields}


def bits(values):
    return struct.pack(f"<{len(values)}f", *values)


class ArrayRecord(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """One recording from the daemon's start, while a live reader looks."""
        cls.devices = [ArrayDevice("skin"), ArrayDevice("tip", values=3, places_m=CURVED_M)]
        cls.devices[0].missing.add(MISSING)
        for device in cls.devices:
            device.is_paused = True
            cls.enterClassContext(device)
        cls.daemon = daemon = Daemon("".join(device.config(2000) for device in cls.devices))
        cls.addClassCleanup(shutil.rmtree, daemon.folder)
        cls.addClassCleanup(daemon.__exit__)
        for device in cls.devices:
            (daemon.folder / f"{device.name}.toml").write_text(device.calibration([DEAD]))
        daemon.start()
        cls.file = daemon.folder / "press.mcap"
        recorder = subprocess.Popen([BIN / "tactilectl", "record", cls.file, "--array-rate", "1000", "--csv", "--json", "--node", daemon.name],
                                    stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        wait_for(lambda: cls.file.exists() and cls.file.stat().st_size > 0, "the file")
        time.sleep(0.2)
        for device in cls.devices:
            device.is_paused = False
        cls.seen = {}
        with tactiled.open(daemon.name) as node:
            cls.places = {device.name: node.places(device.name) for device in cls.devices}

            def look():
                for device in cls.devices:
                    array = node.array(device.name)
                    cls.seen[device.name, array.sample.sequence] = array
                return all(node.latest(device.name).sequence > 200 for device in cls.devices)
            wait_for(look, "200 arrays")
        recorder.send_signal(signal.SIGINT)
        out, cls.errors = recorder.communicate(timeout=60)
        cls.status, cls.said = recorder.returncode, json.loads(out)
        cls.messages = {}
        for topic, sequence, data in read_mcap.messages(cls.file):
            cls.messages.setdefault(topic.removeprefix(f"/{daemon.name}/"), []).append((sequence, data))

    def record(self, name, *words):
        file = self.daemon.folder / name
        done = tactilectl("record", file, "--seconds", 1, "--json", "--node", self.daemon.name, *words)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return file

    def topics(self, file):
        return {topic.removeprefix(f"/{self.daemon.name}/"): count for topic, count in read_mcap.read(file)["topics"].items()}

    def replay(self, file, *words):
        done = tactilectl("replay", file, "--json", *words)
        return done.returncode, json.loads(done.stdout)["sensors"], done.stderr

    def test_nothing_is_lost_and_each_frame_has_its_raw_numbers(self):
        self.assertEqual((self.status, self.errors, self.said["lost"]), (0, "", 0))
        for device in self.devices:
            name, n = device.name, len(device.places_m)
            raw, frames = self.messages[f"link/{name}/taxels"], self.messages[f"link/{name}/frames"]
            self.assertGreater(len(raw), 190)
            self.assertEqual([sequence for sequence, _ in raw], [sequence for sequence, _ in frames])
            cdr = Cdr(raw[100][1])
            cdr.get("i"), cdr.get("I")
            t_ns = cdr.get("Q")
            self.assertEqual(t_ns, struct.unpack_from("<Q", frames[100][1], 12)[0])
            self.assertEqual((cdr.get("H"), cdr.get("H"), cdr.get("I")), (n, device.values, n * device.values))
            values = cdr.get("f", n * device.values)
            self.assertEqual([i for i, value in enumerate(values) if value != value], [MISSING] if name == "skin" else [])
            self.assertTrue(all(value == round(value) for value in values if value == value))  # the numbers of the device
            self.assertEqual(len(self.messages[f"{name}/array"]), len(self.messages[f"{name}/sample"]))

    def test_the_maps_of_taxels_are_those_that_a_live_reader_saw(self):
        for device in self.devices:
            clouds, compared = dict(self.messages[f"{device.name}/taxels"]), 0
            for (name, sequence), array in self.seen.items():
                if name != device.name or sequence not in clouds or array.sample.quality == tactiled.BAD:
                    continue
                frame, height, width, field = cloud_of(clouds[sequence])
                self.assertEqual((frame, height, width), (name, *((8, 12) if name == "skin" else (1, 45))))
                forces = array.force_S_N.tolist()
                axes = ["fz_N"] if device.values == 1 else ["fx_N", "fy_N", "fz_N"]
                for c, axis in enumerate(axes):
                    self.assertEqual(bits(field[axis]), bits([taxel[c] for taxel in forces]))
                self.assertEqual(field["state"], [int(state) for state in array.state])
                for c, axis in enumerate("xyz"):
                    self.assertEqual(bits(field[axis]), bits([place[c] for place in self.places[name]]))
                normals = [place[3:] for place in self.places[name]]
                for press, force, normal in zip(field["press_N"], forces, normals):
                    along = -force[0] * normal[2] if device.values == 1 else -sum(f * n for f, n in zip(force, normal))
                    self.assertTrue(abs(press - along) < 1e-5 or press != press and along != along)
                results = Cdr(dict(self.messages[f"{name}/array"])[sequence])
                results.get("i"), results.get("I")
                self.assertEqual((results.get("Q"), results.get("I"), results.get("I")), (array.sample.t_ns, array.n_out, array.n_contact))
                compared += 1
            self.assertGreater(compared, 100)

    def test_replay_gives_the_same_samples_and_arrays_to_the_last_bit(self):
        status, sensors, errors = self.replay(self.file)
        self.assertEqual((status, errors, [sensor["first_difference"] for sensor in sensors]), (0, "", ["", ""]))
        for sensor in sensors:
            self.assertGreater(sensor["frames"], 190)
            self.assertEqual({sensor[key] for key in ("compared", "equal", "arrays")}, {sensor["compared"]})
            self.assertGreater(sensor["taxels"], 100)  # one a millisecond at most: late frames may come together
            self.assertIn(sensor["frames"] - sensor["compared"], (0, 1))  # the last sample may be later than the recorder's end
            self.assertEqual(sensor["without_sd"], 0)

    def test_a_recording_of_a_running_daemon_has_maps_at_the_rate_of_the_option(self):
        file = self.record("rate.mcap", "--array-rate", 20)
        topics = self.topics(file)
        for device in self.devices:
            self.assertGreater(topics[f"{device.name}/array"], 60)
            self.assertTrue(14 <= topics[f"{device.name}/taxels"] <= 22, topics)
        status, sensors, _ = self.replay(file)
        self.assertEqual((status, [sensor["first_difference"] for sensor in sensors]), (0, ["", ""]))
        self.assertTrue(all(sensor["arrays"] == sensor["compared"] > 60 and 14 <= sensor["taxels"] <= 22 for sensor in sensors), sensors)

    def test_a_rate_of_0_leaves_the_maps_out(self):
        topics = self.topics(self.record("none.mcap", "--array-rate", 0, "--csv"))
        self.assertNotIn("skin/taxels", topics)
        self.assertIn("skin/array", topics)
        self.assertFalse((self.daemon.folder / "none.skin.taxels.csv").exists())

    def test_another_calibration_gives_its_own_forces(self):
        other = self.daemon.folder / "other"
        other.mkdir()
        for file in self.daemon.folder.glob("*.toml"):
            text = file.read_text().replace(str(self.daemon.folder), str(other))
            (other / file.name).write_text(text.replace("taxel = [[-0.001]]", "taxel = [[-0.002]]"))
        status, sensors, _ = self.replay(self.file, "--config", other / "tactiled.toml")
        self.assertEqual(status, 1)
        self.assertRegex(sensors[0]["first_difference"], r"sample \d+: raw_force_S_N")
        self.assertEqual(sensors[1]["first_difference"], "")
        rows = {}
        for folder in (self.daemon.folder, other):
            tactilectl("replay", self.file, "--config", folder / "tactiled.toml", "--sensor", "skin", "--out", folder / "forces.csv")
            with (folder / "forces.csv").open() as forces:
                rows[folder] = [float(row["fz_N"] or 0) for row in csv.DictReader(forces)]
        self.assertAlmostEqual(rows[other][100] / rows[self.daemon.folder][100], 2, 5)

    def test_a_difference_of_the_results_alone_is_found(self):
        """The wrench is the same, and its sd is not compared, because the recording lacks the daemon's first frames."""
        file, other = self.record("late.mcap"), self.daemon.folder / "gains"
        other.mkdir()
        for each in self.daemon.folder.glob("*.toml"):
            text = each.read_text().replace(str(self.daemon.folder), str(other))
            (other / each.name).write_text(text.replace("gain_sd = 0.02", "gain_sd = 0.03"))
        status, sensors, _ = self.replay(file, "--config", other / "tactiled.toml")
        self.assertEqual(status, 1)
        self.assertRegex(sensors[0]["first_difference"], r"sample \d+: array$")

    def test_a_wrong_bit_of_a_map_is_found(self):
        data = bytearray(self.file.read_bytes())
        data[data.index(b"press_N", len(data) // 2) + 1000] ^= 1
        wrong = self.daemon.folder / "wrong.mcap"
        wrong.write_bytes(with_checksums(data))
        status, sensors, _ = self.replay(wrong)
        self.assertEqual((status, sum(sensor["equal"] for sensor in sensors)), (1, sum(sensor["compared"] for sensor in sensors) - 1))
        self.assertRegex("".join(sensor["first_difference"] for sensor in sensors), r"^sample \d+: taxels$")

    def test_without_the_raw_numbers_replay_says_what_is_missing(self):
        file = self.record("small.mcap", "--without-raw-taxels")
        self.assertNotIn("link/skin/taxels", self.topics(file))
        status, sensors, errors = self.replay(file)
        self.assertEqual((status, sensors[0]["compared"]), (1, 0))
        self.assertRegex(errors, r"skin: \d+ frames were left out, because the recording lacks their raw taxels")

    def test_a_killed_recorder_leaves_what_it_has_written(self):
        file = self.daemon.folder / "killed.mcap"
        recorder = subprocess.Popen([BIN / "tactilectl", "record", file, "--node", self.daemon.name])
        def written(sensor):
            return sum(1 for topic, _, _ in (read_mcap.messages(file) if file.exists() else ()) if topic.endswith(f"{sensor}/array"))

        wait_for(lambda: min(written("skin"), written("tip")) > 60, "60 arrays of each")
        recorder.kill()
        recorder.wait()
        status, sensors, errors = self.replay(file)
        self.assertEqual((status, [sensor["first_difference"] for sensor in sensors]), (0, ["", ""]))
        self.assertIn("its end is missing", errors)
        self.assertTrue(all(sensor["arrays"] == sensor["compared"] > 60 for sensor in sensors), sensors)

    def test_a_recorder_that_is_too_slow_says_how_much_it_missed(self):
        file = self.daemon.folder / "slow.mcap"
        recorder = subprocess.Popen([BIN / "tactilectl", "record", file, "--seconds", "3", "--json", "--node", self.daemon.name],
                                    stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        wait_for(lambda: file.exists() and file.stat().st_size > 10_000, "the file")
        recorder.send_signal(signal.SIGSTOP)
        with tactiled.open(self.daemon.name) as node:  # the rings keep 128 arrays and more frames
            until = node.latest("skin").sequence + 160
            wait_for(lambda: node.latest("skin").sequence > until, "160 samples")
        recorder.send_signal(signal.SIGCONT)
        out, errors = recorder.communicate(timeout=60)
        lost = json.loads(out)["lost"]
        self.assertEqual(recorder.returncode, 1)
        self.assertGreater(lost, 2 * 20)
        self.assertIn(f"{lost} records were missed", errors)
        sensors = self.replay(file)[1]
        self.assertGreater(sensors[0]["without_taxels"], 20)
        self.assertGreater(sensors[0]["compared"], 60)

    def test_a_full_disk_and_a_path_that_cannot_be_written_give_an_error(self):
        small = self.daemon.folder / "full.mcap"
        limited = subprocess.run(["prlimit", "--fsize=300000", BIN / "tactilectl", "record", small, "--seconds", "20", "--node", self.daemon.name],
                                 capture_output=True, text=True, timeout=60, preexec_fn=lambda: signal.signal(signal.SIGXFSZ, signal.SIG_IGN))
        self.assertEqual(limited.returncode, 1)
        self.assertIn("recorded so far", limited.stderr)
        self.assertGreater(self.replay(small)[1][0]["arrays"], 10)
        (self.daemon.folder / "there.skin.taxels.csv").mkdir()
        done = tactilectl("record", self.daemon.folder / "there.mcap", "--csv", "--seconds", "1", "--node", self.daemon.name)
        self.assertEqual(done.returncode, 2)
        self.assertIn("there.skin.taxels.csv: Is a directory", done.stderr)

    def test_the_csv_has_a_row_for_each_taxel_of_each_map(self):
        with (self.daemon.folder / "press.skin.taxels.csv").open() as table:
            rows = list(csv.DictReader(table))
        clouds = self.messages["skin/taxels"]
        self.assertEqual(len(rows), 96 * len(clouds))
        _, _, _, field = cloud_of(clouds[100][1])
        part = rows[96 * 100:96 * 101]
        self.assertEqual(bits([float(row["fz_N"] or "nan") for row in part]), bits(field["fz_N"]))
        self.assertEqual([(row["taxel"], row["state"]) for row in part if row["state"]], [(str(DEAD), "dead"), (str(MISSING), "missing")])
        self.assertEqual({row["fx_N"] for row in rows}, {""})
        self.assertTrue((self.daemon.folder / "press.skin.csv").exists())

    def test_the_readers_of_foxglove_decode_it(self):
        fetch_javascript()
        env = {**os.environ, "NODE_PATH": str(ROOT / "build/npm/node_modules")}
        read = subprocess.run(["node", INTEROP / "read_mcap.js", self.file], capture_output=True, text=True, timeout=60, env=env)
        self.assertEqual(read.returncode, 0, read.stderr)
        first = json.loads(read.stdout)["first"]
        for name, data in ((device.name, self.messages[f"{device.name}/taxels"][100][1]) for device in self.devices):
            cloud = first[f"/{self.daemon.name}/{name}/taxels"][100]
            frame, height, width, field = cloud_of(data)
            self.assertEqual((cloud["header"]["frame_id"], cloud["height"], cloud["width"]), (frame, height, width))
            self.assertEqual([each["name"] for each in cloud["fields"]], list(field))
            self.assertEqual(cloud["point_step"], 4 * len(field))
            points = bytes(cloud["data"])
            self.assertEqual(points[:12], bits([field[axis][0] for axis in "xyz"]))
            array = first[f"/{self.daemon.name}/{name}/array"][100]
            self.assertEqual(array["n_out"], 2 if name == "skin" else 1)
            self.assertEqual(len(array["cop_s_m"]), 3)


if __name__ == "__main__":
    unittest.main()
