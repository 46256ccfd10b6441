#!/usr/bin/python3
"""A stand-in for an Arduino with four channels on a soft sensor: prints the lines of drivers/wire/ascii_line.md behind a pty.

    arduino.py                              runs until it is ended
    arduino.py load fx_N=0,fy_N=0,fz_N=-5   puts this load on the sensor of a running one
    arduino.py mount                        takes the sensor off and mounts it again: gains and zeros change by about 1 %

ARDUINO=PATH: the link to the pty, build/demo/arduino if not given
"""
import binascii
import os
import pathlib
import random
import select
import signal
import sys
import time
import tty

PORT = pathlib.Path(os.environ.get("ARDUINO", "build/demo/arduino"))
AXES = ("fx_N", "fy_N", "fz_N")
RATE_Hz, NOISE = 100, 0.3
COUNTS_A_N = ((42.0, 5.0, -38.0), (-44.0, 3.0, -41.0), (2.0, 40.0, -36.0), (-3.0, -43.0, -40.0))
ZERO = (302.0, 295.0, 310.0, 288.0)


def line(text):
    """Returns the bytes of a line with its CRC."""
    return f"{text}*{binascii.crc_hqx(text.encode(), 0xFFFF):04X}\r\n".encode()


class Echo:
    """Answers the requests ?N of a daemon with echo = true. `time_us()` is the device's clock."""

    def __init__(self, port, time_us):
        self.port, self.time_us, self.received = port, time_us, b""

    def answers(self):
        """Returns the lines that answer the requests since the last call. Does not block where the port does not."""
        try:
            self.received += os.read(self.port, 4096)
        except OSError:
            pass  # no request
        *requests, self.received = self.received.split(b"\n")
        return b"".join(line(f"!{int(r[1:])},{self.time_us()}") for r in requests if r[:1] == b"?" and r[1:].isdigit())


def state_file(port):
    return port.with_name(port.name + ".load")


def write_state(port, mounting, load):
    new = port.with_name(port.name + ".new")
    new.write_text(" ".join(map(str, [mounting, *load])))
    new.rename(state_file(port))


def read_state(port):
    mounting, *load = state_file(port).read_text().split()
    return int(mounting), [float(f) for f in load]


def run(port):
    port.parent.mkdir(parents=True, exist_ok=True)
    write_state(port, 1, [0.0, 0.0, 0.0])
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    port.unlink(missing_ok=True)
    port.symlink_to(os.ttyname(slave))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    noise, began, number = random.Random(1), time.monotonic(), 0

    def time_us():
        return int((time.monotonic() - began) * 1e6) & 0xFFFFFFFF

    def send(data):
        try:
            os.write(master, data)
        except BlockingIOError:
            pass  # no program reads: a serial port would lose these bytes, too

    echo = Echo(master, time_us)
    try:
        while True:
            while (left := began + number / RATE_Hz - time.monotonic()) > 0:
                if select.select([master], [], [], left)[0]:
                    send(echo.answers())
            mounting, load = read_state(port)
            mounted = random.Random(mounting)
            channels = []
            for zero, gains in zip(ZERO, COUNTS_A_N):
                gain = mounted.gauss(1, 0.005)
                channels.append(zero + mounted.gauss(0, 0.5) + gain * sum(g * f for g, f in zip(gains, load)) + noise.gauss(0, NOISE))
            send(line(f"{number},{time_us()}," + ",".join(f"{c:.2f}" for c in channels)))
            number += 1
    finally:
        port.unlink(missing_ok=True)


def loaded(words):
    """Returns the load of "fx_N=0,fz_N=-5", and ends the program where it is none."""
    try:
        parts = dict(part.split("=") for part in words.split(","))
        if not set(parts) <= set(AXES):
            raise ValueError
        return [float(parts.get(name, 0)) for name in AXES]
    except ValueError:
        sys.exit(f'arduino.py: "{words}" is no load; write, for example, fx_N=0,fy_N=0,fz_N=-5')


def main():
    words = sys.argv[1:]
    if not words:
        return run(PORT)
    if words != ["mount"] and (words[0] != "load" or len(words) != 2):
        sys.exit(__doc__)
    load = loaded(words[1]) if words[0] == "load" else None
    try:
        mounting, before = read_state(PORT)
    except OSError:
        sys.exit(f"arduino.py: none runs at {PORT}; start it first: node/demo/arduino.py &")
    write_state(PORT, mounting + (load is None), load or before)
    time.sleep(0.1)


if __name__ == "__main__":
    main()
