#!/usr/bin/env python3
"""What the structured text interpreter runs gives the value a controller gives; what a compiler refuses, it refuses."""
import pathlib
import struct
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from st.interpreter import Program, StError  # noqa: E402

FIRST_LINE = 3  # of the body in block(), where `variables` is one line
EVERY_TYPE = "B : BOOL; Y : BYTE; W : WORD; D : DWORD; I : INT; U : UINT; L : DINT; M : UDINT; R : REAL;"


def block(body, variables=EVERY_TYPE, before=""):
    return f"{before}FUNCTION_BLOCK FB_T\nVAR {variables} END_VAR\n{body}\nEND_FUNCTION_BLOCK\n"


def after(body, path, variables=EVERY_TYPE, before="", calls=1):
    fb = Program(block(body, variables, before)).instance("FB_T")
    for _ in range(calls):
        fb.call()
    return fb.value(path)


def result(type_name, expression, assignments="", before=""):
    """The value of an expression whose operands are the variables of EVERY_TYPE, set by `assignments`."""
    return after(f"{assignments} RESULT := {expression};", "RESULT", f"{EVERY_TYPE} RESULT : {type_name};", before)


def nearest_single(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


class StTest(unittest.TestCase):
    def refused(self, line, text, reason):
        with self.assertRaises(StError) as caught:
            Program(text)
        self.assertRegex(str(caught.exception), reason)
        self.assertEqual(caught.exception.line, line, caught.exception)

    def body_refused(self, body, reason, line=FIRST_LINE, **more):
        self.refused(line, block(body, **more), reason)

    def stops(self, body, reason, line=FIRST_LINE, **more):
        fb = Program(block(body, **more)).instance("FB_T")
        with self.assertRaises(StError) as caught:
            fb.call()
        self.assertRegex(str(caught.exception), reason)
        self.assertEqual(caught.exception.line, line, caught.exception)


class Registers(unittest.TestCase):
    TEXT = """
{attribute 'qualified_only'}
TYPE
  T_REGS : ARRAY[0..3] OF WORD; (* two sensors,
                                   two words each *)
  ST_S : STRUCT
    FX_N : REAL; // newton
    VALID : BOOL;
  END_STRUCT;
END_TYPE

FUNCTION FORCE_N : REAL
VAR_INPUT W : WORD; SCALE_N : REAL; END_VAR
FORCE_N := INT_TO_REAL(WORD_TO_INT(W)) * SCALE_N;
END_FUNCTION

FUNCTION_BLOCK FB_T
VAR_INPUT REGS : T_REGS; ENABLE : BOOL := TRUE; END_VAR
VAR_OUTPUT S : ARRAY[1..2] OF ST_S; SEQ : UINT; END_VAR
VAR CONSTANT COUNT : INT := 2; END_VAR
VAR I : INT; END_VAR
IF NOT ENABLE THEN RETURN; END_IF;
FOR I := 1 TO COUNT DO
  S[I].FX_N := FORCE_N(REGS[2 * I - 2], 0.5);
  S[I].VALID := (REGS[2 * I - 1] AND 16#8000) <> 0;
END_FOR;
SEQ := SEQ + 1;
END_FUNCTION_BLOCK
"""

    def setUp(self):
        self.program = Program(self.TEXT)
        self.fb = self.program.instance("FB_T")

    def test_a_block_turns_registers_into_structures(self):
        self.fb.call(REGS=[0xFFFD, 0x8000, 7, 0x7FFF])
        self.assertEqual(self.fb.value("S"), [{"FX_N": -1.5, "VALID": True}, {"FX_N": 3.5, "VALID": False}])
        self.assertEqual(self.fb.value("s[2].fx_n"), 3.5)

    def test_state_and_inputs_persist_between_calls(self):
        self.fb.call(REGS=[2, 0, 0, 0])
        self.fb.call()
        self.assertEqual((self.fb.value("SEQ"), self.fb.value("S[1].FX_N")), (2, 1.0))

    def test_instances_share_no_state(self):
        self.fb.call(REGS=[2, 0, 0, 0])
        self.assertEqual(self.program.instance("fb_t").value("SEQ"), 0)
        self.assertEqual(self.program.instance("fb_t").value("S[1].FX_N"), 0.0)

    def test_return_leaves_the_rest_of_the_block_undone(self):
        self.fb.call(ENABLE=False)
        self.assertEqual(self.fb.value("SEQ"), 0)

    def test_inputs_that_no_register_holds_are_refused(self):
        for wrong in ([0] * 3, [0] * 5, [0, 0, 0, 65536], [0, 0, 0, -1], [0, 0, 0, 1.0], [0, 0, 0, True]):
            with self.assertRaises(ValueError, msg=wrong):
                self.fb.call(REGS=wrong)
        with self.assertRaises(ValueError):
            self.fb.call(ENABLE=1)
        with self.assertRaises(KeyError):
            self.fb.call(SEQ=1)

    def test_the_value_of_a_path_outside_the_block_is_refused(self):
        for path in ("S[3].FX_N", "S[0]", "S[1].FY_N", "NOTHING", "S[1] FX_N"):
            with self.assertRaises(StError, msg=path):
                self.fb.value(path)

    def test_a_value_read_is_a_copy(self):
        self.fb.value("S")[0]["FX_N"] = 9.0
        self.assertEqual(self.fb.value("S[1].FX_N"), 0.0)

    def test_names_lists_every_identifier_as_spelled(self):
        self.assertEqual(self.program.names(), "T_REGS ST_S FX_N VALID FORCE_N W SCALE_N FB_T REGS ENABLE S SEQ "
                                               "COUNT I".split())


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


class Statements(StTest):
    def test_if_takes_the_first_branch_that_holds(self):
        body = "IF I < 0 THEN L := 1; ELSIF I < 5 THEN L := 2; ELSIF I < 9 THEN L := 3; ELSE L := 4; END_IF;"
        for value, branch in ((-1, 1), (4, 2), (5, 3), (9, 4)):
            self.assertEqual(after(f"I := {value}; {body}", "L"), branch)

    def test_case_takes_values_ranges_and_else(self):
        body = "CASE I OF -3..-1: L := 1; 0, 2: L := 2; L := L + 10; 5..7, 9: L := 3; ELSE L := 4; END_CASE;"
        for value, branch in ((-3, 1), (-1, 1), (0, 12), (2, 12), (1, 4), (7, 3), (8, 4), (9, 3)):
            self.assertEqual(after(f"I := {value}; {body}", "L"), branch, value)

    def test_case_without_a_fitting_branch_does_nothing(self):
        self.assertEqual(after("L := 7; CASE I OF 1: L := 1; END_CASE;", "L"), 7)

    def test_case_labels_that_overlap_or_do_not_fit_are_refused(self):
        self.body_refused("CASE I OF 1..3: ;\n2: ; END_CASE;", "taken by a branch before", line=FIRST_LINE + 1)
        self.body_refused("CASE I OF\n3..1: ; END_CASE;", "is empty", line=FIRST_LINE + 1)
        self.body_refused("CASE U OF\n1: ;\n-1: ; END_CASE;", "outside UINT", line=FIRST_LINE + 2)
        self.body_refused("CASE U OF\n-1..3: ; END_CASE;", "outside UINT", line=FIRST_LINE + 1)
        self.body_refused("CASE I OF INT#1: ; END_CASE;", "expected an integer literal")
        self.body_refused("CASE I OF N: ; END_CASE;", "expected an integer literal")
        self.body_refused("CASE W OF 1: ; END_CASE;", "CASE does not take WORD")

    def test_for_counts_up_down_and_not_at_all(self):
        for header, rounds in (("I := 1 TO 3", [1, 2, 3]), ("I := 3 TO 1 BY -1", [3, 2, 1]),
                               ("I := 1 TO 6 BY 2", [1, 3, 5]), ("I := 3 TO 1", [])):
            body = f"L := 0; FOR {header} DO L := L * 10 + I; END_FOR;"
            self.assertEqual(after(body, "L"), int("".join(map(str, rounds)) or 0), header)

    def test_for_evaluates_its_limit_once(self):
        self.assertEqual(after("L := 3; FOR I := 1 TO 3 DO L := L + 1; END_FOR;", "L"), 6)
        self.assertEqual(after("U := 3; M := 0; FOR I := 0 TO 2 DO U := U - 1; M := M + 1; END_FOR;", "M"), 3)
        self.assertEqual(after("L := 3; FOR J := 1 TO L DO L := L + 1; END_FOR;", "L", "L : DINT; J : DINT;"), 6)

    def test_for_up_to_the_last_value_of_its_type_stops(self):
        self.stops("\nFOR I := 32766 TO 32767 DO ; END_FOR;", "32768 is outside INT", line=FIRST_LINE + 1)
        self.stops("FOR U := 3 TO U - 1 DO ; END_FOR;", "-1 is outside UINT")

    def test_for_with_a_step_of_zero_stops(self):
        self.stops("FOR I := 0 TO 1 BY L DO ; END_FOR;", "never ends", variables="I : DINT; L : DINT;")

    def test_a_control_variable_cannot_be_assigned_in_its_loop(self):
        self.body_refused("FOR I := 0 TO 1 DO\nI := 2; END_FOR;", "controls the FOR loop", line=FIRST_LINE + 1)
        self.body_refused("FOR I := 0 TO 1 DO\nFOR I := 0 TO 1 DO ; END_FOR; END_FOR;", "controls", line=FIRST_LINE + 1)
        self.body_refused("FOR R := 0.0 TO 1.0 DO ; END_FOR;", "control variable of FOR does not take REAL")

    def test_a_control_variable_has_no_value_after_its_loop_but_has_one_after_exit(self):
        self.stops("FOR I := 0 TO 1 DO ; END_FOR;\nL := I;", "names no value", line=FIRST_LINE + 1)
        self.assertEqual(after("FOR I := 0 TO 9 DO IF I = 4 THEN EXIT; END_IF; END_FOR; L := I;", "L"), 4)
        self.assertEqual(after("FOR I := 0 TO 1 DO ; END_FOR; I := 7;", "I", calls=2), 7)

    def test_exit_leaves_the_inner_loop_only(self):
        body = "FOR I := 1 TO 3 DO U := 0; WHILE TRUE DO U := U + 1; IF U = 2 THEN EXIT; END_IF; END_WHILE; " \
               "L := L + 1; END_FOR;"
        self.assertEqual(after(body, "L"), 3)
        self.body_refused("\nEXIT;", "EXIT outside a loop", line=FIRST_LINE + 1)
        self.body_refused("WHILE B DO EXIT; END_WHILE;\nEXIT;", "EXIT outside a loop", line=FIRST_LINE + 1)

    def test_while_runs_while_its_condition_holds(self):
        self.assertEqual(after("WHILE I < 5 DO I := I + 1; END_WHILE;", "I"), 5)

    def test_a_loop_without_end_stops(self):
        self.stops("\nWHILE TRUE DO END_WHILE;", "more than 1000000 steps", line=FIRST_LINE + 1)


class Functions(StTest):
    DIFFERENCE = "FUNCTION DIFF : DINT VAR_INPUT A : DINT; B : DINT; END_VAR VAR CALLS : DINT; END_VAR " \
                 "CALLS := CALLS + 1; DIFF := A - B; IF CALLS > 1 THEN DIFF := 99; END_IF; END_FUNCTION "

    def test_arguments_go_by_position_or_by_name(self):
        self.assertEqual(result("DINT", "DIFF(5, 3)", before=self.DIFFERENCE), 2)
        self.assertEqual(result("DINT", "DIFF(B := 5, A := 3)", before=self.DIFFERENCE), -2)

    def test_a_function_forgets_between_calls(self):
        self.assertEqual(result("DINT", "DIFF(5, 3) + DIFF(1, I)", before=self.DIFFERENCE), 3)
        before = "FUNCTION F : INT VAR A : ARRAY[0..1] OF INT; END_VAR A[0] := A[0] + 1; F := A[0]; END_FUNCTION "
        self.assertEqual(result("INT", "F() + F()", before=before), 2)

    def test_return_ends_a_function_with_the_result_so_far(self):
        before = "FUNCTION F : INT F := 1; RETURN; F := 2; END_FUNCTION "
        self.assertEqual(result("INT", "F()", before=before), 1)

    def test_arguments_that_do_not_match_are_refused(self):
        for call in ("DIFF(1)", "DIFF(1, 2, 3)", "DIFF(A := 1)", "DIFF(A := 1, 2)", "DIFF(A := 1, A := 2)",
                     "DIFF(A := 1, C := 2)"):
            with self.subTest(call):
                self.body_refused(f"\nL := {call};", "takes A, B, each once", FIRST_LINE + 1, before=self.DIFFERENCE)
        self.body_refused("L := DIFF(R, 1);", "REAL where DINT", before=self.DIFFERENCE)

    def test_a_function_sees_no_variable_of_its_caller_and_cannot_assign_its_inputs(self):
        self.refused(2, "FUNCTION F : INT\nF := OUTER; END_FUNCTION", "OUTER is not declared")
        self.refused(2, "FUNCTION F : INT VAR_INPUT A : INT; END_VAR\nA := 1; END_FUNCTION", "A is VAR_INPUT")

    def test_an_array_argument_is_a_copy_of_the_named_type(self):
        before = "TYPE T_A : ARRAY[0..1] OF WORD; END_TYPE FUNCTION F : WORD VAR_INPUT A : T_A; END_VAR " \
                 "F := A[1]; END_FUNCTION "
        self.assertEqual(after("A[1] := 7; W := F(A);", "W", "A : T_A; W : WORD;", before), 7)
        self.body_refused("W := F(A);", "where T_A is wanted", variables="A : ARRAY[0..1] OF WORD; W : WORD;",
                          before=before)

    def test_recursion_is_refused(self):
        self.refused(2, "FUNCTION F : INT\nF := F(); END_FUNCTION", "calls itself")
        self.refused(1, "FUNCTION F : INT F := G(); END_FUNCTION\nFUNCTION G : INT G := F(); END_FUNCTION",
                     "G is no function declared before")

    def test_a_call_may_be_a_statement_unless_it_only_has_a_result(self):
        self.assertEqual(after("DIFF(1, 2); I := 1;", "I", before=self.DIFFERENCE), 1)
        self.body_refused("ABS(I);", "result of ABS is dropped")


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
