"""Delays of the machine itself, measured beside the daemon, at the same time, by independent programs."""
import collections
import contextlib
import os
import pty
import subprocess
import sys
import threading
import time
import tty

LATE_NS = 5_000_000


def hurry():
    """Gives real-time priority: devices and witness must not be late on a busy machine. Their child processes have
    normal priority."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(20))


class TtyFloor(threading.Thread):
    """Measures continuously how long the kernel takes to pass a byte through an otherwise unused pty: its worker has
    no priority."""

    def __init__(self):
        super().__init__(daemon=True)
        self.late = collections.deque(maxlen=1000)  # ns, from and to, if a byte took longer than 5 ms
        self.ended = threading.Event()
        self.start()

    def run(self):
        hurry()
        master, slave = pty.openpty()
        tty.setraw(slave)
        while not self.ended.wait(0.005):
            began_ns = time.monotonic_ns()
            os.write(master, b"x")
            os.read(slave, 1)
            if time.monotonic_ns() - began_ns > LATE_NS:
                self.late.append((began_ns, time.monotonic_ns()))
        os.close(master)
        os.close(slave)

    def late_ns(self, since_ns, until_ns):
        """Returns the time for which bytes were delayed in that interval."""
        return overlap_ns(self.late, since_ns, until_ns)


def overlap_ns(late, since_ns, until_ns):
    return sum(max(0, min(end, until_ns) - max(begin, since_ns)) for begin, end in list(late))


class CpuFloor:
    """Records when a processor did not run a thread that sleeps 1 ms at a time at real-time priority, in a separate
    process."""

    def __init__(self):
        self.late = {cpu: collections.deque(maxlen=1000) for cpu in sorted(os.sched_getaffinity(0))}
        self.programs = [subprocess.Popen([sys.executable, __file__, str(cpu)], stdout=subprocess.PIPE, text=True) for cpu in self.late]
        for program, late in zip(self.programs, self.late.values()):
            threading.Thread(target=self.take, args=(program, late), daemon=True).start()

    @staticmethod
    def take(program, late):
        for line in program.stdout:
            late.append(tuple(map(int, line.split())))

    def late_ns(self, since_ns, until_ns):
        """Returns the longest interruption in that interval. It is known only after the end of the interruption."""
        time.sleep(0.05)
        return max(overlap_ns(late, since_ns, until_ns) for late in self.late.values())

    def close(self):
        for program in self.programs:
            program.kill()
            program.wait()


def watch(cpu):
    os.sched_setaffinity(0, {cpu})
    hurry()
    before, parent = time.monotonic_ns(), os.getppid()
    while os.getppid() == parent:
        time.sleep(0.001)
        now = time.monotonic_ns()
        if now - before > LATE_NS:
            print(before, now, flush=True)
        before = now


if __name__ == "__main__":
    watch(int(sys.argv[1]))
