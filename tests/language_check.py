#!/usr/bin/env python3
"""Counts the sentences of comments and pages that begin with a word of BEGINNINGS, folder by folder.

    tests/language_check.py            compares with tests/language.toml; exit status 1 where a folder became worse
    tests/language_check.py --record   writes lower values into tests/language.toml; refuses to raise one
    tests/language_check.py --list FOLDER    prints all such sentences of a folder
    tests/language_check.py --shares         prints the share of each folder

A folder fails if its share rose and a sentence of this kind was added, or if its share rose by more than one sentence's
worth because others were deleted. A folder that is not in the record may have the share of the whole record.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tomllib

from source_text import CPP, HASH, TOML, comments, python_comments, source_files

ROOT = pathlib.Path(__file__).resolve().parent.parent
RECORD = "tests/language.toml"
BEGINNINGS = set("what who whose whether which where how of as so such nobody nothing none those that".split())
OWN_FOLDERS = ("drivers/sim", "node/ctl", "node/lab", "node/modbus")  # in addition to the first level of the tree and to tests/*
CPP_FILES, TOML_FILES = (".c", ".cpp", ".h", ".hpp"), (".toml",)
HASH_FILES = (".sh", ".cmake", "CMakeLists.txt", "run")  # shell and CMake
SUFFIXES = (*CPP_FILES, *TOML_FILES, *HASH_FILES, ".py", ".md")

# The full stop of an abbreviation, or of a single letter, ends no sentence. The stop of 0.5 has no space after it.
ABBREVIATION = re.compile(
    r"(?:^|[\s(\[\"'])(?:e\.g|i\.e|cf|vs|figs?|eqs?|sec|ch|vol|nos?|pp?|al|ca|approx|resp|min|max|[A-Za-z])\.$", re.IGNORECASE)
SENTENCE_END = re.compile(r"(?<!\.)[.!?][\"')\]]*\s+(?=[\"'(\[]*[A-Z0-9])")
NOT_PROSE = re.compile(r"^(?:namespace\b|NOLINT|clang-format (?:on|off)|SPDX|(?:rt|setup):|pylint:|noqa|shellcheck )")
LIST_ITEM = re.compile(r"^\s*(?:[*+-]|\d+[.)])\s+")
WORD = re.compile(r"\b[A-Za-z][A-Za-z'’-]*\b")
CODE = "Code"  # stands for a piece of code in a sentence


def sentences(paragraph):
    """The sentences of [(line, text), ...] with the line on which each begins. A sentence has two words or more."""
    text, starts = "", []
    for line, part in paragraph:
        starts.append((len(text), line))
        text += part.strip() + " "
    text = re.sub(r"``?[^`]+``?", lambda code: CODE.ljust(len(code.group()), "_"), text)  # the length stays
    ends = [0]
    for found in SENTENCE_END.finditer(text):
        if not ABBREVIATION.search(text[ends[-1]:found.start() + 1]) or text[found.start()] != ".":
            ends.append(found.end())
    ends.append(len(text))
    for begin, end in zip(ends, ends[1:]):
        sentence = re.sub(r"_{2,}", "", text[begin:end]).strip()
        if len(WORD.findall(sentence)) >= 2 and not NOT_PROSE.match(sentence):
            yield max((s for s in starts if s[0] <= begin), default=starts[0])[1], sentence


def begins_badly(sentence):
    word = WORD.search(sentence)
    return bool(word) and re.split(r"['’]", word.group().lower())[0] in BEGINNINGS


def comment_paragraphs(found):
    """Joins comments on successive lines. A comment after code is joined with comment lines below it in the same column."""
    paragraph, last = [], (0, 0)
    for line, column, after_code, comment in found:
        block = comment.startswith(("/*", '"""'))
        parts = re.sub(r"^(?:/\*+|\"\"\"|//[/!]?<?|#+)|\*+/$", "", comment).split("\n")
        joined = not block and not after_code and last == (line - 1, column)
        for number, part in enumerate(parts):
            part = re.sub(r"^\s*\*(?=\s|$)", "", part) if comment.startswith("/*") else part
            text = LIST_ITEM.sub("", part)
            code = block and comment.startswith('"') and re.match(r"\s{4,}", part) and not part.strip().endswith(".")
            if paragraph and (not text.strip() or code or text != part or NOT_PROSE.match(text.strip()) or not (joined or number)):
                yield paragraph
                paragraph = []
            if text.strip() and not code:
                paragraph.append((line + number, text))
        last = (0, 0) if block else (line, column)
    if paragraph:
        yield paragraph


def page_paragraphs(text):
    """Prose, list items and cells of tables; no headings, no code."""
    paragraph, fenced, in_list = [], False, False
    for line, part in enumerate(text.split("\n"), 1):
        fence = part.strip().startswith(("```", "~~~"))
        item = LIST_ITEM.match(part)
        row = part.strip().startswith("|")
        code = part.startswith("    ") and not in_list and not paragraph
        ends = fence or fenced or item or row or code or not part.strip() or part.startswith(("#", "<", "!["))
        if ends and paragraph:
            yield paragraph
            paragraph = []
        fenced ^= fence
        if fence or fenced:
            continue
        if part.strip():
            in_list = bool(item) or (in_list and part.startswith(" "))
        part = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", part).replace("**", "").replace("*", "")
        if row:
            for cell in re.sub(r"`[^`]*`", lambda c: c.group().replace("|", "/"), part.strip().strip("|")).split("|"):
                if cell.strip(" -:"):
                    yield [(line, cell)]
        elif not code and part.strip() and not part.startswith(("#", "<", "![")):
            paragraph.append((line, LIST_ITEM.sub("", part)))
    if paragraph:
        yield paragraph


def file_sentences(path):
    name, text = os.path.basename(path), pathlib.Path(path).read_text(errors="replace")
    suffix = os.path.splitext(name)[1]
    if suffix == ".md":
        paragraphs = page_paragraphs(text)
    elif suffix == ".py":
        paragraphs = comment_paragraphs(c for c in sorted(python_comments(text)) if not c[3].startswith("#!"))
    else:
        pattern = CPP if suffix in CPP_FILES else TOML if suffix in TOML_FILES else HASH
        paragraphs = comment_paragraphs(c for c in comments(text, pattern) if not c[3].startswith("#!"))
    for paragraph in paragraphs:
        yield from sentences(paragraph)


def folder_of(name):
    parts = name.split("/")[:-1]
    if parts[:1] == ["tests"] or "/".join(parts[:2]) in OWN_FOLDERS:
        return "/".join(parts[:2])
    return parts[0] if parts else "."


def count(root):
    """{folder: [sentences, [(file, line, sentence that begins badly), ...]]}"""
    folders = {}
    for path in source_files(root, SUFFIXES):
        name = os.path.relpath(path, root).replace(os.sep, "/")
        if name == RECORD:
            continue
        entry = folders.setdefault(folder_of(name), [0, []])
        for line, sentence in file_sentences(path):
            entry[0] += 1
            if begins_badly(sentence):
                entry[1].append((name, line, sentence))
    return {folder: entry for folder, entry in folders.items() if entry[0]}


def read_record(root):
    path = pathlib.Path(root, RECORD)
    return {k: (v["of"], v["begin"]) for k, v in tomllib.loads(path.read_text()).items()} if path.exists() else {}


def allowed(record, folder):
    if folder in record:
        return record[folder]
    return sum(r[0] for r in record.values()), sum(r[1] for r in record.values())


def worse(now, before):
    """Exact, in integers: shares are compared as cross products."""
    (n, bad), (n_before, bad_before) = now, before
    rose = bad * max(n_before, 1) > bad_before * n
    return rose and (bad > bad_before or (bad - 1) * max(n_before, 1) > bad_before * n)


def changed_lines(root):
    """{file: lines changed since the commit that last wrote the record}; None if git does not know it."""
    def git(*words):
        return subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True, check=True).stdout
    try:
        commit = git("log", "-1", "--format=%H", "--", RECORD).strip() or "HEAD"
        lines, name = {}, None
        for line in git("diff", "-U0", "--no-color", "--no-ext-diff", "-M", commit, "--").splitlines():
            if line.startswith("+++ "):
                name = line[6:]
            elif hunk := re.match(r"@@ \S+ \+(\d+)(?:,(\d+))? @@", line):
                first, length = int(hunk[1]), int(hunk[2] or 1)
                lines.setdefault(name, set()).update(range(first, first + length))
        for name in git("ls-files", "--others", "--exclude-standard").splitlines():
            lines[name] = range(1, 1000000)
        return lines
    except (OSError, subprocess.CalledProcessError):
        return None


def report(folder, now, before, offenders, changed):
    print(f"{folder}: {now[1]} of {now[0]} sentences begin with a word of the list ({share(now)}); allowed: "
          f"{before[1]} of {before[0]} ({share(before)})")
    new = [o for o in offenders if changed is not None and o[1] in changed.get(o[0], ())]
    for name, line, sentence in (new or offenders)[:20]:
        print(f"  {name}:{line}: {sentence[:110]}")


def share(counts):
    return f"{100 * counts[1] / max(counts[0], 1):.1f} %"


def write_record(root, folders, record):
    now = {folder: (entry[0], len(entry[1])) for folder, entry in folders.items()}
    refused = [f for f in now if record and worse_share(now[f], allowed(record, f))]
    for folder in refused:
        print(f"{folder}: {share(now[folder])} is above the recorded {share(allowed(record, folder))}; the recorded value stays")
    lines = ["# Sentences of comments and pages (of), and those that begin with a word of the list in language_check.py (begin).",
             "# Written by tests/language_check.py --record, which refuses to raise a share."]
    for folder in sorted(now):
        of, begin = record.get(folder, (0, 0)) if folder in refused else now[folder]
        if of:
            lines.append(f'"{folder}" = {{of = {of}, begin = {begin}}}')
    pathlib.Path(root, RECORD).parent.mkdir(exist_ok=True)
    pathlib.Path(root, RECORD).write_text("\n".join(lines) + "\n")
    return 1 if refused else 0


def worse_share(now, before):
    return now[1] * max(before[0], 1) > before[1] * now[0]


def main(words=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--root", default=ROOT)
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--list", metavar="FOLDER")
    parser.add_argument("--shares", action="store_true", help="print the share of each folder")
    args = parser.parse_args(words)
    folders, record = count(args.root), read_record(args.root)
    if args.list:
        for name, line, sentence in folders.get(args.list, (0, []))[1]:
            print(f"{name}:{line}: {sentence}")
        return 0
    if args.shares:
        for folder, (n, offenders) in sorted(folders.items()):
            print(f"{folder:16} {len(offenders):5} of {n:5}  {share((n, len(offenders)))}")
        return 0
    if args.record:
        return write_record(args.root, folders, record)
    if not record:
        print(f"{RECORD} is missing: write it with tests/language_check.py --record")
        return 1
    if 2 * sum(n for n, _ in folders.values()) < allowed(record, None)[0]:
        print("fewer than half of the recorded sentences were found: this program or its record is wrong")
        return 1
    failed, changed = 0, None
    for folder, (n, offenders) in sorted(folders.items()):
        now, before = (n, len(offenders)), allowed(record, folder)
        if worse(now, before) if folder in record else worse_share(now, before):
            changed = changed_lines(args.root) if not failed else changed
            report(folder, now, before, offenders, changed)
            failed += 1
    if failed:
        print("Begin these sentences with their subject. Once a share is lower, tests/language_check.py --record keeps it there.")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
