"""Injects faults into the release binary. `strike()` is the usual course: begin, observe, end, observe. The faults,
*_faults.py, are functions that return the observations."""
import json
import time

from rig import Rig, tactiled

# Priority over other programs, because the daemon waits for strace at each call. The daemon itself starts normally.
STRACE = ("chrt", "-R", "-f", "50", "strace", "-f", "-qq", "-o", "/dev/null")
GOOD, UNCERTAIN, BAD = tactiled.GOOD, tactiled.UNCERTAIN, tactiled.BAD


def words(reasons):
    return ",".join(word for bit, word in enumerate(tactiled.REASON_WORDS) if reasons >> bit & 1)


def strike(begin, end=lambda rig: None, lasts=0.4, expect=BAD, both=False, recovers_s=3, then=None, **keys):
    """Injects a fault of the left device, or of both, and returns the witness' observations."""
    with Rig(**keys) as rig:
        witness, began_ns = rig.witness, time.monotonic_ns()
        begin(rig)
        began_ns = getattr(rig, "struck_ns", began_ns)  # if begin() itself takes some time
        said = None
        if expect is not None:
            seen_ns = witness.wait("left", expect, 3, f"quality {expect}")
            said = max(0, seen_ns - began_ns) / 1e6, words(witness.history["left"][-1][2])
        time.sleep(max(0, lasts - (time.monotonic_ns() - began_ns) / 1e9))
        ended_ns = time.monotonic_ns()
        end(rig)
        good_ns = witness.wait("left", GOOD, recovers_s, "GOOD again")
        time.sleep(0.3)
        return told(rig, began_ns, said, max(0, good_ns - ended_ns) / 1e6 if expect is not None else 0, both, then)


def told(rig, began_ns, said=None, good_ms=0, both=False, then=None):
    witness = rig.witness
    notes = []
    if then is not None:
        notes.append(then(rig))
    neighbour = [] if both else witness.not_good("right", began_ns)
    if neighbour:
        notes.append(f"the other sensor: {words(neighbour[0][2])}")
    if witness.history["left"][-1][1] != GOOD:
        notes.append("not GOOD at the end")
    if said is None and not both and (hurt := witness.not_good("left", began_ns)):
        notes.append(f"not GOOD: {words(hurt[0][2])}")
    return {"bad_ms": said and said[0], "reasons": said[1] if said else "", "good_ms": good_ms,
            "lies": sum(witness.lies.values()), "first_lie": witness.first_lie,
            "fine": not witness.lies and not neighbour and witness.history["left"][-1][1] == GOOD and
            not any(note.startswith("not GOOD") for note in notes),
            "note": "; ".join(note for note in notes if note)}


def counter(rig, name, link="usb_left"):
    status = json.loads(rig.daemon.ctl("status", "--json").stdout)
    return next(entry for entry in status["links"] if entry["name"] == link)[name]


def spoiled(change):
    """Passes the left device's lines through change(line, device)."""
    def begin(rig):
        rig.left.spoil = change

    def end(rig):
        rig.left.spoil = None
    return begin, end


def valued(change, excuse=0):
    """Passes the left device's values through change(values, device); the first `excuse` frames may be wrong and
    GOOD."""
    def begin(rig):
        left = {"n": excuse}

        def spoil(values, device):
            if left["n"] > 0:
                left["n"] -= 1
                device.excused.add(device.sequence)
            return change(values, device)
        rig.left.values_of = spoil

    def end(rig):
        rig.left.values_of = None
    return begin, end
