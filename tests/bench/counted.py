"""Instructions that valgrind counts. Counts of one binary do not depend on other work."""
import re
import subprocess


def instructions(command):
    """The instructions of a command; None if it fails."""
    done = subprocess.run(["valgrind", "--tool=cachegrind", "--cachegrind-out-file=/dev/null", "--cache-sim=no", *map(str, command)],
                          capture_output=True, text=True, check=False)
    found = re.search(r"I\s+refs:\s+([\d,]+)", done.stderr)
    return int(found.group(1).replace(",", "")) if found and done.returncode == 0 else None


def a_step(command, short, long):
    """The instructions of one step: the difference of two runs, with `short` and `long` steps, in which the set-up cancels. `command` is
    called with a number of steps. The result is None if a run fails."""
    counts = [instructions(command(steps)) for steps in (short, long)]
    return None if None in counts else (counts[1] - counts[0]) / (long - short)
