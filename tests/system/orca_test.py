"""The tactile pads of the ORCA hand, with the shipped configuration and calibration, the release daemon and a model of the hand:
what readers see, and what they see when bytes, a pad or the hand fails."""
import json
import math
import os
import sys
import unittest

from daemon import ROOT, Daemon, ctl, wait_for
from orca_device import ENABLED, FORCES, PADS, TAXELS, TYPE, OrcaHand, first_taxel

sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

SHIPPED = ROOT / "config/devices/orca_hand.toml"
CALIBRATION = ROOT / "config/calibration/orca_hand.toml"
REQUEST = [(TYPE, bytes([FORCES])), (ENABLED, b"\1")]


def shipped_config(stale_ms=500):
    """The shipped configuration with the port of the model, for a cable; a busy machine delays the model."""
    text = SHIPPED.read_text().replace('"/dev/serial/by-id/usb-..."', '"{folder}/port"\npath = "direct"')
    return text.replace("../calibration/orca_hand.toml", str(CALIBRATION)).replace("stale_ms = 100 ", f"stale_ms = {stale_ms} ")


class Hand(unittest.TestCase):
    def setUp(self):
        self.daemon = Daemon(shipped_config())
        self.hand = OrcaHand(self.daemon.folder / "port")
        self.addCleanup(self.daemon.__exit__)
        self.addCleanup(self.hand.__exit__)
        self.hand.__enter__()
        self.daemon.start()
        os.environ["TACTILED_RUNTIME_DIR"] = str(self.daemon.segment.parent)
        self.node = tactiled.open(self.daemon.name)
        self.addCleanup(self.node.close)
        self.wait_for_value()

    def array(self):
        return self.node.array("hand")

    def wait_for_value(self):
        wait_for(lambda: self.array().sample.reasons_text == ["uncalibrated"], "a value")

    def wait_for_no_value(self):
        wait_for(lambda: self.array().sample.quality == tactiled.BAD, "no value")
        self.assertTrue(all(math.isnan(value) for row in self.array().force_S_N.tolist() for value in row))

    def count(self, name):
        """A counter of the link, 0 while it is not shown."""
        return json.loads(self.daemon.ctl("status", "--json").stdout)["links"][0].get(name, 0)

    def test_the_stream_is_requested_by_the_two_writes(self):
        self.assertEqual(self.hand.writes[-2:], REQUEST)
        self.assertEqual(self.hand.wrong, [])
        self.daemon.stop()
        wait_for(lambda: self.hand.writes[-1] == (ENABLED, b"\0"), "the end of the stream")

    def test_forces_are_where_the_hand_is_pressed(self):
        self.hand.counts = {("thumb", 24): (3, -2, 20), ("middle", 0): (0, 0, 5), ("little", 50): (-10, 4, 254)}
        wait_for(lambda: abs(self.array().sample.force_S_N[2] + 27.9) < 1e-4, "27.9 N")
        array = self.array()
        self.assertEqual(array.sample.quality, tactiled.UNCERTAIN)
        forces = array.force_S_N.tolist()
        self.assertEqual(len(forces), TAXELS)
        for (pad, taxel), counts in self.hand.counts.items():
            force = forces[first_taxel(pad) + taxel]
            for value, expected in zip(force, (counts[0] / 10, counts[1] / 10, -counts[2] / 10)):
                self.assertAlmostEqual(value, expected, places=4)
        pressed = {first_taxel(pad) + taxel for pad, taxel in self.hand.counts}
        self.assertEqual({i for i, force in enumerate(forces) if any(force)}, pressed)
        self.assertEqual(array.peak_taxel, TAXELS - 1)
        self.assertAlmostEqual(array.sample.force_S_N[0], -0.7, places=4)
        self.assertAlmostEqual(array.sample.force_S_N[1], 0.2, places=4)

    def test_the_centre_is_at_the_pressed_finger(self):
        """Thumb at x = -60 mm, fingers at -30, 0 and 30 mm, little finger at 60 mm of the layout."""
        for k, (pad, n) in enumerate(PADS.items()):
            self.hand.counts = {(pad, i): (0, 0, 10 + k) for i in range(n)}
            press_N = n * (10 + k) / 10
            wait_for(lambda: abs(self.array().sample.force_S_N[2] + press_N) < 1e-3, f"{press_N} N on {pad}")
            self.assertLess(abs(self.array().cop_S_m[0] - (k - 2) * 30e-3), 1e-3, pad)

    def test_a_saturated_taxel_has_no_force(self):
        self.hand.counts = {("index", 3): (0, 0, 255), ("index", 4): (127, 0, 10)}
        wait_for(lambda: self.array().n_out == 2, "two taxels out")
        array, first = self.array(), first_taxel("index")
        self.assertIn("saturated", array.sample.reasons_text)
        self.assertEqual([bool(array.state[first + i] & tactiled.TAXEL_SATURATED) for i in (2, 3, 4)], [False, True, True])

    def test_frames_with_an_error_have_no_forces(self):
        self.hand.counts = {("ring", 10): (0, 0, 30)}
        wait_for(lambda: abs(self.array().sample.force_S_N[2] + 3) < 1e-4, "3 N")
        self.hand.error = 1
        self.wait_for_no_value()
        self.assertIn("missing-channel", self.array().sample.reasons_text)
        self.hand.error = 0
        self.wait_for_value()

    def test_a_damaged_frame_is_counted_and_the_next_one_is_read(self):
        self.hand.counts = {("index", i): (0, 0, 1) for i in range(87)}
        wait_for(lambda: abs(self.array().sample.force_S_N[2] + 8.7) < 1e-3, "8.7 N")
        lost, changed, headless = lambda f: f[:500] + f[501:], lambda f: f[:500] + b"\x55" + f[501:], lambda f: f[1:]
        for damage in (lost, changed, headless):
            before, skipped = self.hand.frames, self.count("skipped_bytes")
            self.hand.damage = damage
            seen = set()

            def is_past():
                seen.add(round(self.array().sample.force_S_N[2], 3))
                return self.hand.damage is None and self.hand.frames > before + 20

            wait_for(is_past, "frames after the damaged one")
            self.assertEqual(seen, {-8.7})
            wait_for(lambda: self.count("skipped_bytes") > skipped, "counted bytes")

    def test_without_the_frames_of_a_pad_no_finger_has_a_force(self):
        """The stream does not say which pads are in it: a shorter frame could be read as other fingers."""
        self.hand.counts = {("thumb", 0): (0, 0, 40)}
        wait_for(lambda: abs(self.array().sample.force_S_N[2] + 4) < 1e-4, "4 N")
        self.hand.unplugged = {"middle"}
        self.wait_for_no_value()
        self.assertIn("stale", self.array().sample.reasons_text)
        wait_for(lambda: self.count("bad_length") > 0, "counted frames")
        self.hand.unplugged = set()
        wait_for(lambda: abs(self.array().sample.force_S_N[2] + 4) < 1e-4, "4 N again")

    def test_a_silent_hand_has_no_forces(self):
        self.hand.is_silent = True
        self.wait_for_no_value()
        self.hand.is_silent = False
        wait_for(lambda: self.array().sample.quality != tactiled.BAD, "a value again")

    def test_the_stream_of_a_restarted_hand_is_requested_again(self):
        before = len(self.hand.writes)
        self.hand.restart()
        self.wait_for_no_value()
        wait_for(lambda: self.array().sample.quality != tactiled.BAD, "a value again")
        self.assertGreater(len(self.hand.writes), before)
        self.assertEqual(self.hand.writes[-2:], REQUEST)
        self.assertGreater(self.count("restarted"), 0)


class Shipped(unittest.TestCase):
    def test_the_shipped_files_are_good(self):
        done = ctl("check", SHIPPED)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("1 links, 1 sensors", done.stdout)

    def test_a_hand_without_a_pad_needs_another_calibration(self):
        daemon = Daemon(shipped_config().replace("taxels = 363", "taxels = 276"))
        done = ctl("check", daemon.config)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn('is for 363 taxels of 3 values, link "hand" carries 276 taxels of 3 values', done.stderr)


if __name__ == "__main__":
    unittest.main()
