"""Modbus TCP clients that send arbitrary bytes, and a valid one that reads beside them."""
import re
import socket
import struct
import time

from daemon import Stopwatch
from hostile_pdus import CLOSED, adu, read

SILENT = "silent"
PLACES = 16  # for clients, in the daemon
PATIENT_S = 10  # waiting for its second SYN is not a failure for a hostile client
AT_ONCE_S = 0.7  # by a Stopwatch; well below the second that a partial request may take
CONTROL, PLC = "127.0.0.10", "127.0.0.9"


class Client:
    def __init__(self, port, source="127.0.0.1", seconds=PATIENT_S, receive_bytes=None):
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
        """Returns False if the server has closed the connection."""
        try:
            self.socket.sendall(data)
            return True
        except ConnectionError:
            return False

    def frame(self, seconds=None):
        """Returns the next ADU, CLOSED or SILENT; the rest of an incomplete one comes before CLOSED."""
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
        """Returns all frames up to the transaction `last`, or up to CLOSED or SILENT, which is then the last one."""
        heard = []
        while True:
            heard.append(self.frame(seconds))
            if heard[-1] in (CLOSED, SILENT) or last is not None and heard[-1][:2] == last.to_bytes(2, "big"):
                return heard

    def ask(self, pdu):
        """Returns the answer's PDU, CLOSED or SILENT."""
        self.send(adu(pdu))
        answer = self.frame()
        return answer[7:] if isinstance(answer, bytes) else answer

    def reset(self):
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


def witness(port, stop, report):
    """Reads the global block 200 times a second on one connection; reports errors and its waits, less the
    delays of the machine."""
    bad = dict.fromkeys(("missing", "wrong", "torn", "dropped", "heartbeat stood still"), 0)
    waits_ms = []
    client = Client(port)
    watch = Stopwatch()
    transaction, beat, beat_at = 0, None, watch.seconds()
    due = time.monotonic()
    while not stop.is_set():
        due = max(due + 0.005, time.monotonic() - 0.05)
        time.sleep(max(due - time.monotonic(), 0))
        transaction = (transaction + 1) & 0xFFFF
        began = watch.seconds()
        client.send(adu(read(4 if transaction % 2 else 3, 0, 32), transaction, 255))
        frame = client.frame()
        now = watch.seconds()
        waits_ms.append((now - began) * 1000)
        if isinstance(frame, str) or len(frame) != 73:
            bad[{CLOSED: "dropped", SILENT: "missing"}.get(frame, "wrong")] += 1
            client.socket.close()
            client = Client(port)
            continue
        head = struct.pack(">HHHBBB", transaction, 0, 67, 255, 4 if transaction % 2 else 3, 64)
        value = struct.unpack(">32H", frame[9:])
        bad["wrong"] += frame[:9] != head or value[:4] != (0x5441, 0x4354, 0x010A, 1)
        bad["torn"] += value[4] != value[31]
        if value[5] != beat:
            beat, beat_at = value[5], now
        elif now - beat_at > 1:
            bad["heartbeat stood still"] += 1
            beat_at = now
    client.socket.close()
    watch.__exit__()
    report.send((bad, waits_ms))


def show(what):
    if isinstance(what, re.Pattern):
        return f"/{what.pattern!r}/"
    if isinstance(what, (list, tuple)):
        return "[" + " | ".join(map(show, what[:8])) + (f" | .. {len(what)}]" if len(what) > 8 else "]")
    if isinstance(what, bytes):
        return what[:40].hex(" ") + (f" .. {len(what)} bytes" if len(what) > 40 else "")
    return str(what)


def common(a, b):
    return next((n for n, (x, y) in enumerate(zip(a, b)) if x != y), min(len(a), len(b)))
