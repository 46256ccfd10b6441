"""tactiled-web in a test: started beside a daemon, requested over HTTP, with its event stream parsed."""
import base64
import http.client
import json
import pathlib
import shutil
import signal
import struct
import subprocess
import tempfile
import time
import unittest

import process_costs
from daemon import BIN, PATIENCE_S, free_port, wait_for
from unit_daemon import CONFIG, quality_is, unit_daemon

PROGRAM = BIN / "tactiled-web"
TOKEN = "0123456789abcdef-of-a-test"


class Web:
    """A context manager."""

    def __init__(self, node, *words, token=None, env=None, before=()):
        self.port = free_port()
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-web-"))
        self.log_path = self.folder / "log"
        words = list(words)
        if token is not None:
            (self.folder / "token").write_text(token + "\n")
            words += ["--token-file", self.folder / "token"]
        with open(self.log_path, "w") as log:
            self.process = subprocess.Popen([*before, PROGRAM, "--node", node, "--listen", f"127.0.0.1:{self.port}", *map(str, words)], stderr=log, env=env)
        wait_for(lambda: "http://" in self.log() or self.process.poll() is not None, "the server")
        assert self.process.poll() is None, self.log()

    def log(self):
        return self.log_path.read_text()

    @property
    def host(self):
        return f"127.0.0.1:{self.port}"

    def ask(self, path, method="GET", body=None, timeout=30, **fields):
        """Returns (status, header fields, body). fields: X_Y=... is the header field X-Y; None omits Host."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        headers = {key.replace("_", "-"): value for key, value in fields.items()}
        try:
            connection.request(method, path, body, headers)
            answer = connection.getresponse()
            return answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read()
        finally:
            connection.close()

    def status(self):
        code, _, body = self.ask("/api/status")
        assert code == 200, body
        return json.loads(body)

    def command(self, body, token=TOKEN, **fields):
        fields = {"Origin": f"http://{self.host}", "Content_Type": "application/json", "Authorization": f"Bearer {token}", **fields}
        code, _, answer = self.ask("/api/command", "POST", json.dumps(body) if not isinstance(body, (str, bytes)) else body,
                                   **{k: v for k, v in fields.items() if v is not None})
        return code, json.loads(answer)

    def rss_kB(self):
        return process_costs.status(self.process.pid, "VmRSS")

    def cpu_s(self):
        return process_costs.cpu_s(self.process.pid)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            try:
                self.process.wait(timeout=60)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()


class Stream:
    """The events of /api/stream, in their order."""

    def __init__(self, web, timeout=PATIENCE_S):
        self.connection = http.client.HTTPConnection("127.0.0.1", web.port, timeout=timeout)
        self.connection.request("GET", "/api/stream")
        self.answer = self.connection.getresponse()

    def next(self):
        """Returns (name, data); "frame" is the event without a name."""
        name, data = "frame", None
        while True:
            line = self.answer.readline().decode()
            if line == "":
                raise EOFError
            line = line.rstrip("\n")
            if line == "" and data is not None:
                return name, json.loads(data)
            if line.startswith("event: "):
                name = line[7:]
            elif line.startswith("data: "):
                data = line[6:]

    def until(self, condition, seconds=PATIENCE_S):
        """Returns the first event for which condition(name, data) is true."""
        limit = time.monotonic() + seconds
        while time.monotonic() < limit:
            name, data = self.next()
            if condition(name, data):
                return data
        raise TimeoutError

    def close(self):
        self.connection.close()


def column(text, kind):
    """Returns a column of the history: kind is "d", "f" or "I"."""
    raw = base64.b64decode(text)
    return struct.unpack(f"<{len(raw) // struct.calcsize(kind)}{kind}", raw)


class WebCase(unittest.TestCase):
    """A daemon with one sensor, and web servers beside it."""

    rows = "0,1,2,-3\n0.01,1,2,-3\n"
    rate = 200
    config = CONFIG

    def setUp(self):
        if not PROGRAM.exists():
            self.skipTest("tactiled-web is not built: libmicrohttpd-dev was missing")
        self.daemon = unit_daemon(self.rows, self.rate, self.config).start()
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        wait_for(quality_is(self.daemon, "good"), "a good value")

    def web(self, *words, **kinds):
        web = Web(self.daemon.name, *words, **kinds)
        self.addCleanup(shutil.rmtree, web.folder)
        self.addCleanup(web.__exit__)
        wait_for(lambda: web.status()["alive"], "the first tick")
        return web
