#!/usr/bin/env python3
"""A hostile local user beside the release programs: forged segments before, between and during runs, and control sockets. Run as root
it acts as a second user; the readers are those in C, C++ and Python."""
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import time
import unittest

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
    return subprocess.run([BIN / "tactilectl", *map(str, words)], capture_output=True, text=True, timeout=60,
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
        wait_for(quality_is(d, "good"), "a good sample")
        forgery = self.forgery()
        self.assertIn(FORGED, forgery)
        d.stop()
        seen = []
        for phase in ("before", "during", "between", "during"):
            self.forge(forgery)
            if phase == "during":
                d.start()
                wait_for(quality_is(d, "good"), "a good sample")
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
        wait_for(quality_is(d, "good"), "a good sample")
        with open(d.folder / "out.csv", "w+") as out, tactiled.open(d.name) as node:
            reader = subprocess.Popen([BIN / "tactilectl", "read", "left", "--follow", "--csv", "--timeout", "0", "--node", d.name], stdout=out)
            self.addCleanup(reader.wait)
            self.addCleanup(reader.kill)
            wait_for(lambda: os.stat(out.name).st_size > 200, "rows")
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
                wait_for(lambda: node.latest("left").quality == tactiled.GOOD, "a value")
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

    def test_reads_registers_on_the_loopback_address_unless_allow_excludes_it(self):
        d = self.daemon
        for allow in ("", 'allow = ["192.0.2.0/24"]\n'):
            d.config.write_text(d.config.read_text().replace("[modbus]\n", "[modbus]\n" + allow))
            d.start()

            def read():
                with socket.create_connection(("127.0.0.1", d.port), 5) as s:
                    s.settimeout(5)
                    s.sendall(bytes((0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 2)))
                    if len(s.recv(64)) != 13:
                        raise ConnectionError("no answer")
            self.assertEqual(as_stranger(read), allow == "")
            d.stop()

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
        wait_for(lambda: path.exists() and path.stat().st_mode & 0o777 == 0o777, "the squatter")
        time.sleep(0.1)

    def test_a_program_at_the_path_of_the_control_socket_confirms_no_command(self):
        d = self.daemon
        self.assertFalse(as_stranger(lambda: socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET).bind(str(run_folder() / f"{d.name}.sock"))))
        path = pathlib.Path(f"/tmp/tactiled-{d.name}.sock")
        d.config.write_text(d.config.read_text().replace(f"{d.folder}/control.sock", str(path)))
        self.occupy(path, listens=True)
        for _ in range(2):  # before a run, and between two
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
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
            wait_for(quality_is(d, "good"), "a good sample")
            self.assertNotEqual(d.ctl("tare", "left").returncode, 0)
            d.stop()
            self.assertEqual((victim.read_text(), victim.stat().st_mode & 0o777), ("of root", 0o600))
            (path.rmdir if path.is_dir() and not path.is_symlink() else path.unlink)()
        self.occupy(path, listens=False)  # its program has ended, or does not listen
        d.start()
        wait_for(quality_is(d, "good"), "a good sample")
        self.assertEqual(d.ctl("tare", "left").returncode, 0)

    def test_a_group_member_reads_and_does_no_more(self):
        d = self.daemon
        d.start()
        wait_for(quality_is(d, "good"), "a good sample")
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
            wait_for(lambda: "Modbus" in d.log() or d.process.poll() is not None, "the start")
            self.assertIsNone(d.process.poll(), d.log())
            self.assertTrue(segment.exists())
            self.assertTrue((session / "tactiled" / f"{d.name}.sock").exists())  # the default moves along

            def status():
                return subprocess.run([*user, BIN / "tactilectl", "status", "--node", d.name], capture_output=True, text=True, env=d.env)
            wait_for(lambda: status().returncode == 0, "a good sample")
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
            done = subprocess.run(words, capture_output=True, text=True, env=env, timeout=60)
            self.assertEqual(done.returncode, 69)
            self.assertIn("--runtime-dir", done.stderr)
            self.assertIn("export TACTILED_RUNTIME_DIR=$HOME/.tactiled", done.stderr)
            done = subprocess.run([*words, "--runtime-dir", "/tmp"], capture_output=True, text=True, env=env, timeout=60)
            self.assertEqual(done.returncode, 69)
            self.assertIn("/tmp: not a trusted folder", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
