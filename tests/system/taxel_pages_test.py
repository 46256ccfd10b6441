"""The taxels of arrays over Modbus TCP with the release daemon, read by pymodbus and joined by the printed function block."""
import subprocess
import sys
import unittest

from daemon import BIN, ROOT, wait_for
from array_device import ArrayDevice, array_daemon
from taxel_pages import (AGE_MS, COMPONENTS, FAULT, HEADS, N_OUT, N_PAGES, N_TAXELS, NO_FORCE, NO_VALUE, PAGES, SCALE, SEQ,
                         STATUS, TOKEN, NotThere, Plc, uniform_array)

sys.path.insert(0, str(ROOT / "tests"))
from st.interpreter import Program  # noqa: E402


class Pages(unittest.TestCase):
    def setUp(self):
        self.device = uniform_array(name="skin", rows=32, columns=32)
        self.second = ArrayDevice(name="thumb", rows=6, columns=4, values=3)
        self.addCleanup(self.device.__exit__)
        self.addCleanup(self.second.__exit__)
        self.daemon = array_daemon(self.device.start(), self.second.start(), stale_ms=500)
        self.addCleanup(self.daemon.__exit__)
        self.plc = self.client()
        wait_for(lambda: all(self.plc.latch(n)[STATUS] & NO_VALUE == 0 for n in (0, 1)), "a value of both")

    def client(self):
        plc = Plc(self.daemon.port)
        self.addCleanup(plc.close)
        return plc

    def refused(self, what, *words):
        with self.assertRaises(NotThere) as caught:
            what(*words)
        return caught.exception.args[0]

    def test_each_snapshot_is_one_frame_also_beside_another_client(self):
        other, tokens, frames = self.client(), set(), set()
        for _ in range(100):
            head, values = self.plc.snapshot()
            latched = other.latch()
            self.assertEqual(len(values), 1024)
            self.assertEqual(set(values), {values[0]})
            self.assertIn(-values[0], range(20, 70))
            self.assertEqual((head[SCALE], head[N_TAXELS], head[COMPONENTS], head[N_PAGES]), (0xFFFE, 1024, 4, 9))
            self.assertLess(head[AGE_MS], 500)
            tokens |= {head[TOKEN], latched[TOKEN]}
            frames.add(head[SEQ])
        self.assertEqual(len(tokens), 200)
        self.assertGreater(len(frames), 10, "the device stood still, and nothing was shown")

    def test_the_pages_are_those_of_the_sensor_latched_last(self):
        self.second.missing = {3}
        wait_for(lambda: self.plc.latch(1)[N_OUT] == 1, "a missing taxel")
        head, values = self.plc.snapshot(1)
        self.assertEqual((head[FAULT], head[N_TAXELS], head[COMPONENTS], len(values)), (0, 24, 7, 72))
        self.assertEqual([i for i, value in enumerate(values) if value == NO_FORCE], [9, 10, 11])
        self.assertEqual(self.plc.page(0)[0], head[TOKEN])
        self.assertEqual(self.refused(self.plc.page, 1), 2)
        self.assertEqual(self.refused(self.plc.read, HEADS + SEQ, 1), 4)

    def test_a_page_needs_a_snapshot_of_its_connection(self):
        other = self.client()
        self.assertEqual(self.refused(other.page, 0), 4)
        self.assertEqual(other.latch(5)[TOKEN], 0)
        self.assertEqual(self.refused(other.page, 0), 2)
        self.assertEqual(self.refused(other.read, PAGES + 124, 2), 2)

    def test_a_snapshot_ends_with_the_value_of_its_sensor(self):
        self.plc.latch()
        self.device.is_paused = True
        self.assertEqual(self.plc.page(0)[1] < 0x8000, False)  # a press is negative

        def is_refused():
            try:
                return self.plc.page(0) is None
            except NotThere as exception:
                return exception.args[0] == 4

        wait_for(is_refused, "an exception")
        head, values = self.plc.snapshot()
        self.assertEqual((head[STATUS] & (NO_VALUE | 1), len(values), set(values)), (NO_VALUE, 1024, {NO_FORCE}))

    def test_the_function_block_joins_the_pages(self):
        text = subprocess.run([BIN / "tactilectl", "map", "--format", "st", "--values", "1024"], capture_output=True, text=True, check=True).stdout
        plc = Program(text)
        block = plc.instance("FB_TACTILED_ARRAY")
        call = {"HEAD_REGS": self.plc.latch(), "PAGE_REGS": [0] * 125, "PAGE_FROM": 0}

        def step(head=False, page=False):
            plc.now_ms += 100
            block.call(**call, HEAD_READ=head, PAGE_READ=page)
            return [block.value(name) for name in ("BUSY", "VALID", "MIXED")]

        self.assertEqual(step(head=True), [True, False, False])
        for n in range(9):
            self.assertEqual(block.value("PAGE_AT"), PAGES + 125 * n)
            if n == 4:  # the page before, which was read twice: the second edge joins nothing
                self.assertEqual(step(page=True), [True, False, False])
                self.assertEqual((step()[0], block.value("PAGE_AT")), (True, PAGES + 125 * n))
            call["PAGE_FROM"] = block.value("PAGE_AT")
            call["PAGE_REGS"] = self.plc.read(block.value("PAGE_AT"), 125)
            for _ in range(2):  # an edge, so that a page is joined once
                self.assertEqual(step(page=True), [n < 8, n == 8, False])
            step()
        force = block.value("VALUES[0]")
        self.assertTrue(-70 < force <= -20)
        self.assertEqual({block.value(f"VALUES[{i}]") for i in range(1024)}, {force})
        self.assertEqual((block.value("TAXELS"), block.value("OK")), (1024, bool(call["HEAD_REGS"][STATUS] & 1)))
        self.assertAlmostEqual(block.value("UNIT_N"), 0.01, places=6)
        self.assertEqual([step()[1] for _ in range(10)], [True] * 5 + [False] * 5, "values are valid for 0.8 s after their last page")
        call["HEAD_REGS"] = self.plc.latch()
        step(head=True)
        call["PAGE_FROM"] = PAGES
        call["PAGE_REGS"] = [call["HEAD_REGS"][TOKEN] + 1 & 0xFFFF] + [0] * 124
        self.assertEqual(step(page=True), [False, False, True])
        small = Program(text.replace("9 < PAGES", "8 < PAGES")).instance("FB_TACTILED_ARRAY")
        small.call(**call, HEAD_READ=True, PAGE_READ=False)
        self.assertEqual([small.value(name) for name in ("TOO_LONG", "BUSY", "VALID")], [True, False, False])


if __name__ == "__main__":
    unittest.main(verbosity=2)
