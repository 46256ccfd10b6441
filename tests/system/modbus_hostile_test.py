#!/usr/bin/env python3
"""Hostile Modbus TCP clients against the release daemon; a good one reads 200 times a second and must not notice."""
import concurrent.futures
import multiprocessing
import os
import pathlib
import random
import re
import resource
import select
import signal
import socket
import struct
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import hostile_cases as cases  # noqa: E402
from daemon import wait_for  # noqa: E402
from daemon_test import CONFIG, quality_is, unit_daemon  # noqa: E402
from hostile_cases import CLOSED, GOOD, GOOD_ANSWER, MAGIC, MAGIC_IS, OURS, SCRATCH, UNLOCK  # noqa: E402
from hostile_cases import adu, coil, mb, read, register, tcp  # noqa: E402

SILENT = "silent"
PROBE = 0xBEEF  # its transaction id
AT_ONCE_S = 0.7  # well below the second that half a request may take
PLACES = 16
PATIENT_S = 5  # a hostile client that the kernel lets wait for its second SYN is no failure
CONTROL, PLC = "127.0.0.10", "127.0.0.9"
WRITABLE = f"""commands = true
scratch = true
max_clients = {PLACES}
max_requests_per_s = 0
allow = ["127.0.0.0/24"]
command_allow = ["127.0.0.1/32"]
plc = ["{PLC}", "{CONTROL}"]
settings = "{{folder}}/settings.toml"
"""
# A busy machine halts the player for longer than 100 ms, and a stale sensor is not tared.
SENSOR = CONFIG.replace("stale_ms = 100", "stale_ms = 2000") + "tare_ms = 300\n"
MOST_GROWTH_KIB = 8 * 1024
WORST_WAIT_MS = 250
WRITES = (5, 6, 15, 16, 22, 23)
STATE = [read(3, 25, 3), read(3, 120, 1), read(3, 5000, 100), read(3, SCRATCH, 125), read(3, SCRATCH + 125, 3),
         read(1, 0, 34)]  # all that a write can change; 120 = TARE_COUNT


class Client:
    def __init__(self, port, source="127.0.0.1", seconds=1.0, receive_bytes=None):
        self.socket = socket.socket()
        if receive_bytes is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.settimeout(seconds)
        try:
            self.socket.bind((source, 0))
            self.socket.connect(("127.0.0.1", port))
        except OSError:
            self.socket.close()
            raise
        self.seconds = seconds
        self.heard = b""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, data):
        """False when the server has closed."""
        try:
            self.socket.sendall(data)
            return True
        except ConnectionError:
            return False

    def frame(self, seconds=None):
        """The next ADU, CLOSED or SILENT; what is left of an incomplete one comes before CLOSED."""
        until = time.monotonic() + (self.seconds if seconds is None else seconds)
        while True:
            size = 6 + struct.unpack(">H", self.heard[4:6])[0] if len(self.heard) >= 6 else None
            if size is not None and len(self.heard) >= size:
                frame, self.heard = self.heard[:size], self.heard[size:]
                return frame
            self.socket.settimeout(max(until - time.monotonic(), 0.001))
            try:
                data = self.socket.recv(65536)
            except ConnectionError:
                data = b""
            except TimeoutError:
                return SILENT
            if not data:
                rest, self.heard = self.heard, b""
                return rest or CLOSED
            self.heard += data

    def frames(self, last=None, seconds=None):
        """All frames up to the transaction `last`, or up to CLOSED or SILENT, which is then the last one."""
        heard = []
        while True:
            heard.append(self.frame(seconds))
            if heard[-1] in (CLOSED, SILENT) or last is not None and heard[-1][:2] == last.to_bytes(2, "big"):
                return heard

    def ask(self, pdu):
        """The answer's PDU, CLOSED or SILENT."""
        self.send(adu(pdu))
        answer = self.frame()
        return answer[7:] if isinstance(answer, bytes) else answer

    def reset(self):
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


# ---- the good client -------------------------------------------------------------------------------------------------


def witness(port, stop, report):
    """Reads the global block 200 times a second on one connection; reports what went wrong and how long it waited."""
    bad = dict.fromkeys(("missing", "wrong", "torn", "dropped", "heartbeat stood still"), 0)
    waits_ms = []
    client = Client(port)
    transaction, beat, beat_at = 0, None, time.monotonic()
    due = time.monotonic()
    while not stop.is_set():
        due = max(due + 0.005, time.monotonic() - 0.05)
        time.sleep(max(due - time.monotonic(), 0))
        transaction = (transaction + 1) & 0xFFFF
        began = time.monotonic()
        client.send(adu(read(4 if transaction % 2 else 3, 0, 32), transaction, 255))
        frame = client.frame(2)
        now = time.monotonic()
        waits_ms.append((now - began) * 1000)
        if isinstance(frame, str) or len(frame) != 73:
            bad[{CLOSED: "dropped", SILENT: "missing"}.get(frame, "wrong")] += 1
            client.socket.close()
            client = Client(port)
            continue
        head = struct.pack(">HHHBBB", transaction, 0, 67, 255, 4 if transaction % 2 else 3, 64)
        value = struct.unpack(">32H", frame[9:])
        bad["wrong"] += frame[:9] != head or value[:4] != (0x5441, 0x4354, 0x0103, 1)
        bad["torn"] += value[4] != value[31]
        if value[5] != beat:
            beat, beat_at = value[5], now
        elif now - beat_at > 1:
            bad["heartbeat stood still"] += 1
            beat_at = now
    client.socket.close()
    report.send((bad, waits_ms))


# ---- clients that tables cannot tell: each returns "" or what it got instead -----------------------------------------


def deaf(port):
    """Asks for ever and takes nothing."""
    with Client(port, receive_bytes=4096) as client:
        client.socket.setblocking(False)
        poll = select.poll()
        poll.register(client.socket, select.POLLOUT)
        began = time.monotonic()
        while time.monotonic() - began < 6:
            events = poll.poll(50)
            if events and events[0][1] & (select.POLLERR | select.POLLHUP):
                seconds = time.monotonic() - began
                return "" if 1.8 < seconds < 4.5 else f"closed after {seconds:.2f} s"
            if events:
                try:
                    client.socket.send(adu(read(3, 100, 125)) * 100)
                except BlockingIOError:
                    pass
                except ConnectionError:
                    continue
        return "still open after 6 s"


def slow_reader(port):
    with Client(port, receive_bytes=4096) as client:
        client.send(adu(read(3, 9000, 12)) * 1000)
        whole, got = adu(cases.holds(3, *cases.CONSTANTS)) * 1000, b""
        while len(got) < len(whole):
            data = client.socket.recv(512)
            if not data:
                break
            got += data
            time.sleep(0.005)
        return "" if got == whole else f"{len(got)} of {len(whole)} bytes, the same up to {common(got, whole)}"


def common(a, b):
    return next((n for n, (x, y) in enumerate(zip(a, b)) if x != y), min(len(a), len(b)))


def half_closed(port):
    with Client(port) as client:
        client.send(b"".join(cases.HUNDRED))
        client.socket.shutdown(socket.SHUT_WR)
        got = client.frames()
        return "" if got == cases.HUNDRED_ANSWERS + [CLOSED] else f"{len(got) - 1} answers, then {got[-1]}"


def half_closed_at_once(port):
    with Client(port) as client:
        client.socket.shutdown(socket.SHUT_WR)
        got = client.frames()
        return "" if got == [CLOSED] else show(got)


def half_closed_in_a_frame(port):
    with Client(port) as client:
        client.send(GOOD + GOOD[:5])
        client.socket.shutdown(socket.SHUT_WR)
        got = client.frames(seconds=2)
        return "" if got == [GOOD_ANSWER, CLOSED] else show(got)


def reset_in_a_frame(port):
    for size in range(1, len(GOOD)):
        client = Client(port, seconds=PATIENT_S)
        client.send(GOOD[:size])
        client.reset()
    return ""


def reset_before_the_answers(port):
    for _ in range(200):
        client = Client(port, seconds=PATIENT_S)
        client.send(adu(read(3, 100, 125)) * 50)
        client.reset()
    return ""


def closed_in_a_frame(port):
    for size in range(1, len(GOOD)):
        with Client(port, seconds=PATIENT_S) as client:
            client.send(GOOD[:size])
    return ""


def connect_and_close(port):
    for _ in range(500):
        Client(port, seconds=PATIENT_S).socket.close()
    return ""


def connect_and_reset(port):
    for _ in range(500):
        Client(port, seconds=PATIENT_S).reset()
    return ""


def burst_while_the_daemon_is_halted(suite):
    """As a busy machine halts it. No connection may have to wait for its second SYN, which comes after 1 s."""
    clients = [socket.socket() for _ in range(64)]
    poll = select.poll()
    os.kill(suite.daemon.process.pid, signal.SIGSTOP)
    try:
        for client in clients:
            client.setblocking(False)
            client.connect_ex(("127.0.0.1", suite.port))
            poll.register(client, select.POLLOUT)
        time.sleep(0.01)
    finally:
        os.kill(suite.daemon.process.pid, signal.SIGCONT)
    try:
        time.sleep(AT_ONCE_S)
        connected = len(poll.poll(0))
        return "" if connected == len(clients) else f"{len(clients) - connected} still wait after {AT_ONCE_S} s"
    finally:
        for client in clients:
            client.close()


def connections_that_stay(port):
    """More than FD_SETSIZE of them on the client's side; the server keeps its places and closes the rest."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(hard, 4096)), hard))
    clients = [Client(port, seconds=PATIENT_S) for _ in range(1100)]
    wait_for(lambda: places_taken(clients) <= PLACES, 3, "the server to close the rest")
    for client in clients:
        client.socket.close()
    return ""


def places_taken(clients):
    poll = select.poll()
    for client in clients:
        poll.register(client.socket, select.POLLIN)
    return len(clients) - len(poll.poll(0))  # readable: closed, for nobody has asked anything


def silent_clients(port):
    clients = [Client(port, seconds=PATIENT_S) for _ in range(3 * PLACES)]
    with Client(port) as late:
        answer = late.ask(MAGIC)
    wait_for(lambda: places_taken(clients) <= PLACES, 1, "the server to close the rest")
    for client in clients:
        client.socket.close()
    return "" if answer == MAGIC_IS else f"the one that speaks: {show(answer)}"


def full_house(port):
    """With the witness every place is taken by one that polls."""
    pollers = [Client(port) for _ in range(PLACES - 1)]
    plcs, newcomers = [], []
    try:
        for n in range(20):
            polled = [client.ask(MAGIC) for client in pollers]
            if polled != [MAGIC_IS] * len(pollers):
                return f"{polled.count(MAGIC_IS)} of {len(pollers)} that poll are served in turn {n}"
            newcomers.append(Client(port))
            answer = newcomers[-1].ask(MAGIC)
            if answer != CLOSED:
                return f"one too many: {show(answer)}"
        for n in range(4):
            plcs.append(Client(port, source=PLC))
            served = [client.ask(MAGIC) for client in plcs].count(MAGIC_IS)
            if served != n + 1:
                return f"{served} of {n + 1} connections of the PLC are served"
        plcs.append(Client(port, source=PLC))
        served = [client.ask(MAGIC) for client in plcs].count(MAGIC_IS)
        polled = [client.ask(MAGIC) for client in pollers].count(MAGIC_IS)
        if (served, polled) != (4, len(pollers)):
            return f"at the end {served} of 5 of the PLC and {polled} of {len(pollers)} that poll"
        return ""
    finally:
        for client in pollers + plcs + newcomers:
            client.socket.close()


def outside_the_allow_list(port):
    with Client(port, source="127.0.1.1") as client:
        client.send(GOOD)
        got = client.frame(AT_ONCE_S)
        return "" if got == CLOSED else show(got)


def mutated_frames(port):
    randomly = random.Random(20240229)
    good = [GOOD, adu(read(1, 0, 34)), adu(read(2, 0, 68)), adu(cases.registers(SCRATCH, range(20))),
            adu(cases.exchange(0, 32, SCRATCH, range(10))), adu(cases.identity(14, 1, 0)),
            adu(cases.mask(SCRATCH, 1, 2))]
    with Client(port) as patient:
        for n in range(400):
            frame = bytearray(randomly.choice(good))
            for _ in range(randomly.randint(1, 4)):
                at = randomly.randrange(len(frame))
                frame[at:at + randomly.randint(0, 2)] = randomly.randbytes(randomly.randint(0, 2)) or b"\0"
            with Client(port, seconds=PATIENT_S) as client:
                client.send(bytes(frame))
            if n % 20 == 0 and (answer := patient.ask(MAGIC)) != MAGIC_IS:
                return f"after {n}: {show(answer)}"
    return ""


def noise(port):
    randomly = random.Random(42)
    for _ in range(200):
        with Client(port, seconds=PATIENT_S) as client:
            client.send(randomly.randbytes(randomly.randint(1, 600)))
    return ""


def eight_clients_byte_by_byte(port):
    clients = [Client(port) for _ in range(8)]
    try:
        for at in range(len(GOOD)):
            for n, client in enumerate(clients):
                client.send(adu(read(3, 9000 + n, 1), n, n)[at:at + 1])
        got = [client.frame() for client in clients]
    finally:
        for client in clients:
            client.socket.close()
    return "" if got == [adu(cases.holds(3, cases.CONSTANTS[n]), n, n) for n in range(8)] else show(got)


def greedy(port):
    """Asks 100 times before it takes the first answer, for 2 s."""
    until, rounds = time.monotonic() + 2, 0
    with Client(port) as client:
        while time.monotonic() < until:
            client.send(b"".join(cases.HUNDRED))
            got = [client.frame() for _ in cases.HUNDRED]
            if got != cases.HUNDRED_ANSWERS:
                return f"in round {rounds}: {show(got)}"
            rounds += 1
    return "" if rounds > 5 else f"{rounds} rounds in 2 s"


def unlock_is_not_inherited(port):
    setting = register(5030, 100)
    for _ in range(10):
        with Client(port) as client:
            client.ask(UNLOCK)
        with Client(port) as client:
            if (got := client.ask(setting)) != cases.refusal(setting, 2):
                return show(got)
    return ""


def values(client, at, count):
    return struct.unpack(f">{count}H", client.ask(read(3, at, count))[2:])


def is_idle(client):
    return values(client, 26, 1) != (1,) and client.ask(read(1, 0, 16)) == b"\1\2\0\0"


def tare_while_taring(port, gap_s=0.0):
    requests = [register(5010, 1), register(5010, 1), coil(0, 0xFF00), cases.registers(5010, (1, 0)),
                cases.exchange(0, 1, 5010, (1,)), cases.coils(0, 1, b"\1")]
    with Client(port) as client:
        wait_for(lambda: is_idle(client), 5, "earlier commands to end")
        before, = values(client, 120, 1)
        if gap_s == 0:
            client.send(b"".join(map(adu, requests)))
            got = [client.frame()[7:] for _ in requests]
        else:
            got = [client.ask(requests[0])]
            time.sleep(gap_s)
            got += map(client.ask, requests[1:])
        wait_for(lambda: values(client, 120, 1) != (before,) and is_idle(client), 5, "the tare to end")
        tares = (values(client, 120, 1)[0] - before) & 0xFFFF
    want = requests[:1] + [cases.refusal(pdu, 6) for pdu in requests[1:]]
    if (got, tares) != (want, 1):
        return f"{show(got)}, {tares} tares"
    return ""


def save_while_saving(port):
    save = register(5091, cases.SAVE_WORD)
    with Client(port) as client:
        client.send(adu(save) * 20)
        got = [client.frame()[7:] for _ in range(20)]
        wait_for(lambda: client.ask(read(3, 5091, 1)) != cases.holds(3, 1), 5, "SAVE to end")
        end = client.ask(read(3, 5091, 1))
    bad = [pdu for pdu in got if pdu not in (save, cases.refusal(save, 6))]
    return "" if got[0] == save and not bad and end == cases.holds(3, 0) else f"{show(got)}, at the end {show(end)}"


# name, what is sent, what is expected, section, function
IN_PARALLEL = [
    ("a deaf client", "reads of 125, answers not taken", "closed after 2 s", OURS, deaf),
    ("a second deaf client", "reads of 125, answers not taken", "closed after 2 s", OURS, deaf),
    ("a greedy client", "100 reads at a time for 2 s", "all answers", tcp("4.4.1.2"), greedy),
    ("a second greedy client", "100 reads at a time for 2 s", "all answers", tcp("4.4.1.2"), greedy),
    ("a slow reader", "1000 reads, 512 bytes taken each 5 ms", "all answers", tcp("4.4.2.3"), slow_reader),
    ("a half-closed socket", "100 reads, FIN", "100 answers, closed", OURS, half_closed),
    ("FIN at once", "FIN", "closed", OURS, half_closed_at_once),
    ("FIN in the middle of a frame", "a read and a half, FIN", "one answer, closed", OURS, half_closed_in_a_frame),
]
ONE_BY_ONE = [
    ("an address outside allow", "a read from 127.0.1.1", "closed", tcp("4.2.3"), outside_the_allow_list),
    ("RST in the middle of a frame", "1 .. 11 bytes, RST", "nothing", OURS, reset_in_a_frame),
    ("eight clients byte by byte", "a read each, in turns", "each its own answer", tcp("3.1.3"),
     eight_clients_byte_by_byte),
    ("UNLOCK of a connection that was closed", "UNLOCK, close, a setting", "exception 2", OURS,
     unlock_is_not_inherited),
    ("RST before the answers", "50 reads, RST, 200 times", "nothing", OURS, reset_before_the_answers),
    ("close in the middle of a frame", "1 .. 11 bytes, close", "nothing", OURS, closed_in_a_frame),
    ("mutated frames", "400 of them", "others are served", OURS, mutated_frames),
    ("noise", "200 times up to 600 bytes", "nothing", OURS, noise),
    ("a tare while one runs", "a tare, 0.05 s later 5 more", "one accepted, exception 6, one tare", mb("7"),
     lambda port: tare_while_taring(port, 0.05)),
    ("a tare right behind a tare", "6 tares in one segment", "one accepted, exception 6, one tare", mb("7"),
     tare_while_taring),
    ("a SAVE while one runs", "20 SAVEs in one segment", "accepted or exception 6, at the end 0", mb("7"),
     save_while_saving),
]
BURST = ("a burst of connections", "64 within 10 ms, the daemon is halted", "all connected within 0.7 s", OURS)
CROWDS = [
    ("connect and close", "500 times", "nothing", OURS, connect_and_close),
    ("connect and RST", "500 times", "nothing", OURS, connect_and_reset),
    ("silent clients in every place", "48 connections", "one that speaks is served", OURS, silent_clients),
    ("more clients than places", "16 that poll, 20 more, 5 of a PLC", "16 and 4 served", OURS, full_house),
    ("1100 connections that stay", "nothing", "at most 16 open", OURS, connections_that_stay),
]

# ---- the tables ------------------------------------------------------------------------------------------------------


def show(what):
    if isinstance(what, re.Pattern):
        return f"/{what.pattern!r}/"
    if isinstance(what, (list, tuple)):
        return "[" + " | ".join(map(show, what[:8])) + (f" | .. {len(what)}]" if len(what) > 8 else "]")
    if isinstance(what, bytes):
        return what[:40].hex(" ") + (f" .. {len(what)} bytes" if len(what) > 40 else "")
    return str(what)


def fits(got, wanted):
    if not isinstance(wanted, re.Pattern):
        return got == wanted
    return isinstance(got, bytes) and got[:7] == adu(got[7:])[:7] and wanted.fullmatch(got[7:]) is not None


def wanted_frames(case):
    if isinstance(case.expected, int):
        return [adu(cases.refusal(case.sent, case.expected))]
    if isinstance(case.expected, bytes):
        return [adu(case.expected)]
    return case.expected if isinstance(case.expected, list) else [case.expected]


def may_write(case):
    if isinstance(case.sent, bytes):
        return case.sent[0] in WRITES and not isinstance(case.expected, int)
    return any(frame[7] in WRITES for frame in case.expected if frame != CLOSED)


class Suite:
    """One daemon, its witness, and what went wrong."""

    def __init__(self, daemon):
        self.daemon, self.port = daemon, daemon.port
        self.count = 0
        self.failures = []

    def fail(self, name, sent, got, expected, section):
        self.failures.append(name)
        print(f"{name}: sent {show(sent)}, got {show(got)}, expected {show(expected)} ({section})", flush=True)

    def is_served_afterwards(self, name, seconds=0.0):
        """A fresh connection; `seconds`: how long the places of those that went may stay taken."""
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
                return client.frames(seconds=AT_ONCE_S)
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
            for pdu, answer in case.after:
                if (now := self.control.ask(pdu)) != answer:
                    self.fail(f"{case.name}: afterwards", pdu, now, answer, case.section)
            self.is_served_afterwards(case.name)

    def run_slow(self, slow):
        with Client(self.port) as client:
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
            got = client.frames(seconds=2.5)
            seconds = time.monotonic() - began
            return "" if got == slow.answers + [CLOSED] and 0.9 < seconds < 2 else f"{show(got)} after {seconds:.2f} s"

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
        except OSError as error:  # TimeoutError too
            got = f"{type(error).__name__}: {error}"
        if got:
            self.fail(name, sent, got, expected, section)
        self.is_served_afterwards(name, seconds)


def resident_kib(process):
    return int(re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{process.pid}/status").read_text())[1])


class Hostile(unittest.TestCase):
    def play(self, config, cases_of):
        """Starts a daemon with `config` and a witness, lets `cases_of` run its cases, and looks at what is left."""
        with unit_daemon(rows="0,1,2,-3\n0.005,1,2,-3\n", config=config + SENSOR) as daemon:
            daemon.start()
            wait_for(quality_is(daemon, "good"), 3, "a good sample")
            began = time.monotonic()
            stop = multiprocessing.Event()
            mine, its = multiprocessing.Pipe()
            good_client = multiprocessing.Process(target=witness, args=(daemon.port, stop, its), daemon=True)
            good_client.start()
            try:
                suite = Suite(daemon)
                with Client(daemon.port, source=CONTROL if "plc" in config else "127.0.0.1") as suite.control:
                    suite.state()
                    resident = resident_kib(daemon.process)
                    cases_of(suite)
            finally:
                stop.set()
            self.assertTrue(mine.poll(5), "the witness is gone")
            bad, waits_ms = mine.recv()
            good_client.join()
            waits_ms.sort()
            p50, p99, worst = waits_ms[len(waits_ms) // 2], waits_ms[len(waits_ms) * 99 // 100], waits_ms[-1]
            grown = resident_kib(daemon.process) - resident
            print(f"{suite.count} cases in {time.monotonic() - began:.1f} s; witness: {len(waits_ms)} reads, waits "
                  f"p50 {p50:.2f} p99 {p99:.2f} worst {worst:.2f} ms, {bad}; memory grew by {grown} KiB", flush=True)
            self.assertIsNone(daemon.process.poll(), "the daemon is gone")
            self.assertEqual(suite.failures, [])
            self.assertEqual(sum(bad.values()), 0, bad)
            self.assertLess(worst, WORST_WAIT_MS, "ms, the witness's worst wait")
            self.assertLess(grown, MOST_GROWTH_KIB)
            self.assertNotRegex(daemon.log().lower(), r"error|<[0-3]>")

    def test_a_daemon_that_may_be_written_to(self):
        def run(suite):
            suite.run_parallel(cases.SLOW, IN_PARALLEL)
            for table in (cases.READS, cases.UNSUPPORTED, cases.WRITES_OF_BAD_FORM, cases.WRITES_TO_BAD_ADDRESSES,
                          cases.WRITES_OF_BAD_VALUES, cases.SETTINGS_OUT_OF_RANGE, cases.UNLOCKING,
                          cases.NOT_FROM_HERE, cases.WRITES_OF_GOOD_FORM, cases.SETTINGS_IN_RANGE, cases.COMMANDS,
                          cases.FRAMES):
                suite.run(table)
            suite.run_each(ONE_BY_ONE)
            suite.judge(BURST, lambda: burst_while_the_daemon_is_halted(suite), seconds=2)
            suite.run_each(CROWDS, seconds=2)

        self.play(WRITABLE, run)

    def test_a_daemon_that_is_read_only(self):
        def run(suite):
            suite.run(cases.WRITES_OF_BAD_FORM)
            for table in (cases.WRITES_TO_BAD_ADDRESSES, cases.WRITES_OF_BAD_VALUES, cases.WRITES_OF_GOOD_FORM,
                          cases.READS_OF_SCRATCH):
                suite.run([cases.Case(case.name, case.sent, 2, OURS) for case in table])

        self.play("", run)


if __name__ == "__main__":
    unittest.main(verbosity=2)
