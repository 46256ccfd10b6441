#!/usr/bin/env python3
"""node/python/tactiled.py on files: a segment that is cut, foreign, from another version, or overwritten while it is
read."""
import itertools
import math
import os
import pathlib
import signal
import struct
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import ROOT, Stopwatch  # noqa: E402
from python_reader import LAYOUT, a_copy, forces_are_nan, good, played_daemon, same_bits, segment_bytes, sensor_ring, tactiled  # noqa: E402


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
        for member, value in (("offset", 2**31), ("slot_size", 100), ("slots", 0), ("record_size", 508),
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
        for name in ("../../x", "a/b", "a b", "\u00e4", "a\0"):
            with self.assertRaisesRegex(tactiled.Error, "characters A-Z"):
                tactiled.open(name)

    def test_that_may_not_be_read_says_what_to_do(self):
        with a_copy(self.data) as copy:
            name = copy.write(0o600)
            module = (ROOT / "node/python/tactiled.py").read_text()  # user nobody may be unable to enter this folder
            code = f"tactiled = __import__('types').ModuleType('tactiled')\nexec({module!r}, tactiled.__dict__)\ntry: tactiled.open({name!r})\nexcept tactiled.Error as e: print(e)"
            nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
            done = subprocess.run([*nobody, sys.executable, "-B", "-"], input=code, capture_output=True, text=True, cwd="/")
            self.assertIn("join the group of the segment", done.stdout, done.stderr)

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
                    if name not in ("t_ns", "t_published_ns"):
                        self.assertTrue(same_bits(value, getattr(sample, name)), name)

    def test_of_version_1_7_is_read_and_its_ages_have_no_bound(self):
        with a_copy(self.data) as copy:
            copy.make_fresh()
            copy.put("sensor", "age_bound_us", 12_346, at=copy.sensor_at())
            with tactiled.open(copy.write()) as node:
                self.assertEqual(node.info("left").age_bound_us, 12_346)
            copy.put("header", "minor", 7)
            copy.put("header", "n_sensors", 1)
            copy.put("header", "sensor_size", LAYOUT.offset("sensor", "age_bound_us"))
            with tactiled.open(copy.write()) as node:
                info = node.info("left")
                self.assertEqual((tactiled.FRESHNESS[info.freshness], info.age_bound_us), ("cable", tactiled.AGE_UNBOUNDED))
                self.assertTrue(math.isnan(info.undetected_mean) and math.isnan(info.undetected_worst))

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
                kept = sum(1 for _ in left)  # one more is the end of this daemon
                self.assertEqual(left.lost + kept - 1, 2 * slots)
                self.assertGreater(left.lost, slots)

    def test_whose_times_are_in_the_future_is_not_believed(self):
        """A dead daemon's segment, read in a time namespace whose clock is behind."""
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

    def test_is_judged_by_the_clock_after_the_copy(self):
        with a_copy(self.data) as copy:
            copy.make_fresh()
            copy.put("sensor", "stale_ms", 1000, at=copy.sensor_at())
            with tactiled.open(copy.write()) as node:
                read = node._segment.sensors["left"][1].latest

                def interrupted():
                    record = read()
                    time.sleep(1.1)
                    return record

                self.assertNotIn("stale", node.latest("left").reasons_text)
                node._segment.sensors["left"][1].latest = interrupted
                self.assertIn("stale", node.latest("left").reasons_text)

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
                with Stopwatch() as watch:
                    self.assertEqual(list(node.follow("left", 0.2)), [])
                    self.assertLess(watch.seconds(), 1)

    def test_that_changes_during_the_copy_is_not_believed(self):
        with a_copy(self.data) as copy, tactiled.open(copy.write()) as node:
            ring = node._segment.sensors["left"][1]
            number = ring.head() - 1
            self.assertIsNotNone(ring.read(number))

            def overwriting(at, size):
                data = node._segment.read(at, size)
                with open(copy.path, "r+b") as file:
                    file.seek(ring.offset + (number & ring.slots - 1) * ring.slot_size)
                    file.write(struct.pack("=I", 2 * (number + ring.slots) + 1))
                return data
            ring._read = overwriting
            self.assertIsNone(ring.read(number))


if __name__ == "__main__":
    unittest.main(verbosity=2)
