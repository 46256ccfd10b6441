#!/usr/bin/env python3
"""A CAN bus that goes down, is removed, goes bus-off, floods, and sends wrong or incomplete data. Inside the test
machine."""
import os
import pathlib
import signal
import socket
import struct
import time
import unittest

from can_bus import BUS_OFF, CONTROLLER, ERROR, EXTENDED, IP, PROTOCOL, REMOTE, VALUE, Bus, Case, link
from machine import link_of, now_ns, sh, wait_for
from tactiled import GOOD


SOL_CAN_ISOTP, CAN_ISOTP_OPTS, WAIT_TX_DONE = 106, 1, 0x400  # linux/can/isotp.h


class Vcan(Case):
    def setUp(self):
        if not pathlib.Path("/sys/class/net/vcan0").exists():
            self.make()
        self.bus = Bus("vcan0")
        self.addCleanup(self.bus.close)

    def make(self):
        sh(IP, "link", "add", "dev", "vcan0", "type", "vcan")
        sh(IP, "link", "set", "vcan0", "mtu", "72")
        sh(IP, "link", "set", "vcan0", "up")

    def test_fd_messages_as_fast_as_they_come_all_arrive(self):
        # A pipeline of 4 kHz and a witness in Python would be what is measured on this emulated core.
        self.start("[realtime]\nperiod_us = 20000\n" + link("vcan0", device="id = 0x1ABCDE0\nextended = true\nbytes = 64"))
        self.tip.close()
        count, began = 12_000, time.monotonic()
        for n in range(count):
            self.bus.send_fd(0x1ABCDE0 | EXTENDED, struct.pack("<hH60x", VALUE, n & 0xFFFF))
            if n % 4 == 3:
                time.sleep(max(0, began + (n + 1) / 4000 - time.monotonic()))
        print(f"FD: {count / (time.monotonic() - began):.0f} messages of 64 bytes a second; 4000 were asked for", flush=True)
        self.expect(frames=count, bytes=64 * count, lost=0, overrun=0, ring_full=0, skipped_bytes=0, bad_length=0)

    def isotp(self):
        """A device whose sample is a message of 100 bytes: value and counter at its front, and both at its end again."""
        self.start("[realtime]\nperiod_us = 20000\n" + link("vcan0", device="id = 0x7E8\nisotp_reply_id = 0x7E0\nbytes = 100"))
        sender = socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_ISOTP)
        self.addCleanup(sender.close)
        sender.setsockopt(SOL_CAN_ISOTP, CAN_ISOTP_OPTS, struct.pack("=IIBBBB", WAIT_TX_DONE, 0, 0, 0xCC, 0xCC, 0))
        sender.bind(("vcan0", 0x7E0, 0x7E8))
        return sender

    def message(self, number):
        return struct.pack("<hH", VALUE, number) + bytes(range(96))

    def test_the_kernels_own_isotp_is_understood_and_answered(self):
        sender = self.isotp()
        for number in range(200):
            sender.send(self.message(number))  # returns when the last frame is out: each waits for our flow control
        self.expect(frames=200, lost=0, bad_length=0, bus_error=0, skipped_bytes=0)
        self.all_values_are_right()

    def test_an_isotp_message_with_a_frame_missing_doubled_or_swapped_is_dropped_whole_and_counted(self):
        sender = self.isotp()
        sender.send(self.message(0))
        payload = self.message(1)
        frames = [bytes([0x10, 100]) + payload[:6]]
        frames += [bytes([0x20 | n & 15]) + payload[7 * n - 1:7 * n + 6] for n in range(1, 15)]
        broken = (frames[:5] + frames[6:], frames[:5] + frames[4:], frames[:3] + [frames[4], frames[3]] + frames[5:], frames[:9])
        for turn in broken:
            for frame in turn:
                self.bus.send(0x7E8, frame)
            time.sleep(0.05)
        sender.send(self.message(len(broken) + 1))
        self.bus.send(0x7E8, bytes([0x45, 1, 2]))  # no frame of the protocol
        self.expect(frames=2, lost=len(broken), bad_length=1)
        self.assertEqual(self.tip.last().lost, len(broken))
        self.all_values_are_right()

    def test_error_frames_are_counted_and_end_nothing(self):
        self.start(link("vcan0"))
        for n in range(10):
            self.bus.sample()
            self.bus.send(ERROR | PROTOCOL, bytes(8))
        for _ in range(3):
            self.bus.send(ERROR | CONTROLLER, bytes([0, 1, 0, 0, 0, 0, 0, 0]))  # RX_OVERFLOW
        self.bus.send(ERROR | CONTROLLER, bytes([0, 0x10, 0, 0, 0, 0, 0, 0]))  # error passive
        self.bus.sample()
        self.expect(frames=11, bus_error=11, overrun=3, gone=0, lost=0, skipped_bytes=0)
        self.all_values_are_right()

    def test_a_bus_off_frame_is_bad_at_once(self):
        self.start(link("vcan0"))
        for n in range(1, 4):
            self.bus.sample()
            self.good()
            began = now_ns()
            self.bus.send(ERROR | BUS_OFF, bytes(8))
            bad = self.bad_after(began)
            print(f"bus-off frame: BAD within {(bad - began) / 1e6:.1f} ms", flush=True)
            self.assertLess(bad - began, 500e6)  # stale_ms is 1000
            self.expect(gone=n, bus_error=n, opened=n + 1)

    def test_down_and_up_again(self):
        self.start(link("vcan0"))
        self.device(self.bus.sample)
        for turn in range(1, 4):
            self.break_and_repair("down", lambda: sh(IP, "link", "set", "vcan0", "down"),
                                  lambda: sh(IP, "link", "set", "vcan0", "up"))
            self.expect(gone=turn)
        self.assertIn("vcan0 is down: ip link set vcan0 up", self.daemon.log())
        self.all_values_are_right()

    def test_deleted_and_made_again(self):
        self.start(link("vcan0"))
        senders = [self.bus]

        def send():
            senders[-1].sample()

        def make():
            self.make()
            bus = Bus("vcan0")
            bus.number = senders[-1].number
            self.addCleanup(bus.close)
            senders.append(bus)
        self.device(send)
        for turn in range(1, 4):
            self.break_and_repair("deleted", lambda: sh(IP, "link", "del", "vcan0"), make)
            self.expect(gone=turn)
        self.assertIn("there is no interface vcan0", self.daemon.log())
        self.all_values_are_right()

    def test_an_overflow_is_counted_exactly_and_what_waited_is_old(self):
        self.start(link("vcan0"))
        self.bus.sample()
        self.expect(frames=1)
        os.kill(self.daemon.process.pid, signal.SIGSTOP)
        sent_ns = now_ns()
        for _ in range(1500):  # a socket holds some 560
            self.bus.sample()
        last_ns = now_ns()
        time.sleep(0.3)
        continued = now_ns()
        os.kill(self.daemon.process.pid, signal.SIGCONT)
        wait_for(lambda: link_of(self.daemon, "can")["frames"] > 1, "what waited")
        time.sleep(0.5)
        self.bus.sample()  # with it comes the kernel's count
        wait_for(lambda: link_of(self.daemon, "can")["overrun"] > 0, "the count")
        seen = link_of(self.daemon, "can")
        print(f"stopped: {seen['frames']} of 1502 came, {seen['overrun']} overrun, {seen['lost']} lost by the counter", flush=True)
        self.assertEqual(seen["frames"] + seen["overrun"], 1502)
        self.assertEqual(seen["lost"], seen["overrun"])
        waited = [s for at, s in list(self.tip.samples) if at >= continued and s.quality == GOOD and s.sequence > 1]
        old = [s for s in waited if s.t_ns < continued]
        self.assertGreater(len(old), 10)
        for s in old:
            self.assertTrue(sent_ns - 1e6 <= s.t_ns <= last_ns + 20e6, (s.t_ns - sent_ns, last_ns - sent_ns))

    def test_what_is_lost_at_the_end_is_counted_too(self):
        self.start(link("vcan0"))
        self.bus.sample()
        self.expect(frames=1)
        os.kill(self.daemon.process.pid, signal.SIGSTOP)
        for _ in range(1500):  # a socket holds some 560
            self.bus.sample()
        sh(IP, "link", "set", "vcan0", "down")
        os.kill(self.daemon.process.pid, signal.SIGCONT)
        wait_for(lambda: link_of(self.daemon, "can")["gone"] == 1, "the end")
        sh(IP, "link", "set", "vcan0", "up")
        wait_for(lambda: link_of(self.daemon, "can")["overrun"] > 0, "the count")
        seen = link_of(self.daemon, "can")
        print(f"stopped, then down: {seen['frames']} of 1501 came, {seen['overrun']} overrun", flush=True)
        self.assertEqual(seen["frames"] + seen["overrun"], 1501)

    def test_the_wall_clock_may_be_set_at_any_moment(self):
        self.start(link("vcan0"))
        self.device(self.bus.sample)
        self.good()
        began = now_ns()
        for step_s in 3600, -7200, 3600:
            time.clock_settime(time.CLOCK_REALTIME, time.time() + step_s)
            time.sleep(0.5)
        times = [s.t_ns for s in self.tip.between(began, now_ns())]
        self.assertGreater(len(times), 20)
        self.assertEqual(times, sorted(times))
        self.assertEqual(len({s.epoch for s in self.tip.between(began, now_ns())}), 1, "an age made it stale")
        for at, s in list(self.tip.samples):
            self.assertLessEqual(s.t_ns, at)
        self.assertLess(max(b - a for a, b in zip(times, times[1:])), 900e6)
        self.expect(gone=0, lost=0)

    def test_only_the_configured_messages_come_through(self):
        self.start(link("vcan0"))
        self.bus.sample()
        for n in range(1000):
            self.bus.send(0x124, bytes(8))
            self.bus.send(0x123 | EXTENDED, bytes(8))
            self.bus.send(0x123 | REMOTE, bytes(4))
        self.bus.send(0x123, bytes(3))  # too short for its counter
        self.bus.sample()
        self.expect(frames=2, bad_length=1, bytes=4 + 3 + 4, skipped_bytes=3, lost=0, bus_error=0)
        self.all_values_are_right()

    def test_a_sample_of_two_messages_of_a_dbc_file_is_whole_or_lost(self):
        text = link("vcan0").replace("unit1", "unit2")
        begin, end = text.index("id = 0x123"), text.index("[[sensor]]")
        text = text[:begin] + 'dbc = "tip.dbc"\nsignals = ["Force.Fx", "Torque.Mz"]\nsequence = "Count"\nwindow_ms = 1000\n\n' + text[end:]
        self.make_daemon(text)
        (self.daemon.folder / "tip.dbc").write_text(
            'BO_ 291 Force: 8 TIP\n SG_ Fx : 7|16@0- (1,0) [0|0] "N" PLC\n SG_ Count : 24|8@1+ (1,0) [0|0] "" PLC\n'
            'BO_ 292 Torque: 8 TIP\n SG_ Mz : 7|16@0- (1,0) [0|0] "Nm" PLC\n SG_ Count : 24|8@1+ (1,0) [0|0] "" PLC\n')
        self.start_daemon()
        for n in range(300):
            if n % 10 != 3:
                self.bus.send(291, struct.pack(">hxB4x", n, n & 0xFF))
            if n % 10 != 7:
                self.bus.send(292, struct.pack(">hxB4x", -n, n & 0xFF))
        self.expect(frames=240, lost=60)
        wait_for(lambda: self.tip.last().lost == 60, "the last one")
        for _, s in list(self.tip.samples):
            if s.quality == GOOD:
                self.assertEqual(round(s.force_S_N[0]), -round(s.force_S_N[1]))


if __name__ == "__main__":
    unittest.main()
