#!/usr/bin/env python3
"""tactilectl decouple and the daemon judge alike: each scene of hairs is recorded, replayed by a daemon and decoupled from the
recorded channels. Row by row, quality, reasons and standard deviation are equal."""
import csv
import math
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import tomllib
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "scenes"))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402
from modbus_interop_test import INTEROP  # noqa: E402
from run import LATE_MS, QUALITY, calibrate, constant_temperature, constant_temperature_words  # noqa: E402

sys.dont_write_bytecode = True
sys.path[:0] = [str(INTEROP), str(ROOT / "node/python")]
import read_mcap  # noqa: E402
import tactiled  # noqa: E402

SPEED = 4
# The path of a replayed frame, and the age of its zero on another machine's clock, are not in the rows.
NOT_IN_ROWS = tactiled.UNPROVED_AGE | tactiled.ARRIVAL_ONLY


def frames_of(path):
    """(t_ns, device, channels with NaN where missing) of each recorded frame: drivers/mcap/frame_message.cpp."""
    for topic, _, data in read_mcap.messages(path):
        if not topic.endswith("/frames"):
            continue
        t_ns, = struct.unpack_from("<Q", data, 12)
        _, missing, _, _, device, _ = struct.unpack_from("<IIIIHB", data, 28)
        count, = struct.unpack_from("<I", data, 48)
        values = struct.unpack_from(f"<{count}d", data, 52)
        yield t_ns, device, [math.nan if missing >> k & 1 else value for k, value in enumerate(values)]


class AsTheDaemon(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-quality-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)

    def calibration(self, expect):
        of, method = expect["calibration"], expect.get("method", "")
        if not of.startswith("scene:"):
            return ROOT / "config/scenes" / of
        path = self.folder / f"{pathlib.Path(of[6:]).stem}-{method}.toml"
        if not path.exists():
            calibrate(ROOT / "config/scenes" / of[6:], method, path)
        return path

    def record(self, scene, sensors, end_s):
        """Records the frames of a scene up to this time; returns the file."""
        text = f'[[link]]\nname = "scene"\ndriver = "sim"\nscene = "{scene}"\neffects = "all"\nspeed = {SPEED}\n\n{sensors}'
        file = self.folder / f"{scene.stem}.mcap"
        with Daemon(text) as daemon:
            daemon.start()
            recorder = subprocess.Popen([BIN / "tactilectl", "record", file, "--config", daemon.config, "--node", daemon.name],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            with tactiled.open(daemon.name) as node:
                until = time.monotonic() + end_s / SPEED
                wait_for(lambda: time.monotonic() > until
                         or all(node.latest(name).reasons & (tactiled.STALE | tactiled.DISCONNECTED) for name in node.sensors), "the end")
            recorder.send_signal(signal.SIGINT)
            self.assertEqual(recorder.wait(30), 0, recorder.stderr.read())
        shutil.rmtree(daemon.folder)
        return file

    def replay(self, file, sensors, name, count):
        """The samples of a daemon that replays the file."""
        text = f'[[link]]\nname = "scene"\ndriver = "replay"\nfile = "{file}"\n\n{sensors}\n[shm]\nhistory = 16384\n'
        samples = []
        with Daemon(text, node=f"watchdog_ms = {LATE_MS}") as daemon:
            daemon.start()
            with tactiled.open(daemon.name) as node:
                follower = node.follow(name, timeout=LATE_MS / 1e3, wait="sleep", from_oldest=True)
                for sample in follower:
                    if sample.reasons & (tactiled.NO_DATA_YET | tactiled.DISCONNECTED | tactiled.DAEMON_STOPPED | tactiled.STALE):
                        if samples:
                            break
                        continue
                    samples.append(sample)
                    if len(samples) == count:
                        break
                follower.close()
        shutil.rmtree(daemon.folder)
        return samples

    def test_each_scene_of_hairs_row_by_row(self):
        good = {}
        for path in sorted((ROOT / "config/scenes").glob("*.toml")):
            scene = tomllib.loads(path.read_text())
            tables = {s["name"]: (i, s) for i, s in enumerate(scene["sensor"]) if s["model"] == "hair" and "array" not in s}
            expects = [e for e in scene.get("expect", []) if any(name.startswith(e["sensor"].rstrip("*")) for name in tables)]
            if not expects or len(tables) != len(scene["sensor"]):
                continue
            with self.subTest(path.stem):
                name, (device, table) = next(iter(tables.items()))
                good[path.stem] = self.same(path, name, device, table, expects[0])
        print({name: f"{share:.3f}" for name, share in good.items()}, file=sys.stderr)
        self.assertGreater(len(good), 8)
        self.assertGreater(sum(share > 0.5 for share in good.values()), 5, "scenes in which nothing is GOOD prove little")

    def same(self, path, name, device, table, expect):
        calibration = self.calibration(expect)
        held = constant_temperature(calibration)
        channels = ["H1", "H2", "H3", "H4"] + (["H0"] if table.get("dummy") else [])
        sensors = (f'[[sensor]]\nname = "{name}"\nlink = "scene"\ndevice = {device}\nmodel = "hair"\ncalibration = "{calibration}"\n'
                   f'method = "{expect.get("method", "")}"\nchannels = {channels}\nstale_ms = {LATE_MS}\n{held}\n')
        file = self.record(path, sensors.replace(f"stale_ms = {LATE_MS}", "stale_ms = 500"), expect.get("to_s", 1e3))
        frames = [(t_ns, values) for t_ns, of, values in frames_of(file) if of == device]
        self.assertGreater(len(frames), 200)
        rows, forces = self.folder / "rows.csv", self.folder / "forces.csv"
        with open(rows, "w") as out:
            writer = csv.writer(out)
            writer.writerow(["t_s", *channels])
            for t_ns, values in frames:
                writer.writerow([f"{(t_ns - frames[0][0]) / 1e9:.9f}", *("" if math.isnan(v) else repr(v) for v in values)])
        words = constant_temperature_words(calibration)
        done = subprocess.run([BIN / "tactilectl", "decouple", "--calibration", calibration, "--method", expect.get("method", ""), *words,
                               "--in", rows, "--out", forces], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        samples = self.replay(file, sensors, name, len(frames))
        with open(forces) as of_rows:
            judged = list(csv.DictReader(of_rows))
        self.assertEqual(len(samples), len(judged))
        for i, (sample, row) in enumerate(zip(samples, judged)):
            words = [w for bit, w in enumerate(tactiled.REASON_WORDS) if (sample.reasons & ~NOT_IN_ROWS) >> bit & 1]
            quality, _, reasons = row["quality"].partition(":")
            self.assertEqual((quality.lower(), sorted(reasons.split(",")) if reasons else []),
                             (QUALITY[sample.quality], sorted(words)), f"{path.stem} row {i}")
            if sample.quality == tactiled.BAD:
                continue
            for column, values in (("f{}_N", sample.raw_force_S_N), ("sd_f{}_N", sample.sd_force_N)):
                for axis, value in zip("xyz", values):
                    text = row[column.format(axis)]
                    told = float(text) if text else math.nan
                    self.assertTrue(math.isnan(told) and math.isnan(value) or math.isclose(told, value, rel_tol=1e-6, abs_tol=1e-9),
                                    f"{path.stem} row {i} {column}: {told} {value}")
        return sum(s.quality == tactiled.GOOD for s in samples) / len(samples)


if __name__ == "__main__":
    unittest.main(verbosity=2)
