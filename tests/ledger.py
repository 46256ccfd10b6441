#!/usr/bin/env python3
"""Lists the tests that failed in runs of tests/run.sh; tests/failed.tsv has them.

    ledger.py failed FILE COMMIT LOAD OTHERWISE    a line for each failed test of a JUnit file of CTest: date, commit, test, load;
                                                   without one, a line with OTHERWISE as the test
    ledger.py count FILE...    how many programs and cases passed, failed and were skipped
    ledger.py why FILE...      the last lines that each failed program printed
    ledger.py check            fails for a test that is listed twice without a change of its code in between
"""
import datetime
import pathlib
import re
import subprocess
import sys
from xml.etree import ElementTree

ROOT = pathlib.Path(__file__).resolve().parent.parent
LIST = ROOT / "tests/failed.tsv"
LAST_LINES = 30
# GoogleTest: "[  FAILED  ] Suite.Name (3 ms)"; unittest: "FAIL: test_name (module.Class.test_name)"
CASE = re.compile(r"^(?:\[  FAILED  \] (?P<gtest>[\w/]+\.[\w/]+)|(?:FAIL|ERROR): (?P<python>\w+) )")
RAN = re.compile(r"^(?:\[==========\] (\d+) tests? from .* ran|Ran (\d+) tests? in )")


def programs(path):
    """Yields (name, "run", "fail" or "notrun", message, failed cases, number of cases) of each program in CTest's JUnit file."""
    for test in ElementTree.parse(path).iter("testcase"):
        lines = (test.findtext("system-out") or "").splitlines()
        reason = test.find("failure") if test.find("failure") is not None else test.find("skipped")
        message = "" if reason is None else reason.get("message")
        status = test.get("status")
        if status == "notrun" and not message.startswith("SKIP_RETURN_CODE"):
            status = "fail"  # its program is missing, for instance
        cases = {found["gtest"] or found["python"] for line in lines if (found := CASE.match(line))}
        ran = sum(int(found[1] or found[2]) for line in lines if (found := RAN.match(line)))
        yield test.get("name"), status, message, sorted(cases), ran


def failed(output, commit, load, otherwise):
    now = datetime.datetime.now(datetime.timezone.utc).strftime("%F")
    found = [f"{name}:{case}" for name, status, message, cases, _ in programs(output) if status == "fail" for case in cases or [message or "failed"]]
    for test in found or [otherwise]:
        print(now, commit, test, load, sep="\t")


def count(outputs):
    found = [each for output in outputs for each in programs(output)]
    of = {status: sum(each[1] == status for each in found) for status in ("run", "fail", "notrun")}
    print(f"{of['run']} passed, {of['fail']} failed, {of['notrun']} skipped; {sum(ran for *_, ran in found)} cases of GoogleTest and unittest")


def end_of(lines):
    """Returns the last lines, or those before GoogleTest's first failure ends: what follows are other tests."""
    ends = [i + 1 for i, line in enumerate(lines) if line.startswith("[  FAILED  ]")]
    return lines[:ends[0] if ends else None][-LAST_LINES:]


def why(outputs):
    for output in outputs:
        for test in ElementTree.parse(output).iter("testcase"):
            if test.find("failure") is not None:
                print(f"--- {test.get('name')}", *end_of((test.findtext("system-out") or "").splitlines()), sep="\n")


def code_of(test):
    """Returns the files of a listed test: "system.web_test:test_x" or "drivers.1of4:Suite.Name"."""
    program, case = test.split(":", 1)
    folder, _, rest = program.partition(".")
    if folder == "system" and (ROOT / f"tests/system/{rest}.py").exists():
        return [f"tests/system/{rest}.py"]
    suite = case.split(".")[0].split("/")[-1]
    files = [path for path in (ROOT / "tests/unit" / folder).glob("*_test.cpp") if re.search(rf"\b{suite}\b", path.read_text())]
    return [str(path.relative_to(ROOT)) for path in files] or ["tests"]


def check(lines, changed):
    """Returns the errors of the list. `changed`: whether a file of these differs between two commits."""
    last, errors = {}, []
    for line in lines:
        _, commit, test, _ = line.split("\t")
        test = re.sub(r"\.\d+of\d+:", ".1of1:", test)  # the number of parts may have changed
        commit = commit.removesuffix("+changes")
        if test in last and not changed(last[test], commit, code_of(test)):
            errors.append(f"{test} failed at {last[test]} and at {commit}, and its code is the same: repair or remove it")
        last[test] = commit
    return errors


def changed_in_git(before, after, files):
    done = subprocess.run(["git", "-C", ROOT, "diff", "--quiet", before, after, "--", *files, "tests/system/daemon.py"], stderr=subprocess.DEVNULL)
    return done.returncode != 0  # a commit that is not in this clone counts as a change


def main():
    if sys.argv[1:2] == ["failed"] and len(sys.argv) == 6:
        failed(*sys.argv[2:])
    elif sys.argv[1:2] == ["count"]:
        count(sys.argv[2:])
    elif sys.argv[1:2] == ["why"]:
        why(sys.argv[2:])
    elif sys.argv[1:] == ["check"]:
        lines = [line for line in LIST.read_text().splitlines() if line and not line.startswith("#")]
        sys.exit("\n".join(check(lines, changed_in_git)) or None)
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
