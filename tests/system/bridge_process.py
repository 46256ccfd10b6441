"""A bridge as a test drives it, and what it costs."""
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile

import process_costs
from daemon import BIN, wait_for


class Process:
    """A program with its messages in a file. Use as a context manager."""

    def __init__(self, *words, ready=None, env=None, stdout=None):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-bridge-"))
        self.log_path = self.folder / "log"
        with open(self.log_path, "w") as log:
            self.process = subprocess.Popen([str(word) for word in words], stderr=log, stdout=stdout or log, env=env)
        if ready is not None:
            wait_for(lambda: ready in self.log() or self.process.poll() is not None, f"{words[0]}: {ready}")
            assert self.process.poll() is None, self.log()

    def log(self):
        return self.log_path.read_text()

    def status(self, field):
        return process_costs.status(self.process.pid, field)

    def cpu_s(self):
        return process_costs.cpu_s(self.process.pid)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def counts(self):
        """sent, dropped and missed, as the bridge said them last."""
        return tuple(map(int, re.findall(r"sent (\d+), dropped (\d+), missed (\d+)", self.log())[-1]))

    def stop(self):
        """SIGTERM; its exit status."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=60)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            try:
                self.stop()
            except subprocess.TimeoutExpired:
                self.kill()
        shutil.rmtree(self.folder, ignore_errors=True)


def bridge(name, node, *words, ready="node", env=None):
    return Process(BIN / f"tactiled-{name}", "--node", node, *words, ready=ready, env=env)
