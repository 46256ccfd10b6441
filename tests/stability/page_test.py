#!/usr/bin/env python3
"""The page names exactly the cases that the program judges, and its last line: page_test.py PROGRAM."""
import pathlib
import re
import subprocess
import sys

ROW = re.compile(r"^\| ([A-Z][A-Za-z0-9. ]*) \| .* \| .* \| .* \| .* \| .* \|$", re.M)
text = (pathlib.Path(__file__).parent / "CASES.md").read_text()
said = subprocess.run([sys.argv[1], "--table"], capture_output=True, text=True, check=False).stdout
page, cases, counts = ROW.findall(text), ROW.findall(said), said.splitlines()[-1]
print("only on the page:", sorted(set(page) - set(cases)), "only in the program:", sorted(set(cases) - set(page)))
print("not on the page:" if counts not in text else "on the page:", counts)
sys.exit(page != cases or counts not in text or len(cases) < 60 or len(set(cases)) != len(cases))
