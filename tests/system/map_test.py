"""The register map as printed: frozen, equal on all transports, and as structured text that unpacks the daemon's
registers."""
import csv
import io
import json
import logging
import signal
import struct
import time
import unittest

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ConnectionException

from daemon import ROOT, Daemon, wait_for
from plc_view import printed, program
from unit_daemon import CONFIG as UNIT, quality_is, unit_daemon

logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # it reports each try to reach a killed daemon
FROZEN = ROOT / "tests/data/register_map_1.0.csv"
COLUMNS = ("kind", "address", "registers", "sensor", "name", "type", "unit", "access", "least", "most")

CONFIG = f"""
[[link]]
name = "usb0"
driver = "uart"
device = "{{folder}}/table"
baud = 921600
format = "cobs"
simulated = true

[[sensor]]
name = "table"
link = "usb0"
counts_per_unit = 1e9
model = "table"
calibration = "{ROOT}/config/calibration/table_documents.toml"
stale_ms = 1000
"""


def rows(text):
    return [tuple(row[c] for c in COLUMNS) for row in csv.DictReader(io.StringIO(text))]


class Printed(unittest.TestCase):
    def test_no_register_of_version_1_has_moved_or_changed(self):
        now = set(rows(printed("--format", "csv")))
        frozen = rows(FROZEN.read_text())
        self.assertGreater(len(frozen), 900)
        self.assertEqual([row for row in frozen if row not in now], [], "version 1.0 is a promise: a minor version only adds")

    def test_the_page_of_the_project_is_what_the_program_prints(self):
        self.assertEqual((ROOT / "node/modbus/MAP.md").read_text(), printed(), "tactilectl map > node/modbus/MAP.md")

    def test_json_and_csv_tell_the_same(self):
        of_json = {(r["area"], r["address"]) for r in json.loads(printed("--json"))["rows"]}
        first = {(r[0], int(r[1])) for r in rows(printed("--format", "csv")) if r[3] in ("", "0")}
        self.assertEqual(of_json, first)

    def test_the_manual_page_names_every_register(self):
        page = printed("--format", "man")
        self.assertTrue(page.startswith(".TH TACTILED-REGISTERS 7"))
        for row in json.loads(printed("--json"))["rows"]:
            self.assertIn(f".B {row['name']}\n", page)


class Served(unittest.TestCase):
    """A daemon with one sensor and a client of its registers."""

    def setUp(self):
        self.program = program()
        self.blocks = {end: self.program.instance(f"FB_TACTILED{end}") for end in ("", "_SENSOR", "_WEIGHT", "_WRENCH", "_NODE")}
        self.began = time.monotonic()

    def start(self, **words):
        self.daemon = unit_daemon(**words)
        self.addCleanup(self.daemon.__exit__)
        self.daemon.start()
        wait_for(quality_is(self.daemon, "good"), "a good sample")
        self.connect(self.daemon.port)

    def start_table(self):
        """A recording of a real sensor; the age of its samples is not proved, so they are uncertain."""
        self.daemon = Daemon(CONFIG)
        self.addCleanup(self.daemon.__exit__)
        self.daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", self.daemon.folder / "table", "--format", "cobs",
                         "--bits", "32", "--counts-per-unit", "1e9", "--speed", "4", "--loop")
        self.daemon.start()
        self.connect(self.daemon.port)

    def connect(self, port):
        self.client = ModbusTcpClient("127.0.0.1", port=port, timeout=1)
        self.client.connect()
        self.addCleanup(self.client.close)

    def cycle(self, accept=False):
        """One cycle of 20 ms of a PLC: the read, if there is an answer, and all calls."""
        time.sleep(0.02)
        try:
            answer = self.client.read_input_registers(600, count=125)
            is_done = not answer.isError()
        except ConnectionException:
            is_done = False
        if is_done:
            self.registers = answer.registers
        self.program.now_ms = int((time.monotonic() - self.began) * 1000)
        first = self.blocks[""]
        first.call(VIEW_REGS=self.registers, READ_DONE=is_done)
        piece = first.values
        self.blocks["_SENSOR"].call(SENSOR=piece["SENSOR"][0], ACCEPT_UNCERTAIN=accept)
        self.blocks["_WEIGHT"].call(NODE=piece["NODE"], GRASP=piece["GRASP"], DOUBTS=piece["DOUBTS"])
        self.blocks["_WRENCH"].call(WRENCH=piece["WRENCH"])
        self.blocks["_NODE"].call(NODE=piece["NODE"])

    registers = [0] * 125

    def value(self, path, block="_SENSOR"):
        return self.blocks[block].value(path)

    def until(self, block, name):
        def is_so():
            self.cycle()
            return self.value(name, block)
        wait_for(is_so, f"{name} of FB_TACTILED{block}")

    def test_it_unpacks_what_the_daemon_serves(self):
        self.start_table()
        self.until("_SENSOR", "UNCERTAIN")
        forces = set()
        for _ in range(60):
            self.cycle(accept=True)
            node, cells = self.registers[1:33], self.registers[69:94]
            self.assertTrue(self.value("FRESH", "_NODE"))
            self.assertEqual([self.value(n, "_NODE") for n in ("STATUS", "FAULT", "OK", "N_SENSORS")], [node[7], node[8], node[10], 1])
            self.assertEqual([self.value(n, "_WEIGHT") for n in ("WEIGHT_KG", "HAS_WEIGHT", "GRIP_STATE", "OK")], [0, False, 0xFFFF, False])
            self.assertEqual([self.value(n, "_WRENCH") for n in ("OK", "FX_N", "STATUS")], [False, 0, self.registers[50]])
            signed = struct.unpack(">25h", struct.pack(">25H", *cells))
            if self.value("HAS_VALUE"):
                for name, at in (("FX_N", 4), ("FY_N", 5), ("FZ_N", 6)):
                    self.assertAlmostEqual(self.value(name), signed[at] * 0.01, places=4)
                    forces.add(signed[at])
            self.assertEqual([self.value("OK"), self.value("UNCERTAIN")], [bool(cells[1] & 1), bool(cells[1] >> 12 & 1)])
            self.assertFalse(self.value("HAS_TORQUE"))  # four gauges measure none
            self.assertEqual([self.value("TEMP_C"), self.value("HAS_TEMP")], [0, False])
        self.assertGreater(len(forces), 3, "the sensor stood still, and nothing was shown")

    def test_a_silent_sensor_leaves_the_state_of_the_node(self):
        self.start()
        self.until("_SENSOR", "OK")
        self.daemon.others[-1].kill()
        wait_for(lambda: self.cycle() or self.value("FAULT") != 0, "the fault of the sensor")
        for _ in range(100):
            self.cycle()
            self.assertTrue(self.value("FRESH", "_NODE"), "the node is there without its sensors")
            self.assertEqual([self.value(n) for n in ("OK", "HAS_FZ", "FZ_N")], [False, False, 0])

    def test_the_end_of_the_daemon_ends_every_value(self):
        self.start()
        for end in (signal.SIGSTOP, signal.SIGKILL):
            self.until("_SENSOR", "OK")
            self.daemon.process.send_signal(end)
            ended = time.monotonic()
            while self.value("OK"):
                self.cycle()
            self.assertLess(time.monotonic() - ended, 3)  # the client waits 1 s for an answer
            self.assertEqual([self.value(n, b) for b, n in (("_NODE", "FRESH"), ("_NODE", "OK"), ("_NODE", "FAULT"), ("_SENSOR", "FZ_N"))], [False, 0, 0xFFFF, 0])
            self.daemon.process.send_signal(signal.SIGCONT)

    def test_a_small_sensor_has_its_own_count(self):
        config = UNIT.replace("stale_ms", "register_N = 0.0001\nstale_ms")
        self.start(rows="0,0.01,0.02,-0.34\n0.01,0.01,0.02,-0.34\n", config=config)
        self.until("_SENSOR", "OK")
        for name, force_N in (("FX_N", 0.01), ("FY_N", 0.02), ("FZ_N", -0.34)):
            self.assertAlmostEqual(self.value(name), force_N, places=6)

    def test_every_bit_and_state_has_a_named_constant(self):
        block = self.program.instance("FB_TACTILED_CONST")
        for name, value in (("STATUS_READY", 1), ("STATUS_FAULT", 0x8000), ("SENSOR_GOOD", 1), ("SENSOR_FAULT", 0x8000), ("FAULT_STORAGE", 0x40),
                            ("WARN_TARE", 16), ("REASON_ZERO_UNKNOWN", 22), ("REASON_STALE", 4), ("GRIP_HOLDING", 4), ("WEIGHT_STABLE", 2),
                            ("SLIP_GROSS", 2), ("CMD_TARE", 1), ("CMD_TEACH", 10), ("CMD_STATE_DONE", 2), ("RESULT_ADOPTED", 11),
                            ("RESULT_REPEATED", 12), ("GRIPPER_OPENING", 5), ("NOT_KNOWN", 0xFFFF)):
            self.assertEqual(block.value(name), value, name)


if __name__ == "__main__":
    unittest.main(verbosity=2)
