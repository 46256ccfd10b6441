#!/usr/bin/env python3
"""node/python/tactiled.py beside the release daemon: the same layout, the same bits, the same behaviour at an end as
reader.h."""
import itertools
import os
import pathlib
import re
import resource
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
from daemon import BIN, ROOT, Stopwatch, halt, run_folder, wait_for  # noqa: E402
from python_reader import (LAYOUT, RATE_HZ, STALE_MS, WATCHDOG_MS, a_copy, forces_are_nan,  # noqa: E402
                           good, played_daemon, same_bits, segment_bytes, sensor_ring, tactiled)


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
        self.assertEqual(list(tactiled.Sample._fields), [field for field, _, _ in LAYOUT.structs["sample"]] + ["cop_sd_m", "budget"])
        self.assertEqual(tactiled._PLACED.size, LAYOUT.sizes["placed"])
        self.assertEqual(list(tactiled.Command._fields), [field for field, _, _ in LAYOUT.structs["command"]])
        self.assertEqual([field for field, _, _ in LAYOUT.structs["ring"]],
                         ["offset", "slot_size", "slots", "record_size", "head_offset"])
        self.assertEqual(tactiled._STATE_OFFSET, LAYOUT.offset("header", "state"))
        self.assertEqual(tactiled._LINK_SIZE, LAYOUT.sizes["link"])

    def test_have_the_numbers_of_layout_h(self):
        for enum in ("quality", "reason", "sensor_state", "status", "state", "grip_state", "weight_state",
                     "slip_state"):
            self.assertGreater(len(LAYOUT.enums[enum]), 2)
            for name, value in LAYOUT.enums[enum].items():
                self.assertEqual(getattr(tactiled, name), value, name)
        for name in ("BYTE_ORDER", "MAJOR", "MINOR", "MAX_SENSORS", "MAX_LINKS", "AGE_UNBOUNDED"):
            self.assertEqual(getattr(tactiled, name), LAYOUT.numbers[name], name)
        self.assertEqual(tactiled._RECORD_OFFSET, LAYOUT.numbers["RECORD_OFFSET"])

    def test_have_the_words_of_tactilectl(self):
        source = (ROOT / "node/include/tactiled/layout.h").read_text()
        table = dict(re.findall(r'^ +X\((\w+), "([\w-]+)", TACTILED_', source, flags=re.M))
        self.assertEqual(set(table), set(LAYOUT.enums["reason"]))
        for name, word in table.items():
            self.assertEqual(tactiled.REASON_WORDS[getattr(tactiled, name).bit_length() - 1], word)
        self.assertEqual(len(tactiled.REASON_WORDS), len(table))


class ARunningDaemon(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemon = cls.enterClassContext(played_daemon("left", "right"))
        cls.daemon.start()
        good(cls.daemon, "left")
        good(cls.daemon, "right")

    def test_every_sample_comes_once_in_order_with_the_bits_that_a_c_reader_sees(self):
        follow = subprocess.Popen([BIN / "follow", self.daemon.name, "left", "120"], stdout=subprocess.PIPE, text=True)
        self.addCleanup(follow.wait)
        self.addCleanup(follow.kill)
        self.addCleanup(follow.stdout.close)
        lines = [follow.stdout.readline()]
        for wait in ("events", "sleep", "poll"):
            with self.subTest(wait), tactiled.open(self.daemon.name).follow("left", 1, wait) as left:
                samples = [next(left) for _ in range(2 * RATE_HZ if wait == "events" else RATE_HZ // 3)]
                self.assertEqual([s.sequence - samples[0].sequence for s in samples], list(range(len(samples))))
                self.assertEqual(left.lost, 0)
                if wait == "events":
                    followed = samples
        while int(lines[-1].split()[0]) < followed[-1].sequence:
            lines.append(follow.stdout.readline())
        theirs = {int(line.split()[0]): line.rstrip("\n") for line in lines}
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
        with tactiled.open(self.daemon.name) as node:
            wait_for(lambda: node.latest("left").sequence > 50, "samples")
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
            while len(seen) < RATE_HZ / 2:
                record, samples = node.snapshot()
                self.assertEqual(list(samples), ["left", "right"])
                for sample, count in zip(samples.values(), record.count):
                    self.assertEqual(sample.sequence, count - 1)
                    self.assertLessEqual(sample.t_published_ns, record.t_ns)
                self.assertEqual(record.count[2:], (0,) * 14)
                self.assertEqual(len(record.command), 2)
                seen.add(record.sequence)
            self.assertTrue(record.status & tactiled.SIMULATED)

    def test_latest_is_the_newest_and_says_its_age(self):
        with tactiled.open(self.daemon.name) as node:
            for _ in range(200):
                before, asked_ns = node.snapshot()[0].count[1] - 1, time.monotonic_ns()
                sample = node.latest("right")
                self.assertGreaterEqual(sample.sequence, before)
                if sample.quality != tactiled.BAD:
                    self.assertLess((asked_ns - sample.t_ns) / 1e6, STALE_MS)
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
            used, waits, began = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_nvcsw, time.monotonic()
            for _ in range(2 * RATE_HZ):
                sample = next(left)
                late_us.append((time.monotonic_ns() - sample.t_published_ns) / 1000)
            share = (time.process_time() - used) / (time.monotonic() - began)
            waits = (resource.getrusage(resource.RUSAGE_SELF).ru_nvcsw - waits) / len(late_us)
        print(f"events: median {statistics.median(late_us):.0f} us after publishing, "
              f"{share:.1%} of a CPU, {waits:.2f} waits a sample")
        self.assertGreater(waits, 0.5)  # it waits for each sample, and does not poll
        self.assertLess(waits, 2.5)  # naps of 1 ms would be 4
        self.assertLess(share, 0.3)  # usually 3 %; a busy loop takes all

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
        """Returns the samples that still arrive until there is none for half a second."""
        left._timeout = 0.5
        rest = list(itertools.islice(left, 10_000))
        left._timeout = 5
        return rest

    def test_a_stopped_process_is_bad_within_stale_ms(self):
        with self.node.follow("left", 5) as left:
            self.values(left)
            halt(self.daemon.process.pid)
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
            # The samples that the ring still held are too old by now.
            self.assertEqual([s.reasons_text for s in rest[:-1] if s.quality == tactiled.BAD and not s.reasons & tactiled.STALE], [])
            self.assertTrue(rest[-1].reasons & tactiled.DAEMON_STOPPED)
            self.assertTrue(forces_are_nan(rest[-1]))
            self.daemon.process.send_signal(signal.SIGCONT)
            again = [next(left) for _ in range(50)]
            self.assertEqual([s.sequence for s in again], list(range(rest[-1].sequence + 1, rest[-1].sequence + 51)))
            wait_for(lambda: self.node.latest("left").quality != tactiled.BAD, "a value")

    def test_killed_one_bad_sample_then_those_of_the_successor(self):
        for wait in ("events", "sleep", "poll"):
            with self.subTest(wait), self.node.follow("left", 5, wait) as left:
                before = self.values(left)
                self.daemon.process.kill()
                self.daemon.process.wait()
                with Stopwatch() as watch:
                    sample = next(sample for sample in left if sample.quality == tactiled.BAD)
                    took_s = watch.seconds()
                self.assertLess(took_s, WATCHDOG_MS / 1000 + 0.1)
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
                wait_for(lambda: self.node.latest("left").quality != tactiled.BAD, "a value")
                self.assertNotEqual(self.node.latest("left").epoch >> 16, before[-1].epoch >> 16)
                self.assertEqual(self.node.header.pid, self.daemon.process.pid)

    def test_killed_and_its_file_removed_by_hand(self):
        old = self.node.latest("left")
        with self.node.follow("left", 5) as left:
            self.values(left)
            self.daemon.process.kill()
            self.daemon.process.wait()
            self.daemon.segment.unlink()
            self.daemon.start()
            wait_for(lambda: self.node.latest("left").epoch != old.epoch, "the successor")
            wait_for(lambda: self.node.latest("left").quality != tactiled.BAD, "a value of the successor")
            wait_for(lambda: next(left).epoch != old.epoch, "the successor")

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
        halt(self.daemon.process.pid)
        with self.node.follow("left", 0.1) as left:
            next(left)
            with Stopwatch() as watch:
                self.assertIsNone(next(left, None))  # the hang is not detected yet: asks for events
                self.assertLess(watch.seconds(), 0.15)
            time.sleep(WATCHDOG_MS / 1000)
            with Stopwatch() as watch:
                self.assertIn("stopped", next(left).reasons_text)
                self.assertIsNone(next(left, None))
                self.assertLess(watch.seconds(), 0.2)
            self.daemon.process.send_signal(signal.SIGCONT)
            left._timeout = 1
            wait_for(lambda: next(left) and left._events is not None, "events")

    def test_a_timeout_ends_the_loop_and_the_next_one_goes_on(self):
        timeout_s = 1.5 * STALE_MS / 1000  # the sample that is stale comes before it
        with self.node.follow("left", timeout_s) as left:
            last = self.values(left)[-1]
            halt(self.daemon.others[0].pid)
            for sample in left:
                last = sample
            began_s = time.monotonic()
            with Stopwatch() as watch:
                self.assertEqual(list(left), [])
                self.assertLess(watch.seconds(), timeout_s + 0.1)
            self.assertGreater(time.monotonic() - began_s, timeout_s - 0.1)
            self.assertGreaterEqual(self.node.reason_counts("left")["stale"], 1)
            self.assertNotIn("frozen", self.node.reason_counts("left"))
            self.daemon.others[0].send_signal(signal.SIGCONT)
            self.assertEqual(next(left).sequence, last.sequence + 1)


class TheExample(unittest.TestCase):
    def test_of_the_docstring_runs_as_printed(self):
        if (run_folder() / "tactiled.gripper").exists():
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
            rest, errors = example.communicate(timeout=60)
        self.assertEqual((example.returncode, errors), (0, ""))
        self.assertEqual(lines[0], "sensors: left\n")
        self.assertTrue(all(len(line.split()) == 4 for line in lines[1:]))
        self.assertGreater(len({line.split(" ", 1)[1] for line in lines[1:]}), 20, "the forces move")
        self.assertEqual(rest.count("no value: "), 1)
        self.assertRegex(rest, r"\nno value: .*stopped\nnothing new for a second\n$")


if __name__ == "__main__":
    unittest.main(verbosity=2)
