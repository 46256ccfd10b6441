#!/usr/bin/env python3
"""The demo of node/run.sh: a simulated gripper picks, weighs and sorts objects as a PLC commands it, beside a recorded real skin.

    demo.py FOLDER PORT            FOLDER has the ports of the jaws; without a terminal, it prints a line a pick and ends after three
    PICKS=N                        the same after N
    HOLD=SECONDS                   holds the last object of PICKS so long
    PICTURE=FILE.svg               draws the live view while the last object of PICKS is held
"""
import collections
import html
import os
import pathlib
import random
import re
import select
import shlex
import sys
import termios
import threading
import time
import tty

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
import tactiled  # noqa: E402
from gripper import FAULTS, Gripper  # noqa: E402
from plc import NotSeen, Plc  # noqa: E402

BINS = {"A": 0.12, "B": 0.21, "C": 0.34}  # kg
GRIP_STATES = ["open", "contact", "grasped", "lifting", "holding", "slipping", "lost"]
WEIGHT_STATES = ["none", "estimating", "stable", "overload", "not observable", "temperature"]
PAUSED = "paused with open jaws, so that a tare succeeds: tactilectl tare left; p goes on"
HELD = "held, so that a known weight succeeds: tactilectl weigh known {:.4f}; h goes on"
QUALITY = {tactiled.GOOD: ("GOOD", 32), tactiled.UNCERTAIN: ("UNCERTAIN", 33), tactiled.BAD: ("BAD", 31)}
JAWS = ("left", "right")
FULL_N, BAR = 10.0, 16
WIDTH = 80  # columns of a plain terminal
COLOUR = "PICTURE" in os.environ or sys.stdout.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM", "dumb") != "dumb"


def number_of(name):
    """Returns the number in an environment variable, 0 if there is none."""
    text = os.environ.get(name) or "0"
    try:
        return float(text)
    except ValueError:
        sys.exit(f'demo: {name}={text} is no number; write, for example, {name}=10')


class Task(threading.Thread):
    """Picks until it is ended. `done` has the last action, `right` and `wrong` count the results."""

    def __init__(self, gripper, port, picks, say):
        super().__init__(daemon=True)
        self.plc, self.node = Plc(port, self.note_doubts), tactiled.open("gripper")
        self.gripper, self.picks, self.say = gripper, picks, say
        self.doubts = collections.Counter()  # jaw with its reasons: seconds within this step
        self.random, self.number, self.right, self.wrong, self.failed = random.Random(11), 0, 0, 0, 0
        self.true_kg, self.done, self.failure = 0.0, "", None
        self.held = lambda: None  # called while a weighed object is held
        self.pause, self.paused = False, False  # asked for by a key; between two picks, with open jaws
        self.hold, self.holds = False, False    # asked for by a key; the object of this pick, once it is weighed
        self.hold_s = number_of("HOLD")

    def run(self):
        try:
            while not self.plc.ended.is_set() and (self.picks == 0 or self.number < self.picks):
                self.paused = self.pause
                if self.paused:  # the PLC still scans, as its watchdog demands
                    self.plc.scan()
                    time.sleep(0.05)
                    continue
                self.number += 1
                self.one()
        except OSError as failure:
            if not self.plc.ended.is_set():
                self.failure = failure

    def one(self):
        place = self.random.choice(sorted(BINS))
        self.true_kg = BINS[place] * self.random.uniform(0.97, 1.03)
        self.gripper.offer(self.true_kg)
        time.sleep(0.3)
        try:
            seen = self.plc.pick(self.gripper)
            chosen = min(BINS, key=lambda name: abs(BINS[name] - seen["kg"]))
            right = chosen == place
            self.right, self.wrong = self.right + right, self.wrong + (not right)
            self.done = (f"pick {self.number}: {seen['kg']:.4f} +- {seen['sd_kg']:.4f} kg, true weight {self.true_kg:.4f} kg, "
                         f"bin {chosen}: {'right' if right else 'WRONG'}")
            self.held()
            self.keep(0.5)
        except NotSeen as late:
            if self.plc.ended.is_set():
                self.number -= 1
                return
            self.failed += 1
            self.done = f"pick {self.number} given up: no {late.args[0]}: {self.cause(late.args[1])}"
        self.plc.release(self.gripper)
        self.say(self.done)

    def note_doubts(self, seconds):
        if seconds is None:
            self.doubts.clear()
            return
        for name in JAWS:
            sample = self.node.latest(name)
            if sample.quality != tactiled.GOOD:
                self.doubts[" ".join((name, QUALITY[sample.quality][0], *sample.reasons_text))] += seconds

    def cause(self, seen):
        """Returns what kept a step of the pick from happening; `seen`: the last scan."""
        state = f"grip {state_of(GRIP_STATES, seen['grip'])}, weight {state_of(WEIGHT_STATES, seen['weight'])}"
        return ", ".join([state, *(f"{doubt} {seconds:.1f} s" for doubt, seconds in self.doubts.most_common(1))])

    def keep(self, seconds):
        """Holds the object for this time, for HOLD seconds if it is the last one, and as long as the key says so."""
        if self.number == self.picks and self.hold_s > 0:
            seconds = self.hold_s
            self.say(f"pick {self.number}: {self.true_kg:.4f} kg are held for {seconds:g} s")
        until = time.monotonic() + seconds
        while (self.hold or time.monotonic() < until) and not self.plc.ended.is_set():
            self.holds = self.hold
            self.plc.scan()
            time.sleep(0.05)
        self.holds = False


def state_of(names, number):
    return names[number] if number < len(names) else "unknown"


def paint(text, colour):
    return f"\x1b[{colour}m{text}\x1b[0m" if COLOUR else text


def force_line(name, sample):
    force = sample.force_S_N
    word, colour = QUALITY.get(sample.quality, ("NO VALUE", 31))
    known = sample.quality in (tactiled.GOOD, tactiled.UNCERTAIN)
    press = max(0.0, -force[2]) if known else 0.0
    filled = min(BAR, round(BAR * press / FULL_N))
    bar = "#" * filled + "." * (BAR - filled) if press <= FULL_N else "#" * (BAR - 1) + ">"
    numbers = "".join(f"{f:8.2f}" if known and f == f else "       -" for f in force)
    reasons = " ".join(sample.reasons_text)
    contact = "contact" if known and press > 0.5 else ""
    return f"{name:<6} {bar} {numbers} {contact:<7} {paint(word, colour)} {reasons}"


def cropped(line, width):
    """Returns the line without what is beyond `width` columns; colours take none."""
    out, column = "", 0
    for part in re.split("(\x1b\\[\\d*m)", line):
        if not part.startswith("\x1b"):
            part = part[:max(0, width - column)]
            column += len(part)
        out += part
    return out


def screen(node, task, fault, port):
    record, samples = node.snapshot()
    g = record.grasp
    grip = state_of(GRIP_STATES, g.state)
    weight = f"{g.weight_kg:.4f} +- {g.weight_sd_kg:.4f} kg" if g.weight_kg == g.weight_kg else "-"
    lines = ["tactiled: a pick task through Modbus. Gripper: simulated; skin: real, recorded.", "",
             f"{'':<6} {'press 0 .. 10 N':<{BAR}} {'fx/N':>8}{'fy/N':>8}{'fz/N':>8}  - no value, or not measured"]
    lines += [force_line(name, sample) for name, sample in samples.items()]
    lines += ["", f"grip {grip:<9} weight {weight:<20} {state_of(WEIGHT_STATES, g.weight_state):<14} true {task.true_kg:.4f} kg",
              PAUSED if task.paused else HELD.format(task.true_kg) if task.holds else task.done, f"sorted: {task.right} right, {task.wrong} wrong, {task.failed} given up", "",
              "key " + "  ".join(f"{key} {name}" for key, (name, _) in FAULTS.items()) + "  r repair  p pause  h hold  q quit",
              paint(f"fault: {FAULTS[fault][1]}", 31) if fault else "fault: none", "",
              "In another terminal: build/release/bin/tactilectl status, or read left --follow,",
              f"or as a PLC: mbpoll -m tcp -p {port} -t 3:hex -0 -r 0 -c 32 -1 127.0.0.1"]
    folder = os.environ.get("TACTILED_RUNTIME_DIR")  # may be longer than a line
    return [cropped(line, WIDTH) for line in lines] + ([f"there, first: export TACTILED_RUNTIME_DIR={shlex.quote(folder)}"] if folder else [])


def picture(lines):
    """Draws the lines as a terminal; colours become those of the words."""
    colours = {"31": "#f66", "32": "#6d6", "33": "#fc6"}
    rows = []
    for i, line in enumerate(lines):
        parts = re.split("\x1b\\[(\\d+)m(.*?)\x1b\\[0m", line)
        spans = [html.escape(parts[0])]
        for colour, word, rest in zip(parts[1::3], parts[2::3], parts[3::3]):
            spans.append(f'<tspan fill="{colours[colour]}">{html.escape(word)}</tspan>{html.escape(rest)}')
        rows.append(f'<text x="14" y="{24 + 18 * i}" xml:space="preserve">{"".join(spans)}</text>')
    return (f'<svg xmlns="http://www.w3.org/2000/svg" width="720" height="{20 + 18 * len(lines)}" font-family="monospace" font-size="14" fill="#ddd">'
            '<rect width="100%" height="100%" rx="6" fill="#1d1f21"/>\n' + "\n".join(rows) + "\n</svg>\n")


def watch(node, gripper, task, port):
    """Shows the live view until q, Ctrl-C or the end of the task."""
    fault, before = "", termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        print("\x1b[2J", end="")
        while task.is_alive():
            try:
                lines = screen(node, task, fault, port)
            except tactiled.Error as error:
                lines = [f"no data: {error}"]
            print("\x1b[H" + "\x1b[K\n".join(lines) + "\x1b[K\n\x1b[J", end="", flush=True)
            if select.select([sys.stdin], [], [], 0.1)[0]:
                for key in os.read(sys.stdin.fileno(), 64).decode(errors="replace"):  # sys.stdin would keep a second key
                    if key == "q":
                        return
                    if key == "p":
                        task.pause = not task.pause
                    if key == "h":
                        task.hold = not task.hold
                    if key in FAULTS or key == "r":
                        fault = key if key in FAULTS else ""
                        gripper.inject(key)
    except KeyboardInterrupt:
        pass
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def wait_for_sensors(node):
    """The first grasp needs the zero of free jaws: a mean over 0.3 s, after every sensor has a value."""
    until = time.monotonic() + 10
    while time.monotonic() < until:
        try:
            if all(sample.quality == tactiled.GOOD for sample in node.snapshot()[1].values()):
                break
        except tactiled.Error:
            pass  # the daemon is starting
        time.sleep(0.05)
    time.sleep(1)


def main():
    folder, port = pathlib.Path(sys.argv[1]), int(sys.argv[2])
    picks = int(number_of("PICKS"))
    live = sys.stdin.isatty() and sys.stdout.isatty() and picks == 0
    gripper = Gripper(folder, 7)
    gripper.start()
    node = tactiled.open("gripper")
    wait_for_sensors(node)
    try:
        task = Task(gripper, port, picks or (0 if live else 3), (lambda text: None) if live else (lambda text: print(text, flush=True)))
    except OSError as failure:
        sys.exit(f"demo: port {port}: {failure}; build/demo/tactiled.log may have the reason")
    if "PICTURE" in os.environ:
        task.held = lambda: pathlib.Path(os.environ["PICTURE"]).write_text(picture(screen(node, task, "", port)))
    task.start()
    if live:
        watch(node, gripper, task, port)
    else:
        task.join()
    task.plc.ended.set()
    task.join(5)
    gripper.finish()
    if task.failure is not None:
        sys.exit(f"demo: the daemon does not answer through Modbus ({task.failure}): build/demo/tactiled.log may have the reason")
    print(f"{task.right} objects were sorted into the right bin, {task.wrong} into a wrong one, {task.failed} were given up")
    sys.exit(0 if task.wrong == 0 and task.right > 0 else 1)


if __name__ == "__main__":
    main()
