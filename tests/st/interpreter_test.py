#!/usr/bin/env python3
"""A whole program, called cycle by cycle, with what Python gives to it and reads of it."""
import pathlib
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from st.interpreter import Program, StError  # noqa: E402


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


if __name__ == "__main__":
    unittest.main()
