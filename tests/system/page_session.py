"""The sessions on pages: fenced blocks "console", where a line after "$ " is a command and the lines below it are its
output.

A line "> " continues a command. "…" in an output line stands for any text, and alone on a line for any lines. A
command with "# hardware" needs a device and is not run. All commands of a page run in one shell, in page order.
"""
import os
import pathlib
import re
import select
import signal
import subprocess
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
FENCE = re.compile(r"^```console\n(.*?)^```", re.S | re.M)
HARDWARE = "# hardware"


class Command:
    def __init__(self, page, line, text):
        self.page, self.line, self.text, self.output = page, line, text, []

    def __str__(self):
        return f"{self.page}:{self.line}: $ {self.text}"


def commands(page, text):
    """Returns the commands of a page's sessions, with the outputs on the page."""
    found = []
    for block in FENCE.finditer(text):
        first = text.count("\n", 0, block.start(1)) + 1
        current = None
        for offset, line in enumerate(block.group(1).splitlines()):
            if line.startswith("$ "):
                current = Command(page, first + offset, line[2:])
                found.append(current)
            elif current is None:
                raise ValueError(f"{page}:{first + offset}: output before the first command")
            elif line.startswith("> ") and not current.output:
                current.text += "\n" + line[2:]
            else:
                current.output.append(line)
    return found


def matches(expected, seen):
    """Returns "" or the first line of `expected` that `seen` does not have in its place."""
    def one(pattern, line):
        parts = [re.escape(" ".join(part.split())) for part in pattern.split("…")]
        return re.fullmatch(r"\s*.*?\s*".join(parts), " ".join(line.split())) is not None
    at, anything = 0, False
    for pattern in expected:
        if pattern.strip() == "…":
            anything = True
            continue
        if anything:
            while at < len(seen) and not one(pattern, seen[at]):
                at += 1
        if at >= len(seen):
            return f"{pattern!r} is missing at the end"
        if not one(pattern, seen[at]):
            return f"{pattern!r} became {seen[at]!r}"
        at, anything = at + 1, False
    return "" if at == len(seen) or anything else f"{seen[at]!r} is not on the page"


class Shell:
    """A bash in `folder`; its children end with it."""

    MARK = "--page-session-done--"

    def __init__(self, folder, env, before=()):
        self.process = subprocess.Popen([*before, "bash", "--norc", "--noprofile"], cwd=folder, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, start_new_session=True)
        os.set_blocking(self.process.stdout.fileno(), False)

    def run(self, text, timeout):
        """Returns (lines of output, exit status); raises TimeoutError after `timeout` seconds."""
        self.process.stdin.write(f"{{ {text}\n}} 2>&1; echo {self.MARK} $?\n".encode())
        self.process.stdin.flush()
        out, until = b"", time.monotonic() + timeout
        mark = re.compile(rf"^{self.MARK} (\d+)\n".encode(), re.M)
        while (done := mark.search(out)) is None:
            left = until - time.monotonic()
            if left <= 0:
                raise TimeoutError(f"no end within {timeout} s; so far: {out.decode(errors='replace')[-500:]}")
            if select.select([self.process.stdout], [], [], left)[0]:
                piece = os.read(self.process.stdout.fileno(), 65536)
                if not piece:
                    raise RuntimeError(f"the shell ended: {out.decode(errors='replace')}")
                out += piece
        return out[:done.start()].decode(errors="replace").splitlines(), int(done.group(1))

    def close(self):
        self.process.stdin.close()
        try:
            os.killpg(self.process.pid, signal.SIGTERM)
            until = time.monotonic() + 5
            while time.monotonic() < until:
                self.process.poll()  # a zombie would count as a member of the group
                os.killpg(self.process.pid, 0)
                time.sleep(0.02)
            os.killpg(self.process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        self.process.wait()
        self.process.stdout.close()


def faults(page, text, folder, env, before=(), timeout=90):
    """Returns the differences between the page's sessions and their actual output; [] if there are none. Stops at the
    first one, because later commands depend on it."""
    shell = Shell(folder, env, before)
    try:
        for command in commands(page, text):
            if HARDWARE in command.text:
                continue
            try:
                seen, _ = shell.run(command.text, timeout)
            except (TimeoutError, RuntimeError) as error:
                return [f"{command}: {error}"]
            wrong = matches(command.output, seen)
            if wrong:
                return [f"{command}: {wrong}; all of it: {seen[:20]}"]
    finally:
        shell.close()
    return []
