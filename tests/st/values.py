"""Arithmetic, conversions and standard functions of elementary values, as IEC 61131-3 defines them.

A result on which vendors disagree raises StError.
"""
import math
import operator
import struct

from .lexer import BITS, INTEGERS, StError

RANGES = {name: (0, 2**bits - 1) for name, bits in BITS.items()} | {
    "INT": (-2**15, 2**15 - 1), "UINT": (0, 2**16 - 1), "DINT": (-2**31, 2**31 - 1), "UDINT": (0, 2**32 - 1)}
NUMERIC = {*INTEGERS, "REAL"}
LONGEST_MS = 2**31 - 1  # a TIME, in milliseconds: the shortest range of those controllers that count it in 32 bits
UNTYPED = "an untyped integer"  # the type of 5 or 16#FF until its context gives one

COMPARISONS = {"=": operator.eq, "<>": operator.ne, "<": operator.lt, ">": operator.gt, "<=": operator.le,
               ">=": operator.ge}
LOGIC = {"AND": operator.and_, "OR": operator.or_, "XOR": operator.xor}
EXACT = {"+": operator.add, "-": operator.sub, "*": operator.mul}


def single(value, line):
    """The nearest IEEE 754 single; controllers disagree on what follows an infinity or a NaN, so neither passes."""
    try:
        rounded = struct.unpack("<f", struct.pack("<f", value))[0]
    except OverflowError:
        rounded = math.inf
    if not math.isfinite(rounded):
        raise StError(line, "the REAL result is not finite")
    return rounded


def fitted(type_, value, line):
    if type_ == "REAL":
        return single(value, line)
    low, high = (0, LONGEST_MS) if type_ == "TIME" else RANGES[type_]
    if not low <= value <= high:
        raise StError(line, f"{value} is outside {type_}, {low} .. {high}")
    return value


def quotient(left, right):
    """IEC 61131-3, table 24: towards zero."""
    return abs(left) // abs(right) * (1 if (left < 0) == (right < 0) else -1)


def calculated(sign, left, right, type_, line):
    if sign in EXACT:
        result = EXACT[sign](left, right)
    elif right == 0:
        raise StError(line, "division by zero")
    elif type_ == "REAL":
        result = left / right
    else:
        result = quotient(left, right) if sign == "/" else left - quotient(left, right) * right
    return result if type_ == UNTYPED else fitted(type_, result, line)


def conversion(name, source, target):
    """The function value, line -> value of an IEC 61131-3 conversion, or the reason there is none."""
    def checked(value, line):
        return fitted(target, value, line)

    def bits_to_integer(value, line):
        value &= 2 ** INTEGERS[target] - 1
        return value - 2 ** INTEGERS[target] if value > RANGES[target][1] else value

    def integer_to_bits(value, line):
        if value < 0 and BITS[target] > INTEGERS[source]:
            raise StError(line, f"{name} of {value}: vendors disagree on the upper bits")
        return value & (2 ** BITS[target] - 1)

    def to_bool(value, line):
        if value not in (0, 1):
            raise StError(line, f"{name} of {value}: vendors disagree whether one bit or all count")
        return bool(value)

    if source == target:
        return f"there is no {name}"
    if "TIME" in (source, target):
        return f"{name}: vendors disagree on milliseconds against seconds"
    if "REAL" in (source, target):
        if source not in NUMERIC or target not in NUMERIC:
            return f"{name}: vendors disagree on value against bit pattern"
        return checked if target == "REAL" else lambda value, line: checked(round(value), line)
    if source == "BOOL":
        return lambda value, line: int(value)
    if target == "BOOL":
        return to_bool
    if source in BITS:
        return bits_to_integer if target in INTEGERS else lambda value, line: value & (2 ** BITS[target] - 1)
    return integer_to_bits if target in BITS else checked


def shift(name, type_):
    width = BITS[type_]

    def run(line, value, count):
        if not 0 <= count < width:
            raise StError(line, f"{name} by {count}: vendors disagree outside 0 .. {width - 1}")
        if name == "SHR":
            return value >> count
        turned = {"SHL": 0, "ROL": value >> (width - count), "ROR": value << (width - count)}[name]
        moved = value >> count if name == "ROR" else value << count
        return (moved | turned) & (2 ** width - 1)
    return run


def limit(line, low, value, high):
    if low > high:
        raise StError(line, f"LIMIT from {low} to {high}: vendors disagree on an empty range")
    return max(low, min(value, high))


def square_root(line, value):
    if value < 0:
        raise StError(line, "SQRT of a negative number")
    return single(math.sqrt(value), line)


def power(line, base, exponent):
    try:
        return single(math.pow(base, exponent), line)
    except (ValueError, OverflowError):
        raise StError(line, f"EXPT of {base} and {exponent} is not finite") from None
