#!/usr/bin/env python3
"""Sensors that are Modbus slaves: pymodbus over TCP and over a serial line, and slaves that misbehave."""
import cmath
import json
import math
import pathlib
import subprocess
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "node/python"))
import tactiled  # noqa: E402
from daemon import ROOT, Daemon, Stopwatch, free_port, wait_for  # noqa: E402
from modbus_slaves import Hostile, Pty, Server, pymodbus_slave  # noqa: E402
from unit_daemon import CALIBRATION  # noqa: E402

SENSOR = """
[[sensor]]
name = "left"
link = "bus"
model = "generic"
calibration = "{folder}/unit.toml"
stale_ms = 100
frozen_after = 0
"""
KEEP = 'zero_after = "keep"\n'  # registers without a counter may be those of another device after each connection
LINK = """
[[link]]
name = "bus"
driver = "modbus"
"""
THREE = """
registers = [{name = "c1", at = 10}, {name = "c2", at = 11}, {name = "c3", at = 12}]
"""
FT300 = [934, -567, 89, 1000, -2000, 30]  # 9.34 N, -5.67 N, 0.89 N


def modbus_daemon(link, sensors=SENSOR, calibration=CALIBRATION):
    daemon = Daemon(LINK + link + sensors)
    (daemon.folder / "unit.toml").write_text(calibration)
    return daemon


def status(daemon):
    return json.loads(daemon.ctl("status", "--json").stdout)


def sensor(daemon, index=0):
    return status(daemon)["sensors"][index]


def counts(daemon):
    return status(daemon)["links"][0]


def is_good(daemon, index=0):
    return lambda: sensor(daemon, index)["quality"] == "good"


class Witness(threading.Thread):
    """Follows the sensor and stores its samples."""

    def __init__(self, daemon):
        super().__init__(daemon=True)
        self.name_of_node, self.ended, self.good, self.lies = daemon.name, False, 0, []
        self.start()

    def run(self):
        while not self.ended:
            for s in tactiled.open(self.name_of_node).follow("left", timeout=0.2):
                if s.quality in (tactiled.GOOD, tactiled.UNCERTAIN):
                    self.good += 1
                    x, y, z = s.force_S_N
                    if not (x == -y and z == 1 and 0 <= x <= 7):
                        self.lies.append((x, y, z))
                if self.ended:
                    break

    def end(self):
        self.ended = True
        self.join()


class RealSlaves(unittest.TestCase):
    def test_an_ft300_over_rtu_is_read_by_its_ready_made_file(self):
        with modbus_daemon('device = "{folder}/here"\nbaud = 19200\nparity = "none"\ntimeout_ms = 200\n\n[[link.slave]]\n'
                           f'registers_file = "{ROOT}/config/devices/robotiq_ft300.toml"\n',
                           SENSOR + 'channels = ["c1", "c2", "c3", "-", "-", "-"]\n') as d:
            d.others.append(subprocess.Popen(["socat", f"pty,raw,echo=0,link={d.folder}/here", f"pty,raw,echo=0,link={d.folder}/there"]))
            wait_for((d.folder / "there").exists, "socat")
            d.others.append(pymodbus_slave("rtu", d.folder / "there", 9, 180, FT300))
            d.start()
            wait_for(is_good(d), "a good sample")
            for got, sent in zip(sensor(d)["force_S_N"], FT300):
                self.assertAlmostEqual(got, sent / 100, places=9)  # N

    def test_an_rg2_ft_over_tcp_gives_two_sensors_from_one_frame(self):
        values = [0, 0, 10, -20, 30, 1, 2, 3, 0, 0, 0, -40, 50, 60, 4, 5, 6]  # from register 257 on, 0.1 N
        twelve = '"c1", "c2", "c3", "-", "-", "-"'
        unused = '"-", "-", "-", "-", "-", "-"'
        port = free_port()
        right = SENSOR.replace('"left"', '"right"') + f"channels = [{unused}, {twelve}]\n"
        with modbus_daemon(f'address = "127.0.0.1:{port}"\ntimeout_ms = 200\n\n[[link.slave]]\n'
                           f'registers_file = "{ROOT}/config/devices/onrobot_rg2ft.toml"\n',
                           SENSOR + f"channels = [{twelve}, {unused}]\n" + right) as d:
            d.start()  # before its device: it waits for the device
            d.others.append(pymodbus_slave("tcp", port, 65, 257, values))
            wait_for(is_good(d, 1), "a good sample")
            for index, sent in enumerate(([1, -2, 3], [-4, 5, 6])):
                for got, value in zip(sensor(d, index)["force_S_N"], sent):
                    self.assertAlmostEqual(got, value, places=9)  # N

    def test_a_device_that_says_it_is_not_ready_gives_no_value(self):
        values = [4, 0, 10, -20, 30, 1, 2, 3]  # HEX: status 4
        port = free_port()
        with modbus_daemon(f'address = "127.0.0.1:{port}"\ntimeout_ms = 200\n\n[[link.slave]]\n'
                           f'registers_file = "{ROOT}/config/devices/onrobot_hex.toml"\n',
                           SENSOR + 'channels = ["c1", "c2", "c3", "-", "-", "-"]\n') as d:
            d.others.append(pymodbus_slave("tcp", port, 64, 257, values))
            d.start()
            wait_for(lambda: counts(d)["bad_value"] > 20, "answers")
            self.assertEqual(counts(d)["frames"], 0)
            self.assertTrue(sensor(d)["quality"].startswith("bad"))

    def test_polls_on_its_own_grid(self):
        # A busy machine delays single requests and makes the daemon leave out others; the grid does not move by that. A period that
        # began with each answer would spread the requests over all phases: a fifth of them would be within a tenth of a period.
        period_s, server = 1 / 200, Server()
        slave = Hostile(server, {}, 1)
        slave.start()
        with modbus_daemon(f'address = "127.0.0.1:{server.port}"\ntimeout_ms = 5000\n\n[[link.slave]]\nrate_Hz = 200\n' + THREE) as d:
            d.start()
            wait_for(is_good(d), "a good sample")
            first = len(slave.asked_s)
            wait_for(lambda: len(slave.asked_s) > first + 1000, "1000 requests")
            self.assertEqual(counts(d)["bus_error"], 0)
        slave.close()
        asked_s = slave.asked_s[first:]
        mean = sum(cmath.exp(2j * math.pi * at_s / period_s) for at_s in asked_s)
        phase_s = cmath.phase(mean) / (2 * math.pi) * period_s
        on_grid = [at_s for at_s in asked_s if abs((at_s - phase_s) / period_s - round((at_s - phase_s) / period_s)) < 0.1]
        periods = [round((b - a) / period_s) for a, b in zip(on_grid, on_grid[1:])]
        print(f"{len(on_grid)} of {len(asked_s)} requests on the grid, {periods.count(1)} after one period", file=sys.stderr)
        self.assertGreater(len(on_grid), len(asked_s) / 2)
        self.assertGreater(periods.count(1), len(periods) / 2)
        self.assertLessEqual(len(asked_s), (asked_s[-1] - asked_s[0]) / period_s + 2, "more often than once a period")


class HostileSlaves(unittest.TestCase):
    def run_against(self, end, link, misdeeds, seconds=12, keys=""):
        """Returns the counters. Every value that is published is one of a good answer, in time. `keys`: of the sensor."""
        slave = Hostile(end, misdeeds, seed=4)
        slave.start()
        try:
            with modbus_daemon(link + "timeout_ms = 50\n\n[[link.slave]]\nrate_Hz = 100\n" + THREE, SENSOR + keys) as d:
                d.start()
                witness = Witness(d)
                time.sleep(seconds)
                slave.misdeeds = {}
                wait_for(is_good(d), "a good sample after it came to reason")
                witness.end()
                for misdeed in misdeeds:
                    self.assertGreater(slave.done.get(misdeed, 0), 0, misdeed)
                self.assertEqual(witness.lies, [])
                self.assertGreater(witness.good, 100)
                print(witness.good, "good samples;", slave.done, counts(d), file=sys.stderr)
                return counts(d), slave.done
        finally:
            slave.close()

    def test_nothing_wrong_over_tcp_is_taken_for_a_value(self):
        server = Server()
        counted, done = self.run_against(
            server, f'address = "127.0.0.1:{server.port}"\n',
            {name: 0.03 for name in ("late", "silence", "unit", "function", "transaction", "exception", "length", "short", "twice", "slow")})
        self.assertGreaterEqual(counted["bus_error"], done["unit"] + done["function"] + done["exception"])
        self.assertGreaterEqual(counted["bad_length"], done["length"])

    def test_nothing_wrong_over_rtu_is_taken_for_a_value(self):
        with modbus_daemon("", "") as folder:
            pty = Pty(folder.folder / "bus")
            counted, done = self.run_against(
                pty, f'device = "{pty.link}"\nbaud = 115200\n',
                {name: 0.03 for name in ("late", "silence", "unit", "function", "checksum", "exception", "length", "short", "noise", "slow")})
            self.assertEqual(counted["bad_checksum"], done["checksum"])
            self.assertGreater(counted["skipped_bytes"], 5 * done["noise"])

    def test_a_server_that_hangs_up_and_a_line_that_is_pulled_come_back(self):
        server = Server()
        counted, done = self.run_against(server, f'address = "127.0.0.1:{server.port}"\n', {"hang_up": 0.01}, 6, KEEP)
        self.assertGreaterEqual(counted["gone"], done["hang_up"] - 1)
        with modbus_daemon("", "") as folder:
            pty = Pty(folder.folder / "bus")
            counted, done = self.run_against(pty, f'device = "{pty.link}"\nbaud = 115200\n', {"hang_up": 0.01}, 6, KEEP)
            self.assertGreaterEqual(counted["gone"], done["hang_up"] - 1)

    def test_a_slave_that_falls_silent_is_bad_within_its_stale_time_and_costs_no_processor_time(self):
        server = Server()
        slave = Hostile(server, {}, 1)
        slave.start()
        with modbus_daemon(f'address = "127.0.0.1:{server.port}"\ntimeout_ms = 50\n\n[[link.slave]]\nrate_Hz = 100\n' + THREE) as d:
            d.start()
            wait_for(is_good(d), "a good sample")
            with Stopwatch() as watch, tactiled.open(d.name) as node:
                slave.misdeeds = {"silence": 1}
                wait_for(lambda: node.latest("left").quality == tactiled.BAD, "the sensor to be bad")
                self.assertLess(watch.seconds(), 0.5)
            before = cpu_s(d)
            time.sleep(2)
            self.assertLess(cpu_s(d) - before, 0.6)
            slave.misdeeds = {}
            wait_for(is_good(d), "a good sample again")
        slave.close()


def cpu_s(daemon):
    fields = pathlib.Path(f"/proc/{daemon.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / 100


if __name__ == "__main__":
    unittest.main(verbosity=2)
