"""A daemon whose simulated sensors deliver 1,000 samples per second each, a reader of its segment as a process, and the tables of what
programs beside it cost."""
import json
import pathlib
import statistics
import subprocess
import sys
import time

from daemon import ROOT, Daemon

sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

LINK = '\n[[link]]\nname = "l{n}"\ndriver = "sim"\nscene = "{{folder}}/press.toml"\nat_end = "again"\n'
SENSOR = '\n[[sensor]]\nname = "{name}"\nlink = "l{n}"\nmodel = "table"\ncalibration = "' + str(ROOT) + '/config/calibration/table_documents.toml"\nstale_ms = 1000\n'


def simulated_node(sensors, names="s{n}", node=None):
    """Sensors s0, s1, ..., or with a list of names; started."""
    name_of = names.__getitem__ if isinstance(names, tuple) else lambda n: names.format(n=n)
    made = Daemon("[realtime]\nrequired = false\n" + "".join((LINK + SENSOR).format(n=n, name=name_of(n)) for n in range(sensors)), node)
    (made.folder / "press.toml").write_text((ROOT / "config/scenes/press_ramp.toml").read_text().split("[[expect]]")[0])
    return made.start()


def follow(node, sensor, seconds):
    """(sequence, t_ns, t_published_ns, time in ns at which this reader had it) of each sample."""
    until, seen = time.monotonic() + seconds, []
    for sample in tactiled.open(node).follow(sensor):
        if sample.t_ns and sample.quality != tactiled.BAD:  # a sample has no value when the scene begins again
            seen.append((sample.sequence, sample.t_ns, sample.t_published_ns, time.monotonic_ns()))
        if time.monotonic() > until:
            return seen


class Follower:
    """follow() in a process of its own."""

    def __init__(self, node, sensor, seconds):
        self.process = subprocess.Popen([sys.executable, __file__, node, sensor, str(seconds)], stdout=subprocess.PIPE, text=True)

    def result(self):
        return json.loads(self.process.communicate(timeout=120)[0])


def quantiles_us(us):
    """p50, p99 and p99.9."""
    cuts = statistics.quantiles(us, n=1000)
    return cuts[499], cuts[989], cuts[998]


def print_lateness(beside, turns, seconds):
    """The daemon's own latency, from the frame to its publication, in turns with and without `beside`, a function that takes the daemon
    and returns a context manager."""
    seen = {"none": [], "all": []}
    with simulated_node(1) as daemon:
        for turn in range(turns):
            if turn % 2:
                with beside(daemon):
                    time.sleep(1)
                    found = Follower(daemon.name, "s0", seconds).result()
            else:
                time.sleep(1)
                found = Follower(daemon.name, "s0", seconds).result()
            seen["all" if turn % 2 else "none"] += [(published - t_ns) / 1000 for _, t_ns, published, _ in found]
    print("| beside | samples | p50 us | p99 us | p99.9 us |")
    for which, us in seen.items():
        print(f"| {which} | {len(us)} | " + " | ".join(f"{cut:.1f}" for cut in quantiles_us(us)) + " |", flush=True)


def print_revision():
    print(subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip(),
          "load", pathlib.Path("/proc/loadavg").read_text().split()[0], flush=True)


if __name__ == "__main__":
    print(json.dumps(follow(sys.argv[1], sys.argv[2], float(sys.argv[3]))))
