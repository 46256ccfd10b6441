#!/usr/bin/env python3
"""The table, the judge and the page of tests/figures; and two planted errors in real benchmarks, which must be found.

    figures_test.py [unittest options]     TACTILED_BIN=FOLDER: the programs; without them the real plants are skipped
"""
import copy
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import definition
import figures
import judge
import page
import results as store

BIN = pathlib.Path(os.environ.get("TACTILED_BIN", store.ROOT / "build/release/bin"))
SLOWER = 1.3
INSTRUCTIONS = """table/linear none             928 instructions a sample
table/linear checks          1810 instructions a sample
"""
SHM = """blocked p50 22.3 us, p99 35.7 us, reader's CPU {cpu} %, messages 1600 of 1600
closed loop p50 465 ns, p99 525 ns, 1.60 hops, messages 400000
"""


def figure(**fields):
    made = definition.Figure(**{"id": "a.b", "question": "how many", "within": (1, 2), **fields})
    made.run = definition.Run(id="a", command="measure it", duration_s=1, figures=[made], folders=("tests",))
    return made


class Table(unittest.TestCase):
    def test_the_table_is_right_and_each_folder_exists(self):
        for run in {f.run for f in definition.figures_of(definition.load()).values()}:
            for folder in run.folders:
                self.assertTrue((store.ROOT / folder).is_dir(), f"{run.id}: {folder}")

    def test_mistakes_in_it_are_named(self):
        for fields, words in (({"read": "no group"}, "groups"), ({"read": "(a)", "within": (2, 1)}, "empty"), ({"read": "(a)", "kind": "x"}, "kind x")):
            wrong = figure(**fields)
            section = definition.Section(id="s", title="s", text="", runs=[wrong.run])
            self.assertIn(words, " ".join(definition.faults_of([section])))
            self.assertIn("twice", " ".join(definition.faults_of([section, section])))


class Judge(unittest.TestCase):
    def test_values_are_read(self):
        text = "a 1,200 of 4\na 3 of 5\n"
        for how, read, value in (("value", r"a ([\d,]+)", 1200), ("last", r"of (\d)", 5), ("max", r"of (\d)", 5), ("min", r"a ([\d,]+)", 3),
                                 ("sum", r"of (\d)", 9), ("count", r"^a ", 2), ("ratio", r"a (?P<of>[\d,]+) of (?P<over>\d)", 300), ("status", "", 0)):
            self.assertEqual(judge.value_of(figure(how=how, read=read), text), value, how)
        with self.assertRaises(judge.Unreadable):
            judge.value_of(figure(read=r"b (\d)"), text)

    def test_a_value_outside_names_figure_value_interval_and_command(self):
        message = judge.fault(figure(unit="ns"), 2.5)
        for part in ("a.b", "how many", "2.5 ns", "1 .. 2", "measure it"):
            self.assertIn(part, message)
        self.assertEqual(judge.fault(figure(), 1.5), "")

    def test_a_time_is_judged_on_the_idle_stored_machine_only(self):
        for kind, here, idle, expected in (("absolute", "m", True, True), ("absolute", "m", False, False), ("absolute", "n", True, False),
                                           ("ratio", "n", False, True)):
            self.assertEqual(judge.judged(figure(kind=kind), here, "m", idle), expected)
        self.assertTrue(judge.is_idle(share=0.01))
        self.assertFalse(judge.is_idle(share=0.2))

    def test_a_time_of_a_busy_machine_replaces_none_of_an_idle_one(self):
        late = figure(kind="absolute")
        results = {"machine": "m", "figures": {"a.b": {"value": 1.5, "idle": True}}}
        self.assertEqual(figures.keep(results, late, 9, 1, "m", False), "")
        self.assertEqual(results["figures"]["a.b"]["value"], 1.5)
        self.assertIn("outside", figures.keep(results, late, 9, 1, "m", True))
        self.assertEqual(figures.keep(results, late, 1.2, 1, "m", True), "")
        self.assertEqual(results["figures"]["a.b"]["value"], 1.2)


class PlantsInStoredOutput(unittest.TestCase):
    def setUp(self):
        self.figures = definition.figures_of(definition.load())

    def test_a_slow_down_of_30_percent_is_outside_the_interval_of_each_count(self):
        values = store.load()["figures"]
        counted = [f for f in self.figures.values() if f.kind == "instructions"]
        self.assertGreater(len(counted), 5)
        for one in counted:
            value = values[one.id]["value"]
            self.assertEqual(judge.fault(one, value), "")
            self.assertIn("is outside", judge.fault(one, SLOWER * value), one.id)
            self.assertIn("is outside", judge.fault(one, value / SLOWER), one.id)

    def test_a_slower_method_and_a_busy_reader(self):
        linear, cpu = self.figures["instructions.linear"], self.figures["shm.blocked_cpu"]
        self.assertEqual(judge.fault(linear, judge.value_of(linear, INSTRUCTIONS)), "")
        self.assertIn("outside", judge.fault(linear, judge.value_of(linear, INSTRUCTIONS.replace("1810", "2353"))))
        self.assertEqual(judge.fault(cpu, judge.value_of(cpu, SHM.format(cpu=2.3))), "")
        self.assertIn("outside", judge.fault(cpu, judge.value_of(cpu, SHM.format(cpu=95.5))))


class PlantsInPrograms(unittest.TestCase):
    @unittest.skipUnless((BIN / "shm_bench").exists(), "shm_bench is not built")
    def test_a_busy_reader(self):
        done = subprocess.run([BIN / "shm_bench", "--seconds", "0.5", "--plant", "busy-reader"], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 1)
        self.assertIn("it does not sleep", done.stderr)
        cpu = definition.figures_of(definition.load())["shm.blocked_cpu"]
        self.assertIn("outside", judge.fault(cpu, judge.value_of(cpu, done.stdout)))

    @unittest.skipUnless((BIN / "decouple_bench").exists() and shutil.which("valgrind"), "decouple_bench or valgrind is missing")
    def test_a_slow_down_of_30_percent(self):
        one = definition.figures_of(definition.load())["methods.sum_diff"]
        script = store.ROOT / "tests/bench/decouple_instructions.py"
        for plant, outside in ((["--plant", "slow"], True), ([], False)):
            output = subprocess.run([sys.executable, script, "--only", "hair/sum_diff", "--levels", "checks", "--bench", BIN / "decouple_bench", *plant],
                                    capture_output=True, text=True, timeout=300, check=True).stdout
            self.assertEqual("outside" in judge.fault(one, judge.value_of(one, output)), outside, output)


class Pages(unittest.TestCase):
    def setUp(self):
        self.one = figure(show="{:.1f}", read="(a)")
        self.sections = [definition.Section(id="s", title="Section", text="A is {a.b}.", runs=[self.one.run])]
        self.figures = {"a.b": self.one}
        self.results = {"machine": "m", "figures": {"a.b": store.entry(self.one, 1.25, 2, "m", True)}}

    def test_figures_on_a_page_are_filled_in_and_unknown_ones_named(self):
        text, unknown = page.with_figures("x <!--= a.b -->9<!--/--> y <!--= a.c -->8<!--/-->", self.figures, self.results)
        self.assertEqual(text, "x <!--= a.b -->1.2<!--/--> y <!--= a.c -->8<!--/-->")
        self.assertEqual(unknown, ["a.c"])

    def test_pages_that_differ_and_too_many_words_are_found(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "tests/bench").mkdir(parents=True)
            (root / page.PAGE).write_text("")
            (root / "README.md").write_text("x <!--= a.b -->9<!--/-->\n")
            self.assertEqual(len(list(page.faults(self.sections, self.figures, self.results, root))), 2)
            page.render(self.sections, self.figures, self.results, root)
            self.assertEqual(list(page.faults(self.sections, self.figures, self.results, root)), [])
            self.assertIn("A is 1.2.", (root / page.PAGE).read_text())
            self.sections[0].text = "word " * 6001
            page.render(self.sections, self.figures, self.results, root)
            self.assertIn("words", " ".join(page.faults(self.sections, self.figures, self.results, root)))

    def test_changes_since_a_commit(self):
        long = copy.copy(self.one)
        long.kind = "long"
        for commit, words in (("0000000", "no longer exists"), ("HEAD", "unchanged")):
            self.results["figures"]["a.b"].update(commit=commit, changed_lines=store.changed_since(commit, ("LICENSE",)))
            if store.git("rev-parse", "HEAD"):
                self.assertIn(words, page.origin(long, self.results["figures"]["a.b"]))

    def test_a_value_of_no_commit_fails_the_check(self):
        for commit in ("1234567+", "unknown"):
            self.results["figures"]["a.b"]["commit"] = commit
            self.assertIn("a.b was measured with changes that are in no commit", list(figures.check(self.sections, self.figures, self.results)))

    def test_a_value_that_is_missing_or_outside_fails_the_check(self):
        self.results["figures"]["a.b"]["value"] = 7
        self.assertIn("outside", " ".join(figures.check(self.sections, self.figures, self.results)))
        self.results["figures"].clear()
        self.assertIn("no value", " ".join(figures.check(self.sections, self.figures, self.results)))

    def test_each_link_into_the_page_has_its_heading(self):
        text = page.rendered(definition.load(), definition.figures_of(definition.load()), store.load())
        headings = {re.sub(r"[^\w\- ]", "", line.lstrip("# ").lower()).replace(" ", "-") for line in text.splitlines() if line.startswith("#")}
        for path in store.ROOT.rglob("*.md"):
            if "build" not in path.relative_to(store.ROOT).parts:
                for anchor in re.findall(r"RESULTS\.md#([\w-]+)", path.read_text()):
                    self.assertIn(anchor, headings, path)


if __name__ == "__main__":
    unittest.main()
