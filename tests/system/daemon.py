"""The release programs under test: ports, ptys, configurations, start and end."""
import contextlib
import fcntl
import os
import pathlib
import random
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("TACTILED_BIN", ROOT / "build/release/bin"))
PATIENCE_S = 30  # for an event that must come; a busy machine delays a thread by several 100 ms


def run_folder(env=os.environ):
    """Returns the folder of the segments of daemons that run as this user."""
    given, users = env.get("TACTILED_RUNTIME_DIR"), env.get("XDG_RUNTIME_DIR", "/nowhere")
    return pathlib.Path(given or ("/run/tactiled" if os.geteuid() == 0 else f"{users}/tactiled"))


@contextlib.contextmanager
def folder_of_user(uid, mode=0o755):
    """Returns a folder beside run_folder() that belongs to another user; readers trust it for that user's daemon. For
    root."""
    path = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-test-", dir=run_folder({}).parent))
    try:
        os.chown(path, uid, uid)
        path.chmod(mode)
        yield path
    finally:
        shutil.rmtree(path)


def ctl(*words, **kinds):
    """Runs tactilectl to its end; kinds: of subprocess.run()."""
    return subprocess.run([BIN / "tactilectl", *map(str, words)], capture_output=True, text=True, timeout=120, **kinds)


PORTS = range(20000, 30000)  # below those that the kernel gives to clients (net.ipv4.ip_local_port_range)
_held = []  # locks of ports; they end with the process


def free_port():
    """Returns a port of this machine's loopback that no other test has: it stays locked while this process lives."""
    folder = pathlib.Path(tempfile.gettempdir()) / f"tactiled-test-ports-{os.geteuid()}"
    folder.mkdir(exist_ok=True)
    for port in random.sample(PORTS, len(PORTS)):
        lock = open(folder / str(port), "w")
        with socket.socket() as s, contextlib.suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            s.bind(("127.0.0.1", port))
            _held.append(lock)
            return port
        lock.close()
    raise RuntimeError(f"no port of {PORTS} is free")


class Daemon:
    """A tactiled with its own folder, name and port. A context manager."""

    def __init__(self, config, name=None, env=None, node=""):
        """config: TOML text; {folder} {name} {port} are filled in, [node] with the keys `node` and [modbus] are added."""
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-test-"))
        self.name = name or f"test-{os.getpid()}-{free_port()}"
        self.port = free_port()
        self.env = {**os.environ, **(env or {})}
        self.config = self.folder / "tactiled.toml"
        head = f'[node]\nname = "{self.name}"\ncontrol = "{self.folder}/control.sock"\nzeros = "{self.folder}/zeros.toml"\n{node}\n\n[modbus]\nlisten = "127.0.0.1:{self.port}"\n\n'
        self.config.write_text(head + config.replace("{folder}", str(self.folder)))
        self.process = None
        self.others = []

    def play(self, *words):
        """Plays a recorded device behind a pty, in a separate process."""
        with open(self.folder / f"play{len(self.others)}.log", "w") as log:
            process = subprocess.Popen([BIN / "tactilectl", "play", *map(str, words)], stderr=log, stdout=log)
        self.others.append(process)
        link = pathlib.Path(words[list(words).index("--pty") + 1])
        wait_for(link.is_symlink, f"{link} to appear")
        return process

    def start(self, *command):
        """command: the words of one that runs the daemon, such as prlimit."""
        with open(self.folder / "tactiled.log", "a") as log:
            before = len(self.log())  # earlier starts wrote this much
            self.process = subprocess.Popen([*command, BIN / "tactiled", "--config", self.config], stderr=log, env=self.env)
        segment = self.segment
        wait_for(lambda: segment.exists() or self.process.poll() is not None, "the segment")
        wait_for(lambda: "Modbus" in self.log()[before:] or self.process.poll() is not None, "the start")
        assert self.process.poll() is None, self.log()
        return self

    @property
    def reader_env(self):
        """Returns the environment without variables for the daemon alone, such as LD_PRELOAD."""
        return {**os.environ, **{key: value for key, value in self.env.items() if key == "TACTILED_RUNTIME_DIR"}}

    @property
    def segment(self):
        return run_folder(self.env) / f"tactiled.{self.name}"

    def log(self):
        return (self.folder / "tactiled.log").read_text()

    def ctl(self, *words, timeout=30):
        words = [str(w) for w in words] + (["--node", self.name] if words[0] in ("status", "top", "read", "tare", "clear", "weigh", "teach") else [])
        return subprocess.run([BIN / "tactilectl", *words], capture_output=True, text=True, timeout=timeout, env=self.reader_env)

    def stop(self):
        """Sends SIGTERM; returns (exit status, duration in seconds by a Stopwatch)."""
        with Stopwatch() as watch:
            self.process.send_signal(signal.SIGTERM)
            status = self.process.wait(timeout=60)
            return status, watch.seconds()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in [self.process, *self.others]:
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGTERM)
                try:
                    process.wait(timeout=60)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
        if self.segment.exists():
            self.segment.unlink()


def halt(pid):
    """Sends SIGSTOP to a process and returns when all of its threads stand still; until then they may go on."""
    os.kill(pid, signal.SIGSTOP)
    threads = pathlib.Path(f"/proc/{pid}/task")
    wait_for(lambda: all((thread / "stat").read_text().rsplit(")", 1)[1].split()[0] == "T" for thread in threads.iterdir()), "the threads to stand still")


def wait_until_it_rests(count, what, seconds=0.5):
    """Waits until count() is the same for so long: what was on its way has arrived, and nothing follows."""
    def rests():
        before = count()
        time.sleep(seconds)
        return count() == before
    wait_for(rests, f"the end of {what}")


class Stopwatch:
    """The time that passed, less the time by which this machine delayed a thread that sleeps for 5 ms again and again. For a test whose
    claim is a bound in time: a busy machine delays the programs that are measured as it delays that thread. A context manager."""

    NAP_S = 0.005

    def __init__(self):
        self.began_s, self.late_s, self.ended = time.monotonic(), 0.0, False
        self.due_s, self.lock = self.began_s + self.NAP_S, threading.Lock()  # guards late_s and due_s
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while not self.ended:
            time.sleep(self.NAP_S)
            with self.lock:
                now_s = time.monotonic()
                self.late_s += max(0.0, now_s - self.due_s)
                self.due_s = now_s + self.NAP_S

    def seconds(self):
        with self.lock:
            return min(time.monotonic(), self.due_s) - self.began_s - self.late_s

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.ended = True
        self.thread.join()


def wait_for(condition, what, seconds=PATIENCE_S):
    """Waits until condition() is true. The limit ends a test that would hang; it is no claim, and a success costs no time."""
    until = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > until:
            raise TimeoutError(f"waited {seconds} s for {what}")
        time.sleep(0.005)
