#!/usr/bin/python3
"""Costs of each bridge with 1 and 16 sensors at 1 kHz: CPU time, memory, and the age of a sample when a client has it, beside a reader of the
segment in the same run; and the daemon's latency with all bridges running, beside none, in turns. Prints tables.

    /usr/bin/python3 tests/bench/bridge_costs.py [SECONDS]"""
import json
import pathlib
import shutil
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/system"))
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402
from bridge_process import Process, bridge  # noqa: E402
from daemon import BIN, Daemon, free_port  # noqa: E402

DOMAIN = "81"
LINK = '\n[[link]]\nname = "l{n}"\ndriver = "sim"\nscene = "{{folder}}/press.toml"\nat_end = "again"\n'
SENSOR = '\n[[sensor]]\nname = "s{n}"\nlink = "l{n}"\nmodel = "table"\ncalibration = "' + str(ROOT) + '/config/calibration/table_documents.toml"\nstale_ms = 1000\n'
BROKER = shutil.which("mosquitto") or "/usr/sbin/mosquitto"


def daemon(sensors):
    made = Daemon("[realtime]\nrequired = false\n" + "".join((LINK + SENSOR).format(n=n) for n in range(sensors)))
    (made.folder / "press.toml").write_text((ROOT / "config/scenes/press_ramp.toml").read_text().split("[[expect]]")[0])
    return made.start()


# ---- clients, each a process of its own that prints numbers at its end

def rdt_client(port, seconds):
    """(sequence of the sample, time in ns since boot)"""
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.settimeout(1)
    s.sendto(struct.pack("!HHI", 0x1234, 2, 0), ("127.0.0.1", port))
    until, seen = time.monotonic() + seconds, []
    while time.monotonic() < until:
        data = s.recv(64)
        seen.append((struct.unpack_from("!I", data, 4)[0], time.monotonic_ns()))
    s.sendto(struct.pack("!HHI", 0x1234, 0, 0), ("127.0.0.1", port))
    print(json.dumps(seen))


def follow(node, sensor, seconds):
    """(sequence, t_ns, t_published_ns, time in ns at which this reader had it)"""
    until, seen = time.monotonic() + seconds, []
    for sample in tactiled.open(node).follow(sensor):
        if sample.t_ns:
            seen.append((sample.sequence, sample.t_ns, sample.t_published_ns, time.monotonic_ns()))
        if time.monotonic() > until:
            break
    print(json.dumps(seen))


def client(*words):
    return subprocess.Popen([sys.executable, __file__, *map(str, words)], stdout=subprocess.PIPE, text=True)


def result(process):
    return json.loads(process.communicate(timeout=120)[0])


def lines(*words):
    out = tempfile.TemporaryFile("w+")
    process = subprocess.Popen([str(w) for w in words], stdout=out)

    def end():
        process.terminate()
        process.wait()
        out.seek(0)
        return out.read().splitlines()
    return end


def costs(sensors, seconds):
    ports = [free_port() for _ in range(sensors)]
    with daemon(sensors) as d:
        time.sleep(1)
        broker_port = free_port()
        config = d.folder / "mosquitto.conf"
        config.write_text(f"persistence false\nlistener {broker_port} 127.0.0.1\nallow_anonymous true\n")
        streams = [w for n, port in enumerate(ports) for w in ("--sensor", f"s{n}", "--listen", f"127.0.0.1:{port}")]
        with Process(BROKER, "-c", config, ready="running"):
            for name, words in (("rdt", ["--zero", "mx,my,mz", *streams]), ("mqtt", ["--port", broker_port, "--rate-Hz", "0"]),
                                ("mqtt, 30 Hz", ["--port", broker_port, "--rate-Hz", "30"]),
                                ("dds", ["--domain", DOMAIN, "--name", "bench"])):
                kind = name.split(",")[0]
                with bridge(kind, d.name, *words) as b:
                    end = clients = None
                    if kind == "mqtt":
                        end = lines("mosquitto_sub", "-p", broker_port, "-F", "%U %t %p", "-t", "tactiled/+/+/wrench")
                    if kind == "dds":
                        end = lines(BIN / "fastdds_reader", DOMAIN, 1000, *(f"rt/bench/s{n}/wrench" for n in range(sensors)))
                    time.sleep(3)
                    reader = client("follow", d.name, "s0", seconds)
                    if kind == "rdt":
                        clients = [client("rdt", port, seconds) for port in ports]
                    time.sleep(1)
                    cpu, at = b.cpu_s(), time.monotonic()
                    time.sleep(seconds - 2)
                    share = 100 * (b.cpu_s() - cpu) / (time.monotonic() - at)
                    rss = b.status("VmRSS") / 1024
                    segment = result(reader)
                    got = [result(c) for c in clients or []]
                    texts = end() if end else []
                own = [(t - t_ns) / 1000 for _, t_ns, _, t in segment]
                wall_ns = time.time_ns() - time.monotonic_ns()
                if kind == "rdt":
                    times = {number & 0xFFFFFFFF: t_ns for number, t_ns, *_ in segment}
                    us = [(t - times[number]) / 1000 for number, t in got[0] if number in times]
                    expected = got[0][-1][0] - got[0][0][0] + 1
                    lost = expected - len(got[0])
                else:
                    if kind == "mqtt":
                        found = [(float(a), t.split("/")[2], json.loads(p)) for a, t, p in (line.split(" ", 2) for line in texts)]
                        us = [1e6 * (a - m["t_s"]) for a, s, m in found if s == "s0" and m["t_s"]]
                        numbers = [m["sequence"] for _, s, m in found if s == "s0"]
                        lost = numbers[-1] - numbers[0] + 1 - (len(numbers) if "Hz" not in name else sum(m["samples"] for _, s, m in found if s == "s0") - found[0][2]["samples"] + 1)
                    else:
                        found = [line.split(" ") for line in texts if line.split(" ")[2] == "s0"]
                        us = [(int(a) - int(t)) / 1000 for a, t, *_ in found]
                        begin, last = segment[0][1] + wall_ns, segment[-1][1] + wall_ns
                        lost = len(segment) - sum(begin - 5e5 <= int(t) <= last + 5e5 for _, t, *_ in found)
                half = len(us) // 2
                cuts, base = statistics.quantiles(us[half:] if len(us) > 2000 else us, n=100), statistics.quantiles(own, n=100)
                print(f"| {name} | {sensors} | {share:.1f} % | {rss:.1f} MB | {len(us)} | {lost} | {cuts[49]:.0f} | {cuts[98]:.0f} | {base[49]:.0f} | {base[98]:.0f} |", flush=True)


def beside(turns, seconds):
    """The daemon's own latency, from the frame to its publication, with all bridges and their clients, and without."""
    seen = {False: [], True: []}
    with daemon(1) as d:
        config = d.folder / "mosquitto.conf"
        port, rdt_port = free_port(), free_port()
        config.write_text(f"persistence false\nlistener {port} 127.0.0.1\nallow_anonymous true\n")
        for turn in range(turns):
            all_of_them = turn % 2 == 1
            if all_of_them:
                made = [Process(BROKER, "-c", config, ready="running"), bridge("rdt", d.name, "--zero", "mx,my,mz", "--listen", f"127.0.0.1:{rdt_port}"),
                        bridge("mqtt", d.name, "--port", port, "--rate-Hz", "0"), bridge("dds", d.name, "--domain", DOMAIN, "--name", "bench"),
                        Process(BIN / "tactiled-web", "--node", d.name, "--listen", f"127.0.0.1:{free_port()}", ready="http://")]
                ends = [lines("mosquitto_sub", "-p", port, "-t", "tactiled/#"), lines(BIN / "fastdds_reader", DOMAIN, 1000, "rt/bench/s0/wrench")]
                stream = client("rdt", rdt_port, seconds)
            time.sleep(1)
            seen[all_of_them] += [(published - t_ns) / 1000 for _, t_ns, published, _ in result(client("follow", d.name, "s0", seconds))]
            if all_of_them:
                stream.communicate()
                for end in ends:
                    end()
                for each in reversed(made):
                    each.__exit__()
    for all_of_them, us in seen.items():
        cuts = statistics.quantiles(us, n=1000)
        print(f"| {'all' if all_of_them else 'none'} | {len(us)} | {cuts[499]:.1f} | {cuts[989]:.1f} | {cuts[998]:.1f} |", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["rdt"]:
        rdt_client(int(sys.argv[2]), float(sys.argv[3]))
    elif sys.argv[1:2] == ["follow"]:
        follow(sys.argv[2], sys.argv[3], float(sys.argv[4]))
    else:
        length = float(sys.argv[1]) if len(sys.argv) > 1 else 15
        print(subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip())
        print("| bridge | sensors at 1 kHz | CPU | memory | messages | lost | p50 us | p99 us | segment p50 | segment p99 |")
        costs(1, length)
        costs(16, length)
        print("| bridges | samples | p50 us | p99 us | p99.9 us | from the frame to its publication")
        beside(8, length / 2)
