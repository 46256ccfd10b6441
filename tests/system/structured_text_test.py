#!/usr/bin/env python3
"""The text of `tactilectl map --format st` uses only the subset of IEC 61131-3 that its own first comment lists."""
import pathlib
import re
import subprocess
import sys
import unittest

sys.path[:0] = [str(pathlib.Path(__file__).parent), str(pathlib.Path(__file__).resolve().parents[1])]
from daemon import BIN  # noqa: E402
from st.interpreter import Program  # noqa: E402
from st.lexer import tokens_of  # noqa: E402

PUNCTUATION = {"(", ")", "[", "]", ":", ";", ".", "..", ","}
# matiec (IEC 61131-3, second edition) accepts none of these as a name; STruC++ and CODESYS reserve further ones.
FUNCTIONS = set("ABS ADD AND CONCAT DELETE DIV EQ EXP FIND GE GT INSERT LE LEFT LEN LIMIT LN LOG LT MAX MID MIN MOD MOVE MUL MUX NE NOT "
                "OR REPLACE RIGHT ROL ROR SEL SHL SHR SIN SQRT SUB TRUNC XOR SR RS R_TRIG F_TRIG CTU CTD CTUD TP TON TOF RTC".split())


class Subset(unittest.TestCase):
    def setUp(self):
        self.text = subprocess.run([BIN / "tactilectl", "map", "--format", "st", "--sensors", "16"], capture_output=True, text=True, check=True).stdout
        listed = re.search(r"subset of IEC 61131-3:(.*?)\. \*\)", self.text, flags=re.S).group(1)
        self.listed = set(re.sub(r"initial values", "", listed).replace(",", " ").split())

    def test_every_keyword_operator_type_and_function_is_listed(self):
        self.assertGreater(len(self.listed), 30)
        declared = {name.upper() for name in Program(self.text).names()}
        used = set()
        for token in tokens_of(self.text):
            if token.kind == "keyword":
                used.add(token.text)
            elif token.kind == "symbol" and token.text not in PUNCTUATION:
                used.add(token.text)
            elif token.kind == "name" and token.text not in declared:
                used.add(token.text)
        ends = {word for word in used if word.startswith("END_")}
        self.assertEqual(sorted(used - ends - self.listed), [], "used and not listed")
        self.assertEqual(sorted(self.listed - used), [], "listed and not used")

    def test_no_name_is_a_function_or_function_block_of_the_standard(self):
        names = {name.upper() for name in Program(self.text).names()}
        self.assertEqual(names & FUNCTIONS, set())
        self.assertEqual([name for name in names if len(name) > 40], [])

    def test_a_type_and_a_variable_never_share_a_name(self):
        units = re.findall(r"^(?:TYPE|FUNCTION_BLOCK) (\w+)", self.text, flags=re.M)
        self.assertEqual(len(units), len(set(units)))
        fields = set(re.findall(r"^    (\w+) : ", self.text, flags=re.M))
        self.assertEqual(fields & set(units), set())


if __name__ == "__main__":
    unittest.main(verbosity=2)
