"""The test machine from inside: the daemon under test, its simulated hardware, and a witness of the published
samples."""
import json
import os
import pathlib
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/system"), str(ROOT / "node/python")]
import daemon as system  # noqa: E402
import tactiled  # noqa: E402
from daemon import BIN  # noqa: E402,F401

PATIENCE = float(os.environ.get("PATIENCE", 1))  # run.sh: more for slow builds


def wait_for(condition, what, seconds=system.PATIENCE_S):
    system.wait_for(condition, what, seconds * PATIENCE)


class Daemon(system.Daemon):
    """A daemon; a message of a sanitizer fails the test."""

    def __exit__(self, *_):
        super().__exit__()
        log = self.log() if (self.folder / "tactiled.log").exists() else ""
        assert "Sanitizer" not in log and "runtime error" not in log, log


def unit_calibration(channels, most=1e6):
    """A calibration of which each of 1 to 6 channels is one component of the wrench, 1 N or Nm a count."""
    components = ["fx", "fy", "fz", "mx", "my", "mz"][:channels] if channels > 1 else ["fz"]
    names = [f"c{k + 1}" for k in range(channels)]
    rows = [[float(k == column) for column in range(channels)] for k in range(channels)]
    return f"""format = 1
model = "generic"
method = "matrix"
contact_model = "unknown"
date = "2026-01-01"
channels = {json.dumps(names)}
channel_unit = "N"
zero = {[0.0] * channels}
components = {json.dumps(components)}
matrix = {rows}
sd = {[0.01] * channels}
full_scale = {[most] * channels}
"""


# A second link, which must not be affected by faults of the first one.
OTHER = """
[[link]]
name = "other"
driver = "uart"
device = "{folder}/other"
format = "lines"
channels = 1
sequence = true

[[sensor]]
name = "other"
link = "other"
model = "generic"
calibration = "{folder}/unit1.toml"
stale_ms = 1000
"""


def machine_daemon(links):
    """A daemon, not yet started, with `links` (TOML) and link and sensor "other"; unit calibrations are {folder}/unitN.toml."""
    daemon = Daemon(links + OTHER)
    for channels in range(1, 7):
        (daemon.folder / f"unit{channels}.toml").write_text(unit_calibration(channels))
    rows = daemon.folder / "rows.csv"
    rows.write_text("t_s,c1\n0,1.5\n0.01,1.5\n")
    daemon.play("--in", rows, "--pty", daemon.folder / "other", "--format", "lines", "--sequence", "--rate", 100, "--loop")
    return daemon


def link_of(daemon, name):
    """Returns the output of `status` on a link: "open" and its counters."""
    status = json.loads(daemon.ctl("status", "--json").stdout)
    return next(link for link in status["links"] if link["name"] == name)


def now_ns():
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC)


class Witness:
    """Follows a sensor in shared memory from a separate thread and keeps every sample with its time of arrival."""

    def __init__(self, daemon, sensor):
        self.samples = []  # (seen_ns, sample)
        self._follower = tactiled.Follower(daemon.name, sensor, timeout=0.2, from_oldest=True)
        self._stop = False
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def _follow(self):
        while not self._stop:
            try:
                sample = next(self._follower)
            except (tactiled.Error, TimeoutError, StopIteration):
                continue
            self.samples.append((now_ns(), sample))

    def last(self):
        return self.samples[-1][1] if self.samples else None

    def quality(self):
        return self.last().quality if self.samples else None

    def wait_for_quality(self, quality, seconds=10):
        """Returns the ns at which it was first seen from now on."""
        begin = now_ns()
        found = []

        def seen():
            found[:] = [at for at, sample in list(self.samples) if at >= begin and sample.quality == quality][:1]
            return found
        wait_for(seen, f"quality {quality}; last {self.last()}", seconds)
        return found[0]

    def between(self, begin_ns, end_ns):
        return [sample for at, sample in list(self.samples) if begin_ns <= at < end_ns]

    def close(self):
        self._stop = True
        self._thread.join(2)
        self._follower.close()


class Emulator:
    """A program that emulates a USB adapter for the kernel (usbip_can, usbip_i2c); commands are lines."""

    def __init__(self, program, *words):
        self.process = subprocess.Popen([BIN / program, *map(str, words)], stdin=subprocess.PIPE, text=True)

    def tell(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def close(self):
        self.process.kill()
        self.process.wait()


def sh(*words, check=True):
    """Runs a command; returns its output."""
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, timeout=30)
    if check and done.returncode != 0:
        raise RuntimeError(f"{words}: {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def gpio_chip():
    """(its /dev node, the sysfs folder with sim_gpioN/pull and value) of the chip "tactile"."""
    name = pathlib.Path("/sys/kernel/config/gpio-sim/tactile/bank0/chip_name").read_text().strip()
    device = pathlib.Path("/sys/kernel/config/gpio-sim/tactile/dev_name").read_text().strip()
    return f"/dev/{name}", pathlib.Path(f"/sys/devices/platform/{device}/{name}")


def i2c_bus(name):
    """/dev/i2c-N of the adapter whose name starts so, such as "SMBus stub"; None where there is none."""
    for adapter in pathlib.Path("/sys/bus/i2c/devices").glob("i2c-*"):
        try:
            if (adapter / "name").read_text().startswith(name):
                return f"/dev/{adapter.name}"
        except OSError:  # it is being removed
            pass
    return None
