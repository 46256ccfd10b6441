#!/usr/bin/env python3
"""Two builds of freshness_test in one run: how long an old value was GOOD, by kind of delay and stream.

    tests/faults/against.py OLD/build/release/bin/freshness_test build/release/bin/freshness_test [--hours 1] [--seed 7]

Writes the rows in which one of them has more than a second in 1,000 h to AGAINST.md; 2 min."""
import argparse
import concurrent.futures
import os
import pathlib
import re
import subprocess

ROW = re.compile(r"(.{50}) (.{14}) before +\d+ s, now +([\d.]+) s of 1000 h")
PAGE = pathlib.Path(__file__).with_name("AGAINST.md")
HEAD = """# Old values that are GOOD, by two builds

Written by `against.py`: commit {}, {} simulated h of each row, seed {}. A value is old beyond `stale_ms` and the ordinary delay. Seconds in 1,000 h; rows in
which both have less than one are left out. [freshness](../../drivers/wire/freshness.md) says what a stream without a clock cannot show.

|kind of delay|stream|old build, s|new build, s|
|---|---|---|---|
"""
FILTER = "--gtest_filter=*NoKind*:*NoOdd*"


def seconds_of(program, hours, seed):
    """Returns {(kind, stream): s in 1,000 h}; of a row that is run twice, the worse one."""
    env = {**os.environ, "HOURS": str(hours), "SEED": str(seed)}
    text = subprocess.run([program, FILTER], env=env, capture_output=True, text=True).stdout
    rows = {}
    for kind, stream, seconds in ROW.findall(text):
        key = kind.strip(), stream.strip()
        rows[key] = max(rows.get(key, 0), float(seconds))
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("--hours", type=float, default=1, help="of each row")
    parser.add_argument("--seed", type=int, default=7)
    args = parser.parse_args()
    with concurrent.futures.ThreadPoolExecutor() as pool:
        old, new = pool.map(lambda program: seconds_of(program, args.hours, args.seed), (args.old, args.new))
    both = sorted(set(old) & set(new))
    commits = [subprocess.run(["git", "-C", pathlib.Path(program).resolve().parent, "rev-parse", "--short=8", "HEAD"], capture_output=True, text=True).stdout.strip()
               for program in (args.old, args.new)]
    text = HEAD.format(" and ".join(commits), args.hours, args.seed)
    for kind, stream in both:
        before, now = old[kind, stream], new[kind, stream]
        if max(before, now) > 1:
            text += f"|{kind}|{stream}|{before:,.0f}|{now:,.0f}|\n"
    text += "\n"
    for name, is_it in (("with a clock", lambda s: s.startswith("clock")), ("without a clock", lambda s: not s.startswith("clock"))):
        rows = [key for key in both if is_it(key[1])]
        text += f"* Streams {name}: {len(rows)} rows; the new build is better in {sum(new[key] < old[key] for key in rows)}, worse in {sum(new[key] > old[key] for key in rows)}.\n"
    PAGE.write_text(text)
    print(text)


if __name__ == "__main__":
    main()
