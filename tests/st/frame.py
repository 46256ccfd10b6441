"""The values of a call's variables: how they begin, are copied and come in, and how many steps the call may take."""
from dataclasses import dataclass

from .lexer import StError
from .typed import Array, Struct
from .values import fitted

STEPS_A_CALL = 1_000_000
UNDEFINED = object()  # value of a FOR loop's control variable after its end: the standard defines none


@dataclass
class Frame:
    values: dict
    budget: list  # limit for one element: the remaining steps, shared with the called functions


def spend(frame, line):
    frame.budget[0] -= 1
    if frame.budget[0] < 0:
        raise StError(line, f"more than {STEPS_A_CALL} steps in one call")


def clone(value):
    if isinstance(value, dict):
        return {name: clone(field) for name, field in value.items()}
    return [clone(element) for element in value] if isinstance(value, list) else value


def default(type_):
    if isinstance(type_, Array):
        return [default(type_.element) for _ in range(type_.low, type_.high + 1)]
    if isinstance(type_, Struct):
        return {name: default(field) for name, field in type_.fields}
    return {"BOOL": False, "REAL": 0.0}.get(type_, 0)


def given(value, type_, name):
    """An input from Python, checked as a register would hold it: ValueError where it does not fit."""
    if isinstance(type_, Array):
        if not isinstance(value, (list, tuple)) or len(value) != type_.high - type_.low + 1:
            raise ValueError(f"{name} wants {type_.high - type_.low + 1} elements")
        return [given(element, type_.element, name) for element in value]
    if isinstance(type_, Struct):
        fields = {key.upper(): field for key, field in value.items()}
        if fields.keys() != dict(type_.fields).keys():
            raise ValueError(f"{name} wants the fields of {type_}")
        return {key: given(fields[key], field, name) for key, field in type_.fields}
    if isinstance(value, bool) != (type_ == "BOOL") or isinstance(value, float) and type_ != "REAL":
        raise ValueError(f"{name} = {value!r} is no {type_}")
    if type_ == "BOOL":
        return value
    try:
        return fitted(type_, value, 0)
    except StError as error:
        raise ValueError(f"{name}: {error}") from None
