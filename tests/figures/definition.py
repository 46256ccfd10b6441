"""The table of figures: the files of tests/figures/table, one for each section of tests/bench/RESULTS.md.

A file has `title`, `text` (prose, in which `{ID}` is a figure) and runs. A run is one command with `id`, `command`, the
`targets` to build, the `folders` on which it depends, its usual `duration_s`, and figures; `repeat` runs it several times and
takes the median of each figure; `env` has environment variables; `needs` names a program without which the run is left out;
`level` = 3 makes a subsection. A figure has:

question   the subject of its row
unit       "" if it has none
kind       ratio, count, instructions: within the interval on every machine
           absolute: judged only on the stored machine, idle; from half to double of the first idle value
           long: takes hours; is not run by default and keeps its commit
within     [lowest, highest]
read       a regular expression on the command's output: one group is the value; for `how = "ratio"` the groups `of` and `over`
how        "value" (first match, the default), "ratio", "max", "min", "sum", "count" of the matches, "last", "status" (0)
show       the format of the value, "{:.3g}" by default
"""
import dataclasses
import pathlib
import re
import tomllib

FOLDER = pathlib.Path(__file__).resolve().parent
KINDS = ("ratio", "count", "instructions", "absolute", "long")
HOWS = ("value", "ratio", "max", "min", "sum", "count", "last", "status")


@dataclasses.dataclass(eq=False)
class Figure:
    id: str
    question: str
    read: str = ""
    unit: str = ""
    kind: str = "ratio"
    within: tuple = (0, 0)
    how: str = "value"
    show: str = "{:.3g}"
    run: object = None

    def text(self, value):
        return self.show.format(int(value) if self.show.endswith("d}") or self.show == "{:,}" else value)


@dataclasses.dataclass(eq=False)
class Run:
    id: str
    command: str
    duration_s: float
    figures: list
    folders: tuple
    targets: tuple = ()
    repeat: int = 1
    env: dict = dataclasses.field(default_factory=dict)
    needs: str = ""
    section: object = None

    @property
    def is_long(self):
        return all(figure.kind == "long" for figure in self.figures)


@dataclasses.dataclass
class Section:
    id: str
    title: str
    text: str
    runs: list
    level: int = 2


def run_of(row):
    figures = []
    for name, figure in row.pop("figure", {}).items():
        if row.get("long"):
            figure.setdefault("kind", "long")
        figures.append(Figure(id=f"{row['id']}.{name}", **figure))
    row.pop("long", None)
    run = Run(figures=figures, **row)
    for figure in figures:
        figure.run = run
    return run


def faults_of(sections):
    """Mistakes in the table itself."""
    runs = [run for section in sections for run in section.runs]
    figures = [figure for run in runs for figure in run.figures]
    for ids in ([run.id for run in runs], [figure.id for figure in figures]):
        yield from (f"{name} is there twice" for name in set(ids) if ids.count(name) > 1)
    for run in runs:
        if len({figure.kind == "long" for figure in run.figures}) > 1:
            yield f"{run.id} has long and other figures"
    for figure in figures:
        groups = re.compile(figure.read).groups
        wanted = {"ratio": 2, "status": 0}.get(figure.how, 1)
        if figure.kind not in KINDS or figure.how not in HOWS:
            yield f"{figure.id}: kind {figure.kind} or how {figure.how} is not known"
        elif groups != wanted and not (figure.how == "count" and groups == 0):
            yield f"{figure.id}: the expression has {groups} groups, {wanted} are needed"
        elif not figure.within[0] <= figure.within[1]:
            yield f"{figure.id}: the interval is empty"


def load(folder=FOLDER / "table"):
    sections = []
    for path in sorted(folder.glob("*.toml")):
        data = tomllib.loads(path.read_text())
        section = Section(id=path.stem.split("-", 1)[1], title=data["title"], text=data.get("text", ""), level=data.get("level", 2),
                          runs=[run_of(row) for row in data.get("run", [])])
        for run in section.runs:
            run.section = section
        sections.append(section)
    faults = list(faults_of(sections))
    if faults:
        raise SystemExit("tests/figures/table: " + "; ".join(faults))
    return sections


def figures_of(sections):
    return {figure.id: figure for section in sections for run in section.runs for figure in run.figures}
