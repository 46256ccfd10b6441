"""tests/figures/results.json: the newest value of each figure, and the changes since its commit."""
import datetime
import json
import math
import pathlib
import re
import subprocess

PATH = pathlib.Path(__file__).resolve().parent / "results.json"
ROOT = PATH.parents[2]


def load(path=PATH):
    return json.loads(path.read_text()) if path.exists() else {"machine": "", "figures": {}}


def store(results, path=PATH):
    results["figures"] = dict(sorted(results["figures"].items()))
    path.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n")


def git(*words):
    done = subprocess.run(["git", "-C", ROOT, *words], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None


def head(folders):
    """The commit of the tree, with "+" if the folders have changes that are not committed."""
    commit = git("rev-parse", "--short=8", "HEAD")
    if commit is None:
        return "unknown"
    return commit + ("+" if git("status", "--porcelain", "--", *folders) else "")


def today():
    return datetime.date.today().isoformat()


def changed_since(commit, folders):
    """Lines that changed in the folders since the commit, None if the commit does not exist any more."""
    if git("cat-file", "-e", f"{commit.rstrip('+')}^{{commit}}") is None:
        return None
    text = git("diff", "--shortstat", commit.rstrip("+"), "--", *folders) or ""
    return sum(int(count) for count in re.findall(r"(\d+) (?:insertion|deletion)", text))


def note_changes(results, figures):
    """Stores each interval of the table, and the changes since the commit of each long figure."""
    known = {}
    for name, figure in figures.items():
        entry = results["figures"].get(name)
        if entry is None:
            continue
        entry["within"] = interval(figure)
        if figure.kind != "long":
            continue
        key = (entry["commit"], tuple(figure.run.folders))
        if key not in known:
            known[key] = changed_since(*key)
        entry["changed_lines"] = known[key]


def interval(figure):
    return [None if math.isinf(end) else end for end in figure.within]


def entry(figure, value, duration_s, machine, idle):
    return {"value": value, "within": interval(figure), "unit": figure.unit, "commit": head(figure.run.folders), "date": today(),
            "machine": machine, "idle": idle, "command": figure.run.command, "duration_s": round(duration_s, 1)}
