#!/usr/bin/env python3
"""Modbus TCP clients of other projects against the release daemon: each reads the values of the map and may tare."""
import os
import pathlib
import shutil
import socket
import struct
import subprocess
import sys
import unittest

from pymodbus.client import ModbusTcpClient

INTEROP = pathlib.Path(__file__).resolve().parent / "interop"
sys.path[:0] = [str(INTEROP), str(INTEROP.parent)]
from capture import Capture, conversation  # noqa: E402
from contract import expected, map_daemon, start_map, table  # noqa: E402
from daemon import ROOT  # noqa: E402
from mbpoll_client import Mbpoll  # noqa: E402
from pymodbus_client import Pymodbus, device_information, query_data, report_server_id  # noqa: E402

NO_REGISTRY = 75  # exit status of fetch_npm.sh


def mbpoll(daemon):
    return Mbpoll("-m", "tcp", "-a", 1, "-p", daemon.port, "127.0.0.1")


def with_pymodbus(daemon, use):
    client = ModbusTcpClient("127.0.0.1", port=daemon.port, timeout=2)
    assert client.connect()
    try:
        return use(Pymodbus(client, 1))
    finally:
        client.close()


def libmodbus(daemon):
    program = daemon.folder / "libmodbus_client"
    flags = subprocess.run(["pkg-config", "--cflags", "--libs", "libmodbus"],
                           capture_output=True, text=True, check=True)
    subprocess.run(["cc", "-std=gnu11", "-Wall", "-Wextra", "-Werror", "-o", program, INTEROP / "libmodbus_client.c",
                    *flags.stdout.split()], check=True)
    return table([program, daemon.port])


def fetch_javascript():
    """Raises SkipTest without node or a registry; any other problem is a failure."""
    if shutil.which("node") is None:
        raise unittest.SkipTest("no node: apt-get install nodejs")
    done = subprocess.run([INTEROP / "fetch_npm.sh"], capture_output=True, text=True, timeout=120)
    if done.returncode == NO_REGISTRY:
        raise unittest.SkipTest(f"jsmodbus and modbus-serial cannot be fetched: {done.stderr.strip()}")
    assert done.returncode == 0, done.stdout + done.stderr


def javascript(daemon, client):
    fetch_javascript()
    env = {**os.environ, "NODE_PATH": str(ROOT / "build/npm/node_modules")}
    return table(["node", INTEROP / f"{client}_client.js", daemon.port], env=env)


def nmap(daemon):
    if shutil.which("nmap") is None:
        raise unittest.SkipTest("no nmap: apt-get install nmap")
    # The + runs the script although the port is not 502.
    done = subprocess.run(["nmap", "-Pn", "-n", "--script", "+modbus-discover", "-p", str(daemon.port), "127.0.0.1"],
                          capture_output=True, text=True, timeout=60)
    return done.stdout


class Clients(unittest.TestCase):
    maxDiff = None

    def setUp(self):
        self.daemon = self.enterContext(map_daemon())
        start_map(self.daemon)

    def test_mbpoll_sees_the_map_and_tares(self):
        without = ("scratch_fc22", "scratch_fc23", "tare_fc23", "refused_fc22", "refused_fc23", "fc17", "identity")
        self.assertEqual(mbpoll(self.daemon).table(), expected(without))

    def test_pymodbus_sees_the_map_and_tares(self):
        self.assertEqual(with_pymodbus(self.daemon, Pymodbus.table), expected())

    def test_pymodbus_reads_every_object_of_the_identity(self):
        def objects(client, code, first):
            answer = device_information(client.client, code, first, 1)
            return {number: text.decode() for number, text in client.written(answer).information.items()}

        basic = with_pymodbus(self.daemon, lambda client: objects(client, 1, 0))
        regular = with_pymodbus(self.daemon, lambda client: objects(client, 2, 0))
        one = with_pymodbus(self.daemon, lambda client: objects(client, 4, 6))
        self.assertEqual(set(basic), {0, 1, 2})
        self.assertRegex(basic[2], r"^\d+\.\d+")
        self.assertEqual(set(regular), set(range(7)))
        self.assertEqual({number: regular[number] for number in basic}, basic)
        self.assertEqual(regular[6], self.daemon.name)
        self.assertEqual(one, {6: self.daemon.name})

    def test_pymodbus_gets_its_query_data_back_and_reads_the_server_id(self):
        query, data = with_pymodbus(self.daemon, lambda c: query_data(c.client, 0xA537, 1))
        self.assertEqual((query.function_code, query.sub_function_code), (8, 0))
        self.assertEqual(data, b"\xA5\x37")
        answer = with_pymodbus(self.daemon, lambda c: report_server_id(c.client, 1))
        self.assertRegex(answer.identifier, rb"^T\xfftactiled \d+\.\d+\.\d+")

    def test_libmodbus_sees_the_map_and_tares(self):
        self.assertEqual(libmodbus(self.daemon), expected(without=["identity"]))

    def test_jsmodbus_sees_the_map_and_tares(self):
        without = ("scratch_fc22", "scratch_fc23", "tare_fc23", "refused_fc22", "refused_fc23", "fc17")
        self.assertEqual(javascript(self.daemon, "jsmodbus"), expected(without))

    def test_modbus_serial_sees_the_map_and_tares(self):
        self.assertEqual(javascript(self.daemon, "modbus_serial"), expected())

    def test_nmap_names_the_device(self):
        text = nmap(self.daemon)
        self.assertRegex(text, rf"{self.daemon.port}/tcp open +modbus")
        self.assertRegex(text, r"sid 0x1:")
        self.assertRegex(text, r"Slave ID data: .*tactiled \d+\.\d+")
        self.assertRegex(text, r"Device identification: tactiled tactiled \S+")

    def test_every_unit_id_is_answered_and_echoed(self):
        with socket.create_connection(("127.0.0.1", self.daemon.port), timeout=2) as server:
            for unit in (0, 1, 17, 247, 255):
                server.sendall(struct.pack(">HHHBBHH", 0x7000 + unit, 0, 6, unit, 3, 0, 2))
                magic = struct.pack(">HHHBBBHH", 0x7000 + unit, 0, 7, unit, 3, 4, 0x5441, 0x4354)
                self.assertEqual(server.recv(260).hex(" "), magic.hex(" "))


class TheWire(unittest.TestCase):
    def test_tshark_finds_a_clean_conversation_of_all_clients(self):
        with map_daemon() as daemon:
            start_map(daemon)
            with Capture(daemon.port, daemon.folder / "all.pcapng") as capture:
                with_pymodbus(daemon, Pymodbus.table)
                libmodbus(daemon)
                mbpoll(daemon).reads()
                for client in ("jsmodbus", "modbus_serial"):
                    try:
                        javascript(daemon, client)
                    except unittest.SkipTest as reason:
                        print(f"without {client}: {reason}", file=sys.stderr)
            frames = conversation(capture)
        for frame in frames:
            self.assertEqual(frame.complaints, "", frame)
        queries = [frame for frame in frames if frame.is_query]
        answers = [frame for frame in frames if not frame.is_query]
        self.assertGreater(len(queries), 100)
        self.assertEqual({query.function for query in queries}, {1, 2, 3, 4, 5, 6, 15, 16, 17, 22, 23, 43})
        self.assertEqual([query.name for query in queries], [answer.name for answer in answers])
        for query, answer in zip(queries, answers):
            if answer.exception is None:
                self.assertEqual(answer.query_frame, query.number, answer)


if __name__ == "__main__":
    unittest.main(verbosity=2)
