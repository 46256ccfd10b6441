#!/usr/bin/env python3
"""Measures the figures that the pages cite.

    tests/figures.sh                     every figure but the long ones; writes results.json, RESULTS.md and the pages
    tests/figures.sh --only ID|SECTION   one figure, run or section, also a long one; repeat the option for more
    tests/figures.sh --render            writes RESULTS.md and the figures on pages from results.json
    tests/figures.sh --check             compares them, and each value with its interval; builds and runs nothing
    tests/figures.sh --list              ids, kinds and durations

Exit status 1: a figure is outside its interval or could not be read, or a benchmark failed. The message names figure, value,
interval and command. Absolute times are judged and stored only on the machine of results.json (--adopt-machine changes it),
identified by the model and number of its processors, and only if other programs use at most 5 % of it before and
after the command.
"""
import argparse
import os
import signal
import subprocess
import sys
import time

import definition
import judge
import page
import results as store

BUILD = store.ROOT / "build/release"


def chosen(sections, only):
    """The runs of the names in `only`: figures, runs, or the runs of a section but the long ones; without names, all but the long ones."""
    runs = [run for section in sections for run in section.runs]
    usual = [run for run in runs if not run.is_long]
    if not only:
        return usual
    picked = []
    for name in only:
        found = ([run for run in runs if name in (run.id, *(figure.id for figure in run.figures))] or
                 [run for run in usual if run.section.id == name])
        if not found:
            raise SystemExit(f"no figure, run or section {name}; --list names them")
        picked += found
    return [run for run in runs if run in picked]


def build(runs):
    """Builds the targets of the runs as a release; refuses another kind of build."""
    if not (BUILD / "build.ninja").exists():
        subprocess.run(["cmake", "--preset", "release", "-DTACTILED_TESTS=ON"], cwd=store.ROOT, check=True, stdout=subprocess.DEVNULL)
    cache = (BUILD / "CMakeCache.txt").read_text()
    if "CMAKE_BUILD_TYPE:STRING=Release\n" not in cache or "TACTILED_SANITIZE:STRING=\n" not in cache:
        raise SystemExit("build/release is no release build, or has sanitizers: remove it")
    targets = sorted({target for run in runs for target in run.targets})
    if targets:
        subprocess.run(["cmake", "--build", "--preset", "release", "--target", *targets], cwd=store.ROOT, check=True, stdout=subprocess.DEVNULL)


def output_of(run):
    """Runs the command once: its exit status and what it printed."""
    env = {"TACTILED_RUNTIME_DIR": "/dev/shm", **os.environ, **run.env}
    process = subprocess.Popen(run.command, shell=True, cwd=store.ROOT, env=env, text=True, start_new_session=True, stdin=subprocess.DEVNULL,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        output, _ = process.communicate(timeout=120 + 5 * run.duration_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return None, process.communicate()[0]
    return process.returncode, output


def measured(run):
    """The values of a run's figures as medians of its repetitions; the second part says what went wrong."""
    values, faults = {}, []
    for _ in range(run.repeat):
        status, output = output_of(run)
        if status != 0:
            last = "\n    ".join(output.strip().splitlines()[-5:])
            return {}, [f"{run.id}: {'no end in time' if status is None else f'exit status {status}'}; command: {run.command}\n    {last}"]
        for figure in run.figures:
            try:
                value = judge.value_of(figure, output)
                values.setdefault(figure, []).append(value)
            except judge.Unreadable as error:
                faults.append(f"{error}; command: {run.command}")
    return {figure: sorted(many)[(len(many) - 1) // 2] for figure, many in values.items()}, faults


def keep(results, figure, value, took_s, here, idle):
    """Judges and stores a value; the result is the message about it, "" if it is right."""
    judged = judge.judged(figure, here, results["machine"], idle)
    message = judge.fault(figure, value) if judged else ""
    note = message and "OUTSIDE" or ("" if judged else "not judged: another machine, or not idle")
    print(f"  {figure.id:32} {figure.text(value):>10} {figure.unit:8} {note}", flush=True)
    stored = results["figures"].get(figure.id)
    if message == "" and (judged or stored is None or not stored["idle"]):
        results["figures"][figure.id] = store.entry(figure, value, took_s, here, idle)
    return message


def measure(runs, results):
    """Runs all and stores their values; the result is the list of messages."""
    here, messages = judge.machine(), []
    results["machine"] = results["machine"] or here
    for run in runs:
        if run.needs and subprocess.run(["sh", "-c", f"command -v {run.needs}"], stdout=subprocess.DEVNULL, check=False).returncode:
            messages.append(f"{run.id} needs {run.needs}")
            continue
        has_times = any(figure.kind == "absolute" for figure in run.figures)
        idle = has_times and judge.is_idle()
        print(f"{run.id}: {run.command}", flush=True)
        begun = time.monotonic()
        values, faults = measured(run)
        took_s = time.monotonic() - begun
        idle = idle and judge.is_idle()
        print("".join(f"  {fault}\n" for fault in faults), end="", flush=True)
        messages += faults
        results["figures"].update(store.load()["figures"])  # another call may have stored some meanwhile
        messages += filter(None, [keep(results, figure, value, took_s, here, idle) for figure, value in values.items()])
        store.store(results)
    return messages


def check(sections, figures, results):
    for name, figure in figures.items():
        entry = results["figures"].get(name)
        if entry is None:
            yield f"{name} has no value; measure it with tests/figures.sh --only {name}"
        elif entry["command"] != figure.run.command and figure.kind != "long":
            yield f"{name} was measured with another command"
        elif figure.kind != "absolute" or (entry["idle"] and entry["machine"] == results["machine"]):
            yield from filter(None, [judge.fault(figure, entry["value"])])
    yield from (f"{name} was measured with changes that are in no commit" for name, entry in results["figures"].items() if entry["commit"].endswith("+") or entry["commit"] == "unknown")
    yield from (f"results.json has {name}, the table has not" for name in results["figures"] if name not in figures)
    yield from page.faults(sections, figures, results)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", metavar="ID|SECTION")
    for name in ("render", "check", "list", "adopt-machine", "no-build"):
        parser.add_argument(f"--{name}", action="store_true")
    return parser.parse_args()


def main():
    args = arguments()
    sections, results = definition.load(), store.load()
    figures = definition.figures_of(sections)
    messages = []
    if args.list:
        for figure in figures.values():
            print(f"{figure.run.section.id:12} {figure.id:30} {figure.kind:13} {page.duration(figure.run.duration_s):>7}  {figure.question}")
    elif args.check:
        messages = list(check(sections, figures, results))
    else:
        if args.adopt_machine:
            results["machine"] = judge.machine()
        if not args.render:
            runs = chosen(sections, args.only)
            if not args.no_build:
                build(runs)
            messages = measure(runs, results)
        results["figures"] = {name: entry for name, entry in results["figures"].items() if name in figures}
        store.note_changes(results, figures)
        store.store(results)
        page.render(sections, figures, results)
    for message in messages:
        print(message, file=sys.stderr)
    return 1 if messages else 0


if __name__ == "__main__":
    sys.exit(main())
