#!/usr/bin/env python3
"""gcov, as gcovr calls it, without the branches that exceptions make: the two ways out of each call (it returns, it throws), and
the compiler's own inside a landing pad ("is there a temporary to destroy yet?"). gcov tells the former of code that never ran
only as JSON, the latter only as text ($$$$$); gcovr 5.2 looks at neither.

A branch that a person wrote is never left out: a block of code that ends with a call has no condition, and inside a landing pad
there is no line of the source but a catch block's, which is left alone."""
import json
import os
import re
import subprocess
import sys
from collections import defaultdict

GCOV = os.environ.get("REAL_GCOV", "gcov")


def lines_of_catch_blocks(source):
    """Numbers of the lines from each "catch (" to the end of its block; braces in strings and comments do not count."""
    text = re.sub(r"//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])'", lambda m: " " * len(m[0]), source)
    lines = set()
    for found in re.finditer(r"\bcatch\s*\(", text):
        depth, at = 0, text.index("{", found.end())
        for at in range(at, len(text)):
            depth += {"{": 1, "}": -1}.get(text[at], 0)
            if depth == 0:
                break
        lines.update(range(text.count("\n", 0, found.start()) + 1, text.count("\n", 0, at) + 2))
    return lines


def throws_of(arguments):
    """{source: {line: [is branch n one that only a throw takes?]}}, which gcov reports for code that never ran only
    as JSON."""
    out = subprocess.run([GCOV, *arguments, "--json-format", "--stdout"], capture_output=True, text=True).stdout
    throws = defaultdict(lambda: defaultdict(list))
    for document in map(json.loads, out.splitlines()):
        for file in document["files"]:
            for line in file["lines"]:
                throws[file["file"]][line["line_number"]] += [branch["throw"] for branch in line["branches"]]
    return throws


def as_written(text, throws):
    """The .gcov file without those branches."""
    source = re.search(r"^ +-: +0:Source:(.*)$", text, re.M)[1]
    code = "\n".join(re.findall(r"^ *[^ :]+: *[1-9]\d*:(.*)$", text.split("\n------------------", 1)[0], re.M))
    catches = lines_of_catch_blocks(code)
    blocks = [[0, False, []]]  # source line, is a landing pad, lines of text; in the order of the text
    for line in text.splitlines():
        if found := re.match(r" *[^ :]+: *(\d+):", line):
            blocks.append([int(found[1]), False, [line]])
        elif found := re.match(r" *(\S+): *\d+-block", line):
            blocks.append([blocks[-1][0], found[1] == "$$$$$", [line]])
        else:
            blocks[-1][2].append(line)
    branches = defaultdict(int)
    for number, _, lines in blocks:
        branches[number] += sum(line.startswith("branch") for line in lines)
    kept, nth = [], defaultdict(int)
    for number, is_landing_pad, lines in blocks:
        mine = range(nth[number], nth[number] + sum(line.startswith("branch") for line in lines))
        nth[number] = mine.stop
        flags = throws[source][number]  # count of the same branches if both texts have as many; else all are kept
        throws_here = len(flags) == branches[number] and any(flags[n] for n in mine)
        leave_out = throws_here or (is_landing_pad and number not in catches)
        kept += [line for line in lines if not (leave_out and line.startswith("branch"))]
    return "\n".join(kept) + "\n"


def main():
    arguments = sys.argv[1:]
    if "--help" in arguments or "--version" in arguments:
        os.execvp(GCOV, [GCOV, *arguments])
    done = subprocess.run([GCOV, *arguments, "--all-blocks"], capture_output=True, text=True)
    throws = throws_of(arguments)
    for name in re.findall(r"^Creating '(.*)'$", done.stdout, re.M):
        with open(name, encoding="utf-8", errors="replace") as file:
            text = re.sub(r" taken -\d+", " taken 0", file.read())  # threads that count at once; gcovr drops such a line whole
        with open(name, "w", encoding="utf-8") as file:
            file.write(as_written(text, throws))
    sys.stdout.write(done.stdout)
    sys.stderr.write(done.stderr)
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
