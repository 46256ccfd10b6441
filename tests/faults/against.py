#!/usr/bin/env python3
"""Two builds of freshness_test in one run: how long an old value was GOOD, by kind of delay and stream.

    tests/faults/against.py OLD_BIN/freshness_test NEW_BIN/freshness_test [--hours 2] [--seed 7]

Prints the rows in which one of them has more than a second in 1,000 h as a table for a page."""
import argparse
import concurrent.futures
import os
import re
import subprocess

ROW = re.compile(r"(.{50}) (.{14}) before +\d+ s, now +([\d.]+) s of 1000 h")
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
    parser.add_argument("--hours", type=float, default=2, help="of each row")
    parser.add_argument("--seed", type=int, default=7)
    args = parser.parse_args()
    with concurrent.futures.ThreadPoolExecutor() as pool:
        old, new = pool.map(lambda program: seconds_of(program, args.hours, args.seed), (args.old, args.new))
    both = sorted(set(old) & set(new))
    print("|kind of delay|stream|old, s|new, s|\n|---|---|---|---|")
    for kind, stream in both:
        before, now = old[kind, stream], new[kind, stream]
        if max(before, now) > 1:
            print(f"|{kind}|{stream}|{before:,.0f}|{now:,.0f}|")
    for name, is_it in (("with a clock", lambda s: s.startswith("clock")), ("without", lambda s: not s.startswith("clock"))):
        rows = [key for key in both if is_it(key[1])]
        print(f"{name}: {len(rows)} rows, old {sum(old[key] for key in rows):,.0f} s, new {sum(new[key] for key in rows):,.0f} s; "
              f"better in {sum(new[key] < old[key] for key in rows)}, worse in {sum(new[key] > old[key] for key in rows)}")


if __name__ == "__main__":
    main()
