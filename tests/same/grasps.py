"""Grasps of simulated jaws, from the estimators of both builds: each grasp with its weights, to the last bit, and statistics of slips
and faults. Needs `grasp_bench` in both folders."""
import subprocess

from same.outcome import compare_csv, differing_lines, first_difference

LOGS = (("log", "2", "1"), ("log", "2", "4711"))
TEXTS = (("slip", "100", "3"), ("faults", "4", "3"), ("transport", "0.02", "3"))


def compare(base, new, folder, pool, outcome):
    logs = outcome("grasp logs, cells")
    texts = outcome("slips, faults and transport: lines")
    runs = {(build, words): pool.submit(subprocess.run, [build / "grasp_bench", *words], capture_output=True, text=True)
            for words in (*LOGS, *TEXTS) for build in (base, new)}
    done = {key: run.result() for key, run in runs.items()}
    for words in LOGS:
        files = []
        for build in (base, new):
            files.append(folder / f"grasps-{'-'.join(words)}-{len(files)}.csv")
            files[-1].write_text(done[build, words].stdout or f"{done[build, words].stderr}\n")
        compare_csv(logs, *files, " ".join(words))
    for words in TEXTS:
        a, b = done[base, words].stdout, done[new, words].stdout
        lines, differ = differing_lines(a, b)
        texts.add(lines, differ, float("inf") if differ else 0, f"{' '.join(words)}: {first_difference(a, b)}" if a != b else "")
