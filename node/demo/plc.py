"""A PLC in 100 lines: Modbus TCP with sockets alone, a scan of the global block, and the cycle of a pick.

Its only knowledge of gripper and object comes from the registers. node/modbus/MAP.md has every address.
"""
import socket
import struct
import threading
import time

SEQ, OK, GRIP_STATE, WEIGHT_STATE, WEIGHT, WEIGHT_SD, SEQ_END = 4, 10, 17, 19, 20, 22, 31
STATUS, GRASPED = 7, 1 << 2
PLC_HEARTBEAT, PLC_WATCHDOG, GRIPPER_STATE = 5020, 5021, 5022
OPEN, CLOSING, LIFTING, OPENING = 0, 1, 3, 5  # GRIPPER_STATE
STABLE, UNKNOWN = 2, -2 ** 31                 # WEIGHT_STATE, WEIGHT
JAWS = 0b11                                   # their bits in OK
SCAN_s, STEP_s = 0.02, 4
READY_s = 12  # a jaw whose age was in doubt is GOOD again within 10 s where its path has a proof


class Modbus:
    def __init__(self, port, host="127.0.0.1"):
        self.socket = socket.create_connection((host, port), timeout=2)
        self.number = 0

    def ask(self, pdu):
        self.number = self.number + 1 & 0xFFFF
        self.socket.sendall(struct.pack(">HHHB", self.number, 0, len(pdu) + 1, 1) + pdu)
        head = self._take(7)
        answer = self._take(struct.unpack(">HHHB", head)[2] - 1)
        if answer[0] & 0x80:
            raise OSError(f"Modbus exception {answer[1]}")
        return answer

    def _take(self, size):
        data = b""
        while len(data) < size:
            piece = self.socket.recv(size - len(data))
            if not piece:
                raise OSError("the Modbus server closed the connection")
            data += piece
        return data

    def read(self, address, count):
        return struct.unpack(f">{count}H", self.ask(struct.pack(">BHH", 4, address, count))[2:])

    def write(self, address, *values):
        self.ask(struct.pack(f">BHHB{len(values)}H", 16, address, len(values), 2 * len(values), *values))


class NotSeen(Exception):
    """A step of the pick did not happen in time. Its arguments are the step and the last scan."""


class Plc:
    def __init__(self, port, scanned=lambda seconds: None):
        """scanned: called with None when a step of a pick begins, and with the time of each scan until it ends."""
        self.scanned = scanned
        self.modbus, self.beat, self.ended = Modbus(port), 0, threading.Event()
        self.modbus.write(PLC_WATCHDOG, 2000)

    def scan(self):
        """Does one scan: heartbeat out, global block in. All words are of one frame if SEQ equals SEQ_END."""
        self.beat = self.beat + 1 & 0xFFFF
        self.modbus.write(PLC_HEARTBEAT, self.beat)
        r = self.modbus.read(0, 32)
        weight = struct.unpack(">i", struct.pack(">HH", *r[WEIGHT:WEIGHT + 2]))[0]
        return {"whole": r[SEQ] == r[SEQ_END], "good": r[OK] & JAWS == JAWS, "grip": r[GRIP_STATE], "grasped": bool(r[STATUS] & GRASPED), "weight": r[WEIGHT_STATE],
                "kg": None if weight == UNKNOWN else weight * 1e-4, "sd_kg": r[WEIGHT_SD] * 1e-4}

    def wait(self, step, condition, seconds=STEP_s):
        self.scanned(None)
        until, seen = time.monotonic() + seconds, None
        while time.monotonic() < until and not self.ended.is_set():
            begun = time.monotonic()
            seen = self.scan()
            if seen["whole"] and condition(seen):
                return seen
            time.sleep(SCAN_s)
            self.scanned(time.monotonic() - begun)
        raise NotSeen(step, seen)

    def pick(self, robot, grip_N=8.0):
        """Waits for two GOOD jaws, closes, waits for the grasp, lifts, waits for a stable weight. Returns the scan with the weight."""
        self.wait("open gripper", lambda s: s["good"] and s["grip"] == OPEN, READY_s)
        self.modbus.write(GRIPPER_STATE, CLOSING)
        robot.close(grip_N)
        self.wait("grasp", lambda s: s["grasped"])
        self.modbus.write(GRIPPER_STATE, LIFTING)
        robot.lift()
        return self.wait("stable weight", lambda s: s["weight"] == STABLE and s["kg"] is not None)

    def release(self, robot):
        self.modbus.write(GRIPPER_STATE, OPENING)
        robot.open()
        until = time.monotonic() + 2
        while not robot.is_open() and time.monotonic() < until:
            self.scan()
            time.sleep(SCAN_s)
        self.modbus.write(GRIPPER_STATE, OPEN)
