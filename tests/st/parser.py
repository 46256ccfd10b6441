"""Tokens to a tree. The grammar is that of IEC 61131-3, annex B, without what the subset leaves out."""
from collections import namedtuple

from .lexer import ABSENT, StError, check_name, tokens_of

# From the loosest to the tightest; the operators of one level associate to the left.
LEVELS = [{"OR"}, {"XOR"}, {"AND", "&"}, {"=", "<>"}, {"<", ">", "<=", ">="}, {"+", "-"}, {"*", "/", "MOD"}]
SECTIONS = {"VAR", "VAR_INPUT", "VAR_OUTPUT"}


Literal = namedtuple("Literal", "line type value")  # type None for an integer without one
Path = namedtuple("Path", "line name steps")  # a step is a str for a field, an expression for an index
Unary = namedtuple("Unary", "line operator operand")
Binary = namedtuple("Binary", "line operator left right")
Call = namedtuple("Call", "line name arguments")  # tuples (name or None, expression)

Assign = namedtuple("Assign", "line target value")
If = namedtuple("If", "line branches otherwise")  # branches of (condition, statements)
Case = namedtuple("Case", "line selector branches otherwise")  # branches of ([(line, low, high)], statements)
For = namedtuple("For", "line name first last step body")
While = namedtuple("While", "line condition body")
Jump = namedtuple("Jump", "line word")

NamedType = namedtuple("NamedType", "line name")
ArrayOf = namedtuple("ArrayOf", "line low high element")
StructOf = namedtuple("StructOf", "line fields")  # tuples (line, name, type)
TypeDeclaration = namedtuple("TypeDeclaration", "line name definition")
Variable = namedtuple("Variable", "line name section type initial")  # section also CONSTANT
Unit = namedtuple("Unit", "line kind name result variables body")  # a FUNCTION or a FUNCTION_BLOCK


class Parser:
    def __init__(self, text):
        self.tokens = tokens_of(text)
        self.position = 0
        self.names = []  # names as spelled in the declaration

    @property
    def next(self):
        return self.tokens[self.position]

    @property
    def line(self):
        return self.next.line

    def take(self):
        token = self.next
        self.position += 1
        return token

    def sees(self, *texts):
        return self.next.kind in ("symbol", "keyword") and self.next.text in texts

    def accept(self, *texts):
        return self.take() if self.sees(*texts) else None

    def expect(self, text):
        if not self.sees(text):
            # An element without its end is reported at its own line, not where the next line begins.
            line = self.tokens[self.position - 1].line if text == ";" and self.position else self.line
            raise StError(line, f"expected {text} before {self.next.spelled}")
        return self.take()

    def name(self):
        if self.next.kind != "name":
            raise StError(self.line, f"expected a name before {self.next.spelled}")
        if self.next.text in ABSENT:
            raise StError(self.line, f"{self.next.text} is not in this subset")
        return self.take().text

    def declared_name(self):
        check_name(self.next)
        self.names.append(self.next.spelled)
        return self.take().text

    def declarations(self):
        found = []
        while self.next.kind != "end":
            if self.accept("TYPE"):
                found += self.type_declarations()
            elif self.sees("FUNCTION", "FUNCTION_BLOCK"):
                found.append(self.unit())
            else:
                raise StError(self.line, f"expected TYPE, FUNCTION or FUNCTION_BLOCK before {self.next.spelled}")
        return found

    def type_declarations(self):
        found = []
        while not self.accept("END_TYPE"):
            line = self.line
            name = self.declared_name()
            self.expect(":")
            found.append(TypeDeclaration(line, name, self.struct() if self.sees("STRUCT") else self.type()))
            self.expect(";")
        if not found:
            raise StError(self.line, "TYPE declares nothing")
        return found

    def struct(self):
        line = self.take().line
        fields = []
        while not self.accept("END_STRUCT"):
            field_line = self.line
            name = self.declared_name()
            self.expect(":")
            fields.append((field_line, name, self.type()))
            self.expect(";")
        if not fields:
            raise StError(line, "STRUCT has no field")
        return StructOf(line, fields)

    def type(self):
        line = self.line
        if not self.accept("ARRAY"):
            return NamedType(line, self.name())
        self.expect("[")
        low = self.integer()
        self.expect("..")
        high = self.integer()
        self.expect("]")
        self.expect("OF")
        if low > high:
            raise StError(line, f"ARRAY[{low}..{high}] is empty")
        return ArrayOf(line, low, high, NamedType(self.line, self.name()))

    def integer(self):
        sign = -1 if self.accept("-") else 1
        if self.next.kind != "literal" or self.next.type:
            raise StError(self.line, f"expected an integer literal before {self.next.spelled}")
        return sign * self.take().value

    def unit(self):
        keyword = self.take()
        name = self.declared_name()
        result = None
        if keyword.text == "FUNCTION":
            self.expect(":")
            result = NamedType(self.line, self.name())
        variables = []
        while self.sees(*SECTIONS):
            variables += self.section()
        body = self.statements("END_" + keyword.text)
        self.expect("END_" + keyword.text)
        return Unit(keyword.line, keyword.text, name, result, variables, body)

    def section(self):
        keyword = self.take()
        section = keyword.text
        if self.sees("CONSTANT"):
            if section != "VAR":
                raise StError(self.line, f"{section} cannot be CONSTANT")
            section = self.take().text
        variables = []
        while not self.accept("END_VAR"):
            names = [(self.line, self.declared_name())]
            while self.accept(","):
                names.append((self.line, self.declared_name()))
            self.expect(":")
            kind = self.type()
            initial = self.initial() if self.accept(":=") else None
            self.expect(";")
            variables += [Variable(line, name, section, kind, initial) for line, name in names]
        return variables

    def initial(self):
        if not self.accept("["):
            return self.expression()
        values = [self.expression()]
        while self.accept(","):
            values.append(self.expression())
        self.expect("]")
        return values

    def statements(self, *ends):
        found = []
        while not self.sees(*ends):
            if self.accept(";"):
                continue
            found.append(self.statement())
            self.expect(";")
        return found

    def statement(self):
        token = self.next
        compound = {"IF": self.if_, "CASE": self.case, "FOR": self.for_, "WHILE": self.while_}
        if self.sees(*compound):
            self.take()
            return compound[token.text](token.line)
        if self.accept("RETURN", "EXIT"):
            return Jump(token.line, token.text)
        if token.kind != "name":
            raise StError(token.line, f"expected a statement before {token.spelled}")
        name = self.name()
        if self.sees("("):
            return self.call(token.line, name)
        target = self.path(token.line, name)
        self.expect(":=")
        return Assign(token.line, target, self.expression())

    def if_(self, line):
        branches = []
        while not branches or self.accept("ELSIF"):
            condition = self.expression()
            self.expect("THEN")
            branches.append((condition, self.statements("ELSIF", "ELSE", "END_IF")))
        otherwise = self.statements("END_IF") if self.accept("ELSE") else []
        self.expect("END_IF")
        return If(line, branches, otherwise)

    def case(self, line):
        selector = self.expression()
        self.expect("OF")
        branches = []
        while not branches or not self.sees("ELSE", "END_CASE"):
            labels = [self.label()]
            while self.accept(","):
                labels.append(self.label())
            self.expect(":")
            branches.append((labels, self.case_statements()))
        otherwise = self.statements("END_CASE") if self.accept("ELSE") else []
        self.expect("END_CASE")
        return Case(line, selector, branches, otherwise)

    def label(self):
        line = self.line
        low = self.integer()
        return line, low, self.integer() if self.accept("..") else low

    def case_statements(self):
        found = []
        while self.next.kind != "literal" and not self.sees("-", "ELSE", "END_CASE"):
            if not self.accept(";"):
                found.append(self.statement())
                self.expect(";")
        return found

    def for_(self, line):
        name = self.name()
        self.expect(":=")
        first = self.expression()
        self.expect("TO")
        last = self.expression()
        step = self.expression() if self.accept("BY") else Literal(line, None, 1)
        self.expect("DO")
        body = self.statements("END_FOR")
        self.expect("END_FOR")
        return For(line, name, first, last, step, body)

    def while_(self, line):
        condition = self.expression()
        self.expect("DO")
        body = self.statements("END_WHILE")
        self.expect("END_WHILE")
        return While(line, condition, body)

    def expression(self, level=0):
        if level == len(LEVELS):
            return self.unary()
        left = self.expression(level + 1)
        while operator := self.accept(*LEVELS[level]):
            left = Binary(operator.line, "AND" if operator.text == "&" else operator.text, left,
                          self.expression(level + 1))
        return left

    def unary(self):
        operator = self.accept("-", "NOT")
        return Unary(operator.line, operator.text, self.primary()) if operator else self.primary()

    def primary(self):
        line = self.line
        if self.accept("("):
            inner = self.expression()
            self.expect(")")
            return inner
        if self.next.kind == "literal":
            token = self.take()
            return Literal(line, token.type, token.value)
        if self.next.kind != "name":
            raise StError(line, f"expected an operand before {self.next.spelled}")
        name = self.name()
        return self.call(line, name) if self.sees("(") else self.path(line, name)

    def whole_path(self):
        path = self.path(self.line, self.name())
        if self.next.kind != "end":
            raise StError(self.line, f"unexpected {self.next.spelled} after a path")
        return path

    def path(self, line, name):
        steps = []
        while operator := self.accept(".", "["):
            if operator.text == "[":
                steps.append(self.expression())
                self.expect("]")
            elif self.next.kind == "literal":
                raise StError(operator.line, f"bit access .{self.next.spelled} differs between vendors")
            else:
                steps.append(self.name())
        return Path(line, name, steps)

    def call(self, line, name):
        self.expect("(")
        arguments = []
        while not self.sees(")"):
            if arguments:
                self.expect(",")
            formal = None
            if self.next.kind == "name" and self.tokens[self.position + 1].text == ":=":
                formal = self.name()
                self.take()
            arguments.append((formal, self.expression()))
        self.expect(")")
        return Call(line, name, arguments)
