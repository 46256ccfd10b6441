"""The list of failed tests: CTest's results become lines, and a test that fails twice unchanged is an error."""
import contextlib
import io
import pathlib
import tempfile
import unittest

import ledger

OUTPUT = """<testsuite><testcase name="drivers.1of4" status="fail"><failure message=""/><system-out>
[==========] 120 tests from 31 test suites ran. (20 ms total)
[  FAILED  ] Uart.ReadsALine (3 ms)
[  FAILED  ] Uart.ReadsALine
</system-out></testcase><testcase name="system.web_test" status="fail"><failure message=""/><system-out>
Ran 21 tests in 3.2s
FAIL: test_a_page (__main__.Values.test_a_page)
</system-out></testcase><testcase name="system.kill" status="fail"><failure message="timeout"/></testcase>
<testcase name="format" status="run"/></testsuite>"""


class Ledger(unittest.TestCase):
    def said_of(self, action, *words):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "log"
            path.write_text(OUTPUT)
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                action(path, *words)
            return said.getvalue()

    def test_each_failed_case_is_a_line(self):
        lines = self.said_of(ledger.failed, "abc", "9 8 7", "drivers: ctest ended with 8").splitlines()
        self.assertEqual([line.split("\t")[1:] for line in lines],
                         [["abc", "drivers.1of4:Uart.ReadsALine", "9 8 7"], ["abc", "system.web_test:test_a_page", "9 8 7"], ["abc", "system.kill:timeout", "9 8 7"]])

    def test_a_run_without_tests_is_a_line(self):
        line = self.said_of(lambda path: path.write_text("<testsuite/>") and ledger.failed(path, "abc", "1", "drivers: ctest ended with 8"))
        self.assertEqual(line.split("\t")[1:3], ["abc", "drivers: ctest ended with 8"])

    def test_programs_and_cases_are_counted(self):
        self.assertEqual(self.said_of(lambda path: ledger.count([path])), "1 passed, 3 failed, 0 skipped; 141 cases of GoogleTest and unittest\n")

    def test_the_lines_before_a_failure_say_why(self):
        said = self.said_of(lambda path: ledger.why([path]))
        self.assertIn("[  FAILED  ] Uart.ReadsALine (3 ms)\n--- system.web_test\n", said)
        self.assertTrue(said.endswith("FAIL: test_a_page (__main__.Values.test_a_page)\n--- system.kill\n"), said)

    def test_a_second_failure_needs_a_change_between(self):
        twice = ["d\tA\tsystem.web_test:test_a_page\t1", "d\tB\tsystem.web_test:test_a_page\t1"]
        self.assertEqual(len(ledger.check(twice, lambda *_: False)), 1)
        self.assertEqual(ledger.check(twice, lambda *_: True), [])
        self.assertEqual(ledger.check(twice[:1] + ["d\tB\tsystem.web_test:test_another\t1"], lambda *_: False), [])

    def test_the_code_of_a_test_is_its_file(self):
        self.assertEqual(ledger.code_of("system.web_test:x"), ["tests/system/web_test.py"])
        self.assertIn("tests/unit/drivers/uart_test.cpp", ledger.code_of("drivers.1of1:UartTest.X"))


if __name__ == "__main__":
    unittest.main()
