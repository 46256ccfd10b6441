#!/usr/bin/env python3
"""tactilectl identify at pymodbus slaves, whose registers move, and the daemon with the keys that it prints."""
import json
import subprocess
import sys
import tempfile
import time
import unittest
import pathlib

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, Daemon, free_port, wait_for  # noqa: E402
from modbus_slaves import PYMODBUS  # noqa: E402
from unit_daemon import CALIBRATION  # noqa: E402

# Three forces in N that are pressed every two seconds, in the format of sys.argv[5], as in struct; "<" is the low word first.
MOVES = """
import random, struct, threading, time
block = ModbusSequentialDataBlock(first + 1, [0] * 64)
context = ModbusServerContext(slaves={unit: ModbusSlaveContext(hr=block, ir=ModbusSequentialDataBlock(0, [0]))}, single=False)
order, kind_of_number = sys.argv[5]
def move():
    while True:
        load = min(max(2 * (time.monotonic() % 2) - 1, 0), 1)
        words = []
        for axis, gain in enumerate((5, -4, -20)):
            value = (gain * load + random.gauss(0, 0.02)) * float(sys.argv[6]) + 0.0  # no -0.0: registers that rest are equal
            value = value if kind_of_number in "fd" else round(value)
            one = struct.unpack(">" + "H" * (struct.calcsize(kind_of_number) // 2), struct.pack(">" + kind_of_number, value))
            words += one if order == ">" else one[::-1]
        block.setValues(first + 1, words)
        time.sleep(0.01)
threading.Thread(target=move, daemon=True).start()
"""


class Identify(unittest.TestCase):
    def slave(self, number, scale=1.0, first=100):
        port = free_port()
        script = PYMODBUS.replace('if kind == "tcp":', MOVES + 'if kind == "tcp":').replace("[int(v) & 0xFFFF for v in sys.argv[5:]]", "[0]")
        slave = subprocess.Popen(["/usr/bin/python3", "-c", script, "tcp", str(port), "3", str(first), number, str(scale)],
                                 stderr=subprocess.DEVNULL)
        self.addCleanup(slave.wait)
        self.addCleanup(slave.kill)
        return f"127.0.0.1:{port}"

    def identify(self, *words, seconds=3):
        """Once the slave answers."""
        until = time.monotonic() + 20
        while True:
            done = subprocess.run([BIN / "tactilectl", "identify", *words, "--seconds", str(seconds)], capture_output=True, text=True, timeout=60)
            if "refused" not in done.stderr or time.monotonic() > until:
                return done
            time.sleep(0.2)

    def test_the_printed_keys_read_the_newtons(self):
        for number, order in ((">f", "high_first"), ("<f", "low_first")):
            address = self.slave(number)
            done = self.identify(address, "--unit", "3", "--registers", "100..105", "--name", "bus")
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            self.assertIn(f'word_order = "{order}"', done.stdout)
            self.assertIn('{name = "c3", at = 104, type = "float32"}', done.stdout)
        sensor = '\n[[sensor]]\nname = "left"\nlink = "bus"\nmodel = "generic"\ncalibration = "{folder}/unit.toml"\nstale_ms = 200\n'
        with Daemon(done.stdout + sensor) as daemon:
            (daemon.folder / "unit.toml").write_text(CALIBRATION)
            daemon.start()

            def force():
                return json.loads(daemon.ctl("status", "--json").stdout)["sensors"][0].get("force_S_N") or [0, 0, 0]
            wait_for(lambda: -21 < (force()[2] or 0) < -18, "the press of 20 N")

    def test_a_block_one_register_beside_a_double_and_a_type_of_the_manual(self):
        address = self.slave(">f")  # the slave refuses register 99
        done = self.identify(address, "--unit", "3", "--registers", "101..106", "--json")
        answer = json.loads(done.stdout)
        self.assertEqual((answer["interpretations"][0]["type"], answer["interpretations"][0]["at"] % 2), ("float32", 0), done.stdout)
        done = self.identify(self.slave("<d"), "--unit", "3", "--registers", "100..111")
        self.assertEqual(done.returncode, 1)
        self.assertIn('the registers are float64, low_first, at 100, which driver "modbus" does not read', done.stderr)
        self.assertNotIn("[[link]]", done.stdout)
        done = self.identify(self.slave(">h", 100), "--unit", "3", "--registers", "100..102", "--type", "int16")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn('{name = "c3", at = 102, type = "int16"}', done.stdout)

    def test_registers_that_rest_are_not_decided(self):
        address = self.slave(">f", 0.0)
        done = self.identify(address, "--unit", "3", "--registers", "100..105", seconds=1)
        self.assertEqual(done.returncode, 1)
        self.assertIn("press the sensor", done.stderr)
        self.assertNotIn("[[link]]", done.stdout)

    def test_a_link_of_the_configuration_with_the_wrong_order_is_corrected(self):
        address = self.slave("<f")
        with tempfile.TemporaryDirectory() as folder:
            config = pathlib.Path(folder) / "my.toml"
            config.write_text(f'[[link]]\nname = "bus"\ndriver = "modbus"\naddress = "{address}"\n[[link.slave]]\nunit = 3\n'
                              'registers = [{name = "c1", at = 100, type = "float32"}, {name = "c3", at = 104, type = "float32"}]\n')
            done = self.identify("bus", "--config", config)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            self.assertIn('word_order = "low_first"', done.stdout)

    def test_a_device_without_these_registers_and_wrong_options_are_named(self):
        address = self.slave(">f")
        done = self.identify(address, "--unit", "3", "--registers", "400..405")
        self.assertEqual(done.returncode, 1)
        self.assertIn("gives no registers from 400 on", done.stderr)
        for words in (("100",), ("105..100",), ("0..40",)):
            done = self.identify(address, "--registers", *words)
            self.assertEqual(done.returncode, 2)
            self.assertIn("such as 100..105", done.stderr)


if __name__ == "__main__":
    unittest.main()
