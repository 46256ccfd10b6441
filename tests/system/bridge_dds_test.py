#!/usr/bin/env python3
"""tactiled-dds before eProsima's Fast DDS: the values of the segment on a topic of ROS 2, nothing while there is none, and the
reason on /diagnostics."""
import pathlib
import shutil
import subprocess
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bridge_process import bridge  # noqa: E402
from daemon import BIN, ROOT, wait_for, wait_until_it_rests  # noqa: E402
from unit_daemon import play, quality_is, unit_daemon  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

DOMAIN = "77"


class Reader:
    """Lines of fastdds_reader, split: receive and send time in ns, frame, the rest."""

    def __init__(self, topic, domain=DOMAIN):
        self.process = subprocess.Popen([BIN / "fastdds_reader", domain, "120", topic], stdout=subprocess.PIPE, text=True)
        self.lines = []
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n").split(" ", 3))

    def wrench(self):
        return [float(word) for word in self.lines[-1][3].split()]

    def close(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


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

    def reader(self, topic="rt/hand/left/wrench"):
        made = Reader(topic)
        self.addCleanup(made.close)
        return made

    def test_the_topic_has_every_sample_with_the_segments_values(self):
        self.bridge("--frame-prefix", "hand_")
        reader, began_ns = self.reader(), time.time_ns()
        wait_for(lambda: len(reader.lines) > 50, "messages")
        with tactiled.open(self.daemon.name).follow("left", 30) as left:
            published = {next(left).t_ns for _ in range(400)}
        to_wall_ns = time.time_ns() - time.monotonic_ns()
        wait_for(lambda: int(reader.lines[-1][1]) > max(published) + to_wall_ns, "the message of the last sample")
        lines = [line for line in reader.lines if min(published) - 10**6 < int(line[1]) - to_wall_ns < max(published) + 10**6]
        self.assertAlmostEqual(len(lines), len(published), delta=40)  # best effort
        self.assertEqual({tuple(float(w) for w in line[3].split()[:3]) for line in lines}, {(1, 2, -3)})
        self.assertEqual({line[3].split()[3] for line in lines}, {"nan"})  # no torque is measured
        self.assertEqual({line[2] for line in lines}, {"hand_left"})
        self.assertTrue(all(began_ns < int(line[1]) < time.time_ns() for line in lines), "no time of day")

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
        other = Reader("rt/hand/left/wrench", "78")
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
