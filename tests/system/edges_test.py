#!/usr/bin/env python3
"""Every output of the product against every way in which its data can end or become doubtful: at no instant after the limit of an output may
it show a value that looks healthy. The result is tests/faults/EDGES.md.

    /usr/bin/python3 tests/system/edges_test.py            the test; 4 min
    /usr/bin/python3 tests/system/edges_test.py --page     writes the page"""
import collections
import pathlib
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "node/python"))
sys.dont_write_bytecode = True
from daemon import ROOT, Stopwatch, wait_for  # noqa: E402
from edges.outputs import FORCES, GRASPS, TOOLS, WEIGHTS  # noqa: E402
from edges.rig import NEEDED, Rig  # noqa: E402
from forged_node import REASONS, UNCERTAIN  # noqa: E402
from python_reader import LAYOUT  # noqa: E402

PAGE = ROOT / "tests/faults/EDGES.md"
WINDOW_S, MIN_LOOKS = 0.5, 10  # each output is looked at for so long and so often at least, after its limit
STANDS_S = 3  # a reader stands still for so long: longer than each limit
# name, what it is about, how it begins and how it ends (methods of Rig). A part that an output does not need leaves it healthy.
CAUSES = [("sensor killed", "sensor", "kill", "bring_back"), ("sensor stopped", "sensor", "stop", "go_on"),
          ("daemon killed", "daemon", "kill", "bring_back"), ("daemon stopped", "daemon", "stop", "go_on"),
          ("daemon restarts", "daemon", "end", "bring_back"),
          ("bridge killed", "bridge", "kill", "bring_back"), ("bridge stopped", "bridge", "stop", "go_on"),
          ("broker killed", "broker", "kill", "bring_back"), ("broker stopped", "broker", "stop", "go_on"),
          ("network cut", "network", "cut", "mend")]
DOUBTS = [(word, bit, "doubt", "believe") for bit, _, word, best in REASONS if best == UNCERTAIN]
# A node whose values tell their time: each old value is found as soon as the part goes on.
GOING_ON = [cause for cause in CAUSES if cause[1] in ("bridge", "broker", "network") and cause[2] != "kill"]
# The same of a node that holds an object. The daemon that publishes it is a part of this test.
OF_HAND = [("daemon killed", "daemon", "stop_forging", "forge_on"), *(cause for cause in CAUSES if cause[1] in ("bridge", "broker", "network"))]
STATE_ALONE = [("estimating", 0, "doubt_weight", "believe_weight")]
WEIGHT_DOUBTS = STATE_ALONE + [(word, bit, "doubt_weight", "believe_weight") for word, bit in LAYOUT.enums["weight_doubt"].items()]
JAW_DOUBTS = [(DOUBTS[0][0], DOUBTS[0][1], "doubt", "believe_weight")]
TOOL_DOUBTS = [("doubted", 0, "doubt_tool", "believe_tool")]
LATER, UNSURE, JAW, READER = "later client", "UNCERTAIN", "UNCERTAIN jaw", "reader stopped"
HAND = WEIGHTS + GRASPS + TOOLS
OUTPUTS = FORCES + HAND
# Cells in which a value that looks healthy is shown today: the test fails for another one, and for one of these that no longer is.
# A client that stands still finds records or messages of that time in its socket, and neither has a field for its end.
OPEN = {("RDT", READER), ("DDS", READER), ("DDS, wrench on the gripper", READER)}


class Matrix:
    """Runs all causes, one at a time, with all outputs beside each other. shown[output, column]: what looked healthy and when."""

    def __init__(self, rig):
        self.rig, self.shown, self.looks = rig, collections.defaultdict(list), collections.Counter()
        self.outputs = [kind(rig) for kind in FORCES]

    def run(self):
        self.causes(CAUSES)
        self.rig.forge()
        self.causes(GOING_ON)
        self.stop_readers()
        self.causes(DOUBTS, UNSURE)
        self.close()
        self.rig.hold()
        self.outputs = [kind(self.rig) for kind in HAND]
        self.causes(OF_HAND)
        self.stop_readers()
        self.causes(JAW_DOUBTS, JAW, WEIGHTS + GRASPS)
        self.causes(WEIGHT_DOUBTS, UNSURE, WEIGHTS)
        self.causes(TOOL_DOUBTS, UNSURE, TOOLS)

    def causes(self, causes, column=None, kinds=OUTPUTS):
        for name, part, begin, end in causes:
            outputs = [output for output in self.outputs if type(output) in kinds and (column or part in output.needs)]
            self.until_healthy(outputs)
            getattr(self.rig, begin)(part)
            self.look_at(outputs, column or name, name, lambda output: output.limit_s)
            if not column or name == causes[0][0]:
                clients = [type(output)(self.rig) for output in outputs]
                self.look_at(clients, LATER, name, lambda _: 0)
                self.close(clients)
            getattr(self.rig, end)(part)
            if not column:  # no part stood still and kept old values
                self.look_at(outputs, name, f"{name}, then {end}", lambda _: 0, is_over=True)

    def stop_readers(self):
        """The readers stand still, and go on with what has come to them meanwhile."""
        outputs = [output for output in self.outputs if output.stands]
        self.until_healthy(outputs)
        for output in outputs:
            output.halt()
        time.sleep(STANDS_S)
        for output in outputs:
            output.go_on()
        with Stopwatch() as watch:
            began_s = time.monotonic()
            self.look_at(outputs, READER, READER, lambda _: 0, is_over=True)
            late_s = time.monotonic() - began_s - watch.seconds()
        for output in outputs:  # also the values that were used between two looks
            for value, age_s in output.used:
                if age_s > output.limit_s + late_s:
                    self.shown[output.name, READER].append((READER, 0, value, round(age_s, 2)))

    def look_at(self, outputs, column, name, begins_s, is_over=False):
        """Looks at each output for WINDOW_S, and MIN_LOOKS times, from begins_s(output) on. `is_over`: the cause is; new values are shown again."""
        looks = collections.Counter()
        with Stopwatch() as watch:
            began_s, ends_s = time.monotonic(), max(map(begins_s, outputs)) + WINDOW_S
            while (passed_s := watch.seconds()) < ends_s or min(looks[output] for output in outputs) < MIN_LOOKS:
                late_s = time.monotonic() - began_s - passed_s  # by the load of this machine
                for output in outputs:
                    if passed_s >= begins_s(output):
                        looks[output] += 1
                        self.looks[output.name, column] += 1
                        value = output.look()
                        if value is not None and not (is_over and self.is_new(output, value, late_s)):
                            self.shown[output.name, column].append((name, round(passed_s, 2), value, value[1] and round(time.monotonic() - value[1], 2)))
                time.sleep(0.005 if is_over else 0.02)

    @staticmethod
    def is_new(output, value, late_s=0.0):
        return value[1] is None or abs(time.monotonic() - value[1]) < output.limit_s + late_s

    def until_healthy(self, outputs):
        """Each output shows a value that looks healthy, and whose time is that of now: a blind observer would pass for a good output."""
        missing = list(outputs)

        def all_seen():
            missing[:] = [output for output in missing if not self.is_healthy(output)]  # each at its time: a busy machine delays one and another
            if missing:  # a busy machine loses the sensor for a moment, and that latches a fault
                self.rig.clear()
            return not missing
        try:
            wait_for(all_seen, "healthy values")
        except TimeoutError:
            raise TimeoutError(f"no healthy value from {[(output.name, output.why) for output in missing]}") from None

    def is_healthy(self, output):
        value = output.look()
        return value is not None and self.is_new(output, value)

    def close(self, outputs=None):
        for output in outputs or self.outputs:
            output.close()


def columns(kind):
    """Returns the columns that concern an output."""
    causes = OF_HAND if kind in HAND else CAUSES
    names = [name for name, part, *_ in causes if part in kind.needs] + [LATER]
    return names + [READER] * kind.stands + [UNSURE] * (kind not in GRASPS) + [JAW] * (kind in WEIGHTS + GRASPS)


def page(shown):
    """Returns the page for the cells in which something looked healthy."""
    names = [name for name, *_ in CAUSES] + [READER, UNSURE, JAW, LATER]
    rows = ["| | limit | " + " | ".join(names) + " |", "|---" * (len(names) + 2) + "|"]
    for kind in OUTPUTS:
        cells = ["-" if name not in columns(kind) else "**shown**" if (kind.name, name) in shown else "0" for name in names]
        rows.append(f"| {kind.name} | {kind.limit_s:g} s | " + " | ".join(cells) + " |")
    return TEXT.format(table="\n".join(rows), reasons=len(DOUBTS), doubts=len(WEIGHT_DOUBTS) - 1, stands=STANDS_S, window=WINDOW_S)


TEXT = """# Edges

Each output of the product beside each way in which its data can end or become doubtful. Printed by
`tests/system/edges_test.py --page`.

* Columns: a part is killed, stands still or is cut off. The program of the reader stands still for
  {stands:g} s and goes on. UNCERTAIN: a force for each of {reasons} reasons, a weight by its state alone and
  by each of {doubts} doubts alone, the wrench on the gripper by its quality. A jaw is UNCERTAIN while an object
  is held. A client connects after the cause.
* 0: in each look, no value looked healthy from the limit on. **shown**: one did. -: the column does not
  concern the output. The test looks at each output for {window:g} s after its limit, and again as soon as the
  part goes on or is back, where a value that tells its time must not be older than the limit. Each output
  showed a good value before each cause.
* Limit: the age from which on a value must not look healthy; for Prometheus 1 s and a scrape interval.

{table}

A client of RDT or an ordinary subscription of ROS 2 that stood still finds old records in the buffer of its
own socket. RDT has no time in a record; a wrench of ROS 2 has `header.stamp`, which the model does not
compare.

These are models: the use of messages by Home Assistant and of queries by Prometheus, the pins and the
watchdog of LinuxCNC, and the page's judgement of a frame. The PLC runs the printed text in an interpreter.

The values of a device have no time in RDT, Home Assistant and Prometheus. The test therefore stops a bridge,
a broker and the network again with a forged segment, whose values are their time. The columns UNCERTAIN, jaw
and reader, and all rows of weight, grasp and wrench on the gripper, come from it, through the real Modbus
service, bridges and readers.

The broker begins with the retained messages of an earlier version of the bridge. The test stops no
Prometheus, and no reader of pins or of single requests. DDS finds its readers by multicast, which the test
cannot cut.
"""


@unittest.skipIf([p for p in NEEDED if not p.exists()], f"missing: {[p.name for p in NEEDED if not p.exists()]}")
class Edges(unittest.TestCase):
    def test_no_output_shows_a_healthy_value_that_is_not(self):
        rig = Rig()
        self.addCleanup(rig.close)
        matrix = Matrix(rig)
        self.addCleanup(matrix.close)
        began_s = time.monotonic()
        matrix.run()
        looks = sum(matrix.looks.values())
        print(f"\n{len(matrix.looks)} cells, {len(matrix.shown)} with healthy-looking values, {looks} looks in {time.monotonic() - began_s:.0f} s")
        for (output, column), values in sorted(matrix.shown.items()):
            names = sorted({name for name, *_ in values})
            print(f"{output} / {column}: {len(values)} of {matrix.looks[output, column]} looks healthy: {', '.join(names)}; first {values[0][1:]}")
        self.assertEqual({(kind.name, column) for kind in OUTPUTS for column in columns(kind)} - matrix.looks.keys(), set())
        if "--page" in sys.argv:
            PAGE.write_text(page(matrix.shown))
        self.assertEqual(sorted(matrix.shown.keys() - OPEN), [], "healthy-looking values")
        self.assertEqual(sorted(OPEN - matrix.shown.keys()), [], "no longer shown: remove these from OPEN")

    def test_the_page_is_what_the_test_prints(self):
        self.assertEqual(PAGE.read_text(), page(OPEN), "write it anew: edges_test.py --page")


if __name__ == "__main__":
    unittest.main(argv=[word for word in sys.argv if word != "--page"], verbosity=2)
