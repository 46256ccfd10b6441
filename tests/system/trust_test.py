#!/usr/bin/env python3
"""A hostile local user beside the release programs: forged segments before, between and during runs, folders that
others can write to, truncation during a read. Run as root it acts as a second user; the readers are those in C, C++
and Python."""
import itertools
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import time
import unittest
import warnings

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, folder_of_user, run_folder, wait_for  # noqa: E402
from python_reader import a_copy, tactiled  # noqa: E402
from unit_daemon import quality_is, unit_daemon  # noqa: E402

STRANGER = 65534
FORGED = struct.pack("=d", -666.0)
TRUE = struct.pack("=d", -3.0)
IS_ROOT = os.geteuid() == 0


def as_stranger(action):
    """Returns True if the action succeeds as another user, in a separate process."""
    child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setresgid(STRANGER, STRANGER, STRANGER)
            os.setresuid(STRANGER, STRANGER, STRANGER)
            action()
            os._exit(0)
        except OSError:
            os._exit(1)
        finally:
            os._exit(2)
    return os.waitpid(child, 0)[1] == 0


def as_stranger_forever(action):
    """Turns this process, a child, into one of another user."""
    try:
        os.setgroups([])
        os.setresgid(STRANGER, STRANGER, STRANGER)
        os.setresuid(STRANGER, STRANGER, STRANGER)
        action()
    finally:
        os._exit(1)


def ctl(*words, **env):
    return subprocess.run([BIN / "tactilectl", *map(str, words)], capture_output=True, text=True, timeout=20,
                          env={**os.environ, **{key: str(value) for key, value in env.items()}})


@unittest.skipUnless(IS_ROOT, "only root can act as another user")
class AStranger(unittest.TestCase):
    def setUp(self):
        self.daemon = self.enterContext(unit_daemon())
        self.squat = pathlib.Path(f"/dev/shm/tactiled.{self.daemon.name}")
        self.addCleanup(lambda: self.squat.unlink(missing_ok=True))

    def forge(self, data):
        def write():
            self.squat.write_bytes(data)
            self.squat.chmod(0o644)
        self.assertTrue(as_stranger(write))

    def forgery(self):
        """Returns the bytes of the running daemon with another force, GOOD for ten seconds."""
        copy = a_copy(self.daemon.segment.read_bytes().replace(TRUE, FORGED))
        copy.make_fresh()
        return bytes(copy.data)

    def test_forged_before_between_and_during_runs_reaches_no_reader(self):
        d = self.daemon
        d.start()
        wait_for(quality_is(d, "good"), 3, "a good sample")
        forgery = self.forgery()
        self.assertIn(FORGED, forgery)
        d.stop()
        seen = []
        for phase in ("before", "during", "between", "during"):
            self.forge(forgery)
            if phase == "during":
                d.start()
                wait_for(quality_is(d, "good"), 3, "a good sample")
                self.forge(self.forgery())
                with tactiled.open(d.name) as node:
                    seen.append(node.latest("left").force_S_N[2])
                seen += [float(w) for w in d.ctl("read", "left").stdout.split()[-4:-1]]
                d.stop()
            else:
                self.assertEqual(d.ctl("read", "left").returncode, 3)
                self.assertEqual(d.ctl("status").returncode, 3)
                self.assertRaises(tactiled.Error, tactiled.open, d.name)
        self.assertNotIn(-666.0, seen)
        self.assertIn(-3.0, seen)

    def test_readers_that_run_on_follow_the_daemon_and_not_the_forgery(self):
        d = self.daemon
        d.start()
        wait_for(quality_is(d, "good"), 3, "a good sample")
        with open(d.folder / "out.csv", "w+") as out, tactiled.open(d.name) as node:
            reader = subprocess.Popen([BIN / "tactilectl", "read", "left", "--follow", "--csv", "--timeout", "0", "--node", d.name], stdout=out)
            self.addCleanup(reader.wait)
            self.addCleanup(reader.kill)
            wait_for(lambda: os.stat(out.name).st_size > 200, 10, "rows")
            forgery = self.forgery()
            for _ in range(2):
                d.process.kill()
                d.process.wait()
                d.segment.unlink()
                self.forge(forgery)
                for _ in range(20):
                    time.sleep(0.02)
                    self.assertNotEqual(node.latest("left").force_S_N[2], -666.0)
                self.assertEqual(node.latest("left").quality, tactiled.BAD)
                d.start()
                wait_for(lambda: node.latest("left").quality == tactiled.GOOD, 3, "a value")
                self.assertEqual(node.latest("left").force_S_N[2], -3.0)
            d.stop()
            time.sleep(0.1)
            out.seek(0)
            text = out.read()
        self.assertNotIn("-666", text)
        self.assertIn("-3,", text)

    def test_cannot_read_write_rename_or_replace_the_segment_nor_connect(self):
        d = self.daemon
        d.start()
        segment = d.segment  # named before the user changes
        self.assertFalse(as_stranger(lambda: open(segment, "rb").close()))
        self.assertFalse(as_stranger(lambda: open(segment, "r+b").close()))
        self.assertFalse(as_stranger(lambda: os.truncate(segment, 0)))
        self.assertFalse(as_stranger(segment.unlink))
        self.assertFalse(as_stranger(lambda: segment.rename(segment.parent / "x")))
        self.assertFalse(as_stranger(lambda: (segment.parent / "tactiled.other").touch()))
        self.assertFalse(as_stranger(lambda: os.kill(d.process.pid, signal.SIGTERM)))
        d.folder.chmod(0o755)
        s = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.addCleanup(s.close)
        self.assertFalse(as_stranger(lambda: s.connect(str(d.folder / "control.sock"))))
        self.assertTrue(pathlib.Path(d.folder / "control.sock").exists())

    def occupy(self, path, listens):
        """Another user's program at the path of the control socket; it confirms each command. Returns its process."""
        def serve():
            s = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            s.bind(str(path))
            path.chmod(0o777)
            if listens:
                s.listen(16)
            while True:
                if not listens:
                    signal.pause()
                client = s.accept()[0]
                client.recv(128)
                client.send(b"2 0")
                client.close()
        child = os.fork()
        if child == 0:
            as_stranger_forever(serve)
        self.addCleanup(lambda: path.unlink(missing_ok=True))
        self.addCleanup(os.waitpid, child, 0)
        self.addCleanup(os.kill, child, signal.SIGKILL)
        wait_for(lambda: path.exists() and path.stat().st_mode & 0o777 == 0o777, 5, "the squatter")
        time.sleep(0.1)

    def test_a_program_at_the_path_of_the_control_socket_confirms_no_command(self):
        d = self.daemon
        self.assertFalse(as_stranger(lambda: socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET).bind(str(run_folder() / f"{d.name}.sock"))))
        path = pathlib.Path(f"/tmp/tactiled-{d.name}.sock")
        d.config.write_text(d.config.read_text().replace(f"{d.folder}/control.sock", str(path)))
        self.occupy(path, listens=True)
        for _ in range(2):  # before a run, and between two
            d.start()
            wait_for(quality_is(d, "good"), 3, "a good sample")
            self.assertIn("tactilectl tare will not work", d.log())
            done = d.ctl("tare", "left")
            self.assertNotEqual(done.returncode, 0)
            self.assertNotIn("done", done.stdout)
            self.assertIn("without a control socket", done.stderr)
            with tactiled.open(d.name) as node, node.follow("left", 1) as left:
                self.assertEqual(next(left).quality, tactiled.GOOD)
            d.stop()
        self.assertTrue(path.exists())

    def test_what_another_user_leaves_at_the_path_of_the_control_socket_is_replaced_or_left_alone(self):
        d = self.daemon
        path = pathlib.Path(f"/tmp/tactiled-{d.name}.sock")
        d.config.write_text(d.config.read_text().replace(f"{d.folder}/control.sock", str(path)))
        victim = d.folder / "victim"
        victim.write_text("of root")
        victim.chmod(0o600)
        self.addCleanup(lambda: path.unlink(missing_ok=True))
        for leave in (lambda: path.write_text("a file"), lambda: path.symlink_to(victim), lambda: os.mkfifo(path), lambda: path.mkdir()):
            self.assertTrue(as_stranger(leave))
            d.start()
            wait_for(quality_is(d, "good"), 3, "a good sample")
            self.assertNotEqual(d.ctl("tare", "left").returncode, 0)
            d.stop()
            self.assertEqual((victim.read_text(), victim.stat().st_mode & 0o777), ("of root", 0o600))
            (path.rmdir if path.is_dir() and not path.is_symlink() else path.unlink)()
        self.occupy(path, listens=False)  # its program has ended, or does not listen
        d.start()
        wait_for(quality_is(d, "good"), 3, "a good sample")
        self.assertEqual(d.ctl("tare", "left").returncode, 0)

    def test_a_group_member_reads_and_does_no_more(self):
        d = self.daemon
        d.start()
        wait_for(quality_is(d, "good"), 3, "a good sample")
        segment = d.segment  # named before the user changes
        os.chown(segment, -1, STRANGER)
        self.assertTrue(as_stranger(lambda: open(segment, "rb").close()))
        self.assertFalse(as_stranger(lambda: open(segment, "r+b").close()))
        self.assertFalse(as_stranger(lambda: os.truncate(segment, 0)))
        self.assertFalse(as_stranger(segment.unlink))
        self.assertFalse(as_stranger(lambda: (segment.parent / ".tactiled.x").touch()))


class AUser(unittest.TestCase):
    """A daemon without root, for its own user."""

    @unittest.skipUnless(IS_ROOT, "only root can act as another user")
    def test_has_a_daemon_of_his_own_in_his_session(self):
        with folder_of_user(STRANGER, 0o700) as session, unit_daemon() as d:
            text = d.config.read_text().replace(f'control = "{d.folder}/control.sock"\n', "")
            d.config.write_text(text)
            os.chown(d.folder, STRANGER, STRANGER)
            d.folder.chmod(0o755)
            os.chown(os.path.realpath(d.folder / "dev"), STRANGER, -1)
            d.env = {**{k: v for k, v in os.environ.items() if k != "TACTILED_RUNTIME_DIR"}, "XDG_RUNTIME_DIR": str(session)}
            user = ["setpriv", f"--reuid={STRANGER}", f"--regid={STRANGER}", "--clear-groups"]
            segment = session / "tactiled" / f"tactiled.{d.name}"
            with open(d.folder / "tactiled.log", "a") as log:
                d.process = subprocess.Popen([*user, BIN / "tactiled", "--config", d.config], stderr=log, env=d.env)
            wait_for(lambda: "Modbus" in d.log() or d.process.poll() is not None, 10, "the start")
            self.assertIsNone(d.process.poll(), d.log())
            self.assertTrue(segment.exists())
            self.assertTrue((session / "tactiled" / f"{d.name}.sock").exists())  # the default moves along

            def status():
                return subprocess.run([*user, BIN / "tactilectl", "status", "--node", d.name], capture_output=True, text=True, env=d.env)
            wait_for(lambda: status().returncode == 0, 3, "a good sample")
            tare = subprocess.run([*user, BIN / "tactilectl", "tare", "left", "--node", d.name], capture_output=True, text=True, env=d.env)
            self.assertEqual(tare.returncode, 0, tare.stderr)
            self.assertEqual(ctl("status", "--node", d.name, XDG_RUNTIME_DIR="/nowhere").returncode, 3)
            self.assertEqual(ctl("status", "--node", d.name, "--runtime-dir", session / "tactiled").returncode, 0)

    def test_without_any_folder_learns_what_to_give(self):
        if not IS_ROOT:
            self.skipTest("only root can act as another user")
        with unit_daemon(rate=None) as d:
            d.folder.chmod(0o755)
            env = {k: v for k, v in os.environ.items() if k not in ("TACTILED_RUNTIME_DIR", "XDG_RUNTIME_DIR")}
            words = ["setpriv", f"--reuid={STRANGER}", f"--regid={STRANGER}", "--clear-groups", BIN / "tactiled", "--config", d.config]
            done = subprocess.run(words, capture_output=True, text=True, env=env, timeout=10)
            self.assertEqual(done.returncode, 69)
            self.assertIn("--runtime-dir", done.stderr)
            done = subprocess.run([*words, "--runtime-dir", "/tmp"], capture_output=True, text=True, env=env, timeout=10)
            self.assertEqual(done.returncode, 69)
            self.assertIn("/tmp: not a trusted folder", done.stderr)


class AFolder(unittest.TestCase):
    def test_that_others_can_write_to_is_refused_by_every_reader(self):
        with unit_daemon() as d:
            folder = run_folder() / f"test-{os.getpid()}"
            folder.mkdir()
            self.addCleanup(folder.rmdir)
            d.env["TACTILED_RUNTIME_DIR"] = str(folder)
            d.start()
            wait_for(quality_is(d, "good"), 3, "a good sample")
            for mode in (0o777, 0o1777, 0o775):
                folder.chmod(mode)
                for words in (("status",), ("read", "left"), ("tare", "left")):
                    done = d.ctl(*words)
                    self.assertEqual(done.returncode, 3, words)
                    self.assertIn("not a trusted folder", done.stderr)
                with self.assertRaisesRegex(tactiled.Error, "not a trusted folder"):
                    tactiled.open(d.name, str(folder))
            folder.chmod(0o755)
            self.assertEqual(d.ctl("status").returncode, 0)
            d.stop()

    def test_is_checked_by_python_as_by_c(self):
        with unit_daemon() as d:
            d.start()
            inner = run_folder() / f"test-{os.getpid()}" / "a"
            inner.mkdir(parents=True)
            self.addCleanup(lambda: (inner.rmdir(), inner.parent.rmdir()))
            copy = inner / f"tactiled.{d.name}"
            self.addCleanup(lambda: copy.unlink(missing_ok=True))
            link = inner.parent / "link"
            link.symlink_to(inner)
            self.addCleanup(link.unlink)

            def both(folder):
                try:
                    tactiled.open(d.name, str(folder)).close()
                    python = True
                except tactiled.Error as e:
                    python = False
                    self.assertNotIn("Errno", str(e))
                c = ctl("status", "--node", d.name, "--runtime-dir", folder).returncode != 3
                self.assertEqual(python, c, folder)
                return c
            copy.write_bytes(d.segment.read_bytes())
            copy.chmod(0o640)
            self.assertTrue(both(inner))
            self.assertFalse(both(link))
            self.assertFalse(both(f"{inner}/../a"))
            self.assertFalse(both("/tmp"))
            self.assertFalse(both("nowhere"))
            for path, mode in ((inner, 0o777), (inner.parent, 0o1777), (copy, 0o660)):
                before = path.stat().st_mode
                path.chmod(mode)
                self.assertFalse(both(inner), path)
                path.chmod(before)
            if IS_ROOT:
                for path in (copy, inner.parent):
                    os.chown(path, STRANGER, STRANGER)
                    self.assertFalse(both(inner), path)
                    os.chown(path, 0, 0)
                for path in (inner.parent, inner, copy):  # all of one user
                    os.chown(path, STRANGER, STRANGER)
                self.assertTrue(both(inner))
                for path in (inner.parent, inner, copy):
                    os.chown(path, 0, 0)
            self.assertTrue(both(inner))

    def test_dev_shm_is_used_only_where_it_is_named_and_with_a_warning(self):
        with unit_daemon() as d:
            d.env["TACTILED_RUNTIME_DIR"] = "/dev/shm"
            d.start()
            self.assertTrue(pathlib.Path(f"/dev/shm/tactiled.{d.name}").exists())
            wait_for(lambda: "any local user can create a segment" in d.log(), 3, "the warning")
            wait_for(quality_is(d, "good"), 3, "a good sample")
            done = d.ctl("status")
            self.assertEqual(done.returncode, 0)
            self.assertIn("warning: any local user", done.stderr)
            self.assertEqual(ctl("status", "--node", d.name).returncode, 3)
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                with tactiled.open(d.name, "/dev/shm") as node:
                    self.assertEqual(node.latest("left").force_S_N, (1.0, 2.0, -3.0))
            self.assertEqual([w.category for w in said], [RuntimeWarning])

    def test_a_program_of_layout_1_4_meets_the_daemon_in_dev_shm(self):
        """Uses the offsets of that version as numbers."""
        with unit_daemon() as d:
            d.env["TACTILED_RUNTIME_DIR"] = "/dev/shm"
            d.start()
            wait_for(quality_is(d, "good"), 3, "a good sample")
            data = pathlib.Path(f"/dev/shm/tactiled.{d.name}").read_bytes()
        self.assertEqual(data[:8], b"TACTILED")
        byte_order, major, minor, header_size = struct.unpack_from("=IHHI", data, 8)
        self.assertEqual((byte_order, major), (0x01020304, 1))
        self.assertGreaterEqual((minor, header_size), (4, 512))
        n_sensors, sensor_offset, sensor_size = struct.unpack_from("=3I", data, 248)
        self.assertEqual(n_sensors, 1)
        self.assertEqual(data[sensor_offset:sensor_offset + 5], b"left\0")
        offset, slot_size, slots, record_size, head_offset = struct.unpack_from("=5I", data, sensor_offset + 160)
        number = struct.unpack_from("=I", data, head_offset)[0] - 1
        at = offset + number % slots * slot_size
        self.assertEqual(struct.unpack_from("=I", data, at)[0], 2 * number + 2)
        self.assertEqual(struct.unpack_from("=Q", data, at + 8)[0], number)
        self.assertEqual(struct.unpack_from("=3d", data, at + 8 + 56), (1.0, 2.0, -3.0))


class ATruncatedFile(unittest.TestCase):
    def test_ends_no_reader_and_the_next_daemon_is_followed(self):
        for length in (0, 4096, 100_000):
            with self.subTest(length), unit_daemon() as d:
                d.start()
                wait_for(quality_is(d, "good"), 3, "a good sample")
                with open(d.folder / "out.csv", "w+") as out, tactiled.open(d.name) as node, node.follow("left", 0.5) as left:
                    reader = subprocess.Popen([BIN / "tactilectl", "read", "left", "--follow", "--csv", "--timeout", "0", "--node", d.name],
                                              stdout=out)
                    cxx = subprocess.Popen([BIN / "reader_cxx17", d.name, "left", "4"], stdout=subprocess.PIPE, text=True)
                    next(left)
                    wait_for(lambda: os.stat(out.name).st_size > 200, 10, "rows")
                    os.truncate(d.segment, length)
                    wait_for(lambda: node.latest("left").quality == tactiled.BAD, 1, "BAD")
                    rest = list(itertools.islice(left, 1000))
                    self.assertEqual(len([s for s in rest if s.reasons & tactiled.DAEMON_STOPPED]), 1)
                    self.assertTrue(rest[-1].reasons & tactiled.DAEMON_STOPPED)
                    self.assertNotEqual(d.process.wait(5), 0)  # its own mapping was truncated
                    self.assertIsNone(reader.poll())
                    d.start()
                    wait_for(lambda: node.latest("left").quality == tactiled.GOOD, 3, "a value")
                    time.sleep(0.2)
                    reader.terminate()
                    self.assertIn(reader.wait(5), (0, 1))
                    self.assertEqual(cxx.wait(10), 0)
                    cxx.stdout.close()
                    out.seek(0)
                    rows = [row.split(",") for row in out.read().splitlines()[1:-1]]
                self.assertEqual({row[1:4][2] for row in rows}, {"-3", ""})
                self.assertEqual(rows[-1][3], "-3")


class Words(unittest.TestCase):
    def test_a_node_name_that_is_a_path_is_a_wrong_word(self):
        for verb in (("status",), ("read", "left"), ("tare", "all"), ("top", "--count", "1")):
            done = ctl(*verb, "--node", "../../x")
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("a name has the characters", done.stderr)

    def test_a_failed_write_is_exit_1(self):
        with unit_daemon() as d, open("/dev/full", "w") as full:
            d.start()
            wait_for(quality_is(d, "good"), 3, "a good sample")
            for words in (("status",), ("status", "--json"), ("read", "left"), ("read", "left", "--follow", "--count", "300", "--csv")):
                done = subprocess.run([BIN / "tactilectl", *words, "--node", d.name], stdout=full, stderr=subprocess.PIPE, text=True, timeout=20)
                self.assertEqual(done.returncode, 1, words)
                self.assertIn("standard output", done.stderr)
            for words in (("check", "--help"), ("--version",), ("--help",), ("check", "--keys"), ("map",), ("check", d.config), ("simulate", "--help")):
                done = subprocess.run([BIN / "tactilectl", *words], stdout=full, stderr=subprocess.PIPE, text=True)
                self.assertEqual(done.returncode, 1, words)
            self.assertEqual(subprocess.run([BIN / "tactiled", "--help"], stdout=full, stderr=subprocess.PIPE).returncode, 74)
            piped = subprocess.run(f"{BIN}/tactilectl read left --follow --node {d.name} | head -n 3", shell=True, capture_output=True, text=True)
            self.assertEqual((piped.returncode, piped.stderr), (0, ""))


if __name__ == "__main__":
    unittest.main(verbosity=2)
