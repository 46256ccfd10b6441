"""A node whose samples a test chooses: a segment with the bytes of a daemon's, which this process publishes on. Readers and bridges take
it for a daemon, so that each reason, weight and wrench can be shown to them without the device that would cause it."""
import math
import mmap
import os
import re
import struct
import threading
import time

from daemon import ROOT, run_folder
from python_reader import LAYOUT, sensor_ring

NO_VALUE, GOOD, UNCERTAIN, BAD = range(4)
RUNNING = 2


QUALITY = {"GOOD": GOOD, "UNCERTAIN": UNCERTAIN, "BAD": BAD}
ROWS = re.findall(r'X\((\w+), "([\w-]+)", TACTILED_(\w+), (\d+),', (ROOT / "node/include/tactiled/layout.h").read_text())
assert len(ROWS) == len(LAYOUT.enums["reason"]), ROWS
# From TACTILED_REASON_TABLE: (bit, name, word, best quality), and the number of FAULT of each bit in the register map.
REASONS = [(LAYOUT.enums["reason"][name], name, word, QUALITY[best]) for name, word, best, _ in ROWS]
FAULTS = {LAYOUT.enums["reason"][name]: int(number) for name, _, _, number in ROWS}


def verdict(reasons):
    return max([GOOD] + [best for bit, _, _, best in REASONS if reasons & bit])


def end_segment(file):
    """Marks the segment in an open file as replaced, so that its readers look for the new one of the same name."""
    file.seek(LAYOUT.offset("header", "state"))
    file.write(struct.pack("=I", LAYOUT.enums["state"]["REPLACED"]))
    file.flush()


class Ring:
    def __init__(self, memory, offset, slot_size, slots, record_size, head_offset):
        self.memory, self.words = memory, memory.cast("I")
        self.offset, self.slot_size, self.slots, self.record_size, self.head = offset, slot_size, slots, record_size, head_offset // 4
        newest = self.slot(self.words[self.head] - 1) + 8
        self.record = bytearray(memory[newest:newest + record_size])

    def slot(self, number):
        return self.offset + number % self.slots * self.slot_size

    def put(self, struct_name, member, *values, at=0):
        code = next(code for field, _, code in LAYOUT.structs[struct_name] if field == member)
        struct.pack_into("=" + code, self.record, at + LAYOUT.offset(struct_name, member), *values)

    def publish(self):
        """The lock word is odd during the copy, as the daemon keeps it. Each word is one store."""
        number = self.words[self.head]
        lock = self.slot(number) // 4
        self.words[lock] = (2 * number + 1) % 2**32
        self.memory[4 * lock + 8:4 * lock + 8 + self.record_size] = bytes(self.record)
        self.words[lock] = (2 * number + 2) % 2**32
        self.words[self.head] = (number + 1) % 2**32


class ForgedNode:
    """A context manager. `bytes_of_a_segment`: of a daemon that has published. It takes that node's name."""

    PERIOD_S = 0.005
    has_grasp = has_tool = False
    clock = None  # a function of CLOCK_MONOTONIC in ns: the number that each value then has, in N or kg

    def __init__(self, name, bytes_of_a_segment):
        data = bytearray(bytes_of_a_segment)
        header = LAYOUT.decode("header", data)
        for member, code, value in (("epoch", "I", header["epoch"] + 1), ("pid", "I", os.getpid()), ("state", "I", RUNNING), ("control", "B", 0)):
            struct.pack_into("=" + code, data, LAYOUT.offset("header", member), value)
        self.path = run_folder() / f"tactiled.{name}"
        new = self.path.with_suffix(".forged")
        new.write_bytes(data)
        new.chmod(0o640)
        with open(new, "r+b") as file:
            self.map = mmap.mmap(file.fileno(), 0)
        memory = memoryview(self.map)
        self.node = Ring(memory, *header["node"])
        self.sensors = [Ring(memory, *sensor_ring(data, i)[0].values()) for i in range(header["n_sensors"])]
        self.sequence = [struct.unpack_from("=Q", ring.record)[0] for ring in self.sensors]
        self.lock, self.ended = threading.Lock(), False
        for i in range(len(self.sensors)):
            self.show(0, i)
        self.publish()
        os.replace(new, self.path)
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def show(self, reasons, sensor=0, force_N=(1, 2, -3)):
        """From now on the sensor has these reasons, with the quality of the table."""
        with self.lock:
            ring, quality = self.sensors[sensor], verdict(reasons)
            force_N = force_N if quality != BAD else [math.nan] * 3
            ring.put("sample", "reasons", reasons)
            ring.put("sample", "quality", quality)
            ring.put("sample", "force_S_N", *force_N)
            ring.put("sample", "sd_force_N", *(0.01 + 0 * force for force in force_N))

    def put_sample(self, member, value, sensor=0):
        with self.lock:
            self.sensors[sensor].put("sample", member, value)

    def put_status(self, status):
        with self.lock:
            self.node.put("node", "status", status)

    def show_grasp(self, **members):
        self.has_grasp = True
        self.put_part("grasp", members)

    def show_tool(self, **members):
        self.has_tool = True
        self.put_part("tool", members)

    def put_part(self, part, members):
        with self.lock:
            for member, value in members.items():
                self.node.put(part, member, *(value if isinstance(value, (tuple, list)) else (value,)), at=LAYOUT.offset("node", part))

    def publish(self):
        with self.lock:
            now_ns = time.monotonic_ns()
            if self.clock:
                self.put_clock(self.clock(now_ns))
            for i, ring in enumerate(self.sensors):
                self.sequence[i] += 1
                for member, value in (("sequence", self.sequence[i]), ("t_ns", now_ns), ("t_published_ns", now_ns)):
                    ring.put("sample", member, value)
                ring.publish()
            self.node.put("node", "count", *(ring.words[ring.head] for ring in self.sensors), *[0] * (16 - len(self.sensors)))
            self.node.put("node", "sequence", struct.unpack_from("=Q", self.node.record)[0] + 1)
            self.node.put("node", "t_ns", now_ns)
            for member in ("t_ns", "t_newest_ns") if self.has_tool else ():
                self.node.put("tool", member, now_ns, at=LAYOUT.offset("node", "tool"))
            if self.has_grasp:
                self.node.put("grasp", "t_ns", now_ns, at=LAYOUT.offset("node", "grasp"))
            self.node.publish()

    def put_clock(self, number):
        for ring in self.sensors:
            ring.put("sample", "force_S_N", 1, 2, number)
        for part, member, values in (("grasp", "weight_kg", [number]), ("grasp", "grip_N", [number]), ("grasp", "slips", [math.ceil(number)]), ("tool", "force_G_N", [1, 2, number])):
            self.node.put(part, member, *values, at=LAYOUT.offset("node", part))

    def run(self):
        while not self.ended:
            self.publish()
            time.sleep(self.PERIOD_S)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.ended = True
        self.thread.join()
        self.path.unlink(missing_ok=True)
