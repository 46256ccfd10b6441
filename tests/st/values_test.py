#!/usr/bin/env python3
"""Operators, conversions and standard functions give the value a controller gives, or stop."""
import pathlib
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from st.small_program import FIRST_LINE, StTest, nearest_single, result  # noqa: E402


class Operators(StTest):
    def test_precedence_is_that_of_the_standard(self):
        self.assertEqual(result("INT", "I + 3 * 4 MOD 5", "I := 1;"), 3)
        self.assertEqual(result("INT", "I - 3 - 4", "I := 1;"), -6)
        self.assertEqual(result("INT", "-I * 3 + 10", "I := 2;"), 4)
        self.assertIs(result("BOOL", "TRUE OR FALSE AND FALSE"), True)
        self.assertIs(result("BOOL", "TRUE OR TRUE XOR TRUE"), True)
        self.assertIs(result("BOOL", "TRUE XOR FALSE & FALSE"), True)
        self.assertIs(result("BOOL", "NOT B AND B"), False)
        self.assertIs(result("BOOL", "I < 1 = FALSE"), False)
        self.assertIs(result("BOOL", "I + 1 > 0 AND I = 0"), True)

    def test_comparison_binds_tighter_than_and(self):
        self.body_refused("B := W AND 16#8000 <> 0;", "do not mix|WORD")

    def test_two_signs_in_a_row_are_refused(self):
        for expression in ("- -I", "NOT NOT B", "+I"):
            with self.subTest(expression):
                self.body_refused(f"I := {expression};", "expected an operand")

    def test_integer_division_goes_towards_zero_and_mod_follows_the_dividend(self):
        for left, right, quotient, remainder in ((7, 2, 3, 1), (-7, 2, -3, -1), (7, -2, -3, 1), (-7, -2, 3, -1)):
            self.assertEqual(result("INT", f"I / ({right})", f"I := {left};"), quotient)
            self.assertEqual(result("INT", f"I MOD ({right})", f"I := {left};"), remainder)

    def test_division_by_zero_stops(self):
        for body in ("U := 1 / U;", "I := 1 MOD I;", "R := 1.0 / R;"):
            with self.subTest(body):
                self.stops(f"\n{body}", "division by zero", line=FIRST_LINE + 1)

    def test_overflow_stops(self):
        for body in ("I := 32767; I := I + 1;", "I := -32768; I := -I;", "I := -32768; I := I / (-1);",
                     "U := U - 1;", "U := 256; U := U * U;", "L := 2147483647; L := L + 1;", "M := M - 1;",
                     "M := 4294967295; M := M + 1;", "I := 300; L := I * I;", "I := -32768; I := ABS(I);"):
            with self.subTest(body):
                self.stops(f"\n\n{body}", "is outside", line=FIRST_LINE + 2)
        self.stops("R := 3.0E38; R := R * 10.0;", "not finite")

    def test_every_real_result_is_rounded_to_single(self):
        self.assertEqual(result("REAL", "R + 1.0", "R := 16777216.0;"), 16777216.0)
        self.assertEqual(result("REAL", "1.0 / R", "R := 3.0;"), nearest_single(1 / 3))
        self.assertEqual(result("REAL", "R * R", "R := 0.1;"), nearest_single(nearest_single(0.1) ** 2))

    def test_logic_works_on_bits(self):
        self.assertEqual(result("WORD", "(W AND 16#0FF0) OR 16#8000 XOR WORD#16#0010", "W := 16#1234;"), 0x8230)
        self.assertEqual(result("WORD", "NOT W", "W := 16#00FF;"), 0xFF00)
        self.assertEqual(result("BYTE", "NOT Y"), 0xFF)
        self.assertIs(result("BOOL", "NOT B"), True)
        self.assertIs(result("BOOL", "B <> TRUE"), True)

    def test_both_operands_of_and_run(self):
        self.stops("B := (I > 1) AND (A[I] > 0);", "index 0 is outside 1 .. 2",
                   variables="B : BOOL; I : INT; A : ARRAY[1..2] OF INT;")

    def test_comparisons_of_numbers(self):
        for expression, expected in (("I < 3", False), ("I <= 3", True), ("I > 3", False), ("I >= 3", True),
                                     ("I = 3", True), ("I <> 3", False), ("R < 0.5", True), ("L > I", False)):
            with self.subTest(expression):
                self.assertIs(result("BOOL", expression, "I := 3;"), expected)


class Conversions(StTest):
    def test_bits_and_integers_exchange_their_patterns(self):
        for expression, type_name, expected in (
                ("WORD_TO_INT(16#FFFF)", "INT", -1), ("WORD_TO_INT(16#7FFF)", "INT", 32767),
                ("WORD_TO_UINT(16#FFFF)", "UINT", 65535), ("WORD_TO_DINT(16#FFFF)", "DINT", 65535),
                ("DWORD_TO_DINT(16#8000_0000)", "DINT", -2147483648), ("DWORD_TO_INT(16#1FFFE)", "INT", -2),
                ("BYTE_TO_INT(16#FF)", "INT", 255), ("INT_TO_WORD(-2)", "WORD", 0xFFFE),
                ("DINT_TO_DWORD(-1)", "DWORD", 0xFFFFFFFF), ("UINT_TO_DWORD(65535)", "DWORD", 65535),
                ("DINT_TO_WORD(-1)", "WORD", 0xFFFF), ("DWORD_TO_WORD(16#12345678)", "WORD", 0x5678),
                ("WORD_TO_BYTE(16#1234)", "BYTE", 0x34), ("WORD_TO_DWORD(16#8000)", "DWORD", 0x8000)):
            with self.subTest(expression):
                self.assertEqual(result(type_name, expression), expected)

    def test_two_words_make_a_double_word(self):
        expression = "DWORD_TO_UDINT(SHL(WORD_TO_DWORD(W), 16) OR WORD_TO_DWORD(16#5678))"
        self.assertEqual(result("UDINT", expression, "W := 16#1234;"), 0x12345678)

    def test_a_narrow_argument_widens(self):
        self.assertEqual(result("REAL", "DINT_TO_REAL(I)", "I := -7;"), -7.0)
        self.body_refused("R := INT_TO_REAL(L);", "DINT where INT")

    def test_reals_round_to_the_nearest_even_integer(self):
        for value, expected in (("0.5", 0), ("1.5", 2), ("2.5", 2), ("-0.5", 0), ("-1.5", -2), ("2.6", 3),
                                ("-2.6", -3)):
            self.assertEqual(result("INT", f"REAL_TO_INT({value})"), expected, value)

    def test_integers_become_the_nearest_single(self):
        self.assertEqual(result("REAL", "DINT_TO_REAL(16777217)"), 16777216.0)
        self.assertEqual(result("REAL", "UINT_TO_REAL(65535)"), 65535.0)

    def test_integers_that_do_not_fit_stop(self):
        for body in ("L := 32768; I := DINT_TO_INT(L);", "U := 32768; I := UINT_TO_INT(U);",
                     "I := -1; U := INT_TO_UINT(I);", "R := 32767.5; I := REAL_TO_INT(R);",
                     "R := -1.0; M := REAL_TO_UDINT(R);"):
            with self.subTest(body):
                self.stops(f"\n{body}", "is outside", line=FIRST_LINE + 1)

    def test_bools_become_zero_and_one_and_come_from_them(self):
        self.assertEqual(result("WORD", "BOOL_TO_WORD(TRUE)"), 1)
        self.assertEqual(result("INT", "BOOL_TO_INT(FALSE)"), 0)
        self.assertIs(result("BOOL", "WORD_TO_BOOL(W AND 1)", "W := 3;"), True)
        self.stops("W := 2; B := WORD_TO_BOOL(W);", "WORD_TO_BOOL of 2: vendors disagree")

    def test_a_negative_integer_into_more_bits_stops(self):
        self.stops("I := -1; D := INT_TO_DWORD(I);", "vendors disagree on the upper bits")
        self.assertEqual(result("DWORD", "INT_TO_DWORD(I)", "I := 5;"), 5)

    def test_conversions_between_bits_and_real_are_refused(self):
        for expression in ("DWORD_TO_REAL(D)", "WORD_TO_REAL(W)", "BOOL_TO_REAL(B)"):
            with self.subTest(expression):
                self.body_refused(f"\nR := {expression};", "vendors disagree", line=FIRST_LINE + 1)
        self.body_refused("D := REAL_TO_DWORD(R);", "vendors disagree")

    def test_absent_conversions_are_refused(self):
        for expression in ("INT_TO_INT(I)", "INT_TO_LREAL(I)", "TO_REAL(I)", "TRUNC(R)", "UINT_TO_REAL(W)"):
            with self.subTest(expression):
                self.body_refused(f"R := {expression};", "there is no|no function|WORD where UINT")


class StandardFunctions(StTest):
    def test_shifts_fill_with_zero_and_rotations_turn(self):
        for expression, expected in (("SHL(W, 4)", 0x0010), ("SHR(W, 15)", 1), ("ROL(W, 1)", 3),
                                     ("ROR(W, 1)", 0xC000), ("SHL(W, 0)", 0x8001), ("ROR(W, 0)", 0x8001)):
            with self.subTest(expression):
                self.assertEqual(result("WORD", expression, "W := 16#8001;"), expected)

    def test_a_shift_by_the_width_or_below_zero_stops(self):
        for body in ("I := 16; W := SHL(W, I);", "I := -1; W := ROR(W, I);", "W := SHR(W, 16);"):
            with self.subTest(body):
                self.stops(body, "vendors disagree outside 0 .. 15")

    def test_a_shift_of_a_number_is_refused(self):
        self.body_refused("U := SHL(U, 1);", "SHL does not take UINT")
        self.body_refused("W := SHL(W, W);", "the count of SHL does not take WORD")

    def test_selections(self):
        for expression, expected in (("MAX(I, -7)", -5), ("MIN(I, -7)", -7), ("LIMIT(-3, I, 3)", -3),
                                     ("LIMIT(-9, I, 3)", -5), ("SEL(FALSE, I, 2)", -5), ("SEL(TRUE, I, 2)", 2),
                                     ("ABS(I)", 5)):
            with self.subTest(expression):
                self.assertEqual(result("INT", expression, "I := -5;"), expected)
        self.stops("I := LIMIT(3, I, -3);", "empty range")

    def test_roots_and_powers(self):
        self.assertEqual(result("REAL", "SQRT(2.0)"), nearest_single(2 ** 0.5))
        self.assertEqual(result("REAL", "EXPT(10.0, I)", "I := -3;"), nearest_single(1e-3))
        self.stops("R := SQRT(R - 1.0);", "SQRT of a negative")
        self.stops("R := EXPT(R, -1);", "not finite")

    def test_arguments_of_a_wrong_kind_are_refused(self):
        for expression, reason in (("MAX(I, R)", "do not mix"), ("MAX(1, 2, 3)", "takes 2 arguments"),
                                   ("MAX(W, W)", "MAX does not take WORD"), ("SEL(1, I, I)", "BOOL is wanted"),
                                   ("SQRT(I)", "REAL is wanted"), ("SQRT(4)", "REAL is wanted"),
                                   ("EXPT(I, 2)", "REAL is wanted"), ("EXPT(R, W)", "does not take WORD"),
                                   ("SHL(IN := W, N := 1)", "without names"), ("SIN(R)", "no function")):
            with self.subTest(expression):
                self.body_refused(f"\nI := {expression};", reason, line=FIRST_LINE + 1)


if __name__ == "__main__":
    unittest.main()
