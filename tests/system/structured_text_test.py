#!/usr/bin/env python3
"""The text of `tactilectl map --format st`: its subset of IEC 61131-3, its SCL form, and that no value outlives its read.

    structured_text_test.py               20 simulated seconds of each task (20 s)
    PLC_S=600 structured_text_test.py     10 simulated minutes of each task (5 minutes)
"""
import os
import pathlib
import random
import re
import sys
import unittest

sys.path[:0] = [str(pathlib.Path(__file__).parent), str(pathlib.Path(__file__).resolve().parents[1])]
from plc_view import GOOD, NODE, NO_VALUE, UNCERTAIN, View, printed, program, text  # noqa: E402
from st.interpreter import Program  # noqa: E402
from st.lexer import tokens_of  # noqa: E402

SIMULATED_S = int(os.environ.get("PLC_S", "20"))
SEED = int(os.environ.get("SEED", "1"))
TIMEOUT_MS = 100  # a request is given up after this time, by the pages of the controllers
PUNCTUATION = {"(", ")", "[", "]", ":", ";", ".", "..", ","}
# matiec (IEC 61131-3, second edition) accepts none of these as a name; STruC++ and CODESYS reserve further ones.
FUNCTIONS = set("ABS ADD AND CONCAT DELETE DIV EQ EXP FIND GE GT INSERT LE LEFT LEN LIMIT LN LOG LT MAX MID MIN MOD MOVE MUL MUX NE NOT "
                "OR REPLACE RIGHT ROL ROR SEL SHL SHR SIN SQRT SUB TRUNC XOR SR RS R_TRIG F_TRIG CTU CTD CTUD TP TON TOF RTC".split())


class Subset(unittest.TestCase):
    def setUp(self):
        self.text = text()
        listed = re.search(r"subset of IEC 61131-3:(.*?)\. \*\)", self.text, flags=re.S).group(1)
        self.listed = set(re.sub(r"initial values", "", listed).replace(",", " ").split())

    def test_every_keyword_operator_type_and_function_is_listed(self):
        self.assertGreater(len(self.listed), 30)
        declared = {name.upper() for name in Program(self.text).names()}
        used = set()
        for token in tokens_of(self.text):
            if token.kind == "keyword":
                used.add(token.text)
            elif token.kind == "symbol" and token.text not in PUNCTUATION:
                used.add(token.text)
            elif token.kind == "name" and token.text not in declared | {"IN", "PT", "ET", "Q"}:  # TON has these
                used.add(token.text)
        ends = {word for word in used if word.startswith("END_")}
        self.assertEqual(sorted(used - ends - self.listed), [], "used and not listed")
        self.assertEqual(sorted(self.listed - used), [], "listed and not used")

    def test_no_name_is_a_function_or_function_block_of_the_standard(self):
        names = {name.upper() for name in Program(self.text).names()}
        self.assertEqual(names & FUNCTIONS, set())
        self.assertEqual([name for name in names if len(name) > 40], [])

    def test_a_type_and_a_variable_never_share_a_name(self):
        units = re.findall(r"^(?:TYPE|FUNCTION_BLOCK) (\w+)", self.text, flags=re.M)
        self.assertEqual(len(units), len(set(units)))
        fields = set(re.findall(r"^    (\w+) : ", self.text, flags=re.M))
        self.assertEqual(fields & set(units), set())

    def test_no_number_about_time_or_rate_has_to_be_set(self):
        self.assertEqual(re.findall(r"CALLS_PER_SECOND|CYCLE_MS", self.text), [])


class Scl(unittest.TestCase):
    """The form for TIA Portal has the same statements: without its shell it is the structured text again."""

    def setUp(self):
        self.scl = printed("--format", "scl")

    def test_without_its_shell_it_is_the_structured_text(self):
        plain = re.sub(r"\{ S7_Optimized_Access := 'TRUE' \}\n|\n*BEGIN\b|VERSION : 0\.1", "", self.scl)
        plain = re.sub(r'TYPE "(\w+)"', r"TYPE \1 :", plain).replace("#", "").replace('"', "").replace("TON_TIME", "TON")
        original = text().replace("#", "")
        arrays = dict(re.findall(r"^TYPE (\w+) : (ARRAY\[.*?\] OF \w+);\nEND_TYPE\n\n?", original, flags=re.M))
        original = re.sub(r"^TYPE \w+ : ARRAY\[.*?\] OF \w+;\nEND_TYPE\n\n?", "", original, flags=re.M)
        for name, definition in arrays.items():
            original = re.sub(rf"\b{name}\b", definition, original)
        self.assertGreater(len(arrays), 5)
        self.assertEqual(plain.split(), original.split())

    def test_each_block_and_type_is_quoted_has_a_version_and_a_body(self):
        code = re.sub(r"\(\*.*?\*\)", "", self.scl, flags=re.S)
        for unit in re.findall(r"^(?:TYPE|FUNCTION_BLOCK) .*?^END_(?:TYPE|FUNCTION_BLOCK)", code, flags=re.M | re.S):
            self.assertRegex(unit.splitlines()[0], r'^(TYPE|FUNCTION_BLOCK) "\w+"\s*$')
            self.assertEqual(unit.count("VERSION : 0.1"), 1)
            if unit.startswith("TYPE"):
                self.assertIn("STRUCT", unit, "TIA has no named arrays")
                continue
            head, body = unit.split("\nBEGIN\n")
            local = set(re.findall(r"^    (\w+) : ", head, flags=re.M))
            for prefix, name in re.findall(r"([#.\"]?)\b([A-Z]\w*)\b(?!\s*:=[^;]*?\))", body):
                self.assertFalse(name in local and prefix == "", f"{name} without # in {unit.splitlines()[0]}")
        self.assertEqual(re.findall(r"[^\"]T_TACTILED_\w+", code), [])


class Scene:
    """A controller's program: the reading call and calls at two places of use, by one clock."""

    def __init__(self):
        self.program, self.view = program(), View()
        self.map, self.sensor, self.other = (self.program.instance(f"FB_TACTILED{end}") for end in ("", "_SENSOR", "_SENSOR"))
        self.weight, self.wrench, self.node = (self.program.instance(f"FB_TACTILED_{end}") for end in ("WEIGHT", "WRENCH", "NODE"))
        self.read_ms = None  # when registers were read last
        self.registers = [0] * 125

    @property
    def now_ms(self):
        return self.program.now_ms

    def pass_ms(self, milliseconds):
        self.program.now_ms += milliseconds

    def read(self):
        self.registers, self.read_ms = self.view.answer(), self.now_ms

    def first(self, done=True):
        self.map.call(VIEW_REGS=self.registers, READ_DONE=done)

    def use(self, block=None):
        """True: the block hands out a value now."""
        block = block or self.sensor
        block.call(SENSOR=self.map.values["SENSOR"][0])
        return block.values["OK"]

    def use_all(self):
        self.use()
        self.weight.call(**{name: self.map.values[name] for name in ("NODE", "GRASP", "DOUBTS")})
        self.wrench.call(WRENCH=self.map.values["WRENCH"])
        self.node.call(NODE=self.map.values["NODE"])

    def live(self):
        for _ in range(3):
            self.read()
            self.first()
            self.use_all()
            self.pass_ms(50)
        self.read()
        self.first()
        self.use_all()
        return self


class Age(unittest.TestCase):
    """No value later than 1 s after the last good read, by the controller's clock, and none missing while reads arrive."""

    def run_task(self, period_ms, only_on_success, jitter, random_):
        """Runs healthy for SIMULATED_S, then without reads. Returns false deaths, and the time from the daemon's last answer to the last use
        of a value, at its worst: the answer travels for TIMEOUT_MS, arrives just after a cycle has begun, and a value is used at the end of
        the cycle of its call."""
        scene, deaths, last_use_ms, ready_ms, answered_ms, cycle_ms = Scene(), 0, 0, 0, 0, 0
        end_ms = SIMULATED_S * 1000
        while scene.now_ms < end_ms + 3000:
            done = ready_ms <= scene.now_ms < end_ms
            if done:  # a read takes 2 to 60 ms, and at least a cycle
                scene.read()
                answered_ms = cycle_ms - TIMEOUT_MS
                ready_ms = scene.now_ms + random_.randint(2, 60)
            if done or not only_on_success:
                scene.first(done)
            is_ok = scene.use()
            if is_ok:
                last_use_ms = scene.now_ms + min(period_ms, 100)
            cycle_ms = scene.now_ms
            deaths += not is_ok and 1000 < scene.now_ms < end_ms
            scene.pass_ms(max(1, round(period_ms * random_.uniform(1 - jitter, 1 + jitter))))
        return deaths, last_use_ms - answered_ms

    def test_tasks_of_any_period_need_no_number(self):
        for period_ms in (1, 10, 100):
            for only_on_success in (False, True):
                with self.subTest(period_ms=period_ms, only_on_success=only_on_success):
                    deaths, late_ms = self.run_task(period_ms, only_on_success, 0.3, random.Random(SEED))
                    self.assertEqual(deaths, 0)
                    self.assertTrue(500 <= late_ms <= 1000, late_ms)

    def test_whatever_is_called_whenever_no_value_outlives_its_read_by_a_second(self):
        random_, handed_out, late = random.Random(SEED), 0, 0
        for _ in range(100):
            scene, calls = Scene().live(), random_.choice(("first use", "read first use", "read use", "read first use other"))
            stays, is_new = random_.random() < 0.5, False  # READ_DONE stays TRUE, or is TRUE in one call after a read
            for _ in range(400):
                scene.pass_ms(random_.choice((0, 1, 1, 10, 100, 300, 700, 3000)))
                step = random_.choice(calls.split())
                if step == "read" and random_.random() < 0.5:
                    scene.read()
                    is_new = True
                elif step == "first":
                    scene.first(stays or is_new)
                    is_new = False
                elif step in ("use", "other") and scene.use(scene.other if step == "other" else scene.sensor):
                    handed_out += 1
                    late += scene.now_ms - scene.read_ms > 1000
        self.assertGreater(handed_out, 300)
        self.assertEqual(late, 0)

    def test_half_a_millisecond_adds_up(self):
        """A task faster than the clock counts: its calls are 0 ms apart, and 0 added for ever is 0."""
        scene = Scene().live()
        for half_ms in range(2400):
            scene.pass_ms(half_ms % 2)
            is_ok = scene.use()
        self.assertFalse(is_ok)

    def test_a_read_that_changes_nothing_or_is_torn_or_of_another_map_is_none(self):
        for spoil in ({124: 0}, {NODE: 0x4354}, {NODE + 2: 0x0209}, "same"):
            scene = Scene().live()
            for _ in range(30):
                if spoil != "same":
                    scene.read()
                    for at, word in spoil.items():
                        scene.registers[at] = word
                scene.first()
                scene.use_all()
                scene.pass_ms(40)
            self.assertFalse(scene.use(), spoil)
            self.assertFalse(scene.node.values["FRESH"])

    def test_a_first_read_may_be_old(self):
        scene = Scene()
        scene.read()
        for _ in range(20):
            scene.first()
            scene.use_all()
            self.assertEqual([scene.sensor.values["OK"], scene.node.values["FRESH"]], [False, False])
            scene.pass_ms(10)


    def test_one_instance_for_two_sensors_hands_out_nothing(self):
        scene = Scene().live()
        for _ in range(30):
            scene.read()
            scene.first()
            for n in (0, 1):
                scene.sensor.call(SENSOR=scene.map.values["SENSOR"][n])
                self.assertFalse(scene.sensor.values["OK"] and n == 1)
            scene.pass_ms(20)
        self.assertFalse(scene.sensor.values["FRESH"])


class Gates(unittest.TestCase):
    """Every word of every block is judged: without a fresh read none looks healthy."""

    def test_uncertain_and_bad_are_no_values_unless_they_are_accepted(self):
        for status, accept, has in ((GOOD, False, True), (UNCERTAIN, False, False), (UNCERTAIN, True, True), (NO_VALUE, True, False), (0, True, False)):
            scene = Scene()
            scene.sensor.call(SENSOR=scene.map.values["SENSOR"][0], ACCEPT_UNCERTAIN=accept)
            scene.wrench.call(WRENCH=scene.map.values["WRENCH"], ACCEPT_UNCERTAIN=accept)
            scene.view.judge(status)
            scene.live()
            self.assertEqual([scene.sensor.values[n] for n in ("OK", "UNCERTAIN", "HAS_FZ")], [status == GOOD, status == UNCERTAIN, has], status)
            self.assertEqual(scene.sensor.values["FZ_N"] != 0, has)
            if status in (GOOD, UNCERTAIN):
                self.assertEqual([scene.wrench.values[n] for n in ("OK", "UNCERTAIN", "HAS_FX")], [status == GOOD, status == UNCERTAIN, has])

    def test_a_weight_needs_a_stable_state_and_good_jaws(self):
        for state, jaw, ok in ((2, GOOD, True), (1, GOOD, False), (2, UNCERTAIN, False), (2, NO_VALUE, False)):
            scene = Scene()
            scene.view.weigh(state, 2500, 30)
            scene.view.judge(jaw, (1,))
            scene.live()
            self.assertEqual([scene.weight.values[n] for n in ("OK", "HAS_WEIGHT", "WEIGHT_STATE")], [ok, ok, state if jaw == GOOD else 65535])
            self.assertAlmostEqual(scene.weight.values["WEIGHT_KG"], 0.25 if ok else 0, places=6)
            self.assertEqual(scene.weight.values["GRIP_STATE"], 0 if jaw == GOOD else 65535)

    def test_one_sensor_does_not_wait_for_another(self):
        scene = Scene()
        scene.view.cells[NODE + 3] = 1
        scene.view.judge(NO_VALUE, (1,))
        scene.live()
        self.assertEqual([scene.weight.values["ALL_GOOD"], scene.sensor.values["OK"]], [True, True])

    def test_without_a_read_every_word_shows_the_worst(self):
        scene = Scene()
        scene.view.weigh(2, 2500, 30)
        scene.view.cells[NODE + 7:NODE + 10] = [0x0061, 0, 0]
        scene.live()
        self.assertEqual([scene.node.values[n] for n in ("STATUS", "FAULT", "WARN", "OK")], [0x0061, 0, 0, 3])
        self.assertTrue(scene.weight.values["OK"] and scene.wrench.values["OK"])
        scene.pass_ms(950)
        scene.first(False)
        scene.use_all()
        healthy = {}
        for block in ("sensor", "weight", "wrench", "node"):
            for name, variable in getattr(scene, block).block.variables.items():
                value = getattr(scene, block).values[name]
                if variable.section != "VAR_OUTPUT":
                    continue
                good_if_zero = variable.type == "WORD" and name not in ("OK", "CONTACT", "SENSORS")
                if value != 0 and variable.type in ("BOOL", "REAL", "INT", "DINT") or good_if_zero and value == 0:
                    healthy[f"{block}.{name}"] = value
        self.assertEqual(healthy, {})
        self.assertEqual([scene.weight.values[n] for n in ("GRIP_STATE", "WEIGHT_STATE")] + [scene.sensor.values["FAULT"]], [65535] * 3)

    def test_a_value_at_the_end_of_its_range_is_none(self):
        for word in (0x7FFF, 0x8001, 0x8000):
            scene = Scene()
            for at in (69, 94):
                scene.view.cells[at + 6] = word
            scene.view.cells[51] = word
            scene.live()
            self.assertEqual([scene.sensor.values["HAS_FZ"], scene.sensor.values["HAS_VALUE"], scene.wrench.values["HAS_FX"]], [False] * 3)
            is_not_measured = word == 0x8000  # the other components are good
            self.assertEqual([scene.sensor.values["OK"], scene.wrench.values["OK"]], [is_not_measured] * 2)

    def test_forces_are_in_counts_of_scale(self):
        for power in (-6, -4, -2, 0, 1, 5):
            scene = Scene()
            scene.view.cells[69 + 19] = power & 0xFFFF
            scene.live()
            has = power <= 1
            self.assertEqual([scene.sensor.values[n] for n in ("HAS_FZ", "HAS_F_MAG", "OK")], [has] * 3)
            self.assertAlmostEqual(scene.sensor.values["FZ_N"] / (-1234 * 10.0 ** power) if has else 1, 1, places=5)


class Further(unittest.TestCase):
    def test_each_sensor_of_a_longer_read_has_its_own_age(self):
        plc = program()
        blocks, uses = [plc.instance("FB_TACTILED_FURTHER") for _ in range(5)], [plc.instance("FB_TACTILED_SENSOR") for _ in range(5)]
        cells = [0] * 125

        def cycle(advance, seq):
            for n in advance:
                cells[25 * n:25 * n + 25] = [seq, GOOD, 0, 0, 1, 2, (n - 9) & 0xFFFF] + [0x8000] * 12 + [-2 & 0xFFFF, 0, 0, 0, 0, seq]
            for n in range(5):
                blocks[n].call(SENSOR_REGS=cells, READ_DONE=True, FIRST=5, NUMBER=5 + n)
                uses[n].call(SENSOR=blocks[n].values["SENSOR"])
            plc.now_ms += 50

        for seq in range(1, 4):
            cycle(range(5), seq)
        self.assertEqual([round(u.values["FZ_N"], 5) for u in uses], [-0.09, -0.08, -0.07, -0.06, -0.05])
        for seq in range(4, 40):
            cycle((0, 3), seq)
        self.assertEqual([u.values["OK"] for u in uses], [True, False, False, True, False])
        blocks[0].call(SENSOR_REGS=cells, READ_DONE=True, FIRST=0, NUMBER=7)
        self.assertTrue(blocks[0].values["TORN"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
