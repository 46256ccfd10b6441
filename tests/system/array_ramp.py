"""An array whose taxels all have one value that is a function of the frame's number, so that a mixture of two frames shows, and
programs that read it as fast as they can."""
import json
import math
import multiprocessing
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from array_device import ArrayDevice
from daemon import ROOT

SOURCE = pathlib.Path(__file__).parent / "array_witness.c"
COUNT_N, HALF_COUNT_N = 0.001, 0.0005


def force_N(n):
    return COUNT_N * (1000 + abs(n % 20000 - 10000))


class Ramp(ArrayDevice):
    """Sends from a process of its own. A context manager."""

    def numbers(self, _):
        return [round(force_N(self.sequence) / COUNT_N)] * (self.values * len(self.places_m))

    def start(self):
        self.process = multiprocessing.get_context("fork").Process(target=self.run, daemon=True)
        self.process.start()
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.join()
        self.socket.close()


class Witnesses:
    """Runs readers in C, C++ and Python until the end of the block; found[NAME] then has their counts. A context manager.

    reads; lost: no longer in the ring; frames: different ones with values; bad: without values; mixed: values of two frames, or
    of another one than stated; old: values beyond stale_ms; kept: values in a BAD array"""

    def __init__(self, node, sensor, stale_ms, env=os.environ):
        self.folder, self.found, self.running = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-witness-")), {}, {}
        for compiler in (["cc", "-std=gnu11"], ["c++", "-std=c++17", "-x", "c++"]):
            subprocess.run([*compiler, "-O2", "-I", ROOT / "node/include", SOURCE, "-o", self.folder / compiler[0], "-lm"], check=True)
        words = [node, sensor, str(stale_ms)]
        for program in ("cc", "c++"):
            for kind in ("newest", "history"):
                self.begin(f"{program} {kind}", [self.folder / program, *words, kind], env)
        for kind in ("numpy", "memoryview", "history"):
            self.begin(f"python {kind}", [sys.executable, "-W", "ignore", __file__, *words, kind], env)

    def begin(self, name, words, env):
        self.running[name] = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=env)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in self.running.values():
            process.send_signal(signal.SIGTERM)
        for name, process in self.running.items():
            self.found[name] = json.loads(process.communicate(timeout=60)[0])
        shutil.rmtree(self.folder)

    def faults(self):
        """The readers that have seen what no reader may see, and those that have seen nothing."""
        return {name: found for name, found in self.found.items() if found["mixed"] or found["old"] or found["kept"] or not found["frames"]}

    def __str__(self):
        return "\n".join(f"{name:17} " + ", ".join(f"{key} {value}" for key, value in found.items()) for name, found in self.found.items())


def count(array, before_ns, stale_ms, found):
    sample = array.sample
    rows = array.force_S_N.tolist()
    if sample.quality == tactiled.BAD:
        found["bad"] += 1
        found["kept"] += not all(math.isnan(f) for row in rows for f in row) or not math.isnan(array.peak_N)
        return
    expected_N = force_N(sample.device_sequence)
    found["old"] += before_ns - sample.t_ns > stale_ms * 1_000_000
    found["mixed"] += not all(abs(abs(f) - expected_N) < HALF_COUNT_N for row in rows for f in row)
    found["frames"] += sample.sequence != found["sequence"]
    found["sequence"] = sample.sequence


def history(node, sensor, found):
    """The oldest records of the ring, which the daemon is about to overwrite. The module has them for itself alone."""
    node.latest(sensor)  # attaches to a successor
    segment = node._segment
    info, ring = segment.sensors[sensor][0], segment.arrays[sensor]
    newest, components = ring.newest_number(), bin(info.taxel_components).count("1")
    oldest = max(0, newest - ring.slots)
    for number in range(oldest, min(oldest + 8, newest) + 1):
        found["reads"] += 1
        record = ring.read(number)
        if record is None:
            found["lost"] += 1
            continue
        sample = tactiled._sample(record, tactiled._COP_SD_OF_ARRAY)
        found["mixed"] += sample.sequence != number
        count(tactiled._array(record, sample, info.n_taxels, components), sample.t_ns, 0, found)


def read(node_name, sensor, stale_ms, kind):
    if kind == "memoryview":
        tactiled.numpy = None
    found = dict.fromkeys(("reads", "lost", "frames", "bad", "mixed", "old", "kept", "sequence"), 0)
    ended = []
    signal.signal(signal.SIGTERM, lambda *_: ended.append(1))
    node = None
    while not ended:
        try:
            node = node or tactiled.open(node_name)
        except tactiled.Error:
            time.sleep(0.001)
            continue
        if kind == "history":
            history(node, sensor, found)
            continue
        before_ns = time.monotonic_ns()
        array = node.array(sensor)
        found["reads"] += 1
        count(array, before_ns, int(stale_ms), found)
    del found["sequence"]
    print(json.dumps(found))


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT / "node/python"))
    import tactiled

    read(*sys.argv[1:])
