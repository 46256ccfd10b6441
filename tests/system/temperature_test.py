#!/usr/bin/env python3
"""Two sensors of hairs that a kelvin loads with four times their full scale: a thermometer that is wrong, sensors that are exchanged on
their ports and calibrations that are exchanged in the configuration give no wrong value that is GOOD."""
import math
import pathlib
import random
import signal
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from daemon import PATIENCE_S, ROOT, Daemon, wait_for  # noqa: E402
from pty_device import PtyDevice  # noqa: E402

sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

PER_K = 3e-3  # platinum
SENSOR = """
[[link]]
name = "usb-{name}"
driver = "uart"
device = "{{folder}}/{name}"
path = "direct"
format = "lines"
channels = 6
sequence = true

[[sensor]]
name = "{name}"
link = "usb-{name}"
model = "hair"
calibration = "{{folder}}/{name}.toml"
channels = ["H1", "H2", "H3", "H4", "T", "number"]
temperature = "T"
temperature_frozen_after = 100
temperature_difference_K = 0.005
serial_channel = "number"
stale_ms = 2000
"""
LEARNT = """sd = [2e-4, 2e-4, 2e-4]
temperature.reference_C = 23.0
temperature.range_C = [10.0, 40.0]
temperature.zero = [0.0, 0.0, 0.0, 0.0]
temperature.zero_per_K = [3e-3, 3e-3, 3e-3, 3e-3]
temperature.gain_per_K = [0.0, 0.0, 0.0, 0.0]
"""
SERIALS = {"left": 1001, "right": 1002}


def calibration(serial):
    text = (ROOT / "config/calibration/hair_documents.toml").read_text()
    return text.replace('serial = "documents"', f'serial = "{serial}"').replace("\nparameters.area", "\n" + LEARNT + "\nparameters.area", 1)


class Hairs(PtyDevice):
    """A device that sends 200 lines a second: four hairs at no load, its temperature and its number."""

    def __init__(self, path, number):
        self.number, self.true_C, self.said_C, self.still = number, 23.0, None, {}
        self.random = random.Random(number)
        super().__init__(path)

    def line(self, sequence):
        hairs = [PER_K * (self.true_C - 23) + self.random.gauss(0, 5e-6) for _ in range(4)]
        for k, value in self.still.items():
            hairs[k] = value
        said = f"{self.true_C + self.random.gauss(0, 1e-3):.6f}" if self.said_C is None else str(self.said_C)
        return f"{sequence}," + ",".join(f"{h:.9f}" for h in hairs) + f",{said},{self.number}"


class TemperatureAndIdentity(unittest.TestCase):
    def setUp(self):
        self.daemon = Daemon("".join(SENSOR.format(name=name) for name in SERIALS))
        for name, serial in SERIALS.items():
            (self.daemon.folder / f"{name}.toml").write_text(calibration(serial))
        self.devices = {name: Hairs(self.daemon.folder / name, serial) for name, serial in SERIALS.items()}
        self.daemon.start()
        self.wait_good()

    def tearDown(self):
        self.daemon.__exit__()
        for device in self.devices.values():
            device.finish()

    def latest(self, name="left"):
        return tactiled.open(self.daemon.name).latest(name)

    def wait_good(self):
        for name in SERIALS:
            wait_for(lambda name=name: self.latest(name).quality == tactiled.GOOD, f"{name} to be GOOD")

    def good_values(self, seconds=1.0, enough=math.inf, name="left"):
        """Follows the sensor so long, or until so many of its samples were GOOD; returns their number. Every GOOD value must be right."""
        good, until_s = 0, time.monotonic() + seconds
        for sample in tactiled.open(self.daemon.name).follow(name):
            if sample.quality == tactiled.GOOD:
                good += 1
                self.assertLess(abs(sample.force_S_N[2]), 5 * sample.sd_force_N[2])
            if good == enough or time.monotonic() > until_s:
                return good

    def test_the_room_warms_up_and_no_force_appears(self):
        for step in range(20):
            self.devices["left"].true_C = 23 + 0.05 * step
            self.assertEqual(self.good_values(PATIENCE_S, 20), 20)
        self.assertAlmostEqual(self.latest().temperature_C, 23.95, delta=0.01)

    def test_a_thermometer_that_fails_jumps_or_stands_still_gives_no_good_value(self):
        device = self.devices["left"]
        for said in ("nan", 26.0, 73.4, 296.15, -4096.0):  # a missing one, another sensor, degF, K, and the code 0 of a chip
            device.said_C = said
            wait_for(lambda: self.latest().quality != tactiled.GOOD, f"{said} degC to be noticed")
            self.assertEqual(self.good_values(), 0, said)
            self.assertTrue(math.isnan(self.latest().temperature_C), said)
            device.said_C = None
            self.wait_good()
        device.said_C = 23.0
        wait_for(lambda: self.latest().quality != tactiled.GOOD, "a thermometer that stands still to be noticed")
        device.true_C = 24
        self.assertEqual(self.good_values(), 0)

    def test_a_hair_that_stands_still_is_frozen_although_the_calibration_has_no_rows_at_rest(self):
        self.devices["left"].still = {1: 1e-6}  # within the noise of the others
        wait_for(lambda: self.latest().reasons & tactiled.FROZEN, "the frozen hair")
        self.assertNotEqual(self.latest().quality, tactiled.GOOD)
        self.devices["left"].still = {}
        self.wait_good()

    def test_sensors_that_are_exchanged_on_their_ports_have_no_value(self):
        left, right = self.devices["left"], self.devices["right"]
        left.number, right.number = right.number, left.number
        for name in SERIALS:
            wait_for(lambda name=name: self.latest(name).quality == tactiled.BAD, name)
            self.assertTrue(self.latest(name).reasons & tactiled.WRONG_DEVICE)

    def test_calibrations_that_are_exchanged_have_no_value(self):
        files = {name: self.daemon.folder / f"{name}.toml" for name in SERIALS}
        texts = {name: file.read_text() for name, file in files.items()}
        files["left"].write_text(texts["right"])
        files["right"].write_text(texts["left"])
        self.daemon.process.send_signal(signal.SIGHUP)
        for name in SERIALS:
            wait_for(lambda name=name: self.latest(name).quality == tactiled.BAD
                     and self.latest(name).reasons & tactiled.WRONG_DEVICE, name)


if __name__ == "__main__":
    unittest.main(verbosity=2)
