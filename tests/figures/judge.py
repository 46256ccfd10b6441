"""The value of a figure in the output of its command, and the judgement whether it lies within its interval."""
import os
import pathlib
import re
import time

BUSY_SHARE = 0.05  # share of the processors above which the machine is not idle


class Unreadable(Exception):
    """The output has no value for a figure."""


def number(text):
    return float(text.replace(",", ""))


def value_of(figure, output):
    if figure.how == "status":
        return 0.0
    found = list(re.finditer(figure.read, output, re.MULTILINE))
    if figure.how == "count":
        return float(len(found))
    if not found:
        raise Unreadable(f"{figure.id}: nothing in the output matches {figure.read!r}")
    if figure.how == "ratio":
        return number(found[0]["of"]) / number(found[0]["over"])
    values = [number(match[1]) for match in found]
    return {"value": lambda v: v[0], "last": lambda v: v[-1], "max": max, "min": min, "sum": sum}[figure.how](values)


def machine():
    """Identifies the machine by the model of its processors and their number."""
    model = re.search(r"model name\s*:\s*(.+)", pathlib.Path("/proc/cpuinfo").read_text())
    return f"{os.cpu_count()} × {model.group(1) if model else os.uname().machine}"


def busy_share(seconds=2.0):
    """The share of the processors that other programs use."""
    def times():
        fields = [int(word) for word in pathlib.Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
        return sum(fields), fields[3] + fields[4]
    total, idle = times()
    time.sleep(seconds)
    total, idle = times()[0] - total, times()[1] - idle
    return 1 - idle / max(total, 1)


def is_idle(share=None):
    return (busy_share() if share is None else share) <= BUSY_SHARE


def judged(figure, here, stored_machine, idle):
    """True if this machine, in this state, may judge the figure."""
    return figure.kind != "absolute" or (idle and here == stored_machine)


def fault(figure, value):
    """The message about a value outside its interval, "" if it lies within."""
    low, high = figure.within
    if low <= value <= high:
        return ""
    return (f"{figure.id} ({figure.question}): {figure.text(value)} {figure.unit}".rstrip() +
            f" is outside {low} .. {high}; command: {figure.run.command}")
