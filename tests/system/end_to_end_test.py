#!/usr/bin/env python3
"""A real magnetic skin, recorded while it was pressed to 34 N, from a serial port to a PLC.

Calibrated on session 1; another process writes session 2 into a pty; a C program that knows layout.h alone, pymodbus
and mbpoll read the forces. Each value is compared with one that is computed here from the file, without code of the
project.

    end_to_end_test.py [unittest options]
    PACE=1 end_to_end_test.py      the whole session at its true pace (6.5 minutes a format) instead of 36 times faster
"""
import csv
import math
import os
import struct
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
import unittest
import pathlib

from pymodbus.client import ModbusTcpClient

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402

LABELLED = ROOT / "tests/data/eflesh/normal_labelled.csv"
CHANNELS = [f"B{i}" for i in range(1, 16)]
PACE = float(os.environ.get("PACE", "36"))
SEGMENT_FZ_REGISTER = 100 + 6

CONFIG = """
[[link]]
name = "usb0"
driver = "uart"
device = "{folder}/skin"
path = "direct"
baud = 921600
%s

[[sensor]]
name = "skin"
link = "usb0"
model = "generic"
calibration = "{folder}/skin.toml"
stale_ms = 2000
%s
"""
LINES = ('format = "lines"\nchannels = 15\nsequence = true\nchecksum = true\n', "")
COBS = ('format = "cobs"\n', "counts_per_unit = 1e5\n")


def register_of(force_N):
    """Returns the i16 register, 0.01 N, of a force: nearest, halves to even, saturated; 0x8000 for no value."""
    if math.isnan(force_N):
        return 0x8000
    return max(-32767, min(32767, round(force_N * 100))) & 0xFFFF


def double_of(word):
    return struct.unpack("<d", int(word, 16).to_bytes(8, "little"))[0]


class Session2:
    """The content of the file, row by row: label, and force by the calibration's own numbers, summed from left to
    right."""

    def __init__(self, calibration_path):
        with open(calibration_path, "rb") as file:
            calibration = tomllib.load(file)
        assert calibration["channels"] == CHANNELS
        row = calibration["matrix"][calibration["components"].index("fz")]
        self.fz, self.label = [], []
        with open(LABELLED) as file:
            for line in csv.DictReader(file):
                if line["session"] != "2":
                    continue
                total = 0.0
                for gain, zero, name in zip(row, calibration["zero"], CHANNELS):
                    total += gain * (float(line[name]) - zero)
                self.fz.append(total)
                self.label.append(float(line["fz_N"]) if line["fz_N"] else None)
        with open(LABELLED) as file:
            self.full_scale = max(abs(float(r["fz_N"])) for r in csv.DictReader(file) if r["fz_N"])


class EndToEnd(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        folder = pathlib.Path(cls.temporary.name)
        cls.follow = BIN / "follow"
        cls.calibration = folder / "skin.toml"
        done = subprocess.run([BIN / "tactilectl", "calibrate", "--model", "generic", "--session", "1", "--in", LABELLED, "--out",
                               cls.calibration], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        with open(LABELLED) as source, open(folder / "session2.csv", "w") as cut:  # the device's data: no labels
            rows = csv.DictReader(source)
            writer = csv.DictWriter(cut, ["t_s", *CHANNELS], extrasaction="ignore")
            writer.writeheader()
            writer.writerows(r for r in rows if r["session"] == "2")
        cls.session2 = folder / "session2.csv"
        cls.expected = Session2(cls.calibration)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def run_format(self, config, play_words):
        with Daemon(CONFIG % config) as daemon:
            (daemon.folder / "skin.toml").write_bytes(self.calibration.read_bytes())
            player = daemon.play("--in", self.session2, "--pty", daemon.folder / "skin", "--speed", PACE, *play_words)
            daemon.start()
            seconds = 380 / PACE + 30
            follower = subprocess.Popen([self.follow, daemon.name, "skin", str(seconds)], stdout=subprocess.PIPE, text=True)
            samples, polls = [], []
            reading = threading.Thread(target=lambda: samples.extend(follower.stdout))
            reading.start()
            client = ModbusTcpClient("127.0.0.1", port=daemon.port)
            self.assertTrue(client.connect())
            mbpoll_runs, next_mbpoll = [], time.monotonic() + 1
            while player.poll() is None:
                before = time.monotonic_ns()
                answer = client.read_input_registers(100, count=25, slave=1)
                after = time.monotonic_ns()
                self.assertFalse(answer.isError(), answer)
                polls.append((before, after, answer.registers))
                if time.monotonic() > next_mbpoll and len(mbpoll_runs) < 20:
                    next_mbpoll += 0.4
                    mbpoll_runs.append(self.mbpoll(daemon.port))
                time.sleep(0.002)
            time.sleep(0.2)
            follower.terminate()
            follower.wait()
            reading.join()
            follower.stdout.close()
            client.close()
            status = daemon.ctl("status").stdout
            self.check(samples, polls, mbpoll_runs, status)
            self.assertEqual(daemon.stop()[0], 0)

    @staticmethod
    def mbpoll(port):
        before = time.monotonic_ns()
        done = subprocess.run(["mbpoll", "-m", "tcp", "-p", str(port), "-t", "3:hex", "-0", "-r", str(SEGMENT_FZ_REGISTER), "-c", "1", "-1",
                               "127.0.0.1"], capture_output=True, text=True, timeout=60)
        value = [line.split()[1] for line in done.stdout.splitlines() if line.startswith(f"[{SEGMENT_FZ_REGISTER}]")]
        assert done.returncode == 0 and len(value) == 1, done.stdout + done.stderr
        return before, time.monotonic_ns(), int(value[0], 16)

    def check(self, lines, polls, mbpoll_runs, status):
        # The C program gives every row of the file, once, in order, to the last bit.
        visible = []  # (published, register) in the order of publishing
        errors, rows = [], []
        for line in lines:
            words = line.split()
            if words[0] == "end" or len(words) < 10:
                continue
            row, published, quality = int(words[1]), int(words[3]), int(words[5])
            if quality == 3:
                self.assertTrue(math.isnan(double_of(words[9])))
                visible.append((published, 0x8000))
                continue
            fz = double_of(words[9])
            self.assertEqual(fz, self.expected.fz[row], f"row {row}")
            visible.append((published, register_of(fz)))
            rows.append(row)
            if self.expected.label[row] is not None:
                errors.append(fz - self.expected.label[row])
        self.assertEqual(rows, list(range(len(self.expected.fz))), f"frames lost or repeated\n{status}")
        rms = math.sqrt(sum(e * e for e in errors) / len(errors))
        percent = 100 * rms / self.expected.full_scale
        print(f"\n  {len(rows)} frames, {len(polls)} Modbus reads, rms error {rms:.3f} N = {percent:.2f} % of {self.expected.full_scale:.1f} N")
        self.assertLessEqual(percent, 2.3)

        # Modbus: a value that was read is one that shared memory had at some moment of the request.
        def allowed(before, after):
            # A request takes its snapshot between `before` and `after`; publishing takes well under 1 ms more.
            last = max((i for i, (t, _) in enumerate(visible) if t <= before), default=0)
            return {register for t, register in visible[max(0, last - 1):] if t <= after}

        matched = 0
        for before, after, registers in polls:
            self.assertEqual(registers[0], registers[24], "SEQ and SEQ_END differ: two frames in one answer")
            if before < visible[0][0]:
                continue
            self.assertIn(registers[6], allowed(before, after))
            matched += registers[6] != 0x8000
        self.assertGreater(matched, 100)
        for before, after, register in mbpoll_runs:
            if before > visible[0][0]:
                self.assertIn(register, allowed(before, after))
        self.assertGreaterEqual(len(mbpoll_runs), 5)

    def test_text_lines(self):
        self.run_format(LINES, ["--format", "lines", "--sequence", "--checksum"])

    def test_binary_frames(self):
        self.run_format(COBS, ["--format", "cobs", "--bits", "32", "--counts-per-unit", "1e5"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
