"""Statements, checked and turned into Python functions of a Frame."""
from . import parser as tree
from .expressions import Expressions
from .frame import UNDEFINED, Frame, clone, spend
from .lexer import INTEGERS, StError
from .typed import TON, coerced, require
from .values import fitted


class Exit(Exception):
    pass


class Return(Exception):
    pass


def count(timer, was_on, now_ms):
    """TON of IEC 61131-3: ET counts since IN became TRUE, by the controller's clock, up to PT."""
    if not was_on:
        timer["since"] = now_ms
    timer["ET"] = min(now_ms - timer["since"], timer["PT"]) if timer["IN"] else 0
    timer["Q"] = timer["IN"] and timer["ET"] >= timer["PT"]


class Statements(Expressions):
    def __init__(self, program, name):
        super().__init__(program, name)
        self.controls = []  # control variables of the FOR loops around the present statement
        self.loops = 0

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
        variable = self.variables.get(node.name)
        if variable and variable.section == "INSTANCE":
            return self.instance_call(node, variable.type)
        call = self.call(node)
        if node.name not in self.program.functions:
            raise StError(node.line, f"the result of {node.name} is dropped")
        return call.run

    def instance_call(self, node, type_):
        """A call of a variable that is a function block, with all of its inputs by name: vendors keep an input that is left
        out, but a reader does not see it."""
        unit = None if type_ is TON else self.program.blocks[type_.name]
        inputs = {"IN": "BOOL", "PT": "TIME"} if unit is None else {name: v.type for name, v in unit.variables.items() if v.section == "VAR_INPUT"}
        if sorted(str(formal) for formal, _ in node.arguments) != sorted(inputs):
            raise StError(node.line, f"{node.name} takes {', '.join(inputs) or 'nothing'}, each once and by name")
        arguments = {formal: coerced(self.expression(argument), inputs[formal], node.line) for formal, argument in node.arguments}

        def run(frame):
            values = frame.values[node.name]
            was_on = values.get("IN")
            values |= {formal: clone(argument(frame)) for formal, argument in arguments.items()}
            if unit is None:
                count(values, was_on, self.program.now_ms)
            else:
                unit.run(Frame(values, frame.budget))
        return run

    def writable(self, name, line):
        variable = self.variables.get(name)
        if variable and variable.section == "INSTANCE":
            raise StError(line, f"{name} is a function block: call it")
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
