#!/usr/bin/env python3
"""Who may include whom. A model that included a driver, or a driver that included a model, fails here."""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
ALLOWED = {  # folder: prefixes of our own headers that its files may include
    "config": ["config/"],
    "drivers": ["config/options.hpp", "config/names.hpp", "drivers/", "tactiled/layout.h"],
    "decoupling": ["config/options.hpp", "config/names.hpp", "config/calibration.hpp", "decoupling/", "tactiled/layout.h"],
    "node/include/tactiled": ["layout.h", "reader.h"],
    "node": ["config/", "drivers/", "decoupling/", "node/", "tactiled/"],
    "node/lab": ["config/", "drivers/", "decoupling/", "node/", "tactiled/"],
}
# The daemon and the program that operates it do without fits, charts and reports; these are in a program of their own.
FORBIDDEN = {"node": ["decoupling/fit/", "node/lab/"]}
ONLY_HERE = {"toml++": "config/", "Eigen/": "decoupling/", "ceres/": "decoupling/", "modbus": "node/modbus/"}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


def main():
    errors = []
    for path in sorted(ROOT.rglob("*")):
        name = path.relative_to(ROOT).as_posix()
        if path.suffix not in (".hpp", ".cpp", ".h", ".c") or name.startswith(("build", "tests/", ".")):
            continue
        folder = max((f for f in ALLOWED if name.startswith(f + "/")), key=len, default=None)
        if folder is None:
            errors.append(f"{name}: in no known folder")
            continue
        for number, line in enumerate(path.read_text().splitlines(), 1):
            found = INCLUDE.match(line)
            if not found:
                continue
            quote, header = found.groups()
            if quote == '"' and not any(header.startswith(a) for a in ALLOWED[folder]):
                errors.append(f"{name}:{number}: may not include {header}; allowed: {', '.join(ALLOWED[folder])}")
            if quote == '"' and any(header.startswith(f) for f in FORBIDDEN.get(folder, [])):
                errors.append(f"{name}:{number}: {header} belongs to the laboratory, node/lab")
            for library, home in ONLY_HERE.items():
                if quote == "<" and header.startswith(library) and not name.startswith(home):
                    errors.append(f"{name}:{number}: {header} belongs in {home}")
    print("\n".join(errors))
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
