#!/usr/bin/env python3
"""A USB serial cable that is pulled and plugged; a UART that takes a rate and does another one. Inside the test machine."""
# QEMU: -chardev socket,id=c,path=HOST/control.sock,server=on,wait=off -device isa-serial,chardev=c,index=1
# QEMU: -device qemu-xhci -chardev socket,id=u,path=HOST/usb.sock,server=on,wait=off -device usb-serial,chardev=u
# QEMU: -chardev null,id=n -device isa-serial,chardev=n,index=2
import pathlib
import threading
import time
import unittest

from machine import Witness, link_of, machine_daemon, now_ns, sh, wait_for
from tactiled import BAD, GOOD

USB = """
[[link]]
name = "usb"
driver = "uart"
device = "/dev/ttyUSB0"
baud = 115200
format = "lines"
channels = 1
sequence = true
checksum = true

[[sensor]]
name = "tip"
link = "usb"
model = "generic"
calibration = "{folder}/unit1.toml"
stale_ms = 500
"""
WRONG_RATE = """
[[link]]
name = "slow"
driver = "uart"
device = "/dev/ttyS2"
baud = 921600
format = "cobs"

[[sensor]]
name = "slow"
link = "slow"
model = "generic"
calibration = "{folder}/unit1.toml"
"""


class Cable:
    """Plugged, a device at its end sends 100 lines a second."""

    def __init__(self):
        sh("stty", "-F", "/dev/ttyS1", "raw", "-echo")
        self._to_host = open("/dev/ttyS1", "wb", buffering=0)
        self._plugged = False
        threading.Thread(target=self._device, daemon=True).start()

    def _device(self):
        while True:
            if self._plugged:
                self._to_host.write(b"line\n")
            time.sleep(0.01)

    def plug(self):
        self._to_host.write(b"plug\n")
        self._plugged = True
        wait_for(pathlib.Path("/dev/ttyUSB0").exists, "/dev/ttyUSB0")

    def unplug(self):
        self._plugged = False
        self._to_host.write(b"unplug\n")
        wait_for(lambda: not pathlib.Path("/dev/ttyUSB0").exists(), "/dev/ttyUSB0 to go")


class Uart(unittest.TestCase):
    def test_pulled_is_bad_at_once_and_comes_back_while_another_link_goes_on(self):
        cable = Cable()
        cable.plug()
        with machine_daemon(USB) as daemon:
            daemon.start()
            tip, other = Witness(daemon, "tip"), Witness(daemon, "other")
            tip.wait_for_quality(GOOD)
            other.wait_for_quality(GOOD)
            for turn in range(1, 4):
                began = now_ns()
                cable.unplug()
                bad = tip.wait_for_quality(BAD) if tip.quality() != BAD else next(
                    at for at, s in tip.samples if at >= began and s.quality == BAD)
                after = tip.between(bad, now_ns())
                self.assertFalse([s for s in after if s.quality != BAD], "a value after the end")
                cable.plug()
                plugged = now_ns()
                good = tip.wait_for_quality(GOOD)
                print(f"pulled: BAD within {(bad - began) / 1e6:.0f} ms; plugged: GOOD after {(good - plugged) / 1e6:.0f} ms")
                # status copies the counters once a burst
                wait_for(lambda: link_of(daemon, "usb")["gone"] == turn, f"gone = {turn}")
                self.assertEqual(link_of(daemon, "usb")["opened"], turn + 1)
            for at, sample in tip.samples:
                if sample.quality == GOOD:
                    self.assertAlmostEqual(sample.force_S_N[2], 2.5)
            breaks = {sample.epoch for _, sample in other.samples}
            self.assertEqual(len(breaks), 1, "the other link was disturbed")
            self.assertEqual(link_of(daemon, "other")["lost"], 0)
            tip.close()
            other.close()

    def test_a_rate_that_the_uart_does_not_do_is_said_not_read(self):
        with machine_daemon(WRONG_RATE) as daemon:
            daemon.start()
            wait_for(lambda: "921600" in daemon.log(), "the complaint")
            self.assertIn("921600 baud was requested, and the port runs at ", daemon.log())
            self.assertFalse(link_of(daemon, "slow")["open"])
            time.sleep(0.2)
            self.assertEqual(link_of(daemon, "slow")["frames"], 0)


if __name__ == "__main__":
    unittest.main()
