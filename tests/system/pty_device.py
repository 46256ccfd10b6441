"""A device behind a pseudo terminal that sends lines of numbers."""
import os
import threading
import tty


class PtyDevice(threading.Thread):
    """Sends `line(sequence)` at `rate_hz` until finish(); None is silence. The port is the link `path`."""

    def __init__(self, path, rate_hz=200):
        super().__init__(daemon=True)
        self.period_s, self.ended = 1 / rate_hz, threading.Event()
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        path.symlink_to(os.ttyname(self.slave))
        self.start()

    def line(self, sequence):
        raise NotImplementedError

    def run(self):
        sequence = 0
        while not self.ended.wait(self.period_s):
            sequence += 1
            text = self.line(sequence)
            if text is None:
                continue
            try:
                os.write(self.master, text.encode() + b"\n")
            except BlockingIOError:
                pass  # no program reads the port

    def finish(self):
        self.ended.set()
        self.join()
        os.close(self.master)
        os.close(self.slave)
