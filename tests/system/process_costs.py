"""CPU time and memory of a running process, from /proc."""
import os
import pathlib
import time


def cpu_s(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def status(pid, field):
    """A number of /proc/PID/status, such as VmRSS in kB."""
    lines = pathlib.Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(field + ":"))


def share_and_memory(pid, seconds):
    """Per cent of a CPU over `seconds`, and MB at the end."""
    begun, at = cpu_s(pid), time.monotonic()
    time.sleep(seconds)
    return 100 * (cpu_s(pid) - begun) / (time.monotonic() - at), status(pid, "VmRSS") / 1024


def switches(pid):
    """How often each thread has begun to wait: {(thread id, name): number}."""
    counts = {}
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        fields = dict(line.split(":\t") for line in (task / "status").read_text().splitlines() if ":\t" in line)
        counts[int(task.name), fields["Name"]] = int(fields["voluntary_ctxt_switches"])
    return counts
