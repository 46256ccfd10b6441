"""Renders tests/bench/RESULTS.md from the table and the results, and fills in the figures on other pages."""
import math
import pathlib
import re
import subprocess
import textwrap

MAX_WORDS = 6000
ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = "tests/bench/RESULTS.md"
MARK = re.compile(r"(<!--= *([\w.-]+) *-->)(.*?)(<!--/-->)", re.DOTALL)
PLACE = re.compile(r"\{([a-z]\w*\.\w+)\}")


def duration(seconds):
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def value(figure, results):
    """The newest value as text."""
    entry = results["figures"].get(figure.id)
    return figure.text(entry["value"]) if entry else "?"


def origin(figure, entry):
    """Command, commit and date of a value and, of a long figure, the changes since."""
    command = figure.run.command.replace("build/release/bin/", "").strip().replace("|", "\\|")
    words = f"`{command}` {entry['commit']} {entry['date']}"
    if figure.kind == "long":
        lines = entry.get("changed_lines")
        words += ", commit no longer exists" if lines is None else f", {lines:,} lines since" if lines else ", unchanged"
    return words


def interval(figure):
    low, high = figure.within
    if math.isinf(high):
        return f"≥{figure.text(low)}"
    return figure.text(low) if low == high else f"{figure.text(low)}–{figure.text(high)}"


def rows(run, results):
    before = None
    for figure in run.figures:
        entry = results["figures"].get(figure.id)
        source = origin(figure, entry) if entry else "not measured"
        unit = f" {figure.unit}" if figure.unit else ""
        mark = {"absolute": " †", "long": " ‡"}.get(figure.kind, "")
        if entry and figure.kind == "absolute" and not entry["idle"]:
            mark += " busy machine"
        yield f"|{figure.question}|{value(figure, results)}{unit}{mark}|{interval(figure)}|{'' if source == before else source}|"
        before = source


def wrapped(text):
    """Paragraphs in lines of at most 110 characters; lists, tables and code stay."""
    return "\n\n".join(part if part.startswith((" ", "|", "* ", "#")) else
                       textwrap.fill(part, 110, break_long_words=False, break_on_hyphens=False) for part in text.split("\n\n"))


def filled(text, figures, results):
    return PLACE.sub(lambda found: value(figures[found.group(1)], results), text)


def seconds_of(sections, results, long=False):
    """The time that all default runs took, or the long ones."""
    total = 0
    for section in sections:
        for run in section.runs:
            entries = [results["figures"].get(figure.id, {}) for figure in run.figures]
            if run.is_long == long:
                total += max((entry.get("duration_s", run.duration_s) for entry in entries), default=0)
    return total


def rendered(sections, figures, results):
    """The text of the page."""
    parts = []
    for section in sections:
        text = filled(section.text.strip(), figures, results)
        text = wrapped(text.replace("{duration}", duration(seconds_of(sections, results))).replace("{machine}", results["machine"]))
        parts += ["#" * section.level + " " + section.title, text]
        if section.runs:
            parts.append("|question|figure|interval|command, commit, date|\n|---|---|---|---|\n" +
                         "\n".join(row for run in section.runs for row in rows(run, results)))
    return "\n\n".join(part for part in parts if part) + "\n"


def marked_pages(root=ROOT):
    """The pages of the project that cite figures, with their texts."""
    listed = subprocess.run(["git", "-C", root, "ls-files", "-co", "--exclude-standard", "*.md"], capture_output=True, text=True, check=False)
    names = listed.stdout.split() if listed.returncode == 0 else [str(p.relative_to(root)) for p in root.rglob("*.md")]
    for name in names:
        path = pathlib.Path(root) / name
        if name != PAGE and path.exists() and "<!--=" in path.read_text():
            yield name, path.read_text()


def with_figures(text, figures, results):
    """The text of another page with the newest figures, and the ids that are unknown."""
    unknown = [found.group(2) for found in MARK.finditer(text) if found.group(2) not in figures]

    def newest(found):
        name = found.group(2)
        return found.group(1) + (found.group(3) if name in unknown else value(figures[name], results)) + found.group(4)
    return MARK.sub(newest, text), unknown


def render(sections, figures, results, root=ROOT):
    (root / PAGE).write_text(rendered(sections, figures, results))
    for name, text in marked_pages(root):
        (root / name).write_text(with_figures(text, figures, results)[0])


def faults(sections, figures, results, root=ROOT):
    """Differences between the pages and the results."""
    page = rendered(sections, figures, results)
    if (root / PAGE).read_text() != page:
        yield f"{PAGE} is not what tests/figures.sh --render writes"
    if len(page.split()) > MAX_WORDS:
        yield f"{PAGE} has {len(page.split())} words; at most {MAX_WORDS}"
    for name, text in marked_pages(root):
        newest, unknown = with_figures(text, figures, results)
        yield from (f"{name}: a line of prose begins with a figure, which ends its paragraph: {line}"
                    for line in text.splitlines() if line.startswith("<!--="))
        yield from (f"{name}: there is no figure {figure}" for figure in unknown)
        if newest != text:
            yield f"{name} has other figures than tests/figures/results.json; tests/figures.sh --render writes them"
