#!/usr/bin/env python3
"""Every output of the product against every way in which its data can end or become doubtful: at no instant after the limit of an output may
it show a value that looks healthy. The result is tests/faults/EDGES.md.

    /usr/bin/python3 tests/system/edges_test.py            the test; 2 min
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
from edges.outputs import FORCES, WEIGHTS  # noqa: E402
from edges.rig import NEEDED, Rig  # noqa: E402
from forged_node import REASONS, UNCERTAIN  # noqa: E402

PAGE = ROOT / "tests/faults/EDGES.md"
WINDOW_S, MIN_LOOKS = 0.5, 10  # each output is looked at for so long and so often at least, after its limit
# name, what it is about, how it begins and how it ends (methods of Rig). A part that an output does not need leaves it healthy.
CAUSES = [("sensor killed", "sensor", "kill", "bring_back"), ("sensor stopped", "sensor", "stop", "go_on"),
          ("daemon killed", "daemon", "kill", "bring_back"), ("daemon stopped", "daemon", "stop", "go_on"),
          ("daemon restarts", "daemon", "end", "bring_back"),
          ("bridge killed", "bridge", "kill", "bring_back"), ("bridge stopped", "bridge", "stop", "go_on"),
          ("broker killed", "broker", "kill", "bring_back"), ("broker stopped", "broker", "stop", "go_on"),
          ("network cut", "network", "cut", "mend")]
DOUBTS = [(word, bit, "doubt", "believe") for bit, _, word, best in REASONS if best == UNCERTAIN]
# The same of a node that holds an object. The daemon that publishes it is a part of this test.
OF_WEIGHT = [("daemon killed", "daemon", "stop_forging", "forge_on"), *(cause for cause in CAUSES if cause[1] in ("bridge", "broker", "network"))]
WEIGHT_DOUBTS = [(word, 1 << bit, "doubt_weight", "believe_weight") for bit, word in enumerate(("balance", "shares"))]
LATER, UNSURE = "later client", "UNCERTAIN"
OUTPUTS = FORCES + WEIGHTS
# Cells in which a value that looks healthy is shown today: the test fails for another one, and for one of these that no longer is.
OPEN = {}


class Matrix:
    """Runs all causes, one at a time, with all outputs beside each other. shown[output, column]: what looked healthy and when."""

    def __init__(self, rig):
        self.rig, self.shown, self.looks = rig, collections.defaultdict(list), collections.Counter()
        self.outputs = [kind(rig) for kind in FORCES]

    def run(self):
        self.causes(CAUSES)
        self.rig.forge()
        self.causes(DOUBTS, UNSURE)
        self.close()
        self.rig.hold()
        self.outputs = [kind(self.rig) for kind in WEIGHTS]
        self.causes(OF_WEIGHT)
        self.causes(WEIGHT_DOUBTS, UNSURE)

    def causes(self, causes, column=None):
        for name, part, begin, end in causes:
            outputs = [output for output in self.outputs if column or part in output.needs]
            self.until_healthy(self.outputs)
            getattr(self.rig, begin)(part)
            self.look_at(outputs, column or name, name, lambda output: output.limit_s)
            if not column or name == causes[0][0]:
                clients = [type(output)(self.rig) for output in outputs]
                self.look_at(clients, LATER, name, lambda _: 0)
                self.close(clients)
            getattr(self.rig, end)(part)

    def look_at(self, outputs, column, name, begins_s):
        """Looks at each output for WINDOW_S, and MIN_LOOKS times, from begins_s(output) on."""
        looks = collections.Counter()
        with Stopwatch() as watch:
            ends_s = max(map(begins_s, outputs)) + WINDOW_S
            while (passed_s := watch.seconds()) < ends_s or min(looks[output] for output in outputs) < MIN_LOOKS:
                for output in outputs:
                    if passed_s > begins_s(output):
                        looks[output] += 1
                        self.look(output, column, name, passed_s)
                time.sleep(0.02)

    def look(self, output, column, name, passed_s):
        self.looks[output.name, column] += 1
        if (value := output.look()) is not None:
            self.shown[output.name, column].append((name, round(passed_s, 2), value))

    def until_healthy(self, outputs):
        """Each output shows a value that looks healthy, and whose time is that of now: a blind observer would pass for a good output."""
        missing = list(outputs)

        def all_seen():
            missing[:] = [output for output in outputs if not self.is_healthy(output)]
            if missing:  # a busy machine loses the sensor for a moment, and that latches a fault
                self.rig.clear()
            return not missing
        try:
            wait_for(all_seen, "healthy values")
        except TimeoutError:
            raise TimeoutError(f"no healthy value from {[(output.name, output.why) for output in missing]}") from None

    def is_healthy(self, output):
        value = output.look()
        return value is not None and (value[1] is None or abs(time.monotonic() - value[1]) < output.limit_s)

    def close(self, outputs=None):
        for output in outputs or self.outputs:
            output.close()


def columns(kind):
    """Returns the columns that concern an output."""
    causes = OF_WEIGHT if kind in WEIGHTS else CAUSES
    return [name for name, part, *_ in causes if part in kind.needs] + [UNSURE, LATER]


def page(shown):
    """Returns the page for the cells in which something looked healthy."""
    names = [name for name, *_ in CAUSES] + [UNSURE, LATER]
    rows = ["| | limit | " + " | ".join(names) + " |", "|---" * (len(names) + 2) + "|"]
    for kind in OUTPUTS:
        cells = ["-" if name not in columns(kind) else "**shown**" if (kind.name, name) in shown else "0" for name in names]
        rows.append(f"| {kind.name} | {kind.limit_s:g} s | " + " | ".join(cells) + " |")
    return TEXT.format(table="\n".join(rows), reasons=len(DOUBTS))


TEXT = """# Edges

Each output of the product beside each way in which its data can end or become doubtful. Printed by
`tests/system/edges_test.py --page`.

* Columns: a part that is killed, stands still or is cut off; a value that becomes UNCERTAIN, for each of
  {reasons} reasons; a client that connects after that.
* 0: after its limit, no value looked healthy at any instant. **shown**: one did. -: the part is not on the
  way of the output's values. The output showed a good value before each cause.
* Limit: the age from which on a value must not look healthy; for Prometheus 1 s and a scrape interval.

{table}

Home Assistant and Prometheus are models of their use of messages and queries. The PLC runs the printed text
in an interpreter. LinuxCNC is a model of its pins and its watchdog. UNCERTAIN and weights come from a forged
segment, through the real Modbus service, bridges and readers. DDS finds its readers by multicast, which the
test cannot cut.
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
        self.assertEqual(sorted(matrix.shown.keys() - OPEN.keys()), [], "healthy-looking values")
        self.assertEqual(sorted(OPEN.keys() - matrix.shown.keys()), [], "no longer shown: remove these from OPEN")

    def test_the_page_is_what_the_test_prints(self):
        self.assertEqual(PAGE.read_text(), page(OPEN))


if __name__ == "__main__":
    unittest.main(argv=[word for word in sys.argv if word != "--page"], verbosity=2)
