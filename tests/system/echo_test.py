"""Links with echo = true, with the release daemon: devices that answer, that do not, and that answer something else. The
simulated devices answer."""
import binascii
import contextlib
import json
import os
import pathlib
import select
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import tty
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/system"), str(ROOT / "node/python")]
import tactiled  # noqa: E402
from daemon import BIN, PATIENCE_S, Daemon, Stopwatch, wait_for  # noqa: E402
from freshness_test import CALIBRATION  # noqa: E402

PERIOD_S = 0.01
# Without another proof the bound of the age grows by 20 ms/s: it exceeds stale_ms after five seconds.
LINK = """
[[link]]
name = "{name}"
{driver}
format = "lines"
channels = 1
sequence = true
time_us = true
checksum = "crc16"
clock_ppm = 20000
echo = true

[[sensor]]
name = "{name}"
link = "{name}"
model = "generic"
calibration = "{{folder}}/unit.toml"
stale_ms = 100
rate_Hz = 100
"""
UNPROVED_S = 8
ERRORS = ("skipped_bytes", "bad_checksum", "bad_length", "bad_value", "lost", "repeated", "gone", "restarted", "open_failed")


def line(text):
    return f"{text}*{binascii.crc_hqx(text.encode(), 0xFFFF):04X}\n".encode()


def time_us():
    return int(time.monotonic() * 1e6) & 0xFFFFFFFF


class Device(threading.Thread):
    """Measures 100 times a second. `answer(number, time)` returns the bytes for a request; None: it never reads."""

    def __init__(self, answer, tcp=False):
        super().__init__(daemon=True)
        self.answer, self.tcp, self.requests, self.ended = answer, tcp, [], threading.Event()
        if tcp:
            self.server = socket.create_server(("127.0.0.1", 0))
            self.keys = f'driver = "tcp"\naddress = "127.0.0.1:{self.server.getsockname()[1]}"'
        else:
            self.port, self.slave = os.openpty()
            tty.setraw(self.slave)
            os.set_blocking(self.port, False)
            self.keys = f'driver = "uart"\ndevice = "{os.ttyname(self.slave)}"'
        self.start()

    def run(self):
        if self.tcp:
            self.connection = self.server.accept()[0]
            self.port = self.connection.fileno()
        number, due, self.received = 0, time.monotonic(), b""
        while not self.ended.is_set():
            due += PERIOD_S
            while (left := due - time.monotonic()) > 0:
                if self.answer is None:
                    time.sleep(left)
                elif select.select([self.port], [], [], left)[0] and not self.answer_all():
                    return
            self.send(line(f"{number},{time_us()},{number % 7}"))
            number += 1

    def answer_all(self):
        """Returns False after the end of the connection."""
        data = os.read(self.port, 4096)
        *requests, self.received = (self.received + data).split(b"\n")
        for request in requests:
            self.requests.append(request.decode())
            self.send(self.answer(int(request[1:]), time_us()))
        return bool(data)

    def send(self, data):
        with contextlib.suppress(OSError):  # no program reads
            os.write(self.port, data)

    def finish(self):
        self.ended.set()
        self.join(2)


def answered(number, t_us):
    return line(f"!{number},{t_us}")


ANSWERS = {"pty": (answered, False), "tcp": (answered, True)}
OTHERS = {  # name: answer, and the counter of its lines
    "deaf": (None, ""),
    "mute": (lambda n, t: b"", ""),
    "next-number": (lambda n, t: line(f"!{n + 2},{t}"), ""),
    "zero": (lambda n, t: line(f"!0,{t}"), ""),
    "damaged": (lambda n, t: b"!%d,%d*0000\n" % (n, t), "bad_checksum"),
    "too-long": (lambda n, t: line(f"!{n + 2 ** 32},{t}"), "bad_value"),
    "no-time": (lambda n, t: line(f"!{n}"), "bad_value"),
}


class Echo(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """All devices run at once, for longer than the age is proved without an answer."""
        cls.devices = {name: Device(*of) for name, of in ANSWERS.items()}
        cls.devices.update((name, Device(answer)) for name, (answer, _) in OTHERS.items())
        config = "".join(LINK.format(name=name, driver=device.keys) for name, device in cls.devices.items())
        # A look counts if the newest frame is fresh: a busy machine delays devices.
        cls.fresh, cls.good = dict.fromkeys(cls.devices, 0), dict.fromkeys(cls.devices, 0)
        try:
            with Daemon(config) as daemon:
                (daemon.folder / "unit.toml").write_text(CALIBRATION)
                began_s = time.monotonic()
                daemon.start()
                with tactiled.open(daemon.name) as node:
                    wait_for(lambda: all(node.latest(name).quality == tactiled.GOOD for name in ANSWERS), "GOOD samples")
                    wait_for(lambda: all(node.latest(name).quality == tactiled.UNCERTAIN for name in OTHERS), "frames")
                    until = time.monotonic() + UNPROVED_S
                    while time.monotonic() < until:
                        for name in cls.devices:
                            sample = node.latest(name)
                            cls.fresh[name] += sample.age_ms < 50
                            cls.good[name] += sample.age_ms < 50 and sample.quality == tactiled.GOOD
                        time.sleep(0.01)
                    wait_for(lambda: all(node.latest(name).quality == tactiled.GOOD for name in ANSWERS), "GOOD samples")
                    cls.asked_s = time.monotonic() - began_s
                    cls.samples = {name: node.latest(name) for name in cls.devices}
                status = json.loads(daemon.ctl("status", "--json").stdout)
                cls.links = {link["name"]: link for link in status["links"]}
                cls.sensors = {sensor["name"]: sensor for sensor in status["sensors"]}
        finally:
            for device in cls.devices.values():
                device.finish()

    def errors(self, name):
        return {key: n for key, n in self.links[name].items() if key in ERRORS and n}

    def test_a_device_that_answers_stays_good_by_its_answers_alone(self):
        for name in ANSWERS:
            with self.subTest(name):
                self.assertGreater(self.good[name], 100)
                self.assertGreater(self.good[name], 0.9 * self.fresh[name])
                self.assertEqual(self.sensors[name]["freshness"], "clock")

    def test_it_is_asked_several_times_a_second_with_another_number_each_time(self):
        for name in ANSWERS:
            with self.subTest(name):
                requests = self.devices[name].requests
                for request in requests:
                    self.assertRegex(request, r"^\?[1-9]\d{0,9}$")
                self.assertEqual(len(set(requests)), len(requests))
                self.assertTrue(3 * UNPROVED_S <= len(requests) <= 40 * (self.asked_s + 1), len(requests))

    def test_answers_are_neither_frames_nor_errors(self):
        for name in (*ANSWERS, *(name for name, (_, counter) in OTHERS.items() if not counter)):
            with self.subTest(name):
                self.assertEqual(self.errors(name), {})
                self.assertEqual(self.links[name]["opened"], 1)

    def test_without_a_right_answer_frames_are_read_and_not_proved(self):
        for name, (_, counter) in OTHERS.items():
            with self.subTest(name):
                self.assertNotEqual(self.samples[name].quality, tactiled.GOOD)
                self.assertIn(self.samples[name].reasons, (tactiled.UNPROVED_AGE, tactiled.STALE))
                self.assertEqual(self.good[name], 0, "no answer has proved the age")
                self.assertEqual((self.links[name]["opened"], self.links[name]["gone"], self.links[name]["lost"]), (1, 0, 0))
                if counter:
                    self.assertGreaterEqual(self.links[name][counter], 2)  # a request without an answer is repeated after 2 s
                    self.assertEqual(set(self.errors(name)), {counter, "skipped_bytes"})


class SimulatedDevices(unittest.TestCase):
    """Each device sends a frame each 0.2 s; it answers in between, and in the order of the device's times."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.path = self.folder / "port"

    def run_device(self, *words):
        device = subprocess.Popen(words, stderr=subprocess.DEVNULL, env={**os.environ, "ARDUINO": str(self.path)})
        self.addCleanup(device.wait, 10)
        self.addCleanup(device.terminate)
        wait_for(self.path.is_symlink, "the port")
        self.port = os.open(self.path, os.O_RDWR | os.O_NOCTTY)
        self.addCleanup(os.close, self.port)
        tty.setraw(self.port)
        self.received = b""
        self.lines_for(0.5)

    def lines_for(self, seconds):
        """Returns the whole lines that come within this time."""
        lines, until = [], time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            if select.select([self.port], [], [], left)[0]:
                *whole, self.received = (self.received + os.read(self.port, 4096)).split(b"\n")
                lines += [text.decode(errors="replace").rstrip("\r") for text in whole]
        return lines

    def check_answers(self, period_s):
        for number in (1, 4294967295):
            request = f"?{number}\n".encode()
            os.write(self.port, request[:2])
            time.sleep(0.05)  # a request may come in pieces
            with Stopwatch() as watch:
                os.write(self.port, request[2:] + b"?x\n#\n")
                lines = []
                while not any(text.startswith("!") for text in lines) and watch.seconds() < PATIENCE_S:
                    lines += self.lines_for(0.01)
                self.assertLess(watch.seconds(), 0.11)
            lines += self.lines_for(1)
            answers = [text for text in lines if text.startswith("!")]
            self.assertEqual(len(answers), 1, lines)
            body, crc = answers[0].split("*")
            self.assertEqual(int(crc, 16), binascii.crc_hqx(body.encode(), 0xFFFF))
            self.assertRegex(body, rf"^!{number},\d+$")
            times = [int(text.split("*")[0].split(",")[1]) for text in lines]
            self.assertEqual(times, sorted(times), "the answer has the time of the same clock")
            measured = [us for us, text in zip(times, lines) if not text.startswith("!")]
            half = len(measured) // 2  # over many frames, because a device that a busy machine delayed makes up for it
            periods_s = [(b - a) / 1e6 / half for a, b in zip(measured, measured[half:])]
            self.assertAlmostEqual(statistics.median(periods_s), period_s, delta=0.1 * period_s)

    def test_play(self):
        table = self.folder / "table.csv"
        table.write_text("t_s,a\n" + "".join(f"{0.2 * i},{i % 7}\n" for i in range(100)))
        self.run_device(BIN / "tactilectl", "play", "--in", table, "--pty", self.path, "--sequence", "--time", "--crc16")
        self.check_answers(0.2)

    def test_simulate(self):
        scene = self.folder / "scene.toml"
        scene.write_text('format = 1\ntitle = "one"\nrate_Hz = 50\n[[sensor]]\nname = "s"\nmodel = "hair"\nevery = 10\n'
                         '[[motion]]\ndo = "hold"\nfor_s = 20\n')
        self.run_device(BIN / "tactilectl", "simulate", "--scene", scene, "--pty", self.path, "--sequence", "--time", "--crc16")
        self.check_answers(0.2)

    def test_other_formats_do_not_answer(self):
        table = self.folder / "table.csv"
        table.write_text("t_s,a\n" + "".join(f"{0.2 * i},{i % 7}\n" for i in range(100)))
        self.run_device(BIN / "tactilectl", "play", "--in", table, "--pty", self.path, "--format", "cobs")
        os.write(self.port, b"?1\n")
        self.assertNotIn("!", "".join(self.lines_for(0.5)))

    def test_the_emulated_arduino(self):
        self.run_device("/usr/bin/python3", ROOT / "node/demo/arduino.py")
        self.check_answers(0.01)


if __name__ == "__main__":
    unittest.main()
