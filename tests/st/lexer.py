"""Characters to tokens, for the subset of IEC 61131-3 structured text that interpreter.py runs."""
import re
from dataclasses import dataclass

BITS = {"BYTE": 8, "WORD": 16, "DWORD": 32}
INTEGERS = {"INT": 16, "UINT": 16, "DINT": 32, "UDINT": 32}
ELEMENTARY = {"BOOL", "REAL", "TIME", *BITS, *INTEGERS}

KEYWORDS = set(
    "AND ARRAY BY CASE CONSTANT DO ELSE ELSIF END_CASE END_FOR END_FUNCTION END_FUNCTION_BLOCK END_IF END_STRUCT "
    "END_TYPE END_VAR END_WHILE EXIT FALSE FOR FUNCTION FUNCTION_BLOCK IF MOD NOT OF OR RETURN STRUCT THEN TO TRUE "
    "TYPE VAR VAR_INPUT VAR_OUTPUT WHILE XOR".split())
ABSENT = set(  # words of the language that this subset leaves out
    "ACTION AT CONFIGURATION CONTINUE END_ACTION END_CONFIGURATION END_PROGRAM END_REPEAT END_RESOURCE END_STEP "
    "END_TRANSITION F_EDGE FROM GOTO INITIAL_STEP NON_RETAIN PERSISTENT POINTER PROGRAM R_EDGE READ_ONLY READ_WRITE "
    "REF_TO REFERENCE REPEAT RESOURCE RETAIN STEP TASK TRANSITION UNTIL VAR_ACCESS VAR_CONFIG VAR_EXTERNAL VAR_GLOBAL "
    "VAR_IN_OUT VAR_STAT VAR_TEMP WITH".split())
# IEC 61131-3 tables C.1 and C.2, the keywords of CODESYS and TwinCAT and the parameters Rockwell adds to every block.
# TwinCAT also lists the instruction list operators S and R, but compiles variables of those names.
RESERVED = KEYWORDS | ABSENT | ELEMENTARY | set(
    "ABS ABSTRACT ACOS ADD ADR AND_THEN ANDN ANY ASIN ATAN ATAN2 BIT BITADR CAL CALC CALCN CHAR CLASS CONCAT COS CTD "
    "CTU CTUD DATE DATE_AND_TIME DELETE DIV DT EN ENABLEIN ENABLEOUT END_CLASS END_INTERFACE END_METHOD END_NAMESPACE "
    "END_PROPERTY END_UNION ENO EQ EXP EXPT EXTENDS F_TRIG FINAL FIND GE GT IMPLEMENTS INDEXOF INI INSERT INTERFACE "
    "INTERNAL JMP JMPC JMPCN LD LDATE LDN LDT LE LEFT LEN LIMIT LINT LN LOG LREAL LT LTIME LTOD LWORD MAX METHOD MID "
    "MIN MOVE MUL MUX NAMESPACE NE NULL OR_ELSE ORN OVERRIDE PARAMS PRIVATE PROPERTY PROTECTED PUBLIC R_TRIG REF "
    "REPLACE RET RETC RETCN RIGHT ROL ROR RS RTC SEL SHL SHR SIN SINT SIZEOF SQRT SR ST STN STRING SUB SUPER TAN THIS "
    "TIME TIME_OF_DAY TOD TOF TON TP TRUNC ULINT UNION USING USINT WCHAR WSTRING XORN".split())
TYPE_NAME = r"(BOOL|BYTE|L?REAL|[DL]?WORD|U?[SDL]?INT|W?STRING|W?CHAR|TIME|DATE|TOD|DT)"
RESERVED_SHAPE = re.compile(rf"ANY_\w+|({TYPE_NAME}_)?TO_{TYPE_NAME}")
LONGEST_NAME = 40

DIGITS = r"[0-9]+(?:_[0-9]+)*"
TOKEN = re.compile(rf"""
    (?P<space>\s+|//[^\n]*|\{{[^}}]*\}})
  | (?P<time>T\#(?P<ticks>[0-9]+)(?P<unit>MS|S)(?![\w\#]))
  | (?P<literal>
      (?:(?P<type>[A-Z]+)\#(?P<sign>-?))?
      (?: (?P<real>{DIGITS}\.{DIGITS}(?:E[+-]?{DIGITS})?)
        | (?P<based>2\#[01]+(?:_[01]+)*|16\#[0-9A-F]+(?:_[0-9A-F]+)*)
        | (?P<integer>{DIGITS}) )
      (?P<excess>[\w\#]*))
  | (?P<truth>(?:BOOL\#)?(?:TRUE|FALSE)(?![\w\#]))
  | (?P<name>[A-Z_]\w*)
  | (?P<symbol>:=|<=|>=|<>|\.\.|=>|[-+*/<>=&()\[\],:;.])
""", re.VERBOSE | re.IGNORECASE | re.ASCII)


class StError(Exception):
    """An error of the compiler or of the controller at run time; `line` counts from 1."""

    def __init__(self, line, message):
        super().__init__(f"line {line}: {message}")
        self.line = line


@dataclass
class Token:
    kind: str  # "name", "keyword", "literal", "symbol" or "end"
    text: str  # in capitals
    spelled: str
    line: int
    type: str | None = None  # type of a literal; None for an integer without a type
    value: object = None


def check_name(token):
    problem = None
    if token.text in RESERVED or RESERVED_SHAPE.fullmatch(token.text):
        problem = "is a reserved word"
    elif token.kind != "name":
        problem = "is no name"
    elif len(token.text) > LONGEST_NAME:
        problem = f"has {len(token.text)} characters, more than {LONGEST_NAME}"
    elif "__" in token.text or token.text.endswith("_"):
        problem = "has a doubled or a trailing underscore"
    if problem:
        raise StError(token.line, f'"{token.spelled}" {problem}')


def tokens_of(text):
    tokens = []
    position, line = 0, 1
    while position < len(text):
        if text.startswith("(*", position):
            end = comment_end(text, position, line)
        else:
            match = TOKEN.match(text, position)
            if not match:
                raise StError(line, f"unexpected {text[position]!r}")
            end = match.end()
            if not match["space"]:
                tokens.append(token_of(match, line))
        line += text.count("\n", position, end)
        position = end
    tokens.append(Token("end", "", "the end of the text", line))
    return tokens


def comment_end(text, start, line):
    end = text.find("*)", start + 2)
    if end < 0:
        raise StError(line, "the comment is never closed")
    nested = text.find("(*", start + 2, end)
    if nested >= 0:
        line += text.count("\n", start, nested)
        raise StError(line, "a comment inside a comment: compilers differ on its end")
    return end + 2


def token_of(match, line):
    spelled = match[0]
    text = spelled.upper()
    if match["name"]:
        return Token("keyword" if text in KEYWORDS else "name", text, spelled, line)
    if match["symbol"]:
        return Token("symbol", text, spelled, line)
    if match["truth"]:
        return Token("literal", text, spelled, line, "BOOL", text.endswith("TRUE"))
    if match["time"]:
        return Token("literal", text, spelled, line, "TIME", int(match["ticks"]) * (1000 if match["unit"].upper() == "S" else 1))
    type_name, value = number_of(match, line)
    return Token("literal", text, spelled, line, type_name, value)


def number_of(match, line):
    if match["excess"] or match["sign"] and match["based"]:
        raise StError(line, f"malformed literal {match[0]}")
    type_name = match["type"] and match["type"].upper()
    if type_name not in ({None, "REAL"} if match["real"] else {None, *BITS, *INTEGERS}):
        raise StError(line, f"{match[0]} is no literal of this subset")
    sign = -1 if match["sign"] else 1
    if match["real"]:
        return "REAL", sign * float(match["real"].replace("_", ""))
    base, digits = match["based"].split("#") if match["based"] else (10, match["integer"])
    return type_name, sign * int(digits, int(base))
