#!/usr/bin/python3
"""Reads all taxels of an array over Modbus TCP, as a PLC does. As a program: the rate, and the snapshots with values of several
frames, of an array of 32 x 32 taxels.

    /usr/bin/python3 tests/system/taxel_pages.py [snapshots]"""
import statistics
import sys
import time

from pymodbus.client import ModbusTcpClient

from array_device import ArrayDevice, array_daemon

HEADS, HEAD, PAGES, PAGE = 10000, 16, 11000, 125
TOKEN, SEQ, STATUS, FAULT, AGE_MS, SCALE, N_TAXELS, COMPONENTS, N_OUT, N_PAGES = range(10)
NO_VALUE, NO_FORCE = 0x8000, -0x8000


class NotThere(Exception):
    """The exception code of an answer."""


class Plc:
    def __init__(self, port):
        self.client = ModbusTcpClient("127.0.0.1", port=port)
        self.client.connect()

    def read(self, at, count):
        answer = self.client.read_input_registers(at, count=count)
        if answer.isError():
            raise NotThere(answer.exception_code)
        return answer.registers

    def latch(self, sensor=0):
        return self.read(HEADS + HEAD * sensor, HEAD)

    def page(self, n):
        return self.read(PAGES + PAGE * n, PAGE)

    def snapshot(self, sensor=0):
        """Returns the head and all values, 0.01 N."""
        head, values = self.latch(sensor), []
        for n in range(head[N_PAGES]):
            token, *words = self.page(n)
            assert token == head[TOKEN], "a page of another snapshot"
            values += [word - 0x10000 if word >= 0x8000 else word for word in words]
        return head, values[:head[N_TAXELS] * bin(head[COMPONENTS]).count("1")]

    def close(self):
        self.client.close()


def uniform_array(**shape):
    """A device whose taxels all have one force, another one in each frame."""
    device = ArrayDevice(rate_Hz=200, **shape)
    device.numbers = lambda _: [10 * (20 + device.sequence % 50)] * (len(device.places_m) * device.values)
    return device


def main(snapshots):
    with uniform_array(rows=32, columns=32) as device, array_daemon(device) as daemon:
        plc, took_s, mixed, frames = Plc(daemon.port), [], 0, set()
        for _ in range(snapshots):
            began_s = time.monotonic()
            head, values = plc.snapshot()
            took_s.append(time.monotonic() - began_s)
            mixed += len(values) != 1024 or len(set(values)) != 1
            frames.add(head[SEQ])
        plc.close()
    took_s.sort()
    print(f"{snapshots} snapshots of {len(frames)} frames, {mixed} mixed, {snapshots / sum(took_s):.0f} per second; one takes "
          f"p50 {1e3 * statistics.median(took_s):.1f} ms, p99 {1e3 * took_s[int(0.99 * snapshots)]:.1f} ms, worst {1e3 * took_s[-1]:.1f} ms")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
