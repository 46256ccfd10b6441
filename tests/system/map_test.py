"""The register map as printed: frozen, the same everywhere, and as structured text that unpacks what the daemon serves."""
import csv
import io
import json
import struct
import subprocess
import sys
import time
import unittest

from pymodbus.client import ModbusTcpClient

from daemon import BIN, ROOT, Daemon, wait_for

sys.path.insert(0, str(ROOT / "tests"))
from st.interpreter import Program  # noqa: E402

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


def printed(*words):
    return subprocess.run([BIN / "tactilectl", "map", *words], capture_output=True, text=True, check=True).stdout


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


class StructuredText(unittest.TestCase):
    def setUp(self):
        self.daemon = Daemon(CONFIG)
        self.addCleanup(self.daemon.__exit__)
        self.daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", self.daemon.folder / "table", "--format", "cobs",
                         "--bits", "32", "--counts-per-unit", "1e9", "--speed", "4", "--loop")
        self.daemon.start()
        self.client = ModbusTcpClient("127.0.0.1", port=self.daemon.port)
        self.client.connect()
        self.addCleanup(self.client.close)
        wait_for(lambda: self.read(100, 2)[1] & 0x1001 != 0, 10, "a value")

    def read(self, at, count):
        return self.client.read_input_registers(at, count=count).registers

    def test_it_unpacks_what_the_daemon_serves(self):
        program = Program(printed("--format", "st", "--sensors", "2"))
        block = program.instance("FB_TACTILED")
        forces = set()
        for _ in range(100):
            time.sleep(0.02)
            node, cells = self.read(0, 32), self.read(100, 50)
            block.call(GLOBAL_REGS=node, SENSOR_REGS=cells)
            self.assertTrue(block.value("VALID"), [block.value(n) for n in ("WRONG_MAP", "TORN", "DEAD")])
            self.assertEqual(block.value("NODE.SEQ"), node[4])
            self.assertEqual(block.value("NODE.STATUS"), node[7])
            self.assertEqual(block.value("NODE.WEIGHT"), -2**31)  # not available
            signed = struct.unpack(">25h", struct.pack(">25H", *cells[:25]))
            for name, at in (("FX_N", 4), ("FY_N", 5), ("FZ_N", 6)):
                self.assertAlmostEqual(block.value(f"SENSOR[0].{name}"), signed[at] * 0.01, places=4)
                forces.add(signed[at])
            self.assertTrue(block.value("SENSOR[0].HAS_VALUE"))
            self.assertEqual(block.value("SENSOR[0].OK"), bool(cells[1] & 1))
            self.assertFalse(block.value("SENSOR[0].HAS_TORQUE"))  # four gauges see none
            self.assertEqual(block.value("SENSOR[0].TEMP"), -32768)
            self.assertFalse(block.value("SENSOR[1].HAS_VALUE"))  # there is no second sensor
            self.assertFalse(block.value("SENSOR[1].OK"))
        self.assertGreater(len(forces), 3, "the sensor stood still, and nothing was shown")

    def test_it_sees_what_is_wrong(self):
        block = Program(printed("--format", "st", "--sensors", "1")).instance("FB_TACTILED")
        node, cells = self.read(0, 32), self.read(100, 25)
        cells[1] |= 1  # as if GOOD

        def call(node, cells, times=1):
            for _ in range(times):
                block.call(GLOBAL_REGS=node, SENSOR_REGS=cells, CALLS_PER_SECOND=20)
            return [block.value(n) for n in ("VALID", "WRONG_MAP", "TORN", "DEAD", "SENSOR[0].OK")]

        self.assertEqual(call(node, cells), [True, False, False, False, True])
        self.assertEqual(call(node[1:] + [0], cells)[:2], [False, True])  # off by one
        self.assertEqual(call(node[:2] + [0x0200] + node[3:], cells)[:2], [False, True])  # another major version
        self.assertEqual(call(node[:31] + [node[31] ^ 1], cells)[2], True)
        self.assertEqual(call(node, cells[:24] + [cells[24] ^ 1])[2:], [True, False, False])
        self.assertEqual(call(node, cells, 12), [False, False, False, True, False])  # 0.6 s without a beat
        node[5] ^= 1
        self.assertEqual(call(node, cells)[0], True)
        cells[4] = 0x8000
        call(node, cells)
        self.assertFalse(block.value("SENSOR[0].HAS_VALUE"))
        self.assertEqual(block.value("SENSOR[0].FX_N"), 0.0)

    def test_it_unpacks_the_grasp_block(self):
        block = Program(printed("--format", "st")).instance("FB_TACTILED_GRASP")
        block.call(GRASP_REGS=[7, 3, 987, 623, 50, 12, 250, 7])
        self.assertEqual([block.value(f"GRASP.{n}") for n in ("SEQ", "OBJECT_ID", "OBJECT_PROB", "FRICTION", "FRICTION_SD", "GRASPS",
                                                             "SINCE_LIFT")], [7, 3, 987, 623, 50, 12, 250])
        self.assertFalse(block.value("TORN"))
        block.call(GRASP_REGS=self.read(40, 8))
        self.assertEqual(block.value("GRASP.OBJECT_PROB"), 0xFFFF)  # no [grasp] here
        block.call(GRASP_REGS=[7, 0, 0, 0, 0, 0, 0, 8])
        self.assertTrue(block.value("TORN"))

    def test_all_sizes_are_accepted(self):
        for sensors in (1, 5, 16):
            names = Program(printed("--format", "st", "--sensors", str(sensors))).names()
            self.assertIn("fb_tactiled", {n.lower() for n in names})


if __name__ == "__main__":
    unittest.main(verbosity=2)
