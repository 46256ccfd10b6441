#!/usr/bin/python3
"""CPU time and memory of tactiled-web with 1 and 16 sensors at 1 kHz and 0, 1 and 4 pages, the same for a recording that it plays, and how
late the daemon publishes with four pages open, beside none, in turns. Prints tables.

    /usr/bin/python3 tests/web/costs.py live [SENSORS [SECONDS]]        70 s + 3 x SECONDS
    /usr/bin/python3 tests/web/costs.py recording [SENSORS [SECONDS]]   40 s + 3 x SECONDS
    /usr/bin/python3 tests/web/costs.py beside [TURNS [SECONDS]]        TURNS x (SECONDS + 2)"""
import contextlib
import pathlib
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/system"))
from daemon import wait_for  # noqa: E402
from process_costs import share_and_memory  # noqa: E402
from simulated_node import print_lateness, print_revision, simulated_node  # noqa: E402
from web_server import Stream, Web  # noqa: E402


class Pages:
    """Streams that take everything and look at nothing."""

    def __init__(self, web, count):
        self.ended = False
        self.threads = [threading.Thread(target=self.take, args=(web,)) for _ in range(count)]
        for each in self.threads:
            each.start()

    def take(self, web):
        stream = Stream(web, timeout=20)
        while not self.ended:
            stream.answer.read1(1 << 20)
        stream.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.ended = True
        for each in self.threads:
            each.join()


def print_costs(web, what, seconds):
    for pages in (0, 1, 4):
        with Pages(web, pages):
            time.sleep(2)
            share, megabytes = share_and_memory(web.process.pid, seconds)
            print(f"| {what} | {pages} | {share:.2f} % | {megabytes:.1f} MB |", flush=True)


def live(sensors=1, seconds=10.0):
    with simulated_node(sensors) as daemon, Web(daemon.name) as web:
        wait_for(lambda: web.status()["alive"], "the daemon")
        time.sleep(62)  # the history is full
        print_costs(web, f"{sensors} live", seconds)


def recording(sensors=1, seconds=10.0):
    with simulated_node(sensors) as daemon:
        file = daemon.folder / "run.mcap"
        done = daemon.ctl("record", file, "--node", daemon.name, "--seconds", "30", timeout=60)
        assert done.returncode == 0, done.stderr
        daemon.stop()
        print(f"{sensors} sensors at 1 kHz for 30 s: {file.stat().st_size / 1e6:.1f} MB")
        with Web("unused", file) as web:
            wait_for(lambda: web.status()["alive"], "the recording")
            print_costs(web, f"{sensors} recorded", seconds)


@contextlib.contextmanager
def four_pages(daemon):
    with Web(daemon.name) as web, Pages(web, 4):
        yield


def beside(turns=8, seconds=5.0):
    print_lateness(four_pages, turns, seconds)


if __name__ == "__main__":
    print_revision()
    words = sys.argv[2:]
    kinds = (int, float)
    {"live": live, "recording": recording, "beside": beside}[sys.argv[1]](*(kind(word) for kind, word in zip(kinds, words)))
