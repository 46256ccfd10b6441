"""A model of the ORCA hand's tactile pads on a pseudo terminal, written from the facts of the maker's public client:

request  55 AA 00 function address(2) count(2) [data] LRC   function 0x03 reads, 0x10 writes registers
reply    AA 55 00 function address(2) count(2) data LRC     the data of a write are one byte, 0 = done
stream   AA 56 00 length(2) error taxels LRC                length counts error and taxels; three bytes a taxel

Numbers are little-endian; the sum of all bytes of a message is 0 modulo 256."""
import os
import select
import struct
import threading
import time
import tty

PADS = {"thumb": 51, "index": 87, "middle": 87, "ring": 87, "little": 51}  # in the order of the sockets
TAXELS = sum(PADS.values())
READ, WRITE = 0x03, 0x10
TYPE, ENABLED = 0x0016, 0x0017  # registers
RESULTANTS, FORCES = 1, 2  # bits of TYPE
COUNTS, COUNT_STEP = 0x0034, 8  # taxels of the first pad, and the distance of the next pad's register
BYTES_PER_S = 921600 / 10


def first_taxel(pad):
    """The index of a pad's first taxel in the stream of all pads."""
    names = list(PADS)
    return sum(PADS[name] for name in names[:names.index(pad)])


def with_lrc(message):
    return message + bytes([-sum(message) & 0xFF])


class OrcaHand:
    """Streams frames at the rate of the wire, at most `rate_Hz`, while its registers ask for them. The port is the link `path`.
    A context manager. Attributes that a test may change while it runs:

    counts: {(pad, taxel of the pad): (Fx, Fy, Fz)} in 0.1 N; other taxels have no load
    error: the error byte
    unplugged: set of pads without taxels in the stream
    is_silent: sends nothing
    damage: a function of a frame's bytes that returns those on the wire, for the next frame alone"""

    def __init__(self, path, rate_Hz=84):
        self.rate_Hz = rate_Hz
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        path.symlink_to(os.ttyname(self.slave))
        self.counts, self.error, self.unplugged, self.is_silent, self.damage = {}, 0, set(), False, None
        self.frames, self.writes, self.wrong = 0, [], []
        self.lock = threading.Lock()  # guards registers
        self.registers, self.heard = {}, b""
        self.ended, self.thread = False, threading.Thread(target=self.run, daemon=True)

    def restart(self):
        """The hand loses its supply for a moment: the registers have their first values, and the stream is off."""
        with self.lock:
            self.registers, self.heard = {}, b""

    def frame(self):
        taxels = b""
        for pad, n in PADS.items():
            if pad not in self.unplugged:
                taxels += b"".join(struct.pack("<bbB", *self.counts.get((pad, i), (0, 0, 0))) for i in range(n))
        return with_lrc(struct.pack("<BBBHB", 0xAA, 0x56, 0, 1 + len(taxels), self.error) + taxels)

    def register(self, address):
        pad = (address - COUNTS) // COUNT_STEP
        if 0 <= pad < len(PADS) and (address - COUNTS) % COUNT_STEP == 0:
            name = list(PADS)[pad]
            return 0 if name in self.unplugged else PADS[name]
        return self.registers.get(address, 0)

    def replies(self):
        """Takes complete requests from `heard`; a byte that cannot begin one is dropped and listed in `wrong`."""
        out = b""
        while len(self.heard) >= 9:
            if self.heard[:3] != b"\x55\xAA\0" or self.heard[3] not in (READ, WRITE):
                self.wrong.append(self.heard[0])
                self.heard = self.heard[1:]
                continue
            function, address, count = struct.unpack_from("<BHH", self.heard, 3)
            size = 9 + (count if function == WRITE else 0)
            if len(self.heard) < size:
                break
            request, self.heard = self.heard[:size], self.heard[size:]
            if sum(request) & 0xFF:
                self.wrong.append(request)
                continue
            if function == WRITE:
                self.writes.append((address, request[8:-1]))
                self.registers.update(enumerate(request[8:-1], address))
                data = b"\0"
            else:
                data = bytes(self.register(address + i) for i in range(count))
            out += with_lrc(struct.pack("<BBBBHH", 0xAA, 0x55, 0, function, address, len(data)) + data)
        return out

    def listen(self, wait_s):
        if not select.select([self.master], [], [], wait_s)[0]:
            return
        with self.lock:
            try:
                self.heard += os.read(self.master, 4096)
            except (BlockingIOError, OSError):
                return
            self.send(self.replies())

    def send(self, message):
        """The bytes that the port has no room for are lost, as in an adapter that no program reads."""
        try:
            os.write(self.master, message)
        except BlockingIOError:
            pass

    def run(self):
        due_s = time.monotonic()
        while not self.ended:
            self.listen(max(0, min(0.02, due_s - time.monotonic())))
            if time.monotonic() < due_s:
                continue
            with self.lock:
                is_on = self.registers.get(ENABLED) == 1 and self.registers.get(TYPE) == FORCES
            message = self.frame()
            due_s = max(due_s, time.monotonic() - 0.1) + max(1 / self.rate_Hz, len(message) / BYTES_PER_S)
            if not is_on or self.is_silent:
                continue
            damage, self.damage = self.damage, None
            self.send(damage(message) if damage else message)
            self.frames += 1

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.ended = True
        self.thread.join()
        os.close(self.master)
        os.close(self.slave)
