"""Code that compares with a driver's, chip's, serial format's, model's or method's name outside that name's own files.

The names are harvested from the entry objects. A name's own files are the file of its entry, the files beside it that carry
the same stem (can.cpp: can_plan.cpp), and the folder that carries the name (decoupling/hair).
"""
import os
import pathlib
import re

from source_text import code_with_strings

# Type of an entry object: the kind of each string that names it, in the order in which they stand.
ENTRIES = {
    "DriverEntry": ["driver"],
    "ChipEntry": ["chip"],
    "StreamFormat": ["format"],
    "MethodEntry": ["model", "method"],
    "FitEntry": ["model", "fit"],
}
# Fewer names than these mean that the entries look otherwise than ENTRIES and objects() say.
AT_LEAST = {"driver": 7, "chip": 6, "format": 5, "model": 5, "method": 12, "fit": 12}

TOKEN = re.compile(r'R"(?P<fence>[^(\s"]*)\(.*?\)(?P=fence)"|"(?:\\.|[^"\\\n])*"|[A-Za-z_]\w*|==|!=|->|::|[^\s\w]|\d[\w.\']*', re.DOTALL)
SEARCHES = re.compile(r"^(?:compare|find\w*|rfind|starts_with|ends_with|contains|count|equal\w*|\w*cmp|lookup|method_is|model_is|is_\w+)$")
STRING_TYPES = {"string", "string_view", "std", "::", "(", "{"}
OPEN, CLOSE = {"(": ")", "[": "]", "{": "}"}, {")", "]", "}"}
# An operand or receiver of one of these names holds no driver, chip, format, model or method.
OTHER_THINGS = {"verb", "command", "channel", "channels", "channel_names", "column", "columns", "key", "keys", "parameter", "parameters",
                "tables", "component", "effect", "unit"}
# Objects of these types and names (or kNames) list other things that may have the same word for a name.
OTHER_LISTS = {"CostEntry", "Verb", "ordered_json", "json", "channels", "columns", "keys", "parameters", "tables", "effects"}
# Keys of a configuration whose choices are names of entries: one_of("format", {"cobs", ...}) lists formats, one_of("course", ...) not.
KEYS_OF_NAMES = {"driver", "chip", "format", "model", "method", "fit"}


class Token:
    def __init__(self, text, line):
        self.text, self.line = text, line
        self.inside = None  # index of the bracket around it

    @property
    def name(self):
        """The text of a string literal, else None."""
        return self.text[1:-1] if self.text.startswith('"') else self.text[3:-2] if self.text.startswith('R"(') else None


def tokens_of(code):
    tokens, open_brackets, line, place = [], [], 1, 0
    for found in TOKEN.finditer(code):
        line += code.count("\n", place, found.start())
        place = found.start()
        token = Token(found.group(), line)
        if token.text in CLOSE and open_brackets:
            open_brackets.pop()
        token.inside = open_brackets[-1] if open_brackets else None
        if token.text in OPEN:
            open_brackets.append(len(tokens))
        tokens.append(token)
    return tokens


def text(tokens, index):  # "" outside
    return tokens[index].text if 0 <= index < len(tokens) else ""


def is_word(word):
    return bool(re.match(r"[A-Za-z_]", word)) and not word.startswith(('R"', "L\""))


def objects(tokens):
    """(type, index of the opening bracket, whether an array) of each entry object."""
    for i, token in enumerate(tokens):
        if token.text not in ENTRIES or text(tokens, i - 1) in ("struct", "class", "::", "~"):
            continue
        j = i + 1
        while text(tokens, j) in ("<", ">") or (text(tokens, j - 1) == "<" and is_word(text(tokens, j))):
            j += 1
        if is_word(text(tokens, j)):
            j += 1
        array = text(tokens, j) == "["
        while text(tokens, j) in ("[", "]", "=") or (text(tokens, j - 1) == "[" and is_word(text(tokens, j))):
            j += 1
        if text(tokens, j) in ("{", "("):
            yield token.text, j, array


FIELD = {"model": "model", "method": "method", "fit": "method"}  # a kind without an entry has the field "name"


def names_of(tokens, bracket, kinds):
    """The names of one entry object, or fewer than kinds where they are no string literals."""
    if text(tokens, bracket + 1) != ".":
        return list(strings_in(tokens, bracket))
    fields = {text(tokens, i + 1): tokens[i + 3].name for i in range(bracket + 1, len(tokens) - 3)
              if tokens[i].text == "." and tokens[i].inside == bracket and text(tokens, i + 2) == "="}
    return [name for kind in kinds if (name := fields.get(FIELD.get(kind, "name"))) is not None]


def strings_in(tokens, bracket):
    """String literals between the brackets, but none of inner brackets."""
    for i in range(bracket + 1, len(tokens)):
        around = tokens[i].inside
        if around is None or around < bracket:
            return
        if tokens[i].name is not None and around == bracket:
            yield tokens[i].name


def harvest(files):
    """[(kind, name, file)], errors. files: {name: tokens}."""
    names, errors = [], []
    for file, tokens in files.items():
        for entry_type, bracket, array in objects(tokens) if file.endswith(".cpp") else ():
            kinds = ENTRIES[entry_type]
            rows = [i for i, t in enumerate(tokens) if t.text == "{" and t.inside == bracket] if array else [bracket]
            for row in rows:
                strings = names_of(tokens, row, kinds)
                if len(strings) < len(kinds):
                    if strings or text(tokens, row) == "{":
                        errors.append(f"{file}:{tokens[row].line}: no name as a string literal in this {entry_type}")
                    continue
                names += [(kind, name, file) for kind, name in zip(kinds, strings)]
    for kind, least in AT_LEAST.items():
        found = {name for k, name, _ in names if k == kind}
        if len(found) < least:
            errors.append(f"tests/entry_names.py: {len(found)} names of kind {kind} were found ({', '.join(sorted(found))}), at least "
                          f"{least} are expected: adapt ENTRIES to the entry objects")
    return names, errors


def own_file(file, owner, name):
    folder, stem = os.path.dirname(owner), os.path.splitext(os.path.basename(owner))[0]
    if file == owner or (os.path.dirname(file) == folder and os.path.basename(file).startswith((stem + "_", stem + "."))):
        return True
    parts = owner.split("/")[:-1]
    return name in parts[1:] and file.startswith("/".join(parts[:parts.index(name, 1) + 1]) + "/")


def operand(tokens, i, step):
    """The last name of the expression that ends (step -1) or begins (step 1) at i: `link.driver`, `std::string_view(x.method())`."""
    word, depth = "", 0
    while 0 <= i < len(tokens):
        t = tokens[i].text
        if t in (CLOSE if step < 0 else OPEN):
            depth += 1
        elif t in (OPEN if step < 0 else CLOSE):
            depth -= 1
            if depth < 0:
                break
        elif depth == 0 and is_word(t):
            word = t
            if step < 0:
                break
        elif depth == 0 and t not in (".", "->", "::", "*", "&"):
            break
        i += step
    return word


def use(tokens, i):
    """Describes a comparison with the string literal at i; None where the code does another thing with it."""
    before, after = i - 1, i + 1
    while text(tokens, before) in STRING_TYPES and (text(tokens, before) not in "({" or text(tokens, before - 1) in STRING_TYPES - {"(", "{"}):
        before -= 1  # std::string_view("name")
    while text(tokens, after) in ("s", "sv") or (before < i - 1 and text(tokens, after) in CLOSE):
        after += 1
    if text(tokens, before) in ("==", "!="):
        return None if operand(tokens, before - 1, -1) in OTHER_THINGS else "compares"
    if text(tokens, after) in ("==", "!="):
        return None if operand(tokens, after + 1, 1) in OTHER_THINGS else "compares"
    if "case" in (text(tokens, k) for k in range(max(0, i - 6), i)) and ":" in (text(tokens, k) for k in range(i, i + 4)):
        return "is a case"
    around = tokens[i].inside
    if text(tokens, i - 1) in ("=", "{") and is_word(text(tokens, i - 2)) and text(tokens, i - 2).startswith("k") and text(tokens, i + 1) in (";", "}"):
        return "is a constant"
    if around is None:
        return None
    callee = text(tokens, around - 1)
    if tokens[around].text == "(" and SEARCHES.match(callee):
        return None if operand(tokens, around - 3, -1) in OTHER_THINGS else f"is an argument of {callee}()"
    if tokens[around].text == "{" and text(tokens, i - 1) in ("{", ","):
        key = tokens[around - 2].name if text(tokens, around - 1) == "," and around > 1 else None
        other = key is not None and key not in KEYS_OF_NAMES and text(tokens, around - 3) == "("
        return None if other or any(not OTHER_LISTS.isdisjoint((w, w[1:].lower())) for w in header(tokens, around)) else "is in a list"
    if tokens[around].text == "[" and text(tokens, i - 1) == "[" and text(tokens, i + 1) == "]":
        return None if operand(tokens, around - 1, -1) in OTHER_THINGS else "is an index"
    return None


def header(tokens, bracket):
    """Words of the statement before an initializer list, and before those around it."""
    words = []
    while bracket is not None:
        i = bracket - 1
        while i >= 0 and text(tokens, i) not in (";", "{", "}", ")", ","):
            words.append(text(tokens, i))
            i -= 1
        bracket = tokens[bracket].inside
    return words


def comparisons(root, file_names):
    """[(file, line, name, kinds, use)] outside of the names' own files, and errors of the harvest."""
    files = {f: tokens_of(code_with_strings(pathlib.Path(root, f).read_text())) for f in file_names}
    names, errors = harvest(files)
    owners = {}
    for kind, name, file in names:
        owners.setdefault(name, []).append((kind, file))
    found = []
    for file, tokens in files.items():
        for i, token in enumerate(tokens):
            name = token.name
            if name in owners and not any(own_file(file, owner, name) for _, owner in owners[name]) and (how := use(tokens, i)):
                found.append((file, token.line, name, "/".join(sorted({kind for kind, _ in owners[name]})), how))
    return found, errors
