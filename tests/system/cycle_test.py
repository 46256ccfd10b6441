#!/usr/bin/env python3
"""A PLC with one request in each cycle: FC 23 reads the view and writes command, heartbeat and hints; and clients that send
nothing while others ask."""
import pathlib
import socket
import struct
import subprocess
import sys
import threading
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN  # noqa: E402
from held_force import Held, wait_for  # noqa: E402

VIEW, VIEW_SIZE, CYCLE = 600, 125, 5300
SEQ, GLOBAL, SENSOR, SEQ_END = 0, 1, 69, 124          # offsets in the view
CMD_SEQ_ACK, CMD_STATE, CMD_RESULT, ECHO = (GLOBAL + n for n in (25, 26, 27, 29))
FZ, TARE_COUNT = SENSOR + 6, SENSOR + 20
TARE, DONE, ADOPTED, BUSY, NOT_KNOWN, NO_HINT = 1, 2, 11, 6, 0x8000, 0xFFFF
IDLE = 18


class Plc:
    """One connection, one request in each cycle."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), 10)
        self.number = self.beat = 0
        self.command = [0, 0, 0, 0, 0]
        self.gravity = [NOT_KNOWN] * 3

    def cycle(self):
        """Returns the view after the write, or the number of an exception other than "busy", after which it writes again."""
        self.beat = self.beat + 1 & 0xFFFF
        answers = []

        def is_taken():
            answers.append(self.ask())
            return answers[-1] != BUSY
        wait_for(is_taken, "a daemon that is not busy")
        return answers[-1]

    def ask(self):
        self.number = self.number + 1 & 0xFFFF
        write = [*self.command, self.beat, NO_HINT, 0, *self.gravity, *[NOT_KNOWN] * 3, 0]
        pdu = struct.pack(">BHHHHB", 23, VIEW, VIEW_SIZE, CYCLE, len(write), 2 * len(write)) + struct.pack(f">{len(write)}H", *write)
        self.socket.sendall(struct.pack(">HHHB", self.number, 0, len(pdu) + 1, 1) + pdu)
        answer = b""
        while len(answer) < 9 or len(answer) < 6 + struct.unpack(">H", answer[4:6])[0]:
            piece = self.socket.recv(300)
            if not piece:
                raise ConnectionError("closed")
            answer += piece
        return answer[8] if answer[7] & 0x80 else struct.unpack(f">{VIEW_SIZE}H", answer[9:])

    def wait(self, what, condition):
        seen = []

        def holds():
            seen[:] = [self.cycle()]
            return not isinstance(seen[0], int) and condition(seen[0])
        wait_for(holds, what)
        return seen[0]


class OneRequestInEachCycle(unittest.TestCase):
    def test_it_reads_one_frame_tares_once_and_repeats_nothing_after_a_restart(self):
        with Held() as held:
            held.press(-5.0)
            plc = Plc(held.daemon.port)
            first = plc.wait("the first number to be adopted", lambda view: view[CMD_RESULT] == ADOPTED)
            plc.command = [TARE, 1, 0, 0, 7]
            plc.wait("the tare", lambda view: view[CMD_SEQ_ACK] == 7 and view[CMD_STATE] == DONE)
            for _ in range(200):
                view = plc.cycle()
                self.assertEqual(view[SEQ], view[SEQ_END])
                self.assertEqual(view[ECHO], plc.beat, "the write comes before the read")
                self.assertEqual(view[TARE_COUNT], first[TARE_COUNT] + 1 & 0xFFFF)
            self.assertLess(min(view[FZ], 0x10000 - view[FZ]), 10, "0.1 N")
            plc.socket.close()
            held.restart()
            held.press(-9.0)
            again = Plc(held.daemon.port)
            again.command, again.beat = plc.command, plc.beat
            again.wait("the old number to be adopted", lambda view: view[CMD_SEQ_ACK] == 7 and view[CMD_RESULT] == ADOPTED)
            self.assertEqual(again.cycle()[TARE_COUNT], view[TARE_COUNT])
            again.socket.close()

    def test_a_write_with_one_bad_cell_changes_nothing(self):
        with Held() as held:
            plc = Plc(held.daemon.port)
            echo = plc.wait("a cycle", lambda view: True)[ECHO]
            plc.gravity = [0, 0, 1000]
            self.assertEqual(plc.cycle(), 3, "no gravity on Earth")
            plc.gravity = [0, 0, 9810]
            plc.beat = echo
            self.assertEqual(held.plc().read(29, 1), [echo])
            self.assertEqual(plc.cycle()[ECHO], echo + 1)
            plc.socket.close()


class Idle:
    """Clients that connect, send nothing, and connect again as soon as they are closed."""

    def __init__(self, connect):
        self.ended, self.connected = threading.Event(), threading.Semaphore(0)
        self.threads = [threading.Thread(target=self.run, args=(connect,), daemon=True) for _ in range(IDLE)]

    def run(self, connect):
        while not self.ended.is_set():
            try:
                with connect() as client:
                    client.settimeout(0.1)
                    self.connected.release()
                    while not self.ended.is_set():
                        try:
                            if not client.recv(1):
                                break
                        except TimeoutError:
                            pass
            except OSError:
                pass

    def __enter__(self):
        for thread in self.threads:
            thread.start()
        for _ in self.threads:
            self.connected.acquire()
        return self

    def __exit__(self, *_):
        self.ended.set()
        for thread in self.threads:
            thread.join()


class IdleClients(unittest.TestCase):
    def test_of_the_control_socket_refuse_no_command(self):
        def connect():
            client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            client.connect(str(held.daemon.folder / "control.sock"))
            return client

        with Held() as held, Idle(connect):
            for _ in range(5):
                done = subprocess.run([BIN / "tactilectl", "clear", "--node", held.daemon.name], capture_output=True, text=True,
                                      env=held.daemon.reader_env)
                self.assertEqual(done.returncode, 0, done)

    def test_of_modbus_keep_no_plc_out(self):
        with Held(modbus="max_clients = 8\n") as held, Idle(lambda: socket.create_connection(("127.0.0.1", held.daemon.port), 10)):
            for _ in range(5):
                plc = []

                def is_served():  # one that is held up between connecting and asking may be taken for an idle one
                    try:
                        plc[:] = [Plc(held.daemon.port)]
                        return not isinstance(plc[0].cycle(), int)
                    except OSError:
                        return False
                wait_for(is_served, "a PLC to be served")
                for _ in range(100):
                    self.assertEqual(len(plc[0].cycle()), VIEW_SIZE)
                plc[0].socket.close()


if __name__ == "__main__":
    unittest.main(verbosity=2)
