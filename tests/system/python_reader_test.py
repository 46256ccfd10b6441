#!/usr/bin/env python3
"""node/python/tactiled.py beside the release daemon: the same layout, the same bits, the same ends as reader.h."""
import itertools
import math
import os
import pathlib
import re
import signal
import statistics
import struct
import subprocess
import sys
import textwrap
import time
import unittest
import unittest.mock

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

RATE_HZ = 250
STALE_MS = 100
WATCHDOG_MS = 250  # the default
LINK = """
[[link]]
name = "usb-{}"
driver = "uart"
device = "{{folder}}/{}"
baud = 921600
format = "cobs"
simulated = true

[[sensor]]
name = "{}"
link = "usb-{}"
counts_per_unit = 1e9
model = "table"
calibration = "ROOT/config/calibration/table_documents.toml"
stale_ms = STALE_MS
"""


def played_daemon(*sensors, rate=RATE_HZ, name=None):
    config = "".join(LINK.format(s, s, s, s) for s in sensors)
    daemon = Daemon(config.replace("ROOT", str(ROOT)).replace("STALE_MS", str(STALE_MS)), name=name)
    for sensor in sensors:
        daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", daemon.folder / sensor, "--format", "cobs",
                    "--bits", 32, "--counts-per-unit", "1e9", "--rate", rate, "--loop")
    return daemon


def good(daemon, sensor="left"):
    with tactiled.open(daemon.name) as node:
        wait_for(lambda: node.latest(sensor).quality in (tactiled.GOOD, tactiled.UNCERTAIN), 3, "a value")


def forces_are_nan(sample):
    fields = ("force_S_N", "torque_S_Nm", "sd_force_N", "sd_torque_Nm", "raw_force_S_N", "raw_torque_S_Nm", "cop_S_m")
    return all(math.isnan(x) for name in fields for x in getattr(sample, name)) and math.isnan(sample.residual)


def same_bits(a, b):
    """Whether two decoded values are the same, NaN being the same as NaN."""
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same_bits, a, b))
    return a == b or (isinstance(a, float) and struct.pack("d", a) == struct.pack("d", b))


class Layout:
    """layout.h as a parser sees it that knows nothing of the module."""

    SCALARS = {"char": ("s", 1), "uint8_t": ("B", 1), "uint16_t": ("H", 2), "uint32_t": ("I", 4), "uint64_t": ("Q", 8), "float": ("f", 4),
               "double": ("d", 8)}

    def __init__(self):
        text = re.sub(r"/\*.*?\*/", "", (ROOT / "node/include/tactiled/layout.h").read_text(), flags=re.S)
        self.numbers = {name: int(value.rstrip("u"), 0)
                        for name, value in re.findall(r"#define TACTILED_(\w+) (0x\w+|\d+u?)\s", text)}
        self.enums = {}
        for name, body in re.findall(r"enum tactiled_(\w+) \{(.*?)\}", text, flags=re.S):
            self.enums[name] = {}
            for constant, one, shift in re.findall(r"TACTILED_(\w+) = (0x\w+|\d+)(?: << (\d+))?", body):
                self.enums[name][constant] = int(one, 0) << int(shift or 0)
            self.numbers.update(self.enums[name])
        self.structs = {}  # name -> [(member, offset, format)]
        self.sizes = {}
        for name, body in re.findall(r"struct tactiled_(\w+) \{(.*?)\};", text, flags=re.S):
            self._lay_out(name, body)

    def _lay_out(self, name, body):
        members, at, largest = [], 0, 4
        for member in filter(None, (m.strip() for m in body.split(";"))):
            align, kind, names = re.fullmatch(r"(?:TACTILED_ALIGN\((\d+)\) )?((?:struct )?\w+) (.*)", member).groups()
            for field, dim in re.findall(r"(\w+)(?:\[(\w+)\])?", names):
                count = 1 if not dim else int(dim) if dim.isdigit() else self.numbers[dim.replace("TACTILED_", "")]
                if kind == "struct tactiled_grasp":  # a table of its own
                    letter, size, count, align = "s", 1, self.sizes["grasp"], 8
                elif kind.startswith("struct"):
                    inner = self.structs[kind.split("_", 1)[1]]
                    assert all(code == "I" for _, _, code in inner)
                    letter, size, count = "I", 4, count * len(inner)
                else:
                    letter, size = self.SCALARS[kind]
                alignment = int(align or size)
                largest = max(largest, alignment)
                at += -at % alignment
                members.append((field, at, letter if count == 1 else f"{count}{letter}"))
                at += size * count
        self.structs[name], self.sizes[name] = members, at + -at % largest

    def offset(self, name, member):
        return next(offset for field, offset, _ in self.structs[name] if field == member)

    def decode(self, name, data):
        values = {}
        for field, offset, code in self.structs[name]:
            found = struct.unpack_from("=" + code, data, offset)
            values[field] = found if code[:-1] else found[0]
        return values


LAYOUT = Layout()


class TheTables(unittest.TestCase):
    def test_have_the_fields_of_layout_h_in_its_places(self):
        for name, ours in (("header", tactiled._HEADER), ("sensor", tactiled._SENSOR), ("sample", tactiled._SAMPLE),
                           ("node", tactiled._NODE), ("grasp", tactiled._GRASP)):
            at, fields = 0, []
            for field, code in ours.fields:
                if field != "-":
                    fields.append((field, at, code))
                at += struct.calcsize("=" + code)
            self.assertEqual(fields, LAYOUT.structs[name], name)
            self.assertEqual(at, LAYOUT.sizes[name], name)
        self.assertEqual(list(tactiled.Sample._fields), [field for field, _, _ in LAYOUT.structs["sample"]])
        self.assertEqual(list(tactiled.Command._fields), [field for field, _, _ in LAYOUT.structs["command"]])
        self.assertEqual([field for field, _, _ in LAYOUT.structs["ring"]],
                         ["offset", "slot_size", "slots", "record_size", "head_offset"])
        self.assertEqual(tactiled._STATE_WORD * 4, LAYOUT.offset("header", "state"))
        self.assertEqual(tactiled._LINK_SIZE, LAYOUT.sizes["link"])

    def test_have_the_numbers_of_layout_h(self):
        for enum in ("quality", "reason", "sensor_state", "status", "state", "grip_state", "weight_state",
                     "slip_state"):
            self.assertGreater(len(LAYOUT.enums[enum]), 2)
            for name, value in LAYOUT.enums[enum].items():
                self.assertEqual(getattr(tactiled, name), value, name)
        for name in ("BYTE_ORDER", "MAJOR", "MINOR", "MAX_SENSORS", "MAX_LINKS"):
            self.assertEqual(getattr(tactiled, name), LAYOUT.numbers[name], name)
        self.assertEqual(tactiled._RECORD_OFFSET, LAYOUT.numbers["RECORD_OFFSET"])

    def test_have_the_words_of_tactilectl(self):
        source = (ROOT / "node/ctl/verb.hpp").read_text()
        words = re.findall('"(.*?)"', re.search(r"kReasonWords\{(.*?)\}", source, flags=re.S).group(1))
        self.assertEqual(list(tactiled.REASON_WORDS), words)
        self.assertEqual(len(words), len(LAYOUT.enums["reason"]))


class ARunningDaemon(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemon = cls.enterClassContext(played_daemon("left", "right"))
        cls.daemon.start()
        good(cls.daemon, "left")
        good(cls.daemon, "right")

    def test_every_sample_comes_once_in_order_with_the_bits_that_a_c_reader_sees(self):
        follow = subprocess.Popen([BIN / "follow", self.daemon.name, "left", "3"], stdout=subprocess.PIPE, text=True)
        self.addCleanup(follow.stdout.close)
        for wait in ("events", "sleep", "poll"):
            with self.subTest(wait), tactiled.open(self.daemon.name).follow("left", 1, wait) as left:
                samples, until = [], time.monotonic() + (2 if wait == "events" else 0.3)
                while time.monotonic() < until:
                    samples.append(next(left))
                self.assertEqual([s.sequence - samples[0].sequence for s in samples], list(range(len(samples))))
                self.assertEqual(left.lost, 0)
                if wait == "events":
                    self.assertGreater(len(samples), RATE_HZ)  # half of what was played
                    followed = samples
        lines = follow.communicate(timeout=10)[0].split("\n")
        theirs = {int(line.split()[0]): line for line in lines if line[:1].isdigit()}
        for s in followed:
            bits = " ".join(struct.pack(">d", force).hex() for force in s.force_S_N)
            self.assertEqual(f"{s.sequence} {s.device_sequence} {s.t_ns} {s.t_published_ns} {s.epoch:x} {s.quality} "
                             f"{s.reasons:x} {bits}", theirs[s.sequence])
        self.assertGreater(len({s.force_S_N for s in followed}), 50, "the recording moves")

    def test_every_field_is_what_stands_in_the_slot(self):
        with tactiled.open(self.daemon.name).follow("left", 1, from_oldest=True) as left:
            samples = [next(left) for _ in range(50)]
        ring, data = sensor_ring(segment_bytes(self.daemon.name), 0)
        for s in samples:
            at = ring["offset"] + s.sequence % ring["slots"] * ring["slot_size"] + 8
            expected = LAYOUT.decode("sample", data[at:at + LAYOUT.sizes["sample"]])
            if s.quality == tactiled.BAD:
                continue  # too old when it was read: judged, not copied
            for name, value in expected.items():
                self.assertTrue(same_bits(value, getattr(s, name)), (name, value, getattr(s, name)))

    def test_following_from_the_oldest_goes_back_to_what_is_kept(self):
        time.sleep(0.2)
        with tactiled.open(self.daemon.name) as node:
            newest = node.latest("left").sequence
            with node.follow("left", 1) as left:
                self.assertGreaterEqual(next(left).sequence, newest)
            with node.follow("left", 1, from_oldest=True) as left:
                first = next(left).sequence
                self.assertLess(first, newest - 20)
                self.assertEqual([next(left).sequence for _ in range(20)], list(range(first + 1, first + 21)))

    def test_a_snapshot_belongs_together(self):
        with tactiled.open(self.daemon.name) as node:
            self.assertEqual(node.sensors, ("left", "right"))
            seen = set()
            until = time.monotonic() + 1
            while time.monotonic() < until:
                record, samples = node.snapshot()
                self.assertEqual(list(samples), ["left", "right"])
                for sample, count in zip(samples.values(), record.count):
                    self.assertEqual(sample.sequence, count - 1)
                    self.assertLessEqual(sample.t_published_ns, record.t_ns)
                self.assertEqual(record.count[2:], (0,) * 14)
                self.assertEqual(len(record.command), 2)
                seen.add(record.sequence)
            self.assertGreater(len(seen), RATE_HZ / 2)
            self.assertTrue(record.status & tactiled.SIMULATED)

    def test_latest_is_the_newest_and_says_its_age(self):
        with tactiled.open(self.daemon.name) as node:
            for _ in range(200):
                before = node.snapshot()[0].count[1] - 1
                sample = node.latest("right")
                self.assertGreaterEqual(sample.sequence, before)
                self.assertLess(sample.age_ms, STALE_MS)
                self.assertEqual(sample.reasons_text, [w for i, w in enumerate(tactiled.REASON_WORDS)
                                                       if sample.reasons & 1 << i])
                time.sleep(0.001)
            self.assertEqual(node.info("right").stale_ms, STALE_MS)
            self.assertEqual(node.info("right").link, "usb-right")
            self.assertEqual(node.header.pid, self.daemon.process.pid)

    def test_a_sample_cannot_be_changed_and_an_unknown_sensor_is_named(self):
        with tactiled.open(self.daemon.name) as node:
            with self.assertRaises(AttributeError):
                node.latest("left").quality = tactiled.GOOD
            for ask in (node.latest, node.follow, node.info):
                with self.assertRaisesRegex(tactiled.Error, 'no sensor "middle"'):
                    ask("middle")
            with self.assertRaisesRegex(ValueError, "events"):
                node.follow("left", wait="event")
        with self.assertRaisesRegex(tactiled.Error, "closed"):
            node.latest("left")

    def test_closing_gives_back_mapping_and_descriptors(self):
        def held():
            maps = pathlib.Path("/proc/self/maps").read_text().count(f"tactiled.{self.daemon.name}")
            return maps, len(os.listdir("/proc/self/fd"))
        before = held()
        with tactiled.open(self.daemon.name) as node, node.follow("left", 1) as left:
            next(left), next(left)
            self.assertGreater(held(), before)
        self.assertEqual(held(), before)
        self.assertEqual(list(left), [])

    def test_events_wake_promptly_without_naps_and_use_little_cpu(self):
        with tactiled.open(self.daemon.name).follow("left", 1) as left, \
                unittest.mock.patch.object(tactiled.time, "sleep", side_effect=AssertionError("it naps")):
            next(left)
            late_us = []
            used, began = time.process_time(), time.monotonic()
            while time.monotonic() < began + 2:
                sample = next(left)
                late_us.append((time.monotonic_ns() - sample.t_published_ns) / 1000)
            share = (time.process_time() - used) / (time.monotonic() - began)
        print(f"events at {len(late_us) / 2:.0f} Hz: median {statistics.median(late_us):.0f} us after publishing, "
              f"{share:.1%} of a CPU")
        self.assertGreater(len(late_us), RATE_HZ)
        self.assertLess(statistics.median(late_us), 500)  # us; 50 on an idle machine, 550 with naps of 1 ms
        self.assertLess(share, 0.05)

    def test_a_slow_reader_counts_what_it_lost(self):
        with tactiled.open(self.daemon.name).follow("left", 1) as left:
            first = next(left)
            slots = left._segment.sensors["left"][1].slots
            left._next = left._next - 2 * slots & 0xFFFFFFFF  # as if it had slept for two rings
            second = next(left)
            self.assertEqual(left.lost, second.sequence - (first.sequence + 1 - 2 * slots))


class TheEndOfADaemon(unittest.TestCase):
    def setUp(self):
        self.daemon = self.enterContext(played_daemon("left"))
        self.daemon.start()
        good(self.daemon)
        self.node = self.enterContext(tactiled.open(self.daemon.name))

    def values(self, left, n=50):
        samples = [next(left) for _ in range(n)]
        self.assertNotIn(tactiled.BAD, [s.quality for s in samples])
        return samples

    def drained(self, left):
        """What still comes until nothing does for half a second."""
        left._timeout = 0.5
        rest = list(itertools.islice(left, 10_000))
        left._timeout = 5
        return rest

    def test_a_stopped_process_is_bad_within_stale_ms(self):
        with self.node.follow("left", 5) as left:
            self.values(left)
            self.daemon.process.send_signal(signal.SIGSTOP)
            time.sleep(STALE_MS / 1000 + 0.005)
            sample = self.node.latest("left")
            self.assertEqual(sample.quality, tactiled.BAD)
            self.assertIn("stale", sample.reasons_text)
            self.assertTrue(forces_are_nan(sample))
            self.assertEqual(sample.state, 0)
            record, samples = self.node.snapshot()
            self.assertEqual(samples["left"].reasons & tactiled.STALE, tactiled.STALE)
            self.assertTrue(forces_are_nan(samples["left"]))
            rest = self.drained(left)
            self.assertEqual([s.quality for s in rest].count(tactiled.BAD), 1)
            self.assertTrue(rest[-1].reasons & tactiled.DAEMON_STOPPED)
            self.assertTrue(forces_are_nan(rest[-1]))
            self.daemon.process.send_signal(signal.SIGCONT)
            again = [next(left) for _ in range(50)]
            self.assertEqual([s.sequence for s in again], list(range(rest[-1].sequence + 1, rest[-1].sequence + 51)))
            wait_for(lambda: self.node.latest("left").quality != tactiled.BAD, 1, "a value")

    def test_killed_one_bad_sample_then_those_of_the_successor(self):
        for wait in ("events", "sleep", "poll"):
            with self.subTest(wait), self.node.follow("left", 5, wait) as left:
                before = self.values(left)
                self.daemon.process.kill()
                self.daemon.process.wait()
                killed = time.monotonic()
                for sample in left:
                    if sample.quality == tactiled.BAD:
                        break
                self.assertLess(time.monotonic() - killed, WATCHDOG_MS / 1000 + 0.1)
                self.assertIn("stopped", sample.reasons_text)
                self.assertTrue(forces_are_nan(sample))
                self.assertGreaterEqual(sample.sequence, before[-1].sequence)
                self.assertEqual(self.drained(left), [])
                self.assertEqual(self.node.latest("left").quality, tactiled.BAD)
                self.daemon.start()
                after = [next(left) for _ in range(50)]
                self.assertEqual([s.sequence for s in after], list(range(50)))
                self.assertTrue(all(s.epoch >> 16 != before[-1].epoch >> 16 for s in after))
                self.assertFalse(any(s.reasons & tactiled.DAEMON_STOPPED for s in after))
                wait_for(lambda: self.node.latest("left").quality != tactiled.BAD, 1, "a value")
                self.assertNotEqual(self.node.latest("left").epoch >> 16, before[-1].epoch >> 16)
                self.assertEqual(self.node.header.pid, self.daemon.process.pid)

    def test_killed_and_its_file_removed_by_hand(self):
        old = self.node.latest("left")
        with self.node.follow("left", 5) as left:
            self.values(left)
            self.daemon.process.kill()
            self.daemon.process.wait()
            os.unlink(f"/dev/shm/tactiled.{self.daemon.name}")
            self.daemon.start()
            wait_for(lambda: self.node.latest("left").epoch != old.epoch, 1, "the successor")
            wait_for(lambda: self.node.latest("left").quality != tactiled.BAD, 1, "a value of the successor")
            wait_for(lambda: next(left).epoch != old.epoch, 2, "the successor")

    def test_a_clean_stop_is_bad_at_once_and_once(self):
        with self.node.follow("left", 5) as left:
            before = self.values(left)
            self.daemon.stop()
            sample = self.node.latest("left")
            self.assertEqual(sample.quality, tactiled.BAD)
            self.assertIn("stopped", sample.reasons_text)
            self.assertTrue(forces_are_nan(sample))
            self.assertTrue(forces_are_nan(self.node.snapshot()[1]["left"]))
            rest = self.drained(left)
            ends = [s.sequence for s in rest if s.reasons & tactiled.DAEMON_STOPPED]
            self.assertEqual(ends, [rest[-1].sequence])
            self.assertEqual([s.sequence for s in rest],
                             list(range(before[-1].sequence + 1, before[-1].sequence + 1 + len(rest))))
            with self.assertRaisesRegex(tactiled.Error, "no daemon of that name runs"):
                tactiled.open(self.daemon.name)
            self.daemon.start()
            self.assertNotEqual(next(left).epoch >> 16, before[-1].epoch >> 16)

    def test_a_file_that_says_replaced_or_stopped_is_bad_though_its_samples_are_new(self):
        data = segment_bytes(self.daemon.name)
        for state in (tactiled.STOPPED, tactiled.REPLACED):
            with a_copy(data) as copy:
                copy.make_fresh()
                with tactiled.open(copy.write()) as node:
                    self.assertNotEqual(node.latest("left").quality, tactiled.BAD)
                    copy.put("header", "state", state)
                    copy.write_in_place()
                    self.assertIn("stopped", node.latest("left").reasons_text)
                    self.assertTrue(forces_are_nan(node.snapshot()[1]["left"]))

    def test_without_a_control_socket_it_naps(self):
        os.unlink(self.daemon.folder / "control.sock")
        with self.node.follow("left", 5) as left:
            samples = self.values(left)
            self.assertEqual([s.sequence - samples[0].sequence for s in samples], list(range(50)))

    def test_a_daemon_that_hangs_delays_no_timeout_and_is_asked_again(self):
        self.daemon.process.send_signal(signal.SIGSTOP)
        with self.node.follow("left", 0.1) as left:
            next(left)
            began = time.monotonic()
            self.assertIsNone(next(left, None))  # it is not known yet to hang: asked for events
            self.assertLess(time.monotonic() - began, 0.15)
            time.sleep(WATCHDOG_MS / 1000)
            began = time.monotonic()
            self.assertIn("stopped", next(left).reasons_text)
            self.assertIsNone(next(left, None))
            self.assertLess(time.monotonic() - began, 0.2)
            self.daemon.process.send_signal(signal.SIGCONT)
            left._timeout = 1
            began = time.monotonic()
            while left._events is None and time.monotonic() < began + 3:
                next(left)
            self.assertIsNotNone(left._events)

    def test_a_timeout_ends_the_loop_and_the_next_one_goes_on(self):
        with self.node.follow("left", 0.3) as left:
            last = self.values(left)[-1]
            self.daemon.others[0].send_signal(signal.SIGSTOP)
            for sample in left:
                last = sample
            began = time.monotonic()
            self.assertEqual(list(left), [])
            self.assertAlmostEqual(time.monotonic() - began, 0.3, delta=0.1)
            self.assertGreaterEqual(self.node.reason_counts("left")["stale"], 1)
            self.assertNotIn("frozen", self.node.reason_counts("left"))
            self.daemon.others[0].send_signal(signal.SIGCONT)
            self.assertEqual(next(left).sequence, last.sequence + 1)


def segment_bytes(name):
    return bytearray(pathlib.Path(f"/dev/shm/tactiled.{name}").read_bytes())


def sensor_ring(data, index):
    header = LAYOUT.decode("header", data)
    at = header["sensor_offset"] + index * header["sensor_size"]
    numbers = LAYOUT.decode("sensor", data[at:at + LAYOUT.sizes["sensor"]])["ring"]
    return dict(zip((field for field, _, _ in LAYOUT.structs["ring"]), numbers)), data


class a_copy:
    """A segment's bytes under another name, to be patched. A context manager."""

    def __init__(self, data):
        self.data = bytearray(data)
        self.name = f"copy-{os.getpid()}-{time.monotonic_ns()}"
        self.path = pathlib.Path(f"/dev/shm/tactiled.{self.name}")

    def put(self, struct_name, member, *values, at=0):
        code = next(code for field, _, code in LAYOUT.structs[struct_name] if field == member)
        struct.pack_into("=" + code, self.data, at + LAYOUT.offset(struct_name, member), *values)

    def make_fresh(self):
        """No sample is stale for the next ten seconds."""
        self.date_samples(time.monotonic_ns())
        self.put("sensor", "stale_ms", 10_000, at=self.sensor_at())

    def date_samples(self, t_ns):
        ring, _ = sensor_ring(self.data, 0)
        for slot in range(ring["slots"]):
            self.put("sample", "t_ns", t_ns, at=ring["offset"] + slot * ring["slot_size"] + 8)

    def empty_rings(self, records=0):
        """Nothing published, or so many samples that the ring has wrapped."""
        header, ring = LAYOUT.decode("header", self.data), sensor_ring(self.data, 0)[0]
        for offset, slot_size, slots, _, head_offset in (header["node"], ring.values()):
            struct.pack_into("=I", self.data, head_offset, 0)
            for slot in range(slots):
                struct.pack_into("=I", self.data, offset + slot * slot_size, 1)
        for number in range(records):
            slot = ring["offset"] + number % ring["slots"] * ring["slot_size"]
            struct.pack_into("=I", self.data, slot, 2 * number + 2)
            struct.pack_into("=I", self.data, ring["head_offset"], number + 1)

    def sensor_at(self):
        return LAYOUT.decode("header", self.data)["sensor_offset"]

    def set_record_size(self, size):
        ring, _ = sensor_ring(self.data, 0)
        ring["record_size"] = size
        self.put("sensor", "ring", *ring.values(), at=self.sensor_at())

    def write(self, mode=0o640):
        self.path.write_bytes(self.data)
        self.path.chmod(mode)
        return self.name

    def write_in_place(self):
        with open(self.path, "r+b") as file:
            file.write(self.data)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.path.exists():
            self.path.unlink()


class AFile(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with played_daemon("left") as daemon:
            daemon.start()
            good(daemon)
            time.sleep(0.2)
            daemon.process.send_signal(signal.SIGSTOP)
            cls.data = segment_bytes(daemon.name)
            daemon.process.send_signal(signal.SIGCONT)
        ring, data = sensor_ring(cls.data, 0)
        head = struct.unpack_from("=I", data, ring["head_offset"])[0]
        at = ring["offset"] + (head - 1) % ring["slots"] * ring["slot_size"] + 8
        cls.newest = LAYOUT.decode("sample", data[at:at + LAYOUT.sizes["sample"]])

    def refused(self, text, copy, mode=0o640):
        name = copy.write(mode)
        with self.assertRaisesRegex(tactiled.Error, text) as caught:
            tactiled.open(name)
        self.assertIn(str(copy.path), str(caught.exception))

    def test_that_is_no_segment_of_ours_is_refused_with_the_reason(self):
        cases = (
            (f"its layout is version 2.7, this reader knows {tactiled.MAJOR}.{tactiled.MINOR}", [("major", 2), ("minor", 7)]),
            ("no tactiled segment", [("magic", b"TACTILES")]),
            ("the other byte order", [("byte_order", 0x04030201)]),
            ("truncated", [("header_size", 508)]),
            ("truncated", [("total_size", len(self.data) + 1)]),
            ("more sensors or links than can be", [("n_sensors", 17)]),
            ("more sensors or links than can be", [("n_links", 17)]),
            ("directory entries too small", [("sensor_size", 212)]),
            ("directory entries too small", [("link_size", 128)]),
            ("a directory lies outside", [("sensor_offset", len(self.data) - 8)]),
            ("a directory lies outside", [("link_offset", 516)]),
            ("the node ring lies outside", [("node", 128, 256, 2**20, 208, 4)]),
            ("the node ring lies outside", [("node", 1024, 256, 12, 208, 4)]),
        )
        for text, patches in cases:
            with self.subTest(text, patches=patches), a_copy(self.data) as copy:
                for member, *values in patches:
                    copy.put("header", member, *values)
                self.refused(text, copy)
        for member, value in (("offset", 2**31), ("slot_size", 100), ("slots", 0), ("record_size", 252),
                              ("head_offset", len(self.data))):
            with self.subTest(member), a_copy(self.data) as copy:
                ring, _ = sensor_ring(copy.data, 0)
                copy.put("sensor", "ring", *{**ring, member: value}.values(), at=copy.sensor_at())
                self.refused("a sensor's ring lies outside", copy)

    def test_that_is_cut_off_or_writable_by_others_is_refused(self):
        with a_copy(self.data[:100]) as copy:
            self.refused("too short to be a segment", copy)
        with a_copy(self.data[:512]) as copy:
            self.refused("truncated", copy)
        for mode in (0o660, 0o642):
            with a_copy(self.data) as copy:
                self.refused("others than its owner may write it", copy, mode)
        with a_copy(b"") as copy:
            copy.path.symlink_to("/dev/null")
            with self.assertRaisesRegex(tactiled.Error, str(copy.path)):
                tactiled.open(copy.name)

    def test_that_is_a_pipe_stops_nobody(self):
        with a_copy(b"") as copy:
            os.mkfifo(copy.path, 0o640)
            with self.assertRaisesRegex(tactiled.Error, "not a segment"):
                tactiled.open(copy.name)

    def test_of_a_name_that_no_daemon_can_have_is_refused(self):
        for name in ("a" * 32, ""):
            with self.assertRaisesRegex(tactiled.Error, "1 to 31 characters"):
                tactiled.open(name)

    def test_that_may_not_be_read_says_what_to_do(self):
        with a_copy(self.data) as copy:
            name = copy.write(0o600)
            module = (ROOT / "node/python/tactiled.py").read_text()  # nobody may be unable to enter this folder
            code = f"tactiled = __import__('types').ModuleType('tactiled')\nexec({module!r}, tactiled.__dict__)\ntry: tactiled.open({name!r})\nexcept tactiled.Error as e: print(e)"
            nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
            done = subprocess.run([*nobody, sys.executable, "-B", "-"], input=code, capture_output=True, text=True, cwd="/")
            self.assertIn("join the segment's group", done.stdout, done.stderr)

    def test_of_a_later_minor_version_with_larger_records_is_read(self):
        with a_copy(self.data) as copy:
            copy.make_fresh()
            copy.put("header", "minor", 4)
            copy.set_record_size(248)
            entry = bytes(copy.data[copy.sensor_at():copy.sensor_at() + LAYOUT.sizes["sensor"]])
            copy.put("header", "sensor_offset", len(copy.data))
            copy.put("header", "sensor_size", 584)
            copy.data += entry.ljust(584, b"\xff")
            copy.put("header", "total_size", len(copy.data))
            with tactiled.open(copy.write()) as node:
                sample = node.latest("left")
                for name, value in self.newest.items():
                    if name != "t_ns":
                        self.assertTrue(same_bits(value, getattr(sample, name)), name)

    def test_of_version_1_0_is_read_and_its_sensors_have_no_methods(self):
        with a_copy(self.data) as copy:
            copy.make_fresh()
            copy.put("header", "minor", 0)
            entry = bytes(copy.data[copy.sensor_at():copy.sensor_at() + 216])
            copy.put("header", "n_sensors", 1)
            copy.put("header", "sensor_offset", len(copy.data))
            copy.put("header", "sensor_size", 216)
            copy.data += entry
            copy.put("header", "total_size", len(copy.data))
            with tactiled.open(copy.write()) as node:
                self.assertEqual(node.latest("left").force_S_N, self.newest["force_S_N"])
                self.assertEqual((node.info("left").methods, node.info("left").budget_us), ("", 0))
                self.assertEqual(node.reason_counts("left"), {})

    def test_of_smaller_records_has_zeros_for_what_is_missing(self):
        with a_copy(self.data) as copy:
            copy.make_fresh()
            copy.set_record_size(LAYOUT.offset("sample", "cop_S_m"))
            with tactiled.open(copy.write()) as node, node.follow("left", 0.5) as left:
                for sample in (node.latest("left"), next(left), node.snapshot()[1]["left"]):
                    self.assertEqual(sample.force_S_N, self.newest["force_S_N"])
                    self.assertEqual(sample.cop_S_m, (0.0, 0.0))
                    for name in ("residual", "rate_Hz", "temperature_C", "state", "peak_N"):
                        self.assertEqual(getattr(sample, name), 0, name)

    def test_whose_writer_has_published_nothing_yet_is_no_second_end(self):
        with a_copy(self.data) as old, a_copy(self.data) as young:
            old.make_fresh()
            young.name, young.path = old.name, old.path
            header = LAYOUT.decode("header", young.data)
            young.put("header", "epoch", header["epoch"] + 1)
            young.put("header", "state", tactiled.STARTING)
            young.empty_rings()
            with tactiled.open(old.write()) as node, node.follow("left", 0.3) as left:
                self.assertEqual(["stopped" in s.reasons_text for s in itertools.islice(left, 10)], [False, True])
                old.path.unlink()
                young.write()
                self.assertIsNone(next(left, None))
                self.assertEqual(left._segment.header.epoch, header["epoch"] + 1)
                self.assertEqual(self.latest_of(young).reasons_text, ["no-data-yet"])

    def latest_of(self, copy):
        with tactiled.open(copy.name) as node:
            return node.latest("left")

    def test_of_a_successor_that_has_lapped_its_ring_counts_what_is_lost(self):
        with a_copy(self.data) as old, a_copy(self.data) as young:
            young.name, young.path = old.name, old.path
            young.put("header", "epoch", LAYOUT.decode("header", young.data)["epoch"] + 1)
            slots = sensor_ring(young.data, 0)[0]["slots"]
            young.empty_rings(2 * slots)
            with tactiled.open(old.write()) as node, node.follow("left", 0.3) as left:
                self.assertEqual(["stopped" in s.reasons_text for s in itertools.islice(left, 10)], [False, True])
                old.path.unlink()
                young.write()
                kept = sum(1 for _ in left)  # one more is the end of this one
                self.assertEqual(left.lost + kept - 1, 2 * slots)
                self.assertGreater(left.lost, slots)

    def test_whose_times_are_in_the_future_is_not_believed(self):
        """A dead daemon's, read in a time namespace whose clock is behind."""
        with a_copy(self.data) as copy:
            later_ns = time.monotonic_ns() + 600 * 10**9
            copy.date_samples(later_ns)
            offset, slot_size, slots, *_ = LAYOUT.decode("header", copy.data)["node"]
            for slot in range(slots):
                copy.put("node", "t_ns", later_ns, at=offset + slot * slot_size + 8)
            with tactiled.open(copy.write()) as node, node.follow("left", 0.3) as left:
                for sample in (node.latest("left"), node.snapshot()[1]["left"], next(left)):
                    self.assertIn("stale", sample.reasons_text)
                    self.assertTrue(forces_are_nan(sample))
                self.assertIn("stopped", next(left).reasons_text)

    def test_whose_writer_died_within_a_sample_gives_no_half_one(self):
        with a_copy(self.data) as copy:
            copy.make_fresh()
            ring, _ = sensor_ring(copy.data, 0)
            for slot in range(ring["slots"]):
                at = ring["offset"] + slot * ring["slot_size"]
                lock = struct.unpack_from("=I", copy.data, at)[0]
                struct.pack_into("=I", copy.data, at, lock | 1)
            with tactiled.open(copy.write()) as node:
                self.assertEqual(node.latest("left").reasons_text, ["reader-overrun"])
                self.assertTrue(forces_are_nan(node.latest("left")))
                with self.assertRaises(tactiled.Error):
                    node.snapshot()
                began = time.monotonic()
                self.assertEqual(list(node.follow("left", 0.2)), [])
                self.assertLess(time.monotonic() - began, 1)

    def test_that_changes_during_the_copy_is_not_believed(self):
        with a_copy(self.data) as copy, tactiled.open(copy.write()) as node:
            ring = node._segment.sensors["left"][1]
            number = ring.head() - 1
            self.assertIsNotNone(ring.read(number))

            class Overwriting:
                def __getitem__(self, piece):
                    data = node._segment.bytes[piece]
                    with open(copy.path, "r+b") as file:
                        file.seek(ring.offset + (number & ring.slots - 1) * ring.slot_size)
                        file.write(struct.pack("=I", 2 * (number + ring.slots) + 1))
                    return data
            ring._bytes = Overwriting()
            self.assertIsNone(ring.read(number))


class TheExample(unittest.TestCase):
    def test_of_the_docstring_runs_as_printed(self):
        if os.path.exists("/dev/shm/tactiled.gripper"):
            self.skipTest('a daemon of the name "gripper" runs here')
        example = re.search(r"\n\n((?:    .*\n|\n)+)\S", tactiled.__doc__).group(1)
        self.assertIn("import tactiled", example)
        with played_daemon("left", name="gripper") as daemon:
            daemon.start()
            good(daemon)
            environment = {**os.environ, "PYTHONPATH": str(ROOT / "node/python"), "PYTHONUNBUFFERED": "1"}
            example = subprocess.Popen([sys.executable, "-Bc", textwrap.dedent(example)], env=environment, text=True,
                                       stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            lines = [example.stdout.readline() for _ in range(200)]
            daemon.stop()
            rest, errors = example.communicate(timeout=10)
        self.assertEqual((example.returncode, errors), (0, ""))
        self.assertEqual(lines[0], "sensors: left\n")
        self.assertTrue(all(len(line.split()) == 4 for line in lines[1:]))
        self.assertGreater(len({line.split(" ", 1)[1] for line in lines[1:]}), 20, "the forces move")
        self.assertEqual(rest.count("no value: "), 1)
        self.assertRegex(rest, r"\nno value: .*stopped\nnothing new for a second\n$")


if __name__ == "__main__":
    unittest.main(verbosity=2)
