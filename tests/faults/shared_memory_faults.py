"""Faults of the run-time folder and of its readers."""
import subprocess
import time

from daemon import run_folder
from rig import BIN, Rig
from strikes import strike


FOLDER = run_folder()


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
        for _ in range(64):  # one after the other, because their start is not under test
            rig.readers.append(subprocess.Popen([BIN / "tactilectl", "read", "left", "--follow", "--node", rig.daemon.name], stdout=subprocess.DEVNULL))
            time.sleep(0.03)

    def end(rig):
        for reader in rig.readers:
            reader.kill()
            reader.wait()
    return strike(begin, end, lasts=2, expect=None)


def in_a_mount_namespace(prepare):
    return ("unshare", "-m", "sh", "-c", prepare + ' && exec "$@"', "sh")


def at_start(words_to_find, **keys):
    """The daemon must end at once with exit 69 and log the reason; nothing else may appear."""
    rig = Rig(**keys)
    try:
        done = subprocess.run([*rig.before, BIN / "tactiled", "--config", rig.daemon.config], capture_output=True, text=True, timeout=20, env=rig.daemon.env)
        fine = done.returncode == 69 and words_to_find in done.stderr
        return {"bad_ms": None, "reasons": "it does not start", "good_ms": 0, "lies": 0, "first_lie": "", "fine": fine,
                "note": f"exit {done.returncode}: {done.stderr.strip().splitlines()[-1][3:]}".replace("|", "/")}
    finally:
        rig.__exit__()


def full_shm():
    return at_start("no room", before=in_a_mount_namespace(f"mkdir -p {FOLDER} && mount -t tmpfs -o size=64k,mode=755 none {FOLDER}"))


def read_only_shm():
    return at_start("Read-only", before=in_a_mount_namespace(f"mkdir -p {FOLDER} && mount -t tmpfs -o ro,mode=755 none {FOLDER}"))


def squatted():
    squat = 'name=$(sed -n "s/^name = .\\(test-.*\\).$/\\1/p" "{folder}/tactiled.toml"); touch /dev/shm/tactiled.$name; chown 65534 /dev/shm/tactiled.$name'
    return at_start("belongs to user 65534", before=in_a_mount_namespace("mount -t tmpfs none /dev/shm && " + squat),
                    env={"TACTILED_RUNTIME_DIR": "/dev/shm"})
