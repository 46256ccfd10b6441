"""Checks that the shipped programs have the compiler's and the linker's protection against attacks, in the files
themselves."""
import subprocess
import unittest

from daemon import BIN


def readelf(words, program):
    return subprocess.run(["readelf", words, BIN / program], capture_output=True, text=True, check=True).stdout


class Hardening(unittest.TestCase):
    def each(self):
        for program in ("tactiled", "tactilectl", "tactilectl-lab", *(["tactiled-web"] if (BIN / "tactiled-web").exists() else [])):
            with self.subTest(program=program):
                yield program

    def test_they_load_anywhere(self):
        for program in self.each():
            self.assertIn("Position-Independent Executable", readelf("-hW", program))

    def test_their_linkage_is_read_only_from_the_start(self):
        for program in self.each():
            self.assertIn("GNU_RELRO", readelf("-lW", program))
            self.assertIn("BIND_NOW", readelf("-dW", program))

    def test_no_part_of_them_is_both_written_and_run(self):
        for program in self.each():
            parts = [line.split() for line in readelf("-lW", program).splitlines() if line.split()[:1] in (["LOAD"], ["GNU_STACK"])]
            flags = ["".join(words[6:-1]) for words in parts]
            self.assertGreaterEqual(len(flags), 5)
            self.assertEqual([f for f in flags if "W" in f and "E" in f], [])

    def test_a_smashed_stack_and_an_overrun_buffer_end_them(self):
        for program in self.each():
            symbols = readelf("-sW", program)
            self.assertIn("__stack_chk_fail", symbols)
            self.assertIn("_chk@GLIBC", symbols.replace("__stack_chk_fail", ""))

    def test_asserts_are_on(self):
        for program in self.each():
            symbols = readelf("-sW", program)
            self.assertIn("__glibcxx_assert_fail", symbols)
            self.assertIn("__assert_fail", symbols)


if __name__ == "__main__":
    unittest.main(verbosity=2)
