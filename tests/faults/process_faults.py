"""The daemon's process: killed, stopped, started twice or in an unusual environment, out of control."""
import contextlib
import os
import pathlib
import signal
import socket
import subprocess
import time

from rig import BIN, STALE_MS, Rig, ask, wait_for
from strikes import strike


def end_daemon(rig, number):
    rig.daemon.process.send_signal(number)
    rig.daemon.process.wait()


def runaway_thread():
    """The pipeline's thread runs in an endless loop, under the limits of the unit: SIGXCPU. systemd would start the
    daemon again."""
    def begin(rig):
        pid = next(p for p in rig.pids())
        threads = {(task / "comm").read_text().strip(): task.name for task in pathlib.Path(f"/proc/{pid}/task").iterdir()}
        subprocess.run([BIN / "runaway", threads["pipeline"]], check=True)
        ended = rig.daemon.process.wait(timeout=5)
        rig.note = "ended by SIGXCPU" if ended == -signal.SIGXCPU else f"not GOOD: ended with {ended}"
    return strike(begin, lambda rig: rig.daemon.start(), lasts=0.3, both=True, before=("prlimit", "--rttime=200000:1000000", "--core=0"),
                  then=lambda rig: rig.note)


def killed():
    return strike(lambda rig: end_daemon(rig, signal.SIGKILL), lambda rig: rig.daemon.start(), lasts=0.3, both=True,
                  then=lambda rig: f"{len(rig.witness.epochs['left'])} epochs")


def terminated():
    def begin(rig):
        began = time.monotonic()
        end_daemon(rig, signal.SIGTERM)
        rig.took = time.monotonic() - began
    return strike(begin, lambda rig: rig.daemon.start(), lasts=0.3, both=True, then=lambda rig: f"ended in {rig.took * 1000:.0f} ms with {rig.daemon.process.poll() or 0}")


def killed_ten_times():
    def begin(rig):
        for _ in range(10):
            epochs = len(rig.witness.epochs["left"])
            end_daemon(rig, signal.SIGKILL)
            rig.daemon.start()
            wait_for(lambda: len(rig.witness.epochs["left"]) > epochs, "a value of the successor")
            time.sleep(rig.random.uniform(0, 0.1))
        rig.struck_ns = time.monotonic_ns()
        end_daemon(rig, signal.SIGKILL)
    return strike(begin, lambda rig: rig.daemon.start(), lasts=0, both=True, then=lambda rig: f"{len(rig.witness.epochs['left'])} epochs")


def started_twice():
    def begin(rig):
        second = subprocess.run([BIN / "tactiled", "--config", rig.daemon.config], capture_output=True, text=True, timeout=10)
        rig.second = f"exit {second.returncode}, names pid {rig.daemon.process.pid}" if str(rig.daemon.process.pid) in second.stderr else "not GOOD: no pid"
    return strike(begin, lasts=0.2, expect=None, then=lambda rig: rig.second)


def stalled_2_s():
    def burst(rig):
        heartbeats = [values[5] for _, values in rig.witness.registers]
        return f"heartbeat {heartbeats[0]} to {heartbeats[-1]}"
    return strike(lambda rig: rig.daemon.process.send_signal(signal.SIGSTOP), lambda rig: rig.daemon.process.send_signal(signal.SIGCONT), lasts=2, both=True, then=burst)


def stopped_10_s():
    return strike(lambda rig: rig.daemon.process.send_signal(signal.SIGSTOP), lambda rig: rig.daemon.process.send_signal(signal.SIGCONT), lasts=10, both=True)


def signals():
    def begin(rig):
        for number in (signal.SIGPIPE, signal.SIGWINCH, signal.SIGURG, signal.SIGCHLD, signal.SIGCONT):
            rig.daemon.process.send_signal(number)
    return strike(begin, lasts=0.5, expect=None)


def closed_descriptors():
    """Standard input, output and error are closed: no file of the daemon may get their numbers and be written to as a
    log."""
    return strike(lambda rig: rig.left.unplug(), lambda rig: rig.left.plug(), before=("sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh"), log=-1)


def full_log_pipe():
    """The pipe for the log has no reader and is full, and a loose plug causes further log lines."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    for size in (4096, 1):
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(writer, bytes(size))
    os.set_blocking(writer, True)

    def begin(rig):
        for _ in range(4):
            rig.left.unplug()
            time.sleep(0.05)
            rig.left.plug()
            time.sleep(1.2)
        rig.struck_ns = time.monotonic_ns()
        rig.left.unplug()
    try:
        return strike(begin, lambda rig: rig.left.plug(), lasts=0, recovers_s=4, log=writer)
    finally:
        os.close(reader)
        os.close(writer)


def other_locale_and_empty_environment():
    return strike(lambda rig: None, lasts=0.5, expect=None, before=("env", "-i", "LC_ALL=de_DE.UTF-8"))


def in_time_namespace(uptime_s):
    """The witness' clock differs from the daemon's there, so the PLC is asked, whose server uses the daemon's clock."""
    rig = Rig(before=("unshare", "-T", "--monotonic", str(uptime_s), "--boottime", str(uptime_s)))
    try:
        rig.daemon.start(*rig.before)
        with socket.create_connection(("127.0.0.1", rig.daemon.port), timeout=2) as client:
            wait_for(lambda: ask(client, 10, 1)[0] == 3, "both sensors to be ok")
            not_ok, ages, until = 0, [], time.monotonic() + 15  # 2^32 ms have passed 7 s after the start
            while time.monotonic() < until:
                values = ask(client, 0, 32)
                not_ok += values[10] != 3
                ages.append(values[6])
                time.sleep(0.005)
            began_ns = time.monotonic_ns()
            rig.left.unplug()
            wait_for(lambda: ask(client, 10, 1)[0] == 2, "the left one to be BAD")
            bad_ms = (time.monotonic_ns() - began_ns) / 1e6
            ended_ns = time.monotonic_ns()
            rig.left.plug()
            wait_for(lambda: ask(client, 10, 1)[0] == 3, "GOOD again")
            return {"bad_ms": bad_ms, "reasons": "disconnected", "good_ms": (time.monotonic_ns() - ended_ns) / 1e6, "lies": 0, "first_lie": "", "fine": not_ok == 0 and max(ages) < STALE_MS,
                    "note": f"{len(ages)} answers over the wrap, {not_ok} of them without a sensor, oldest frame {max(ages)} ms"}
    finally:
        rig.__exit__()
