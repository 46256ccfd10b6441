#!/usr/bin/env python3
"""Plants errors into a copy of the last commit, one at a time, and expects that a test of the ordinary run finds each.

    tests/plants/plants.py                  all of plants.toml; prints a table; exit status 1 if one is not found
    tests/plants/plants.py --only KIND      those of one kind or with this name; may be repeated
    tests/plants/plants.py --list

The copy is build/plants/tree; its builds are kept for the next time. Without a plant each test has to pass."""
import argparse
import contextlib
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
TREE = ROOT / "build/plants/tree"
TIMEOUT_S = 300  # limit of a test; a plant that keeps a test from ending is found
ENV = {**os.environ, "CCACHE_BASEDIR": str(TREE), "CCACHE_NOHASHDIR": "1"}


class Error(Exception):
    """The plants, the copy or a build is wrong, not the test."""


def plants():
    """Returns the table, checked."""
    table = tomllib.loads((ROOT / "tests/plants/plants.toml").read_text())["plant"]
    names = [p["name"] for p in table]
    for p in table:
        text = (ROOT / p["file"]).read_text()
        if names.count(p["name"]) != 1:
            raise Error(f"{p['name']}: two plants of this name")
        if text.count(p["old"]) != 1:
            raise Error(f"{p['name']}: `old` occurs {text.count(p['old'])} times in {p['file']}")
    return table


def run(*command, cwd=None, what=None):
    """Runs a command. Returns its output; raises Error if it fails."""
    done = subprocess.run(list(map(str, command)), cwd=cwd or TREE, env=ENV, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise Error(f"{what or command[0]}: failed\n{done.stdout[-3000:]}")
    return done.stdout


def prepare():
    """Makes the copy, or brings it to the last commit."""
    if not TREE.exists():
        run("git", "clone", "--quiet", "--shared", ROOT, TREE, cwd=ROOT)
    commit = run("git", "rev-parse", "HEAD", cwd=ROOT).strip()
    run("git", "fetch", "--quiet", "origin", commit)
    run("git", "checkout", "--quiet", "--force", "--detach", commit)


def build(preset, targets, jobs):
    if not (TREE / "build" / preset / "build.ninja").exists():
        run("cmake", "--preset", preset, "-DTACTILED_TESTS=ON")
    run("cmake", "--build", "--preset", preset, "-j", jobs, "--target", *targets, what=f"build of {', '.join(targets)}")


def targets_of(plant):
    return plant.get("targets", [plant["test"].split()[0]])


def passes(plant):
    """Runs the plant's test. Returns True if it passes, and the end of its output."""
    first, *rest = plant["test"].split()
    bin_folder = TREE / "build" / plant["preset"] / "bin"
    if first.endswith(".py"):
        command = ["/usr/bin/python3", first, *rest]
    elif rest and not rest[0].startswith("-"):
        command = [bin_folder / first, "--gtest_brief=1", f"--gtest_filter={' '.join(rest)}"]
    else:
        command = [bin_folder / first, *rest]
    with tempfile.TemporaryFile(mode="w+", errors="replace") as output:  # a pipe would stay open while a daemon of the test lives
        process = subprocess.Popen(list(map(str, command)), cwd=TREE, env={**ENV, "TACTILED_BIN": str(bin_folder)}, stdout=output,
                                   stderr=subprocess.STDOUT, start_new_session=True)
        try:
            status = process.wait(timeout=TIMEOUT_S)
        except subprocess.TimeoutExpired:
            status = "it did not end"
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # the test's own session
        process.wait()
        output.seek(0)
        return status == 0, f"{output.read()}\n{status if status == 'it did not end' else ''}"


def found_by(output):
    """The line of the output that names the finding best, shortened."""
    lines = [line.strip() for line in output.splitlines()]
    for mark in ("WARNING: ThreadSanitizer", "ERROR: AddressSanitizer", "runtime error:", "data race", " torn", "sleeps for ever", "[  FAILED  ]", "FAIL: ", "ERROR: ", "did not end"):
        for line in lines:
            if mark in line:
                return line[line.index(mark) if mark.isupper() else 0:].replace("|", "/")[:90]
    return next((line for line in reversed(lines) if line), "no output").replace("|", "/")[:90]


def try_plant(plant, jobs):
    """Returns (found, by what, seconds)."""
    path = TREE / plant["file"]
    text, began = path.read_text(), time.monotonic()
    try:
        if text.count(plant["old"]) != 1:
            raise Error(f"{plant['file']} of the last commit lacks the text")
        path.write_text(text.replace(plant["old"], plant["new"]))
        build(plant["preset"], targets_of(plant), jobs)
        passed, output = passes(plant)
    except Error as error:
        return False, str(error).replace("|", "/"), time.monotonic() - began
    finally:
        path.write_text(text)
    return not passed, "nothing" if passed else found_by(output), time.monotonic() - began


def check_without_plants(chosen, jobs):
    """Each test has to pass in the copy as it is."""
    for preset in sorted({p["preset"] for p in chosen}):
        build(preset, sorted({t for p in chosen if p["preset"] == preset for t in targets_of(p)}), jobs)
    for plant in {(p["preset"], p["test"]): p for p in chosen}.values():
        passed, output = passes(plant)
        if not passed:
            raise Error(f"{plant['test']} ({plant['preset']}) fails without a plant:\n{output[-3000:]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", metavar="NAME|KIND")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("-j", "--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    chosen = [p for p in plants() if not options.only or p["name"] in options.only or p["kind"] in options.only]
    if not chosen:
        raise Error("there is no plant of this name or kind: --list shows them")
    if options.list:
        print("\n".join(f"{p['kind']:14} {p['name']}: {p['preset']}, {p['test']}" for p in chosen))
        return 0
    prepare()
    check_without_plants(chosen, options.jobs)
    print("| kind | plant | test | found by | s |\n|---|---|---|---|---|", flush=True)
    missed = []
    for plant in chosen:
        found, by, seconds = try_plant(plant, options.jobs)
        missed += [] if found else [plant["name"]]
        print(f"| {plant['kind']} | {plant['name']} | {plant['preset']} {plant['test']} | {by if found else '**not found**: ' + by} | {seconds:.0f} |",
              flush=True)
    print(f"\n{len(chosen) - len(missed)} of {len(chosen)} found")
    return 1 if missed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Error as error:
        sys.exit(f"plants.py: {error}")
