"""Faults of the real binary: each returns what was seen. `strike()` is the usual course: begin, look, end, look."""
import contextlib
import json
import os
import pathlib
import random
import signal
import socket
import struct
import subprocess
import threading
import time

from rig import BIN, CONFIG, FROZEN_AFTER, STALE_MS, Rig, ask, count_of, line_of, tactiled, wait_for

# Ahead of what else the machine does: the daemon waits for it at each call. The daemon itself starts as ever.
STRACE = ("chrt", "-R", "-f", "50", "strace", "-f", "-qq", "-o", "/dev/null")
GOOD, UNCERTAIN, BAD = tactiled.GOOD, tactiled.UNCERTAIN, tactiled.BAD


def words(reasons):
    return ",".join(word for bit, word in enumerate(tactiled.REASON_WORDS) if reasons >> bit & 1)


def strike(begin, end=lambda rig: None, lasts=0.4, expect=BAD, both=False, recovers_s=3, then=None, **keys):
    """A fault of the left device, or of both: what the witness saw of it."""
    with Rig(**keys) as rig:
        witness, began_ns = rig.witness, time.monotonic_ns()
        begin(rig)
        began_ns = getattr(rig, "struck_ns", began_ns)  # where begin() itself takes a while
        said = None
        if expect is not None:
            seen_ns = witness.wait("left", expect, 3, f"quality {expect}")
            said = max(0, seen_ns - began_ns) / 1e6, words(witness.history["left"][-1][2])
        time.sleep(max(0, lasts - (time.monotonic_ns() - began_ns) / 1e9))
        ended_ns = time.monotonic_ns()
        end(rig)
        good_ns = witness.wait("left", GOOD, recovers_s, "GOOD again")
        time.sleep(0.3)
        return told(rig, began_ns, said, max(0, good_ns - ended_ns) / 1e6 if expect is not None else 0, both, then)


def told(rig, began_ns, said=None, good_ms=0, both=False, then=None):
    witness = rig.witness
    notes = []
    if then is not None:
        notes.append(then(rig))
    neighbour = [] if both else witness.not_good("right", began_ns)
    if neighbour:
        notes.append(f"the other sensor: {words(neighbour[0][2])}")
    if witness.history["left"][-1][1] != GOOD:
        notes.append("not GOOD at the end")
    if said is None and not both and (hurt := witness.not_good("left", began_ns)):
        notes.append(f"not GOOD: {words(hurt[0][2])}")
    return {"bad_ms": said and said[0], "reasons": said[1] if said else "", "good_ms": good_ms,
            "lies": sum(witness.lies.values()), "first_lie": witness.first_lie,
            "fine": not witness.lies and not neighbour and witness.history["left"][-1][1] == GOOD and
            not any(note.startswith("not GOOD") for note in notes),
            "note": "; ".join(note for note in notes if note)}


def counter(rig, name, link="usb_left"):
    status = json.loads(rig.daemon.ctl("status", "--json").stdout)
    return next(entry for entry in status["links"] if entry["name"] == link)[name]


def spoiled(change):
    """The left device's lines go through change(line, device)."""
    def begin(rig):
        rig.left.spoil = change

    def end(rig):
        rig.left.spoil = None
    return begin, end


def valued(change, excuse=0):
    """The left device's values go through change(values, device); the first `excuse` frames may be wrong and GOOD."""
    def begin(rig):
        left = {"n": excuse}

        def spoil(values, device):
            if left["n"] > 0:
                left["n"] -= 1
                device.excused.add(device.sequence)
            return change(values, device)
        rig.left.values_of = spoil

    def end(rig):
        rig.left.values_of = None
    return begin, end


# ---- serial ---------------------------------------------------------------------------------------------------------------

def unplugged():
    return strike(lambda rig: rig.left.unplug(), lambda rig: rig.left.plug(), then=lambda rig: f"{rig.daemon.log().count('is gone')} line in the log")


def comes_back_elsewhere():
    """The by-id name points to another tty then."""
    def elsewhere(rig):
        rig.spare = [os.openpty() for _ in range(2)]  # takes the old numbers
        rig.left.plug()
    return strike(lambda rig: rig.left.unplug(), elsewhere)


def refused_at_open():
    """EBUSY of the left port, from the start for 1 s."""
    rig = Rig(before=(*STRACE, "-P", "{folder}/left", "-e", "trace=openat", "-e",
                      "inject=openat:error=EBUSY:when=1..4"))
    return opened_late(rig)


def opened_late(rig):
    began_ns = time.monotonic_ns()
    with rig:
        starts = rig.witness.history["left"][0]
        good = next(t for t, q, _ in rig.witness.history["left"] if q == GOOD)
        said = (starts[0] - began_ns) / 1e6, words(starts[2])
        return told(rig, time.monotonic_ns(), said, (good - began_ns) / 1e6)


def garbage():
    return strike(*spoiled(lambda line, device: os.urandom(len(line))))


def flipped_bits():
    def flip(line, device):
        if device.sequence % 10:
            return line
        at = device.sequence // 10 % (len(line) - 1)
        return line[:at] + bytes([line[at] ^ 1 << device.sequence % 7]) + line[at + 1:]
    return strike(*spoiled(flip), lasts=2, expect=None, then=lambda rig: f"{counter(rig, 'lost')} lost, {counter(rig, 'bad_checksum') + counter(rig, 'bad_length') + counter(rig, 'bad_value')} told as damaged")


def too_long_lines():
    return strike(*spoiled(lambda line, device: line[:-4] + b"0" * 600 + line[-4:]))


def cut_lines():
    return strike(*spoiled(lambda line, device: line[:len(line) // 2] if device.sequence % 4 == 0 else line), lasts=2, expect=None,
                  then=lambda rig: f"{counter(rig, 'lost')} lost")


def chopped():
    def chop(line, device):
        for byte in line[:-1]:
            os.write(device.master, bytes([byte]))
        return line[-1:]
    return strike(*spoiled(chop), lasts=1, expect=None)


def gaps_repeats_and_overtakings():
    held = []

    def mix(line, device):
        kind = device.sequence % 20
        if kind == 3:
            return None
        if kind == 7:
            return line + line
        if kind == 11:
            held.append(line)
            return None
        return line + held.pop() if held else line
    return strike(*spoiled(mix), lasts=2, expect=None, then=lambda rig: f"lost {counter(rig, 'lost')}, repeated {counter(rig, 'repeated')}")


def silent():
    return strike(*spoiled(lambda line, device: None), lasts=0.5)


def two_devices_of_one_name():
    """The second one counts 5 ahead and feels what the right sensor does; who sends first, chance says."""
    dice = random.Random(1)
    excused = 19  # readings of the second one, until it is told

    def mix(line, device):
        nonlocal excused
        number = device.sequence + 5
        second = line_of(number, [count_of(device.index + 1, number, k) for k in range(3)])
        if excused > 0:
            device.excused.add(number)
            excused -= 1
        return line + second if dice.random() < 0.5 else second + line
    return strike(*spoiled(mix), lasts=1, recovers_s=5, then=lambda rig: f"repeated {counter(rig, 'repeated')}")


def half_rate():
    def slow(rig):
        rig.left.period_s = 0.02

    def back(rig):
        rig.left.period_s = 0.01
    return strike(slow, back, lasts=2.5, expect=None, then=lambda rig: "told: wrong-rate" if any(r & tactiled.WRONG_RATE for _, _, r in rig.witness.history["left"]) else "not GOOD: nothing was told")


def interrupted_calls():
    return strike(lambda rig: None, lasts=3, expect=None, before=(*STRACE, "-e", "trace=read,write,ppoll", "-e",
                                                                   "inject=read:error=EINTR:when=100+7", "-e", "inject=ppoll:error=EINTR:when=100+5"))


def stopped_200_ms():
    return strike(lambda rig: rig.daemon.process.send_signal(signal.SIGSTOP), lambda rig: rig.daemon.process.send_signal(signal.SIGCONT), lasts=0.2, both=True)


def another_opens_it():
    def steal(rig):
        rig.thief = os.open(rig.left.slave_path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        rig.stop = threading.Event()

        def read():
            while not rig.stop.is_set():
                try:
                    os.read(rig.thief, 4096)
                except BlockingIOError:
                    pass
                time.sleep(0.001)
        rig.reads = threading.Thread(target=read)
        rig.reads.start()

    def give_back(rig):
        rig.stop.set()
        rig.reads.join()
        os.close(rig.thief)
    return strike(steal, give_back, lasts=2, expect=None, both=True, then=lambda rig: f"{counter(rig, 'lost')} lost")


# ---- values ---------------------------------------------------------------------------------------------------------------

def frozen():
    at = {}
    return strike(*valued(lambda values, device: at.setdefault(id(device), values), excuse=FROZEN_AFTER), lasts=0.6)


def all_zeros():
    return strike(*valued(lambda values, device: [0, 0, 0], excuse=FROZEN_AFTER), lasts=0.6)


def at_its_rail():
    return strike(*valued(lambda values, device: [*values[:2], 8388607]), expect=UNCERTAIN)


def impossible_step():
    return strike(*valued(lambda values, device: [values[0] + 200000 * (device.sequence % 9 == 0), *values[1:]]), lasts=1, expect=UNCERTAIN)


def not_a_number():
    return strike(*valued(lambda values, device: [values[0], "nan", values[2]]))


def infinite():
    return strike(*valued(lambda values, device: [values[0], "inf", values[2]]), lasts=0.5)


def tare_while_bad():
    def begin(rig):
        rig.left.spoil = lambda line, device: None
        rig.witness.wait("left", BAD, 3, "BAD")
        done = rig.daemon.ctl("tare", "left")
        rig.note = f"refused: exit {done.returncode}" if done.returncode == 1 else "not GOOD: a tare was taken"

    def end(rig):
        rig.left.spoil = None
    return strike(begin, end, lasts=0, then=lambda rig: rig.note)


def refused_tare(why, config, values_of):
    """tactilectl tare of the left sensor is refused for `why`, told in the log and in WARN, and the force stays as it is."""
    def begin(rig):
        rig.left.values_of = values_of
        rig.left.excused.update(range(rig.left.sequence, rig.left.sequence + 1000))  # of another truth
        time.sleep(0.1)
        done = rig.daemon.ctl("tare", "left")
        warned = ask_once(rig, 9)[0] & 1 << 4
        tared = json.loads(rig.daemon.ctl("status", "--json").stdout)["sensors"][0]["tare_count"]
        wait_for(lambda: "tare refused: " in rig.daemon.log(), 1, "a line in the log")
        good = done.returncode == 1 and why in done.stderr and warned and tared == 0
        rig.note = f"refused: exit 1, {why}" if good else f"not GOOD: exit {done.returncode}, {done.stdout}{done.stderr}, WARN {warned}, {tared} tares"

    def end(rig):
        rig.left.values_of = None
    # Begin and end are steps, and told as such.
    return strike(begin, end, lasts=0, expect=None, both=True, config=config, then=lambda rig: rig.note)


def ask_once(rig, at, count=1):
    with socket.create_connection(("127.0.0.1", rig.daemon.port), timeout=1) as client:
        return ask(client, at, count)


def tare_in_motion():
    """The force grows by 10 N a second."""
    return refused_tare("the force of a sensor moved", CONFIG, lambda values, device: [v + 100 * (device.sequence % 512) for v in values])


def tare_under_load():
    """20 N on each axis, at rest."""
    return refused_tare("under load", CONFIG.replace('name = "left"\nlink', 'name = "left"\ntare_limit_N = 5\nlink'),
                        lambda values, device: [20000 + v % 50 for v in values])


def redundant_sensors_differ():
    """The left sensor's force creeps away from the right one's by 40 N a second. 32 frames: until they are 45 N apart, and for agree_ms."""
    since = {}

    def creep(values, device):
        first = since.setdefault("left", device.sequence)
        return [v - 400 * min(device.sequence - first, 75) for v in values]

    def then(rig):
        found = [r for _, q, r in rig.witness.history["right"] if q == UNCERTAIN]
        faults = {values[58 + 1] for _, values in rig.witness.registers}
        return "both told, FAULT 19" if found and all(r == tactiled.SENSORS_DIFFER for r in found) and 19 in faults else \
            f"not GOOD: the right one said {found}, FAULT {faults}"
    pair = CONFIG.replace('name = "left"\nlink', 'name = "left"\nagrees_with = "right"\nagree_N = 45\nagree_ms = 100\nlink')
    return strike(*valued(creep, 32), expect=UNCERTAIN, lasts=1, both=True, config=pair, then=then)


def counter_wraps():
    return strike(lambda rig: None, lasts=2.5, expect=None, first=0xFFFFFFFF - 100, then=lambda rig: f"lost {counter(rig, 'lost')}")


# ---- shared memory and processes ---------------------------------------------------------------------------------------------

def end_daemon(rig, number):
    rig.daemon.process.send_signal(number)
    rig.daemon.process.wait()


def runaway_thread():
    """The pipeline's thread runs without end, under the limits of the unit: SIGXCPU. Who starts it again is systemd."""
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
            wait_for(lambda: len(rig.witness.epochs["left"]) > epochs, 5, "a value of the successor")
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


def readers_killed():
    def begin(rig):
        for _ in range(50):
            reader = subprocess.Popen([BIN / "tactilectl", "read", "left", "--follow", "--node", rig.daemon.name], stdout=subprocess.DEVNULL)
            time.sleep(0.01)
            reader.kill()
            reader.wait()
    return strike(begin, lasts=0.1, expect=None)


def many_readers():
    def begin(rig):
        rig.readers = []
        for _ in range(64):  # one after the other: their start is not what is asked
            rig.readers.append(subprocess.Popen([BIN / "tactilectl", "read", "left", "--follow", "--node", rig.daemon.name], stdout=subprocess.DEVNULL))
            time.sleep(0.03)

    def end(rig):
        for reader in rig.readers:
            reader.kill()
            reader.wait()
    return strike(begin, end, lasts=2, expect=None)


def flapping():
    def begin(rig):
        until = time.monotonic() + 3
        while time.monotonic() < until:
            rig.left.unplug()
            time.sleep(0.005)
            rig.left.plug()
            time.sleep(0.005)
        rig.struck_ns = time.monotonic_ns()
        rig.left.unplug()
    return strike(begin, lambda rig: rig.left.plug(), lasts=0, recovers_s=4, then=lambda rig: f"{len(rig.daemon.log().splitlines())} lines in the log")


def closed_descriptors():
    """Standard input, output and error are closed: nothing of ours may take their numbers and be written to as a log."""
    return strike(lambda rig: rig.left.unplug(), lambda rig: rig.left.plug(), before=("sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh"), log=-1)


def full_log_pipe():
    """Nobody reads the pipe that it logs into, and the pipe is full: a loose plug makes it log more."""
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


def in_a_mount_namespace(prepare):
    return ("unshare", "-m", "sh", "-c", prepare + ' && exec "$@"', "sh")


def at_start(words_to_find, **keys):
    """The daemon must end at once with exit 69 and say why; nothing else is seen."""
    rig = Rig(**keys)
    try:
        done = subprocess.run([*rig.before, BIN / "tactiled", "--config", rig.daemon.config], capture_output=True, text=True, timeout=20)
        fine = done.returncode == 69 and words_to_find in done.stderr
        return {"bad_ms": None, "reasons": "it does not start", "good_ms": 0, "lies": 0, "first_lie": "", "fine": fine,
                "note": f"exit {done.returncode}: {done.stderr.strip().splitlines()[-1][3:]}".replace("|", "/")}
    finally:
        rig.__exit__()


def full_shm():
    return at_start("no room", before=in_a_mount_namespace("mount -t tmpfs -o size=64k none /dev/shm"))


def read_only_shm():
    return at_start("/dev/shm", before=in_a_mount_namespace("mount -t tmpfs -o ro none /dev/shm"))


def squatted():
    squat = 'name=$(sed -n "s/^name = .\\(test-.*\\).$/\\1/p" "{folder}/tactiled.toml"); touch /dev/shm/tactiled.$name; chown 65534 /dev/shm/tactiled.$name'
    return at_start("belongs to user 65534", before=in_a_mount_namespace("mount -t tmpfs none /dev/shm && " + squat))


# ---- network -----------------------------------------------------------------------------------------------------------------

def connect(rig):
    return socket.create_connection(("127.0.0.1", rig.daemon.port), timeout=2)


def slow_client():
    def begin(rig):
        rig.slow, rig.closed = connect(rig), "not GOOD: left open; "
        before = rig.witness.answers
        for byte in struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, 0, 10)[:6]:
            try:
                rig.slow.send(bytes([byte]))
            except OSError:
                rig.closed = "closed; "
                break
            time.sleep(0.3)
        rig.answers = rig.witness.answers - before
    return strike(begin, lambda rig: rig.slow.close(), lasts=0, expect=None, then=lambda rig: f"{rig.closed}{rig.answers} answers to the other client meanwhile")


def flood_of_connections():
    def begin(rig):
        before = rig.witness.answers
        rig.flood = []
        for _ in range(300):
            try:
                rig.flood.append(connect(rig))
            except OSError:
                pass
        time.sleep(1)
        rig.answers = rig.witness.answers - before
    return strike(begin, lambda rig: [c.close() for c in rig.flood], lasts=0, expect=None, then=lambda rig: f"{rig.answers} answers to the other client meanwhile")


def client_that_never_reads():
    def begin(rig):
        rig.deaf = connect(rig)
        rig.deaf.setblocking(False)
        request = struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, 0, 125)
        until = time.monotonic() + 1
        while time.monotonic() < until:
            try:
                rig.deaf.send(request * 50)
            except OSError:
                time.sleep(0.01)
    return strike(begin, lambda rig: rig.deaf.close(), lasts=0, expect=None, then=lambda rig: f"{rig.witness.answers} answers to the other client")


def reset_in_the_middle():
    def begin(rig):
        for _ in range(200):
            c = connect(rig)
            c.send(b"\0\1\0\0\0\6\1")
            c.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            c.close()
    return strike(begin, lasts=0.3, expect=None, then=lambda rig: f"{len(os.listdir(f'/proc/{rig.daemon.process.pid}/fd'))} descriptors")


def failing_accepts():
    return strike(lambda rig: [connect(rig).close() for _ in range(20)], lasts=0.5, expect=None, before=(
        *STRACE, "-e", "trace=accept4,sendto", "-e", "inject=accept4:error=ECONNABORTED:when=3+3"))


def few_descriptors():
    def begin(rig):
        rig.many = []
        for _ in range(60):
            try:
                rig.many.append(connect(rig))
            except OSError:
                break
        rig.left.unplug()
    def end(rig):
        for c in rig.many:
            c.close()
        rig.left.plug()
    return strike(begin, end, lasts=1, before=("prlimit", "--nofile=40:40"))


# ---- time ---------------------------------------------------------------------------------------------------------------------

def in_time_namespace(uptime_s):
    """The witness' clock is not the daemon's there: asked is the PLC, whose server is."""
    rig = Rig(before=("unshare", "-T", "--monotonic", str(uptime_s), "--boottime", str(uptime_s)))
    try:
        rig.daemon.start(*rig.before)
        with socket.create_connection(("127.0.0.1", rig.daemon.port), timeout=2) as client:
            wait_for(lambda: ask(client, 10, 1)[0] == 3, 5, "both sensors to be ok")
            not_ok, ages, until = 0, [], time.monotonic() + 15  # 2^32 ms are passed 7 s after the start
            while time.monotonic() < until:
                values = ask(client, 0, 32)
                not_ok += values[10] != 3
                ages.append(values[6])
                time.sleep(0.005)
            began_ns = time.monotonic_ns()
            rig.left.unplug()
            wait_for(lambda: ask(client, 10, 1)[0] == 2, 2, "the left one to be BAD")
            bad_ms = (time.monotonic_ns() - began_ns) / 1e6
            ended_ns = time.monotonic_ns()
            rig.left.plug()
            wait_for(lambda: ask(client, 10, 1)[0] == 3, 3, "GOOD again")
            return {"bad_ms": bad_ms, "reasons": "disconnected", "good_ms": (time.monotonic_ns() - ended_ns) / 1e6, "lies": 0, "first_lie": "", "fine": not_ok == 0 and max(ages) < STALE_MS,
                    "note": f"{len(ages)} answers over the wrap, {not_ok} of them without a sensor, oldest frame {max(ages)} ms"}
    finally:
        rig.__exit__()
