"""The master's end of a Modbus RTU line, byte by byte: a pty whose other end the daemon opens by a link."""
import os
import pathlib
import select
import struct
import time
import tty

SILENCE_S = 0.1  # limit for an answer, which takes about 3 ms
GAP_S = 0.02     # ends a frame: t3.5 is 2.0 ms at 19200 baud, and a pty has no line time of its own


def crc(frame):
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


def framed(address, pdu):
    frame = bytes([address]) + pdu
    return frame + crc(frame)


def length(frame):
    """Returns the length of the answer that begins so; None: more bytes are needed."""
    if len(frame) < 3:
        return None
    if frame[1] & 0x80:
        return 5
    if frame[1] in (1, 2, 3, 4, 17, 23):
        return 5 + frame[2]
    if frame[1] in (5, 6, 8, 15, 16):  # FC 8 of one word
        return 8
    if frame[1] == 22:
        return 10
    if frame[1] != 43:
        raise AssertionError(f"an answer to no function that was asked: {frame.hex(' ')}")
    at, objects = 8, frame[7] if len(frame) > 7 else 1
    for _ in range(objects):
        if len(frame) < at + 2:
            return None
        at += 2 + frame[at + 1]
    return at + 2


class Line:
    def __init__(self, link, address):
        self.link = pathlib.Path(link)
        self.address = address
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.link.symlink_to(os.ttyname(self.slave))

    def close(self):
        if self.master is not None:
            os.close(self.slave)
            os.close(self.master)
            self.link.unlink()
            self.master = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def write(self, data):
        os.write(self.master, data)

    def read(self, seconds):
        ready, _, _ = select.select([self.master], [], [], seconds)
        return os.read(self.master, 512) if ready else b""

    def heard(self, seconds=SILENCE_S):
        """Returns all bytes that arrive within this time."""
        until, seen = time.monotonic() + seconds, b""
        while (left := until - time.monotonic()) > 0:
            seen += self.read(left)
        return seen

    def ask(self, pdu, seconds=1):
        """Sends a request and returns the PDU of the answer, after checking its frame."""
        self.write(framed(self.address, pdu))
        until, frame = time.monotonic() + seconds, b""
        while (wanted := length(frame)) is None or len(frame) < wanted:
            left = until - time.monotonic()
            if left <= 0:
                raise AssertionError(f"{pdu.hex(' ')}: after {seconds} s the answer is {frame.hex(' ') or 'silence'}")
            frame += self.read(left)
        if len(frame) != wanted or frame[0] != self.address or crc(frame[:-2]) != frame[-2:]:
            raise AssertionError(f"{pdu.hex(' ')}: a bad frame: {frame.hex(' ')}")
        return frame[1:-2]


def read_words(address, count=1, function=3):
    return struct.pack(">BHH", function, address, count)


def write_word(address, value):
    return struct.pack(">BHH", 6, address, value)


def words(pdu):
    """Returns the registers of an answer to FC 3, 4 or 23."""
    return list(struct.unpack(f">{pdu[1] // 2}H", pdu[2:]))
