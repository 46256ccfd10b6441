"""The register map as printed: frozen, equal on all transports, and as structured text that unpacks the daemon's
registers."""
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
from unit_daemon import CONFIG as UNIT, quality_is, unit_daemon

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


class Served(unittest.TestCase):
    """A daemon with one sensor and a client of its registers."""

    def setUp(self):
        self.daemon = Daemon(CONFIG)
        self.addCleanup(self.daemon.__exit__)
        self.daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", self.daemon.folder / "table", "--format", "cobs",
                         "--bits", "32", "--counts-per-unit", "1e9", "--speed", "4", "--loop")
        self.daemon.start()
        self.client = ModbusTcpClient("127.0.0.1", port=self.daemon.port)
        self.client.connect()
        self.addCleanup(self.client.close)
        wait_for(lambda: self.read(100, 2)[1] & 0x1001 != 0, "a value")

    def read(self, at, count):
        return self.client.read_input_registers(at, count=count).registers


VIEW, VIEW_SIZE = 600, 125


class WholeReads(Served):
    """Reads that reach over several areas, and the view, which is one of copies."""

    def setUp(self):
        super().setUp()
        self.map = json.loads(printed("--json"))["rows"]

    def read_both(self, at):
        """Returns the view and the registers from `at` on, of one frame."""
        pair = []

        def of_one_frame():
            pair[:] = self.read(VIEW, VIEW_SIZE), self.read(at, 125), self.read(VIEW, VIEW_SIZE)
            return pair[0][0] == pair[2][0]

        wait_for(of_one_frame, "two reads within one frame")
        return pair[0], pair[1]

    def test_one_request_reads_a_whole_scan_of_one_frame(self):
        cells = self.read(0, 125)
        self.assertEqual(len(cells), 125)
        self.assertEqual(len({cells[at] for at in (4, 31, 40, 47, 60, 79, 80, 87, 100, 124)}), 1, "SEQ and SEQ_END")
        named = {row["address"] + i for row in self.map if row["area"] in ("global", "grasp", "command", "tool", "doubt", "sensor")
                 for i in range(row["registers"])}
        self.assertEqual([cells[at] for at in range(125) if at not in named], [0] * (125 - len([a for a in named if a < 125])))

    def test_the_view_is_of_one_frame_and_each_cell_is_that_of_its_origin(self):
        copies = [(row["address"], row["name"]) for row in self.map if row["area"] == "view" and "." in row["name"]]
        self.assertGreater(len(copies), 90)
        view, scan = self.read_both(0)
        self.assertEqual(len({view[at] for at in (0, 5, 32, 33, 40, 41, 48, 49, 68, 69, 93, 94, 118, 124)}), 1)
        ages = {7, 65, 72, 97}  # AGE_MS: the time of the request
        for at, origin, count in ((1, 0, 32), (33, 40, 8), (41, 80, 8), (49, 60, 20), (69, 100, 25)):
            for i in set(range(count)) - {age - at for age in ages}:
                if (at, i) != (1, 30):  # the worst cycle of the last second
                    self.assertEqual(view[at + i], scan[origin + i], (at, i))
        self.assertEqual(view[1:3], [0x5441, 0x4354])
        self.assertNotEqual(view[73:76], [0x8000] * 3, "a force")
        self.assertEqual(view[94 + 1] >> 15, 1, "there is no second sensor")
        self.assertEqual(view[121:124], [0, 0, 0])

    def test_every_read_function_reads_the_view(self):
        for read in (self.client.read_holding_registers, self.client.read_input_registers):
            cells = read(VIEW, count=VIEW_SIZE).registers
            self.assertEqual((len(cells), cells[0], cells[1]), (VIEW_SIZE, cells[124], 0x5441))
        self.assertEqual(self.read(VIEW + 1, 2), [0x5441, 0x4354], "a part of it")

    def test_what_holds_no_register_or_cuts_an_array_is_refused(self):
        for at, count in ((88, 12), (500, 100), (725, 100), (4990, 10), (10015, 2), (10999, 2), (23500, 1), (65535, 1)):
            self.assertEqual(self.client.read_holding_registers(at, count=count).exception_code, 2, (at, count))
        self.assertEqual(self.client.read_input_registers(4999, count=2).exception_code, 2)
        self.assertEqual(self.client.read_holding_registers(4999, count=2).registers, [0, 0])


class StructuredText(Served):
    def test_it_unpacks_what_the_daemon_serves(self):
        program = Program(printed("--format", "st", "--sensors", "2"))
        block = program.instance("FB_TACTILED")
        forces = set()
        for scan in range(100):
            time.sleep(0.02)
            node, cells = self.read(0, 32), self.read(100, 50)
            block.call(GLOBAL_REGS=node, SENSOR_REGS=cells)
            if scan < 20:  # until the heartbeat and SEQ have changed once
                continue
            self.assertTrue(block.value("VALID"), [block.value(n) for n in ("WRONG_MAP", "TORN", "DEAD")])
            self.assertEqual(block.value("NODE.SEQ"), node[4])
            self.assertEqual(block.value("NODE.STATUS"), node[7])
            for name in ("WEIGHT", "WEIGHT_G", "WEIGHT_SD", "GRIP_FORCE", "REC_GRIP"):  # there is no [grasp]
                self.assertEqual([block.value(f"NODE.{name}"), block.value(f"NODE.HAS_{name}")], [0, False], name)
            self.assertEqual(block.value("NODE.GRIP_STATE"), 0xFFFF)
            signed = struct.unpack(">25h", struct.pack(">25H", *cells[:25]))
            for name, at in (("FX_N", 4), ("FY_N", 5), ("FZ_N", 6)):
                self.assertAlmostEqual(block.value(f"SENSOR[0].{name}"), signed[at] * 0.01, places=4)
                forces.add(signed[at])
            self.assertTrue(block.value("SENSOR[0].HAS_VALUE"))
            self.assertEqual(block.value("SENSOR[0].OK"), bool(cells[1] & 1))
            self.assertFalse(block.value("SENSOR[0].HAS_TORQUE"))  # four gauges measure none
            self.assertEqual([block.value("SENSOR[0].TEMP"), block.value("SENSOR[0].HAS_TEMP")], [0, False])
            self.assertTrue(block.value("SENSOR[0].HAS_F_MAG"))
            self.assertFalse(block.value("SENSOR[1].HAS_VALUE"))  # there is no second sensor
            self.assertFalse(block.value("SENSOR[1].OK"))
        self.assertGreater(len(forces), 3, "the sensor stood still, and nothing was shown")

    def live_block(self, sensors=1):
        """Returns FB_TACTILED after a read that differed from the one before, and its inputs."""
        block = Program(printed("--format", "st", "--sensors", str(sensors))).instance("FB_TACTILED")
        node, cells = self.read(0, 32), sum((self.read(100 + 25 * n, 25) for n in range(sensors)), [])
        for n in range(sensors):
            cells[25 * n + 1] |= 1  # GOOD
        self.assertEqual(self.call(block, node, cells), [False, False, False, True, False], "a first read may be old")
        self.advance(node, cells)
        self.assertEqual(self.call(block, node, cells), [True, False, False, False, True])
        return block, node, cells

    @staticmethod
    def advance(node, cells=(), sensors=None):
        """Returns the next frame: of the global read, and of the blocks of `sensors`."""
        node[5] ^= 1
        for n in range(len(cells) // 25) if sensors is None else sensors:
            cells[25 * n] = cells[25 * n + 24] = (cells[25 * n] + 1) & 0xFFFF

    @staticmethod
    def call(block, node, cells, times=1):
        for _ in range(times):
            block.call(GLOBAL_REGS=node, SENSOR_REGS=cells, CALLS_PER_SECOND=20)
        return [block.value(n) for n in ("VALID", "WRONG_MAP", "TORN", "DEAD", "SENSOR[0].OK")]

    def test_it_sees_what_is_wrong(self):
        block, node, cells = self.live_block()

        def call(node, cells, times=1):
            return self.call(block, node, cells, times)

        self.assertEqual(call(node[1:] + [0], cells)[:2], [False, True])  # off by one
        self.assertEqual(call(node[:2] + [0x0200] + node[3:], cells)[:2], [False, True])  # another major version
        self.assertEqual(call(node[:31] + [node[31] ^ 1], cells)[2], True)
        self.assertEqual(call(node, cells[:24] + [cells[24] ^ 1])[2:], [True, False, False])
        self.assertEqual(call(node, cells, 12), [False, False, False, True, False])  # 0.6 s without a heartbeat
        self.advance(node, cells)
        self.assertEqual(call(node, cells)[0], True)

    def test_a_sensor_read_that_stands_still_is_not_ok_while_the_global_read_runs(self):
        for still in ({0}, {1}, {0, 1}):
            block, node, cells = self.live_block(2)
            node[3] = 2
            for scan in range(40):
                self.advance(node, cells, {0, 1} - still)
                self.call(block, node, cells)
                for n in (0, 1):
                    dead = n in still and scan >= 10
                    self.assertEqual([block.value(f"SENSOR[{n}].{name}") for name in ("OK", "ALIVE")], [not dead] * 2, (still, scan, n))
                    self.assertEqual(block.value(f"SENSOR[{n}].HAS_FZ"), not dead and cells[25 * n + 6] != 0x8000)
                self.assertEqual([block.value(n) for n in ("VALID", "DEAD", "GLOBAL_OK")], [scan < 10, scan >= 10, True])

    def test_each_piece_of_a_longer_read_has_its_own_liveness(self):
        block, node, cells = self.live_block(16)
        node[3] = 16
        for _ in range(20):
            self.advance(node, cells, range(5, 16))  # the first piece of 125 registers does not change
            self.call(block, node, cells)
        self.assertEqual([block.value(f"SENSOR[{n}].OK") for n in range(16)], [False] * 5 + [True] * 11)

    def test_a_component_that_is_not_there_is_not_a_zero_newton(self):
        block, node, cells = self.live_block()
        cells[4:24] = [0x8000, 0x8000, 0xFC18] + [0x8000] * 3 + [0xFFFF, 0xFFFF, 0x8000, 0x8000] + cells[14:24]
        self.advance(node, cells)
        self.assertTrue(self.call(block, node, cells)[4])
        self.assertAlmostEqual(block.value("SENSOR[0].FZ_N"), -10, places=4)
        self.assertEqual([n for n in ("FX", "FY", "FZ", "TX", "TY", "TZ", "F_TANG", "F_MAG", "COP_X", "COP_Y", "COP", "VALUE", "TORQUE")
                          if block.value(f"SENSOR[0].HAS_{n}")], ["FZ"])
        cells[4:14] = [100, 200, 300, 1, 2, 3, 224, 374, 5, 0xFFFB]
        self.advance(node, cells)
        self.call(block, node, cells)
        for name, value in (("FX_N", 1), ("FY_N", 2), ("FZ_N", 3), ("TX_NM", 0.001), ("TZ_NM", 0.003), ("F_TANG", 224),
                            ("F_MAG", 374), ("COP_X", 5), ("COP_Y", -5)):
            self.assertAlmostEqual(block.value(f"SENSOR[0].{name}"), value, places=5)
        for name in ("FX", "FY", "FZ", "TX", "TY", "TZ", "F_TANG", "F_MAG", "COP_X", "COP_Y", "COP", "VALUE", "TORQUE"):
            self.assertTrue(block.value(f"SENSOR[0].HAS_{name}"), name)

    def test_forces_are_in_counts_of_scale(self):
        block, node, cells = self.live_block()
        for power, fz_N in ((-2, -34), (-4, -0.34), (-6, -0.0034), (0, -3400), (1, -34000)):
            cells[4:7] = [1, 2, -3400 & 0xFFFF]
            cells[10:12] = [3, 3400]
            cells[19] = power & 0xFFFF
            self.advance(node, cells)
            self.call(block, node, cells)
            self.assertAlmostEqual(block.value("SENSOR[0].FZ_N") / fz_N, 1, places=5)
            self.assertAlmostEqual(block.value("SENSOR[0].UNIT_N") / 10 ** power, 1, places=5)
            self.assertEqual([block.value(f"SENSOR[0].{n}") for n in ("HAS_FX", "HAS_FZ", "HAS_F_MAG", "F_MAG")], [True, True, True, 3400])
        cells[19] = 5  # a count that this code does not know
        self.advance(node, cells)
        self.call(block, node, cells)
        self.assertEqual([block.value(f"SENSOR[0].{n}") for n in ("FZ_N", "HAS_FZ", "HAS_VALUE", "HAS_F_MAG", "F_MAG")], [0, False, False, False, 0])

    def test_a_small_sensor_has_its_own_count(self):
        config = UNIT.replace("stale_ms", "register_N = 0.0001\nstale_ms")
        with unit_daemon(rows="0,0.01,0.02,-0.34\n0.01,0.01,0.02,-0.34\n", config=config) as small:
            small.start()
            wait_for(quality_is(small, "good"), "a good sample")
            client = ModbusTcpClient("127.0.0.1", port=small.port)
            self.addCleanup(client.close)
            client.connect()
            block = Program(printed("--format", "st", "--sensors", "1")).instance("FB_TACTILED")
            for _ in range(30):
                time.sleep(0.02)
                node, cells = (client.read_input_registers(at, count=n).registers for at, n in ((0, 32), (100, 25)))
                block.call(GLOBAL_REGS=node, SENSOR_REGS=cells, CALLS_PER_SECOND=40)
            self.assertEqual(struct.unpack(">h", struct.pack(">H", cells[19]))[0], -4)
            self.assertTrue(block.value("SENSOR[0].OK"))
            for name, force_N in (("FX_N", 0.01), ("FY_N", 0.02), ("FZ_N", -0.34)):
                self.assertAlmostEqual(block.value(f"SENSOR[0].{name}"), force_N, places=6)

    def test_a_weight_has_a_flag_and_none_without_a_fresh_read(self):
        block, node, cells = self.live_block()
        node[18:23] = [250, 2, 0, 2500, 30]
        self.advance(node, cells)
        self.call(block, node, cells)
        self.assertEqual([block.value(f"NODE.{n}") for n in ("HAS_WEIGHT", "WEIGHT", "HAS_WEIGHT_G", "WEIGHT_G")], [True, 2500, True, 250])
        node[20:22] = [0xFFFF, 0xFFFF]  # -0.1 g
        self.advance(node, cells)
        self.call(block, node, cells)
        self.assertEqual([block.value("NODE.HAS_WEIGHT"), block.value("NODE.WEIGHT")], [True, -1])
        self.call(block, node, cells, 12)
        self.assertEqual([block.value("NODE.HAS_WEIGHT"), block.value("NODE.WEIGHT"), block.value("NODE.GRIP_STATE")], [False, 0, 0xFFFF])

    def test_it_unpacks_the_grasp_block(self):
        block = Program(printed("--format", "st")).instance("FB_TACTILED_GRASP")

        def call(*registers):
            block.call(GRASP_REGS=list(registers), CALLS_PER_SECOND=20)
            return [block.value(n) for n in ("VALID", "TORN", "DEAD")]

        self.assertEqual(call(6, 3, 987, 623, 50, 12, 250, 6), [False, False, True], "a first read may be old")
        self.assertEqual(block.value("GRASP.HAS_OBJECT_PROB"), False)
        self.assertEqual(call(7, 3, 987, 623, 50, 12, 250, 7), [True, False, False])
        self.assertEqual([block.value(f"GRASP.{n}") for n in ("SEQ", "OBJECT_ID", "OBJECT_PROB", "FRICTION", "FRICTION_SD", "GRASPS",
                                                             "SINCE_LIFT")], [7, 3, 987, 623, 50, 12, 250])
        self.assertEqual(call(8, 3, 987, 623, 0xFFFF, 12, 250, 8)[0], True)
        self.assertEqual([block.value("GRASP.HAS_FRICTION_SD"), block.value("GRASP.FRICTION_SD")], [False, 0])
        for _ in range(12):
            still = call(8, 3, 987, 623, 50, 12, 250, 8)
        self.assertEqual(still, [False, False, True])
        self.assertEqual([block.value("GRASP.HAS_OBJECT_ID"), block.value("GRASP.OBJECT_ID")], [False, 0])
        self.assertEqual(call(9, 0, 0, 0, 0, 0, 0, 8)[:2], [False, True])

    def test_every_bit_and_state_has_a_named_constant(self):
        block = Program(printed("--format", "st")).instance("FB_TACTILED_CONST")
        for name, value in (("STATUS_READY", 1), ("STATUS_FAULT", 0x8000), ("SENSOR_GOOD", 1), ("SENSOR_FAULT", 0x8000), ("FAULT_STORAGE", 0x40),
                            ("WARN_TARE", 16), ("REASON_ZERO_UNKNOWN", 22), ("REASON_STALE", 4), ("GRIP_HOLDING", 4), ("WEIGHT_STABLE", 2),
                            ("SLIP_GROSS", 2), ("CMD_TARE", 1), ("CMD_TEACH", 10), ("CMD_STATE_DONE", 2), ("RESULT_ADOPTED", 11),
                            ("RESULT_REPEATED", 12), ("GRIPPER_OPENING", 5), ("NOT_KNOWN", 0xFFFF)):
            self.assertEqual(block.value(name), value, name)

    def test_all_sizes_are_accepted(self):
        for sensors in (1, 5, 16):
            names = Program(printed("--format", "st", "--sensors", str(sensors))).names()
            self.assertIn("fb_tactiled", {n.lower() for n in names})


if __name__ == "__main__":
    unittest.main(verbosity=2)
