#!/usr/bin/env python3
"""The directions of includes and of names, and the one place of the verdict. A model that includes a driver fails here, and so does code that compares with the
name of a driver, chip, serial format, model, method or fit outside that name's own files (entry_names.py). Code that chooses
a quality instead of computing it from reasons fails, too."""
import pathlib
import re
import sys

import entry_names

ROOT = pathlib.Path(__file__).resolve().parent.parent
ALLOWED = {  # folder: prefixes of our own headers that its files may include
    "config": ["config/"],
    "drivers": ["config/options.hpp", "config/registry.hpp", "config/names.hpp", "drivers/", "tactiled/layout.h"],
    "decoupling": ["config/options.hpp", "config/registry.hpp", "config/names.hpp", "config/calibration.hpp", "drivers/taxels.hpp", "decoupling/",
                   "tactiled/layout.h", "tactiled/uncertainty.h"],
    "node/include/tactiled": ["folder.h", "layout.h", "mapping.h", "reader.h", "uncertainty.h"],
    "node": ["config/", "drivers/", "decoupling/", "node/", "tactiled/"],
    "node/lab": ["config/", "drivers/", "decoupling/", "node/", "tactiled/"],
}
# The daemon and the program that operates it do without fits, charts and reports; these are in a program of their own.
FORBIDDEN = {"node": ["decoupling/fit/", "node/lab/"]}
ONLY_HERE = {"toml++": "config/", "Eigen/": "decoupling/", "ceres/": "decoupling/", "modbus": "node/modbus/"}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
# file: (names that it may compare with although other files own them, why). An exception that is not needed is an error.
EXCEPTIONS = {
    "decoupling/fit/columns.cpp": ("tcp", "a word of robots for the centre point of their tool, in names of columns"),
    "drivers/sim/sensor.cpp": ("table hair capacitive",
                               "the simulator's sensors carry the models' names and share no code with the models"),
    "node/lab/simulate_text.cpp": ("table hair capacitive", "prints the names of the simulator's sensors, as above"),
    "node/lab/tradeoff_plan.cpp": ("table hair capacitive piezo generic linear signs matrix map nonlinear sum_diff physics quadratic "
                                   "ratio overlap fused rbf mlp", "the plan of a study: which scene calibrates and judges which method"),
}
MAX_EXCEPTIONS = 10
VERDICT = "node/include/tactiled/layout.h"  # the only file that chooses a quality; BAD is safe
QUALITY_WRITTEN = re.compile(r"\b\w*quality\w*(?:\[\w+\])?\s*(?:=(?!=)|\{)\s*([^;]*)")
QUALITY_COPIED = re.compile(r"\bquality|verdict\(")  # from another value, or computed


def sources(root):
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root).as_posix()
        if path.suffix in (".hpp", ".cpp", ".h", ".c") and not name.startswith(("build", "tests/", ".")):
            yield name


def include_errors(root):
    for name in sources(root):
        folder = max((f for f in ALLOWED if name.startswith(f + "/")), key=len, default=None)
        if folder is None:
            yield f"{name}: in no known folder"
            continue
        for number, line in enumerate((root / name).read_text().splitlines(), 1):
            found = INCLUDE.match(line)
            if not found:
                continue
            quote, header = found.groups()
            if quote == '"' and not any(header.startswith(a) for a in ALLOWED[folder]):
                yield f"{name}:{number}: may not include {header}; allowed: {', '.join(ALLOWED[folder])}"
            if quote == '"' and any(header.startswith(f) for f in FORBIDDEN.get(folder, [])):
                yield f"{name}:{number}: {header} belongs to the laboratory, node/lab"
            for library, home in ONLY_HERE.items():
                if quote == "<" and header.startswith(library) and not name.startswith(home):
                    yield f"{name}:{number}: {header} belongs in {home}"


def name_errors(root, exceptions):
    found, errors = entry_names.comparisons(root, list(sources(root)))
    yield from errors
    if len(exceptions) > MAX_EXCEPTIONS:
        yield f"tests/include_directions.py: {len(exceptions)} exceptions, at most {MAX_EXCEPTIONS} are allowed"
    excepted = {(file, name) for file, (names, _) in exceptions.items() for name in names.split()}
    for file, line, name, kinds, use in found:
        if (file, name) not in excepted:
            yield f'{file}:{line}: "{name}" {use}, the name of a {kinds} that other files own'
    for file, name in sorted(excepted - {(f[0], f[2]) for f in found}):
        yield f'tests/include_directions.py: the exception for "{name}" in {file} is no longer needed'


def quality_errors(root):
    for name in sources(root):
        for number, line in enumerate((root / name).read_text().splitlines(), 1):
            found = QUALITY_WRITTEN.search(line.split("//")[0])
            chosen = found and re.search(r"TACTILED_(GOOD|UNCERTAIN)\b", found[1])
            if name != VERDICT and chosen and not QUALITY_COPIED.search(found[1]):
                yield f"{name}:{number}: chooses a quality; add a reason, and tactiled_verdict() computes it ({VERDICT})"


def main(root=ROOT, exceptions=None):
    root = pathlib.Path(root)
    errors = [*include_errors(root), *name_errors(root, EXCEPTIONS if exceptions is None else exceptions),
              *quality_errors(root)]
    print("\n".join(errors))
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
