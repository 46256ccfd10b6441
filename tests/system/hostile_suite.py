"""Runs cases against one daemon: the tables of hostile_cases and hostile_frames, and clients that tables cannot
describe."""
import concurrent.futures
import re
import select
import time

from daemon import Stopwatch
from hostile_client import AT_ONCE_S, PLACES, Client, common, show
from hostile_pdus import CLOSED, GOOD, MAGIC, MAGIC_IS, OURS, SCRATCH, adu, read, refusal

PROBE = 0xBEEF  # transaction id of the probe
WRITES = (5, 6, 15, 16, 22, 23)
STATE = [read(3, 25, 3), read(3, 120, 1), read(3, 5000, 100), read(3, SCRATCH, 125), read(3, SCRATCH + 125, 3),
         read(1, 0, 34)]  # everything that a write can change; 120 = TARE_COUNT


def fits(got, wanted):
    if not isinstance(wanted, re.Pattern):
        return got == wanted
    return isinstance(got, bytes) and got[:7] == adu(got[7:])[:7] and wanted.fullmatch(got[7:]) is not None


def wanted_frames(case):
    if isinstance(case.expected, int):
        return [adu(refusal(case.sent, case.expected))]
    if isinstance(case.expected, bytes):
        return [adu(case.expected)]
    return case.expected if isinstance(case.expected, list) else [case.expected]


def may_write(case):
    if isinstance(case.sent, bytes):
        return case.sent[0] in WRITES and not isinstance(case.expected, int)
    return any(frame[7] in WRITES for frame in case.expected if frame != CLOSED)


class Suite:
    """One daemon, its witness, and the failures."""

    def __init__(self, daemon):
        self.daemon, self.port = daemon, daemon.port
        self.count = 0
        self.failures = []

    def fail(self, name, sent, got, expected, section):
        self.failures.append(name)
        print(f"{name}: sent {show(sent)}, got {show(got)}, expected {show(expected)} ({section})", flush=True)

    def is_served_afterwards(self, name, seconds=0.0):
        """Tests a new connection; `seconds`: time for which the places of disconnected clients may stay taken."""
        if self.daemon.process.poll() is not None:
            status = self.daemon.process.returncode
            raise AssertionError(f"the daemon died of {name}: {status}\n{self.daemon.log()[-2000:]}")
        until = time.monotonic() + seconds
        while True:
            try:
                with Client(self.port) as client:
                    answer = client.ask(MAGIC)
            except OSError as error:
                answer = str(error)
            if answer == MAGIC_IS:
                return
            if time.monotonic() >= until:
                return self.fail(f"a fresh connection after {name}", GOOD, answer, MAGIC_IS, OURS)

    def state(self):
        return [self.control.ask(pdu) for pdu in STATE]

    def exchange(self, case):
        wanted = wanted_frames(case)
        pieces = case.sent if isinstance(case.sent, list) else [adu(case.sent)]
        with Client(self.port, source=case.source) as client, Client(self.port, source=case.source) as other:
            for one, pdus in ((client, case.before), (other, case.elsewhere)):
                for pdu in pdus:
                    if (answer := one.ask(pdu))[0] != pdu[0]:
                        return [f"{show(pdu)} was answered {show(answer)}"]
            for piece in pieces:
                client.send(piece)
                if len(pieces) > 1:
                    time.sleep(0.001)
            if wanted[-1] == CLOSED:
                with Stopwatch() as watch:
                    got = client.frames()
                    return got if watch.seconds() < AT_ONCE_S else [*got, f"after {watch.seconds():.2f} s"]
            client.send(adu(MAGIC, PROBE))
            got = client.frames(last=PROBE)
            return got[:-1] if got[-1] == adu(MAGIC_IS, PROBE) else got

    def run(self, table):
        for case in table:
            self.count += 1
            before = self.state()
            try:
                got = self.exchange(case)
            except OSError as error:
                got = [str(error)]
            wanted = wanted_frames(case)
            if len(got) != len(wanted) or not all(map(fits, got, wanted)):
                self.fail(case.name, case.sent, got, wanted, case.section)
            elif not may_write(case) and (after := self.state()) != before:
                changed = [f"answer to {show(pdu)} changed at byte {common(was, now)}"
                           for pdu, was, now in zip(STATE, before, after) if was != now]
                self.fail(f"{case.name}: nothing may be written", case.sent, changed, wanted, case.section)
            self.look_afterwards(case)
            self.is_served_afterwards(case.name)

    def look_afterwards(self, case):
        if not case.after:
            return
        with Client(self.port, source=case.source) as client:  # acknowledgements belong to its address
            for pdu, answer in case.after:
                if (now := client.ask(pdu)) != answer:
                    self.fail(f"{case.name}: afterwards", pdu, now, answer, case.section)

    def run_slow(self, slow):
        with Client(self.port) as client, Stopwatch() as watch:
            began = time.monotonic()
            for n, piece in enumerate(slow.pieces):
                time.sleep(slow.gap_s if n else 0)
                if not client.send(piece):
                    break
                if slow.is_closed and select.select([client.socket], [], [], 0)[0] and not slow.answers:
                    break
            if not slow.is_closed:
                client.send(adu(MAGIC, PROBE))
                got = client.frames(last=PROBE)
                return "" if got == slow.answers + [adu(MAGIC_IS, PROBE)] else got
            got = client.frames()
            seconds = time.monotonic() - began
            return "" if got == slow.answers + [CLOSED] and seconds > 0.9 and watch.seconds() < 2 else f"{show(got)} after {seconds:.2f} s"

    def run_parallel(self, slow, functions):
        before = self.state()
        with concurrent.futures.ThreadPoolExecutor(PLACES - 4) as pool:
            running = [(s.name, s.pieces, s.answers + [CLOSED] * s.is_closed, s.section, pool.submit(self.run_slow, s))
                       for s in slow]
            running += [(*row[:-1], pool.submit(row[-1], self.port)) for row in functions]
            for *row, future in running:
                self.judge(row, future.result)
        if self.state() != before:
            self.fail("slow clients", "halves of frames", "registers that changed", "nothing written", OURS)

    def run_each(self, functions, seconds=0.0):
        for *row, function in functions:
            self.judge(row, lambda: function(self.port), seconds)

    def judge(self, row, outcome, seconds=0.0):
        name, sent, expected, section = row
        self.count += 1
        try:
            got = outcome()
        except OSError as error:  # includes TimeoutError
            got = f"{type(error).__name__}: {error}"
        if got:
            self.fail(name, sent, got, expected, section)
        self.is_served_afterwards(name, seconds)
