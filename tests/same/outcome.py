"""Counts of compared and differing values."""
import csv
import math


class Outcome:
    """One line of the table."""

    def __init__(self, what, judged=True):
        self.what, self.judged = what, judged
        self.compared = self.differ = 0
        self.greatest = 0.0  # difference, in units of full scale; inf where a word or an empty cell differs
        self.first = ""

    def add(self, compared, differ=0, greatest=0.0, first=""):
        self.compared += compared
        self.differ += differ
        self.greatest = max(self.greatest, greatest)
        self.first = self.first or first

    def equal(self, a, b, name):
        """Two values of any type, one comparison."""
        self.add(1, a != b, math.inf if a != b else 0, f"{name}: {shortened(a)} | {shortened(b)}" if a != b else "")


def shortened(value):
    text = str(value)
    return text if len(text) < 100 else text[:97] + "..."


def first_difference(a, b):
    """The first line that differs of two texts."""
    lines_a, lines_b = a.splitlines(), b.splitlines()
    for x, y in zip(lines_a, lines_b):
        if x != y:
            return f"{x} | {y}"
    return f"{len(lines_a)} lines | {len(lines_b)} lines"


def differing_lines(a, b):
    """(lines in either, lines in one alone), in order of a set: a moved line counts as the same."""
    lines_a, lines_b = a.splitlines(), b.splitlines()
    return max(len(lines_a), len(lines_b)), max(len(set(lines_a) - set(lines_b)), len(set(lines_b) - set(lines_a)))


def number(cell):
    try:
        return float(cell)
    except ValueError:
        return None


def group_of(column):
    """Columns that share a full scale."""
    name = column.removeprefix("sd_")
    return "force" if name.startswith("f") else "torque" if name.startswith("m") else "cop" if name.startswith("cop") else name


def compare_csv(outcome, base, new, name):
    """Each cell as text. Full scale is the 99th percentile of the magnitudes in the group of the column, or the value itself if
    that is greater, for rows of impossible readings."""
    text_base, text_new = base.read_text(), new.read_text()
    cells = text_base.count(",") + text_base.count("\n")
    if text_base == text_new:
        outcome.add(cells)
        return
    rows_base, rows_new = list(csv.reader(text_base.splitlines())), list(csv.reader(text_new.splitlines()))
    rows_new = [row[:len(rows_base[0])] for row in rows_new]  # columns may have been appended
    if len(rows_base) != len(rows_new) or rows_base[0] != rows_new[0]:
        outcome.add(cells, abs(len(rows_base) - len(rows_new)) * len(rows_base[0]) or len(rows_base[0]), math.inf,
                    f"{name}: {len(rows_base)} rows {rows_base[0]} | {len(rows_new)} rows {rows_new[0]}")
        return
    scale = {}
    for k, column in enumerate(rows_base[0]):
        scale.setdefault(group_of(column), []).extend(abs(v) for r in rows_base[1:] if (v := number(r[k])) is not None and column[:3] != "sd_")
    scale = {group: sorted(values)[len(values) * 99 // 100] for group, values in scale.items() if values}
    for line, (row, other) in enumerate(zip(rows_base, rows_new), 1):
        for column, a, b in zip(rows_base[0], row, other):
            if a == b or (not a and column.startswith("cop_")):  # a place that the base did not state
                outcome.add(1)
                continue
            x, y = number(a), number(b)
            by = math.inf
            if x is not None and y is not None:
                by = abs(x - y) / (max(scale.get(group_of(column), 0), abs(x)) or 1)
            outcome.add(1, 1, by, f"{name}, line {line}, {column}: {a or 'empty'} | {b or 'empty'}")
