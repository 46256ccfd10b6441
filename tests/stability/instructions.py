#!/usr/bin/env python3
"""Instructions of the worst hard reading beside an ordinary one, for every method: each sample of hard_readings counted by itself (callgrind).
Exit 1 where the worst is more than three times the ordinary one and the method's page states no bound of its own.

    instructions.py [path of hard_readings] [METHOD]
"""
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile

PROGRAM = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "build/release/bin/hard_readings").resolve()
METHODS = sys.argv[2:] or ("generic/matrix generic/quadratic generic/rbf generic/mlp table/linear table/signs table/nonlinear table/matrix "
                           "table/map hair/sum_diff hair/matrix hair/physics capacitive/quadratic capacitive/ratio capacitive/overlap "
                           "piezo/fused").split()
MOST = 3
STATED = {  # bounds that README.md states, in instructions
    "table/linear": 2000,  # looking for a dead gauge
    "table/matrix": 2200,  # likewise
    "table/map": 14e6,  # nine searches of the plate
    "capacitive/overlap": 2e5,  # eight steps over clipped edges
}


def samples(method):
    with tempfile.TemporaryDirectory() as folder:
        out = subprocess.run(["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/count", "--zero-before=one_sample",
                              "--dump-after=one_sample", "--combine-dumps=no", str(PROGRAM), method], capture_output=True, text=True, check=True)
        names = [line.split()[1] for line in out.stdout.splitlines()]
        files = sorted(pathlib.Path(folder).glob("count.*"), key=lambda path: int(path.suffix[1:]))[:len(names)]
        counts = [int(re.search(r"^(?:totals|summary): (\d+)", path.read_text(), re.M).group(1)) for path in files]
        return list(zip(names, counts, strict=True))


failed = False
print(f"{'':22}{'ordinary':>10}{'worst':>10}{'ratio':>8}  reading", flush=True)
for name in METHODS:
    counted = samples(name)
    easy = statistics.median(count for what, count in counted if what == "easy")
    worst, count = max(((what, count) for what, count in counted), key=lambda one: one[1])
    failed |= count > MOST * easy and count > STATED.get(name, 0)
    print(f"{name:22}{easy:10.0f}{count:10}{count / easy:8.2f}  {worst}", flush=True)
sys.exit(failed)
