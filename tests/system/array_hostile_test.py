#!/usr/bin/env python3
"""Hostile datagrams at the UDP port of a daemon that receives an array: what is no piece of a frame is dropped and counted, the
values stay those of the device and GOOD, and memory does not grow. MUTATIONS=1000000 in the environment: a longer run, which
prints its counts."""
import json
import math
import os
import random
import shutil
import socket
import struct
import sys
import time
import unittest

import process_costs
from array_device import ANSWER, FORMAT, HAS_TIME, I16, ArrayDevice, array_daemon, with_crc
from array_ramp import HALF_COUNT_N, Ramp, force_N
from daemon import ROOT, wait_for

sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

MUTATIONS = int(os.environ.get("MUTATIONS", 20_000))
BATCH, PAUSE_S = 40, 0.001  # fewer than the socket's buffer holds
F32 = 5
# The reasons of samples after a busy machine has stopped the daemon for so long that the link is opened again.
DELAYED = tactiled.DISCONNECTED | tactiled.STALE | tactiled.STEPPED | tactiled.UNPROVED_AGE | tactiled.ZERO_OLD
TAXELS = 32 * 32


def piece(sequence=0, numbers=(), t_us=0, taxels=TAXELS, values=1, first=0, count=None, form=FORMAT, device=0, kind=I16, flags=HAS_TIME, reserved=0):
    """A message with a right CRC; `count` may be another one than that of the numbers."""
    head = struct.pack("<BBBBIIHBBHH", form, device, kind, flags, sequence & 0xFFFFFFFF, t_us & 0xFFFFFFFF, taxels, values, reserved, first,
                       len(numbers) if count is None else count)
    return with_crc(head + struct.pack(f"<{len(numbers)}{'f' if kind == F32 else 'h'}", *numbers))


class Hostile(unittest.TestCase):
    def setUp(self):
        self.dice = random.Random(1)
        self.device = self.enterContext(Ramp(rows=32, columns=32, rate_Hz=100))
        self.daemon = array_daemon(self.device, stale_ms=2000)
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        self.node = self.enterContext(tactiled.open(self.daemon.name, str(self.daemon.segment.parent)))

    def counts(self):
        return json.loads(self.daemon.ctl("status", "--json").stdout)["links"][0]

    def send(self, messages, sender=None):
        """Sends them, by default from the device's own address, and judges each array that comes meanwhile. Returns what the link
        has counted, with `n` messages and `size` bytes sent."""
        before, cpu_s, memory_kB = self.counts(), process_costs.cpu_s(self.daemon.process.pid), process_costs.status(self.daemon.process.pid, "VmRSS")
        n = size = 0
        first, doubtful = self.node.latest("skin").sequence, []
        with self.node.follow("skin", 0) as samples:
            for message in messages:
                (sender or self.device.socket).sendto(message, ("127.0.0.1", self.device.listen))
                n, size = n + 1, size + len(message)
                if n % BATCH == 0:
                    self.judge(samples, doubtful)
                    time.sleep(PAUSE_S)
            last = self.node.latest("skin").sequence
            wait_for(lambda: self.node.latest("skin").sequence > last + 5, "arrays after the last message")
            self.judge(samples, doubtful)
        after = self.counts()
        found = {key: after[key] - before[key] for key in after if isinstance(after[key], int) and not isinstance(after[key], bool)}
        used_us = 1e6 * (process_costs.cpu_s(self.daemon.process.pid) - cpu_s) / n
        self.assertLess(process_costs.status(self.daemon.process.pid, "VmRSS") - memory_kB, 1000)
        if "MUTATIONS" in os.environ:
            print(self.id().rpartition(".")[2], n, "sent,", f"{used_us:.1f} us each with those of the device,", {key: value for key, value in found.items() if value})
        self.assertGreater(self.node.latest("skin").sequence, first)
        self.assertEqual([sample.reasons_text for sample in doubtful if not found["opened"] or sample.reasons & ~DELAYED], [])
        return {**found, "n": n, "size": size}

    def judge(self, samples, doubtful):
        """Keeps the samples that are not GOOD, and tests the values of the others."""
        for sample in samples:
            if sample.quality != tactiled.GOOD:
                doubtful.append(sample)
                continue
            self.assertLess(abs(-sample.force_S_N[2] - TAXELS * force_N(sample.device_sequence)), TAXELS * HALF_COUNT_N)
        array = self.node.array("skin")
        self.assertTrue(array.sample.quality == tactiled.BAD or all(abs(-row[0] - force_N(array.sample.device_sequence)) < HALF_COUNT_N for row in array.force_S_N.tolist()))

    def expect_all(self, found, *counters):
        """All that was sent was counted, but for what the socket's buffer did not hold."""
        self.assertLessEqual(sum(found[key] for key in counters), found["n"])
        self.assertGreaterEqual(sum(found[key] for key in counters), found["n"] - found["overrun"])

    def newest(self):
        return self.node.latest("skin").device_sequence

    def mutations(self, n):
        """Good pieces of right and wrong frames in which bytes were changed, removed, added or repeated; the CRC is no longer right."""
        good = [piece(self.dice.randrange(1 << 32), [self.dice.randrange(-999, 999) for _ in range(500)], first=self.dice.choice((0, 512))) for _ in range(50)]
        for _ in range(n):
            message = bytearray(self.dice.choice(good))
            for _ in range(self.dice.choice((1, 1, 2, 5, 50))):
                at = self.dice.randrange(len(message))
                way = self.dice.randrange(4)
                if way == 0:
                    message[at] ^= 1 << self.dice.randrange(8)
                elif way == 1 and len(message) > 1:
                    del message[at:at + self.dice.randrange(1, 40)]
                    message = message or bytearray(b"\3")
                elif way == 2:
                    message[at:at] = self.dice.randbytes(self.dice.randrange(1, 40))
                else:
                    message[at:at] = message[at:at + self.dice.randrange(1, 200)]
            if bytes(message) not in good:
                yield bytes(message)

    def test_mutations_are_dropped_and_counted(self):
        self.expect_all(self.send(self.mutations(MUTATIONS)), "bad_checksum", "bad_length")

    def lies(self, n):
        """Messages with a right CRC that are no piece of this array."""
        numbers = [20000] * 100
        wrong = [dict(taxels=1023), dict(taxels=0), dict(taxels=65535), dict(values=0), dict(values=2), dict(values=255), dict(count=0), dict(count=99),
                 dict(count=101), dict(count=65535), dict(first=925), dict(first=1024), dict(first=65535), dict(first=65535, count=1), dict(reserved=1),
                 dict(flags=4), dict(flags=0x82), dict(flags=3), dict(kind=6), dict(kind=255), dict(kind=0), dict(kind=4), dict(device=16), dict(device=255),
                 dict(form=0), dict(form=1), dict(form=5), dict(form=255), dict(form=ANSWER)]
        cut = [with_crc(piece(0, numbers)[:size]) for size in (12, 13, 19, 20, 21, 23, 219)]
        others = [b"", b"\3", b"\3" * 15, with_crc(b""), bytes(60_000), piece(0, numbers) * 3]
        for k in range(n):
            if k % 3 == 0:
                yield self.dice.choice(cut + others)
            else:
                yield piece(self.newest() + self.dice.randrange(-9, 9) if k % BATCH == 0 else k, numbers, **self.dice.choice(wrong))

    def test_lies_with_a_right_checksum_are_dropped_and_counted(self):
        self.expect_all(self.send(self.lies(MUTATIONS // 4)), "bad_length", "bad_checksum")

    def repeats(self, n):
        for _ in range(n):
            yield piece(self.newest() - self.dice.randrange(1, 4), [20000] * 500, first=self.dice.choice((0, 524)))

    def test_pieces_of_earlier_frames_are_repeated(self):
        self.expect_all(self.send(self.repeats(MUTATIONS // 4)), "repeated")

    def answers(self, n):
        """Answers that nobody asked for, with the numbers of requests that have ended or were never sent."""
        for _ in range(n):
            number = self.dice.choice((0, 2 * self.dice.randrange(1000), self.dice.randrange(1 << 31, 1 << 32)))
            yield with_crc(struct.pack("<BBHII", ANSWER, self.dice.choice((0, 1, 15)), 0, number, self.dice.randrange(1 << 32)))

    def test_answers_to_no_request_change_nothing(self):
        found = self.send(self.answers(MUTATIONS // 4))
        self.assertEqual([found[key] for key in ("bad_length", "bad_checksum", "lost")], [0, 0, 0])

    def test_other_addresses_are_not_believed(self):
        """Whole frames with the device's next numbers, from another port and another address."""
        for address in ("127.0.0.1", "127.0.0.2"):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
                stranger.bind((address, 0 if address == "127.0.0.1" else self.device.port))
                found = self.send((piece(self.newest() + self.dice.randrange(1, 4), [20000] * TAXELS) for _ in range(MUTATIONS // 8)), stranger)
                self.assertGreaterEqual(found["skipped_bytes"], found["size"] - found["overrun"] * len(piece(0, [0] * TAXELS)))
                self.assertEqual(found["lost"], 0)

    def test_pieces_of_later_frames_cost_frames_and_mix_none(self):
        """Pieces that the device itself might send: each begins a frame that never ends."""
        places = (0, 500, TAXELS - 100)
        self.send(piece(self.newest() + self.dice.choice((1, 2, 1000, 1 << 31)), [20000] * 100, self.dice.randrange(1 << 32), first=self.dice.choice(places))
                  for _ in range(MUTATIONS // 40))


class EchoLies(unittest.TestCase):
    def test_a_device_whose_answers_have_another_time_proves_no_age(self):
        """Its frames have the right time, and its answers an earlier or any time."""
        class Liar(ArrayDevice):
            def now_us(self):
                return super().now_us() - self.late_us()

        lies = {"five_s": lambda: 5_000_000, "fifty_ms": lambda: 50_000, "any": lambda: random.randrange(1 << 32)}
        devices = [Liar(name, 4, 4) for name in lies]
        for device in devices:
            device.late_us = lies[device.name]
            self.enterContext(device)
        daemon = array_daemon(*devices)
        self.addCleanup(shutil.rmtree, daemon.folder)
        self.addCleanup(daemon.__exit__)
        wait_for(lambda: all(device.answers > 5 for device in devices), "answers")
        with tactiled.open(daemon.name, str(daemon.segment.parent)) as node:
            for name in lies:
                with node.follow(name, 0, from_oldest=True) as samples:
                    seen = [sample.reasons_text for sample in samples]
                self.assertGreater(len(seen), 50, name)
                self.assertTrue(all("unproved-age" in reasons or "no-data-yet" in reasons for reasons in seen), (name, seen[-1]))


class AnyFloats(unittest.TestCase):
    def test_no_array_with_a_value_has_a_number_that_is_infinite(self):
        """A device that sends all kinds of f32: NaN, infinities, the largest and the smallest ones, and any bits."""
        dice = random.Random(2)
        odd = [math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-45, -1e-45, 1e-38, 0.0, -0.0, 1e20, 1e30]

        class Floats(ArrayDevice):
            def pieces(self, t_us, _):
                n = self.sequence
                values = [2.0 + 0.01 * dice.random() for _ in self.places_m]
                for _ in range(dice.choice((1, 2, 50))) if n > 100 else ():
                    values[dice.randrange(len(values))] = dice.choice((*odd, struct.unpack("<f", dice.randbytes(4))[0]))
                yield piece(n, values, t_us, len(values), kind=F32)

        def numbers(value):
            if isinstance(value, (tuple, list)):
                return [number for part in value for number in numbers(part)]
            return [value] if isinstance(value, float) else []

        with Floats(rows=8, columns=12, rate_Hz=400) as device, array_daemon(device) as daemon, tactiled.open(daemon.name, str(daemon.segment.parent)) as node:
            out, wrong, last = 0, [], device.sequence + 1500
            while device.sequence < last:
                array = node.array("skin")
                out += array.n_out
                if any(map(math.isinf, numbers([*array.sample, *array[1:-2], array.force_S_N.tolist()]))):
                    wrong.append((array.sample.reasons_text, array))
                if array.sample.quality == tactiled.GOOD and not math.isfinite(array.sample.force_S_N[2]):
                    wrong.append("GOOD and no number")
            self.assertGreater(out, 0)
            self.assertIsNone(daemon.process.poll())
            self.assertEqual(wrong[:1], [])


if __name__ == "__main__":
    unittest.main()
