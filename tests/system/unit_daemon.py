"""A daemon with one sensor whose three channels are in newtons, for tests of other properties than forces."""
import json

from daemon import Daemon

# stale_ms: a busy machine delays the player and the daemon for longer than 100 ms, and a stale sensor has no value and is not tared.
CONFIG = """
[[link]]
name = "usb0"
driver = "uart"
device = "{folder}/dev"
path = "direct"
format = "lines"
channels = 3
sequence = true

[[sensor]]
name = "left"
link = "usb0"
model = "generic"
calibration = "{folder}/unit.toml"
stale_ms = 2000
frozen_after = 0
"""

WATCHDOG_S = 0.25  # the default of watchdog_ms

CALIBRATION = """format = 1
model = "generic"
method = "matrix"
contact_model = "unknown"
serial = "unit"
date = "2026-01-01"
channels = ["c1", "c2", "c3"]
channel_unit = "N"
zero = [0.0, 0.0, 0.0]
components = ["fx", "fy", "fz"]
matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
sd = [0.01, 0.01, 0.01]
full_scale = [100.0, 100.0, 100.0]
"""


def unit_daemon(rows="0,1,2,-3\n0.01,1,2,-3\n", rate=200, config=CONFIG, calibration=CALIBRATION):
    daemon = Daemon(config)
    (daemon.folder / "unit.toml").write_text(calibration)
    (daemon.folder / "rows.csv").write_text("t_s,c1,c2,c3\n" + rows)
    if rate:
        play(daemon, rate)
    return daemon


def play(daemon, rate=200):
    return daemon.play("--in", daemon.folder / "rows.csv", "--pty", daemon.folder / "dev", "--format", "lines", "--sequence", "--rate", rate, "--loop")


def sensor(daemon):
    return json.loads(daemon.ctl("status", "--json").stdout)["sensors"][0]


def quality_is(daemon, word):
    return lambda: sensor(daemon)["quality"].startswith(word)
