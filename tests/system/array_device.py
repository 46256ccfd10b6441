"""A pressed array of taxels that sends its frames as datagrams, written from drivers/wire/array_frame.md, and a daemon that
reads it."""
import json
import math
import random
import select
import socket
import struct
import threading
import time
import zlib

from daemon import Daemon, free_port, wait_for

FORMAT, ANSWER = 3, 4  # first byte of a piece, and of an answer
I16, MAX_I16 = 2, 32767
HAS_MISSING, HAS_TIME = 1, 2
MAX_DATAGRAM = 1472

CONFIG = """
[[link]]
name = "{name}"
driver = "udp"
address = "127.0.0.1:{port}"
listen = {listen}
taxels = {taxels}
values = {values}
echo = true

[[sensor]]
name = "{name}"
link = "{name}"
model = "patch"
calibration = "{{folder}}/{name}.toml"
stale_ms = {stale_ms}
"""

CALIBRATION = """format = 1
model = "patch"
method = "linear"
contact_model = "unknown"
serial = "{name}"
date = "2026-01-01"
channels = {channels}
channel_unit = "counts"
zero = {zero}
components = {components}

[parameters]
{places}gain_sd = 0.02

[tables]
taxel = {taxel}
taxel_sd = {taxel_sd}
"""


def with_crc(message):
    return message + struct.pack("<I", zlib.crc32(message))


class ArrayDevice:
    """Sends `rate_Hz` frames a second from its own port, once started, and answers the echo. A context manager. Attributes that
    a test may change while it runs:

    body: a function of the seconds since the start that returns x_m, y_m, press_N and radius_m of a ball on the skin, in frame S
    missing, saturated: sets of taxels"""

    def __init__(self, name="skin", rows=8, columns=12, values=1, rate_Hz=100, pitch_m=2e-3, counts_per_N=1000, places_m=None):
        """values: 1 (fz) or 3 (fx fy fz). places_m: a list of (x, y, z) in place of a grid of rows and columns."""
        self.name, self.rows, self.columns, self.values, self.rate_Hz = name, rows, columns, values, rate_Hz
        self.pitch_m, self.counts_per_N, self.is_grid = pitch_m, counts_per_N, places_m is None
        self.places_m = places_m or [((i % columns - (columns - 1) / 2) * pitch_m, ((rows - 1) / 2 - i // columns) * pitch_m, 0.0) for i in range(rows * columns)]
        self.body = lambda _: (0.0, 0.0, 2.0, 5e-3)
        self.missing, self.saturated = set(), set()
        self.sequence, self.answers, self.is_paused = 0, 0, False
        self.port, self.listen = free_port(), free_port()
        self.random = random.Random(1)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", self.port))
        self.ended, self.thread = False, None

    def config(self, stale_ms=1000):
        return CONFIG.format(name=self.name, port=self.port, listen=self.listen, taxels=len(self.places_m), values=self.values, stale_ms=stale_ms)

    def calibration(self, dead=()):
        places = f"rows = {self.rows}\ncolumns = {self.columns}\npitch_mm = {1e3 * self.pitch_m}\n" if self.is_grid else ""
        per_count = 1 / self.counts_per_N
        one = self.values == 1
        text = CALIBRATION.format(
            name=self.name, places=places, channels='["Z"]' if one else '["X", "Y", "Z"]', zero=[0.0] * self.values,
            components='["fz", "mx", "my"]' if one else '["fx", "fy", "fz", "mx", "my", "mz"]',
            taxel=[[-per_count]] if one else [[per_count, 0, 0], [0, per_count, 0], [0, 0, -per_count]], taxel_sd=[[0.005] * self.values])
        if not self.is_grid:
            text += f"place_mm = {[[1e3 * v for v in place] for place in self.places_m]}\n"
        return text + (f"dead = [{list(dead)}]\n" if dead else "")

    def forces_N(self, t_s):
        """The press on each taxel."""
        x_m, y_m, press_N, radius_m = self.body(t_s)
        parts = [math.sqrt(max(0.0, 1 - ((x - x_m) ** 2 + (y - y_m) ** 2) / radius_m ** 2)) for x, y, _ in self.places_m]
        whole = sum(parts) or 1
        return [press_N * part / whole for part in parts]

    def numbers(self, t_s):
        """The i16 of all taxels, those of one taxel together."""
        out = []
        for i, force_N in enumerate(self.forces_N(t_s)):
            counts = [*([0.1 * force_N * self.counts_per_N] * (self.values - 1)), force_N * self.counts_per_N]
            if i in self.missing:
                out += [0] * self.values
            elif i in self.saturated:
                out += [*([0] * (self.values - 1)), MAX_I16]
            else:
                out += [max(1 - MAX_I16, min(MAX_I16 - 1, round(c + self.random.gauss(0, 3)))) for c in counts]
        return out

    def pieces(self, t_us, numbers):
        """The messages of one frame."""
        taxels = len(self.places_m)
        size = (MAX_DATAGRAM - 24) * 8 // (16 * self.values + 1)
        flags = HAS_TIME | (HAS_MISSING if self.missing else 0)
        for first in range(0, taxels, size):
            count = min(size, taxels - first)
            message = struct.pack("<BBBBIIHBBHH", FORMAT, 0, I16, flags, self.sequence & 0xFFFFFFFF, t_us & 0xFFFFFFFF, taxels, self.values, 0, first, count)
            if self.missing:
                bits = sum(1 << i - first for i in self.missing if first <= i < first + count)
                message += bits.to_bytes((count + 7) // 8, "little")
            message += struct.pack(f"<{count * self.values}h", *numbers[first * self.values:(first + count) * self.values])
            yield with_crc(message)

    def now_us(self):
        """The time in an answer."""
        return time.monotonic_ns() // 1000

    def answer(self, wait_s):
        """Answers the questions that come within this time."""
        until = time.monotonic() + wait_s
        while select.select([self.socket], [], [], max(0, until - time.monotonic()))[0]:
            text, sender = self.socket.recvfrom(2048)
            for line in text.split(b"\n"):
                if line.startswith(b"?") and line[1:].isdigit():
                    self.socket.sendto(with_crc(struct.pack("<BBHII", ANSWER, 0, 0, int(line[1:]) & 0xFFFFFFFF, self.now_us() & 0xFFFFFFFF)), sender)
                    self.answers += 1

    def run(self):
        began_s = due_s = time.monotonic()
        while not self.ended:
            self.answer(max(0, due_s - time.monotonic()))
            due_s = max(due_s + 1 / self.rate_Hz, time.monotonic() - 0.1)
            if self.is_paused:
                continue
            t_us = time.monotonic_ns() // 1000
            for piece in self.pieces(t_us, self.numbers(time.monotonic() - began_s)):
                self.socket.sendto(piece, ("127.0.0.1", self.listen))
            self.sequence += 1

    def start(self):
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()
        return self

    def __enter__(self):
        return self.start()

    def __exit__(self, *_):
        self.ended = True
        self.thread.join()
        self.socket.close()


def array_daemon(*devices, dead=(), stale_ms=1000):
    """A started daemon with a sensor for each started device; the sensors have the devices' names."""
    daemon = Daemon("".join(device.config(stale_ms) for device in devices))
    for device in devices:
        (daemon.folder / f"{device.name}.toml").write_text(device.calibration(dead))
    daemon.start()

    def is_ready():
        qualities = [sensor["quality"] for sensor in json.loads(daemon.ctl("status", "--json").stdout)["sensors"]]
        return all(quality.startswith(("good", "uncertain")) and "stepped" not in quality for quality in qualities)
    wait_for(is_ready, "values")
    return daemon
