"""Requests that the map refuses, with the exception on any transport. One sensor, nothing unlocked."""
import struct


def pdu(function, *words, data=b""):
    return struct.pack(f">B{len(words)}H", function, *words) + data


def write(function, address, count, size, byte_count=None):
    return pdu(function, address, count, data=bytes([size if byte_count is None else byte_count]) + bytes(size))


def read_write(read, read_count, at, count, byte_count=None):
    size = 2 * count
    return pdu(23, read, read_count, at, count, data=bytes([size if byte_count is None else byte_count]) + bytes(size))


def identity(mei, code, first):
    return bytes([43, mei, code, first])


ILLEGAL_FUNCTION = {
    "FC 7": bytes([7]),
    "FC 8 with sub-function 1": pdu(8, 1, 0),
    "FC 8 with sub-function 4": pdu(8, 4, 0),
    "FC 11": bytes([11]),
    "FC 20": bytes([20, 7, 6, 0, 1, 0, 0, 0, 1]),
    "FC 24": pdu(24, 0),
    "FC 65": bytes([65, 1, 2, 3]),
    "FC 43 with MEI type 13": bytes([43, 13, 0, 0]),
}

ILLEGAL_QUANTITY = {
    "FC 1 of no coils": pdu(1, 0, 0),
    "FC 1 of 2001 coils": pdu(1, 0, 2001),
    "FC 2 of no inputs": pdu(2, 0, 0),
    "FC 2 of 2001 inputs": pdu(2, 0, 2001),
    "FC 3 of no registers": pdu(3, 0, 0),
    "FC 3 of 126 registers": pdu(3, 100, 126),
    "FC 3 of no registers outside the map": pdu(3, 40000, 0),
    "FC 3 that is too short": pdu(3, 0),
    "FC 3 that is too long": pdu(3, 0, 1, 0),
    "FC 4 of no registers": pdu(4, 0, 0),
    "FC 4 of 126 registers": pdu(4, 100, 126),
    "FC 5 with 0x1234": pdu(5, 0, 0x1234),
    "FC 5 with 1": pdu(5, 0, 1),
    "FC 6 that is too short": pdu(6, 5100),
    "FC 6 that is too long": pdu(6, 5100, 1, 2),
    "FC 8 without data": pdu(8, 0),
    "FC 8 with half a word": pdu(8, 0, data=b"1"),
    "FC 17 that is too long": bytes([17, 0]),
    "FC 15 of no coils": write(15, 0, 0, 0),
    "FC 15 of 1969 coils": write(15, 0, 1969, 247),
    "FC 15 with a byte too many": write(15, 0, 8, 2),
    "FC 15 with a wrong byte count": write(15, 0, 8, 1, byte_count=2),
    "FC 16 of no registers": write(16, 5100, 0, 0),
    "FC 16 of 124 registers": pdu(16, 5100, 124, data=bytes([246]) + bytes(246)),
    "FC 16 with a wrong byte count": write(16, 5100, 2, 4, byte_count=2),
    "FC 16 without the last byte": write(16, 5100, 2, 3, byte_count=4),
    "FC 22 that is too short": pdu(22, 5100, 0),
    "FC 23 that reads nothing": read_write(5100, 0, 5100, 1),
    "FC 23 that reads 126": read_write(5100, 126, 5100, 1),
    "FC 23 that writes nothing": read_write(5100, 1, 5100, 0),
    "FC 23 that writes 122": pdu(23, 5100, 1, 5100, 122, data=bytes([242]) + bytes(242)),
    "FC 23 with a wrong byte count": read_write(5100, 1, 5100, 2, byte_count=2),
    "FC 43 with code 0": identity(14, 0, 0),
    "FC 43 with code 5": identity(14, 5, 0),
}

ILLEGAL_ADDRESS = {
    "FC 1 at 34": pdu(1, 34, 1),
    "FC 1 across the last coil": pdu(1, 33, 2),
    "FC 2 at 68": pdu(2, 68, 1),
    "FC 2 across the last input": pdu(2, 67, 2),
    "FC 3 at 32": pdu(3, 32, 1),
    "FC 3 of unnamed cells only": pdu(3, 88, 12),
    "FC 3 across two heads of arrays": pdu(3, 10015, 2),
    "FC 3 from a hole into a page of an array": pdu(3, 10999, 2),
    "FC 3 to 65536": pdu(3, 65535, 2),
    "FC 4 of the writable block": pdu(4, 5000, 1),
    "FC 4 of a scratch register": pdu(4, 5100, 1),
    "FC 4 from a hole into the writable block": pdu(4, 4999, 2),
    "FC 4 of the registers of a cycle": pdu(4, 5300, 15),
    "FC 5 to coil 34": pdu(5, 34, 0),
    "FC 5 to the coil of a sensor that is not there": pdu(5, 1, 0xFF00),
    "FC 6 to a read-only register": pdu(6, 0, 1),
    "FC 6 to a constant": pdu(6, 9000, 1),
    "FC 6 to a reserved cell": pdu(6, 5036, 1),
    "FC 6 to a locked setting": pdu(6, 5030, 100),
    "FC 15 across the last coil": write(15, 33, 2, 1),
    "FC 16 to read-only registers": write(16, 100, 2, 4),
    "FC 16 across the scratch registers": write(16, 5227, 2, 4),
    "FC 16 from the command block into a reserved cell": write(16, 5003, 3, 6),
    "FC 22 to a read-only register": pdu(22, 0, 0, 1),
    "FC 23 that writes a read-only register": read_write(5100, 1, 0, 1),
    "FC 23 that reads outside": read_write(32, 1, 5100, 1),
    "FC 43 of object 0x50": identity(14, 4, 0x50),
}

ILLEGAL_VALUE = {
    "a watchdog of 5 ms": pdu(6, 5021, 5),
    "a watchdog of 60001 ms": pdu(6, 5021, 60001),
    "a gripper state of 6": pdu(6, 5022, 6),
    "the same in a write of a cycle": pdu(16, 5305, 2, data=bytes([4]) + struct.pack(">HH", 7, 6)),
    "an unlock word that is wrong": pdu(6, 5090, 1),
    "a save word that is wrong": pdu(6, 5091, 1),
    "a tare of a sensor that is not there": pdu(6, 5010, 2),
    "a mask that makes such a value": pdu(22, 5022, 0, 7),
    "FC 16 with one such value": pdu(16, 5021, 2, data=bytes([4]) + struct.pack(">HH", 1000, 6)),
}

REFUSALS = [(name, request, exception)
            for exception, requests in ((1, ILLEGAL_FUNCTION), (3, ILLEGAL_QUANTITY), (2, ILLEGAL_ADDRESS),
                                        (3, ILLEGAL_VALUE), (4, {"weighing": pdu(6, 5013, 1)}))
            for name, request in requests.items()]
