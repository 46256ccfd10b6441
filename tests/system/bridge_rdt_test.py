#!/usr/bin/env python3
"""tactiled-rdt: a client of RDT reads the values of the segment, with an error in the status while they are doubtful, and nothing at all
while there is no value."""
import contextlib
import http.client as http_client
import itertools
import pathlib
import shutil
import socket
import statistics
import subprocess
import sys
import threading
import unittest
import urllib.error
import urllib.request

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bridge_process import bridge  # noqa: E402
from daemon import BIN, free_port, wait_for  # noqa: E402
from forged_node import REASONS, UNCERTAIN, ForgedNode  # noqa: E402
from rdt_client import Client, NetFt  # noqa: E402
from unit_daemon import CALIBRATION, quality_is, unit_daemon  # noqa: E402

STOP, STREAM, BIAS = 0, 2, 0x42
ERROR = 1 << 31


class Rdt(unittest.TestCase):
    rows = "0,1,2,-3\n0.01,1,2,-3\n"

    def setUp(self):
        self.daemon = unit_daemon(self.rows).start()
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        wait_for(quality_is(self.daemon, "good"), "a good value")
        self.port = free_port()

    def bridge(self, *words):
        made = bridge("rdt", self.daemon.name, "--listen", f"127.0.0.1:{self.port}", *words)
        self.addCleanup(made.__exit__)
        return made

    def client(self, **kinds):
        client = Client(self.port, **kinds)
        self.addCleanup(client.close)
        return client

    def refused(self, *words):
        done = subprocess.run([BIN / "tactiled-rdt", "--node", self.daemon.name, *words], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 2, done.stderr)
        return done.stderr

    def test_a_stream_has_every_sample_with_the_segments_values(self):
        self.bridge("--zero", "mx,my,mz")
        client = self.client()
        client.request(STREAM)
        records = [client.record() for _ in range(100)]
        self.assertEqual({tuple(r[3]) for r in records}, {(1, 2, -3, 0, 0, 0)})
        self.assertEqual([r[0] for r in records], list(range(1, 101)))
        first = records[0][1]
        self.assertEqual([r[1] for r in records], list(range(first, first + 100)))
        self.assertEqual({r[2] for r in records}, {0})
        client.request(STOP)
        wait_for(lambda: client.records(0.3) == [], "the end of the stream")

    def test_a_request_for_three_records_gets_three(self):
        self.bridge("--zero", "mx,my,mz")
        client = self.client()
        client.request(STREAM, 3)
        self.assertEqual([client.record()[0] for _ in range(3)], [1, 2, 3])
        self.assertEqual(client.records(0.5), [])

    def test_a_sensor_of_three_axes_is_refused_unless_told(self):
        self.assertIn("does not measure mx,my,mz", self.refused("--sensor", "left"))
        self.assertIn("--zero mx,my,mz", self.refused("--sensor", "left", "--zero", "mx"))
        self.assertIn("would hide", self.refused("--sensor", "left", "--zero", "fx,mx,my,mz"))
        self.assertIn("no sensor \"right\"", self.refused("--sensor", "right"))

    def test_other_machines_need_an_allow_list(self):
        self.assertIn("--allow", self.refused("--zero", "mx,my,mz", "--listen", f"0.0.0.0:{self.port}"))

    def test_nothing_is_sent_while_the_value_is_bad_and_a_restart_is_found(self):
        self.bridge("--zero", "mx,my,mz")
        client = self.client()
        client.request(STREAM)
        client.record()
        device = self.daemon.others[0]
        device.kill()
        device.wait()
        wait_for(lambda: client.records(0.5) == [], "the end of the records")
        self.daemon.process.kill()
        self.daemon.process.wait()
        self.assertEqual(client.records(0.6), [])
        (self.daemon.folder / "dev").unlink(missing_ok=True)
        from unit_daemon import play
        play(self.daemon)
        self.daemon.start()
        self.assertEqual(client.record()[3], [1, 2, -3, 0, 0, 0])

    def test_a_killed_bridge_stops_the_stream_and_its_successor_serves_a_new_request(self):
        first = self.bridge("--zero", "mx,my,mz")
        client = self.client()
        client.request(STREAM)
        client.record()
        first.kill()
        wait_for(lambda: client.records(0.5) == [], "the end of the records")
        self.assertEqual(self.daemon.process.poll(), None)
        self.bridge("--zero", "mx,my,mz")
        client.request(STREAM)
        self.assertEqual(client.record()[3], [1, 2, -3, 0, 0, 0])

    def test_a_client_that_has_gone_gets_no_more(self):
        server = self.bridge("--zero", "mx,my,mz")
        client = Client(self.port)
        client.request(STREAM)
        client.record()
        client.close()
        wait_for(lambda: "no client" in server.log().splitlines()[-1], "the stream's end")

    def test_a_bias_is_refused_unless_allowed_and_is_of_one_client(self):
        server = self.bridge("--zero", "mx,my,mz")
        client = self.client()
        client.request(STREAM)
        client.record()
        client.request(BIAS)
        wait_for(lambda: "refused" in server.log(), "the refusal")
        self.assertEqual({tuple(r[3]) for r in client.records(0.3)}, {(1, 2, -3, 0, 0, 0)})
        server.stop()
        self.bridge("--zero", "mx,my,mz", "--bias")
        other = self.client()
        for each in (client, other):
            each.request(STREAM)
        client.request(BIAS)
        while (record := client.record())[3] != [0, 0, 0, 0, 0, 0]:
            self.assertEqual(record[3], [1, 2, -3, 0, 0, 0])
        while (of_other := other.record())[1] <= record[1]:  # later than the bias
            pass
        self.assertEqual(of_other[3], [1, 2, -3, 0, 0, 0])

    def test_a_bias_waits_for_a_good_value_and_ends_with_a_tare(self):
        data = self.daemon.segment.read_bytes()
        self.daemon.stop()
        uncertain = next(bit for bit, _, _, best in REASONS if best == UNCERTAIN)
        with ForgedNode(self.daemon.name, data) as node:
            node.show(uncertain)
            self.bridge("--zero", "mx,my,mz", "--bias")
            client = self.client()
            client.request(BIAS)
            client.request(STREAM)
            self.assertEqual({(r[2] != 0, tuple(r[3][:3])) for r in (client.record() for _ in range(50))}, {(True, (1, 2, -3))})
            node.show(0)
            while (record := client.record())[2]:
                pass
            self.assertEqual(record[3], [0] * 6)
            node.show(0, force_N=(2, 4, -6))
            while (record := client.record())[3] == [0] * 6:
                pass
            self.assertEqual(record[3][:3], [1, 2, -3])
            node.put_sample("tare_count", 7)
            while (record := client.record())[3][:3] == [1, 2, -3]:
                pass
            self.assertEqual(record[3][:3], [2, 4, -6])

    def test_a_host_takes_no_place_of_one_that_has_fewer(self):
        server = self.bridge("--zero", "mx,my,mz", "--allow", "127.0.0.0/8")
        quiet = self.client()
        quiet.socket.bind(("127.0.0.2", 0))
        quiet.request(STREAM)
        quiet.record()
        crowd = [self.client() for _ in range(40)]
        for client in crowd:
            client.request(STREAM)
            client.record()
        last = quiet.record()[0]
        wait_for(lambda: quiet.record()[0] > last + 100, "records of the host with one place")
        self.assertEqual(server.log().count("lost its place"), 1)

    def test_a_rate_is_kept(self):
        self.bridge("--zero", "mx,my,mz", "--rate-Hz", "50")
        client = self.client()
        client.request(STREAM)
        samples = [client.record()[1] for _ in range(101)]
        steps = [b - a for a, b in zip(samples, samples[1:])]
        # By the numbers of the samples, 200 per second, because a busy machine may leave records out.
        self.assertEqual(statistics.median(steps), 4)
        self.assertGreater(samples[-1] - samples[0], 0.95 * 4 * 100)

    def uncertain(self):
        """Another daemon, whose values are doubtful."""
        daemon = unit_daemon(self.rows, calibration=CALIBRATION.replace("sd = [0.01, 0.01, 0.01]\n", "")).start()
        self.addCleanup(shutil.rmtree, daemon.folder)
        self.addCleanup(daemon.__exit__)
        wait_for(quality_is(daemon, "uncertain"), "a doubtful value")
        return daemon

    def test_an_uncertain_value_has_the_error_bit(self):
        words = ("--listen", f"127.0.0.1:{self.port}", "--zero", "mx,my,mz")
        daemon, client = self.uncertain(), self.client()
        with bridge("rdt", daemon.name, *words):
            client.request(STREAM)
            records = [client.record() for _ in range(50)]
            self.assertEqual({r[2] for r in records}, {ERROR | 1 << 23})  # not calibrated
            self.assertEqual({tuple(r[3]) for r in records}, {(1, 2, -3, 0, 0, 0)})
        with bridge("rdt", daemon.name, *words, "--good-only") as server:
            other = self.client()
            other.request(STREAM)
            wait_for(lambda: "streaming" in server.log(), "the stream")
            self.assertEqual(other.records(0.5), [])

    def test_the_client_that_has_been_silent_for_longest_loses_its_place_to_a_ninth(self):
        server = self.bridge("--zero", "mx,my,mz")
        clients = [self.client() for _ in range(8)]
        for client in clients:
            client.request(STREAM)
            client.record()
        numbers = [clients[0].record()[0]]
        clients[0].request(STREAM)  # a sign of life: now the second one is the oldest
        wait_for(lambda: numbers.append(clients[0].record()[0]) or numbers[-1] < numbers[-2], "its new start")
        ninth = self.client()
        ninth.request(STREAM)
        ninth.record()
        wait_for(lambda: clients[1].records(0.3) == [], "the end of the second client's stream")
        for client in (clients[0], *clients[2:], ninth):
            self.assertNotEqual(client.records(0.3), [])
        self.assertIn("lost its place", server.log())

    def test_a_client_that_knows_the_address_alone_reads_the_page(self):
        http = free_port()
        self.bridge("--zero", "mx,my,mz", "--http-port", http, "--counts-per-N", 5000, "--counts-per-Nm", 7000)
        client = NetFt(self.port, http)
        self.addCleanup(client.close)
        self.assertEqual((client.counts, client.ranges), ([5000] * 3 + [7000] * 3, [100] * 3 + [0] * 3))
        self.assertEqual({tuple(values) for values in client.read(50)}, {(1, 2, -3, 0, 0, 0)})
        self.assertEqual(client.now(), (0, [1, 2, -3, 0, 0, 0]))
        wait_for(lambda: abs(int(client.fields()["comrdtrate"]) - 200) < 20, "the rate of the sensor")
        self.daemon.others[0].kill()
        wait_for(lambda: client.now() == (ERROR | 1 << 27, []), "the end of the sensor")
        self.daemon.process.kill()
        self.daemon.process.wait()
        wait_for(lambda: client.now()[0] & (ERROR | 1 << 14) == ERROR | 1 << 14, "the end of the daemon")
        self.assertEqual(client.now()[1], [])
        for absent in ("netftcalapi.xml", "netftapi2.xml?index=1"):
            with self.assertRaises(urllib.error.HTTPError) as other:
                urllib.request.urlopen(f"http://127.0.0.1:{http}/{absent}", timeout=30)
            self.assertEqual(other.exception.code, 404)
            other.exception.close()
        with urllib.request.urlopen(f"http://127.0.0.1:{http}/netftapi2.xml?index=0", timeout=30) as answer:
            self.assertEqual(answer.status, 200)

    def test_a_doubtful_value_is_refused_by_a_client_that_reads_its_status(self):
        daemon, http = self.uncertain(), free_port()
        with bridge("rdt", daemon.name, "--listen", f"127.0.0.1:{self.port}", "--zero", "mx,my,mz", "--http-port", http):
            client = NetFt(self.port, http)
            self.addCleanup(client.close)
            self.assertEqual(client.now()[0], ERROR | 1 << 23)
            with self.assertRaisesRegex(ValueError, "status 0x80800000"):
                client.read(10)

    def test_the_page_is_for_allowed_clients_and_idle_ones_lose_their_place(self):
        http = free_port()
        self.bridge("--zero", "mx,my,mz", "--http-port", http, "--allow", "127.0.0.3/32")
        with self.assertRaises((OSError, http_client.HTTPException)):
            urllib.request.urlopen(f"http://127.0.0.1:{http}/netftapi2.xml", timeout=30)

        def get(address, host=f"127.0.0.1:{http}"):
            connection = http_client.HTTPConnection("127.0.0.1", http, timeout=30, source_address=(address, 0))
            connection.request("GET", "/netftapi2.xml", headers={"Host": host})
            text = connection.getresponse().read().decode()
            connection.close()
            return text

        def tried(address):
            try:
                return get(address)
            except (OSError, http_client.HTTPException):
                return ""

        self.assertIn("<cfgcpf>1000000</cfgcpf>", get("127.0.0.3"))
        self.assertIn("<cfgcpf>", get("127.0.0.3", "localhost"))
        self.assertNotIn("<", get("127.0.0.3", "gripper.example"))  # DNS rebinding
        idle = [socket.create_connection(("127.0.0.1", http), source_address=("127.0.0.3", 0)) for _ in range(12)]
        for each in idle:
            self.addCleanup(each.close)
        self.assertIn("<cfgcpf>", get("127.0.0.3"))
        self.keep_dripping([socket.create_connection(("127.0.0.1", http), source_address=("127.0.0.3", 0)) for _ in range(8)])
        wait_for(lambda: "<cfgcpf>" in tried("127.0.0.3"), "a place beside clients that send byte by byte")
        self.assertIn("addresses of their own", self.refused("--sensor", "left", "--listen", f"127.0.0.1:{free_port()}", "--zero", "mx,my,mz", "--http-port", str(http)))

    def keep_dripping(self, clients):
        """Each sends a request without an end, a byte ten times a second."""
        ended = threading.Event()

        def drip():
            for byte in itertools.chain(b"GET /netftapi2.xml HTTP/1.1\r\nX: ", itertools.repeat(ord("a"))):
                for each in clients:
                    with contextlib.suppress(OSError):
                        each.send(bytes([byte]))
                if ended.wait(0.1):
                    return
        thread = threading.Thread(target=drip)
        thread.start()
        for each in clients:
            self.addCleanup(each.close)
        self.addCleanup(thread.join)
        self.addCleanup(ended.set)

    def test_rubbish_changes_nothing(self):
        self.bridge("--zero", "mx,my,mz")
        client = self.client()
        for data in (b"", b"\x12\x34", b"\x12\x34\x00\x63" + bytes(4), bytes(8), b"\xff" * 1400):
            client.socket.sendto(data, client.to)
        client.request(STREAM)
        self.assertEqual(client.record()[3], [1, 2, -3, 0, 0, 0])


if __name__ == "__main__":
    unittest.main(verbosity=2)
