"""A CAN bus for the tests: programs that write to it, a device on it, and a daemon that reads it beside another link."""
import socket
import struct
import threading
import time
import unittest

from machine import Witness, link_of, machine_daemon, now_ns, wait_for
from tactiled import BAD, DISCONNECTED, GOOD

IP = "/usr/bin/ip"  # busybox has one of its own
EXTENDED, REMOTE, ERROR = 0x80000000, 0x40000000, 0x20000000
BUS_OFF, PROTOCOL, CONTROLLER = 0x40, 0x8, 0x4
VALUE = 250  # measured value of the device, by default


def link(interface, keys="", device="id = 0x123"):
    """A link "can" with a sensor "tip": one channel of 16 bits, and a counter of 16 bits behind it."""
    return f"""
[[link]]
name = "can"
driver = "can"
interface = "{interface}"
{keys}
[[link.device]]
device = 0
{device}
signals = [{{name = "Fz", start = 0, length = 16, order = "intel", type = "signed"}}]
sequence = {{start = 16, length = 16, order = "intel"}}

[[sensor]]
name = "tip"
link = "can"
model = "generic"
calibration = "{{folder}}/unit1.toml"
stale_ms = 1000
"""


class Bus:
    """Writes messages to an interface."""

    def __init__(self, interface):
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        self.socket.bind((interface,))
        self.number = 0

    def send(self, identifier, data):
        self.socket.send(struct.pack("=IB3x8s", identifier, len(data), data))

    def send_fd(self, identifier, data):
        self.socket.send(struct.pack("=IBB2x64s", identifier, len(data), 1, data))

    def sample(self, value=VALUE):
        self.send(0x123, struct.pack("<hH", value, self.number & 0xFFFF))
        self.number += 1

    def close(self):
        self.socket.close()


class Device:
    """A device that sends its samples, 50 a second, as long as the bus lets it."""

    def __init__(self, send):
        self._send, self._stop = send, False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._stop:
            try:
                self._send()
            except OSError:
                pass
            time.sleep(0.02)

    def close(self):
        self._stop = True
        self._thread.join(2)


class Case(unittest.TestCase):
    def start(self, links, *before):
        self.make_daemon(links)
        self.start_daemon(*before)

    def make_daemon(self, links):
        self.daemon = machine_daemon(links)
        self.addCleanup(self.daemon.__exit__)

    def start_daemon(self, *before):
        self.daemon.start(*before)
        self.tip, self.other = Witness(self.daemon, "tip"), Witness(self.daemon, "other")
        self.addCleanup(self.tip.close)
        self.addCleanup(self.other.close)
        self.other.wait_for_quality(GOOD)
        wait_for(lambda: link_of(self.daemon, "can")["open"] or "can\":" in self.daemon.log(), "the link")

    def device(self, send):
        device = Device(send)
        self.addCleanup(device.close)
        return device

    def good(self):
        wait_for(lambda: self.tip.quality() == GOOD, "GOOD")

    def bad_after(self, began):
        """Returns the first BAD sample since then; no value may follow until the caller has restored the bus."""
        wait_for(lambda: self.tip.quality() == BAD, "BAD")
        bad, why = next((at, s.reasons) for at, s in list(self.tip.samples) if at >= began and s.quality == BAD)
        self.assertTrue(why & DISCONNECTED, "it was its age that told, not the link")
        self.assertFalse([s for s in self.tip.between(bad, now_ns()) if s.quality != BAD], "a value after the end")
        return bad

    def break_and_repair(self, what, break_it, repair_it):
        self.good()
        began = now_ns()
        break_it()
        bad = self.bad_after(began)
        time.sleep(0.3)  # gives the log time to contain the error
        mended = now_ns()
        repair_it()
        good = self.tip.wait_for_quality(GOOD)
        print(f"{what}: BAD within {(bad - began) / 1e6:.0f} ms; mended: GOOD after {(good - mended) / 1e6:.0f} ms", flush=True)

    def expect(self, **counters):
        """Checks counters of link "can"; status copies them once a burst, or after a silence of 50 ms."""
        def differences():
            seen = link_of(self.daemon, "can")
            return {name: (seen[name], wanted) for name, wanted in counters.items() if seen[name] != wanted}
        try:
            wait_for(lambda: not differences(), "counters")
        except TimeoutError:
            self.fail(f"(seen, wanted): {differences()}")

    def all_values_are_right(self, value=VALUE):
        for _, sample in list(self.tip.samples):
            if sample.quality == GOOD:
                self.assertEqual(round(sample.force_S_N[2]), value)

    def tearDown(self):
        if hasattr(self, "other"):
            self.assertEqual(len({s.epoch for _, s in list(self.other.samples)}), 1, "the other link was disturbed")
            self.assertEqual(link_of(self.daemon, "other")["lost"], 0)
