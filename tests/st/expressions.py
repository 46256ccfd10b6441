"""Expressions and calls, checked and turned into Python functions of a Frame."""
from . import parser as tree
from .frame import UNDEFINED, Frame, clone, spend
from .lexer import BITS, ELEMENTARY, INTEGERS, StError
from .typed import Array, Struct, Typed, coerced, common_type, require
from .values import (COMPARISONS, LOGIC, NUMERIC, UNTYPED, calculated, conversion, fitted, limit, power, shift,
                     square_root)


class Expressions:
    """The environment of one FUNCTION or FUNCTION_BLOCK: its variables declared so far, and the functions of its
    program."""

    def __init__(self, program, name):
        self.program = program
        self.name = name
        self.variables = {}

    def expression(self, node):
        return {tree.Literal: self.literal, tree.Path: self.read, tree.Unary: self.unary, tree.Binary: self.binary,
                tree.Call: self.call}[type(node)](node)

    def literal(self, node):
        if node.type is None:
            return Typed(UNTYPED, lambda frame: node.value, node.value)
        value = node.value if node.type in ("BOOL", "TIME") else fitted(node.type, node.value, node.line)
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
            compared = {UNTYPED, "TIME", *NUMERIC} | ({"BOOL", *BITS} if sign in ("=", "<>") else set())
            require(type_, compared, sign, line)
            return Typed("BOOL", lambda frame: COMPARISONS[sign](first(frame), second(frame)))
        require(type_, {UNTYPED, *INTEGERS} | (set() if sign == "MOD" else {"REAL"}) | ({"TIME"} if sign == "+" else set()), sign, line)
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
