"""Arrays in the channels of an ordinary link, and taxels with a calibration of their own, with the release daemon: 2 x 3 pads of
five values as 30 numbers in a line of text."""
import os
import shutil
import signal
import socket
import sys
import threading
import unittest

from daemon import ROOT, Daemon, ctl, wait_for

sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

ZERO_pF = (1.2285, 1.2285, 1.2285, 1.2285, 1.3039)  # of the thesis' pad
ARRAY = """format = 1
model = "patch"
method = "taxel_models"
channels = ["C1", "C2", "C3", "C4", "Cn"]
channel_unit = "pF"
components = ["fx", "fy", "fz", "mx", "my", "mz"]
taxel_calibration = ["pad.toml"]
parameters.rows = 2
parameters.columns = 3
parameters.pitch_mm = 8.0
"""
CONFIG = """
[[link]]
name = "board"
driver = "tcp"
address = "127.0.0.1:{port}"
format = "lines"
channels = {channels}

[[sensor]]
name = "pads"
link = "board"
model = "patch"
calibration = "{{folder}}/array.toml"
stale_ms = 1000
rate_Hz = 100
"""


class Board(threading.Thread):
    """Sends 100 lines a second: pad after pad, its values in pF."""

    def __init__(self):
        super().__init__(daemon=True)
        self.server = socket.create_server(("127.0.0.1", 0))
        self.pads = [list(ZERO_pF) for _ in range(6)]
        self.ended = threading.Event()
        self.start()

    def run(self):
        connection = self.server.accept()[0]
        try:
            while not self.ended.wait(0.01):
                connection.sendall((",".join(f"{value}" for pad in self.pads for value in pad) + "\n").encode())
        except OSError:
            pass
        connection.close()

    def close(self):
        self.ended.set()
        self.server.close()


class SmallArray(unittest.TestCase):
    def daemon(self, channels=30):
        self.board = Board()
        self.addCleanup(self.board.close)
        daemon = Daemon(CONFIG.format(port=self.board.server.getsockname()[1], channels=channels))
        self.addCleanup(daemon.__exit__)
        shutil.copy(ROOT / "config/calibration/capacitive_documents.toml", daemon.folder / "pad.toml")
        (daemon.folder / "array.toml").write_text(ARRAY)
        return daemon

    def test_pads_in_a_line_are_forces_at_their_places(self):
        daemon = self.daemon()
        daemon.start()
        os.environ["TACTILED_RUNTIME_DIR"] = str(daemon.segment.parent)
        node = tactiled.open(daemon.name)
        self.addCleanup(node.close)
        self.board.pads[1][4] += 0.0405 * 2 + 0.0008 * 4  # 2 N in the middle of the upper row
        self.board.pads[5][4] += 0.0405 * 1 + 0.0008 * 1  # 1 N at the lower right
        wait_for(lambda: abs(node.array("pads").sample.force_S_N[2] + 3) < 1e-2, "3 N")
        array = node.array("pads")
        forces = [row[2] for row in array.force_S_N.tolist()]
        for seen, wanted in zip(forces, (0, -2, 0, 0, 0, -1)):
            self.assertAlmostEqual(seen, wanted, delta=1e-3)
        self.assertAlmostEqual(array.sample.torque_S_Nm[0], -2 * 4e-3 + 1 * 4e-3, delta=1e-5)  # y fz
        self.assertAlmostEqual(array.sample.torque_S_Nm[1], 1 * 8e-3, delta=1e-5)              # -x fz
        self.assertIn("sd-unknown", array.sample.reasons_text)  # the thesis states none

    def test_a_changed_file_of_the_pads_is_in_force_after_a_reload(self):
        daemon = self.daemon()
        daemon.start()
        self.board.pads[1][4] += 0.0405 * 2 + 0.0008 * 4
        os.environ["TACTILED_RUNTIME_DIR"] = str(daemon.segment.parent)
        with tactiled.open(daemon.name) as node:
            wait_for(lambda: abs(node.latest("pads").force_S_N[2] + 2) < 1e-2, "2 N")
            pad = daemon.folder / "pad.toml"
            pad.write_text(pad.read_text().replace("parameters.normal_b = 0.0405", "parameters.normal_b = 0.081"))
            daemon.process.send_signal(signal.SIGHUP)
            wait_for(lambda: abs(node.latest("pads").force_S_N[2] + 1.029) < 5e-3, "the new curve")

    def test_another_number_of_channels_is_another_device(self):
        daemon = self.daemon(channels=25)
        daemon.start()
        os.environ["TACTILED_RUNTIME_DIR"] = str(daemon.segment.parent)
        with tactiled.open(daemon.name) as node:
            wait_for(lambda: node.latest("pads").quality == tactiled.BAD, "BAD")

    def test_a_calibration_for_another_unit_is_refused_with_its_file(self):
        daemon = self.daemon()
        pad = daemon.folder / "pad.toml"
        pad.write_text(pad.read_text().replace('"pF"', '"fF"'))
        found = daemon.ctl("check", str(daemon.config))
        self.assertNotEqual(found.returncode, 0)
        self.assertIn("pad.toml has the channels C1 C2 C3 C4 Cn in fF, the array", found.stdout + found.stderr)


if __name__ == "__main__":
    unittest.main()
