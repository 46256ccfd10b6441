"""Faults of the serial line and of the device behind it."""
import os
import random
import signal
import threading
import time

from rig import Rig, count_of, line_of, tactiled
from strikes import GOOD, STRACE, counter, spoiled, strike, told, words


def unplugged():
    return strike(lambda rig: rig.left.unplug(), lambda rig: rig.left.plug(), then=lambda rig: f"{rig.daemon.log().count('is disconnected')} line in the log")


def comes_back_elsewhere():
    """The by-id name then points to another tty."""
    def elsewhere(rig):
        rig.spare = [os.openpty() for _ in range(2)]  # takes the old numbers
        rig.left.plug()
    return strike(lambda rig: rig.left.unplug(), elsewhere)


def refused_at_open():
    """The left port returns EBUSY from the start for 1 s."""
    rig = Rig(before=(*STRACE, "-P", "{folder}/left", "-e", "trace=openat", "-e",
                      "inject=openat:error=EBUSY:when=1..4"))
    return opened_late(rig)


def opened_late(rig):
    began_ns = time.monotonic_ns()
    with rig:
        starts = rig.witness.history["left"][0]
        good = next(t for t, q, _ in rig.witness.history["left"] if q == GOOD)
        said = (starts[0] - began_ns) / 1e6, words(starts[2])
        return told(rig, time.monotonic_ns(), said, (good - began_ns) / 1e6)


def flapping():
    def begin(rig):
        until = time.monotonic() + 3
        while time.monotonic() < until:
            rig.left.unplug()
            time.sleep(0.005)
            rig.left.plug()
            time.sleep(0.005)
        rig.struck_ns = time.monotonic_ns()
        rig.left.unplug()
    return strike(begin, lambda rig: rig.left.plug(), lasts=0, recovers_s=4, then=lambda rig: f"{len(rig.daemon.log().splitlines())} lines in the log")


def garbage():
    return strike(*spoiled(lambda line, device: os.urandom(len(line))))


def flipped_bits():
    def flip(line, device):
        if device.sequence % 10:
            return line
        at = device.sequence // 10 % (len(line) - 1)
        return line[:at] + bytes([line[at] ^ 1 << device.sequence % 7]) + line[at + 1:]
    return strike(*spoiled(flip), lasts=2, expect=None, then=lambda rig: f"{counter(rig, 'lost')} lost, {counter(rig, 'bad_checksum') + counter(rig, 'bad_length') + counter(rig, 'bad_value')} told as damaged")


def too_long_lines():
    return strike(*spoiled(lambda line, device: line[:-4] + b"0" * 600 + line[-4:]))


def cut_lines():
    return strike(*spoiled(lambda line, device: line[:len(line) // 2] if device.sequence % 4 == 0 else line), lasts=2, expect=None,
                  then=lambda rig: f"{counter(rig, 'lost')} lost")


def chopped():
    def chop(line, device):
        for byte in line[:-1]:
            os.write(device.master, bytes([byte]))
        return line[-1:]
    return strike(*spoiled(chop), lasts=1, expect=None)


def gaps_repeats_and_overtakings():
    held = []

    def mix(line, device):
        kind = device.sequence % 20
        if kind == 3:
            return None
        if kind == 7:
            return line + line
        if kind == 11:
            held.append(line)
            return None
        return line + held.pop() if held else line
    return strike(*spoiled(mix), lasts=2, expect=None, then=lambda rig: f"lost {counter(rig, 'lost')}, repeated {counter(rig, 'repeated')}")


def silent():
    return strike(*spoiled(lambda line, device: None), lasts=0.5)


def two_devices_of_one_name():
    """The second device counts 5 ahead and measures the right sensor's force; the order of sending is random."""
    dice = random.Random(1)
    excused = 19  # readings of the second device before its detection

    def mix(line, device):
        nonlocal excused
        number = device.sequence + 5
        second = line_of(number, [count_of(device.index + 1, number, k) for k in range(3)])
        if excused > 0:
            device.excused.add(number)
            excused -= 1
        return line + second if dice.random() < 0.5 else second + line
    return strike(*spoiled(mix), lasts=1, recovers_s=5, then=lambda rig: f"repeated {counter(rig, 'repeated')}")


def half_rate():
    def slow(rig):
        rig.left.period_s = 0.02

    def back(rig):
        rig.left.period_s = 0.01
    return strike(slow, back, lasts=2.5, expect=None, then=lambda rig: "told: wrong-rate" if any(r & tactiled.WRONG_RATE for _, _, r in rig.witness.history["left"]) else "not GOOD: nothing was told")


def interrupted_calls():
    return strike(lambda rig: None, lasts=3, expect=None, before=(*STRACE, "-e", "trace=read,write,ppoll", "-e",
                                                                   "inject=read:error=EINTR:when=100+7", "-e", "inject=ppoll:error=EINTR:when=100+5"))


def stopped_200_ms():
    return strike(lambda rig: rig.daemon.process.send_signal(signal.SIGSTOP), lambda rig: rig.daemon.process.send_signal(signal.SIGCONT), lasts=0.2, both=True)


def another_opens_it():
    def steal(rig):
        rig.thief = os.open(rig.left.slave_path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        rig.stop = threading.Event()

        def read():
            while not rig.stop.is_set():
                try:
                    os.read(rig.thief, 4096)
                except BlockingIOError:
                    pass
                time.sleep(0.001)
        rig.reads = threading.Thread(target=read)
        rig.reads.start()

    def give_back(rig):
        rig.stop.set()
        rig.reads.join()
        os.close(rig.thief)
    return strike(steal, give_back, lasts=2, expect=None, both=True, then=lambda rig: f"{counter(rig, 'lost')} lost")


def counter_wraps():
    return strike(lambda rig: None, lasts=2.5, expect=None, first=0xFFFFFFFF - 100, then=lambda rig: f"lost {counter(rig, 'lost')}")
