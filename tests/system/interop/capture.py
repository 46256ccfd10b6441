"""A conversation on the loopback in Wireshark's dissector of Modbus TCP."""
import collections
import shutil
import signal
import subprocess
import time
import unittest

Frame = collections.namedtuple("Frame", "number is_query name function exception query_frame complaints")


class Capture:
    """Records a port of the loopback while the context lasts. Raises SkipTest if that is not permitted."""

    def __init__(self, port, path):
        self.port = port
        self.path = path

    def __enter__(self):
        if shutil.which("tshark") is None or shutil.which("dumpcap") is None:
            raise unittest.SkipTest("no tshark: apt-get install tshark")
        self.log = open(f"{self.path}.log", "w+")
        self.process = subprocess.Popen(["dumpcap", "-i", "lo", "-f", f"tcp port {self.port}", "-w", self.path],
                                        stdout=self.log, stderr=self.log)
        until = time.monotonic() + 5
        while not self.path.exists() and self.process.poll() is None and time.monotonic() < until:
            time.sleep(0.01)
        if not self.path.exists():
            self.stop()
            self.log.seek(0)
            raise unittest.SkipTest(f"capturing on the loopback needs root or CAP_NET_RAW: {self.log.read().strip()}")
        time.sleep(0.3)  # the file appears before the first packet is captured
        return self

    def __exit__(self, *_):
        time.sleep(0.5)  # dumpcap delivers packets in blocks
        self.stop()
        self.log.close()

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            self.process.wait(timeout=60)


def conversation(capture):
    """Returns every frame with a payload; `name` is the common key of a query and its answer."""
    fields = ["frame.number", "tcp.dstport", "tcp.stream", "mbtcp.trans_id", "mbtcp.unit_id", "modbus.func_code",
              "modbus.exception_code", "modbus.request_frame", "_ws.malformed", "_ws.expert.message"]
    wanted = "tcp.len > 0 or _ws.malformed"
    done = subprocess.run(["tshark", "-r", capture.path, "-o", f"mbtcp.tcp.port:{capture.port}", "-Y", wanted, "-T",
                           "fields", *(word for field in fields for word in ("-e", field))],
                          capture_output=True, text=True, timeout=60, check=True)
    return [read_frame(line.split("\t"), capture.port) for line in done.stdout.splitlines()]


def read_frame(cells, port):
    number, to, stream, transaction, unit, function, exception, query, malformed, expert = cells
    complaints = "".join([malformed, expert, "" if transaction else "not Modbus TCP"])
    return Frame(int(number), int(to) == port, (stream, transaction, unit, function), int(function or -1),
                 int(exception) if exception else None, int(query) if query else None, complaints)
