"""Comments, strings and code of a source file, with their lines; for language_check.py and include_directions.py."""
import ast
import io
import os
import re
import tokenize

# Raw strings first: their text may hold quotes and comment marks. A quote after a letter or digit is a digit separator.
CPP = re.compile(
    r'R"(?P<fence>[^(\s"]*)\(.*?\)(?P=fence)"|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])+\'|//[^\n]*|/\*.*?\*/', re.DOTALL)
HASH = re.compile(r'"""(?:\\.|[^\\])*?"""|"(?:\\.|[^"\\])*"|\'[^\']*\'|(?:(?<=\s)|^)#[^\n]*', re.DOTALL | re.MULTILINE)
TOML = re.compile(r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*', re.DOTALL)
HASH_KEEPS_LINE = re.compile(r"#[^\n]*")


def source_files(root, suffixes):
    """Files below root, sorted, without what a build, git or Python made. Works without git."""
    for folder, below, names in os.walk(root):
        below[:] = sorted(d for d in below if not d.startswith(("build", "__pycache__", "node_modules"))
                          and (not d.startswith(".") or d == ".ci"))
        for name in sorted(names):
            path = os.path.join(folder, name)
            if not os.path.islink(path) and (os.path.splitext(name)[1] in suffixes or name in suffixes):
                yield path


def comments(text, pattern):
    """(line, column, whether code stands before it, comment with its mark) of each comment that `pattern` finds."""
    for found in pattern.finditer(text):
        word = found.group()
        if not word.startswith(("//", "/*", "#")):
            continue
        start = text.rfind("\n", 0, found.start()) + 1
        yield (text.count("\n", 0, found.start()) + 1, found.start() - start,
               not text[start:found.start()].isspace() and found.start() != start, word)


def python_comments(text):
    """The same tuples as comments() gives; a docstring is a comment that begins with three quotes."""
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            line, column = token.start
            yield line, column, bool(lines[line - 1][:column].strip()), token.string
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and ast.get_docstring(node):
            first = node.body[0]
            yield first.lineno, 0, False, '"""' + first.value.value


def code_with_strings(text):
    """C++ code without its comments; the lines stay where they were."""
    def blank(found):
        word = found.group()
        return "\n" * word.count("\n") + " " if word.startswith(("//", "/*")) else word
    return CPP.sub(blank, text)
