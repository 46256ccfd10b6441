"""Runs the structured text (IEC 61131-3 ST) that a register map generator emits, as a controller would.

    program = Program(text)                    # StError, with the line, for what a strict compiler refuses
    fb = program.instance("FB_TACTILED")
    program.now_ms = 120                       # the controller's clock
    fb.call(REGS=[...])                        # one cycle; variables keep their values until the next call
    fb.value("S[3].FX_N")

A text is refused if vendors disagree on its meaning: at once if its types show it, else when a value does.
"""
from . import parser as tree
from .frame import STEPS_A_CALL, Frame, clone, default, given
from .lexer import ELEMENTARY, StError
from .parser import Parser
from .statements import Return, Statements
from .typed import TON, Array, Struct, Variable, coerced


class Unit(Statements):
    """One FUNCTION or FUNCTION_BLOCK, checked, its statements turned into Python functions of a Frame."""

    def __init__(self, program, node):
        super().__init__(program, node.name)
        self.kind = node.kind
        self.result = node.result and node.result.name
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

    def fresh(self):
        """The variables of a new instance."""
        return {name: clone(variable.initial) for name, variable in self.variables.items()}

    def outputs(self):
        """The type of an instance in another block, which can read its outputs alone."""
        return Struct(self.name, tuple((name, v.type) for name, v in self.variables.items() if v.section == "VAR_OUTPUT"))

    def declare(self, variable):
        line, name, type_ = variable.line, variable.name, self.program.type_of(variable.type, is_variable=True)
        if name in self.variables or name in self.program.taken:
            raise StError(line, f"{name} is declared twice")
        unit = self.program.blocks.get(variable.type.name) if isinstance(variable.type, tree.NamedType) else None
        if unit or type_ is TON:
            if self.kind == "FUNCTION" or variable.section != "VAR" or variable.initial is not None:
                raise StError(line, "an instance of a function block is a VAR of a FUNCTION_BLOCK, without an initial value")
            self.variables[name] = Variable(type_, "INSTANCE", unit.fresh() if unit else default(type_))
            return
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


class Program:
    def __init__(self, text):
        parser = Parser(text)
        self.now_ms = 0  # the controller's clock, which its timers read: set it before each call
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

    def type_of(self, node, name=None, is_variable=False):
        if isinstance(node, tree.ArrayOf):
            element = self.type_of(node.element)
            if isinstance(element, Array):
                raise StError(node.line, "an array of arrays is not in this subset")
            return Array(name or f"ARRAY[{node.low}..{node.high}] OF {element}", node.low, node.high, element)
        if node.name in ELEMENTARY:
            return node.name
        if is_variable and node.name == "TON":
            return TON
        if is_variable and node.name in self.blocks:
            return self.blocks[node.name].outputs()
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
        self.values = block.fresh()

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
