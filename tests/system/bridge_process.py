"""A bridge as a test drives it, and what it costs."""
import pathlib
import shutil
import signal
import subprocess
import tempfile

from daemon import BIN, wait_for


class Process:
    """A program with its messages in a file. Use as a context manager."""

    def __init__(self, *words, ready=None, env=None, stdout=None):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-bridge-"))
        self.log_path = self.folder / "log"
        with open(self.log_path, "w") as log:
            self.process = subprocess.Popen([str(word) for word in words], stderr=log, stdout=stdout or log, env=env)
        if ready is not None:
            wait_for(lambda: ready in self.log() or self.process.poll() is not None, 10, f"{words[0]}: {ready}")
            assert self.process.poll() is None, self.log()

    def log(self):
        return self.log_path.read_text()

    def status(self, field):
        """A number of /proc/PID/status, such as VmRSS, in kB."""
        lines = pathlib.Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith(field + ":"))

    def cpu_s(self):
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / 100

    def kill(self):
        self.process.kill()
        self.process.wait()

    def stop(self):
        """SIGTERM; its exit status."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=10)

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
