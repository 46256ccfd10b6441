"""Runs the structured text (IEC 61131-3 ST) that a register map generator emits, as a controller would.

    program = Program(text)                    # StError, with the line, for what a strict compiler refuses
    fb = program.instance("FB_TACTILED")
    fb.call(REGS=[...], NOW=...)               # one cycle; variables keep their values until the next call
    fb.value("S[3].FX_N")

Where vendors disagree on a meaning the text is refused: at once if its types tell, else when a value shows it.
"""
from dataclasses import dataclass
from typing import Callable

from . import parser as tree
from .lexer import BITS, ELEMENTARY, INTEGERS, StError
from .parser import Parser
from .values import (COMPARISONS, LOGIC, NUMERIC, RANGES, UNTYPED, calculated, conversion, fitted, limit, power, shift,
                     square_root)

WIDENINGS = {("INT", "DINT"), ("UINT", "UDINT"), ("UINT", "DINT")}
STEPS_A_CALL = 1_000_000
UNDEFINED = object()  # what a FOR loop leaves in its control variable: the standard names no value


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
    fields: tuple  # of (name, type)

    def __str__(self):
        return self.name


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


@dataclass
class Frame:
    values: dict
    budget: list  # of one element: the steps left, shared with the functions called


class Exit(Exception):
    pass


class Return(Exception):
    pass


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


def coerced(typed, type_, line):
    """What runs `typed` where a value of `type_` is wanted, if no conversion has to be written for that."""
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


class Unit:
    """One FUNCTION or FUNCTION_BLOCK, checked, its statements turned into Python functions of a Frame."""

    def __init__(self, program, node):
        self.program = program
        self.kind = node.kind
        self.name = node.name
        self.result = node.result and node.result.name
        self.variables = {}
        self.controls = []  # of the FOR loops around the statement at hand
        self.loops = 0
        if self.result:
            if self.result not in ELEMENTARY:
                raise StError(node.line, f"a FUNCTION of this subset does not return {self.result}")
            self.variables[self.name] = Variable(self.result, "RESULT", default(self.result))
        for variable in node.variables:
            self.declare(variable)
        self.body = self.statements(node.body)

    def run(self, frame):
        try:
            self.body(frame)
        except Return:
            pass

    def declare(self, variable):
        line, name, type_ = variable.line, variable.name, self.program.type_of(variable.type)
        if name in self.variables or name in self.program.taken:
            raise StError(line, f"{name} is declared twice")
        if variable.section == "VAR_OUTPUT" and self.kind == "FUNCTION":
            raise StError(line, "VAR_OUTPUT of a FUNCTION is not in this subset")
        if variable.section == "VAR_INPUT" and self.kind == "FUNCTION" and variable.initial is not None:
            raise StError(line, "an input of a FUNCTION has no initial value")
        if variable.section == "CONSTANT" and variable.initial is None:
            raise StError(line, f"the constant {name} has no value")
        initial = default(type_) if variable.initial is None else self.initial(variable.initial, type_, line)
        self.variables[name] = Variable(type_, variable.section, initial)

    def initial(self, node, type_, line):
        if isinstance(node, list):
            if not isinstance(type_, Array) or len(node) != type_.high - type_.low + 1:
                raise StError(line, f"{len(node)} initial values for {type_}")
            return [self.initial(element, type_.element, line) for element in node]
        operand = node.operand if isinstance(node, tree.Unary) and node.operator == "-" else node
        constant = isinstance(operand, tree.Path) and not operand.steps and operand.name in self.variables \
            and self.variables[operand.name].section == "CONSTANT"
        if not constant and not isinstance(operand, tree.Literal):
            raise StError(line, "an initial value is a literal or a constant declared before")
        constants = {name: known.initial for name, known in self.variables.items()}
        return clone(coerced(self.expression(node), type_, line)(Frame(constants, [1])))

    # Expressions

    def expression(self, node):
        return {tree.Literal: self.literal, tree.Path: self.read, tree.Unary: self.unary, tree.Binary: self.binary,
                tree.Call: self.call}[type(node)](node)

    def literal(self, node):
        if node.type is None:
            return Typed(UNTYPED, lambda frame: node.value, node.value)
        value = node.value if node.type == "BOOL" else fitted(node.type, node.value, node.line)
        return Typed(node.type, lambda frame: value)

    def read(self, node):
        type_, locate = self.path(node)
        line = node.line

        def run(frame):
            container, key = locate(frame)
            if container[key] is UNDEFINED:
                raise StError(line, f"{node.name} after its FOR loop: the standard names no value")
            return container[key]
        return Typed(type_, run)

    def path(self, node):
        """The type at the path and what finds, in a Frame, the container and key of its value."""
        if node.name not in self.variables:
            raise StError(node.line, f"{node.name} is not declared")
        type_ = self.variables[node.name].type
        keys = []
        for step in node.steps:
            if isinstance(step, str):
                fields = dict(type_.fields) if isinstance(type_, Struct) else {}
                if step not in fields:
                    raise StError(node.line, f"{type_} has no field {step}")
                type_ = fields[step]
                keys.append(lambda frame, name=step: name)
            else:
                if not isinstance(type_, Array):
                    raise StError(node.line, f"{type_} is no array")
                keys.append(self.index(step, type_, node.line))
                type_ = type_.element

        def locate(frame):
            container, key = frame.values, node.name
            for step in keys:
                container, key = container[key], step(frame)
            return container, key
        return type_, locate

    def index(self, node, array, line):
        typed = self.expression(node)
        require(typed.type, {UNTYPED, *INTEGERS}, "an index", line)

        def run(frame):
            value = typed.run(frame)
            if not array.low <= value <= array.high:
                raise StError(line, f"index {value} is outside {array.low} .. {array.high}")
            return value - array.low
        if typed.type == UNTYPED:
            run(None)
        return run

    def unary(self, node):
        line = node.line
        typed = self.expression(node.operand)
        run = typed.run
        if node.operator == "NOT":
            require(typed.type, {"BOOL", *BITS}, "NOT", line)
            ones = True if typed.type == "BOOL" else 2 ** BITS[typed.type] - 1
            return Typed(typed.type, lambda frame: run(frame) ^ ones)
        require(typed.type, {UNTYPED, "INT", "DINT", "REAL"}, "the sign -", line)
        if typed.type == UNTYPED:
            return Typed(UNTYPED, lambda frame: -typed.literal, -typed.literal)
        return Typed(typed.type, lambda frame: fitted(typed.type, -run(frame), line))

    def binary(self, node):
        line, sign = node.line, node.operator
        left, right = self.expression(node.left), self.expression(node.right)
        type_ = common_type(left, right, line)
        both_untyped = type_ == UNTYPED
        first, second = ((t.run if both_untyped else coerced(t, type_, line)) for t in (left, right))
        # Both operands always run: a controller need not stop at the first that decides.
        if sign in LOGIC:
            require(type_, {"BOOL", *BITS}, sign, line)
            return Typed(type_, lambda frame: LOGIC[sign](first(frame), second(frame)))
        if sign in COMPARISONS:
            compared = {UNTYPED, *NUMERIC} | ({"BOOL", *BITS} if sign in ("=", "<>") else set())
            require(type_, compared, sign, line)
            return Typed("BOOL", lambda frame: COMPARISONS[sign](first(frame), second(frame)))
        require(type_, {UNTYPED, *INTEGERS} | (set() if sign == "MOD" else {"REAL"}), sign, line)
        if both_untyped:
            value = calculated(sign, left.literal, right.literal, UNTYPED, line)
            return Typed(UNTYPED, lambda frame: value, value)
        return Typed(type_, lambda frame: calculated(sign, first(frame), second(frame), type_, line))

    # Calls

    def call(self, node):
        line, name = node.line, node.name
        if name == self.name:
            raise StError(line, f"{name} calls itself")
        if name in self.program.functions:
            return self.own_function(self.program.functions[name], node)
        source, _, target = name.partition("_TO_")
        if source not in ELEMENTARY or target not in ELEMENTARY:
            return self.standard_function(node)
        convert = conversion(name, source, target)
        if isinstance(convert, str):
            raise StError(line, convert)
        argument = coerced(self.positional(node, 1)[0], source, line)
        return Typed(target, lambda frame: convert(argument(frame), line))

    def positional(self, node, count):
        if any(formal for formal, _ in node.arguments):
            raise StError(node.line, f"{node.name} takes its arguments without names")
        if len(node.arguments) != count:
            raise StError(node.line, f"{node.name} takes {count} arguments, not {len(node.arguments)}")
        return [self.expression(argument) for _, argument in node.arguments]

    def own_function(self, function, node):
        line = node.line
        inputs = [name for name, variable in function.variables.items() if variable.section == "VAR_INPUT"]
        formals = [formal for formal, _ in node.arguments]
        if not any(formals) and len(formals) == len(inputs):
            formals = inputs
        if sorted(map(str, formals)) != sorted(inputs):
            raise StError(line, f"{function.name} takes {', '.join(inputs) or 'nothing'}, each once")
        arguments = {formal: coerced(self.expression(argument), function.variables[formal].type, line)
                     for formal, (_, argument) in zip(formals, node.arguments)}

        def run(frame):
            spend(frame, line)
            values = {name: clone(variable.initial) for name, variable in function.variables.items()}
            values |= {name: argument(frame) for name, argument in arguments.items()}
            function.run(Frame(values, frame.budget))
            return values[function.name]
        return Typed(function.result, run)

    def standard_function(self, node):
        line, name = node.line, node.name
        counts = {"SHL": 2, "SHR": 2, "ROL": 2, "ROR": 2, "ABS": 1, "MAX": 2, "MIN": 2, "LIMIT": 3, "SEL": 3,
                  "SQRT": 1, "EXPT": 2}
        if name not in counts:
            raise StError(line, f"{name} is no function declared before this line")
        arguments = self.positional(node, counts[name])
        if name in ("SHL", "SHR", "ROL", "ROR"):
            require(arguments[0].type, BITS, name, line)
            require(arguments[1].type, {UNTYPED, *INTEGERS}, f"the count of {name}", line)
            return self.applied(arguments[0].type, shift(name, arguments[0].type), [a.run for a in arguments], line)
        if name in ("SQRT", "EXPT"):
            runs = [coerced(arguments[0], "REAL", line)] + [a.run for a in arguments[1:]]
            for exponent in arguments[1:]:
                require(exponent.type, {UNTYPED, *NUMERIC}, "the exponent of EXPT", line)
            return self.applied("REAL", power if name == "EXPT" else square_root, runs, line)
        chosen = arguments[1:] if name == "SEL" else arguments
        type_ = common_type(chosen[0], chosen[-1], line)
        if len(chosen) == 3:
            type_ = common_type(Typed(type_, None), chosen[1], line)
        require(type_, {*NUMERIC, "BOOL", *BITS} if name == "SEL" else NUMERIC, name, line)
        runs = [coerced(a, type_, line) for a in chosen]
        if name == "SEL":
            runs.insert(0, coerced(arguments[0], "BOOL", line))
        run = {"ABS": lambda line, value: fitted(type_, abs(value), line), "LIMIT": limit,
               "MAX": lambda line, *values: max(values), "MIN": lambda line, *values: min(values),
               "SEL": lambda line, second, *values: values[second]}[name]
        return self.applied(type_, run, runs, line)

    @staticmethod
    def applied(type_, function, runs, line):
        return Typed(type_, lambda frame: function(line, *[run(frame) for run in runs]))

    # Statements

    def statements(self, nodes):
        compilers = {tree.Assign: self.assign, tree.If: self.if_, tree.Case: self.case, tree.For: self.for_,
                     tree.While: self.while_, tree.Jump: self.jump, tree.Call: self.call_statement}
        compiled = [(node.line, compilers[type(node)](node)) for node in nodes]

        def run(frame):
            for line, statement in compiled:
                spend(frame, line)
                statement(frame)
        return run

    def call_statement(self, node):
        call = self.call(node)
        if node.name not in self.program.functions:
            raise StError(node.line, f"the result of {node.name} is dropped")
        return call.run

    def writable(self, name, line):
        variable = self.variables.get(name)
        if variable and variable.section in ("VAR_INPUT", "CONSTANT"):
            raise StError(line, f"{name} is {variable.section} and cannot be assigned")
        if name in self.controls:
            raise StError(line, f"{name} controls the FOR loop around this line")

    def assign(self, node):
        self.writable(node.target.name, node.line)
        type_, locate = self.path(node.target)
        value = coerced(self.expression(node.value), type_, node.line)

        def run(frame):
            result = clone(value(frame))
            container, key = locate(frame)
            container[key] = result
        return run

    def condition(self, node):
        return coerced(self.expression(node), "BOOL", node.line)

    def if_(self, node):
        branches = [(self.condition(condition), self.statements(body)) for condition, body in node.branches]
        otherwise = self.statements(node.otherwise)

        def run(frame):
            for condition, body in branches:
                if condition(frame):
                    return body(frame)
            return otherwise(frame)
        return run

    def case(self, node):
        selector = self.expression(node.selector)
        require(selector.type, INTEGERS, "CASE", node.line)
        taken = []
        for line, low, high in (label for labels, _ in node.branches for label in labels):
            fitted(selector.type, low, line)
            fitted(selector.type, high, line)
            if low > high:
                raise StError(line, f"the label {low}..{high} is empty")
            if any(low <= other_high and other_low <= high for other_low, other_high in taken):
                raise StError(line, f"the label {low} is taken by a branch before")
            taken.append((low, high))
        branches = [([(low, high) for _, low, high in labels], self.statements(body)) for labels, body in node.branches]
        otherwise = self.statements(node.otherwise)

        def run(frame):
            value = selector.run(frame)
            for labels, body in branches:
                if any(low <= value <= high for low, high in labels):
                    return body(frame)
            return otherwise(frame)
        return run

    def looped(self, body):
        self.loops += 1
        run = self.statements(body)
        self.loops -= 1
        return run

    def for_(self, node):
        line, name = node.line, node.name
        self.writable(name, line)
        type_, _ = self.path(tree.Path(line, name, []))
        require(type_, INTEGERS, "the control variable of FOR", line)
        first, last, step = (coerced(self.expression(e), type_, line) for e in (node.first, node.last, node.step))
        self.controls.append(name)
        body = self.looped(node.body)
        self.controls.pop()

        def run(frame):
            value, end, increment = first(frame), last(frame), step(frame)
            if increment == 0:
                raise StError(line, "FOR with a step of 0 never ends")
            while value <= end if increment > 0 else value >= end:
                spend(frame, line)
                frame.values[name] = value
                try:
                    body(frame)
                except Exit:
                    return
                # Past the last round the variable still steps: FOR to 32767 in an INT never ends on a controller.
                value = fitted(type_, value + increment, line)
            frame.values[name] = UNDEFINED
        return run

    def while_(self, node):
        line = node.line
        condition = self.condition(node.condition)
        body = self.looped(node.body)

        def run(frame):
            try:
                while condition(frame):
                    spend(frame, line)
                    body(frame)
            except Exit:
                pass
        return run

    def jump(self, node):
        if node.word == "EXIT" and not self.loops:
            raise StError(node.line, "EXIT outside a loop")

        def run(frame):
            raise Exit if node.word == "EXIT" else Return
        return run


class Program:
    def __init__(self, text):
        parser = Parser(text)
        self.types = {}
        self.functions = {}
        self.blocks = {}
        self.taken = set()  # names of types, functions and function blocks
        for declaration in parser.declarations():
            name = declaration.name
            if name in self.taken or any(name in unit.variables for unit in [*self.functions.values(),
                                                                             *self.blocks.values()]):
                raise StError(declaration.line, f"{name} is declared twice")
            self.taken.add(name)
            if isinstance(declaration, tree.TypeDeclaration):
                self.types[name] = self.defined(declaration)
            elif declaration.kind == "FUNCTION":
                self.functions[name] = Unit(self, declaration)
            else:
                self.blocks[name] = Unit(self, declaration)
        self.declared = parser.names

    def defined(self, declaration):
        definition = declaration.definition
        if isinstance(definition, tree.ArrayOf):
            return self.type_of(definition, declaration.name)
        if isinstance(definition, tree.NamedType):
            raise StError(declaration.line, f"{declaration.name} is neither a STRUCT nor an ARRAY")
        fields = {}
        for line, name, type_ in definition.fields:
            if name in fields:
                raise StError(line, f"{name} is declared twice")
            fields[name] = self.type_of(type_)
        return Struct(declaration.name, tuple(fields.items()))

    def type_of(self, node, name=None):
        if isinstance(node, tree.ArrayOf):
            element = self.type_of(node.element)
            if isinstance(element, Array):
                raise StError(node.line, "an array of arrays is not in this subset")
            return Array(name or f"ARRAY[{node.low}..{node.high}] OF {element}", node.low, node.high, element)
        if node.name in ELEMENTARY:
            return node.name
        if node.name not in self.types:
            raise StError(node.line, f"{node.name} is no type of this subset declared before this line")
        return self.types[node.name]

    def instance(self, name):
        return Instance(self.blocks[name.upper()])

    def names(self):
        """Every identifier the text declares, in its order and spelling."""
        return list(self.declared)


class Instance:
    def __init__(self, block):
        self.block = block
        self.values = {name: clone(variable.initial) for name, variable in block.variables.items()}

    def call(self, **inputs):
        """One cycle. An input not given keeps its value, as on a controller."""
        for name, value in inputs.items():
            variable = self.block.variables.get(name.upper())
            if variable is None or variable.section != "VAR_INPUT":
                raise KeyError(f"{self.block.name} has no input {name}")
            self.values[name.upper()] = given(value, variable.type, name)
        self.block.run(Frame(self.values, [STEPS_A_CALL]))

    def value(self, path):
        node = Parser(path).whole_path()
        return clone(self.block.read(node).run(Frame(self.values, [STEPS_A_CALL])))


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
