#!/usr/bin/env python3
"""prose_check.py on small trees: which lines are prose, which words are judged, and how it is skipped."""
import contextlib
import io
import pathlib
import tempfile
import unittest
import unittest.mock

import prose_check as check

LONG = "word " * 23 + "end."  # 119 characters


class Lines(unittest.TestCase):
    def long(self, text):
        return [line for line, _ in check.long_lines(text)]

    def test_prose_and_items_of_lists_are_limited(self):
        self.assertEqual(self.long(f"# Title\n\n{LONG}\n\n* {LONG}\n  {LONG}\n\n    * below {LONG}\n"), [3, 5, 6, 8])
        self.assertEqual(self.long("x" * 110), [])

    def test_tables_headings_code_and_pictures_are_not(self):
        self.assertEqual(self.long(f"# {LONG}\n\n| {LONG} |\n\n    {LONG}\n\n```\n{LONG}\n```\n![{LONG}](a.svg)\n"), [])


class Words(unittest.TestCase):
    def words(self, text):
        return [word for _, word in check.words_of([(1, text)])]

    def test_code_units_names_and_files_are_no_words(self):
        self.assertEqual(self.words("It reads `stael_ms`, stael_ms, 20kHz, SCHED, tactilectl.py, https://a.bcd/efgh and stale() values."), ["reads", "values"])

    def test_a_word_has_its_line(self):
        self.assertEqual(list(check.words_of([(4, "wrong"), (5, "spelt's")])), [(4, "wrong"), (5, "spelt")])


class Tree(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def run_check(self):
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            status = check.main(["--root", str(self.root)])
        return status, output.getvalue()

    def test_a_misspelt_word_is_named_with_its_place_unless_it_is_in_the_list(self):
        if check.unknown({"word"}, set()) is None:
            self.skipTest("no hunspell with its dictionaries")
        (self.root / "a.md").write_text("A sentence.\n\nThe tactyle colour and color.\n")
        (self.root / "a.cpp").write_text("int a;  // a meazure\n")
        status, output = self.run_check()
        self.assertEqual(status, 1)
        self.assertIn("a.md:3: tactyle", output)
        self.assertIn("a.cpp:1: meazure", output)
        self.assertEqual(output.count("dictionary"), 2)
        (self.root / "tests").mkdir()
        (self.root / "tests/words.txt").write_text("tactyle\nmeazure\n")
        self.assertEqual(self.run_check()[0], 0)

    def test_a_merge_that_was_not_finished_is_named(self):
        (self.root / "a.md").write_text("A line.\n" + "<" * 7 + " HEAD\nAnother one.\n")
        status, output = self.run_check()
        self.assertEqual(status, 1)
        self.assertIn("a.md:2: the mark of a merge", output)

    def test_without_a_dictionary_it_is_skipped_but_long_lines_are_errors(self):
        for missing in (unittest.mock.patch("shutil.which", return_value=None), unittest.mock.patch.object(check, "DICTIONARIES", "en_US,xx_XX")):
            with missing:
                (self.root / "a.md").write_text("A tactyle sentence.\n")
                status, output = self.run_check()
                self.assertEqual(status, 77)
                self.assertIn("is missing", output)
                (self.root / "a.md").write_text(LONG + "\n")
                self.assertEqual(self.run_check()[0], 1)


if __name__ == "__main__":
    unittest.main()
