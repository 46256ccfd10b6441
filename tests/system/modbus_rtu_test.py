#!/usr/bin/env python3
"""Modbus RTU of the release daemon on a pty: two foreign masters, then the line byte by byte."""
import contextlib
import os
import pathlib
import shutil
import socket
import struct
import subprocess
import sys
import time
import unittest

from pymodbus.client import ModbusSerialClient

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "interop"))
from contract import CONSTANTS, RTU_ADDRESS, expected, map_daemon, start_map, wait_for  # noqa: E402
from daemon import PATIENCE_S, Stopwatch  # noqa: E402
from mbpoll_client import Mbpoll  # noqa: E402
from pymodbus_client import Pymodbus, poll  # noqa: E402
from refusals import REFUSALS  # noqa: E402
from rtu_line import GAP_S, Line, framed, read_words, words, write_word  # noqa: E402

MAGIC = [0x5441, 0x4354]
SLOW_S = 0.3  # ends a frame at 300 baud: t3.5 is 0.13 s
NEIGHBOUR = 9
SCRATCH = 5100
TARE_COUNT, STATUS, TARING = 120, 7, 0x100


@contextlib.contextmanager
def socat_pair(near, far):
    """Makes two ends of a serial line; yields the process."""
    with subprocess.Popen(["socat", f"pty,raw,echo=0,link={near}", f"pty,raw,echo=0,link={far}"]) as process:
        try:
            wait_for(lambda: near.is_symlink() and far.is_symlink(), "socat's ptys")
            yield process
        finally:
            process.terminate()


class ForeignMasters(unittest.TestCase):
    maxDiff = None

    def setUp(self):
        if shutil.which("socat") is None:
            self.skipTest("no socat: apt-get install socat")
        self.daemon = self.enterContext(map_daemon(rtu=True))
        self.device = self.daemon.folder / "master"
        self.socat = self.enterContext(socat_pair(self.daemon.folder / "rtu", self.device))
        start_map(self.daemon)
        self.client = ModbusSerialClient(str(self.device), baudrate=19200, timeout=1)
        self.assertTrue(self.client.connect())
        self.addCleanup(self.client.close)
        opened = poll(lambda: not self.client.read_holding_registers(0, count=1, slave=RTU_ADDRESS).isError(), bool)
        self.assertTrue(opened, self.daemon.log())
        self.client.write_register(5004, 0, slave=RTU_ADDRESS)  # the first number is adopted

    def test_mbpoll_sees_the_map_and_tares(self):
        self.client.close()
        master = Mbpoll("-m", "rtu", "-a", RTU_ADDRESS, "-b", 19200, "-P", "even", self.device)
        without = ("scratch_fc22", "scratch_fc23", "tare_fc23", "refused_fc22", "refused_fc23", "fc17", "identity")
        self.assertEqual(master.table(), expected(without))

    def test_pymodbus_sees_the_map_and_tares(self):
        self.assertEqual(Pymodbus(self.client, RTU_ADDRESS).table(), expected())


class OnTheLine(unittest.TestCase):
    def setUp(self):
        self.daemon = self.enterContext(map_daemon(rtu=True, tare_ms=1500))
        self.line = self.enterContext(Line(self.daemon.folder / "rtu", RTU_ADDRESS))
        start_map(self.daemon)
        self.until_answered()

    def until_answered(self, seconds=30):
        """Sends requests until the daemon has the line open; returns the duration by a Stopwatch."""
        with Stopwatch() as watch:
            while True:
                try:
                    self.line.ask(read_words(0), 0.1)
                    took_s = watch.seconds()
                    self.line.heard()  # late answers to earlier requests
                    return took_s
                except AssertionError:
                    self.assertLess(watch.seconds(), seconds, self.daemon.log())
                    self.line.heard(GAP_S)

    def assert_answered(self):
        self.assertEqual(words(self.line.ask(read_words(0, 2))), MAGIC)

    def assert_silent_then_answered(self, *frames):
        for frame in frames:
            self.line.write(frame)
            time.sleep(GAP_S)
        self.assertEqual(self.line.heard().hex(" "), "")
        self.assert_answered()

    def word(self, address):
        return words(self.line.ask(read_words(address)))[0]

    def tare_count_reaches(self, count):
        self.assertEqual(poll(lambda: self.word(TARE_COUNT), lambda seen: seen == count), count)
        self.assertEqual(poll(lambda: self.word(STATUS) & TARING, lambda seen: not seen), 0, "its zero is in the file")

    def test_its_own_address_is_answered(self):
        self.assert_answered()
        self.assertEqual(words(self.line.ask(read_words(9000, 12, function=4))), CONSTANTS)
        self.assertEqual(len(words(self.line.ask(read_words(100, 125)))), 125)

    def test_a_wrong_crc_is_met_with_silence(self):
        frame = framed(RTU_ADDRESS, write_word(SCRATCH, 99))
        self.assert_silent_then_answered(frame[:-1] + bytes([frame[-1] ^ 1]))
        self.assert_silent_then_answered(frame[:-2] + frame[:-3:-1])
        self.assertEqual(self.word(SCRATCH), 0)

    def test_other_devices_are_left_alone(self):
        request = framed(NEIGHBOUR, read_words(0, 2))
        answer = framed(NEIGHBOUR, struct.pack(">BBHH", 3, 4, *MAGIC))
        write = framed(NEIGHBOUR, write_word(SCRATCH, 99))
        self.assert_silent_then_answered(request)
        self.assert_silent_then_answered(request, answer)
        self.assert_silent_then_answered(write, write)
        self.assertEqual(self.word(SCRATCH), 0)

    def test_a_request_inside_the_answer_of_a_neighbour_is_none(self):
        inside = framed(RTU_ADDRESS, write_word(SCRATCH, 99))
        self.assert_silent_then_answered(framed(NEIGHBOUR, bytes([3, len(inside)]) + inside))
        self.assertEqual(self.word(SCRATCH), 0)

    def test_noise_costs_no_request_but_the_one_that_it_touches(self):
        begun = bytes([RTU_ADDRESS, 3])
        for noise in (b"\x00", b"\xff\x00\x55", begun[:1], begun, os.urandom(40), bytes(700)):
            self.line.write(noise)
            time.sleep(GAP_S)
            self.assert_answered()
        self.assert_silent_then_answered(b"\xff" + framed(RTU_ADDRESS, read_words(0, 2)))

    def test_a_frame_with_a_hole_is_none(self):
        frame = framed(RTU_ADDRESS, write_word(SCRATCH, 99))
        for cut in (1, 3, 6):
            self.line.write(frame[:cut])
            time.sleep(0.05)
            self.assert_silent_then_answered(frame[cut:])
        self.assertEqual(self.word(SCRATCH), 0)

    def test_a_broadcast_is_carried_out_without_an_answer(self):
        self.assert_silent_then_answered(framed(0, write_word(SCRATCH, 0xBEEF)))
        self.assertEqual(self.word(SCRATCH), 0xBEEF)
        self.assert_silent_then_answered(framed(0, struct.pack(">BHHBHH", 16, SCRATCH + 1, 2, 4, 5, 6)))
        self.assertEqual(words(self.line.ask(read_words(SCRATCH, 3))), [0xBEEF, 5, 6])
        self.assert_silent_then_answered(framed(0, struct.pack(">BHH", 5, 0, 0xFF00)))
        self.tare_count_reaches(1)

    def test_a_broadcast_that_reads_or_errs_is_met_with_silence(self):
        for pdu in (read_words(0, 2), read_words(0, 2, function=4), read_words(0, 8, function=1), bytes([43, 14, 1, 0]),
                    bytes([17]), struct.pack(">BHH", 8, 0, 1), write_word(0, 1), read_words(0, 0)):
            self.assert_silent_then_answered(framed(0, pdu))

    def test_every_exception_is_the_one_that_tcp_gives(self):
        with socket.create_connection(("127.0.0.1", self.daemon.port), timeout=2) as server:
            before = self.writable()
            for name, pdu, exception in REFUSALS:
                with self.subTest(name):
                    refused = bytes([pdu[0] | 0x80, exception])
                    self.assertEqual(over_tcp(server, pdu).hex(" "), refused.hex(" "), "over TCP")
                    self.assertEqual(self.line.ask(pdu).hex(" "), refused.hex(" "), "over RTU")
            self.assertEqual(self.writable(), before)

    def writable(self):
        return [words(self.line.ask(read_words(address, count))) for address, count in ((5000, 100), (5100, 125))]

    def test_a_second_tare_is_refused_while_one_runs(self):
        tare, coil = write_word(5010, 1), struct.pack(">BHH", 5, 0, 0xFF00)
        self.assertEqual(self.line.ask(tare), tare)
        time.sleep(GAP_S)  # the same frame at once is the adapter's echo of the answer; a line of 19200 baud has no
                           # time for it
        for pdu in (tare, coil):
            self.assertEqual(self.line.ask(pdu).hex(" "), bytes([pdu[0] | 0x80, 6]).hex(" "))
        self.tare_count_reaches(1)
        self.assertEqual(self.line.ask(coil), coil)
        self.tare_count_reaches(2)

    def test_query_data_and_the_server_id(self):
        query = struct.pack(">BHH", 8, 0, 0xA537)
        self.assertEqual(self.line.ask(query), query)
        self.assertRegex(self.line.ask(bytes([17])), rb"^\x11.T\xfftactiled \d+\.\d+\.\d+$")

    def test_the_command_block_is_busy_while_a_tare_runs(self):
        block = struct.pack(">BHHB5H", 16, 5000, 5, 10, 1, 1, 0, 0, 77)
        self.line.ask(write_word(5004, 0))  # the first number is adopted
        self.line.ask(write_word(5010, 1))
        self.assertEqual(self.line.ask(block).hex(" "), "90 06")
        self.assertEqual(words(self.line.ask(read_words(5000, 5))), [0] * 5)
        self.tare_count_reaches(1)
        self.assertEqual(self.line.ask(block), block[:5])
        self.tare_count_reaches(2)

    def test_mask_write_and_write_with_read(self):
        self.line.ask(write_word(SCRATCH, 0x0012))
        mask = struct.pack(">BHHH", 22, SCRATCH, 0x00F2, 0x0025)
        self.assertEqual(self.line.ask(mask), mask)
        self.assertEqual(self.word(SCRATCH), 0x0017)
        both = struct.pack(">BHHHHB3H", 23, SCRATCH, 4, SCRATCH + 1, 3, 6, 7, 8, 9)
        self.assertEqual(words(self.line.ask(both)), [0x17, 7, 8, 9])

    def test_the_identity_in_a_stream_and_one_by_one(self):
        def objects(code, first):
            answer = self.line.ask(bytes([43, 14, code, first]))
            self.assertEqual((answer[1], answer[2]), (14, code))
            at, found = 7, {}
            for _ in range(answer[6]):
                found[answer[at]] = answer[at + 2:at + 2 + answer[at + 1]].decode()
                at += 2 + answer[at + 1]
            return found

        basic, regular = objects(1, 0), objects(2, 0)
        self.assertEqual((list(basic), basic[0], basic[1]), ([0, 1, 2], "tactiled", "tactiled"))
        self.assertEqual(list(regular), list(range(7)))
        self.assertEqual(objects(4, 6), {6: self.daemon.name})
        self.assertEqual(objects(1, 0x50), basic)

    def test_a_setting_is_locked_until_the_line_unlocks_it(self):
        self.line.ask(write_word(5090, 0x5AFE))
        self.assertEqual(self.word(5090), 1)
        self.assertEqual(self.line.ask(write_word(5030, 100)), write_word(5030, 100))
        self.assertEqual(self.word(5030), 100)
        self.assertEqual(self.line.ask(write_word(5030, 1001)), bytes([0x86, 3]))
        self.line.ask(write_word(5090, 0))
        self.assertEqual(self.line.ask(write_word(5030, 50)), bytes([0x86, 2]))

    def test_two_thousand_requests_back_to_back_are_all_answered_right(self):
        answered, last_seq = 0, self.word(4)
        for i in range(500):
            step = struct.pack(">BHHHHBH", 23, SCRATCH, 1, SCRATCH, 1, 2, 4 * i)
            self.assertEqual(words(self.line.ask(step)), [4 * i])
            write = write_word(SCRATCH, 4 * i + 1)
            self.assertEqual(self.line.ask(write), write)
            block = words(self.line.ask(read_words(0, 32, function=4)))
            self.assertEqual(block[:2], MAGIC)
            self.assertEqual(block[4], block[31])
            self.assertLess(block[4] - last_seq & 0xFFFF, 0x8000)
            last_seq = block[4]
            self.assertEqual(self.word(SCRATCH), 4 * i + 1)
            answered += 4
        self.assertEqual(answered, 2000)

    def test_a_line_that_goes_and_comes_back_is_opened_again(self):
        self.line.ask(write_word(SCRATCH, 41))
        for _ in range(2):
            self.line.close()
            time.sleep(0.3)
            self.line = self.enterContext(Line(self.daemon.folder / "rtu", RTU_ADDRESS))
            self.assertLess(self.until_answered(), 2)  # s
            self.assertEqual(self.word(SCRATCH), 41)
        self.assertIsNone(self.daemon.process.poll())


class Echoes(unittest.TestCase):
    """On a slow line: an echo is one for as long as the answer is on the line, and a busy machine delays this process."""

    def setUp(self):
        self.daemon = self.enterContext(map_daemon(rtu=True))
        text = self.daemon.config.read_text()
        self.daemon.config.write_text(text.replace("baud = 19200", "baud = 300"))
        self.line = self.enterContext(Line(self.daemon.folder / "rtu", RTU_ADDRESS))
        start_map(self.daemon)
        wait_for(lambda: "rtu" in self.daemon.log(), "the line")

    def test_an_adapter_that_hears_itself_does_not_make_it_answer_itself(self):
        write = framed(RTU_ADDRESS, write_word(5110, 7))  # its answer is the same frame
        self.line.write(write)
        self.line.write(self.line.read(PATIENCE_S))  # sends its answer back
        self.assertEqual(self.line.heard(SLOW_S), b"")
        self.assertEqual(words(self.line.ask(read_words(5110, 1))), [7])

    def test_no_answer_that_an_adapter_hears_is_answered(self):
        for pdu in (read_words(0, 2), read_words(0, 8, function=1), read_words(0, 20, function=1), read_words(0, 0), bytes([7]),
                    bytes([0x83]), bytes([17]), bytes([43, 14, 2, 0]), struct.pack(">BHH", 8, 0, 7), struct.pack(">BHH", 5, 33, 0),
                    struct.pack(">BHHB2H", 16, SCRATCH, 2, 4, 1, 2), struct.pack(">BHHH", 22, SCRATCH, 0, 1),
                    struct.pack(">BHHHHBH", 23, 0, 6, SCRATCH, 1, 2, 7)):
            with self.subTest(pdu.hex(" ")):
                self.line.write(framed(RTU_ADDRESS, pdu))
                answer = self.line.read(PATIENCE_S)
                self.line.write(answer)
                self.assertEqual(self.line.heard(SLOW_S), b"")
                self.assertEqual(words(self.line.ask(read_words(0, 2))), MAGIC)
                time.sleep(SLOW_S)


def over_tcp(server, pdu):
    server.sendall(struct.pack(">HHHB", 1, 0, 1 + len(pdu), 1) + pdu)
    return server.recv(260)[7:]


if __name__ == "__main__":
    unittest.main(verbosity=2)
