#!/usr/bin/env python3
"""The page names exactly the cases that the program judges: page_test.py PROGRAM."""
import pathlib
import re
import subprocess
import sys

ROW = re.compile(r"^\| ([A-Z][A-Za-z0-9. ]*) \| .* \| .* \| .* \| .* \| .* \|$", re.M)
page = ROW.findall((pathlib.Path(__file__).parent / "README.md").read_text())
cases = ROW.findall(subprocess.run([sys.argv[1], "--table"], capture_output=True, text=True, check=False).stdout)
print("only on the page:", sorted(set(page) - set(cases)), "only in the program:", sorted(set(cases) - set(page)))
sys.exit(page != cases or len(cases) < 60 or len(set(cases)) != len(cases))
