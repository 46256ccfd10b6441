"""An output of the product as a test looks at it.

look() returns (value, time of the value or None) if a user of the output would take its present value for a good one, else None. Times are of
CLOCK_MONOTONIC, in s. A second object of a class is a client that comes later. `needs`: the parts on the way of a value. `limit_s`: the age
from which on the output must not show it. `lasts_s`: how long a message is taken for the present value, where messages are events. `stands`:
its reader is a program that can stand still and go on."""
import contextlib
import http.client
import signal
import subprocess
import threading
import time

from daemon import halt

SENSOR, GOOD = "left", 1
TURN_S = 300  # a forged value is the time of CLOCK_MONOTONIC modulo this one, which the registers of a force can hold


class Output:
    needs = {"sensor", "daemon", "bridge"}
    limit_s = 1.0
    lasts_s = 0.2
    stands, paused = False, False
    newest, at_s, why = None, 0.0, ""  # why: of nothing to show, where the output says it

    def __init__(self, rig):
        self.rig, self.ended, self.lock = rig, False, threading.Lock()
        self.used = []  # the values and their ages, since the reader has gone on
        self.open()

    def thread(self, work):
        def run():
            while not self.ended:
                self.wait()
                with contextlib.suppress(OSError, EOFError, ValueError, http.client.HTTPException):
                    work()
                time.sleep(0.02)
        threading.Thread(target=run, daemon=True).start()

    def wait(self):
        while self.paused and not self.ended:
            time.sleep(0.005)

    def halt(self):
        self.paused = True
        if hasattr(self, "process"):
            halt(self.process.pid)

    def go_on(self):
        self.newest, self.used, self.paused = None, [], False  # the user of the values stood still with their reader
        if hasattr(self, "process"):
            self.process.send_signal(signal.SIGCONT)

    def told(self, number):
        """The time that a forged value tells, which may be rounded up to 1 s; None: the value is that of a device."""
        now_s = time.monotonic()
        return None if self.rig.forged is None else now_s + 1 - (now_s + 1 - number) % TURN_S

    def lines(self, *words):
        """Starts a program; came(line) has each line that it prints."""
        process = self.process = subprocess.Popen([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)

        def read():
            for line in process.stdout:
                self.came(line.rstrip("\n"))
        threading.Thread(target=read, daemon=True).start()

    def show(self, value):
        self.newest, self.at_s = value, time.monotonic()
        if value and value[1] is not None:
            self.used.append((value, self.at_s - value[1]))

    def look(self):
        return self.newest if time.monotonic() - self.at_s < self.lasts_s else None

    def close(self):
        self.ended = True
        if hasattr(self, "process"):
            self.process.kill()
            self.process.wait()
