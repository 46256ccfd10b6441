#!/usr/bin/env python3
"""campaign.py SECONDS TARGET...: what campaign.sh does once the targets are built. Exit status 1: a target found something in the
product, or did not find a bug that was put there."""
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import time
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = ROOT / "build/fuzz"
PLANT_S = 60  # in which a planted bug is to be found
MAX_S = 30  # for one input; 10 s without a processor were seen beside compilers, and taken for a find


def run(words, folder, profile="/dev/null", limit_s=None):
    """A fuzzer in `folder`, where it leaves what it finds: (its exit status, what it said)."""
    done = subprocess.run([str(w) for w in words], cwd=folder, capture_output=True, text=True, errors="replace", timeout=limit_s,
                          env=os.environ | {"LLVM_PROFILE_FILE": str(profile)})
    return done.returncode, done.stderr


class Target:
    def __init__(self, name, about):
        self.name, self.about = name, about
        self.program = BUILD / f"bin/fuzz_{name}"
        self.corpus = BUILD / "corpus" / name
        self.found = BUILD / "found" / name
        for folder in (self.corpus, self.found):
            folder.mkdir(parents=True, exist_ok=True)

    def words(self, program, corpus, *more):
        options = [f"-max_len={self.about['max_len']}", f"-timeout={MAX_S}", "-print_final_stats=1", *self.about.get("options", [])]
        return [program, *options, *more, corpus, BUILD / "seeds" / self.name]

    def fuzz(self, seconds):
        status, said = run(self.words(self.program, self.corpus, f"-max_total_time={seconds}"), self.found)
        if status != 0:
            print(f"{self.name}: {re.findall('SUMMARY.*|.*does not hold', said)}; the input is in {self.found}", file=sys.stderr)
        number = {key: int(value) for key, value in re.findall(r"stat::(\w+): +(\d+)", said)}
        return status == 0, number.get("number_of_executed_units", 0), number.get("average_exec_per_sec", 0)

    def coverage(self):
        """Branches of the parsers' files that the corpus takes, in percent of all."""
        raw, data = BUILD / f"coverage.{self.name}.raw", BUILD / f"coverage.{self.name}.data"
        run(self.words(self.program, self.corpus, "-runs=0"), self.found, raw)
        subprocess.run(["llvm-profdata-14", "merge", "-sparse", raw, "-o", data], check=True)
        said = subprocess.run(["llvm-cov-14", "export", "-summary-only", f"-instr-profile={data}", self.program], check=True,
                              capture_output=True, text=True).stdout
        wanted = {ROOT / file for file in self.about["parses"]}
        files = [file for file in json.loads(said)["data"][0]["files"] if pathlib.Path(file["filename"]).resolve() in wanted]
        count, covered = [sum(file["summary"]["branches"][key] for file in files) for key in ("count", "covered")]
        return 100 * covered / max(count, 1)

    def find(self, number, plant):
        """Seconds until the planted bug is found; None: not within PLANT_S."""
        folder = BUILD / "plants" / f"{self.name}{number}"
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "corpus").mkdir(parents=True)
        program = planted(self.name, plant, self.about["parses"], folder)
        began = time.monotonic()
        status, _ = run(self.words(program, folder / "corpus", f"-max_total_time={PLANT_S}", "-seed=1"), folder)
        took_s = time.monotonic() - began
        inputs = [file for file in folder.iterdir() if re.fullmatch(r".*-[0-9a-f]{40}", file.name)]
        # A finding that also occurs without the bug, or that cannot be repeated, is not the bug.
        fails = [bool(inputs) and run([p, f"-timeout={MAX_S}", *inputs], folder)[0] != 0 for p in (program, self.program)]
        if status != 0 and fails != [True, False]:
            print(f"{self.name}: bug {number}: fails with it and without it: {fails}; {inputs}", file=sys.stderr)
        return took_s if fails == [True, False] else None


def planted(name, plant, parses, folder):
    """The target with the bug: a copy of one file is compiled, or what takes it in, and takes the place of its objects."""
    original = ROOT / plant["file"]
    text = original.read_text()
    assert text.count(plant["is"]) == 1, f"targets.toml: {plant['file']} has {text.count(plant['is'])} times: {plant['is']}"
    copy = folder / plant["file"]
    copy.parent.mkdir(parents=True)
    if copy.suffix != ".cpp":  # its neighbours include each other without a path
        for file in original.parent.glob("*.h*"):
            shutil.copy(file, copy.parent)
    copy.write_text(text.replace(plant["is"], plant["becomes"]))

    # A header's bug is in each file that takes it in: the target itself and what it is about.
    sources = {original: copy} if copy.suffix == ".cpp" else {
        source: source for source in [HERE / f"{name}.cpp", *(ROOT / file for file in parses if file.endswith(".cpp"))]}
    commands = {entry["file"]: entry for entry in json.loads((BUILD / "compile_commands.json").read_text())}
    objects = {}
    for source, compiled in sources.items():
        words = shlex.split(commands[str(source)]["command"])
        objects[words[words.index("-o") + 1]] = words[words.index("-o") + 1] = str(folder / f"{source.stem}.o")
        words[words.index("-c") + 1] = str(compiled)
        if copy.suffix != ".cpp":
            at = next(i for i, word in enumerate(words) if word.startswith("-I"))
            words[at:at] = [f"-I{folder}", f"-I{folder}/node/include"]
        subprocess.run(words, cwd=BUILD, check=True, capture_output=True)

    asked = subprocess.run(["ninja", "-t", "commands", f"fuzz_{name}"], cwd=BUILD, check=True, capture_output=True, text=True).stdout
    link = asked.strip().splitlines()[-1].removeprefix(": && ").removesuffix(" && :")
    words = [word for word in shlex.split(link) if word not in objects]
    first = next(i for i, word in enumerate(words) if word.endswith(".o"))
    words[first:first] = objects.values()  # the linker takes the first of several definitions from one header
    words[words.index("-o") + 1] = str(folder / "program")
    subprocess.run(words, cwd=BUILD, check=True, capture_output=True)
    return folder / "program"


def main(seconds, names):
    about = tomllib.loads((HERE / "targets.toml").read_text())
    subprocess.run([HERE / "seeds.py", BUILD / "seeds"], check=True)
    good = True
    print("| target | inputs | a second | corpus | branches of | | bugs found, after s |\n|---|---|---|---|---|---|---|", flush=True)
    for name in names:
        target = Target(name, about[name])
        clean, inputs, rate = target.fuzz(seconds)
        good = clean and good
        times = [target.find(number, plant) for number, plant in enumerate(target.about["plants"])]
        good = good and None not in times
        files = " ".join(f"`{pathlib.Path(file).name}`" for file in target.about["parses"])
        found = [f"{t:.0f}" if t is not None else "**none**" for t in times]
        print(f"| `{name}` | {inputs:,} | {rate:,} | {len(list(target.corpus.iterdir()))} | {files} | {target.coverage():.0f} % | "
              f"{len(times) - times.count(None)} of {len(times)}{': ' if found else ''}{', '.join(found)} |", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2:]))
