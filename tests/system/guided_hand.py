"""Sensors whose channels are newtons already, as a test commands them, and a guided verb of tactilectl that it answers."""
import random
import subprocess
import time

from daemon import BIN, Daemon
from pty_device import PtyDevice

RATE_HZ = 200
COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")


def calibration(channels, full_scale=100.0, sd=0.005):
    rows = ", ".join("[" + ", ".join("1.0" if i == k else "0.0" for i in range(channels)) + "]" for k in range(channels))
    names = ", ".join(f'"c{i + 1}"' for i in range(channels))
    scale = "" if full_scale is None else f"full_scale = [{', '.join([str(full_scale)] * channels)}]\n"
    return (f'format = 1\nmodel = "generic"\nmethod = "matrix"\ncontact_model = "unknown"\nserial = "unit"\ndate = "2026-01-01"\n'
            f'channels = [{names}]\nchannel_unit = "N"\nzero = [{", ".join(["0.0"] * channels)}]\n'
            f'components = [{", ".join(f"{chr(34)}{c}{chr(34)}" for c in COMPONENTS[:channels])}]\nmatrix = [{rows}]\n'
            f'sd = [{", ".join([str(sd)] * channels)}]\n{scale}')


def link_and_sensor(name, channels, more=""):
    return (f'[[link]]\nname = "usb-{name}"\ndriver = "uart"\ndevice = "{{folder}}/{name}.dev"\nformat = "lines"\nchannels = {channels}\n'
            f'sequence = true\ntime_us = true\npath = "direct"\n\n[[sensor]]\nname = "{name}"\nlink = "usb-{name}"\nmodel = "generic"\n'
            f'calibration = "{{folder}}/{name}.toml"\nstale_ms = 2000\n{more}\n')


class Device(PtyDevice):
    """Sends `reading`, a list of numbers that the test replaces, with noise."""

    def __init__(self, path, channels, seed, noise=0.003):
        self.reading, self.is_silent = [0.0] * channels, False
        self.random, self.noise = random.Random(seed), noise
        super().__init__(path, RATE_HZ)

    def line(self, sequence):
        if self.is_silent:
            return None
        values = ",".join(f"{v + self.random.gauss(0, self.noise):.6f}" for v in self.reading)
        return f"{sequence},{time.monotonic_ns() // 1000 % 2**32},{values}"


def begin(test, config, channels, commands=False, full_scale=100.0, more=""):
    """A daemon with `channels` = {sensor: number of channels} and its devices."""
    daemon = Daemon("".join(link_and_sensor(name, n, more) for name, n in channels.items()) + config)
    test.addCleanup(daemon.__exit__)
    if commands:
        text = daemon.config.read_text().replace("[modbus]\n", f'[modbus]\ncommands = true\nsettings = "{daemon.folder}/s.toml"\n')
        daemon.config.write_text(text)
    devices = {}
    for name, n in channels.items():
        (daemon.folder / f"{name}.toml").write_text(calibration(n, full_scale))
        devices[name] = Device(daemon.folder / f"{name}.dev", n, name)
        test.addCleanup(devices[name].finish)
    daemon.start()
    return daemon, devices


def guide(daemon, words, steps):
    """Runs a guided verb; before each of its prompts the next of `steps` is done, which may return the words to answer.
    Returns (exit status, all that it printed)."""
    process = subprocess.Popen([BIN / "tactilectl", *map(str, words), "--node", daemon.name], stdin=subprocess.PIPE,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=daemon.reader_env)
    printed, todo, since, refused = "", list(steps), 0, 0
    while byte := process.stdout.read(1):
        printed += byte.decode("utf-8", "replace")
        if not printed.rsplit("\n", 1)[-1].endswith(("Enter: ", "0 0 9.81): ")):
            continue
        again = "not taken: " in printed[since:]  # the same step, once more
        refused += again
        if refused > 20:
            process.kill()
            raise AssertionError(printed)
        answer = "" if again or not todo else todo.pop(0)() or ""
        since = len(printed)
        process.stdin.write(f"{answer}\n".encode())
        process.stdin.flush()
    process.stdin.close()
    process.stdout.close()
    return process.wait(timeout=60), printed
