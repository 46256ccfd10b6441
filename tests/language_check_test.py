#!/usr/bin/env python3
"""language_check.py on small trees: what a sentence is, and when a folder fails."""
import contextlib
import io
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import language_check as check


class Tree(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def write(self, name, text):
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def found(self, name, text):
        self.write(name, text)
        return [(line, sentence) for line, sentence in check.file_sentences(self.root / name)]

    def bad(self, name, text):
        return [line for line, sentence in self.found(name, text) if check.begins_badly(sentence)]

    def run_check(self, *words):
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            status = check.main(["--root", str(self.root), *words])
        return status, output.getvalue()


class Sentences(Tree):
    def test_a_comment_is_joined_over_its_lines(self):
        self.assertEqual(self.found("a.cpp", "// The loop reads,\n// of all links, one. Then it\n// sleeps.\nint a;\n"),
                         [(1, "The loop reads, of all links, one."), (2, "Then it sleeps.")])

    def test_comments_after_code_stand_alone_but_for_their_continuation(self):
        self.assertEqual(self.found("a.cpp", "int a;  // of the link\nint b;  // the maximum\n        // of it\n// Next one\n"),
                         [(1, "of the link"), (2, "the maximum of it"), (4, "Next one")])

    def test_a_blank_comment_line_and_a_list_item_end_a_sentence(self):
        self.assertEqual(self.bad("a.cpp", "// A list of two\n//\n// which are\n// * whose one\n"), [3, 4])

    def test_abbreviations_numbers_and_ranges_end_no_sentence(self):
        text = "// Gains, e.g. Which, i.e. How, fig. Of eq. Of 0.5 and C1 .. What J. Who.\n"
        self.assertEqual(len(self.found("a.cpp", text)), 1)
        self.assertEqual(self.bad("a.cpp", "// It ends here. Of these, two. As in (1).\n"), [1, 1])

    def test_code_in_backticks_is_one_word(self):
        self.assertEqual(self.bad("a.cpp", "// `what. Who is` names a key.\n"), [])
        self.assertEqual(self.bad("a.md", "`a.b. C` does it. What is left.\n"), [1])

    def test_strings_of_code_are_no_comments(self):
        self.assertEqual(self.found("a.cpp", 'const char* a = "// of what"; char q = \'"\'; auto r = R"(// who is)"; int m = 1\'000;\n'), [])
        self.assertEqual(self.found("a.sh", 'echo "a # of what" ${#words} $# \'# of\'\n'), [])
        self.assertEqual(self.found("a.toml", 'a = "# of what"\n'), [])
        self.assertEqual(self.found("a.py", 'a = "# of what"\n'), [])

    def test_each_language(self):
        self.assertEqual(self.bad("a.c", "/* A line.\n * Which one. */\n"), [2])
        self.assertEqual(self.bad("a.py", 'def f():\n    """Whether it is. It is."""\n    # nothing is here\n'), [2, 3])
        self.assertEqual(self.bad("a.sh", "#!/bin/sh\n# Where it is\ntrue  # as before\n"), [2, 3])
        self.assertEqual(self.bad("CMakeLists.txt", 'add("#of it")  # So it is.\n'), [1])
        self.assertEqual(self.bad("a.toml", "# Those are left.\na = 1  # how many\n"), [1, 2])

    def test_a_page_has_prose_lists_and_cells_but_no_code_or_headings(self):
        page = "# What it is\n\nThe text\nof it. Who reads?\n\n```\nwhat is code\n```\n\n* as an item\n\n| what | How so |\n|---|---|\n\n    of code\n"
        self.assertEqual(self.bad("a.md", page), [4, 10, 12])

    def test_contracts_and_closing_comments_are_no_sentences(self):
        self.assertEqual(self.found("a.cpp", "// Reads a frame.\n// rt: wait-free\n}  // namespace so\n"), [(1, "Reads a frame.")])

    def test_words_that_only_begin_like_one_of_the_list(self):
        self.assertEqual(self.bad("a.cpp", "// Software is here. Assets are. Ask it. Nonetheless it is. However it is. Thatch is.\n"), [])
        self.assertEqual(self.bad("a.cpp", "// That's it. Who's there? (Of two.)\n"), [1, 1, 1])


class Record(Tree):
    def setUp(self):
        super().setUp()
        self.write("node/a.cpp", "// It is here.\n\n// Of these two.\n\n// It is there.\n\n// It is good.\n")
        self.assertEqual(self.run_check("--record")[0], 0)

    def test_the_same_tree_passes_without_git(self):
        self.assertEqual(self.run_check(), (0, ""))

    def test_one_more_is_found_and_printed(self):
        self.write("node/b.cpp", "\n// What is left.\n")
        status, text = self.run_check()
        self.assertEqual(status, 1)
        self.assertIn("node: 2 of 5 sentences", text)
        self.assertIn("node/b.cpp:2: What is left.", text)
        self.assertIn("--record", text)

    @unittest.skipUnless(shutil.which("git"), "git is not installed")
    def test_with_git_the_changed_line_is_printed_and_no_other(self):
        def git(*words):
            subprocess.run(["git", "-C", str(self.root), "-c", "user.name=a", "-c", "user.email=a@b", *words], check=True,
                           capture_output=True)
        git("init", "-q")
        git("add", "-A")
        git("commit", "-q", "-m", "a")
        self.write("node/b.cpp", "// What is left.\n")
        text = self.run_check()[1]
        self.assertIn("node/b.cpp:1", text)
        self.assertNotIn("node/a.cpp", text)

    def test_one_good_sentence_may_go_but_not_two(self):
        self.write("node/a.cpp", "// It is here.\n\n// Of these two.\n\n// It is there.\n")
        self.assertEqual(self.run_check()[0], 0)
        self.write("tests/unit/a.cpp", "// Of two.\n" + "\n// It is good.\n" * 9 + "\n// Of three.\n")
        self.write("tests/language.toml", '"node" = {of = 4, begin = 1}\n"tests/unit" = {of = 23, begin = 2}\n')
        self.assertIn("tests/unit: 2 of 11", self.run_check()[1])
        self.write("tests/language.toml", '"node" = {of = 4, begin = 1}\n"tests/unit" = {of = 22, begin = 2}\n')
        self.assertEqual(self.run_check()[0], 0)

    def test_good_sentences_do_not_buy_bad_ones_above_the_share(self):
        self.write("node/b.cpp", "// It is.\n\n" * 4 + "// Of that.\n")
        self.assertEqual(self.run_check()[0], 0)  # 2 of 9
        self.write("node/b.cpp", "// It is.\n\n" * 2 + "// Of that.\n")
        self.assertEqual(self.run_check()[0], 1)  # 2 of 7

    def test_a_folder_that_is_new_has_the_share_of_all(self):
        self.write("lab/a.cpp", "// Of that.\n\n" + "// It is.\n\n" * 3)
        self.assertEqual(self.run_check()[0], 0)
        self.write("lab/a.cpp", "// Of that.\n\n" + "// It is.\n\n" * 2)
        self.assertEqual(self.run_check()[0], 1)

    def test_record_lowers_and_never_raises(self):
        self.write("node/a.cpp", "// It is here.\n")
        self.assertEqual(self.run_check("--record")[0], 0)
        self.assertEqual(check.read_record(self.root), {"node": (1, 0)})
        self.write("node/a.cpp", "// Of it all.\n")
        status, text = self.run_check("--record")
        self.assertEqual(status, 1)
        self.assertIn("the recorded value stays", text)
        self.assertEqual(check.read_record(self.root), {"node": (1, 0)})


if __name__ == "__main__":
    unittest.main()
