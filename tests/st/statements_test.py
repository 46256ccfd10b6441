#!/usr/bin/env python3
"""Statements and functions: the order in which a controller runs them, and what a compiler refuses."""
import pathlib
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from st.interpreter import Program  # noqa: E402
from st.small_program import FIRST_LINE, StTest, after, block, result  # noqa: E402


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

    def test_a_timer_counts_by_the_clock_of_the_controller_and_only_when_it_is_called(self):
        program = Program(block("T(IN := B, PT := T#2s); E := T.ET; Q := T.Q;", "T : TON; B : BOOL := TRUE; E : TIME; Q : BOOL;"))
        fb = program.instance("FB_T")
        for now_ms, elapsed, is_over in ((100, 0, False), (100, 0, False), (2099, 1999, False), (2100, 2000, True), (9000, 2000, True)):
            program.now_ms = now_ms
            fb.call()
            self.assertEqual([fb.value("E"), fb.value("Q")], [elapsed, is_over], now_ms)

    def test_a_timer_that_is_switched_off_and_on_in_one_cycle_begins_again(self):
        program = Program(block("T(IN := FALSE, PT := T#1s); T(IN := TRUE, PT := T#1s); E := T.ET;", "T : TON; E : TIME;"))
        fb = program.instance("FB_T")
        for program.now_ms in (0, 500, 1500):
            fb.call()
            self.assertEqual(fb.value("E"), 0)

    def test_times_are_added_and_compared_and_nothing_else(self):
        self.assertTrue(after("B := P + T#900ms < T#2s;", "B", "P : TIME := T#1s; B : BOOL;"))
        for wrong in ("P * P", "P + 1", "P - P", "TIME_TO_DINT(P)", "DINT_TO_TIME(L)"):
            self.body_refused(f"P := {wrong};", "TIME", variables="P : TIME; L : DINT;")

    def test_a_block_in_a_block_keeps_its_variables_and_shows_its_outputs_alone(self):
        inner = "FUNCTION_BLOCK FB_I VAR_INPUT A : INT; END_VAR VAR_OUTPUT SUM : INT; END_VAR VAR HIDDEN : INT; END_VAR SUM := SUM + A; END_FUNCTION_BLOCK "
        variables = "X : FB_I; Y : FB_I; I : INT;"
        self.assertEqual(after("X(A := 2); Y(A := 10); I := X.SUM + Y.SUM;", "I", variables, inner, calls=3), 36)
        for body, reason in (("X();", "takes A"), ("X(1);", "takes A"), ("X(B := 1);", "takes A"), ("I := X.HIDDEN;", "no field HIDDEN"),
                             ("X.SUM := 1;", "is a function block")):
            self.body_refused(body, reason, variables=variables, before=inner)

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


if __name__ == "__main__":
    unittest.main()
