"""Values that no intact sensor sends, tares that must be refused, and redundant sensors that differ."""
import json
import socket
import time

from rig import CONFIG, FROZEN_AFTER, ask, tactiled, wait_for
from strikes import BAD, UNCERTAIN, strike, valued


def frozen():
    at = {}
    return strike(*valued(lambda values, device: at.setdefault(id(device), values), excuse=FROZEN_AFTER), lasts=0.6)


def all_zeros():
    return strike(*valued(lambda values, device: [0, 0, 0], excuse=FROZEN_AFTER), lasts=0.6)


def at_its_rail():
    return strike(*valued(lambda values, device: [*values[:2], 8388607]), expect=UNCERTAIN)


def impossible_step():
    return strike(*valued(lambda values, device: [values[0] + 200000 * (device.sequence % 9 == 0), *values[1:]]), lasts=1, expect=UNCERTAIN)


def not_a_number():
    return strike(*valued(lambda values, device: [values[0], "nan", values[2]]))


def infinite():
    return strike(*valued(lambda values, device: [values[0], "inf", values[2]]), lasts=0.5)


def tare_while_bad():
    def begin(rig):
        rig.left.spoil = lambda line, device: None
        rig.witness.wait("left", BAD, 3, "BAD")
        done = rig.daemon.ctl("tare", "left")
        rig.note = f"refused: exit {done.returncode}" if done.returncode == 1 else "not GOOD: a tare was taken"

    def end(rig):
        rig.left.spoil = None
    return strike(begin, end, lasts=0, then=lambda rig: rig.note)


def refused_tare(why, config, values_of):
    """tactilectl tare of the left sensor is refused for `why`, which appears in the log and in WARN, and the force is
    unchanged."""
    def begin(rig):
        rig.left.values_of = values_of
        rig.left.excused.update(range(rig.left.sequence, rig.left.sequence + 1000))  # these frames have another true
                                                                                     # value
        time.sleep(0.1)
        done = rig.daemon.ctl("tare", "left")
        warned = ask_once(rig, 9)[0] & 1 << 4
        tared = json.loads(rig.daemon.ctl("status", "--json").stdout)["sensors"][0]["tare_count"]
        wait_for(lambda: "tare refused: " in rig.daemon.log(), "a line in the log")
        good = done.returncode == 1 and why in done.stderr and warned and tared == 0
        rig.note = f"refused: exit 1, {why}" if good else f"not GOOD: exit {done.returncode}, {done.stdout}{done.stderr}, WARN {warned}, {tared} tares"

    def end(rig):
        rig.left.values_of = None
    # Begin and end are steps, and are reported as steps.
    return strike(begin, end, lasts=0, expect=None, both=True, config=config, then=lambda rig: rig.note)


def ask_once(rig, at, count=1):
    with socket.create_connection(("127.0.0.1", rig.daemon.port), timeout=1) as client:
        return ask(client, at, count)


def tare_in_motion():
    """The force grows by 10 N a second."""
    return refused_tare("the force of a sensor moved", CONFIG, lambda values, device: [v + 100 * (device.sequence % 512) for v in values])


def tare_under_load():
    """20 N on each axis, at rest."""
    return refused_tare("under load", CONFIG.replace('name = "left"\nlink', 'name = "left"\ntare_limit_N = 5\nlink'),
                        lambda values, device: [20000 + v % 50 for v in values])


def redundant_sensors_differ():
    """The left sensor's force drifts away from the right one's by 40 N a second. 32 frames: until they are 45 N
    apart, and for agree_ms."""
    since = {}

    def creep(values, device):
        first = since.setdefault("left", device.sequence)
        return [v - 400 * min(device.sequence - first, 75) for v in values]

    def then(rig):
        found = [r for _, q, r in rig.witness.history["right"] if q == UNCERTAIN]
        faults = {values[58 + 1] for _, values in rig.witness.registers}
        return "both told, FAULT 19" if found and all(r == tactiled.SENSORS_DIFFER for r in found) and 19 in faults else \
            f"not GOOD: the right one said {found}, FAULT {faults}"
    pair = CONFIG.replace('name = "left"\nlink', 'name = "left"\nagrees_with = "right"\nagree_N = 45\nagree_ms = 100\nlink')
    return strike(*valued(creep, 32), expect=UNCERTAIN, lasts=1, both=True, config=pair, then=then)
