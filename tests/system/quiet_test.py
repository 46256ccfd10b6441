#!/usr/bin/env python3
"""Threads of a daemon whose devices are silent. Links wait for at most 250 ms, which dates their bytes, the pipeline wakes for a record each third
of watchdog_ms, and Modbus, the shared links and the watchdog look each 500 or 250 ms. All others wait for work. Prints the wake-ups by thread."""
import os
import pathlib
import sys
import time
import tty
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import Daemon, ROOT, wait_for  # noqa: E402
from process_costs import cpu_s, switches  # noqa: E402

MOST = {"link": 5, "pipeline": 13, "modbus": 3, "links": 3, "watchdog": 5, "control": 2}  # a second: each cadence, and one more
MOST_OF_OTHERS, MOST_OF_ALL = 1, 30
QUIET_S = 12  # after the start; a link looks each fortieth of its silence
LINK = """
[[link]]
name = "usb-{0}"
driver = "uart"
device = "{{folder}}/{0}"
baud = 921600
format = "cobs"

[[sensor]]
name = "{0}"
link = "usb-{0}"
model = "table"
calibration = "ROOT/config/calibration/table_documents.toml"
"""


class Quiet(unittest.TestCase):
    def measure(self, devices, seconds=10):
        """Prints the wake-ups and the processor time of a daemon with silent devices; returns [(thread, wake-ups per second)]."""
        config = "".join(LINK.format(name) for name in devices).replace("ROOT", str(ROOT))
        ends = []
        with Daemon(config) as daemon:
            for name in devices:
                master, slave = os.openpty()
                tty.setraw(slave)
                (daemon.folder / name).symlink_to(os.ttyname(slave))
                ends += [master, slave]
            daemon.start()
            wait_for(lambda: daemon.log().count(": open") == len(devices), "the links")
            time.sleep(QUIET_S)
            pid = daemon.process.pid
            before, cpu_before, at = switches(pid), cpu_s(pid), time.monotonic()
            time.sleep(seconds)
            took_s = time.monotonic() - at
            after, cpu = switches(pid), 100 * (cpu_s(pid) - cpu_before) / took_s
            status, stop_s = daemon.stop()
        for end in ends:
            os.close(end)
        rates = {f"{name} {thread}": (count - before.get((thread, name), 0)) / took_s for (thread, name), count in after.items()}
        total = sum(rates.values())
        print(f"{len(devices)} silent devices: {total:.1f} wake-ups/s, {cpu:.2f} % CPU, stopped in {stop_s * 1000:.0f} ms")
        print("  " + ", ".join(f"{name.split()[0]} {rate:.1f}" for name, rate in rates.items() if rate > 0.05))
        self.assertEqual(status, 0)
        return [(name.split()[0], rate) for name, rate in rates.items()]

    def test_with_one_and_two_silent_devices(self):
        for devices in (["left"], ["left", "right"]):
            with self.subTest(devices=devices):
                rates = self.measure(devices)
                for thread, rate in rates:
                    self.assertLessEqual(rate, MOST.get(thread, MOST_OF_OTHERS), thread)
                self.assertLessEqual(sum(rate for _, rate in rates), MOST_OF_ALL)


if __name__ == "__main__":
    unittest.main(verbosity=2)
