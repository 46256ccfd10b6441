"""Frames of hostile Modbus TCP clients, whole, cut or late, and the required answers: tables only."""
from dataclasses import dataclass

from hostile_pdus import (CLOSED, FULL_WRITE, GOOD, GOOD_ANSWER, HUNDRED, HUNDRED_ANSWERS, MAGIC, MAGIC_IS, NEXT,
                          NEXT_ANSWER, OURS, SCRATCH, adu, coil, coils, exchange, holds, mask, mb, read, refusal,
                          register, registers, table, tcp, words)


def cut(data, size):
    return [data[at:at + size] for at in range(0, len(data), size)]


FRAMES = table([
    *((f"protocol id {protocol}", [adu(MAGIC, protocol=protocol)], [CLOSED], tcp("4.4.2.1"))
      for protocol in (1, 0x100, 0xFFFF)),
    *((f"length {length}", [adu(MAGIC, length=length)], [CLOSED], OURS) for length in (0, 1, 255, 256, 0x600, 65535)),
    ("length 255 and as much data", [adu(words(16, SCRATCH, 124) + b"\xF8" + bytes(248))], [CLOSED], mb("4.1")),
    ("the header of length 0 alone", [bytes(6)], [CLOSED], OURS),
    ("the header of length 65535 alone", [adu(b"", length=65535)[:6]], [CLOSED], OURS),
    ("a write with protocol id 1", [adu(register(SCRATCH, 1), protocol=1)], [CLOSED], tcp("4.4.2.1")),
    ("a write with length 255", [adu(register(SCRATCH, 1), length=255)], [CLOSED], OURS),
    ("a length one shorter than the PDU", [adu(MAGIC, length=5) + NEXT], [adu(refusal(MAGIC, 3)), CLOSED],
     tcp("3.1.3")),
    ("a length one longer than the PDU", [adu(MAGIC, length=7) + NEXT], [adu(refusal(MAGIC, 3)), CLOSED],
     tcp("3.1.3")),
    ("FC 6 cut before its value, then a good frame", [adu(register(SCRATCH, 1)[:3]) + NEXT],
     [adu(bytes([0x86, 3])), NEXT_ANSWER], tcp("3.1.3")),
    ("FC 6 cut in its value, then a good frame", [adu(register(SCRATCH, 1)[:4]) + NEXT],
     [adu(bytes([0x86, 3])), NEXT_ANSWER], tcp("3.1.3")),
    ("FC 5 cut before its value, then a good frame", [adu(coil(32, 0xFF00)[:3]) + NEXT],
     [adu(bytes([0x85, 3])), NEXT_ANSWER], tcp("3.1.3")),
    ("FC 15 cut before its data, then a good frame", [adu(coils(0, 16)[:6]) + NEXT],
     [adu(bytes([0x8F, 3])), NEXT_ANSWER], tcp("3.1.3")),
    ("FC 16 cut before its data, then a good frame", [adu(registers(SCRATCH, (1, 2))[:6]) + NEXT],
     [adu(bytes([0x90, 3])), NEXT_ANSWER], tcp("3.1.3")),
    ("FC 16 cut in its data, then a good frame", [adu(registers(SCRATCH, (1, 2))[:8]) + NEXT],
     [adu(bytes([0x90, 3])), NEXT_ANSWER], tcp("3.1.3")),
    ("FC 22 cut in its masks, then a good frame", [adu(mask(SCRATCH, 0, 1)[:5]) + NEXT],
     [adu(bytes([0x96, 3])), NEXT_ANSWER], tcp("3.1.3")),
    ("FC 23 cut before its data, then a good frame", [adu(exchange(0, 2, SCRATCH, (1, 2))[:10]) + NEXT],
     [adu(bytes([0x97, 3])), NEXT_ANSWER], tcp("3.1.3")),
    ("a frame in single bytes", cut(GOOD, 1), [GOOD_ANSWER], tcp("3.1.3")),
    ("a header in single bytes, then the rest and another frame", cut(GOOD[:7], 1) + [GOOD[7:] + NEXT],
     [GOOD_ANSWER, NEXT_ANSWER], tcp("3.1.3")),
    ("a write in single bytes", cut(adu(register(SCRATCH, 0x1111)), 1), [adu(register(SCRATCH, 0x1111))],
     tcp("3.1.3"), (), (), ((read(3, SCRATCH, 1), holds(3, 0x1111)),)),
    ("a frame and a half, then the other half", [GOOD + NEXT[:6], NEXT[6:]], [GOOD_ANSWER, NEXT_ANSWER], tcp("3.1.3")),
    ("100 requests in one segment", [b"".join(HUNDRED)], HUNDRED_ANSWERS, tcp("4.4.1.2")),
    ("100 requests in pieces of 7 bytes", cut(b"".join(HUNDRED), 7), HUNDRED_ANSWERS, tcp("4.4.1.2")),
    ("100 exceptions in one segment", [b"".join(adu(bytes([n]), n) for n in range(65, 165))],
     [adu(bytes([n | 0x80, 1]), n) for n in range(65, 165)], mb("7")),
    ("good requests behind exceptions", [adu(bytes([7]), 1) + NEXT + adu(read(3, 0, 0), 2) + GOOD],
     [adu(bytes([0x87, 1]), 1), NEXT_ANSWER, adu(bytes([0x83, 3]), 2), GOOD_ANSWER], mb("7")),
    ("one transaction id twice", [GOOD + GOOD], [GOOD_ANSWER, GOOD_ANSWER], tcp("4.4.2.3")),
    ("a good request, then protocol id 1", [GOOD + adu(MAGIC, protocol=1)], [GOOD_ANSWER, CLOSED], tcp("4.4.2.1")),
    ("a good request, then length 0", [GOOD + bytes(12)], [GOOD_ANSWER, CLOSED], OURS),
    ("a good request, then noise", [GOOD + bytes(range(0x50, 0x90))], [GOOD_ANSWER, CLOSED], OURS),
    ("three good requests, then length 65535", [GOOD + NEXT + GOOD + adu(MAGIC, length=65535)],
     [GOOD_ANSWER, NEXT_ANSWER, GOOD_ANSWER, CLOSED], OURS),
    ("a good write, then garbage", [adu(register(SCRATCH, 0x2222)) + b"\xFF" * 300],
     [adu(register(SCRATCH, 0x2222)), CLOSED], OURS),
    *((f"transaction id 0x{number:04X}", [adu(MAGIC, number)], [adu(MAGIC_IS, number)], tcp("4.4.2.3"))
      for number in (0, 1, 0x8000, 0xFFFF)),
    *((f"unit id {unit}", [adu(MAGIC, unit=unit)], [adu(MAGIC_IS, unit=unit)], tcp("4.4.2.3"))
      for unit in (0, 2, 127, 247, 248, 255)),
    ("an exception to transaction 0xFFFF, unit 255", [adu(bytes([7]), 0xFFFF, 255)],
     [adu(bytes([0x87, 1]), 0xFFFF, 255)], tcp("4.4.2.3")),
    ("an RTU frame that happens to be one of TCP", [bytes.fromhex("01 03 00 00 00 02 c4 0b")],
     [bytes.fromhex("01 03 00 00 00 03 c4 8b 01")], mb("7")),
    ("a TLS hello", [bytes.fromhex("16 03 01 00 a5 01 00 00 a1 03 03") + bytes(range(160))], [CLOSED],
     tcp("4.4.2.1")),
    ("HTTP", [b"GET / HTTP/1.1\r\nHost: plc\r\n\r\n"], [CLOSED], tcp("4.4.2.1")),
    ("an SSH banner", [b"SSH-2.0-OpenSSH_9.2\r\n"], [CLOSED], tcp("4.4.2.1")),
    ("an S7 connection request",
     [bytes.fromhex("03 00 00 16 11 e0 00 00 00 01 00 c1 02 01 00 c2 02 01 02 c0 01 0a")], [CLOSED], tcp("4.4.2.1")),
    ("EtherNet/IP: list identity", [b"\x63" + bytes(23)], [CLOSED], OURS),
    ("64 KiB of zeros", [bytes(65536)], [CLOSED], OURS),
    ("64 KiB of ones", [b"\xFF" * 65536], [CLOSED], tcp("4.4.2.1")),
])

@dataclass
class Slow:
    """Pieces, sent `gap_s` apart; then the answers, and whether the connection is closed 1 s after its start."""
    name: str
    pieces: list
    gap_s: float
    answers: list
    is_closed: bool
    section: str = OURS


SLOW = [
    Slow("one byte, then silence", [b"\0"], 0, [], True),
    Slow("half a header, then silence", [GOOD[:3]], 0, [], True),
    Slow("a header, then silence", [GOOD[:7]], 0, [], True),
    Slow("all but the last byte, then silence", [GOOD[:-1]], 0, [], True),
    Slow("a length longer than the PDU, then silence", [adu(MAGIC, length=20)], 0, [], True),
    Slow("a write without its last byte, then silence", [adu(registers(SCRATCH, FULL_WRITE))[:-1]], 0, [], True),
    Slow("a frame and a half, then silence", [GOOD + NEXT[:5]], 0, [GOOD_ANSWER], True),
    Slow("a drip, 0.3 s a byte", cut(GOOD, 1), 0.3, [], True),
    Slow("a drip of a long write, 0.04 s a byte", cut(adu(registers(SCRATCH, FULL_WRITE)), 1), 0.04, [], True),
    Slow("a drip that is fast enough", cut(GOOD, 1), 0.05, [GOOD_ANSWER], False),
    Slow("two halves, 0.5 s apart", [GOOD[:6], GOOD[6:]], 0.5, [GOOD_ANSWER], False),
    Slow("a frame every 0.5 s, each begun with the one before",
         [GOOD + NEXT[:5], NEXT[5:] + GOOD[:5], GOOD[5:] + NEXT[:5], NEXT[5:] + GOOD[:5], GOOD[5:]], 0.5,
         [GOOD_ANSWER, NEXT_ANSWER, GOOD_ANSWER, NEXT_ANSWER, GOOD_ANSWER], False),
    Slow("nothing for 3 s, then a request", [b"", GOOD], 3, [GOOD_ANSWER], False),
]
