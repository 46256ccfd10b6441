"""Calibrations and forces of two builds: the same labelled rows and the same signals through both tactilectl."""
import csv
import lzma
import pathlib
import re
import subprocess
import sys
import tomllib

import run as scenes  # tests/scenes/run.py
from simulated_sensors import SENSORS
from same.outcome import compare_csv, first_difference

ROOT = pathlib.Path(__file__).resolve().parents[2]
METHODS = {
    "generic": ("matrix", "quadratic", "rbf", "mlp"),
    "table": ("linear", "signs", "matrix", "map", "nonlinear"),
    "hair": ("sum_diff", "matrix", "physics"),
    "capacitive": ("quadratic", "ratio", "overlap"),
    "piezo": ("fused",),
}
NOT_FITTED = {("table", "signs")}
MAX_ROWS = 3000      # rows of one scene's signals
MAX_FIT_ROWS = 1000  # rows of one scene's labelled file
HARD_CELLS = ("", "1e300", "-1e300", "0", "-0", "4.9e-324", "1e-300", "nan")


def ctl(build, *words):
    return subprocess.run([build / "tactilectl", *map(str, words)], capture_output=True, text=True)


def thin(labelled, remembers):
    """Fewer rows, so that every fit takes seconds at most; a model with a memory needs those that it keeps one after the other."""
    first, *rows = labelled.read_text().splitlines(keepends=True)
    rows = rows[:MAX_FIT_ROWS * 8] if remembers else rows[::len(rows) // MAX_FIT_ROWS + 1]
    labelled.write_text(first + "".join(rows))


class Calibrations:
    """The fits, as words of `tactilectl calibrate` without --out, and the files that base makes of them."""

    def __init__(self, base, folder):
        self.base, self.folder, self.jobs = base, folder, {}

    def simulated_sensors(self):
        for name, kind in SENSORS.items():
            for method in kind.methods:
                if method in kind.fitted_as:
                    continue
                sensor = kind()
                sensor.begin(method)
                labelled = self.folder / f"{name}-{method}.csv"
                sensor.write_labelled(labelled)
                self.jobs[labelled.stem] = ["--model", sensor.model, "--method", method, "--channel-unit", sensor.channel_unit,
                                            "--in", labelled, *sensor.calibrate_words()]
        self.jobs["skin-forget"] = [*self.jobs["skin-matrix"], "--forget", "0.999"]

    def recorded_data(self):
        data = ROOT / "tests/data/eflesh"
        shear = self.folder / "shear.csv"
        shear.write_bytes(lzma.decompress((data / "shear_labelled.csv.xz").read_bytes()))
        # Every fourth row of one session for the slow fits.
        few = self.folder / "normal_few.csv"
        lines = (data / "normal_labelled.csv").read_text().splitlines(keepends=True)
        few.write_text(lines[0] + "".join(line for line in lines[1::4] if line.rstrip().endswith(",1")))
        for method in ("matrix", "quadratic"):
            self.jobs[f"normal-{method}"] = ["--model", "generic", "--method", method, "--in", data / "normal_labelled.csv", "--session", "1"]
            self.jobs[f"shear-{method}"] = ["--model", "generic", "--method", method, "--in", shear]
        for method in ("rbf", "mlp"):
            self.jobs[f"normal-{method}"] = ["--model", "generic", "--method", method, "--in", few]

    def scenes(self, pattern="*calibrate*.toml"):
        def take(*words):  # in place of run.run_ctl: simulates with base, keeps the words of the fit
            if words[0] != "calibrate":
                done = ctl(self.base, *words)
                assert done.returncode == 0, done.stderr
                return
            thin(words[words.index("--in") + 1], words[2] == "piezo")
            at = words.index("--out")
            self.jobs[words[at + 1].stem] = [*words[1:at], *words[at + 2:]]
        scenes.run_ctl = take
        for path in sorted((ROOT / "config/scenes").glob(pattern)):
            toml = tomllib.loads(path.read_text())
            model = toml.get("calibrate", {}).get("model", toml["sensor"][0]["model"])
            for method in METHODS[model]:
                if (model, method) not in NOT_FITTED:
                    scenes.calibrate(path, method, self.folder / f"{path.stem}-{method}.toml")

    def compare(self, new, pool, fits, messages):
        """Returns {name: calibration file of base}."""
        self.simulated_sensors()
        self.recorded_data()
        self.scenes()
        made = {p.stem: p for p in sorted((ROOT / "config/calibration").glob("*.toml"))}
        runs = {}
        for name, words in sorted(self.jobs.items(), key=lambda job: "auto" not in job[0] and "mlp" not in job[0]):
            outs = [self.folder / f"{name}.{k}.toml" for k in ("base", "new")]
            runs[name] = outs, [pool.submit(ctl, build, "calibrate", *words, "--out", out) for build, out in zip((self.base, new), outs)]
        for name, (outs, (base_run, new_run)) in runs.items():
            a, b = base_run.result(), new_run.result()
            fits.equal(a.returncode, b.returncode, f"{name}: exit status")
            messages.equal(*(re.sub(r"\.(base|new)\.toml", ".toml", r.stdout + r.stderr) for r in (a, b)), name)
            if a.returncode == b.returncode == 0:
                texts = [re.sub(r'^date = .*\n', "", out.read_text(), flags=re.MULTILINE) for out in outs]
                lines = texts[0].count("\n")
                if texts[0] == texts[1]:
                    fits.add(lines)
                else:
                    fits.add(lines, 1, float("inf"), f"{name}: {first_difference(*texts)}")
                made[name] = outs[0]
        return made


class Signals:
    """One file for all scenes with the same channels, one behind the other in time; the demo's and the labelled ones."""

    def __init__(self, base, folder):
        self.base, self.folder, self.rows = base, folder, {}

    def add(self, fields, rows):
        """Splits the columns of several sensors (jaw1.H1) and appends them."""
        prefixes = sorted({f.rpartition(".")[0] for f in fields[1:]})
        for prefix in {prefixes[0], prefixes[-1]}:
            columns = [k for k, f in enumerate(fields) if k and f.rpartition(".")[0] == prefix]
            names = tuple(fields[k].rpartition(".")[2] for k in columns)
            kept = self.rows.setdefault(names, [])
            from_s = float(kept[-1][0]) + 1 if kept else 0
            begin_s = float(rows[0][0])
            kept += [[repr(from_s + float(row[0]) - begin_s), *(row[k] for k in columns)] for row in rows[:MAX_ROWS]]

    def collect(self, pool):
        # An array of taxels has no channels, and no signals.csv.
        paths = [p for p in sorted((ROOT / "config/scenes").glob("*.toml")) if not any("taxels" in s for s in tomllib.loads(p.read_text())["sensor"])]
        outs = [self.folder / f"{path.stem}.signals.csv" for path in paths]
        done = list(pool.map(lambda p, o: ctl(self.base, "simulate", "--scene", p, "--effects", "all", "--out", o), paths, outs))
        for path, run in zip(paths, done):
            assert run.returncode == 0, f"{path}: {run.stderr}"
        more = [*sorted((ROOT / "config/demo").glob("*.csv")), ROOT / "tests/data/eflesh/normal_labelled.csv", *sorted(self.folder.glob("*-*.csv"))]
        for path in [*outs, *more]:
            with open(path) as file:
                fields, *rows = csv.reader(file)
            keep = [k for k, f in enumerate(fields) if not f.endswith(("_N", "_Nm")) and f != "session"]
            self.add([fields[k] for k in keep], [[row[k] for k in keep] for row in rows])
        return self.files()

    def files(self):
        """[(channels, file, words)]: as it is, and with impossible readings and saturation limits."""
        made = []
        for names, rows in self.rows.items():
            plain, hard = (self.folder / f"signals{len(made)}{kind}.csv" for kind in ("", "hard"))
            broken = [list(row) for row in rows]
            for k in range(0, len(broken), 7):
                broken[k][1 + k % len(names)] = HARD_CELLS[k // 7 % len(HARD_CELLS)]
            for path, some in ((plain, rows), (hard, broken)):
                with open(path, "w", newline="") as file:
                    csv.writer(file, lineterminator="\n").writerows([["t_s", *names], *some])
            top = max(abs(float(row[1])) for row in rows)
            made += [(set(names), plain, []), (set(names), hard, ["--saturates-above", top / 2, "--saturates-below", -top / 2])]
        return made


def compare_forces(base, new, folder, pool, calibrations, signals, forces, messages):
    def both(job):
        number, name, calibration, method, path, words = job
        outs = [folder / f"forces{number}.{k}.csv" for k in ("base", "new")]
        done = [ctl(build, "decouple", "--calibration", calibration, "--method", method, "--in", path, "--out", out, *words)
                for build, out in zip((base, new), outs)]
        return f"{name} {method} {path.name}", outs, done

    jobs = []
    for name, calibration in calibrations.items():
        toml = tomllib.loads(calibration.read_text())
        jobs += [(name, calibration, method, path, words) for method in METHODS.get(toml["model"], ())  # an array has no columns
                 for names, path, words in signals if set(toml["channels"]) <= names]
    seen = set()
    for name, outs, done in pool.map(both, ((k, *job) for k, job in enumerate(jobs))):
        forces.equal(done[0].returncode, done[1].returncode, f"{name}: exit status")
        messages.equal(done[0].stderr, done[1].stderr, name)
        if done[0].returncode == done[1].returncode == 0:
            compare_csv(forces, *outs, name)
            seen.add(name.split()[1])
        for out in outs:
            out.unlink(missing_ok=True)
    missing = {m for methods in METHODS.values() for m in methods} - seen
    if missing:
        sys.exit(f"same_results.py: no signal went through {' '.join(sorted(missing))}")
