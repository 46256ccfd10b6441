#!/usr/bin/env python3
"""gcov_as_written.py on a program of which each branch is known: it leaves out what only unwinding takes, and nothing that a person wrote."""
import json
import pathlib
import subprocess
import tempfile
import unittest

GCOV = pathlib.Path(__file__).resolve().with_name("gcov_as_written.py")
# A line, and how many branches are counted there: two a condition, two a catch that there is another one behind; and two for
# each "was it made?" that the compiler asks on the ordinary way, which runs both ways when the conditions do.
PROGRAM = [
    ("#include <stdexcept>", 0),
    ("#include <string>", 0),
    ("struct Closes {", 0),
    ("    explicit Closes(bool open) : open_(open) {}", 0),
    ("    ~Closes() { if (open_) open_ = false; }", 2),
    ("    bool open_; };", 0),
    ("std::string made(int n) {", 0),
    ("    if (n > 2) throw std::runtime_error(\"large {\");", 2),
    ("    return std::string(\"a\") + std::string(\"b\") + \"c\"; }", 0),
    ("int tried(int n) { try {", 0),
    ("        const Closes file(n > 0);", 0),
    ("        return int(made(n).size());", 0),
    ("    } catch (const std::runtime_error& error) {", 2),
    ("        if (error.what()[0] == 'l') return -1;", 2),
    ("        return error.what()[1] == '}' ? -2 : -3;", 2),
    ("    } catch (...) { return n > 7 && n < 9 ? -4 : -5; } }", 4),
    ("int never(const std::string& text) {", 0),
    ("    for (const char c : text + made(1)) if (c == 'x') return 1;", 4 + 2),
    ("    return text.empty() ? 0 : 1; }", 2),
    ("int main(int argc, char**) {", 0),
    ("    return argc > 8 ? never(\"a\") : tried(argc) + tried(0) + tried(3); }", 2 + 4),
]


class AsWritten(unittest.TestCase):
    def test_every_branch_that_a_person_wrote_is_counted_and_no_other(self):
        folder = self.enterContext(tempfile.TemporaryDirectory())
        (pathlib.Path(folder) / "a.cpp").write_text("".join(line + "\n" for line, _ in PROGRAM))
        subprocess.run("g++ -O0 --coverage a.cpp -o a && ./a >/dev/null; test -e a*.gcda", shell=True, cwd=folder, check=True)
        out = subprocess.run(["gcovr", "--root", folder, "--branches", "--json", "--gcov-executable", GCOV], cwd=folder,
                             capture_output=True, text=True, check=True).stdout
        counted = {line["line_number"]: len(line["branches"]) for line in json.loads(out)["files"][0]["lines"]}
        self.assertEqual({line: counted.get(line, 0) for line in range(1, len(PROGRAM) + 1)},
                         {number: wanted for number, (_, wanted) in enumerate(PROGRAM, 1)})


if __name__ == "__main__":
    unittest.main(verbosity=2)
