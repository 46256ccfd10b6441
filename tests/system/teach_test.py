#!/usr/bin/env python3
"""tactilectl teach, weigh, status and top, with real grasps of the gripper of pick_bench.py."""
import json
import os
import pathlib
import pty
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402
from pick_bench import GRASP, Robot, calibrate_skin  # noqa: E402
from simulated_sensors import SENSORS  # noqa: E402
from web_server import PROGRAM, TOKEN, Web  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

GRIP_N = 8.0


class Teach(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-teach-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        calibrate_skin(cls.folder / "skin.toml")

    def setUp(self):
        self.daemon = Daemon("".join(SENSORS["skin"]().toml(name, "quadratic") for name in ("left", "right")) + GRASP)
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        for name in ("left", "right"):
            shutil.copy(self.folder / "skin.toml", self.daemon.folder / f"{name}-quadratic.toml")
        self.robot = Robot(self.daemon.folder, 7)
        self.robot.start()
        self.addCleanup(self.robot.finish)
        self.daemon.start()
        self.node = tactiled.open(self.daemon.name)
        self.addCleanup(self.node.close)
        self.objects = self.daemon.folder / "objects.toml"
        wait_for(lambda: self.node.grasp.state == tactiled.GRIP_OPEN, "a value of both jaws")
        self.robot.live(0.3)  # the free phase shows the zero

    def hold(self, mass_kg):
        self.robot.offer(mass_kg)
        self.robot.live(0.25)
        self.robot.close(GRIP_N)
        wait_for(lambda: self.node.grasp.state == tactiled.GRIP_GRASPED, "grasped")
        self.robot.lift()
        wait_for(lambda: self.node.grasp.weight_state == tactiled.WEIGHT_STABLE, "a stable weight")
        time.sleep(0.1)
        return self.node.grasp

    def let_go(self):
        """Opens in the air: an object that falls out of opening jaws slides, and the daemon is not informed of the
        opening here."""
        self.robot.open()
        gone = (tactiled.GRIP_OPEN, tactiled.GRIP_LOST)
        wait_for(lambda: self.node.grasp.state in gone and self.robot.is_open(), "open")

    def teach(self, name, mass_kg, count, *words):
        """Runs tactilectl teach during successive grasps. Returns its result."""
        done = threading.Event()

        def grasp_on():
            while not done.is_set():
                self.hold(mass_kg)
                self.let_go()
        hands = threading.Thread(target=grasp_on)
        teaching = subprocess.Popen([BIN / "tactilectl", "teach", name, "--count", str(count), "--node", self.daemon.name, *words],
                                    stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        time.sleep(0.2)
        hands.start()
        try:
            out, err = teaching.communicate(timeout=60)
        finally:
            done.set()
            hands.join()
        return subprocess.CompletedProcess(teaching.args, teaching.returncode, out, err)

    def test_an_object_is_taught_recognised_listed_and_forgotten(self):
        self.assertEqual(self.hold(0.2).object_id, 0)
        self.let_go()
        taught = self.teach("bolt", 0.2, 3)
        self.assertEqual(taught.returncode, 0, taught.stderr)
        self.assertEqual(len(re.findall(r"grasp \d of 3: 0\.\d+ kg \+- ", taught.stdout)), 3, taught.stdout)
        scatter, stated = re.search(r"the grasps scatter by (\S+) kg, and each weight states (\S+) kg", taught.stdout).groups()
        self.assertAlmostEqual(float(re.search(r"sd (\S+) kg, id", taught.stdout).group(1)), max(float(scatter), float(stated)), places=4)
        told = self.hold(0.2)
        self.assertEqual((told.object_id, told.object), (1, "bolt"))
        self.assertGreater(told.object_probability, 0.5)
        status = json.loads(self.daemon.ctl("status", "--json").stdout)["grasp"]
        self.assertEqual((status["object"], status["state"], status["weight_state"]), ("bolt", "holding", "stable"))
        self.assertAlmostEqual(status["weight_kg"], 0.2, delta=0.006)
        self.let_go()
        self.assertEqual(self.hold(0.3).object_id, 0)  # unknown, not the most similar one
        self.let_go()
        like = self.teach("nut", 0.2005, 2)
        self.assertEqual(like.returncode, 1, like.stdout)
        self.assertIn('cannot be distinguished from "bolt"', like.stderr)
        self.assertRegex(like.stderr, r"\d\.\d sd of each apart, 3 are needed")
        again = self.teach("bolt", 0.3, 2)  # the same name again: replaced with the same id
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertEqual(self.hold(0.3).object_id, 1)
        listed = json.loads(self.daemon.ctl("teach", "--list", "--json").stdout)
        self.assertEqual([(o["name"], o["grasps"]) for o in listed["objects"]], [("bolt", 2)])
        self.assertEqual(self.daemon.ctl("teach", "--forget", "screw").returncode, 2)
        self.assertEqual(self.daemon.ctl("teach", "--forget", "bolt").returncode, 0)
        wait_for(lambda: self.node.grasp.object_id == 0, "the object to be forgotten")  # without a restart, while
                                                                                           # the object is held
        self.assertEqual(self.node.grasp.state, tactiled.GRIP_HOLDING)

    @unittest.skipUnless(PROGRAM.exists(), "tactiled-web is not built")
    def test_different_objects_are_not_one(self):
        masses = iter((0.15, 0.25, 0.2, 0.3, 0.15, 0.25))
        hold = self.hold
        self.hold = lambda _: hold(next(masses))
        taught = self.teach("bolt", 0, 3)
        self.assertEqual(taught.returncode, 1, taught.stdout)
        self.assertIn("they are of different objects. Nothing stored", taught.stderr)
        self.assertFalse(self.objects.exists())

    def test_the_web_page_teaches_the_object_that_hangs(self):
        with Web(self.daemon.name, token=TOKEN) as web:
            self.addCleanup(shutil.rmtree, web.folder)
            wait_for(lambda: web.status()["alive"], "the daemon")
            code, answer = web.command({"command": "teach", "object": "bolt"})
            self.assertEqual((code, answer["result"]), (409, 4))
            self.assertIn("no stable weight", answer["why"])
            self.assertFalse(self.objects.exists())
            self.hold(0.2)
            self.assertEqual(web.command({"command": "teach", "object": "bolt"})[0], 200)
            wait_for(lambda: self.node.grasp.object == "bolt", "the object")
            self.let_go()
            self.assertEqual(self.hold(0.2).object, "bolt")
            self.assertEqual(web.command({"command": "teach", "object": "bolt"})[0], 200)  # one more grasp
            code, answer = web.command({"command": "teach", "object": "nut"})
            self.assertEqual((code, answer["result"]), (409, 6))
            self.assertIn('cannot be distinguished from object 1 ("bolt")', answer["why"])
            listed = json.loads(self.daemon.ctl("teach", "--list", "--json").stdout)
            self.assertEqual([(o["name"], o["grasps"]) for o in listed["objects"]], [("bolt", 2)])
            grasp = web.status()["grasp"]
            self.assertEqual((grasp["state"], grasp["object"]), ("holding", "bolt"))

    def test_a_file_with_an_error_changes_nothing(self):
        good = 'format = 1\n[[object]]\nid = 5\nname = "egg"\nmass_kg = 0.2\nsd_kg = 0.01\n'
        self.objects.write_text(good)
        self.assertEqual(self.daemon.ctl("teach", "--reload").returncode, 0)
        self.assertEqual(self.hold(0.2).object, "egg")
        self.objects.write_text(good.replace("0.01", "-1"))
        refused = self.daemon.ctl("teach", "--reload")
        self.assertEqual(refused.returncode, 1)
        self.assertIn("objects.toml:6: ", refused.stderr)
        time.sleep(0.1)
        self.assertEqual(self.node.grasp.object, "egg")

    def test_teaching_gives_up_and_stores_nothing(self):
        gone = self.daemon.ctl("teach", "bolt", "--timeout", "0.5")
        self.assertEqual(gone.returncode, 1)
        self.assertIn("0 of 5 seen, nothing stored", gone.stderr)
        self.assertFalse(self.objects.exists())
        self.assertEqual(self.daemon.ctl("teach", "a name").returncode, 2)
        self.assertEqual(self.daemon.ctl("teach").returncode, 2)

    def test_weighing_is_commanded(self):
        self.assertEqual(self.daemon.ctl("weigh", "start").returncode, 1)  # no object is held
        early = self.daemon.ctl("weigh", "known", "0.2")
        self.assertEqual(early.returncode, 1)
        self.assertIn("the weight is not stable", early.stderr)
        self.hold(0.2)
        grams = self.daemon.ctl("weigh", "known", "200")
        self.assertEqual(grams.returncode, 2)
        self.assertIn("the mass is in kg", grams.stderr)
        self.assertIn("for grams write 0.2", grams.stderr)
        self.assertRegex(grams.stderr, r"200 kg is [\d]+ times the 0\.(19|20)\d* kg that hang now")
        self.assertFalse(self.node.grasp.scale_shown)  # unchanged
        other = self.daemon.ctl("weigh", "known", "0.1")
        self.assertEqual(other.returncode, 2)
        self.assertIn("is it this object?", other.stderr)
        self.assertIn("at most 5 times, or a 5th", self.daemon.ctl("weigh", "known", "0.02", "--force").stderr)
        self.assertFalse(self.node.grasp.scale_shown)
        self.assertEqual(self.daemon.ctl("weigh", "known", "0.1", "--force").returncode, 0)
        wait_for(lambda: abs(self.node.grasp.weight_kg - 0.1) < 0.001, "the scale of another object")
        self.assertEqual(self.daemon.ctl("weigh", "forget").returncode, 0)
        wait_for(lambda: self.node.grasp.weight_state == tactiled.WEIGHT_STABLE and abs(self.node.grasp.weight_kg - 0.2) < 0.001, "a weight without it")
        known = self.daemon.ctl("weigh", "known", "0.21")
        self.assertEqual(known.returncode, 0)
        self.assertRegex(known.stdout, r"it read 0\.(19|20)\d* kg, and reads 0\.21 kg from now on")
        self.assertEqual(self.daemon.ctl("weigh", "known", "nan").returncode, 2)
        wait_for(lambda: abs(self.node.grasp.weight_kg - 0.21) < 0.001, "the scale")
        self.assertTrue(self.node.grasp.scale_shown)
        self.assertEqual(self.daemon.ctl("weigh", "forget").returncode, 0)
        wait_for(lambda: abs(self.node.grasp.weight_kg - 0.2) < 0.001 and not self.node.grasp.scale_shown, "no scale")
        wait_for(lambda: self.node.grasp.weight_state == tactiled.WEIGHT_STABLE, "a weight without it")
        self.assertEqual(self.daemon.ctl("weigh", "zero").returncode, 0)
        wait_for(lambda: abs(self.node.grasp.weight_kg) < 0.001, "the tare")
        self.assertEqual(self.daemon.ctl("weigh", "stop").returncode, 0)
        wait_for(lambda: self.node.grasp.weight_state == tactiled.WEIGHT_NONE, "no weight")

    def test_an_object_taught_with_a_scale_waits_for_it_after_a_restart(self):
        self.hold(0.2)
        self.assertEqual(self.daemon.ctl("weigh", "known", "0.2").returncode, 0)
        self.let_go()
        taught = self.teach("bolt", 0.2, 2)
        self.assertEqual(taught.returncode, 0, taught.stderr)
        self.assertEqual(self.hold(0.2).object, "bolt")
        self.let_go()
        self.daemon.stop()
        (self.daemon.folder / "tactiled.log").unlink()  # the lines of the next start alone
        self.daemon.start()
        self.assertIn("recognised only once a known weight is shown again", self.daemon.log())
        self.node = tactiled.open(self.daemon.name)
        self.addCleanup(self.node.close)
        wait_for(lambda: self.node.grasp.state == tactiled.GRIP_OPEN, "a value of both jaws")
        self.robot.live(0.3)
        self.assertEqual(self.hold(0.2).object_id, 0)  # its weight was measured with another scale
        self.assertEqual(self.daemon.ctl("weigh", "known", "0.2").returncode, 0)
        wait_for(lambda: self.node.grasp.object == "bolt", "the object")

    def test_top_fits_a_terminal_and_prints_plainly_elsewhere(self):
        self.hold(0.2)
        plain = self.daemon.ctl("top", "--count", "2", "--interval", "0.1")
        self.assertEqual(plain.returncode, 0, plain.stderr)
        self.assertNotIn("\x1b", plain.stdout)
        self.assertEqual(plain.stdout.count("grasp holding"), 2, plain.stdout)
        self.assertLessEqual(max(map(len, plain.stdout.splitlines())), 80, plain.stdout)
        for word in ("left", "right", "good", "kg", "slips", "links 2 of 2 open"):
            self.assertIn(word, plain.stdout)
        pid, terminal = pty.fork()
        if pid == 0:
            os.execv(BIN / "tactilectl", ["tactilectl", "top", "--count", "2", "--interval", "0.1", "--node", self.daemon.name])
        screen = b""
        try:
            while piece := os.read(terminal, 65536):
                screen += piece
        except OSError:
            pass  # it has ended
        self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), 0)
        self.assertEqual(screen.count(b"\x1b[H"), 2)
        self.assertLess(screen.rpartition(b"\x1b[H")[2].count(b"\n"), 24)
        self.assertIn(b"grasp holding", screen)


if __name__ == "__main__":
    unittest.main(verbosity=2)
