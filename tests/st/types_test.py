#!/usr/bin/env python3
"""Types and declarations: what may stand where, what begins with which value, and what a compiler refuses."""
import pathlib
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from st.interpreter import Program  # noqa: E402
from st.small_program import FIRST_LINE, StTest, after, block, result  # noqa: E402


class Types(StTest):
    def test_only_the_three_widenings_need_no_conversion(self):
        self.assertEqual(result("DINT", "L + I + U", "L := 100000; I := -1; U := 1;"), 100000)
        self.assertEqual(result("UDINT", "M + U", "M := 100000; U := 1;"), 100001)
        names = {"B": "BOOL", "Y": "BYTE", "W": "WORD", "D": "DWORD", "I": "INT", "U": "UINT", "L": "DINT",
                 "M": "UDINT", "R": "REAL"}
        allowed = {("L", "I"), ("L", "U"), ("M", "U")}
        for target in names:
            for source in names:
                if source == target or (target, source) in allowed:
                    Program(block(f"{target} := {source};"))
                else:
                    self.body_refused(f"\n{target} := {source};", f"{names[source]} where {names[target]} is wanted",
                                      line=FIRST_LINE + 1)

    def test_operands_that_do_not_mix_are_refused(self):
        for expression in ("I + U", "I + R", "L + M", "W + I", "W = I", "W AND Y", "B AND W", "R * L", "R > I"):
            with self.subTest(expression):
                self.body_refused(f"B := {expression};", "do not mix")

    def test_arithmetic_on_bits_and_logic_on_numbers_are_refused(self):
        for expression in ("W + 1", "W * W", "Y - Y", "-W", "-U", "B + B", "I AND 1", "NOT I", "NOT R", "R MOD R",
                           "R AND R", "1 AND 2"):
            with self.subTest(expression):
                self.body_refused(f"B := {expression};", "does not take")

    def test_an_order_of_bits_is_refused(self):
        self.body_refused("B := W > 5;", "> does not take WORD")
        self.body_refused("B := B < TRUE;", "< does not take BOOL")

    def test_integer_literals_are_no_reals_and_no_bools(self):
        self.body_refused("R := 1;", "untyped integer where REAL")
        self.body_refused("R := R * 2;", "untyped integer where REAL")
        self.body_refused("B := 1;", "untyped integer where BOOL")
        self.body_refused("I := 1.0;", "REAL where INT")

    def test_a_condition_is_a_bool(self):
        self.body_refused("IF B THEN ;\nELSIF I THEN ; END_IF;", "INT where BOOL", line=FIRST_LINE + 1)
        self.body_refused("WHILE W DO ; END_WHILE;", "WORD where BOOL")

    def test_structures_are_assigned_by_value_and_only_to_their_own_type(self):
        types = "TYPE ST_A : STRUCT X : INT; END_STRUCT; ST_B : STRUCT X : INT; END_STRUCT; END_TYPE "
        variables = "P : ST_A; Q : ST_A; O : ST_B;"
        self.assertEqual(after("P.X := 1; Q := P; P.X := 2;", "Q.X", variables, types), 1)
        self.body_refused("O := P;", "ST_A where ST_B", variables=variables, before=types)
        self.body_refused("P.Y := 1;", "ST_A has no field Y", variables=variables, before=types)
        self.body_refused("IF P = Q THEN ; END_IF;", "does not take ST_A", variables=variables, before=types)

    def test_bit_access_is_refused(self):
        self.body_refused("\nB := W.3;", "bit access .3", line=FIRST_LINE + 1)
        self.body_refused("B := W.%X3;", "unexpected '%'")

    def test_inputs_and_constants_cannot_be_assigned(self):
        head = "FUNCTION_BLOCK FB_T VAR_INPUT A : ARRAY[0..1] OF INT; END_VAR\nVAR CONSTANT C : INT := 1; END_VAR\n"
        self.refused(3, head + "A[0] := 1; END_FUNCTION_BLOCK", "A is VAR_INPUT")
        self.refused(4, head + "\nC := 2; END_FUNCTION_BLOCK", "C is CONSTANT")

    def test_an_assignment_without_a_colon_is_refused(self):
        self.body_refused("I = 1;", "expected := before =")


class Declarations(StTest):
    def test_initial_values(self):
        variables = "I : INT := -3; R : REAL := 0.5; A : ARRAY[0..2] OF UINT := [1, 2, 3]; P, Q : WORD := 16#FF;"
        for path, value in (("I", -3), ("R", 0.5), ("A[2]", 3), ("P", 255), ("Q", 255)):
            self.assertEqual(after("", path, variables), value)

    def test_everything_else_begins_with_zero(self):
        for path, value in (("B", False), ("W", 0), ("R", 0.0)):
            self.assertEqual(after("", path), value)

    def test_a_constant_initialises_a_variable(self):
        text = "FUNCTION_BLOCK FB_T VAR CONSTANT N : INT := 4; END_VAR VAR I : INT := N; END_VAR END_FUNCTION_BLOCK"
        self.assertEqual(Program(text).instance("FB_T").value("I"), 4)

    def test_initial_values_that_do_not_fit_are_refused(self):
        for variable, reason in (("I : INT := 40000", "outside INT"), ("R : REAL := 1", "REAL is wanted"),
                                 ("A : ARRAY[0..2] OF INT := [1, 2]", "2 initial values"),
                                 ("A : ARRAY[0..1] OF INT := 1", "is wanted"), ("I : INT := J", "constant declared"),
                                 ("J : INT := 1; I : INT := J", "constant declared"),
                                 ("I : INT := 1 + 1", "literal or a constant")):
            with self.subTest(variable):
                self.refused(2, f"FUNCTION_BLOCK FB_T VAR\n{variable}; END_VAR END_FUNCTION_BLOCK", reason)

    def test_a_constant_without_a_value_is_refused(self):
        self.refused(2, "FUNCTION_BLOCK FB_T\nVAR CONSTANT N : INT; END_VAR END_FUNCTION_BLOCK", "has no value")

    def test_what_the_subset_leaves_out_is_refused(self):
        for text, reason in (("VAR_GLOBAL", "expected TYPE"), ("PROGRAM P", "expected TYPE"),
                             ("FUNCTION_BLOCK FB_T VAR_IN_OUT", "not in this subset"),
                             ("FUNCTION_BLOCK FB_T VAR RETAIN", "reserved word"),
                             ("FUNCTION_BLOCK FB_T REPEAT", "not in this subset"),
                             ("FUNCTION_BLOCK FB_T VAR S : STRING; END_VAR END_FUNCTION_BLOCK", "no type"),
                             ("FUNCTION_BLOCK FB_T VAR_INPUT CONSTANT", "cannot be CONSTANT"),
                             ("FUNCTION F : INT VAR_OUTPUT A : INT; END_VAR END_FUNCTION", "VAR_OUTPUT of a FUNCTION"),
                             ("FUNCTION F : INT VAR_INPUT A : INT := 1; END_VAR END_FUNCTION", "no initial value"),
                             ("TYPE A : INT; END_TYPE", "neither"), ("TYPE END_TYPE", "declares nothing"),
                             ("TYPE A : STRUCT END_STRUCT; END_TYPE", "has no field"),
                             ("TYPE A : ARRAY[3..2] OF INT; END_TYPE", "is empty"),
                             ("TYPE A : ARRAY[0..1, 0..1] OF INT; END_TYPE", "expected ]"),
                             ("TYPE A : ARRAY[0..1] OF INT; B : ARRAY[0..1] OF A; END_TYPE", "array of arrays"),
                             ("TYPE A : STRUCT X : A; END_STRUCT; END_TYPE", "no type of this subset"),
                             ("TYPE A : STRUCT X : INT := 1; END_STRUCT; END_TYPE", "expected ;"),
                             ("FUNCTION F : T END_FUNCTION", "does not return")):
            with self.subTest(text):
                self.refused(2, "\n" + text, reason)

    def test_a_missing_semicolon_is_refused_at_the_line_that_lacks_it(self):
        self.body_refused("I := 1\nI := 2;", "expected ; before I", line=FIRST_LINE)
        self.body_refused("IF B THEN I := 1;\nEND_IF\nI := 2;", "expected ; before I", line=FIRST_LINE + 1)
        self.refused(2, "TYPE ST_A : STRUCT A : INT;\nEND_STRUCT\nEND_TYPE", "expected ; before END_TYPE")

    def test_a_missing_end_is_refused(self):
        self.body_refused("IF B THEN\nI := 1;", "before END_FUNCTION_BLOCK", line=FIRST_LINE + 2)
        self.refused(2, "FUNCTION_BLOCK FB_T\n", "the end of the text")


class Arrays(StTest):
    VARIABLES = "I : INT; W : WORD; A : ARRAY[-1..1] OF INT;"

    def test_bounds_need_not_begin_at_zero(self):
        self.assertEqual(after("A[-1] := 5; A[I] := 6;", "A", self.VARIABLES), [5, 6, 0])

    def test_a_constant_index_out_of_bounds_is_refused(self):
        self.body_refused("\nA[2] := 1;", "index 2 is outside -1 .. 1", line=FIRST_LINE + 1, variables=self.VARIABLES)

    def test_a_computed_index_out_of_bounds_stops(self):
        self.stops("I := -2;\nA[I] := 1;", "index -2 is outside", line=FIRST_LINE + 1, variables=self.VARIABLES)
        self.stops("I := 2;\n\nI := A[I];", "index 2 is outside", line=FIRST_LINE + 2, variables=self.VARIABLES)

    def test_an_index_is_an_integer(self):
        self.body_refused("A[W] := 1;", "an index does not take WORD", variables=self.VARIABLES)
        self.body_refused("I[0] := 1;", "INT is no array", variables=self.VARIABLES)


if __name__ == "__main__":
    unittest.main()
