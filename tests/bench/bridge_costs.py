#!/usr/bin/python3
"""Costs of each bridge with 1 and 16 sensors at 1 kHz: CPU time, memory, the age of a sample when a client has it beside that at a reader of
the segment in the same run, and where samples were lost on the way to the client; and how late the daemon publishes with all bridges and
the page, beside none, in turns. Prints tables.

    /usr/bin/python3 tests/bench/bridge_costs.py bridges [SENSORS [SECONDS [NAME...]]]   6 x (SECONDS + 9); names: rdt rdt30 mqtt mqtt30 dds dds30;
        with -stopped behind it the client stands still for 0.5 s
    /usr/bin/python3 tests/bench/bridge_costs.py beside [TURNS [SECONDS]]                TURNS x (SECONDS + 3)

"bridge": samples that the bridge missed, and messages that it dropped. "on the way": messages that the broker dropped for the subscriber,
or datagrams for which the socket of a client had no room (RcvbufErrors of /proc/net/snmp)."""
import collections
import contextlib
import json
import pathlib
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/system"))
from bridge_process import Process, bridge  # noqa: E402
from daemon import BIN, free_port  # noqa: E402
from process_costs import share_and_memory  # noqa: E402
from simulated_node import Follower, print_lateness, print_revision, quantiles_us, simulated_node  # noqa: E402

DOMAIN = "81"
BROKER = shutil.which("mosquitto") or "/usr/sbin/mosquitto"
# us: of sensor s0; the others: of all sensors, but of s0 for received and expected of DDS
Got = collections.namedtuple("Got", "us received expected on_the_way")


def datagrams_without_room():
    names, values = [line.split() for line in pathlib.Path("/proc/net/snmp").read_text().splitlines() if line.startswith("Udp:")]
    return int(values[names.index("RcvbufErrors")])


class Lines:
    """A program with its output."""

    def __init__(self, *words):
        self.out = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen([str(w) for w in words], stdout=self.out)

    def end(self):
        self.process.terminate()
        self.process.wait()
        self.out.seek(0)
        return self.out.read().splitlines()


class Broker:
    def __init__(self, folder, *settings):
        self.port = free_port()
        config = folder / "mosquitto.conf"
        config.write_text("\n".join(["persistence false", f"listener {self.port} 127.0.0.1", "allow_anonymous true", "sys_interval 1", *settings]) + "\n")
        self.process = Process(BROKER, "-c", config, ready="running")

    def dropped(self):
        time.sleep(1.5)
        done = subprocess.run(["mosquitto_sub", "-p", str(self.port), "-C", "1", "-W", "5", "-t", "$SYS/broker/publish/messages/dropped"], capture_output=True, text=True)
        return int(done.stdout or 0)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.__exit__()


# ---- A client of each kind: begin() before the reader of the segment starts, end(samples of that reader) gives Got.

class Mqtt:
    kind = "mqtt"

    def __init__(self, daemon, sensors, rate_Hz):
        self.sensors, self.counts_samples = sensors, rate_Hz > 0
        self.broker = Broker(daemon.folder)
        self.words = ["--port", self.broker.port, "--rate-Hz", rate_Hz]

    def begin(self, seconds):
        self.client = Lines("mosquitto_sub", "-p", self.broker.port, "-F", "%U %t %p", "-t", "tactiled/+/+/wrench")

    def end(self, samples):
        dropped = self.broker.dropped()
        found = collections.defaultdict(list)
        for line in self.client.end():
            at, topic, text = line.split(" ", 2)
            found[topic.split("/")[2]].append((float(at), json.loads(text)))
        expected = received = 0
        for each in found.values():
            expected += each[-1][1]["sequence"] - each[0][1]["sequence"]
            received += sum(message["samples"] for _, message in each[1:]) if self.counts_samples else len(each) - 1
        assert len(found) == self.sensors
        return Got([1e6 * (at - message["t_s"]) for at, message in found["s0"]], received, expected, dropped)

    def __exit__(self, *_):
        self.broker.__exit__()


class Dds:
    kind = "dds"

    def __init__(self, daemon, sensors, rate_Hz):
        self.sensors, self.every = sensors, rate_Hz == 0
        self.words = ["--domain", DOMAIN, "--name", "bench", "--uncertain", "--rate-Hz", rate_Hz]  # a simulated table has no sd

    def begin(self, seconds):
        self.before = datagrams_without_room()
        self.client = Lines(BIN / "fastdds_reader", DOMAIN, 1000, *(f"rt/bench/s{n}/wrench" for n in range(self.sensors)))

    def end(self, samples):
        found = collections.defaultdict(list)
        for line in self.client.end():
            at, sent, name, _ = line.split(" ", 3)
            found[name].append((int(at), int(sent)))
        assert len(found) == self.sensors
        # A WrenchStamped has a time and no number: the samples of s0 are those of the reader of the segment.
        wall_ns = time.time_ns() - time.monotonic_ns()
        measured = [t_ns + wall_ns for _, t_ns, *_ in samples]
        begin, end = max(measured[0], found["s0"][0][1]) - 5e5, min(measured[-1], found["s0"][-1][1]) + 5e5
        received, expected = (sum(begin < t < end for t in times) for times in ([sent for _, sent in found["s0"]], measured))
        return Got([(at - sent) / 1000 for at, sent in found["s0"]], received, expected if self.every else received,
                   datagrams_without_room() - self.before)

    def __exit__(self, *_):
        pass


class Rdt:
    kind = "rdt"

    def __init__(self, daemon, sensors, rate_Hz):
        self.ports = [free_port() for _ in range(sensors)]
        streams = [word for n, port in enumerate(self.ports) for word in ("--sensor", f"s{n}", "--listen", f"127.0.0.1:{port}")]
        self.words = ["--zero", "mx,my,mz", "--rate-Hz", rate_Hz, *streams]

    def begin(self, seconds):
        self.before = datagrams_without_room()
        self.client = subprocess.Popen([sys.executable, __file__, "rdt-client", str(seconds + 2), *map(str, self.ports)], stdout=subprocess.PIPE, text=True)

    def end(self, samples):
        received, expected, first = json.loads(self.client.communicate(timeout=60)[0])
        measured = {number & 0xFFFFFFFF: t_ns for number, t_ns, *_ in samples}
        return Got([(at - measured[number]) / 1000 for number, at in first if number in measured], received, expected, datagrams_without_room() - self.before)

    def __exit__(self, *_):
        pass


def rdt_client(seconds, *ports):
    """Received and expected records of all streams; number of the sample and time of the first stream's records."""
    sockets = {}
    poll = select.epoll()
    for port in ports:
        s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        s.setblocking(False)
        s.connect(("127.0.0.1", int(port)))
        s.send(struct.pack("!HHI", 0x1234, 2, 0))
        sockets[s.fileno()] = (s, [])
        poll.register(s, select.EPOLLIN)
    first = next(iter(sockets))
    until, times = time.monotonic() + seconds, []
    while time.monotonic() < until:
        for fd, _ in poll.poll(0.1):
            s, numbers = sockets[fd]
            with contextlib.suppress(BlockingIOError):
                while True:
                    sequence, number = struct.unpack_from("!II", s.recv(64))
                    numbers.append(sequence)
                    if fd == first:
                        times.append((number, time.monotonic_ns()))
    for s, _ in sockets.values():
        s.send(struct.pack("!HHI", 0x1234, 0, 0))
    print(json.dumps([sum(len(n) - 1 for _, n in sockets.values()), sum(n[-1] - n[0] for _, n in sockets.values()), times]))


CLIENTS = {"rdt": (Rdt, 0), "rdt30": (Rdt, 30), "mqtt": (Mqtt, 0), "mqtt30": (Mqtt, 30), "dds": (Dds, 0), "dds30": (Dds, 30)}
STOPPED = "-stopped"


def bridges(sensors=1, seconds=15.0, *names):
    print("| bridge | sensors | CPU | memory | received | lost | bridge: missed, dropped | on the way | p50 us | p99 us | segment p50 | segment p99 |")
    for name in names or CLIENTS:
        make, rate_Hz = CLIENTS[name.removesuffix(STOPPED)]
        with simulated_node(sensors) as daemon:
            time.sleep(1)
            client = make(daemon, sensors, rate_Hz)
            with bridge(client.kind, daemon.name, *client.words) as b:
                client.begin(seconds)
                time.sleep(3)
                reader = Follower(daemon.name, "s0", seconds)
                time.sleep(1)
                if name.endswith(STOPPED):
                    process = getattr(client.client, "process", client.client)
                    process.send_signal(signal.SIGSTOP)
                    time.sleep(0.5)
                    process.send_signal(signal.SIGCONT)
                share, megabytes = share_and_memory(b.process.pid, seconds - 2)
                samples = reader.result()
                got = client.end(samples)
                b.stop()
                _, dropped, missed = b.counts()
            client.__exit__()
        own = quantiles_us([(at - t_ns) / 1000 for _, t_ns, _, at in samples])
        seen = quantiles_us(got.us)
        print(f"| {name} | {sensors} | {share:.1f} % | {megabytes:.1f} MB | {got.received} | {got.expected - got.received} | {missed}, {dropped} | {got.on_the_way} | "
              f"{seen[0]:.0f} | {seen[1]:.0f} | {own[0]:.0f} | {own[1]:.0f} |", flush=True)


@contextlib.contextmanager
def all_of_them(daemon):
    """Every bridge and the page, each with a client."""
    with contextlib.ExitStack() as stack:
        broker = stack.enter_context(Broker(daemon.folder))
        rdt, dds = Rdt(daemon, 1, 0), Dds(daemon, 1, 0)
        stack.enter_context(bridge("rdt", daemon.name, *rdt.words))
        stack.enter_context(bridge("mqtt", daemon.name, "--port", broker.port, "--rate-Hz", 0))
        stack.enter_context(bridge("dds", daemon.name, *dds.words))
        web = free_port()
        stack.enter_context(Process(BIN / "tactiled-web", "--node", daemon.name, "--listen", f"127.0.0.1:{web}", ready="http://"))
        stack.enter_context(Process("curl", "-sN", "-o", "/dev/null", f"http://127.0.0.1:{web}/api/stream"))
        rdt.begin(3600)
        stack.callback(rdt.client.kill)
        stack.callback(Lines("mosquitto_sub", "-p", broker.port, "-t", "tactiled/#").end)
        stack.callback(Lines(BIN / "fastdds_reader", DOMAIN, 1000, "rt/bench/s0/wrench").end)
        yield


def beside(turns=8, seconds=6.0):
    print_lateness(all_of_them, turns, seconds)


if __name__ == "__main__":
    what, words = sys.argv[1], sys.argv[2:]
    if what == "rdt-client":
        rdt_client(float(words[0]), *words[1:])
    else:
        print_revision()
        numbers = [kind(word) for kind, word in zip((int, float), words)]
        {"bridges": bridges, "beside": beside}[what](*numbers, *words[2:])
