"""Programs of a few lines for the tests: a function block of which the test specifies only the body."""
import struct
import unittest

from .interpreter import Program, StError

FIRST_LINE = 3  # first line of the body in block(), if `variables` is one line
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
