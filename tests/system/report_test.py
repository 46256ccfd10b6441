"""tactilectl calibrate --report: a page that another parser reads, that needs no other resource and replaces no data."""
import html.parser
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

from daemon import BIN, ROOT

LABELLED = ROOT / "tests/data/eflesh/normal_labelled.csv"
ALONE = {"meta", "br"}  # elements without an end tag


class Page(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.open, self.seen, self.faults, self.words, self.values = [], {}, [], [], []
        self.feed(text)
        self.close()
        self.faults += [f"<{tag}> stays open" for tag in self.open]

    def handle_starttag(self, tag, attributes):
        self.seen[tag] = self.seen.get(tag, 0) + 1
        self.faults += [f"{tag} {name}" for name, _ in attributes if name in ("src", "href") or name.startswith("on")]
        self.values += [float(value) for name, value in attributes if tag == "data" and name == "value"]
        if tag not in ALONE:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> at {self.getpos()}")

    def handle_data(self, data):
        self.words.append(data)


class Report(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def calibrate(self, labelled, report, *words):
        return subprocess.run([BIN / "tactilectl", "calibrate", "--model", "generic", "--in", labelled, "--out",
                               self.folder / "skin.toml", "--report", report, *words], capture_output=True, text=True)

    def test_the_page_is_whole_and_says_what_the_terminal_says(self):
        done = self.calibrate(LABELLED, self.folder / "skin.html", "--session", "1", "--method", "rbf", "--serial", "<b>7</b>")
        self.assertEqual(done.returncode, 0, done.stderr)
        text = (self.folder / "skin.html").read_text()
        page = Page(text)
        self.assertEqual(page.faults, [])
        self.assertEqual(page.seen["svg"], 6)
        self.assertFalse({"script", "link", "img", "b"} & set(page.seen))
        self.assertNotRegex(text, "(?i)http|url\\(|@import")
        self.assertIn("<b>7</b>", page.words)
        full_scale, fitted, held_out, percent = re.search(r" fz +\d+ +(\S+) N +(\S+) N +(\S+) N +(\S+)", done.stdout).groups()
        for printed in (full_scale, fitted, held_out, percent):
            self.assertTrue(any(abs(value - float(printed)) <= 5e-3 * abs(value) for value in page.values), printed)

    def test_a_report_never_replaces_the_recording_or_the_calibration(self):
        labelled = self.folder / "labelled.csv"
        labelled.write_bytes(LABELLED.read_bytes())
        (self.folder / "link.csv").symlink_to(labelled)
        for report in (labelled, self.folder / "." / "skin.toml", self.folder / "link.csv"):
            done = self.calibrate(labelled, report)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("would replace this file", done.stderr)
        self.assertEqual(labelled.read_bytes(), LABELLED.read_bytes())
        self.assertFalse((self.folder / "skin.toml").exists())

    def test_a_calibration_never_replaces_the_recording(self):
        labelled = self.folder / "skin.toml"
        labelled.write_bytes(LABELLED.read_bytes())
        done = self.calibrate(labelled, self.folder / "skin.html")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("would replace this file", done.stderr)
        self.assertEqual(labelled.read_bytes(), LABELLED.read_bytes())

    def test_times_that_are_no_seconds_are_refused(self):
        (self.folder / "now.csv").write_text("t_s,B1\n5e10,1\n")
        (self.folder / "one.toml").write_text('format = 1\nmodel = "generic"\nchannels = ["B1"]\nzero = [0]\n'
                                              'components = ["fz"]\nmatrix = [[1]]\n')
        done = subprocess.run([BIN / "tactilectl", "decouple", "--calibration", self.folder / "one.toml", "--in",
                               self.folder / "now.csv"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("now.csv:2: column t_s", done.stderr)

    def test_a_file_is_tared_on_demand(self):
        (self.folder / "raw.csv").write_text("t_s,B1\n" + "".join(f"{0.1 * i:.1f},{5 + i % 2 + (-20 if i > 9 else 0)}\n" for i in range(20)))
        text = 'format = 1\nmodel = "generic"\nchannels = ["B1"]\nzero = [0]\ncomponents = ["fz"]\nmatrix = [[1]]\n'

        def decouple(*words):
            done = subprocess.run([BIN / "tactilectl", "decouple", "--calibration", self.folder / "one.toml", "--in",
                                   self.folder / "raw.csv", *words], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            return [float(line.split(",")[3] or "nan") for line in done.stdout.splitlines()[1:]], done.stderr
        (self.folder / "one.toml").write_text(text)
        raw, said = decouple()
        self.assertEqual((raw[:2], raw[-1], said), ([5, 6], -14, ""))
        tared, _ = decouple("--tare-s", "1")
        self.assertEqual([force - 5.5 for force in raw], tared)
        self.assertEqual(decouple("--tare-s", "9")[0], [force - sum(raw) / 20 for force in raw])
        (self.folder / "one.toml").write_text(text + 'validation = "leave one session out (2 sessions), each with its own zero"\n')
        self.assertIn("use --tare-s", decouple()[1])
        self.assertEqual(decouple("--tare-s", "1")[1], "")
        rows = (self.folder / "raw.csv").read_text().splitlines()
        (self.folder / "raw.csv").write_text("\n".join([rows[0], "0.0,", *rows[2:]]) + "\n")  # no value in the first row
        self.assertAlmostEqual(decouple("--tare-s", "1")[0][1], 6 - (4 * 5 + 5 * 6) / 9)

    def test_a_report_in_a_missing_folder_is_refused_before_the_fit(self):
        done = self.calibrate(LABELLED, self.folder / "nowhere" / "skin.html")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("nowhere", done.stderr)
        self.assertFalse((self.folder / "skin.toml").exists())

    def test_a_report_that_cannot_be_written_is_an_error_and_the_calibration_stands(self):
        os.mkfifo(self.folder / "skin.html")
        done = self.calibrate(LABELLED, self.folder / "skin.html")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("skin.html: not saved", done.stderr)
        self.assertTrue((self.folder / "skin.toml").exists())


if __name__ == "__main__":
    unittest.main()
