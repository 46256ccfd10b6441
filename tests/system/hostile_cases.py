"""Requests of hostile Modbus TCP clients and the required answers: tables of PDUs only.

The daemon has one sensor, commands and scratch registers, and 16 places for clients; nothing is unlocked.
"""
import re

from hostile_pdus import (FULL_WRITE, LOCK, MAGIC, MAGIC_IS, OTHERS, OURS, SAVE_WORD, SCRATCH, SCRATCH_END, UNLOCK,
                          UNLOCK_WORD, Case, adu, coil, coils, exchange, holds, identity, mask, mb, objects, read,
                          refusal, register, registers, some, table, words)

# ---- reading ---------------------------------------------------------------------------------------------------------

READS = table([
    *((f"FC {fc} {what}", pdu, expected, mb(section))
      for fc, size, section in ((1, 34, "6.1"), (2, 68, "6.2"))
      for what, pdu, expected in (
          ("of nothing", read(fc, 0, 0), 3),
          ("of nothing, outside", read(fc, 40000, 0), 3),
          ("of 2001", read(fc, 0, 2001), 3),
          ("of 0xFFFF", read(fc, 0, 0xFFFF), 3),
          ("of 2000, more than there are", read(fc, 0, 2000), 2),
          ("of all", read(fc, 0, size), some(fc, (size + 7) // 8)),
          ("of all and one", read(fc, 0, size + 1), 2),
          ("of the last", read(fc, size - 1, 1), some(fc, 1)),
          ("one beyond", read(fc, size, 1), 2),
          ("across the end", read(fc, size - 1, 2), 2),
          ("at 0xFFFF", read(fc, 0xFFFF, 1), 2),
          ("wrapping to 0", read(fc, 0xFFFF, 2), 2),
          ("one byte short", read(fc, 0, 1)[:-1], 3),
          ("one byte long", read(fc, 0, 1) + b"\0", 3),
          ("of the function alone", bytes([fc]), 3))),
    *((f"FC {fc} {what}", pdu, expected, mb(section))
      for fc, section in ((3, "6.3"), (4, "6.4"))
      for what, pdu, expected in (
          ("of nothing", read(fc, 0, 0), 3),
          ("of nothing, outside", read(fc, 40000, 0), 3),
          ("of 125", read(fc, 100, 125), some(fc, 250)),
          ("of 126", read(fc, 100, 126), 3),
          ("of 256, whose byte count wraps to 0", read(fc, 100, 256), 3),
          ("of 0xFFFF", read(fc, 0, 0xFFFF), 3),
          ("wrapping to 0", read(fc, 0xFFFF, 2), 2),
          ("125 wrapping to 0", read(fc, 0xFFF0, 125), 2),
          ("one byte short", read(fc, 0, 1)[:-1], 3),
          ("one byte long", read(fc, 0, 1) + b"\0", 3),
          ("of the function alone", bytes([fc]), 3),
          ("in the longest frame there is", read(fc, 0, 1) + bytes(248), 3))),
    *((f"FC {fc} {what} of {first}..{last}", read(fc, at, count), expected(fc), mb(section))
      for fc, section in ((3, "6.3"), (4, "6.4"))
      for first, last in ((0, 31), (100, 499), (600, 724), (2000, 2025), (2100, 2947), (3000, 3025), (3100, 3947), (9000, 9011), (9100, 9115))
      for what, at, count, expected in (
          ("at the end", last, 1, lambda fc: some(fc, 2)),
          ("beyond the end", last + 1, 1, lambda _: 2),
          ("across the end", last, 2, lambda fc: some(fc, 4)),
          ("across the start", (first - 1) & 0xFFFF, 2, lambda fc, first=first: some(fc, 4) if first else 2))),
    *((f"FC {fc} of a whole scan", read(fc, 0, 125), some(fc, 250), OURS) for fc in (3, 4)),
    ("FC 3 of the cells between two blocks", read(3, 88, 12), 2, OURS),
    *((f"FC 3 of {what}", read(3, at, count), 2, OURS) for what, at, count in (
        ("a head of an array and more", 10015, 2), ("a hole and a head", 9999, 17), ("the last head and a hole", 10255, 2),
        ("a hole and a page", 10999, 2), ("two pages", 11001, 125), ("the last page and more", 23499, 2))),
    ("FC 3 at the end of the writable block", read(3, 5099, 1), holds(3, 0), mb("6.3")),
    ("FC 3 across the start of the writable block", read(3, 4999, 2), some(3, 4), mb("6.3")),
    ("FC 4 across the start of the writable block", read(4, 4999, 2), 2, mb("6.4")),
    ("FC 3 from the writable block into scratch", read(3, 5099, 2), some(3, 4), mb("6.3")),
    ("FC 3 beyond scratch", read(3, SCRATCH_END, 1), 2, mb("6.3")),
    ("FC 3 across the end of scratch", read(3, SCRATCH_END - 1, 2), some(3, 4), mb("6.3")),
    ("FC 3 of the last constant", read(3, 9011, 1), holds(3, 0x4748), OURS),
    ("FC 3 of reserved cells", read(3, 5036, 4), holds(3, 0, 0, 0, 0), OURS),
    ("FC 4 of the writable block", read(4, 5000, 1), 2, OURS),
    ("FC 4 of a scratch register", read(4, SCRATCH, 1), 2, OURS),
])

UNSUPPORTED = table([
    *((f"FC {pdu[0]}", pdu, 1, mb(section)) for pdu, section in (
        (bytes([0]), "4.1"),
        (words(0, 0, 1), "4.1"),
        (bytes([7]), "6.7"),
        (words(8, 1, 0), "6.8"),
        (words(8, 4, 0), "6.8"),
        (bytes([11]), "6.9"),
        (bytes([12]), "6.10"),
        (bytes([20, 7, 6, 0, 1, 0, 0, 0, 1]), "6.14"),
        (bytes([21, 9, 6, 0, 1, 0, 0, 0, 1, 0, 1]), "6.15"),
        (words(24, 0), "6.18"),
        (bytes([65, 1, 2, 3]), "5"),
        (bytes([100]), "5"),
        (bytes([127]), "5"),
        (read(0x80, 0, 1), "4.1"),
        (read(0x83, 0, 2), "4.1"),
        (words(0x86, SCRATCH, 1), "4.1"),
        (bytes([0xFF]), "4.1"))),
    ("an unsupported function in the longest frame there is", bytes([65]) + bytes(252), 1, mb("7")),
    *((f"FC 43 with MEI type {mei}", identity(mei, 1, 0), 1, mb("6.19")) for mei in (0, 1, 13, 15, 0x8E, 0xFF)),
    ("every function that is not supported, alone and with data",
     [adu(bytes([n]) + data, n) for n in OTHERS for data in (b"", words(0, 0, 1)[1:])],
     [adu(bytes([n | 0x80, 1]), n) for n in OTHERS for _ in range(2)], mb("7")),
    ("FC 8 repeats its data", words(8, 0, 0x1234), words(8, 0, 0x1234), mb("6.8")),
    ("FC 8 repeats as much as there can be", words(8, 0) + bytes(250), words(8, 0) + bytes(250), mb("6.8")),
    ("FC 8 alone", bytes([8]), 3, mb("6.8")),
    ("FC 8 without data", words(8, 0), 3, mb("6.8")),
    ("FC 8 with half a word", words(8, 0) + b"1", 3, mb("6.8")),
    ("FC 17", bytes([17]), re.compile(rb"\x11.T\xfftactiled \d+\.\d+\.\d+", re.DOTALL), mb("6.13")),
    ("FC 17 one byte long", bytes([17, 0]), 3, mb("6.13")),
    ("FC 43 alone", identity(), re.compile(b"\xab[\x01\x03]"), mb("6.19")),
    ("FC 43/14 without code and object", identity(14), 3, mb("6.21")),
    ("FC 43/14 without object", identity(14, 1), 3, mb("6.21")),
    ("FC 43/14 one byte long", identity(14, 1, 0, 0), 3, mb("6.21")),
    *((f"FC 43/14 with code {code}", identity(14, code, 0), 3, mb("6.21")) for code in (0, 5, 0x80, 0xFF)),
    ("FC 43/14 with a bad code and a bad object", identity(14, 5, 0x50), 3, mb("6.21")),
    *((f"FC 43/14 of object {number}", identity(14, 4, number), 2, mb("6.21")) for number in (7, 0x50, 0x80, 0xFF)),
    *((f"FC 43/14 with code {code} from object 0xFF", identity(14, code, 0xFF), objects(code, 0, count, b"tactiled"),
       mb("6.21")) for code, count in ((1, 3), (2, 7), (3, 7))),
    ("FC 43/14 of one object", identity(14, 4, 0), objects(4, 0, 1, b"tactiled"), mb("6.21")),
])

# ---- writing: refused for their form or their address, with and without `commands` -----------------------------------

WRITES_OF_BAD_FORM = table([
    *((f"FC 5 with 0x{value:04X}", coil(0, value), 3, mb("6.5"))
      for value in (1, 0xFF, 0x100, 0xFE00, 0xFF01, 0xFFFF)),
    ("FC 5 with 0x1234, outside", coil(34, 0x1234), 3, mb("6.5")),
    ("FC 5 one byte short", coil(32, 0xFF00)[:-1], 3, mb("6.5")),
    ("FC 5 one byte long", coil(32, 0xFF00) + b"\0", 3, mb("6.5")),
    ("FC 6 one byte short", register(SCRATCH, 1)[:-1], 3, mb("6.6")),
    ("FC 6 without a value", register(SCRATCH, 1)[:-2], 3, mb("6.6")),
    ("FC 6 one byte long", register(SCRATCH, 1) + b"\0", 3, mb("6.6")),
    ("FC 6 alone", bytes([6]), 3, mb("6.6")),
    ("FC 15 of nothing", coils(0, 0), 3, mb("6.11")),
    ("FC 15 of nothing, with a byte", coils(0, 0, b"\1"), 3, mb("6.11")),
    ("FC 15 of 1969", coils(0, 1969), 3, mb("6.11")),
    ("FC 15 of 0xFFFF", coils(0, 0xFFFF, bytes(246)), 3, mb("6.11")),
    ("FC 15 of 8 with two bytes", coils(0, 8, b"\0\0"), 3, mb("6.11")),
    ("FC 15 of 9 with one byte", coils(0, 9, b"\0"), 3, mb("6.11")),
    ("FC 15 with byte count 0", coils(32, 1, b"\1", 0), 3, mb("6.11")),
    ("FC 15 with byte count 255", coils(32, 1, b"\1", 255), 3, mb("6.11")),
    ("FC 15 one byte short", coils(16, 16)[:-1], 3, mb("6.11")),
    ("FC 15 one byte long", coils(16, 16) + b"\0", 3, mb("6.11")),
    ("FC 15 without its byte count", words(15, 0, 1), 3, mb("6.11")),
    ("FC 16 of nothing", registers(SCRATCH, ()), 3, mb("6.12")),
    ("FC 16 of nothing, with a register", registers(SCRATCH, (1,), 0), 3, mb("6.12")),
    ("FC 16 of 124 with 123", registers(SCRATCH, FULL_WRITE, 124), 3, mb("6.12")),
    ("FC 16 of 124, byte count 248", registers(SCRATCH, FULL_WRITE, 124, 248), 3, mb("6.12")),
    ("FC 16 of 129, whose byte count wraps to 2", registers(SCRATCH, (1,), 129), 3, mb("6.12")),
    ("FC 16 of 0xFFFF", registers(SCRATCH, (1, 2), 0xFFFF), 3, mb("6.12")),
    ("FC 16 with a byte count too small", registers(SCRATCH, (1, 2), 2, 2), 3, mb("6.12")),
    ("FC 16 with a byte count too large", registers(SCRATCH, (1,), 1, 4), 3, mb("6.12")),
    ("FC 16 with an odd byte count", registers(SCRATCH, (1,), 1, 3) + b"\0", 3, mb("6.12")),
    ("FC 16 with byte count 0", registers(SCRATCH, (1,), 1, 0), 3, mb("6.12")),
    ("FC 16 with more data than its count", registers(SCRATCH, (1, 2), 1), 3, mb("6.12")),
    ("FC 16 one byte short", registers(SCRATCH, (1, 2))[:-1], 3, mb("6.12")),
    ("FC 16 one byte long", registers(SCRATCH, (1, 2)) + b"\0", 3, mb("6.12")),
    ("FC 16 without its byte count", words(16, SCRATCH, 1), 3, mb("6.12")),
    ("FC 16 of nothing, to a read-only address", registers(0, ()), 3, mb("6.12")),
    ("FC 22 one byte short", mask(SCRATCH, 0, 1)[:-1], 3, mb("6.16")),
    ("FC 22 without the OR mask", mask(SCRATCH, 0, 1)[:-2], 3, mb("6.16")),
    ("FC 22 one byte long", mask(SCRATCH, 0, 1) + b"\0", 3, mb("6.16")),
    ("FC 23 that reads nothing", exchange(0, 0, SCRATCH, (1,)), 3, mb("6.17")),
    ("FC 23 that reads 126", exchange(100, 126, SCRATCH, (1,)), 3, mb("6.17")),
    ("FC 23 that reads 0xFFFF", exchange(0, 0xFFFF, SCRATCH, (1,)), 3, mb("6.17")),
    ("FC 23 that writes nothing", exchange(0, 1, SCRATCH, ()), 3, mb("6.17")),
    ("FC 23 of 122 with 121", exchange(0, 1, SCRATCH, FULL_WRITE[:121], 122), 3, mb("6.17")),
    ("FC 23 that writes 0xFFFF", exchange(0, 1, SCRATCH, (1,), 0xFFFF), 3, mb("6.17")),
    ("FC 23 with an odd byte count", exchange(0, 1, SCRATCH, (1,), 1, 3) + b"\0", 3, mb("6.17")),
    ("FC 23 with a byte count too large", exchange(0, 1, SCRATCH, (1,), 1, 4), 3, mb("6.17")),
    ("FC 23 with a byte count too small", exchange(0, 1, SCRATCH, (1, 2), 2, 2), 3, mb("6.17")),
    ("FC 23 one byte short", exchange(0, 1, SCRATCH, (1, 2))[:-1], 3, mb("6.17")),
    ("FC 23 one byte long", exchange(0, 1, SCRATCH, (1, 2)) + b"\0", 3, mb("6.17")),
    ("FC 23 without its byte count", words(23, 0, 1, SCRATCH, 1), 3, mb("6.17")),
])

READ_ONLY = (0, 31, 32, 99, 100, 499, 500, 600, 724, 2000, 2499, 3000, 4999, 9000, 9011, SCRATCH_END, 0xFFFF)
RESERVED = (5005, 5009, 5018, 5024, 5036, 5039, 5047, 5089, 5092, 5099)

WRITES_TO_BAD_ADDRESSES = table([
    ("FC 5 beyond the last coil", coil(34, 0xFF00), 2, mb("6.5")),
    ("FC 5 at 0xFFFF", coil(0xFFFF, 0), 2, mb("6.5")),
    ("FC 5 to tare a sensor that is not there", coil(1, 0xFF00), 2, OURS),
    ("FC 5 to clear the latch of a sensor that is not there", coil(31, 0xFF00), 2, OURS),
    *((f"FC 6 to {at}", register(at, 1), 2, mb("6.6") if at in READ_ONLY else OURS) for at in READ_ONLY + RESERVED),
    *((f"FC 22 to {at}", mask(at, 0xFFFF, 1), 2, mb("6.16") if at in READ_ONLY else OURS)
      for at in (0, 32, 100, 5036, 9000, 0xFFFF)),
    ("FC 15 across the last coil", coils(33, 2), 2, mb("6.11")),
    ("FC 15 of the most there can be", coils(0, 1968), 2, mb("6.11")),
    ("FC 15 beyond the last coil", coils(34, 1), 2, mb("6.11")),
    ("FC 15 wrapping to 0", coils(0xFFFF, 2), 2, mb("6.11")),
    ("FC 15 to a sensor and to one that is not there", coils(0, 2, b"\3"), 2, OURS),
    ("FC 16 to read-only registers", registers(100, (1, 2)), 2, mb("6.12")),
    ("FC 16 across the end of scratch", registers(SCRATCH_END - 1, (1, 2)), 2, mb("6.12")),
    ("FC 16 of 123 across the end of scratch", registers(SCRATCH + 6, FULL_WRITE), 2, mb("6.12")),
    ("FC 16 from the writable block into scratch", registers(5099, (1, 2)), 2, mb("6.12")),
    ("FC 16 from read-only into the writable block", registers(4999, (1, 2)), 2, mb("6.12")),
    ("FC 16 from the command block into a reserved cell", registers(5000, (3, 0, 0, 0, 0x7E57, 0)), 2, OURS),
    ("FC 16 from the hints into a reserved cell", registers(5020, (7, 0, 1, 2, 3)), 2, OURS),
    ("FC 16 wrapping to 0", registers(0xFFFF, (1, 2)), 2, mb("6.12")),
    ("FC 16 to the constants", registers(9000, (1,) * 12), 2, mb("6.12")),
    ("FC 23 with a read beyond the global block", exchange(32, 1, SCRATCH, (1, 2)), 2, mb("6.17")),
    ("FC 23 with a read across two heads", exchange(10015, 2, SCRATCH, (1, 2)), 2, mb("6.17")),
    ("FC 23 with a read wrapping to 0", exchange(0xFFFF, 2, SCRATCH, (1, 2)), 2, mb("6.17")),
    ("FC 23 of a command with a read outside", exchange(32, 1, 5000, (3, 0, 0, 0, 0x7E58)), 2, mb("6.17")),
    ("FC 23 with a write to read-only", exchange(SCRATCH, 1, 0, (1,)), 2, mb("6.17")),
    ("FC 23 with a write below scratch", exchange(SCRATCH, 1, SCRATCH - 1, (1, 2)), 2, mb("6.17")),
    ("FC 23 with a write across the end", exchange(SCRATCH, 1, SCRATCH_END - 1, (1, 2)), 2, mb("6.17")),
    ("FC 23 with a write to a reserved cell", exchange(SCRATCH, 1, 5024, (1,)), 2, OURS),
    ("FC 23 with a write wrapping to 0", exchange(SCRATCH, 1, 0xFFFF, (1, 2)), 2, mb("6.17")),
    *((f"a locked setting, {at} = {value}", register(at, value), 2, OURS)
      for at, value in ((5030, 100), (5031, 20), (5032, 10), (5033, 0), (5034, 50), (5035, 100), (5030, 1001))),
    ("locked settings by FC 16", registers(5030, (100, 20, 10)), 2, OURS),
    ("a locked setting by FC 22", mask(5030, 0, 100), 2, OURS),
    ("a locked setting by FC 23", exchange(0, 1, 5030, (100,)), 2, OURS),
    ("hints and a locked setting by FC 16", registers(5023, (1,) * 8), 2, OURS),
    ("a bad value and a reserved cell", registers(5022, (6, 1, 1)), 2, OURS),
])

# ---- refused because of their value: without `commands` each is exception 2
# -----------------------------------------

WRITES_OF_BAD_VALUES = table([
    *((f"a watchdog of {ms} ms", register(5021, ms), 3, OURS) for ms in (1, 9, 60001, 0xFFFF)),
    *((f"a gripper state of {state}", register(5022, state), 3, OURS) for state in (6, 7, 0xFFFE)),
    *((f"{name} with mask 0x{sensors:X}", register(at, sensors), 3, OURS)
      for at, name in ((5010, "TARE"), (5011, "UNTARE"), (5012, "CLEAR_LATCH"), (5014, "RESET_PEAK"))
      for sensors in (2, 0x8001, 0xFFFF)),
    ("WEIGH", register(5013, 1), 4, OURS),
    *((f"UNLOCK with 0x{word:04X}", register(5090, word), 3, OURS)
      for word in (1, 0xFE5A, 0x5AFF, SAVE_WORD, 0xFFFF)),
    *((f"SAVE with 0x{word:04X}", register(5091, word), 3, OURS)
      for word in (0, 1, 0x6173, UNLOCK_WORD, 0xFFFF)),
    ("a good hint and a bad one", registers(5020, (0x7E57, 1000, 6)), 3, OURS),
    ("a bad hint before good ones", registers(5021, (9, 1, 0x7E57)), 3, OURS),
    ("a tare of a sensor that is there and of one that is not", registers(5010, (1, 2)), 3, OURS),
    ("a clearing and a tare of a sensor that is not there", registers(5010, (2, 0, 1)), 3, OURS),
    ("FC 22 that makes a gripper state of 7", mask(5022, 0, 7), 3, OURS),
    ("FC 22 that makes a wrong magic word", mask(5090, 0, 0x1234), 3, OURS),
    ("FC 23 of a bad value", exchange(0, 32, 5022, (6,)), 3, OURS),
    ("FC 23 of a good and a bad value", exchange(0, 32, 5021, (1000, 6)), 3, OURS),
])

SETTINGS_OUT_OF_RANGE = [
    Case(f"{name} = {value}, unlocked", register(at, value), 3, OURS, before=(UNLOCK,))
    for at, name, values in ((5030, "FILTER_HZ", (1001, 0xFFFE)), (5031, "CONTACT_ON", (0, 30001, 0xFFFE)),
                             (5032, "CONTACT_OFF", (30001, 0xFFFE)), (5034, "SLIP_SENSITIVITY", (101, 0xFFFE)),
                             (5035, "WEIGH_WINDOW", (0, 9, 10001, 0xFFFE)))
    for value in values]

SETTINGS_IN_RANGE = [
    Case(f"{at} = {value}, unlocked", register(at, value), register(at, value), OURS, before=(UNLOCK,),
         after=((read(3, at, 1), holds(3, value)),))
    for at, values in ((5030, (1000, 1, 0, 0xFFFF)), (5031, (30000, 1, 0xFFFF)), (5032, (30000, 0, 0xFFFF)),
                       (5033, (1, 30000, 0, 0xFFFF)), (5034, (0, 100, 0xFFFF)), (5035, (10, 10000, 0xFFFF)))
    for value in values]

UNLOCKING = [
    Case("settings after LOCK", register(5030, 100), 2, OURS, before=(UNLOCK, LOCK)),
    Case("settings unlocked elsewhere", register(5030, 100), 2, OURS, elsewhere=(UNLOCK,)),
    Case("UNLOCK reads 0 elsewhere", read(3, 5090, 1), holds(3, 0), OURS, elsewhere=(UNLOCK,)),
    Case("UNLOCK reads 1 here", read(3, 5090, 1), holds(3, 1), OURS, before=(UNLOCK,)),
    Case("a wrong UNLOCK opens nothing", [adu(register(5090, 0xFE5A)), adu(register(5030, 100), 2)],
         [adu(refusal(UNLOCK, 3)), adu(bytes([0x86, 2]), 2)], OURS),
    Case("good settings and a bad one", registers(5030, (100, 20, 30001)), 3, OURS, before=(UNLOCK,)),
    Case("settings into reserved cells", registers(5034, (50, 100, 0)), 2, OURS, before=(UNLOCK,)),
    Case("reserved cells while unlocked", register(5036, 0), 2, OURS, before=(UNLOCK,)),
    Case("UNLOCK in a write that is refused opens nothing",
         [adu(registers(5090, (UNLOCK_WORD, SAVE_WORD, 0))), adu(register(5030, 100), 2)],
         [adu(bytes([0x90, 2])), adu(bytes([0x86, 2]), 2)], OURS),
    Case("FC 22 that makes a bad setting", mask(5031, 0, 0xFFF0), 3, OURS, before=(UNLOCK,)),
]

# ---- valid writes at the limits of the writable range: without `commands` each is exception 2
# -----------------------

WRITES_OF_GOOD_FORM = table([
    ("FC 5, nothing to do", coil(0, 0), coil(0, 0), mb("6.5")),
    ("FC 5, nothing to do for no sensor", coil(1, 0), coil(1, 0), OURS),
    ("FC 5 of the last but one", coil(32, 0xFF00), coil(32, 0xFF00), mb("6.5")),
    ("FC 15 of all, nothing to do", coils(0, 34), words(15, 0, 34), mb("6.11")),
    ("FC 15 with bits set beyond its quantity", coils(32, 1, b"\xFE"), words(15, 32, 1), mb("6.11")),
    ("FC 6 to the last scratch register", register(SCRATCH_END - 1, 0xFFFF), register(SCRATCH_END - 1, 0xFFFF),
     mb("6.6"), (), (), ((read(3, SCRATCH_END - 1, 1), holds(3, 0xFFFF)),)),
    ("FC 16 of 123", registers(SCRATCH, FULL_WRITE), words(16, SCRATCH, 123), mb("6.12"),
     (), (), ((read(3, SCRATCH, 123), holds(3, *FULL_WRITE)),)),
    ("FC 16 up to the last scratch register", registers(SCRATCH + 5, FULL_WRITE), words(16, SCRATCH + 5, 123),
     mb("6.12"), (), (), ((read(3, SCRATCH + 5, 123), holds(3, *FULL_WRITE)),)),
    ("FC 22", mask(SCRATCH, 0, 0xFFFF), mask(SCRATCH, 0, 0xFFFF), mb("6.16"),
     (), (), ((read(3, SCRATCH, 1), holds(3, 0xFFFF)),)),
    ("FC 23 writes before it reads", exchange(SCRATCH, 2, SCRATCH, (0xA55A, 0x5AA5)), holds(23, 0xA55A, 0x5AA5),
     mb("6.17")),
    ("FC 23 of 125 and 121", exchange(100, 125, SCRATCH, FULL_WRITE[:121]), some(23, 250), mb("6.17"),
     (), (), ((read(3, SCRATCH, 121), holds(3, *FULL_WRITE[:121])),)),
    *((f"the least and the most of {at}: {value}", register(at, value), register(at, value), OURS,
       (), (), ((read(3, at, 1), holds(3, value)),))
      for at, value in ((5021, 10), (5021, 60000), (5021, 0), (5022, 5), (5022, 0), (5022, 0xFFFF), (5020, 0xFFFF), (5023, 0xFFFF))),
    *((f"a mask of 0 in {at}", register(at, 0), register(at, 0), OURS) for at in (5010, 5011, 5012, 5013, 5014)),
    ("UNLOCK", UNLOCK, UNLOCK, OURS),
    ("LOCK", LOCK, LOCK, OURS),
])

COMMANDS = [
    Case(f"command {command} with mask {sensors}", registers(5000, (command, sensors, 0, 0, 0x100 + n)),
         words(16, 5000, 5), OURS, after=((read(3, 25, 3), holds(3, 0x100 + n, 3, result)),))
    for n, (command, sensors, result) in enumerate((
        (0, 1, 1), (11, 1, 1), (0xFFFF, 1, 1), (1, 0, 2), (1, 2, 2), (1, 0x8001, 2), (2, 0, 2), (2, 2, 2), (6, 0, 2),
        (6, 0xFFFE, 2), (4, 1, 4), (5, 1, 4), (7, 1, 4), (9, 1, 4), (10, 1, 4)))
] + [
    Case("the same CMD_SEQ again", registers(5000, (1, 1, 0, 0, 0x200)), words(16, 5000, 5), OURS,
         before=(registers(5000, (11, 1, 0, 0, 0x200)),), after=((read(3, 25, 3), holds(3, 0x200, 3, 12)),)),
    Case("a command without CMD_SEQ", registers(5000, (1, 1, 0, 0)), words(16, 5000, 4), OURS,
         before=(registers(5000, (11, 1, 0, 0, 0x201)),), after=((read(3, 25, 3), holds(3, 0x201, 3, 1)),)),
    Case("FC 23 of a command reads its acknowledgement", exchange(25, 3, 5000, (11, 1, 0, 0, 0x202)),
         re.compile(b"\x17\6\2\2\0[\1\3]\0[\0\1]"), OURS),
]

NOT_FROM_HERE = [
    Case("a write from an address outside command_allow", register(SCRATCH, 1), 2, OURS, source="127.0.0.2"),
    Case("UNLOCK from an address outside command_allow", UNLOCK, 2, OURS, source="127.0.0.2"),
    Case("a tare coil from an address outside command_allow", coil(0, 0xFF00), 2, OURS, source="127.0.0.2"),
    Case("a read from an address outside command_allow", MAGIC, MAGIC_IS, OURS, source="127.0.0.2"),
]

READS_OF_SCRATCH = table([
    ("FC 3 of scratch", read(3, SCRATCH, 1), 2, OURS),
    ("FC 23 within scratch", exchange(SCRATCH, 1, SCRATCH, (1,)), 2, OURS),
])
