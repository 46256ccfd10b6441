#!/usr/bin/env python3
"""Delays at every depth of the way from a device to the release daemon. Device and relays are processes (relay.py), the links
between them are ptys, connections and a veth pair; each value is the time at which it was measured."""
import concurrent.futures
import contextlib
import json
import mmap
import os
import pathlib
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/system"), str(ROOT / "node/python")]
import tactiled  # noqa: E402
from daemon import BIN, Daemon, wait_for  # noqa: E402
from freshness_test import CALIBRATION, ORDINARY_MS, SENSOR, STALE_MS, UNSEEN_MS  # noqa: E402

FIELDS = ("sequence+clock", "clock", "sequence", "none")
RANDOM = random.Random(int(os.environ.get("SEED", "23")))
LIBRARY = BIN / "libsuspend.so"
# The ordinary run has the depths alone. faults.freshness has the causes of the others in simulated time.
longer = unittest.skipUnless("LONG" in os.environ, "a longer run: LONG=1")


class Chain:
    """A device, relays and a daemon. `stages`: sinks of the device and of each relay. Each takes the commands of relay.py."""

    def __init__(self, fields, stages, keys="", rate=100, env=None, namespace=()):
        self.stack, self.began = contextlib.ExitStack(), time.monotonic()
        self.ahead_s, self.stages = 0.0, []
        self.unseen_ms = 0 if "clock" in fields else UNSEEN_MS
        source = f"device:{rate}:{fields}"
        for i, sink in enumerate(stages):
            process = subprocess.Popen([*(namespace if i == 0 else ()), sys.executable, str(ROOT / "tests/system/relay.py"), source, sink],
                                       stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ, "BEGAN_MS": str(self.began * 1000)})
            self.stack.callback(process.wait)
            self.stack.callback(process.kill)
            self.stages.append(process)
            name = process.stdout.readline().strip()
            source = f"tty:{name}" if sink == "pty" else f"tcp:{name}"
        driver = f'driver = "uart"\ndevice = "{name}"' if sink == "pty" else f'driver = "tcp"\naddress = "{name}"'
        keys += f"\nsequence = {str('sequence' in fields).lower()}\ntime_us = {str('clock' in fields).lower()}"
        self.daemon = Daemon(SENSOR.format(driver=driver, keys=keys, sensor='zero_after = "keep"').replace("rate_Hz = 100", f"rate_Hz = {rate}"), env=env)
        (self.daemon.folder / "unit.toml").write_text(CALIBRATION)

    def tell(self, command, stage=0):
        self.stages[stage].stdin.write(command + "\n")
        self.stages[stage].stdin.flush()

    def __enter__(self):
        with contextlib.ExitStack() as failed:  # no daemon or relay stays if this ends with an error
            failed.callback(self.stack.close)
            self.stack.enter_context(self.daemon)
            self.daemon.start()
            self.node = self.stack.enter_context(tactiled.open(self.daemon.name))
            wait_for(lambda: self.node.latest("s").quality == tactiled.GOOD, "a GOOD sample")
            self.watch(3)
            failed.pop_all()
        return self

    def __exit__(self, *what):
        self.stack.close()

    def age_ms(self, sample, at_s):
        return (at_s + self.ahead_s - self.began) * 1000 - sample.raw_force_S_N[2] * 1000

    def watch(self, seconds, until=None, every_s=0.002):
        """The true age of the oldest GOOD value in ms, less the delay that is not seen without a clock, and that of the youngest; a
        wrong value is far from both.

        On a busy machine this process may have to wait before or after its read: the value was read, and judged, between
        the two times. Any reader may see it as GOOD until stale_ms after its t_ns, so that age counts, too."""
        oldest, youngest, end = 0.0, 1e9, time.monotonic() + seconds
        while time.monotonic() < end and not (until and until()):
            before_s = time.monotonic()
            sample = self.node.latest("s")
            after_s = time.monotonic()
            if sample.quality == tactiled.GOOD:
                last_ms = self.age_ms(sample, sample.t_ns * 1e-9) + STALE_MS
                oldest, youngest = max(oldest, self.age_ms(sample, before_s), last_ms), min(youngest, self.age_ms(sample, after_s))
            time.sleep(every_s)
        return oldest - self.unseen_ms, youngest

    def quality(self):
        return self.node.latest("s").quality


def of_each(chains, action):
    """Runs `action` for all at once: [(what it returns, for each chain)]."""
    with concurrent.futures.ThreadPoolExecutor(len(chains)) as pool:
        return list(pool.map(action, chains))


class Witnessed(unittest.TestCase):
    def assert_young(self, seen, about):
        oldest, youngest = seen
        self.assertLess(oldest, STALE_MS + ORDINARY_MS, about)
        self.assertGreater(youngest, -20, about)


class Depths(Witnessed):
    def test_frames_that_are_held_or_late_at_any_depth_are_not_good(self):
        ends = {"pty": ["tcp:127.0.0.1", "tcp:127.0.0.1", "pty"], "tcp": ["pty", "tcp:127.0.0.1", "tcp:127.0.0.1"]}
        with contextlib.ExitStack() as stack:
            about = [(end, fields) for end in ends for fields in FIELDS[1:] if (end, fields) != ("tcp", "none")]
            chains = [Chain(fields, ends[end]) for end, fields in about]
            of_each(chains, stack.enter_context)
            for stage in range(3):
                hold_s, lag_s = RANDOM.uniform(0.5, 2), RANDOM.uniform(0.3, 3)

                def held_and_late(number, stage=stage, hold_s=hold_s, lag_s=lag_s):
                    chain, (end, fields) = chains[number], about[number]
                    # On a busy machine the connection may be opened again while the relay holds its lines.
                    chain.tell(f"keep {int(fields == 'sequence' and end == 'tcp')}", stage)
                    chain.tell(f"hold {hold_s}", stage)
                    seen = [chain.watch(hold_s + 1.5)]
                    # Without a clock, a connection that is opened again hides the delay of a relay before the last one
                    # (drivers/wire/freshness.md).
                    if end == "pty" or "clock" in fields or (fields == "sequence" and stage == 2):
                        chain.tell(f"lag {lag_s}", stage)  # a relay as fast as the device: it never catches up
                        seen.append(chain.watch(lag_s + 2))
                        chain.tell("lag 0", stage)
                        seen.append(chain.watch(lag_s + 2))
                    return seen
                for name, seen in zip(about, of_each(range(len(chains)), held_and_late)):
                    for one in seen:
                        self.assert_young(one, (name, "stage", stage, hold_s, lag_s))
            # On a busy machine a frame may be truly late at any moment, and its value BAD.
            for (end, fields), chain in zip(about, chains):
                if "clock" in fields:
                    wait_for(lambda c=chain: c.quality() == tactiled.GOOD, f"GOOD: {end}, {fields}")

    @longer
    def test_lost_bytes_swapped_and_repeated_frames_and_a_clock_that_jumps_give_no_wrong_value(self):
        with contextlib.ExitStack() as stack:
            chains = [Chain(fields, ["tcp:127.0.0.1", end]) for fields in FIELDS[:3] for end in ("pty", "tcp:127.0.0.1")]
            of_each(chains, stack.enter_context)

            def strike(chain):
                seen = []
                for lost in range(1, 17):
                    chain.tell(f"lose {lost}", 1)
                    seen.append(chain.watch(0.12))
                chain.tell("swap 1", 1)
                seen.append(chain.watch(1))
                chain.tell("swap 0", 1)
                seen.append(chain.watch(0.5))
                for jump_s in (0.5, -0.5, 100, 1000, -10):
                    chain.tell(f"jump {jump_s}")
                    # After a clock has gone back, its frames may be old ones: late for 1.1 times the jump, and at least 2 s.
                    seen.append(chain.watch(3))
                return seen
            for chain, seen in zip(chains, of_each(chains, strike)):
                for i, one in enumerate(seen):
                    self.assert_young(one, (chain.daemon.config.read_text(), i))
                wait_for(lambda c=chain: c.quality() == tactiled.GOOD, "GOOD again")

    @longer
    def test_a_lag_that_begins_with_a_leap_of_the_clock_or_with_a_start_of_the_device_is_not_good(self):
        with contextlib.ExitStack() as stack:
            chains = [Chain(fields, ["tcp:127.0.0.1"]) for fields in FIELDS[:2]]
            of_each(chains, stack.enter_context)

            def strike(chain):
                seen = []
                for words in ("jump 1.2", "restart", "kick\njump 100"):
                    chain.tell(f"keep 1\nlag 1\n{words}")
                    seen.append(chain.watch(2.5))
                    chain.tell("keep 0\nlag 0")
                    wait_for(lambda: chain.quality() == tactiled.GOOD, f"GOOD after {words}")
                return seen
            for chain, seen in zip(chains, of_each(chains, strike)):
                for i, one in enumerate(seen):
                    self.assert_young(one, (chain.daemon.config.read_text(), i))

    def test_an_old_frame_under_a_new_number_is_seen_by_the_clock_of_the_device(self):
        with Chain("sequence+clock", ["tcp:127.0.0.1", "tcp:127.0.0.1"]) as chain:
            for _ in range(5):
                chain.tell("repeat_old 1")
                self.assert_young(chain.watch(0.3), "an old frame")
            self.assertEqual(chain.quality(), tactiled.GOOD)

    def test_a_relay_that_keeps_its_frames_while_the_connection_is_opened_again_stays_unproved(self):
        with Chain("sequence", ["tcp:127.0.0.1", "tcp:127.0.0.1"]) as chain:
            chain.tell("keep 1", 1)
            chain.tell("lag 2", 1)
            self.assert_young(chain.watch(8), "kept")
            self.assertEqual(chain.quality(), tactiled.UNCERTAIN)
            status = chain.daemon.ctl("status", "--json").stdout
            self.assertGreater(int(status.split('"opened":')[1].split(",")[0]), 1, "opened again in vain")

    def test_a_lag_is_not_learned_by_a_reload(self):
        with contextlib.ExitStack() as stack:
            chains = [Chain(fields, ["tcp:127.0.0.1", "pty"]) for fields in FIELDS[1:3]]
            of_each(chains, stack.enter_context)
            for chain in chains:
                chain.tell("lag 2", 1)
            for fields, one in zip(FIELDS[1:], of_each(chains, lambda chain: chain.watch(4))):
                self.assert_young(one, (fields, "before"))
            for chain in chains:
                config = chain.daemon.config
                config.write_text(config.read_text().replace("rate_Hz = 100", "rate_Hz = 100\nrate_tolerance = 0.25"))
                chain.daemon.process.send_signal(signal.SIGHUP)
            for fields, one in zip(FIELDS[1:], of_each(chains, lambda chain: chain.watch(3))):
                self.assert_young(one, (fields, "after the reload"))
            for chain in chains:
                self.assertIn("SIGHUP: changed", chain.daemon.log())

    def test_a_device_whose_firmware_keeps_bytes_while_the_process_is_stopped(self):
        """As on a USB port: the firmware's buffer waits until the host reads again."""
        for stop_s in (0.6, 4):
            with contextlib.ExitStack() as stack:
                chains = [Chain(fields, ["pty"], 'path = "direct"', rate=1000) for fields in FIELDS[1:]]
                of_each(chains, stack.enter_context)
                for chain in chains:
                    chain.tell("fifo 4096")
                    chain.daemon.process.send_signal(signal.SIGSTOP)
                time.sleep(stop_s)
                for chain in chains:
                    chain.daemon.process.send_signal(signal.SIGCONT)
                for fields, chain, one in zip(FIELDS[1:], chains, of_each(chains, lambda chain: chain.watch(1.5))):
                    self.assert_young(one, (fields, stop_s))
                    self.assertEqual(chain.quality(), tactiled.GOOD, fields)


@unittest.skipUnless("MINUTES" in os.environ, "a longer run: MINUTES=60")
class GrowingQueues(Witnessed):
    """A gateway that passes on one line per 10 ms of its own timer, behind a device that is faster: the queue grows while
    time, number and rate look perfect."""

    GATEWAYS = {"keeps": ["keep 1"], "keeps 60": ["keep 1", "cap 60"]}
    QUEUES = [("sequence+clock", "discards", 200, 200), ("clock", "keeps", 200, 200), ("clock", "keeps 60", 50, 200),
              ("clock", "discards", 5000, 5000), ("sequence", "discards", 3000, 200), ("sequence", "keeps", 200, 200),
              ("clock", "pty", 200, 200)]  # fields, gateway, PPM, clock_ppm

    def test_an_old_value_is_never_good(self):
        seconds = 60 * float(os.environ["MINUTES"])
        with contextlib.ExitStack() as stack:
            chains = [Chain(fields, ["tcp:127.0.0.1", "pty" if gateway == "pty" else "tcp:127.0.0.1"], f"clock_ppm = {key}")
                      for fields, gateway, _, key in self.QUEUES]
            of_each(chains, stack.enter_context)
            for chain, (_, gateway, fast, _) in zip(chains, self.QUEUES):
                chain.tell(f"fast {fast}")
                for command in [*self.GATEWAYS.get(gateway, []), "pace 0.01"]:
                    chain.tell(command, 1)
            seen = of_each(chains, lambda chain: chain.watch(seconds, every_s=0.01))
            for queue, chain, one in zip(self.QUEUES, chains, seen):
                status = json.loads(chain.daemon.ctl("status", "--json").stdout)
                link, sensor = status["links"][0], status["sensors"][0]
                print(*queue, f"oldest GOOD {one[0]:.0f} ms", {k: link[k] for k in ("frames", "lost", "opened")},
                      sensor["quality"], f'{sensor["age_bound_ms"]} ms', sep="; ", flush=True)
            for queue, one in zip(self.QUEUES, seen):
                self.assert_young(one, queue)


@unittest.skipUnless("STALLS" in os.environ, "a longer run: STALLS=10")
class Stalls(Witnessed):
    """Device, gateway and daemon stand still at random times, beside twenty busy processes, for 30 s."""

    PATHS = [("sequence+clock", "tcp:127.0.0.1", ""), ("clock", "tcp:127.0.0.1", ""), ("sequence", "tcp:127.0.0.1", ""),
             ("clock", "pty", 'path = "direct"')]

    def stall(self, chain, end_s):
        while time.monotonic() < end_s:
            length_s = RANDOM.choice((0.05, 0.2, 0.8)) * RANDOM.uniform(0.5, 1.5)
            where = RANDOM.choice(("device", "gateway", "daemon"))
            if where == "daemon":
                chain.daemon.process.send_signal(signal.SIGSTOP)
                time.sleep(length_s)
                chain.daemon.process.send_signal(signal.SIGCONT)
            else:
                chain.tell(f"pause {length_s}" if where == "device" else f"hold {length_s}", int(where == "gateway"))
            time.sleep(RANDOM.uniform(0.2, 2))

    def test_each_stream_is_good_again_within_10_s(self):
        for round_ in range(int(os.environ["STALLS"])):
            with contextlib.ExitStack() as stack:
                chains = [Chain(fields, ["tcp:127.0.0.1", end], keys) for fields, end, keys in self.PATHS]
                of_each(chains, stack.enter_context)
                with contextlib.ExitStack() as busy, concurrent.futures.ThreadPoolExecutor(len(chains)) as pool:
                    for _ in range(20):
                        process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
                        busy.callback(process.wait)
                        busy.callback(process.kill)
                    end_s = time.monotonic() + 30
                    stalls = [pool.submit(self.stall, chain, end_s) for chain in chains]
                    seen = of_each(chains, lambda chain: chain.watch(30, every_s=0.01))
                    for one in stalls:
                        one.result()
                begun_s = time.monotonic()
                good_s = of_each(chains, lambda chain: wait_for(lambda: chain.quality() == tactiled.GOOD, "GOOD again")
                                 or time.monotonic() - begun_s)
                for path, one, after_s in zip(self.PATHS, seen, good_s):
                    print(round_, *path[:2], f"oldest GOOD {one[0]:.0f} ms, GOOD again after {after_s:.1f} s", sep="; ", flush=True)


@longer
class OddDevices(Witnessed):
    """Devices and servers that differ from what the formats expect (tests/faults/odd_devices.cpp)."""

    def test_a_clock_in_nanoseconds_proves_nothing(self):
        with contextlib.ExitStack() as stack:
            chains = [Chain(fields, ["tcp:127.0.0.1", end]) for fields in FIELDS[:2] for end in ("pty", "tcp:127.0.0.1")]
            of_each(chains, stack.enter_context)
            for chain in chains:
                chain.tell("unit 1000")
            of_each(chains, lambda chain: chain.watch(6))
            for chain in chains:
                chain.tell("lag 2", 1)
            for chain, one in zip(chains, of_each(chains, lambda chain: chain.watch(4))):
                self.assert_young(one, chain.daemon.config.read_text())
                self.assertEqual(chain.quality(), tactiled.UNCERTAIN)

    def test_a_server_that_sends_the_last_line_of_a_dead_device_to_each_new_connection(self):
        with contextlib.ExitStack() as stack:
            chains = [Chain(fields, ["tcp:127.0.0.1"]) for fields in FIELDS[:3]]
            of_each(chains, stack.enter_context)

            def dies(chain):
                chain.tell("retain 1")
                chain.tell("pause 6")
                time.sleep(0.2)
                seen = []
                for _ in range(5):
                    chain.tell("kick")
                    seen.append(chain.watch(1))
                return seen
            for chain, seen in zip(chains, of_each(chains, dies)):
                for one in seen:
                    self.assert_young(one, chain.daemon.config.read_text())
            for chain in chains:
                wait_for(lambda c=chain: c.quality() == tactiled.GOOD, "GOOD again")


@longer
@unittest.skipUnless(LIBRARY.exists(), "libsuspend.so was not built")
class Suspended(unittest.TestCase):
    """The machine sleeps: its processes stand still, CLOCK_MONOTONIC, too, and CLOCK_BOOTTIME goes on (tests/faults/suspend.cpp)."""

    def test_what_waited_while_the_machine_slept_is_not_good(self):
        for keys in ('path = "direct"', 'path = "network"'):
            with tempfile.NamedTemporaryFile(dir="/dev/shm") as file, contextlib.ExitStack() as stack:
                file.write(bytes(8))
                file.flush()
                clock = stack.enter_context(mmap.mmap(file.fileno(), 8))
                env = {"LD_PRELOAD": str(LIBRARY), "SUSPENDED": file.name}
                chains = [Chain(fields, ["pty"], keys, env=env) for fields in FIELDS]
                of_each(chains, stack.enter_context)
                for slept_s in (0.5, 8, 3600):
                    for chain in chains:
                        chain.tell("hold 0.15")  # these are on the way while it sleeps
                    time.sleep(0.05)
                    for chain in chains:
                        chain.daemon.process.send_signal(signal.SIGSTOP)
                    time.sleep(0.05)
                    total_ns = struct.unpack("=q", clock[:8])[0] + int(slept_s * 1e9)
                    clock[:8] = struct.pack("=q", total_ns)
                    for chain in chains:
                        chain.ahead_s = total_ns / 1e9
                        chain.tell(f"ahead {chain.ahead_s}")
                    time.sleep(0.05)
                    for chain in chains:
                        chain.daemon.process.send_signal(signal.SIGCONT)
                    time.sleep(0.02)  # a reader sees the last sample for up to one cycle of the daemon
                    for fields, (oldest, _) in zip(FIELDS, of_each(chains, lambda chain: chain.watch(1.5))):
                        self.assertLess(oldest, STALE_MS + ORDINARY_MS, (keys, fields, slept_s))
                # On a busy machine a frame may be truly late at any moment.
                for fields, chain in zip(FIELDS, chains):
                    if "clock" in fields or "direct" in keys:
                        wait_for(lambda c=chain: c.quality() == tactiled.GOOD, f"GOOD: {keys}, {fields}")


@longer
class Veth(unittest.TestCase):
    def test_a_link_of_the_network_that_goes_down_and_comes_back(self):
        if os.geteuid() != 0:
            self.skipTest("only root makes namespaces")
        if "OWN_NAMESPACE" not in os.environ:
            done = subprocess.run(["unshare", "--net", sys.executable, __file__, self.id().split(".", 1)[1]], env={**os.environ, "OWN_NAMESPACE": "1"})
            return self.assertEqual(done.returncode, 0)
        with contextlib.ExitStack() as stack:
            other = subprocess.Popen(["unshare", "--net", "sleep", "1000"])
            stack.callback(other.wait)
            stack.callback(other.kill)
            enter = ("nsenter", "--net", "--target", str(other.pid))
            time.sleep(0.2)
            for words in ("link set lo up", "link add here type veth peer name there", f"link set there netns {other.pid}",
                          "addr add 10.0.0.1/24 dev here", "link set here up"):
                subprocess.run(["ip", *words.split()], check=True)
            for words in ("link set lo up", "addr add 10.0.0.2/24 dev there", "link set there up"):
                subprocess.run([*enter, "ip", *words.split()], check=True)
            chains = [Chain(fields, ["tcp:10.0.0.2"], namespace=enter) for fields in FIELDS[1:]]
            of_each(chains, stack.enter_context)
            for end in ("here", "there", "there"):
                down_s = RANDOM.uniform(0.5, 3.9)
                before = enter if end == "there" else ()
                subprocess.run([*before, "ip", "link", "set", end, "down"], check=True)
                seen = of_each(chains, lambda chain, s=down_s: chain.watch(s))
                subprocess.run([*before, "ip", "link", "set", end, "up"], check=True)
                seen += of_each(chains, lambda chain, s=down_s: chain.watch(6))
                for fields, one in zip(FIELDS[1:] * 2, seen):
                    self.assertLess(one[0], STALE_MS + ORDINARY_MS, (fields, end, down_s))
            for fields, chain in zip(FIELDS[1:], chains):
                wait_for(lambda c=chain: c.quality() == tactiled.GOOD, f"GOOD with {fields}")


if __name__ == "__main__":
    unittest.main(warnings="ignore")
