"""tactilectl doctor on machines that are folders: a machine without faults, and one for each possible fault."""
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

from daemon import BIN, ROOT, Daemon
from map_test import CONFIG as RUNNING

CONFIG = """
[realtime]
priority = 80
cpu = 2

[[link]]
name = "usb0"
driver = "uart"
device = "/dev/serial/by-id/usb-one"
format = "cobs"

[[link]]
name = "bus"
driver = "can"
interface = "can0"
[[link.device]]
device = 0
id = 0x123
signals = [{name = "R1", start = 0, length = 16, order = "intel", type = "signed"}]

[[link]]
name = "skin"
driver = "udp"
address = "192.168.1.30:5000"
taxels = 1024
values = 3

[[sensor]]
name = "left"
link = "usb0"
model = "table"
calibration = "{calibration}"
rate_Hz = 100
frozen_after = 100
expect_serial = "documents"
temperature_range_C = [20, 25]

[modbus]
listen = "127.0.0.1:1502"

[shm]
group = "tactile"
""".replace("{calibration}", str(ROOT / "config/calibration/table_documents.toml"))
CPU = "sys/devices/system/cpu"
CLOCK = "sys/devices/system/clocksource/clocksource0/current_clocksource"
TIMER = "sys/bus/usb-serial/devices/ttyUSB0/latency_timer"
SOUND = {
    "etc/passwd": "root:x:0:0::/root:/bin/sh\ntactiled:x:990:991::/:/usr/sbin/nologin\n",
    "etc/group": "root:x:0:\ndialout:x:20:tactiled\ntactile:x:991:\n",
    "proc/sys/kernel/osrelease": "6.1.0-56-rt-amd64\n", "proc/sys/kernel/sched_rt_runtime_us": "950000\n", "proc/sys/kernel/sched_rt_period_us": "1000000\n",
    "proc/77/limits": "Limit                     Soft Limit           Hard Limit           Units     \n"
                      "Max locked memory         unlimited            unlimited            bytes     \n"
                      "Max realtime priority     98                   98                   \n",
    "proc/77/status": "Name:\ttactiled\nCapEff:\t0000000000000000\nSeccomp:\t2\n", "proc/77/cgroup": "1:cpu,cpuacct:/\n0::/system.slice/tactiled.service\n",
    "proc/sys/kernel/seccomp/actions_avail": "kill_process kill_thread trap errno user_notif trace log allow\n",
    "proc/77/task/78/comm": "pipeline\n", "proc/77/task/78/stat": "78 (pipe) line) S " + " ".join(["0"] * 36) + " 80 1 0 0 0\n",
    "proc/net/tcp": "  sl  local_address rem_address   st\n   0: 0100007F:0016 00000000:0000 0A\n   1: 0100007F:05DE 0100007F:9999 01\n",
    "sys/kernel/realtime": "1\n", CLOCK: "tsc\n", "run/systemd/timesync/synchronized": "",
    f"{CPU}/online": "0-3\n", f"{CPU}/isolated": "2-3\n", f"{CPU}/nohz_full": "2\n", f"{CPU}/cpu0/cpufreq/scaling_governor": "performance\n",
    f"{CPU}/cpu0/cpuidle/state1/latency": "2\n", f"{CPU}/cpu0/cpuidle/state2/latency": "400\n", f"{CPU}/cpu0/cpuidle/state2/disable": "1\n",
    TIMER: "1\n", "proc/sys/net/core/rmem_max": "1230800\n", "sys/class/net/can0/flags": "0x40041\n", "dev/ttyUSB0": "",
}
# The change (None: file removed), the check that must report it, and its text.
CASES = [
    ({"proc/77/limits": "Max locked memory         unlimited\nMax realtime priority     0  0\n"}, "priority", "wrong"),
    ({"proc/77/limits": "Max locked memory         8388608\nMax realtime priority     98\n"}, "memory", "wrong"),
    ({"proc/77/cgroup": "1:cpu,cpuacct:/slice\n", "sys/fs/cgroup/cpu,cpuacct/slice/cpu.rt_runtime_us": "0\n"}, "rt_group", "wrong"),
    ({"proc/77/task/78/stat": "78 (pipeline) S " + " ".join(["0"] * 36) + " 0 0 0 0 0\n"}, "loop", "wrong"),
    ({"proc/77/status": "Name:\ttactiled\nCapEff:\t0000000000000000\nSeccomp:\t0\n"}, "system_calls", "advice"),
    ({"proc/77/status": "CapEff:\t0000000000000000\n", "proc/sys/kernel/seccomp/actions_avail": None}, "system_calls", "advice"),
    ({"sys/kernel/realtime": None}, "kernel", "advice"),
    ({"proc/sys/kernel/sched_rt_runtime_us": "0\n"}, "rt_throttling", "wrong"),
    ({"proc/sys/kernel/sched_rt_runtime_us": "-1\n"}, "rt_throttling", "advice"),
    ({CLOCK: "hpet\n"}, "clocksource", "wrong"),
    ({"run/systemd/timesync/synchronized": None}, "time", "advice"),
    ({f"{CPU}/cpu0/cpufreq/scaling_governor": "powersave\n"}, "governor", "advice"),
    ({f"{CPU}/cpu0/cpuidle/state2/disable": "0\n"}, "idle", "advice"),
    ({f"{CPU}/online": "0-1\n"}, "cpu", "wrong"),
    ({f"{CPU}/isolated": "\n"}, "cpu", "advice"),
    ({f"{CPU}/nohz_full": "(null)\n"}, "cpu", "advice"),
    ({"dev/ttyUSB0": None}, "device", "wrong"),
    ({"etc/group": "dialout:x:20:\ntactile:x:991:\n"}, "device", "wrong"),
    ({TIMER: "16\n"}, "latency_timer", "wrong"),
    ({"sys/class/net/can0/flags": "0x40040\n"}, "device", "wrong"),
    ({"sys/class/net/can0/flags": None}, "device", "wrong"),
    ({"proc/sys/net/core/rmem_max": "212992\n"}, "socket_buffer", "advice"),
    ({"etc/group": "dialout:x:20:tactiled\n"}, "shm_group", "wrong"),
    ({"etc/passwd": "root:x:0:0::/root:/bin/sh\n"}, "user", "wrong"),
]


@unittest.skipIf(os.geteuid() != 0, "needs root, to give a file of the tree to a group")
class Doctor(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-doctor-"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.config = self.folder / "tactiled.toml"
        self.config.write_text(CONFIG)

    def machine(self, changes=None):
        root = self.folder / f"root{len(list(self.folder.iterdir()))}"
        for name, text in {**SOUND, **(changes or {})}.items():
            if text is None:
                continue
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        (root / "dev/serial/by-id").mkdir(parents=True)
        (root / "dev/serial/by-id/usb-one").symlink_to("../../ttyUSB0")
        if (root / "dev/ttyUSB0").exists():
            os.chown(root / "dev/ttyUSB0", 0, 20)
            (root / "dev/ttyUSB0").chmod(0o660)
        return root

    def doctor(self, root, *words, pid="77"):
        done = subprocess.run([BIN / "tactilectl", "doctor", "--config", self.config, "--root", root, "--user", "tactiled", "--json", *words,
                               *(["--pid", pid] if pid else [])], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.stderr, "")
        return done.returncode, json.loads(done.stdout)

    def test_a_sound_machine_is_good_in_every_check(self):
        status, said = self.doctor(self.machine())
        self.assertEqual([f for f in said["findings"] if f["verdict"] != "good"], [])
        self.assertEqual((status, said["schema"], said["good"]), (0, 1, True))
        self.assertEqual({f["check"] for f in said["findings"]},
                         {check for _, check, _ in CASES if check != "user"} | {"configuration", "freshness", "identity"})

    def test_each_thing_that_is_wrong_is_found_alone_with_a_remedy(self):
        for changes, check, verdict in CASES:
            with self.subTest(check=check, changes=changes):
                status, said = self.doctor(self.machine(changes))
                odd = [(f["check"], f["verdict"]) for f in said["findings"] if f["verdict"] != "good"]
                self.assertEqual(odd, [(check, verdict)])
                self.assertTrue(next(f["remedy"] for f in said["findings"] if f["check"] == check and f["verdict"] != "good"))
                self.assertEqual(status, 1 if verdict == "wrong" else 0)

    def test_a_port_in_use_is_wrong_unless_the_daemon_runs(self):
        taken = self.machine({"proc/net/tcp": "  sl  local_address\n   0: 0100007F:05DE 00000000:0000 0A\n", "proc/self/limits": SOUND["proc/77/limits"],
                              "proc/self/status": SOUND["proc/77/status"]})
        self.assertEqual(self.doctor(taken)[0], 0)
        status, said = self.doctor(taken, pid=None)
        self.assertEqual([f["check"] for f in said["findings"] if f["verdict"] == "wrong"], ["port"])
        self.assertEqual(status, 1)
        self.assertEqual([f["verdict"] for f in said["findings"] if f["check"] == "system_calls"], ["good"])

    def test_an_error_in_the_configuration_is_reported_with_its_line(self):
        self.config.write_text(CONFIG.replace("cpu = 2", "cpus = 2"))
        status, said = self.doctor(self.machine())
        self.assertEqual(status, 1)
        self.assertIn("tactiled.toml:4", next(f["says"] for f in said["findings"] if f["check"] == "configuration"))

    def test_it_finds_the_daemon_that_runs_here(self):
        with Daemon(RUNNING) as daemon:
            daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", daemon.folder / "table", "--format", "cobs", "--bits", "32",
                        "--counts-per-unit", "1e9", "--loop")
            daemon.start()
            done = subprocess.run([BIN / "tactilectl", "doctor", "--config", daemon.config], capture_output=True, text=True, timeout=60)
            self.assertRegex(done.stdout, r"loop +the daemon's loop")
            self.assertRegex(done.stdout, r"good +system_calls +the daemon's system calls are filtered")
            self.assertNotIn("port ", done.stdout)
            self.assertRegex(done.stdout, r"good +device .*/table is there")


if __name__ == "__main__":
    unittest.main(verbosity=2)
