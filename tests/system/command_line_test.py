#!/usr/bin/env python3
"""The command line of tactilectl: words in any order, misspelt words, pipes that end, a dead daemon, and completion."""
import json
import os
import pathlib
import pty
import re
import select
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import unittest

from daemon import BIN, ROOT, Daemon, run_folder, wait_for
from unit_daemon import CALIBRATION, CONFIG, play, quality_is, unit_daemon

VERBS = ["status", "top", "read", "record", "replay", "tare", "clear", "weigh", "teach", "tool-fit", "grasp-check", "map", "check", "completion", "doctor",
         "calibrate", "capture", "decouple", "identify", "play", "simulate", "tradeoff"]


def ctl(*words, **kinds):
    return subprocess.run([BIN / "tactilectl", *map(str, words)], capture_output=True, text=True, timeout=60, **kinds)


class Words(unittest.TestCase):
    def test_help_is_a_verb(self):
        self.assertEqual(ctl("help").stdout, ctl("--help").stdout)
        self.assertEqual(ctl("help", "read").stdout, ctl("read", "--help").stdout)
        self.assertEqual(ctl("help", "calibrate").stdout, ctl("calibrate", "--help").stdout)
        self.assertEqual(ctl("help").returncode, 0)

    def test_a_misspelt_verb_names_the_nearest_one(self):
        for wrong, meant in (("raed", "read"), ("staus", "status"), ("calibarte", "calibrate"), ("identfy", "identify"), ("Tare", "tare")):
            done = ctl(wrong)
            self.assertEqual((done.returncode, done.stdout), (2, ""), wrong)
            self.assertIn(f'did you mean "{meant}"?', done.stderr)
        done = ctl("weigh", "knwon", "0.2")
        self.assertEqual(done.returncode, 2)
        self.assertIn('did you mean "known"?', done.stderr)
        self.assertIn("tactilectl help lists the verbs", ctl("xyzzy").stderr)
        self.assertEqual(ctl().returncode, 2)
        self.assertIn("no verb is given", ctl().stderr)

    def test_every_verb_has_its_exit_statuses_in_its_help(self):
        for verb in VERBS:
            text = ctl(verb, "--help").stdout
            self.assertIn("Exit status: 0 good, 1 unhealthy or failed, 2 wrong arguments or files, 3 no daemon", text, verb)
        for verb in ("read", "record", "replay", "weigh", "calibrate", "capture", "identify"):
            self.assertIn("Examples:\n", ctl(verb, "--help").stdout, verb)

    def test_version_names_commit_and_libraries(self):
        for program in ("tactilectl", "tactiled"):
            text = subprocess.run([BIN / program, "--version"], capture_output=True, text=True, check=True).stdout
            self.assertRegex(text, r"(?m)^0\.\d+\.\d+$")
            self.assertRegex(text, r"(?m)^commit (unknown|[0-9a-f]{7,40}(-dirty)?)$")
            for library in ("fmt", "CLI11", "nlohmann_json", "Eigen3", "Boost", "glibc", "libmodbus", "libgpiod", "libsystemd"):
                self.assertRegex(text, library + r" \d+(\.\d+)*")
        if shutil.which("git") and subprocess.run(["git", "-C", ROOT, "rev-parse"], capture_output=True).returncode == 0:
            self.assertNotIn("commit unknown", text)

    def test_a_pipe_that_ends_needs_no_message(self):
        for words in (("map",), ("map", "--format", "csv"), ("check", "--keys"), ("help",)):
            done = subprocess.run(f"{BIN}/tactilectl {' '.join(words)} | head -n 1", shell=True, capture_output=True, text=True)
            self.assertEqual(done.stderr, "", words)
            self.assertEqual(done.stdout.count("\n"), 1)


class WithDaemon(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemon = unit_daemon()
        cls.addClassCleanup(cls.daemon.__exit__)
        cls.daemon.start()
        wait_for(quality_is(cls.daemon, "good"), 5, "a good sample")

    def test_options_stand_before_the_verb_or_after_it(self):
        name = self.daemon.name
        for words in (("--node", name, "read", "left"), (f"--node={name}", "read", "left"), ("read", "--node", name, "left"),
                      ("read", "left", "--node", name), ("--node", name, "--json", "status"), ("--json", "--node", name, "read", "left")):
            self.assertEqual(ctl(*words).returncode, 0, words)
        # A node may have the name of a verb.
        self.assertEqual(ctl("--node", "read", "status").returncode, 3)
        for words in (("weigh", "--node", name, "zero"), ("weigh", "zero", "--node", name), ("--node", name, "weigh", "zero")):
            done = ctl(*words)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("there is no [grasp]", done.stderr)

    def test_colour_is_for_a_terminal_and_no_color_is_respected(self):
        def on_terminal(**variables):
            master, slave = pty.openpty()
            env = {**os.environ, "TERM": "xterm", **variables}
            process = subprocess.Popen([BIN / "tactilectl", "status", "--node", self.daemon.name], stdout=slave, stderr=slave, env=env)
            os.close(slave)
            text = b""
            try:
                while piece := os.read(master, 65536):
                    text += piece
            except OSError:
                pass
            process.wait(10)
            os.close(master)
            return text.decode()
        self.assertIn("\x1b[32mgood", on_terminal())
        self.assertNotIn("\x1b[", on_terminal(NO_COLOR="1"))
        self.assertNotIn("\x1b[", on_terminal(TERM="dumb"))
        self.assertNotIn("\x1b[", self.daemon.ctl("status").stdout)

    def test_without_a_grasp_no_line_of_it(self):
        self.assertNotIn("grasp", self.daemon.ctl("status").stdout)
        self.assertNotIn("recommended", self.daemon.ctl("top", "--count", "1").stdout)

    def test_completion_of_bash_knows_verbs_options_and_sensors(self):
        def complete(*words):
            script = f'''source <("{BIN}/tactilectl" completion bash)
PATH={BIN}:$PATH
COMP_WORDS=({' '.join(words)} ''); [ "{words[-1]}" = . ] && COMP_WORDS=({' '.join(words[:-1])} "")
COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 ))
_tactilectl; printf '%s\\n' "${{COMPREPLY[@]}}"'''
            env = {**os.environ, "TACTILED_RUNTIME_DIR": str(run_folder())}
            return subprocess.run(["bash", "-c", script], capture_output=True, text=True, env=env).stdout.split()
        self.assertEqual(sorted(complete("tactilectl")), sorted(VERBS + ["help"]))
        # A partly typed word is the last of COMP_WORDS.
        script = f'''source <("{BIN}/tactilectl" completion bash); PATH={BIN}:$PATH
for words in "tactilectl cal" "tactilectl read --fo" "tactilectl weigh kn" "tactilectl help ide"; do
COMP_WORDS=($words); COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 )); _tactilectl; echo "${{COMPREPLY[@]}}"; done'''
        done = subprocess.run(["bash", "-c", script], capture_output=True, text=True)
        self.assertEqual(done.stdout.split("\n")[:4], ["calibrate", "--follow", "known", "identify"], done.stderr)

    @unittest.skipUnless(shutil.which("zsh"), "there is no zsh")
    def test_completion_of_zsh(self):
        pid, terminal = pty.fork()
        if pid == 0:
            os.environ.update(PATH=f"{BIN}:{os.environ['PATH']}", TERM="dumb", ZDOTDIR="/nowhere")
            os.execvp("zsh", ["zsh", "-f", "-i"])
        self.addCleanup(os.waitpid, pid, 0)
        self.addCleanup(os.close, terminal)  # zsh ends with it

        def seen(typed, expected):
            os.write(terminal, typed.encode())
            text, until = "", time.monotonic() + 20
            while expected not in text:
                self.assertLess(time.monotonic(), until, text)
                if select.select([terminal], [], [], 0.1)[0]:
                    text += os.read(terminal, 65536).decode()
        seen("source <(tactilectl completion zsh); echo is-$((1 + 1))-there\n", "is-2-there")
        for word, whole in (("tactilectl cal", "calibrate "), ("tactilectl read --fo", "--follow "), ("tactilectl weigh kn", "known ")):
            seen(word + "\t", whole)
            os.write(terminal, b"\x15")  # deletes the line

    def test_an_occupied_port_is_not_announced_as_served(self):
        with socket.socket() as taken, unit_daemon(rate=None) as d:
            taken.bind(("127.0.0.1", d.port))
            taken.listen()
            d.start()
            wait_for(lambda: "not served yet" in d.log(), 5, "the word")
            line = [line for line in d.log().splitlines() if "node \"" in line][0]
            self.assertIn(f"Modbus 127.0.0.1:{d.port} not served yet", line)
        self.assertNotIn("not served", self.daemon.log())


class Faults(unittest.TestCase):
    def test_faults_and_warnings_are_words(self):
        with unit_daemon() as d:
            d.start()
            wait_for(quality_is(d, "good"), 5, "a good sample")
            self.assertEqual(json.loads(d.ctl("status", "--json").stdout)["fault"], [])
            d.others[0].send_signal(signal.SIGKILL)
            wait_for(quality_is(d, "bad"), 5, "BAD")
            wait_for(lambda: json.loads(d.ctl("status", "--json").stdout)["fault"], 5, "a fault")
            self.assertIn("SENSOR_LOST", json.loads(d.ctl("status", "--json").stdout)["fault"])
            self.assertIn("FAULT  sensor lost", d.ctl("status").stdout)
            self.assertIn("sensor lost", d.ctl("top", "--count", "1").stdout)


    def test_a_coarse_sensor_at_rest_is_told_what_to_write(self):
        with unit_daemon(config=CONFIG.replace("frozen_after = 0", "frozen_after = 20")) as d:
            d.start()
            wait_for(lambda: ":frozen" in d.ctl("status").stdout, 5, "the frozen channels")
            self.assertIn("left: a channel repeats one number", d.ctl("status").stdout)
            self.assertIn("needs frozen_after = 0", d.ctl("status").stdout)

    def test_a_tare_that_is_refused_for_the_age_names_the_line_to_write(self):
        config = CONFIG.replace('path = "direct"\n', "").replace("sequence = true\n", "")
        with unit_daemon(config=config, rate=None) as d:
            d.play("--in", d.folder / "rows.csv", "--pty", d.folder / "dev", "--format", "lines", "--rate", 200, "--loop")
            self.assertIn("-> accept_unproved_age = true", ctl("check", d.config).stdout)
            d.start()
            wait_for(quality_is(d, "good"), 5, "a good sample")
            done = d.ctl("tare", "left")
            self.assertEqual(done.returncode, 1)
            self.assertIn("left is good:arrival-only", done.stderr)
            self.assertIn("accept_unproved_age = true", done.stderr)
            d.config.write_text(d.config.read_text().replace("stale_ms", "accept_unproved_age = true\nstale_ms"))
            self.assertNotIn("accept_unproved_age", ctl("check", d.config).stdout)

    def test_a_missing_control_socket_is_named_by_status_and_doctor(self):
        with unit_daemon() as d:
            d.config.write_text(re.sub('control = ".*"', 'control = "/proc/nowhere/control.sock"', d.config.read_text()))
            d.start()
            wait_for(quality_is(d, "good"), 5, "a good sample")
            self.assertIn("there is no control socket: ", d.ctl("status").stdout)
            self.assertIn("/proc/nowhere/control.sock", d.log())
            found = json.loads(ctl("doctor", "--json", "--config", d.config).stdout)["findings"]
            self.assertEqual([f["verdict"] for f in found if f["check"] == "control"], ["wrong"])


class DeadDaemon(unittest.TestCase):
    def setUp(self):
        self.daemon = unit_daemon()
        self.addCleanup(self.daemon.__exit__)
        self.daemon.start()
        wait_for(quality_is(self.daemon, "good"), 5, "a good sample")
        self.recorder = subprocess.Popen([BIN / "tactilectl", "record", self.daemon.folder / "a.mcap", "--node", self.daemon.name],
                                         stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(self.recorder.communicate)  # after kill(): cleanups run from the last to the first
        self.addCleanup(self.recorder.kill)
        wait_for((self.daemon.folder / "a.mcap").exists, 5, "the recording")
        self.daemon.process.send_signal(signal.SIGKILL)
        self.daemon.process.wait()
        time.sleep(0.5)

    def test_every_reader_says_that_it_is_dead(self):
        pid = str(self.daemon.process.pid)
        for words in (("status",), ("read", "left"), ("top", "--count", "1")):
            done = self.daemon.ctl(*words)
            self.assertEqual(done.returncode, 3, (words, done))
            self.assertIn("is dead", done.stdout + done.stderr)
            self.assertIn(f"there is no process {pid}", done.stdout + done.stderr)
        self.assertNotIn(", open)", self.daemon.ctl("status").stdout)
        self.assertEqual(json.loads(self.daemon.ctl("status", "--json").stdout)["daemon"], "dead")
        self.assertFalse(json.loads(self.daemon.ctl("status", "--json").stdout)["links"][0]["open"])
        self.recorder.wait(10)  # the recorder was running when the daemon died
        error = self.recorder.stderr.read()
        self.assertEqual(self.recorder.returncode, 3)
        self.assertIn("is dead", error)
        done = ctl("record", self.daemon.folder / "b.mcap", "--node", self.daemon.name, "--seconds", "1")
        self.assertEqual(done.returncode, 3)
        self.assertFalse((self.daemon.folder / "b.mcap").exists())

    def test_a_killed_daemon_whose_parent_has_not_waited_for_it_is_dead(self):
        """A supervisor or a shell may leave the ended process as a zombie, which has a number and a name in /proc."""
        with unit_daemon() as d:
            d.start()
            wait_for(quality_is(d, "good"), 5, "a good sample")
            os.kill(d.process.pid, signal.SIGKILL)  # Popen.send_signal() would wait for an ended process
            stat = pathlib.Path(f"/proc/{d.process.pid}/stat")
            wait_for(lambda: "(tactiled) Z" in stat.read_text(), 5, "the zombie")
            time.sleep(0.5)
            for words in (("status",), ("read", "left"), ("top", "--count", "1")):
                done = d.ctl(*words)
                self.assertEqual(done.returncode, 3, (words, done))
                self.assertIn("is dead", done.stdout + done.stderr)
                self.assertNotIn("it hangs or was stopped", done.stdout + done.stderr)
            self.assertEqual(json.loads(d.ctl("status", "--json").stdout)["daemon"], "dead")
            findings = json.loads(ctl("doctor", "--json", "--config", d.config).stdout)["findings"]
            said = [(f["verdict"], f["says"]) for f in findings if f["check"] == "daemon"]
            self.assertEqual([verdict for verdict, _ in said], ["wrong"])
            self.assertIn("is dead", said[0][1])
            self.assertIn("(tactiled) Z", stat.read_text())  # it was a zombie until the end

    def test_a_stopped_daemon_hangs_and_is_not_dead(self):
        with unit_daemon() as d:
            d.start()
            wait_for(quality_is(d, "good"), 5, "a good sample")
            d.process.send_signal(signal.SIGSTOP)
            time.sleep(0.5)
            done = d.ctl("status")
            d.process.send_signal(signal.SIGCONT)
            self.assertEqual(done.returncode, 1)
            self.assertIn("it hangs or was stopped", done.stderr)


class Recording(unittest.TestCase):
    def test_replay_takes_configuration_and_calibration_from_the_file(self):
        config = CONFIG.replace("{folder}/unit.toml", "unit.toml")
        with unit_daemon(config=config) as d:
            d.start()
            wait_for(quality_is(d, "good"), 5, "a good sample")
            file = d.folder / "a.mcap"
            done = ctl("record", file, "--node", d.name, "--seconds", "1")
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            moved = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-test-"))
            self.addCleanup(shutil.rmtree, moved)
            shutil.copy(file, moved / "b.mcap")
            d.stop()
            (d.folder / "unit.toml").unlink()
            done = ctl("replay", moved / "b.mcap", "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            sensor = json.loads(done.stdout)["sensors"][0]
            self.assertGreater(sensor["compared"], 50)
            self.assertEqual(sensor["equal"], sensor["compared"])

    def test_another_configuration_than_that_in_force_is_named(self):
        with unit_daemon() as d:
            d.start()
            wait_for(quality_is(d, "good"), 5, "a good sample")
            d.config.write_text(d.config.read_text() + "# changed after the start\n")
            done = ctl("record", d.folder / "a.mcap", "--node", d.name, "--seconds", "0.3")
            self.assertIn("was changed since the daemon read it", done.stderr)


class Check(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-test-"))
        self.addCleanup(shutil.rmtree, self.folder)
        (self.folder / "unit.toml").write_text(CALIBRATION)

    def check(self, config, calibration=CALIBRATION):
        (self.folder / "unit.toml").write_text(calibration)
        (self.folder / "my.toml").write_text(config.replace("{folder}", str(self.folder)))
        return ctl("check", "my.toml", cwd=self.folder)

    def test_a_configuration_with_a_grasp_needs_no_folder_in_its_name(self):
        grasp = CONFIG + '\n[grasp]\n[[grasp.jaw]]\nsensor = "left"\nx_S_in_G = [1, 0, 0]\nz_S_in_G = [0, 1, 0]\n'
        done = self.check(grasp)
        self.assertEqual(done.returncode, 0, done.stderr)
        shutil.copytree(ROOT / "config", self.folder / "config")
        self.assertNotIn("filesystem error", ctl("check", "tactiled.toml", cwd=self.folder / "config").stderr)

    def test_four_channels_do_not_fit_a_calibration_of_three(self):
        done = self.check(CONFIG.replace("channels = 3", "channels = 4"))
        self.assertEqual(done.returncode, 1)
        self.assertIn("has 4 channels, the calibration has 3", done.stderr)
        named = CONFIG.replace("channels = 3", "channels = 4").replace("stale_ms", 'channels = ["c1", "-", "c2", "c3"]\nstale_ms')
        self.assertEqual(self.check(named).returncode, 0)

    def test_what_is_unsafe_is_named_with_the_line_to_write(self):
        done = self.check(CONFIG.replace("sequence = true\n", "").replace("stale_ms", "tare_limit_N = 0\nstale_ms"),
                          CALIBRATION.replace("100.0, 100.0, 100.0", "0.1, 0.1, 0.3"))
        self.assertEqual(done.returncode, 0, done.stderr)
        for said in ("no sequence", "no checksum", "rate_Hz = ", "frozen_after = ", "tare under any load", "contact_on_N = 0.5 is beyond",
                     "contact_on_N = 0.033"):
            self.assertIn(said, done.stdout)
        safe = CONFIG.replace("channels = 3\n", 'channels = 3\nchecksum = "crc16"\ntime_us = true\n')
        safe = safe.replace("stale_ms", "rate_Hz = 100\nstale_ms").replace("frozen_after = 0", "frozen_after = 100")
        self.assertIn("no joint domain", self.check(safe).stdout)
        joint = "joint_domain.mean = [0.0, 0.0, 0.0]\njoint_domain.whitening = [[1.0], [0.0, 1.0], [0.0, 0.0, 1.0]]\njoint_domain.limit = 9.0\n"
        self.assertNotIn("warning", self.check(safe, CALIBRATION + joint).stdout)

    def test_loads_that_the_channels_cannot_show_are_named(self):
        self.assertIn("a press beside the places of the calibration (3 channels, 5 unknowns)", self.check(CONFIG).stdout)
        self.assertNotIn("change of the load", self.check(CONFIG).stdout)
        slow = self.check(CONFIG.replace("stale_ms", "delay_ms = 250\nstale_ms")).stdout
        self.assertIn("a change of the load within the 500 ms over which the channels are measured, longer than stale_ms = ", slow)

    def test_a_misspelt_key_is_one_error(self):
        for key, wrong in (("model", "modle"), ("device", "devcie"), ("[[sensor]]", "[[sensr]]"), ("driver", "drivr"), ("channels", "chanels")):
            done = self.check(CONFIG.replace(key, wrong, 1))
            self.assertEqual(done.returncode, 1)
            lines = done.stderr.strip().splitlines()
            self.assertEqual(len(lines), 1, done.stderr)
            self.assertIn("did you mean", lines[0])

    def test_a_configuration_with_tabs_and_one_from_another_folder(self):
        tabs = re.sub(r" *= *", "\t=\t", CONFIG.replace("{folder}/unit.toml", "unit.toml")).replace("\nname", "\n\tname").replace("\n", "\r\n")
        self.assertEqual(self.check(tabs).returncode, 0, self.check(tabs).stderr)
        self.assertEqual(ctl("check", self.folder / "my.toml", cwd="/").returncode, 0)

    def test_a_small_sensor_is_told_the_count_of_its_registers(self):
        small = self.check(CONFIG, CALIBRATION.replace("100.0, 100.0, 100.0", "0.2, 0.2, 0.2"))
        self.assertIn("its full scale of 0.346 N is 35 counts of 0.01 N in the registers", small.stdout)
        self.assertIn("-> register_N = 0.0001", small.stdout)
        cured = self.check(CONFIG.replace("stale_ms", "register_N = 0.0001\nstale_ms"), CALIBRATION.replace("100.0, 100.0, 100.0", "0.2, 0.2, 0.2"))
        self.assertNotIn("registers", cured.stdout)
        large = self.check(CONFIG, CALIBRATION.replace("100.0, 100.0, 100.0", "900.0, 900.0, 900.0"))
        self.assertIn("beyond the registers, which end at 327.67 N", large.stdout)
        self.assertIn("register_N = 0.002 is no power of ten", self.check(CONFIG.replace("stale_ms", "register_N = 0.002\nstale_ms")).stderr)

    def test_a_hair_without_a_temperature_range_and_a_coarse_sensor_are_told_the_line(self):
        shutil.copy(ROOT / "config/calibration/hair_documents.toml", self.folder / "hair.toml")
        hair = CONFIG.replace("channels = 3", "channels = 4").replace('model = "generic"', 'model = "hair"').replace("unit.toml", "hair.toml")
        hair = hair.replace("frozen_after = 0\n", "")
        done = self.check(hair)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("every value is UNCERTAIN:outside-domain\n    -> temperature_range_C = [20, 24]", done.stdout)
        self.assertIn("counts as dead: a coarse sensor at rest does so, too\n    -> frozen_after = 0", done.stdout)
        cured = self.check(hair.replace("stale_ms", "temperature_range_C = [22, 22]\nfrozen_after = 0\nstale_ms"))
        self.assertNotIn("UNCERTAIN", cured.stdout)
        self.assertNotIn("counts as dead", cured.stdout)
        found = json.loads(ctl("doctor", "--json", "--config", self.folder / "my.toml").stdout)["findings"]
        self.assertNotIn("temperature", {f["check"] for f in found})
        self.check(hair)
        found = json.loads(ctl("doctor", "--json", "--config", self.folder / "my.toml").stdout)["findings"]
        self.assertTrue(any(f["check"] == "temperature" and f["remedy"].startswith("temperature_range_C = ") for f in found))

    def test_a_slow_sensor_is_told_its_stale_ms(self):
        rows = [f"{i / 10},{84000 - 2100 * load + i * 37 % 11},{load}" for i, load in enumerate(load for load in (0, -1, -2, -3, -5, -7, -10) for _ in range(20))]
        (self.folder / "cell.csv").write_text("t_s,c1,fz_N\n" + "\n".join(rows) + "\n")
        done = ctl("calibrate", "--model", "generic", "--in", "cell.csv", "--out", "cell.toml", cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("stale_ms = 300  #", done.stdout)
        sensor = done.stdout[done.stdout.index("[[sensor]]"):]
        link = CONFIG[:CONFIG.index("[[sensor]]")].replace("channels = 3", "channels = 1")
        self.assertNotIn("an outage", self.check(link + sensor).stdout)
        quick = self.check(CONFIG.replace("stale_ms", "rate_Hz = 10\nstale_ms")).stdout
        self.assertIn("its frames are 100 ms apart, and without one for stale_ms = 100 there is no value", quick)
        self.assertIn("-> stale_ms = 300", quick)

    def test_the_expected_standard_deviation_of_a_weight_is_printed(self):
        two = CONFIG + CONFIG.replace('"usb0"', '"usb1"').replace("/dev\"", "/dev1\"").replace('"left"', '"right"')
        jaw = '[[grasp.jaw]]\nsensor = "{}"\nx_S_in_G = [0, 0, -1]\nz_S_in_G = [{}, 0, 0]\n'
        grasp = two + "\n[grasp]\ngravity_G_m_s2 = [0, 0, 9.81]\n" + jaw.format("left", 1) + jaw.format("right", -1)
        done = self.check(grasp)
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = re.findall(r"weight: (\S+) kg, held with (\S+) N a jaw: expected sd (\S+) kg \(\S+ %\); after `weigh known (\S+)` (\S+) kg", done.stdout)
        self.assertEqual([row[0] for row in lines], ["3", "0.6"])  # half of 2 x 100 N x 0.5 / 1.5 / g = 6.8 kg, rounded down
        for mass_kg, _, sd_kg, _, known_kg in lines:
            self.assertLess(float(sd_kg), 0.05 * float(mass_kg))
            self.assertLessEqual(float(known_kg), 1.1 * float(sd_kg))
        worse = self.check(grasp, CALIBRATION.replace("sd = [0.01, 0.01, 0.01]", "sd = [30.0, 30.0, 30.0]"))
        self.assertIn("expected sd no stable weight", worse.stdout)

    def test_doctor_says_the_same(self):
        self.check(CONFIG)
        found = json.loads(ctl("doctor", "--json", "--config", self.folder / "my.toml").stdout)["findings"]
        kinds = {f["check"] for f in found if f["verdict"] == "advice"}
        self.assertLessEqual({"rate", "frozen", "line"}, kinds)
        self.assertTrue(all(f["remedy"] for f in found if f["check"] in ("rate", "frozen")))


if __name__ == "__main__":
    unittest.main(verbosity=2)
