#!/usr/bin/env python3
"""tactiled-dds before eProsima's Fast DDS, with the QoS of an ordinary subscription of ROS 2: the values of the segment on a topic of ROS 2,
nothing while they are not GOOD, and the reason on /diagnostics."""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bridge_process import bridge  # noqa: E402
from daemon import BIN, ROOT, halt, wait_for, wait_until_it_rests  # noqa: E402
import ros_types  # noqa: E402
from unit_daemon import CALIBRATION, play, quality_is, unit_daemon  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

DOMAIN = "77"
SOCKET_HOLDS = 2 * 208 * 1024 // 768  # messages: the receive buffer that Linux gives a socket, each of which counts for 768 bytes at least; twice


class Reader:
    """Lines of fastdds_reader, split: receive and send time in ns, frame, the rest."""

    def __init__(self, *topics, domain=DOMAIN, option=("--writers",)):
        self.errors = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen([BIN / "fastdds_reader", domain, "120", *option, *topics], stdout=subprocess.PIPE, stderr=self.errors, text=True)
        self.lines = []
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n").split(" ", 3))

    def wrench(self):
        return [float(word) for word in self.lines[-1][3].split()]

    def writers(self):
        """Topic: reliability and user data of its writer."""
        text = os.pread(self.errors.fileno(), 1 << 16, 0).decode()
        return {line.split(" ", 3)[1]: line.split(" ", 3)[2:] for line in text.splitlines() if line.startswith("writer ")}

    def close(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        self.errors.close()


@unittest.skipUnless((BIN / "tactiled-dds").exists(), "tactiled-dds is not built: cyclonedds-dev was missing")
@unittest.skipUnless((BIN / "fastdds_reader").exists(), "the reader is not built: libfastrtps-dev was missing")
class Dds(unittest.TestCase):
    def setUp(self):
        self.daemon = unit_daemon().start()
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        wait_for(quality_is(self.daemon, "good"), "a good value")

    def bridge(self, *words):
        made = bridge("dds", self.daemon.name, "--domain", DOMAIN, "--name", "hand", *words)
        self.addCleanup(made.__exit__)
        return made

    def reader(self, *topics, **kinds):
        made = Reader(*(topics or ("rt/hand/left/wrench",)), **kinds)
        self.addCleanup(made.close)
        return made

    def times_of_samples(self, count):
        """The times of so many samples of the segment from now on, in ns since 1970."""
        with tactiled.open(self.daemon.name).follow("left", 30) as left:
            published = [next(left).t_ns for _ in range(count)]
        to_wall_ns = time.time_ns() - time.monotonic_ns()
        return [t_ns + to_wall_ns for t_ns in published]

    def received(self, reader, times_ns):
        """Messages of the reader between the first and the last of these times, after that of the last one came, and how many of the times
        have none, less the samples that the bridge held back: on a busy machine it finds the daemon late, and the value BAD."""
        wait_for(lambda: int(reader.lines[-1][1]) > times_ns[-1] - 10**6, "the message of the last sample")
        lines = [line for line in list(reader.lines) if times_ns[0] - 10**6 < int(line[1]) < times_ns[-1] + 10**6]
        stamps, used, missing = sorted(int(line[1]) for line in lines), 0, 0
        for t_ns in times_ns:  # each needs a message of its own; frames that were read at once have one time
            while used < len(stamps) and stamps[used] < t_ns - 10**6:
                used += 1
            if used < len(stamps) and stamps[used] < t_ns + 10**6:
                used += 1
            else:
                missing += 1
        return lines, max(0, missing - self.held())

    def held(self):
        diagnostics = self.reader("rt/diagnostics")
        wait_for(lambda: diagnostics.lines and "held samples = " in diagnostics.lines[-1][3], "diagnostics")
        return int(diagnostics.lines[-1][3].rpartition("held samples = ")[2].split()[0])

    def test_the_topic_has_every_sample_with_the_segments_values(self):
        self.bridge("--frame-prefix", "hand_")
        reader, began_ns = self.reader(), time.time_ns()
        wait_for(lambda: len(reader.lines) > 50, "messages")
        times_ns = self.times_of_samples(600)
        lines, missing = self.received(reader, times_ns)
        self.assertEqual(missing, 0)
        self.assertEqual({tuple(float(w) for w in line[3].split()[:3]) for line in lines}, {(1, 2, -3)})
        self.assertEqual({line[3].split()[3] for line in lines}, {"nan"})  # no torque is measured
        self.assertEqual({line[2] for line in lines}, {"hand_left"})
        self.assertTrue(all(began_ns < int(line[1]) < time.time_ns() for line in lines), "no time of day")

    def test_writers_are_reliable_and_have_the_hash_of_their_type(self):
        server, reader = self.bridge(), self.reader("rt/hand/left/wrench", "rt/diagnostics")
        wait_for(lambda: len(reader.writers()) == 2, "the writers")
        for topic, kind in (("rt/hand/left/wrench", "geometry_msgs/msg/WrenchStamped"), ("rt/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")):
            self.assertEqual(reader.writers()[topic], ["reliable", f"typehash=RIHS01_{ros_types.type_hash(kind)};"])
        server.stop()
        self.bridge("--best-effort")
        other = self.reader(option=("--best-effort",))
        wait_for(lambda: other.lines, "messages")
        wait_for(lambda: reader.writers()["rt/hand/left/wrench"][0] == "best-effort", "the second writer")

    def test_a_stopped_reader_delays_nobody(self):
        server, stopped, reader = self.bridge(), self.reader(), self.reader()
        wait_for(lambda: len(reader.lines) > 50 and len(stopped.lines) > 50, "messages")
        halt(stopped.process.pid)
        before = server.status("VmRSS")
        times_ns = self.times_of_samples(1000)  # 5 s
        lines, missing = self.received(reader, times_ns)
        self.assertEqual(missing, 0)
        self.assertLess(server.status("VmRSS") - before, 2048)
        late_ms = sorted((int(line[0]) - int(line[1])) / 1e6 for line in lines)
        print(f"\nms from the sample to another reader, p50 {late_ms[len(lines) // 2]:.2f}, p99 {late_ms[len(lines) * 99 // 100]:.2f}, worst {late_ms[-1]:.2f}")
        seen = len(stopped.lines)
        stopped.process.send_signal(signal.SIGCONT)
        wait_for(lambda: len(stopped.lines) > seen + 50 and int(stopped.lines[-1][1]) > times_ns[-1], "messages after the stop")
        self.assertEqual(server.stop(), 0)
        self.assertEqual(server.counts()[1:], (0, 0))  # dropped: a write that had to wait; missed: a writer that was late

    def test_a_reader_that_stood_still_gets_no_old_value_again(self):
        self.bridge()
        stopped, reader = self.reader(), self.reader()
        wait_for(lambda: len(reader.lines) > 50 and len(stopped.lines) > 50, "messages")
        halt(stopped.process.pid)
        first, seen = len(reader.lines), len(stopped.lines)
        wait_for(lambda: len(reader.lines) > first + SOCKET_HOLDS + 900, "more messages than the socket of the stopped reader holds")
        continued_ns, sent_ns = time.time_ns(), [int(line[1]) for line in reader.lines[first:]]
        stopped.process.send_signal(signal.SIGCONT)
        wait_for(lambda: int(stopped.lines[-1][1]) > continued_ns + 1e9, "messages after the stop")
        old_ns = [t_ns for t_ns in sent_ns[SOCKET_HOLDS:] if t_ns < continued_ns - 1.1e9]  # the bridge sends none of these again: they are older than 1 s
        self.assertGreater(len(old_ns), 300)
        self.assertEqual([line for line in stopped.lines[seen:] if old_ns[0] < int(line[1]) <= old_ns[-1]], [])

    def test_an_uncertain_wrench_is_sent_on_request_alone(self):
        daemon = unit_daemon(calibration=CALIBRATION.replace("sd = [0.01, 0.01, 0.01]\n", "")).start()
        self.addCleanup(shutil.rmtree, daemon.folder)
        self.addCleanup(daemon.__exit__)
        wait_for(quality_is(daemon, "uncertain"), "a doubtful value")
        reader, diagnostics = self.reader("rt/doubtful/left/wrench"), self.reader("rt/diagnostics")
        server = bridge("dds", daemon.name, "--domain", DOMAIN, "--name", "doubtful")
        self.addCleanup(server.__exit__)
        wait_for(lambda: diagnostics.lines and "| uncertain:sd-unknown" in diagnostics.lines[-1][3], "the reason")
        self.assertIn("| 1 tactiled: ", diagnostics.lines[-1][3])
        wait_for(lambda: "rt/doubtful/left/wrench" in reader.writers() and "1 reader" in server.log(), "the reader to be known")
        self.assertEqual(reader.lines, [])
        server.stop()
        server = bridge("dds", daemon.name, "--domain", DOMAIN, "--name", "doubtful", "--uncertain")
        self.addCleanup(server.__exit__)
        wait_for(lambda: reader.lines, "the doubtful values")

    def test_nothing_is_sent_while_the_value_is_bad_and_diagnostics_say_why(self):
        self.bridge()
        reader, diagnostics = self.reader(), self.reader("rt/diagnostics")
        wait_for(lambda: reader.lines and diagnostics.lines, "messages")
        wait_for(lambda: "0 tactiled: " in diagnostics.lines[-1][3] and "| good" in diagnostics.lines[-1][3], "good")
        self.daemon.others[0].kill()
        wait_for(lambda: "| bad:" in diagnostics.lines[-1][3], "the reason")
        self.assertIn("| 3 tactiled: ", diagnostics.lines[-1][3])
        wait_until_it_rests(lambda: len(reader.lines), "the messages")
        sent = len(reader.lines)
        self.daemon.process.kill()
        killed = time.monotonic()
        self.daemon.process.wait()
        wait_for(lambda: "does not respond" in diagnostics.lines[-1][3], "the daemon's death")
        print(f"\n/diagnostics after kill -9 of the daemon, s: {time.monotonic() - killed:.2f}")
        (self.daemon.folder / "dev").unlink(missing_ok=True)
        play(self.daemon)
        self.daemon.start()
        wait_for(lambda: len(reader.lines) > sent + 10, "the successor")
        self.assertEqual(reader.wrench()[:3], [1, 2, -3])

    def test_a_killed_bridge_is_replaced_without_a_new_reader(self):
        first = self.bridge()
        reader = self.reader()
        wait_for(lambda: len(reader.lines) > 10, "messages")
        first.kill()
        wait_until_it_rests(lambda: len(reader.lines), "the messages")
        sent = len(reader.lines)
        self.bridge()
        began = time.monotonic()
        wait_for(lambda: len(reader.lines) > sent + 10, "the second bridge")
        print(f"\nmessages of the next bridge, s: {time.monotonic() - began:.2f}")

    def test_another_domain_and_a_wrong_network_are_apart(self):
        self.bridge()
        other = Reader("rt/hand/left/wrench", domain="78")
        self.addCleanup(other.close)
        mine = self.reader()
        wait_for(lambda: len(mine.lines) > 10, "messages")
        self.assertEqual(other.lines, [])
        done = subprocess.run([BIN / "tactiled-dds", "--node", self.daemon.name, "--network", "no-such-interface"], capture_output=True,
                              text=True, timeout=60)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("no-such-interface", done.stderr)

    def test_an_end_says_so(self):
        server = self.bridge()
        diagnostics = self.reader("rt/diagnostics")
        wait_for(lambda: diagnostics.lines, "diagnostics")
        self.assertEqual(server.stop(), 0)
        wait_for(lambda: "the bridge has ended" in diagnostics.lines[-1][3], "the last message")


if __name__ == "__main__":
    unittest.main(verbosity=2)
