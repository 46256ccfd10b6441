#!/usr/bin/env python3
"""Checks pages for lines of prose that are too long and for marks of merges, and pages and comments for words that no dictionary has.

    tests/prose_check.py            exit status 1 names each line and each unknown word with its places
    tests/prose_check.py --words    prints the unknown words alone, to be corrected or added to tests/words.txt

The length holds for pages that no program writes; clang-format limits the lines of comments. The spelling is that of hunspell
with the dictionaries en_US and en_GB; without hunspell, or without one of them, it is not checked and the exit status is 77.
"""
import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys

from language_check import CODE, CPP_FILES, SUFFIXES, TOML_FILES, comment_paragraphs, page_paragraphs
from source_text import CPP, HASH, TOML, comments, python_comments, source_files

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORDS = "tests/words.txt"
MAX_LENGTH = 110
GENERATED = ("config/KEYS.md", "node/modbus/MAP.md", "tests/faults/AGAINST.md", "tests/faults/PLC.md", "tests/faults/TABLE.md", "tests/orders/TABLES.md",
             "tests/stability/CASES.md")
DICTIONARIES = "en_US,en_GB"
NOT_WORDS = re.compile(r"``?[^`]+``?|https?://\S+|(?<!\w)\S*[/\\_=<>{}@$|^]\S*|\b\w+\(\)|\S+\.(?:md|cpp|hpp|h|py|toml|sh|csv|svg)\b")
TOKEN = re.compile(r"(?<![\w.'’-])[A-Za-z][A-Za-z'’]*(?![\w(])")
INNER_CAPITAL = re.compile(r"[a-z].*[A-Z]|^[A-Z]{2}")


def long_lines(text):
    """(line, length) of prose; tables, headings, code, links alone on their line and HTML may be longer."""
    fenced = in_list = False
    before = ""
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip().startswith(("```", "~~~")):
            fenced = not fenced
        item = re.match(r"\s*(?:[*+-]|\d+[.)])\s", line)
        in_list = bool(item) or (in_list and (line.startswith(" ") or not line.strip()))
        code = fenced or (line.startswith("    ") and not in_list) or (line.startswith("       ") and not item and not before.strip())
        if len(line) > MAX_LENGTH and not code and not line.lstrip().startswith(("|", "#", "<", "![")):
            yield number, len(line)
        before = line if line.strip() and not code else ("" if not line.strip() else before)


def paragraphs_of(path):
    name, text = os.path.basename(path), pathlib.Path(path).read_text(errors="replace")
    suffix = os.path.splitext(name)[1]
    if suffix == ".md":
        return page_paragraphs(text)
    if suffix == ".py":
        return comment_paragraphs(c for c in sorted(python_comments(text)) if not c[3].startswith("#!"))
    pattern = CPP if suffix in CPP_FILES else TOML if suffix in TOML_FILES else HASH
    return comment_paragraphs(c for c in comments(text, pattern) if not c[3].startswith("#!"))


def words_of(paragraph):
    """(line, word) of each word of prose. Names of code, files and units are none."""
    text = "\n".join(part for _, part in paragraph)
    text = NOT_WORDS.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), text)
    for found in TOKEN.finditer(text):
        word = re.sub(r"['’]s?$", "", found.group())
        if len(word) > 3 and word != CODE and not INNER_CAPITAL.search(word):
            yield paragraph[min(text.count("\n", 0, found.start()), len(paragraph) - 1)][0], word


def unknown(words, own):
    """Those of `words` that neither a dictionary nor the list of the project has. None: there is no dictionary."""
    if not shutil.which("hunspell"):
        return None
    installed = subprocess.run(["hunspell", "-D"], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if not all(f"/{name}\n" in installed.stdout + installed.stderr + "\n" for name in DICTIONARIES.split(",")):
        return None  # hunspell itself is content with one of them
    done = subprocess.run(["hunspell", "-d", DICTIONARIES, "-i", "utf-8", "-l"], input="\n".join(sorted(words)) + "\n",
                          capture_output=True, text=True, check=True)
    return {word for word in done.stdout.split() if word.lower() not in own}


def places(root):
    """{word: [(file, line), ...]}"""
    found = {}
    for path in source_files(root, SUFFIXES):
        name = os.path.relpath(path, root).replace(os.sep, "/")
        if name in GENERATED:
            continue
        for paragraph in paragraphs_of(path):
            for line, word in words_of(paragraph):
                found.setdefault(word, []).append((name, line))
    return found


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--root", default=ROOT, type=pathlib.Path)
    parser.add_argument("--words", action="store_true", help="print the unknown words alone")
    args = parser.parse_args(arguments)
    failed = 0
    for path in source_files(args.root, (".md",)):
        name = os.path.relpath(path, args.root).replace(os.sep, "/")
        if name in GENERATED or args.words:
            continue
        text = pathlib.Path(path).read_text()
        for line, length in long_lines(text):
            print(f"{name}:{line}: {length} characters; at most {MAX_LENGTH}")
            failed += 1
        for line in (n for n, line in enumerate(text.split("\n"), 1) if re.match("(<{7}|>{7}) ", line)):
            print(f"{name}:{line}: the mark of a merge that was not finished")
            failed += 1
    found = places(args.root)
    listed = args.root / WORDS
    own = set(listed.read_text().lower().split()) if listed.exists() else set()
    wrong = unknown(found, own)
    if wrong is None:
        print(f"spelling is not checked: hunspell with {DICTIONARIES} is missing (node/install-packages.sh tests)")
        return 1 if failed else 77
    for word in sorted(wrong, key=str.lower):
        print(word if args.words else f"{found[word][0][0]}:{found[word][0][1]}: {word} ({len(found[word])} times) is in no dictionary")
    if wrong and not args.words:
        print(f"Correct these words, or add them to {WORDS}.")
    return 1 if failed or wrong else 0


if __name__ == "__main__":
    sys.exit(main())
