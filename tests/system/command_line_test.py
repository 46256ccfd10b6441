#!/usr/bin/env python3
"""The command line of tactilectl: words in any order, misspelt words, pipes that end, words of the status, and completion."""
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

from daemon import BIN, ROOT, ctl, run_folder, wait_for
from unit_daemon import CONFIG, quality_is, unit_daemon

VERBS = ["status", "top", "read", "record", "replay", "tare", "clear", "weigh", "teach", "tool-fit", "grasp-check", "map", "check", "completion", "doctor",
         "calibrate", "capture", "decouple", "identify", "play", "simulate", "tradeoff"]


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

    def test_a_misspelt_option_names_the_nearest_one(self):
        done = ctl("record", "a.mcap", "--second", "0.5")
        self.assertEqual(done.returncode, 2)
        self.assertEqual(done.stderr, "tactilectl: --second is no option here; did you mean --seconds?\n")
        self.assertIn("not expected", ctl("record", "a.mcap", "--xyzzy").stderr)
        for words in (("--count", "3"), ("--follow", "--count", "-3"), ("--follow", "--count", "0")):
            done = ctl("read", "left", *words)
            self.assertEqual(done.returncode, 2, words)
            self.assertLess(len(done.stderr), 300)

    def test_every_verb_has_a_manual_page(self):
        made = (ROOT / "systemd/CMakeLists.txt").read_text()
        pages = re.search(r"foreach\(verb (.*) \$", made).group(1).split() + re.search(r"set\(laboratory (.*)\)", made).group(1).split()
        self.assertEqual(sorted(pages), sorted(VERBS))

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
        wait_for(quality_is(cls.daemon, "good"), "a good sample")

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
            process.wait(timeout=60)
            os.close(master)
            return text.decode()
        self.assertIn("\x1b[32mgood", on_terminal())
        self.assertNotIn("\x1b[", on_terminal(NO_COLOR="1"))
        self.assertNotIn("\x1b[", on_terminal(TERM="dumb"))
        self.assertNotIn("\x1b[", self.daemon.ctl("status").stdout)

    def test_the_first_line_of_the_status_has_units_and_no_bare_word(self):
        first = self.daemon.ctl("status").stdout.splitlines()[0]
        self.assertRegex(first, r"heartbeat \d+  longest cycle \d+ us  woken \d+ us late, p99 \d+ us  \d+ cycles missed")
        top = self.daemon.ctl("top", "--count", "1").stdout
        for bare in (r"\bbeat\b", r"\bworst\b", r"\bmissed\b"):
            self.assertNotRegex(top, bare)

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
            wait_for(lambda: "not served yet" in d.log(), "the word")
            line = [line for line in d.log().splitlines() if "node \"" in line][0]
            self.assertIn(f"Modbus 127.0.0.1:{d.port} not served yet", line)
        self.assertNotIn("not served", self.daemon.log())


class Faults(unittest.TestCase):
    def test_faults_and_warnings_are_words(self):
        with unit_daemon() as d:
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
            self.assertEqual(json.loads(d.ctl("status", "--json").stdout)["fault"], [])
            d.others[0].send_signal(signal.SIGKILL)
            wait_for(quality_is(d, "bad"), "BAD")
            wait_for(lambda: json.loads(d.ctl("status", "--json").stdout)["fault"], "a fault")
            self.assertIn("SENSOR_LOST", json.loads(d.ctl("status", "--json").stdout)["fault"])
            self.assertIn("FAULT  sensor lost", d.ctl("status").stdout)
            self.assertIn("sensor lost", d.ctl("top", "--count", "1").stdout)


    def test_lines_that_are_all_refused_are_no_silence(self):
        with unit_daemon(config=CONFIG.replace("sequence = true\n", 'checksum = "crc16"\n')) as d:
            d.start()
            wait_for(lambda: "bytes arrive, and every frame of them is refused (bad_checksum " in d.ctl("status").stdout, "the reason")
            self.assertNotIn("the device is silent", d.ctl("status").stdout)

    def test_a_coarse_sensor_at_rest_is_told_what_to_write(self):
        with unit_daemon(config=CONFIG.replace("frozen_after = 0", "frozen_after = 20")) as d:
            d.start()
            wait_for(lambda: ":frozen" in d.ctl("status").stdout, "the frozen channels")
            self.assertIn("left: a channel is frozen; remedy: the channel repeats one number", d.ctl("status").stdout)
            self.assertIn("write frozen_after = 0", d.ctl("status").stdout)

    def test_a_tare_that_is_refused_for_the_age_names_the_line_to_write(self):
        config = CONFIG.replace('path = "direct"\n', "").replace("sequence = true\n", "")
        with unit_daemon(config=config, rate=None) as d:
            d.play("--in", d.folder / "rows.csv", "--pty", d.folder / "dev", "--format", "lines", "--rate", 200, "--loop")
            self.assertIn("-> accept_unproved_age = true", ctl("check", d.config).stdout)
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
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
            wait_for(quality_is(d, "good"), "a good sample")
            self.assertIn("there is no control socket: ", d.ctl("status").stdout)
            self.assertIn("/proc/nowhere/control.sock", d.log())
            found = json.loads(ctl("doctor", "--json", "--config", d.config).stdout)["findings"]
            self.assertEqual([f["verdict"] for f in found if f["check"] == "control"], ["wrong"])


class Recording(unittest.TestCase):
    def test_replay_takes_configuration_and_calibration_from_the_file(self):
        config = CONFIG.replace("{folder}/unit.toml", "unit.toml")
        with unit_daemon(config=config) as d:
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
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
            wait_for(quality_is(d, "good"), "a good sample")
            d.config.write_text(d.config.read_text() + "# changed after the start\n")
            done = ctl("record", d.folder / "a.mcap", "--node", d.name, "--seconds", "0.3")
            self.assertIn("was changed since the daemon read it", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
