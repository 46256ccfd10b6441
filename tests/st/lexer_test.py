#!/usr/bin/env python3
"""Literals, names and comments: what a controller reads in them, and what a compiler refuses."""
import pathlib
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from st.small_program import FIRST_LINE, StTest, after, nearest_single, result  # noqa: E402


class Literals(StTest):
    def test_based_and_underscored_integers(self):
        self.assertEqual(result("DWORD", "16#FF_ff"), 0xFFFF)
        self.assertEqual(result("BYTE", "2#1010_0000"), 160)
        self.assertEqual(result("UDINT", "4_000_000_000"), 4_000_000_000)

    def test_typed_literals(self):
        self.assertEqual(result("WORD", "WORD#16#8000"), 0x8000)
        self.assertEqual(result("INT", "INT#-5"), -5)
        self.assertEqual(result("REAL", "REAL#-1.5E+2"), -150.0)
        self.assertIs(result("BOOL", "BOOL#TRUE"), True)

    def test_a_real_literal_is_the_nearest_single(self):
        self.assertEqual(result("REAL", "1.0E-3"), nearest_single(1e-3))

    def test_malformed_literals_are_refused(self):
        for literal in ("1__0", "1_", "16#", "16#FG", "2#12", "8#7", "3N", "1.0E", "1e3", "0x10", "INT#-16#5"):
            with self.subTest(literal):
                self.body_refused(f"\nI := {literal};", "malformed literal", line=FIRST_LINE + 1)
        for literal in ("1.", ".5"):
            with self.subTest(literal):
                self.body_refused(f"\nR := {literal};", "expected", line=FIRST_LINE + 1)

    def test_literals_outside_their_type_are_refused(self):
        for assignment in ("I := 32768", "I := -32769", "I := 16#FFFF", "I := INT#16#FFFF", "U := -1", "U := 65536",
                           "W := 16#10000", "Y := 256", "W := WORD#-1", "M := UDINT#4_294_967_296"):
            with self.subTest(assignment):
                self.body_refused(f"{assignment};", "is outside")
        self.body_refused("R := 1.0E39;", "not finite")

    def test_literals_of_absent_types_are_refused(self):
        for literal in ("T#5", "REAL#1", "INT#1.0", "LREAL#1.0", "BOOL#1"):
            with self.subTest(literal):
                self.body_refused(f"I := {literal};", "no literal of this subset")

    def test_the_most_negative_integers_are_written_with_a_sign(self):
        self.assertEqual(result("INT", "-32768"), -32768)
        self.assertEqual(result("DINT", "-2147483648"), -2147483648)

    def test_words_that_begin_with_true_are_names(self):
        self.assertIs(after("TRUEST := TRUE;", "TRUEST", "TRUEST : BOOL;"), True)


class Names(StTest):
    def test_case_does_not_matter(self):
        self.assertEqual(after("if not b then Count := COUNT + 2; end_if;", "coUNT", "B : BOOL; count : int;"), 2)

    def test_a_name_of_40_characters_is_accepted_and_one_of_41_refused(self):
        self.assertEqual(after("", "A" * 40, "A" * 40 + " : INT;"), 0)
        self.refused(3, f"FUNCTION_BLOCK FB_T\nVAR\n{'A' * 41} : INT;\nEND_VAR\nEND_FUNCTION_BLOCK", "41 characters")

    def test_doubled_and_trailing_underscores_are_refused(self):
        for name in ("A__B", "AB_", "_"):
            with self.subTest(name):
                self.refused(2, f"TYPE\n{name} : ARRAY[0..1] OF INT;\nEND_TYPE", "underscore")

    def test_reserved_words_are_refused_for_variables_fields_types_and_units(self):
        for word in ("TO", "ton", "Time", "MAX", "INT_TO_REAL", "TO_DINT", "AT", "LREAL", "ANY_NUM", "END_PROGRAM"):
            with self.subTest(word):
                self.refused(2, f"FUNCTION_BLOCK FB_T VAR\n{word} : INT; END_VAR END_FUNCTION_BLOCK", "reserved")
                self.refused(3, f"TYPE ST_A : STRUCT\nA : INT;\n{word} : INT; END_STRUCT; END_TYPE", "reserved")
                self.refused(1, f"TYPE {word} : ARRAY[0..1] OF INT; END_TYPE", "reserved")
                self.refused(1, f"FUNCTION_BLOCK {word} END_FUNCTION_BLOCK", "reserved")

    def test_a_name_that_only_looks_like_a_conversion_is_accepted(self):
        self.assertEqual(after("", "REGS_TO_REAL", "REGS_TO_REAL : INT;"), 0)

    def test_a_second_declaration_of_a_name_is_refused_whatever_its_case(self):
        self.refused(3, "FUNCTION_BLOCK FB_T VAR\nA : INT;\na : INT; END_VAR END_FUNCTION_BLOCK", "twice")
        self.refused(3, "TYPE ST_A : STRUCT\nX : INT;\nx : INT; END_STRUCT; END_TYPE", "twice")
        array = "T_A : ARRAY[0..1] OF INT;\n"
        self.refused(2, f"TYPE {array} {array} END_TYPE", "twice")
        unit = "FUNCTION_BLOCK FB_T VAR T_A : INT; END_VAR END_FUNCTION_BLOCK"
        self.refused(2, f"TYPE {array} END_TYPE {unit}", "twice")
        self.refused(2, f"{unit}\nTYPE {array} END_TYPE", "twice")

    def test_undeclared_names_are_refused(self):
        self.body_refused("\n\nI := J;", "J is not declared", line=FIRST_LINE + 2)
        self.body_refused("J := 1;", "J is not declared")
        self.body_refused("I := F(1);", "F is no function")
        self.refused(2, "FUNCTION_BLOCK FB_T VAR\nA : ST_A; END_VAR END_FUNCTION_BLOCK", "ST_A is no type")

    def test_letters_outside_ascii_are_refused_but_not_in_comments(self):
        self.assertEqual(after("I := 1; // Größe\n(* Kraft über Ω *)", "I"), 1)
        self.body_refused("\nÜ := 1;", "unexpected 'Ü'", line=FIRST_LINE + 1)


class Comments(StTest):
    def test_comments_and_pragmas_are_skipped_and_their_lines_counted(self):
        self.body_refused("(* one\ntwo *) // three (*\n{four\nfive}\nI := TRUE;", "BOOL where INT", line=FIRST_LINE + 4)

    def test_a_nested_comment_is_refused_at_its_line(self):
        self.body_refused("(* a\n (* b *) *)", "comment inside", line=FIRST_LINE + 1)

    def test_an_open_comment_or_pragma_is_refused_where_it_begins(self):
        self.body_refused("I := 1;\n(*) I := 2;", "never closed", line=FIRST_LINE + 1)
        self.body_refused("I := 1;\n{ I := 2;", "unexpected '{'", line=FIRST_LINE + 1)


if __name__ == "__main__":
    unittest.main()
