#!/usr/bin/env python3
"""Instructions of StreamAge::judge() for a frame, by kind of proof, and of JumpCheck, QuietCheck, all checks and
the budget of a sample: the stream with the check less the same without.

    judge_instructions.py [path of stamps]          about 20 s
"""
import pathlib
import sys

import counted

STAMPS = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "build/release/bin/stamps").resolve()
SHORT, LONG = 20_000, 120_000


def a_frame(kind):
    return counted.a_step(lambda frames: [STAMPS, "--age", kind, frames], SHORT, LONG)


none = a_frame("none")
for name in ("clock", "sequence", "arrival", "cable, clock", "cable", "request"):
    print(f"{name + ':':14} {a_frame(name) - none:5.0f} instructions a frame", flush=True)
for name, program in (("jumps", "glitches"), ("noise", "quiet"), ("all", "monitors"), ("budget", "budget_costs")):
    check, bare = (counted.a_step(lambda samples: [STAMPS.parent / program, "--count", samples, *words], SHORT, LONG)
                   for words in ([], ["bare"]))
    print(f"{name + ':':14} {check - bare:5.0f} instructions a sample")
