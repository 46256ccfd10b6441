#!/usr/bin/python3
"""Crowds of hostile clients of tactiled-web, each a process of its own, and an ordinary client that measures how long it waits beside them.

    /usr/bin/python3 tests/system/hostile_web.py [SECONDS]     prints a table; (SECONDS + 3) for each row, 10 rows"""
import pathlib
import random
import resource
import select
import socket
import statistics
import subprocess
import sys
import threading
import time

PLACES = 1984  # connections of the server: LimitNOFILE=2048
HEAD = b" HTTP/1.1\r\nHost: localhost\r\n"
FOREIGN = (b"GET /api/status HTTP/1.1\r\nHost: evil.example\r\n\r\n", b"GET /api/status HTTP/1.1\r\nHost: 127.0.0.1.evil.example\r\nOrigin: http://127.0.0.1.evil.example\r\n\r\n",
           b"GET /metrics" + HEAD + b"Origin: http://evil.example\r\n\r\n", b"GET /api/stream" + HEAD + b"Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: cors\r\n\r\n",
           b"OPTIONS /api/command" + HEAD + b"Origin: http://evil.example\r\nAccess-Control-Request-Method: POST\r\n\r\n")
TARE = b'{"command":"tare","sensor":"all"}'


def tare(*fields, host=b"localhost"):
    lines = (b"Host: " + host, *fields, b"Content-Length: %d" % len(TARE))
    return b"POST /api/command HTTP/1.1\r\n" + b"\r\n".join(lines) + b"\r\n\r\n" + TARE


REFUSED = (tare(b"Content-Type: text/plain"), tare(b"Origin: http://evil.example", b"Content-Type: application/json", b"Authorization: Bearer "),
           tare(b"Origin: http://localhost", b"Content-Type: application/json", b"Authorization: Bearer 0123456789abcdef"),
           tare(b"Origin: http://evil.example", b"Content-Type: application/json", b"Authorization: Bearer x", host=b"evil.example"))
SEEDS = (*FOREIGN, *REFUSED, b"GET /" + HEAD + b"\r\n", b"GET /api/status" + HEAD + b"\r\n", b"GET /api/stream" + HEAD + b"\r\n", b"HEAD /uPlot.js" + HEAD + b"\r\n",
         b"GET /api/events HTTP/1.0\r\n\r\n", b"POST /api/command" + HEAD + b"Transfer-Encoding: chunked\r\n\r\n5\r\n{\"a\":\r\n1\r\n1\r\n1\r\n}\r\n0\r\n\r\n",
         b"GET /" + HEAD + b"Connection: close\r\nExpect: 100-continue\r\nContent-Length: 10\r\n\r\n")


def damaged(chance):
    """A request with up to eight bytes or pieces changed."""
    data = bytearray(chance.choice(SEEDS))
    for _ in range(chance.randint(1, 8)):
        kind, at = chance.randint(0, 3), chance.randrange(len(data) + 1)
        if kind == 0:
            data[at:at + 1] = chance.randbytes(1)
        elif kind == 1:
            del data[at:at + chance.randint(1, 20)]
        elif kind == 2:
            data[at:at] = chance.randbytes(chance.randint(1, 50))
        else:
            other = chance.choice(SEEDS)
            data[at:] = other[chance.randrange(len(other)):]
    return bytes(data)


class Crowd:
    """Holds `count` connections, each of which says first() and then drip() each 0.2 s, takes answers where `takes`, and opens anew what is
    closed; with `again`, it says first() again after each answer; with `leaves`, it closes after the first part of an answer."""

    def __init__(self, port, count, first, drip=None, takes=True, again=False, leaves=False, buffer=0):
        self.port, self.first, self.drip, self.takes, self.again, self.leaves, self.buffer = port, first, drip, takes, again, leaves, buffer
        self.poll, self.open = select.epoll(), {}
        while len(self.open) < count:
            self.add()

    def add(self):
        s = socket.socket()
        if self.buffer:
            s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, self.buffer)
        s.settimeout(10)
        s.connect(("127.0.0.1", self.port))
        s.setblocking(False)
        self.open[s.fileno()] = s
        self.poll.register(s, select.EPOLLRDHUP | (select.EPOLLIN if self.takes else 0))
        self.say(s, self.first())

    def say(self, s, data):
        try:
            if data:
                s.send(data)
        except OSError:
            pass  # closed; poll() tells

    def run(self):
        dripped = time.monotonic()
        while True:
            closed = []
            for fd, events in self.poll.poll(0.05):
                s = self.open[fd]
                answer = b""
                if self.takes:
                    try:
                        answer = s.recv(1 << 18)
                    except BlockingIOError:
                        continue
                    except OSError:
                        pass
                if answer == b"" or self.leaves:
                    closed.append(fd)
                elif self.again:
                    self.say(s, self.first())
            for fd in closed:
                self.poll.unregister(fd)
                self.open.pop(fd).close()
            for _ in closed:
                self.add()
            if self.drip and time.monotonic() - dripped > 0.2:
                dripped = time.monotonic()
                for s in self.open.values():
                    self.say(s, self.drip())


def crowd(kind, port):
    chance = random.Random(kind)
    pick = lambda *kinds: lambda: chance.choice(kinds)
    half = b"GET /" + HEAD + b"X: "
    return {
        "1,000 silent connections": lambda: Crowd(port, 1000, lambda: b""),
        "1,984 silent connections": lambda: Crowd(port, PLACES, lambda: b""),
        "1,984 requests, a byte each 0.2 s": lambda: Crowd(port, PLACES, lambda: half, drip=lambda: b"x"),
        "1,984 clients that take no answer": lambda: Crowd(port, PLACES, pick(b"GET /uPlot.js" + HEAD + b"\r\n" * 8), takes=False, buffer=2048),
        "1,000 clients that ask without a pause": lambda: Crowd(port, 1000, pick(b"GET /metrics" + HEAD + b"\r\n", b"GET /api/status" + HEAD + b"\r\n"), again=True),
        "12 pages, opened again and again": lambda: Crowd(port, 12, lambda: b"GET /api/stream" + HEAD + b"\r\n", leaves=True),
        "200 pages of other origins and names": lambda: Crowd(port, 200, pick(*FOREIGN, *REFUSED), again=True),
        "200 clients with damaged requests": lambda: Crowd(port, 200, lambda: damaged(chance), again=True),
    }[kind]()


KINDS = ("1,000 silent connections", "1,984 silent connections", "1,984 requests, a byte each 0.2 s", "1,984 clients that take no answer",
         "1,000 clients that ask without a pause", "12 pages, opened again and again", "200 pages of other origins and names", "200 clients with damaged requests")


class Hostile:
    """A crowd in a process of its own. A context manager."""

    def __init__(self, kind, port):
        self.process = subprocess.Popen([sys.executable, __file__, "crowd", kind, str(port)], stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == "ready\n"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


def ordinary(web, seconds):
    """An open page and a client with a new connection for each request: durations of its requests, and the longest silence of the page, in
    s by a Stopwatch."""
    from daemon import Stopwatch
    from web_server import Stream
    stream = Stream(web)
    stream.until(lambda name, _: name == "frame")
    ended, silence = threading.Event(), [0.0]

    def page():
        last = watch.seconds()
        while not ended.is_set():
            stream.until(lambda name, _: name == "frame")
            silence[0], last = max(silence[0], watch.seconds() - last), watch.seconds()
    with Stopwatch() as watch:
        thread = threading.Thread(target=page)
        thread.start()
        took, until = [], time.monotonic() + seconds
        while time.monotonic() < until:
            asked = watch.seconds()
            web.status()
            took.append(watch.seconds() - asked)
            time.sleep(0.01)
        ended.set()
        thread.join()
    stream.close()
    return took, silence[0]


def main(seconds):
    from simulated_node import print_revision, simulated_node
    from web_server import TOKEN, Web
    print_revision()
    print("| beside | requests | p50 ms | p99 ms | longest ms | longest silence of a page, ms | CPU | memory |")
    for kind in (None, *KINDS, None):
        with simulated_node(16) as daemon, Web(daemon.name, token=TOKEN) as web:
            time.sleep(1.5)
            with Hostile(kind, web.port) if kind else threading.Lock():
                begun, at = web.cpu_s(), time.monotonic()
                took, silence = ordinary(web, seconds)
                share = 100 * (web.cpu_s() - begun) / (time.monotonic() - at)
                memory = web.rss_kB() / 1024
            assert all(s["tare_count"] == 0 for s in web.status()["sensors"])
        cuts = statistics.quantiles(took, n=100)
        print(f"| {kind or 'none'} | {len(took)} | " + " | ".join(f"{1000 * t:.1f}" for t in (cuts[49], cuts[98], max(took), silence)) +
              f" | {share:.0f} % | {memory:.0f} MB |", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["crowd"]:
        limit = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(limit, 8192), limit))
        made = crowd(sys.argv[2], int(sys.argv[3]))
        print("ready", flush=True)
        made.run()
    else:
        sys.path.insert(0, str(pathlib.Path(__file__).parent))
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 8)
