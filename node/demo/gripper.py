"""The simulated gripper of the demo: the physics of the gripper in the tests (tests/system/pick_bench.py), with
faults that keys switch on."""
import collections
import pathlib
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/system"))
import pick_bench  # noqa: E402
from arduino import Echo, line  # noqa: E402

DELAY_s = 0.6

FAULTS = {  # key: name, effect
    "u": ("unplug", "the left jaw's cable is pulled"),
    "f": ("frozen", "a channel of the left jaw repeats its last number"),
    "d": ("delayed", f"the left jaw's bytes arrive {DELAY_s} s late"),
    "j": ("dead jaw", "the left jaw measures no load"),
}


class DemoSkin:
    """The skin of the tests, with lines that have a clock, with the answers to the daemon's requests, and with faults."""

    def __init__(self, skin):
        self.skin, self.fault, self.held, self.began = skin, "", None, time.monotonic()
        self.echo = None
        self.late = collections.deque()

    def begin(self, method):
        self.skin.begin(method)

    def __setattr__(self, name, value):
        if name == "noise_random":
            self.skin.noise_random = value
        else:
            object.__setattr__(self, name, value)

    def read(self, load):
        values = self.skin.read({c: 0.0 for c in load} if self.fault == "j" else load)
        if self.fault == "f":
            values[0] = self.held = values[0] if self.held is None else self.held
        else:
            self.held = None
        return values

    def time_us(self, of_monotonic_us=None):
        now_us = time.monotonic() * 1e6 if of_monotonic_us is None else of_monotonic_us
        return int(now_us - self.began * 1e6) & 0xFFFFFFFF

    def frame(self, sequence, channels, time_us):
        answers, now = self.echo.answers(), time.monotonic()
        cells = [sequence, self.time_us(time_us), *(round(value * self.skin.counts_per_unit) for value in channels)]
        frame = line(",".join(map(str, cells)))
        self.late.append((now + (DELAY_s if self.fault == "d" else 0), answers + frame))
        out = b""
        while self.late and self.late[0][0] <= now:
            out += self.late.popleft()[1]
        return out


class Gripper(pick_bench.Robot):
    def __init__(self, folder, seed):
        original = pick_bench.SENSORS["skin"]
        pick_bench.SENSORS["skin"] = lambda: DemoSkin(original())
        try:
            super().__init__(folder, seed)
        finally:
            pick_bench.SENSORS["skin"] = original
        for name, skin in self.skins.items():
            skin.echo = Echo(self.master[name], skin.time_us)

    def inject(self, key):
        """Switches the fault of a key on, or with "r" every fault off."""
        self.skins["left"].fault = key if key in FAULTS else ""
        self.silent = {"left"} if key == "u" else set()
