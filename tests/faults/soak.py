#!/usr/bin/env python3
"""One daemon for an hour, with faults all along: no undetected wrong value, always GOOD again, and constant memory,
descriptors and threads.

    soak.py [MINUTES [SEED]]     60 minutes; prints the results, exit 1 after growth, an undetected wrong value or a missing recovery
    WORKERS=1 soak.py ...        on a busy machine: gives the kernel's workers, which pass on the bytes of ttys, priority over its programs (root)
"""
import collections
import contextlib
import os
import pathlib
import random
import signal
import socket
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from floors import CpuFloor, TtyFloor  # noqa: E402
from rig import BIN, FROZEN_AFTER, SENSORS, Rig, tactiled, with_ptys_of_its_own  # noqa: E402

WARM_UP = 1 / 3  # share of the run: one-time allocations, such as for the largest number of clients, are done by then
MAX_GROWTH_KB = 64  # growth of resident memory, from then to the end: a page a minute is a leak


def spoiling(change):
    def fault(rig, device, dice):
        device.spoil = change
        time.sleep(dice.uniform(0.05, 0.6))
        device.spoil = None
    return fault


def flip(line, device):
    at = device.sequence % (len(line) - 1)
    return line[:at] + bytes([line[at] ^ 1 << device.sequence % 7]) + line[at + 1:]


def freeze(rig, device, dice):
    back(rig)  # the first of the equal frames are good: they must be known before another fault
    device.values_of = lambda values, d: [20000, 21000, 22000]
    device.excused.update(range(device.sequence, device.sequence + FROZEN_AFTER + 5))
    time.sleep(dice.uniform(0.3, 0.6))
    device.values_of = None


def back(rig):
    """Waits until both sensors are GOOD."""
    for name in SENSORS:
        rig.witness.wait(name, tactiled.GOOD, 5, f"{name} to be GOOD again")


def unplug(rig, device, dice):
    device.unplug()
    time.sleep(dice.uniform(0.0, 0.5))
    device.plug()


def stand(rig, device, dice):
    rig.daemon.process.send_signal(signal.SIGSTOP)
    time.sleep(dice.uniform(0.02, 0.6))
    rig.daemon.process.send_signal(signal.SIGCONT)


def reload(rig, device, dice):
    text = rig.text
    kind = dice.randrange(3)
    if kind == 0:
        text = text.replace('name = "left"\nlink', f'name = "left"\ncontact_on_N = {dice.uniform(1, 2):.3f}\nlink')
    if kind == 1:
        text = text[:dice.randrange(len(text))]
    rig.daemon.config.write_text(text)
    for _ in range(dice.randrange(1, 4)):
        rig.daemon.process.send_signal(signal.SIGHUP)
    time.sleep(0.1)


def recalibrate(rig, device, dice):
    path = rig.daemon.folder / "unit.toml"
    path.write_text(path.read_text().split("serial")[0] + f'serial = "{dice.randrange(10**6)}"\n')
    rig.daemon.process.send_signal(signal.SIGHUP)
    time.sleep(0.1)


def knock(rig, device, dice):
    """Makes connections that send half a request or nothing, stay, or reset."""
    with contextlib.ExitStack() as held:
        for _ in range(dice.randrange(1, 100)):
            with contextlib.suppress(OSError):
                client = held.enter_context(socket.create_connection(("127.0.0.1", rig.daemon.port), timeout=0.3))
                client.send(os.urandom(dice.randrange(1, 300)))
                if dice.random() < 0.5:
                    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        time.sleep(dice.uniform(0, 0.3))


def read_and_die(rig, device, dice):
    readers = [subprocess.Popen([BIN / "tactilectl", "read", dice.choice(SENSORS), "--follow", "--node", rig.daemon.name],
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for _ in range(dice.randrange(1, 6))]
    time.sleep(dice.uniform(0, 0.3))
    for reader in readers:
        reader.kill()
        reader.wait()


def tare(rig, device, dice):
    rig.daemon.ctl("tare", dice.choice((*SENSORS, "all")))


FAULTS = {
    "garbage": spoiling(lambda line, device: os.urandom(len(line))), "silence": spoiling(lambda line, device: None), "flipped bits": spoiling(flip),
    "cut lines": spoiling(lambda line, device: line[:len(line) // 2]), "long lines": spoiling(lambda line, device: line[:-4] + b"0" * 600 + line[-4:]),
    "a word": spoiling(lambda line, device: line.replace(b",", b",nan,", 1)), "frozen": freeze, "unplugged": unplug, "standing": stand, "reload": reload,
    "recalibrated": recalibrate, "connections": knock, "readers killed": read_and_die, "tare": tare,
}


def usage(pid):
    status = dict(line.split(":", 1) for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines())
    return {"resident_kB": int(status["VmRSS"].split()[0]), "threads": int(status["Threads"]), "descriptors": len(os.listdir(f"/proc/{pid}/fd"))}


class Workers(threading.Thread):
    """Gives the kernel's unbound workers, including new ones, real-time priority until close()."""

    def __init__(self):
        super().__init__(daemon=True)
        self.ended = threading.Event()
        self.start()

    def run(self):
        while not self.ended.wait(0.3):
            self.schedule(os.SCHED_FIFO, 30)

    def schedule(self, policy, priority):
        for entry in pathlib.Path("/proc").glob("[0-9]*/comm"):
            with contextlib.suppress(OSError):
                if entry.read_text().startswith("kworker/u"):
                    os.sched_setscheduler(int(entry.parent.name), policy, os.sched_param(priority))

    def close(self):
        self.ended.set()
        self.join()
        self.schedule(os.SCHED_OTHER, 0)


def settled(rig):
    """Waits until all connections of this test are closed."""
    until = time.monotonic() + 5
    seen = usage(rig.daemon.process.pid)
    while time.monotonic() < until and seen["descriptors"] != rig.rest["descriptors"]:
        time.sleep(0.1)
        seen = usage(rig.daemon.process.pid)
    return seen


def main():
    with_ptys_of_its_own()
    minutes, seed = float(sys.argv[1]) if len(sys.argv) > 1 else 60, int(sys.argv[2]) if len(sys.argv) > 2 else 1
    workers = Workers() if os.environ.get("WORKERS") else None
    dice, struck, wrong = random.Random(seed), collections.Counter(), []
    with Rig() as rig:
        began = time.monotonic()
        ttys, cpus = TtyFloor(), CpuFloor()
        rig.witness.floor = lambda since_ns, until_ns: max(ttys.late_ns(since_ns, until_ns), cpus.late_ns(since_ns, until_ns))
        rig.rest, rig.text = usage(rig.daemon.process.pid), rig.daemon.config.read_text()
        minute, first = 1, None
        while time.monotonic() - began < minutes * 60 and not wrong:
            try:
                for name in dice.sample(sorted(FAULTS), dice.randrange(1, 3)):
                    FAULTS[name](rig, dice.choice(rig.devices), dice)
                    struck[name] += 1
                back(rig)
            except TimeoutError as error:
                wrong.append(f"{error}, after {name}")
                print(rig.daemon.ctl("status").stdout, rig.daemon.log()[-2000:], sep="\n")
                print({name: rig.witness.history[name][-5:] for name in SENSORS}, time.monotonic_ns(), [device.sequence for device in rig.devices], flush=True)
            if rig.daemon.process.poll() is not None:
                wrong.append(f"the daemon ended: {rig.daemon.process.returncode}")
                break
            elapsed = time.monotonic() - began
            if elapsed > 60 * minute:
                last = settled(rig)
                first = first or (last if elapsed > WARM_UP * 60 * minutes else None)
                minute += 1
                print(f"{elapsed / 60:6.1f} min  {last}  {sum(struck.values())} faults, {sum(rig.witness.lies.values())} lies", rig.witness.first_lie, flush=True)
        last = settled(rig)
        first = first or last
        for what, most in (("resident_kB", MAX_GROWTH_KB), ("threads", 0), ("descriptors", 0)):
            if last[what] - first[what] > most:
                wrong.append(f"{what}: {first[what]} after a third of the time, {last[what]} at the end")
        if rig.witness.lies:
            wrong.append(f"lies: {dict(rig.witness.lies)}, first {rig.witness.first_lie}")
        print(f"{minutes:g} min, seed {seed}: {dict(sorted(struck.items()))}; {rig.witness.looks} looks at shared memory, {rig.witness.answers} at registers, "
              f"{sum(rig.witness.lies.values())} lies, "
              f"{rig.witness.excused} looks at values that were held up by a tty's worker in the kernel or by a processor that stood (at most {max((end - begin for late in cpus.late.values() for begin, end in late), default=0) / 1e6:.0f} ms); at the start {rig.rest}, after a third of the time {first}, at the end {last}")
        cpus.close()
    if workers is not None:
        workers.close()
    for each in wrong:
        print(f"wrong: {each}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
