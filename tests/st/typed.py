"""The types of variables and expressions, and the implicit conversions between them."""
from dataclasses import dataclass
from typing import Callable

from .lexer import StError
from .values import RANGES, UNTYPED, fitted

WIDENINGS = {("INT", "DINT"), ("UINT", "UDINT"), ("UINT", "DINT")}


@dataclass(frozen=True)
class Array:
    name: str  # its own, or a description for an array without one
    low: int
    high: int
    element: object

    def __str__(self):
        return self.name


@dataclass(frozen=True)
class Struct:
    name: str
    fields: tuple  # tuples (name, type)

    def __str__(self):
        return self.name


# The timer of the standard, the one function block that is not declared in the text. Only its outputs can be read.
TON = Struct("TON", (("Q", "BOOL"), ("ET", "TIME")))


@dataclass
class Variable:
    type: object
    section: str
    initial: object


@dataclass
class Typed:
    type: object
    run: Callable  # Frame -> value
    literal: int | None = None  # the value, if the type is UNTYPED


def coerced(typed, type_, line):
    """Returns the function that runs `typed` where a value of `type_` is required, if no explicit conversion is
    necessary."""
    if typed.type == UNTYPED and type_ in RANGES:
        value = fitted(type_, typed.literal, line)
        return lambda frame: value
    if typed.type == type_ or (typed.type, type_) in WIDENINGS:
        return typed.run
    raise StError(line, f"{typed.type} where {type_} is wanted")


def common_type(left, right, line):
    if left.type == right.type or right.type == UNTYPED or (right.type, left.type) in WIDENINGS:
        return left.type
    if left.type == UNTYPED or (left.type, right.type) in WIDENINGS:
        return right.type
    raise StError(line, f"{left.type} and {right.type} do not mix without a conversion")


def require(type_, allowed, what, line):
    if type_ not in allowed:
        raise StError(line, f"{what} does not take {type_}")
