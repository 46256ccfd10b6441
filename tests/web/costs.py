#!/usr/bin/python3
"""CPU time and memory of tactiled-web with 1 and 16 sensors and 0, 1 and 4 pages; and how late a reader sees samples with pages open,
beside none, in turn. Prints tables.

    /usr/bin/python3 tests/web/costs.py [SECONDS]"""
import pathlib
import statistics
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/system"))
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402
from daemon import Daemon, wait_for  # noqa: E402
from unit_daemon import CALIBRATION  # noqa: E402
from web_server import Stream, Web  # noqa: E402

LINK = '\n[[link]]\nname = "usb{n}"\ndriver = "uart"\ndevice = "{{folder}}/dev{n}"\npath = "direct"\nformat = "lines"\nchannels = 3\nsequence = true\n'
SENSOR = '\n[[sensor]]\nname = "s{n}"\nlink = "usb{n}"\nmodel = "generic"\ncalibration = "{{folder}}/unit.toml"\nstale_ms = 500\n'
ROWS = "t_s,c1,c2,c3\n" + "".join(f"{n / 1000},{1 + n % 7 / 100},{2 + n % 5 / 100},{-3 - n % 3 / 100}\n" for n in range(105))


def daemon(sensors, rate):
    d = Daemon("".join((LINK + SENSOR).format(n=n) for n in range(sensors)))
    (d.folder / "unit.toml").write_text(CALIBRATION)
    (d.folder / "rows.csv").write_text(ROWS)
    for n in range(sensors):
        d.play("--in", d.folder / "rows.csv", "--pty", d.folder / f"dev{n}", "--format", "lines", "--sequence", "--rate", rate, "--loop")
    return d.start()


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


def costs(sensors, rate, seconds):
    with daemon(sensors, rate) as d, Web(d.name) as web:
        wait_for(lambda: web.status()["alive"], 10, "the daemon")
        time.sleep(62)  # the history is full
        for pages in (0, 1, 4):
            with Pages(web, pages):
                time.sleep(2)
                cpu, at = web.cpu_s(), time.monotonic()
                time.sleep(seconds)
                share = (web.cpu_s() - cpu) / (time.monotonic() - at)
                print(f"| {sensors} | {rate} | {pages} | {100 * share:.2f} % | {web.rss_kB() / 1024:.1f} MB |", flush=True)


def lateness(pages_of_turns, seconds):
    """us from the frame's last byte to its publication (t_published_ns - t_ns), by turns with and without pages."""
    seen = {0: [], 4: []}
    with daemon(1, 1000) as d, Web(d.name) as web:
        wait_for(lambda: web.status()["alive"], 10, "the daemon")
        for pages in pages_of_turns:
            with Pages(web, pages):
                time.sleep(1)
                until = time.monotonic() + seconds
                for sample in tactiled.open(d.name).follow("s0"):
                    if sample.t_ns:
                        seen[pages].append((sample.t_published_ns - sample.t_ns) / 1000)
                    if time.monotonic() > until:
                        break
    for pages, us in seen.items():
        cuts = statistics.quantiles(us, n=1000)
        print(f"| {pages} | {len(us)} | {cuts[499]:.1f} | {cuts[989]:.1f} | {cuts[998]:.1f} |", flush=True)


if __name__ == "__main__":
    length = float(sys.argv[1]) if len(sys.argv) > 1 else 20
    print(subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip())
    print("| sensors | Hz each | pages | CPU | memory |")
    costs(1, 1000, length)
    costs(16, 200, length)
    print("| pages | samples | p50 us | p99 us | p99.9 us | from the last byte taken to the cycle that published it")
    lateness([0, 4] * 4, length / 2)
