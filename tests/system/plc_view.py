"""The view of a two-jaw gripper, 125 registers, as a daemon would answer it: for tests of the PLC's text without a daemon."""
import json
import subprocess
import sys

from daemon import BIN, ROOT

sys.path.insert(0, str(ROOT / "tests"))
from st.interpreter import Program  # noqa: E402

NODE, GRASP, DOUBTS, WRENCH, SENSOR = 1, 33, 41, 49, (69, 94)  # first cells of the copies in the view
GOOD, UNCERTAIN, NO_VALUE = 1, 1 << 12, 1 << 15  # bits of a sensor's STATUS
SIZE = 125


def printed(*words):
    return subprocess.run([BIN / "tactilectl", "map", *words], capture_output=True, text=True, check=True).stdout


def text():
    return printed("--format", "st")


def program():
    return Program(text())


def copies():
    """Cells of the view by area, as the map lists them."""
    return {row["area"]: row for row in json.loads(printed("--json"))["rows"]}


class View:
    """The registers of the view. Each answer() is of another frame."""

    def __init__(self, sensors=2):
        self.cells = [0] * SIZE
        self.seq = 7
        self.cells[NODE:NODE + 4] = [0x5441, 0x4354, 0x010A, sensors]
        self.cells[NODE + 17] = self.cells[NODE + 19] = 0  # open, no weight
        for at in SENSOR:
            self.cells[at + 4:at + 14] = [0, 0, -1234 & 0xFFFF, 0x8000, 0x8000, 0x8000, 0, 1234, 0x8000, 0x8000]
            self.cells[at + 19] = -2 & 0xFFFF
        self.cells[WRENCH + 2:WRENCH + 14] = [100, 0xFF9C, 300, 1, 2, 3, 10, 10, 10, 1, 1, 1]
        self.judge(GOOD)

    def judge(self, status, sensors=(0, 1)):
        """Gives sensors this STATUS, with what the daemon derives from it."""
        for n in sensors:
            self.cells[SENSOR[n] + 1] = status
        words = [self.cells[at + 1] for at in SENSOR]
        self.cells[NODE + 10] = sum(1 << n for n, word in enumerate(words) if word & GOOD)
        self.cells[WRENCH + 1] = 1 << 15 if any(w & NO_VALUE for w in words) else 1 << 8 if all(w & GOOD for w in words) else 1 << 9

    def weigh(self, state, tenths_of_gram, sd):
        self.cells[NODE + 19:NODE + 23] = [state, tenths_of_gram >> 16 & 0xFFFF, tenths_of_gram & 0xFFFF, sd]
        self.cells[NODE + 7] = 0x60 if state == 2 else 0

    def answer(self):
        self.seq = self.seq + 1 & 0xFFFF
        cells = list(self.cells)
        for at in (0, 124, NODE + 4, NODE + 31, GRASP, GRASP + 7, DOUBTS, DOUBTS + 7, WRENCH, WRENCH + 19, *(s + e for s in SENSOR for e in (0, 24))):
            cells[at] = self.seq
        return cells
