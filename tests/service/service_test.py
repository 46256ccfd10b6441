#!/usr/bin/env python3
"""The unit as the package installs it, under a real systemd: process 1 of namespaces over a fresh Debian.

    cmake --build --preset release --target service_tools && /usr/bin/python3 tests/service/service_test.py

Needs root, debootstrap, and once the network. Skips where it cannot run, and says why; TACTILED_MUST=1: fails instead."""
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import threading
import time
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "package"))
from package_test import ROOT, TREES, cannot, deb, dependencies, make_tree  # noqa: E402

HERE = pathlib.Path(__file__).parent
BIN = ROOT / "build/release/bin"
WATCHDOG_S = 2.0
CONFIG = """
[node]
name = "gripper"
stuck_link_ms = 300

[[link]]
name = "scene"
driver = "sim"
scene = "/usr/share/tactiled/scenes/press_ramp.toml"
at_end = "again"

[[sensor]]
name = "left"
link = "scene"
model = "generic"
calibration = "/etc/tactiled/good.toml"
"""
# Computes one force from the scene's eight gauges: only its quality matters here.
CALIBRATION = """format = 1
model = "generic"
method = "matrix"
contact_model = "unknown"
date = "2026-01-01"
channels = ["R1", "R2", "R3", "R4", "R5", "R6", "R7", "R8"]
channel_unit = "dR/R0"
zero = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
components = ["fz"]
matrix = [[-1.0, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0, 0.0]]
sd = [0.01]
full_scale = [10.0]
"""
# This machine may lack the right to raise limits: then the unit gets its rights as capabilities, and nothing else changes.
LIMITS = """[Service]
LimitRTPRIO=
LimitMEMLOCK=
OOMScoreAdjust=
CapabilityBoundingSet=CAP_SYS_NICE CAP_IPC_LOCK
AmbientCapabilities=CAP_SYS_NICE CAP_IPC_LOCK
"""


class Machine:
    """A booted systemd; commands run in it by nsenter."""

    def __init__(self, tree):
        self.tree = tree
        self.boot = subprocess.Popen([HERE / "boot.sh", tree.path], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        self.pid1 = None
        for _ in range(300):
            children = pathlib.Path(f"/proc/{self.boot.pid}/task/{self.boot.pid}/children").read_text().split()
            if children and pathlib.Path(f"/proc/{children[0]}/comm").read_text() == "systemd\n":
                self.pid1 = children[0]
                if self.run("systemctl", "is-system-running", "--wait", status=None).strip() in ("running", "degraded"):
                    return
            time.sleep(0.1)
        raise RuntimeError(f"systemd did not start: {self.boot.stderr.read() if self.boot.poll() else ''}")

    def words(self, *words):
        return ["nsenter", "--target", self.pid1, "--all", "env", "-i", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", *map(str, words)]

    def run(self, *words, status=0):
        done = subprocess.run(self.words(*words), capture_output=True, text=True, timeout=60)
        assert status is None or done.returncode == status, f"{words}: {done.returncode}\n{done.stdout}{done.stderr}{self.journal()}"
        return done.stdout + done.stderr

    def journal(self):
        return subprocess.run(self.words("journalctl", "-u", "tactiled", "-n", "40", "--no-pager"), capture_output=True, text=True).stdout

    def show(self, what):
        return self.run("systemctl", "show", "-P", what, "tactiled").strip()

    def host_pid(self):
        """The daemon's number outside, by its number inside."""
        inside = self.show("MainPID")
        for status in pathlib.Path("/proc").glob("[0-9]*/status"):
            try:
                found = re.search(r"^NSpid:\s+(\d+)\s+(\d+)$", status.read_text(), re.M)
                if found and found.group(2) == inside and os.readlink(status.parent / "ns/pid") == os.readlink(f"/proc/{self.pid1}/ns/pid"):
                    return int(found.group(1))
            except OSError:
                pass
        raise AssertionError("no daemon")

    def threads(self, name):
        return [int(t.name) for t in pathlib.Path(f"/proc/{self.host_pid()}/task").iterdir() if (t / "comm").read_text().strip() == name]

    def end(self):
        subprocess.run(["kill", "-9", self.pid1])
        self.boot.wait()


class Follower:
    """A reader in the machine that follows the sensor through every restart; each line has the time of its arrival."""

    def __init__(self, machine):
        self.process = subprocess.Popen(machine.words("stdbuf", "-oL", "tactilectl", "read", "left", "--follow", "--json", "--timeout", "0"),
                                        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, start_new_session=True)
        self.samples = []
        self.taking = threading.Thread(target=self.take, daemon=True)
        self.taking.start()

    def take(self):
        for line in self.process.stdout:
            self.samples.append((time.monotonic(), json.loads(line)["quality"]))

    def good_after(self, since, seconds=10):
        """Seconds from `since` to the first GOOD sample after one that was BAD."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            seen = [s for s in self.samples if s[0] > since]
            bad = next((i for i, s in enumerate(seen) if s[1].startswith("bad")), None)
            good = next((s for s in seen[bad:] if s[1] == "good"), None) if bad is not None else None
            if good:
                return good[0] - since
            time.sleep(0.01)
        raise AssertionError(f"never GOOD again: {self.samples[-5:]}")

    def end(self):
        os.killpg(self.process.pid, 9)  # nsenter, and the program in the machine
        self.process.wait()
        self.taking.join()
        self.process.stdout.close()


class Service(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        TREES.mkdir(parents=True, exist_ok=True)
        of_web = [name for name in dependencies("tactiled-web") if name != "tactiled"]
        cls.tree = tree = make_tree(cls(), "service", ",".join([*dependencies("tactiled"), *of_web, "systemd-sysv"]))
        tree.run("dpkg", "-i", *("/srv/deb/" + deb(name).name for name in ("tactiled", "tactiled-web")))
        (tree.path / "etc/tactiled/tactiled.toml").write_text(CONFIG)
        (tree.path / "etc/tactiled/good.toml").write_text(CALIBRATION)
        (tree.path / "home/secret").write_text("of the administrator\n")
        (tree.path / "usr/lib/sandbox-probe").write_bytes((BIN / "sandbox_probe").read_bytes())
        (tree.path / "usr/lib/sandbox-probe").chmod(0o755)
        if resource.getrlimit(resource.RLIMIT_RTPRIO)[1] < 98:
            drop_in = tree.path / "etc/systemd/system/tactiled.service.d"
            drop_in.mkdir(parents=True)
            (drop_in / "limits.conf").write_text(LIMITS)
        cls.machine = Machine(tree)

    @classmethod
    def tearDownClass(cls):
        cls.machine.end()

    def setUp(self):
        self.machine.run("systemctl", "reset-failed", "tactiled", status=None)
        self.machine.run("systemctl", "start", "tactiled")
        self.follower = Follower(self.machine)
        self.addCleanup(self.follower.end)
        until = time.monotonic() + 10
        while not any(s[1] == "good" for s in self.follower.samples):
            self.assertLess(time.monotonic(), until, self.machine.journal())
            time.sleep(0.01)

    def test_it_is_ready_and_real_time(self):
        self.assertEqual(self.machine.show("ActiveState"), "active")
        self.assertEqual(self.machine.show("NRestarts"), "0")
        self.assertNotIn("RT_DEGRADED", self.machine.run("tactilectl", "status"), self.machine.journal())

    def test_it_has_no_group_but_its_own_and_those_of_its_devices(self):
        status = pathlib.Path(f"/proc/{self.machine.host_pid()}/status").read_text()
        table = dict(reversed(line.split(":")[:3:2]) for line in (self.tree.path / "etc/group").read_text().splitlines())
        self.assertEqual({table[g] for g in re.search(r"^Groups:(.*)$", status, re.M).group(1).split()}, {"tactile", "dialout", "i2c", "gpio"})
        self.assertEqual(len(set(re.search(r"^Uid:(.*)$", status, re.M).group(1).split())), 1)
        self.assertNotIn("Uid:\t0", status)

    def ask_page(self, request):
        """The answer of tactiled-web, asked from within the machine by bash alone."""
        return self.machine.run("bash", "-c", f"exec 3<>/dev/tcp/127.0.0.1/8080; printf '{request}\\r\\nHost: localhost\\r\\nConnection: close\\r\\n\\r\\n' >&3; cat <&3", status=None)

    def test_the_page_runs_beside_it_as_a_user_of_its_own_and_may_not_command(self):
        self.assertEqual(self.machine.run("systemctl", "is-active", "tactiled-web", status=3).strip(), "inactive")  # until
                                                                                                                    # a
                                                                                                                    # client
                                                                                                                    # connects
        self.machine.run("systemctl", "start", "tactiled-web")
        self.addCleanup(self.machine.run, "systemctl", "stop", "tactiled-web")
        until = time.monotonic() + 10
        while '"alive": true' not in (answer := self.ask_page("GET /api/status HTTP/1.1")):
            self.assertLess(time.monotonic(), until, answer + self.machine.run("journalctl", "-u", "tactiled-web", "-n", "20", "--no-pager"))
            time.sleep(0.1)
        self.assertIn('"quality": "good', answer)
        uid = int(self.machine.run("bash", "-c", "stat -c %u /proc/$(systemctl show -P MainPID tactiled-web)"))
        self.assertIn(uid, range(61184, 65520), "one that systemd has made for it")
        self.assertIn("commands are off", self.ask_page("POST /api/command HTTP/1.1"))
        os.kill(self.machine.host_pid(), 9)  # the daemon: the page outlives it
        time.sleep(2)
        self.assertIn('"alive": true', self.ask_page("GET /api/status HTTP/1.1"))
        self.assertEqual(self.machine.run("systemctl", "show", "-P", "NRestarts", "tactiled-web").strip(), "0")

    def test_killed_it_is_good_again_within_half_a_second(self):
        taken = []
        for _ in range(5):
            time.sleep(0.5)
            since = time.monotonic()
            os.kill(self.machine.host_pid(), 9)
            taken.append(self.follower.good_after(since))
        print(f"\nSIGKILL to GOOD, s: {' '.join(f'{t:.3f}' for t in taken)}")
        self.assertLessEqual(max(taken), 0.5)

    def stall(self, thread):
        tool = subprocess.Popen([BIN / "stall", str(self.machine.threads(thread)[0])], stdout=subprocess.PIPE, text=True)
        self.assertEqual(tool.stdout.readline(), "stopped\n")
        since = time.monotonic()
        taken = self.follower.good_after(since)
        self.assertEqual(tool.wait(timeout=5), 0)
        tool.stdout.close()
        print(f"\n{thread} hangs to GOOD, s: {taken:.3f}")
        return taken

    def test_a_pipeline_that_hangs_is_restarted_by_the_watchdog(self):
        taken = self.stall("pipeline")
        self.assertGreater(taken, WATCHDOG_S * 0.9, "that was not the watchdog")
        self.assertLessEqual(taken, WATCHDOG_S + 0.5)
        self.assertIn("the pipeline: does not respond", self.machine.journal())

    def test_a_link_that_hangs_is_restarted_after_its_own_limit(self):
        taken = self.stall("link")
        self.assertGreater(taken, WATCHDOG_S * 0.9 + 0.3)
        self.assertLessEqual(taken, WATCHDOG_S + 0.3 + 0.5)
        self.assertIn('link "scene": does not respond', self.machine.journal())

    def test_it_ends_within_a_second(self):
        began = time.monotonic()
        self.machine.run("systemctl", "stop", "tactiled")
        taken = time.monotonic() - began
        print(f"\nsystemctl stop, s: {taken:.3f}")
        self.assertLess(taken, 1)
        self.assertEqual(self.machine.show("Result"), "success")
        for folder in ("dev/shm", "run"):
            self.assertEqual(list((self.tree.path / f"/proc/{self.machine.pid1}/root/{folder}").glob("*tactiled*")), [])

    def test_a_wrong_configuration_is_no_loop(self):
        path = self.tree.path / "etc/tactiled/tactiled.toml"
        self.machine.run("systemctl", "stop", "tactiled")
        path.write_text("[node]\nnam = 1\n")
        try:
            self.machine.run("systemctl", "start", "tactiled", status=1)
            time.sleep(1)
            self.assertEqual((self.machine.show("NRestarts"), self.machine.show("ExecMainStatus")), ("0", "78"))
        finally:
            path.write_text(CONFIG)

    def test_a_reload_keeps_the_daemon_also_with_a_wrong_file(self):
        path, pid = self.tree.path / "etc/tactiled/tactiled.toml", self.machine.show("MainPID")
        try:
            path.write_text(CONFIG + "stale_ms = 200\n")
            self.machine.run("systemctl", "reload", "tactiled")
            path.write_text("[node]\nnam = 1\n")
            self.machine.run("systemctl", "reload", "tactiled")  # says that it was sent; the file, the log
            time.sleep(0.5)
            self.assertIn("did you mean \"name\"", self.machine.journal())
        finally:
            path.write_text(CONFIG)
        self.assertEqual((self.machine.show("MainPID"), self.machine.show("ActiveState")), (pid, "active"))

    def test_a_crash_loop_ends(self):
        until = time.monotonic() + 25
        while self.machine.show("ActiveState") != "failed" and time.monotonic() < until:
            try:
                os.kill(self.machine.host_pid(), 9)
            except AssertionError:  # between two daemons
                time.sleep(0.02)
        self.assertIn("repeated too quickly", self.machine.journal())
        self.assertLessEqual(int(self.machine.show("NRestarts")), 11)  # the limit is StartLimitBurst=10, plus the
                                                                       # refused one

    def probe(self, *words):
        lines = self.machine.run(*words).splitlines()
        return {line.split()[0]: line.split(maxsplit=1)[1] for line in lines if re.match(r"\w+ (ok|refused)", line)}

    def test_what_a_taken_over_daemon_would_do_is_refused_and_what_it_needs_is_not(self):
        drop_in = pathlib.Path(f"/proc/{self.machine.pid1}/root/run/systemd/system/tactiled.service.d")
        drop_in.mkdir(parents=True)
        out = "/run/probe.txt"
        (drop_in / "probe.conf").write_text(f"[Service]\nType=oneshot\nWatchdogSec=0\nRestart=no\nExecStart=\nExecStart=/usr/lib/sandbox-probe\n"
                                            f"StandardOutput=truncate:{out}\n")
        self.machine.run("systemctl", "stop", "tactiled")
        try:
            self.machine.run("systemctl", "daemon-reload")
            self.machine.run("systemctl", "start", "tactiled")
            inside = self.probe("cat", out)
        finally:
            (drop_in / "probe.conf").unlink()
            self.machine.run("systemctl", "daemon-reload")
        outside = self.probe("/usr/lib/sandbox-probe")  # root, without the unit: each try can succeed
        needs = {name for name in inside if name.startswith("need_")}
        forbidden = set(inside) - needs
        could = {name for name in forbidden if outside[name] == "ok"}
        for name in sorted(inside):
            print(f"\n{name:35} {inside[name]:45} (without the unit: {outside[name]})", end="")
        print(f"\n{len(forbidden)} tries, {len(could)} of them possible here without the unit")
        self.assertEqual({n: inside[n] for n in forbidden if inside[n] == "ok"}, {})
        self.assertEqual({n: inside[n] for n in needs if inside[n] != "ok"}, {})
        self.assertGreaterEqual(len(could), 11)

    def test_the_exposure_is_1_7_at_most(self):
        for unit in (ROOT / "systemd/tactiled.service", ROOT / "systemd/tactiled-web.service"):
            done = subprocess.run(["systemd-analyze", "security", "--offline=true", "--threshold=17", "--no-pager", unit],
                                  capture_output=True, text=True)
            print("\n" + done.stdout.splitlines()[-1])
            self.assertEqual(done.returncode, 0, done.stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
