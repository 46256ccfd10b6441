"""Modbus PDUs and frames byte by byte, including invalid ones, and the fields of a case in the hostile tables.

Sections: mb() is the Modbus Application Protocol 1.1b3, tcp() the Messaging on TCP/IP Guide 1.0b, OURS if both are
silent and the register map or the manual decides.
"""
import re
import struct
from dataclasses import dataclass

OURS = "ours"
CLOSED = "closed"
TRANSACTION, UNIT = 0x1234, 1
SUPPORTED = {1, 2, 3, 4, 5, 6, 8, 15, 16, 17, 22, 23, 43}
OTHERS = [n for n in range(256) if n not in SUPPORTED]
SCRATCH, SCRATCH_END = 5100, 5228
UNLOCK_WORD, SAVE_WORD = 0x5AFE, 0x7361


def mb(section):
    return f"MB 1.1b3 {section}"


def tcp(section):
    return f"MBTCP 1.0b {section}"


@dataclass
class Case:
    """A request that is answered completely, and in order, by `expected`; an exception or CLOSED also means that no
    register was written."""
    name: str
    sent: object  # a PDU, or a list of raw pieces, each sent separately
    expected: object  # exception code, PDU, pattern of a PDU, CLOSED; or a list of raw ADUs and perhaps CLOSED
    section: str
    before: tuple = ()  # PDUs that are sent first and accepted
    elsewhere: tuple = ()  # the same on another connection, which stays open
    after: tuple = ()  # pairs of a PDU and its answer, on another connection
    source: str = "127.0.0.1"


def words(function, *values):
    return struct.pack(f">B{len(values)}H", function, *values)


def read(function, at, count):
    return words(function, at, count)


def coil(at, value):
    return words(5, at, value)


def register(at, value):
    return words(6, at, value)


def coils(at, count, data=None, byte_count=None):
    data = bytes((count + 7) // 8) if data is None else data
    return words(15, at, count) + bytes([len(data) if byte_count is None else byte_count]) + data


def registers(at, values, count=None, byte_count=None):
    data = struct.pack(f">{len(values)}H", *values)
    return words(16, at, len(values) if count is None else count) \
        + bytes([len(data) if byte_count is None else byte_count]) + data


def mask(at, keep, add):
    return words(22, at, keep, add)


def exchange(read_at, read_count, at, values, count=None, byte_count=None):
    data = struct.pack(f">{len(values)}H", *values)
    return words(23, read_at, read_count, at, len(values) if count is None else count) \
        + bytes([len(data) if byte_count is None else byte_count]) + data


def identity(*rest):
    return bytes([43, *rest])


def adu(pdu, transaction=TRANSACTION, unit=UNIT, protocol=0, length=None):
    return struct.pack(">HHHB", transaction, protocol, len(pdu) + 1 if length is None else length, unit) + pdu


def refusal(pdu, exception):
    return bytes([pdu[0] | 0x80, exception])


def holds(function, *values):
    return bytes([function, 2 * len(values)]) + struct.pack(f">{len(values)}H", *values)


def some(function, size):
    """Any answer to a read with `size` bytes of data."""
    return re.compile(re.escape(bytes([function, size])) + b".{%d}" % size, re.DOTALL)


def objects(code, first, count, text):
    """An answer of `count` objects, whose object `first` is `text`."""
    head, one = bytes([43, 14, code]), bytes([count, first, len(text)]) + text
    return re.compile(re.escape(head) + b".\0\0" + re.escape(one) + b".*", re.DOTALL)


def table(rows):
    return [Case(*row) for row in rows]


MAGIC = read(3, 0, 2)
MAGIC_IS = holds(3, 0x5441, 0x4354)
UNLOCK, LOCK = register(5090, UNLOCK_WORD), register(5090, 0)
FULL_WRITE = tuple(range(0x4000, 0x4000 + 123))

GOOD, GOOD_ANSWER = adu(MAGIC), adu(MAGIC_IS)
NEXT, NEXT_ANSWER = adu(MAGIC, 0x4242), adu(MAGIC_IS, 0x4242)
HUNDRED = [adu(read(3, 9000 + n % 12, 1), n) for n in range(100)]
CONSTANTS = (0x1234, 0xFB2E, 0x1234, 0x5678, 0x449A, 0x5000, 0x5000, 0x449A, 0x4142, 0x4344, 0x4546, 0x4748)
HUNDRED_ANSWERS = [adu(holds(3, CONSTANTS[n % 12]), n) for n in range(100)]
