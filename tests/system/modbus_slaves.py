"""Modbus slaves for a test: pymodbus' own, and one that misbehaves depending on a seed."""
import os
import pathlib
import random
import select
import socket
import struct
import subprocess
import sys
import threading
import time
import tty

sys.path.insert(0, str(pathlib.Path(__file__).parent / "interop"))
from rtu_line import crc  # noqa: E402

PYMODBUS = """
import sys
from pymodbus.datastore import ModbusServerContext, ModbusSlaveContext, ModbusSequentialDataBlock
from pymodbus.server import StartSerialServer, StartTcpServer
try:
    from pymodbus.framer import FramerType  # pymodbus 3.8, Debian 13
    rtu = FramerType.RTU
except ImportError:
    from pymodbus.transaction import ModbusRtuFramer as rtu  # pymodbus 3.0, Debian 12
kind, where, unit, first = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
block = ModbusSequentialDataBlock(first + 1, [int(v) & 0xFFFF for v in sys.argv[5:]])
context = ModbusServerContext(slaves={unit: ModbusSlaveContext(hr=block, ir=block)}, single=False)
if kind == "tcp":
    StartTcpServer(context=context, address=("127.0.0.1", int(where)))
else:
    StartSerialServer(context=context, framer=rtu, port=where, baudrate=19200, timeout=0.005)
"""


def pymodbus_slave(kind, where, unit, first, values):
    """A process that serves `values` from register `first` on, for functions 3 and 4. kind: "tcp" (a port) or "rtu" (a tty)."""
    return subprocess.Popen(["/usr/bin/python3", "-c", PYMODBUS, kind, str(where), str(unit), str(first), *map(str, values)])


class Pty:
    """One end of a serial line; the daemon opens `link`."""

    def __init__(self, link):
        self.link = pathlib.Path(link)
        self.master = None
        self.plug()

    def plug(self):
        self.master, slave = os.openpty()
        tty.setraw(slave)
        name = os.ttyname(slave)
        os.close(slave)
        if self.link.is_symlink():
            self.link.unlink()
        self.link.symlink_to(name)

    def receive(self, seconds):
        try:
            ready, _, _ = select.select([self.master], [], [], seconds)
            return os.read(self.master, 512) if ready else b""
        except OSError:  # the other end is not open
            time.sleep(0.01)
            return b""

    def send(self, data):
        os.write(self.master, data)

    def hang_up(self):
        os.close(self.master)
        time.sleep(0.1)
        self.plug()

    def close(self):
        os.close(self.master)


class Server:
    """One TCP client at a time."""

    def __init__(self):
        self.listener = socket.socket()
        self.listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.listener.bind(("127.0.0.1", 0))
        self.listener.listen()
        self.port = self.listener.getsockname()[1]
        self.client = None

    def receive(self, seconds):
        ready, _, _ = select.select([self.client or self.listener], [], [], seconds)
        if not ready:
            return b""
        if self.client is None:
            self.client, _ = self.listener.accept()
            return b""
        try:
            data = self.client.recv(512)
        except ConnectionResetError:  # the daemon closed it while an answer was on its way
            data = b""
        if not data:
            self.hang_up()
        return data

    def send(self, data):
        if self.client is not None:
            try:
                self.client.sendall(data)
            except OSError:
                self.hang_up()

    def hang_up(self):
        if self.client is not None:
            self.client.close()
        self.client = None

    def close(self):
        self.hang_up()
        self.listener.close()


class Hostile(threading.Thread):
    """Answers function 3 at unit 1, in order, as a slave does. A good answer has n, -n, 1 with n in 0 .. 7; an answer
    that must not be used has 9, 9, 9. `misdeeds`: name -> share of the requests."""

    def __init__(self, end, misdeeds, seed, late_s=0.09):
        super().__init__(daemon=True)
        self.end, self.misdeeds, self.random, self.late_s = end, misdeeds, random.Random(seed), late_s
        self.rtu = isinstance(end, Pty)
        self.done = {}  # misdeed -> count
        self.asked_s = []  # time of receipt of each request
        self.ended = False
        self.n = 0

    def run(self):
        waiting = b""
        while not self.ended:
            data = self.end.receive(0.05)
            waiting = waiting + data
            while len(waiting) >= (8 if self.rtu else 12):
                request, waiting = waiting[:8 if self.rtu else 12], waiting[8 if self.rtu else 12:]
                if not self.answer(request):
                    waiting = b""

    def answer(self, request):
        self.asked_s.append(time.monotonic())
        transaction, pdu = (b"", request[:6]) if self.rtu else (request[:2], request[6:])
        count = struct.unpack(">H", pdu[4:6])[0]
        what = self.choose()
        self.done[what] = self.done.get(what, 0) + 1
        self.n += 1
        step = self.n // 32 % 8  # a force rests between steps
        good = [step, -step, 1]
        values = (good if what in ("good", "noise", "slow", "twice") else [9, 9, 9]) + [9] * 200
        unit = 2 if what == "unit" else 1
        body = bytes([unit, 3, 2 * count]) + struct.pack(f">{count}h", *values[:count])
        if what == "length":
            body = bytes([1, 3, 2 * count + 2]) + struct.pack(f">{count + 1}h", *values[:count + 1])
        if what == "exception":
            body = bytes([1, 0x83, 4])
        if what == "function":
            body = bytes([1, 4]) + body[2:]
        if what == "transaction":
            transaction = struct.pack(">H", struct.unpack(">H", transaction)[0] ^ 0x0101)
        frame = body + crc(body) if self.rtu else transaction + b"\0\0" + struct.pack(">H", len(body)) + body
        if what == "checksum":
            frame = frame[:4] + bytes([frame[4] ^ 0x40]) + frame[5:]
        if what == "short":
            frame = frame[:-3]
        if what == "noise":
            frame = bytes(self.random.randrange(256) for _ in range(5)) + frame
        if what == "late":
            time.sleep(self.late_s)
        if what == "slow":
            time.sleep(0.02)
        if what == "hang_up":
            self.end.hang_up()
            return False
        if what != "silence":
            self.end.send(frame)
        if what == "twice":  # the same transaction again
            self.end.send(frame[:9] + struct.pack(f">{count}h", *[9] * count))
        return True

    def choose(self):
        x = self.random.random()
        for name, share in self.misdeeds.items():
            x -= share
            if x < 0:
                return name
        return "good"

    def close(self):
        self.ended = True
        self.join()
        self.end.close()
