#!/usr/bin/env python3
"""Calibrates on recordings given in the ways of users, and judges each calibration on rows that it was not given.

    calibration_ways.py [--data tests/data] [--sets skin,cross,shear,tongs,...] [--ways whole,rows100,...] [--methods matrix,...]

sets     skin (both sessions of the magnetic skin, press), cross (its session 1, judged on session 2), back (the reverse), shear,
         tongs, cell (40 rows of a load cell)
ways     see WAYS
Every fifth of 25 stretches of time is held out (tongs: the maker's test rows; cross, back: the other session). The
judgement takes their GOOD rows: share within 1 sd (at least 60 %), beyond 5 sd (at most 3 %); after a tare, where the
sessions have zeros of their own. "!" marks a miss. A refusal is printed with its text.
"""
import argparse
import json
import math
import pathlib
import random
import subprocess
import tempfile
import time

from real_data import COMPONENTS, DATA, ROOT, number, rows_of, write

GIVEN = None


def compressed(path):
    return path if path.exists() else path.with_suffix(path.suffix + ".xz")


def stretches(rows, every=5, number_of=25):
    held = [r for i, r in enumerate(rows) if (i * number_of // len(rows)) % every == every - 1]
    return [r for i, r in enumerate(rows) if (i * number_of // len(rows)) % every != every - 1], held


def labelled(rows):
    labels = [c for c in COMPONENTS if c in rows[0]]
    return [r for r in rows if any(r[c] for c in labels)]


def sets():
    normal = labelled(rows_of(DATA / "eflesh/normal_labelled.csv"))
    one, two = [r for r in normal if r["session"] == "1"], [r for r in normal if r["session"] == "2"]
    shear = labelled(rows_of(compressed(DATA / "eflesh/shear_labelled.csv")))
    first, second = stretches(one), stretches(two)
    tongs = rows_of(compressed(DATA / "tongs/train_labelled.csv")), rows_of(compressed(DATA / "tongs/test_labelled.csv"))
    cell = [{"deflection": r["deflection"], "fz_N": repr(-number(r["load"]) / 1e4)} for r in rows_of(DATA / "pontius/pontius.csv")]
    return {"skin": (first[0] + second[0], first[1] + second[1]), "cross": (one, two), "back": (two, one), "shear": stretches(shear),
            "tongs": tongs, "cell": ([r for i, r in enumerate(cell) if i % 4 != 3], [r for i, r in enumerate(cell) if i % 4 == 3])}


def evenly(rows, n):
    return [rows[i * len(rows) // n] for i in range(min(n, len(rows)))]


def without(rows, *columns):
    return [{k: v for k, v in r.items() if k not in columns} for r in rows]


def with_labels(rows, change):
    return [{k: repr(change(k, float(v))) if k in COMPONENTS and v else v for k, v in r.items()} for r in rows]


def shuffled(rows, seed=1):
    rows = list(rows)
    random.Random(seed).shuffle(rows)
    return rows


def channels_of(rows):
    return [c for c in rows[0] if c not in (*COMPONENTS, "t_s", "session")]


def with_gaps(rows, text, share=0.02, seed=2):
    rng, result = random.Random(seed), []
    for r in rows:
        r = dict(r)
        for c in (*channels_of(rows), *COMPONENTS):
            if c in r and rng.random() < share:
                r[c] = text
        result.append(r)
    return result


def widened(rows, n=32, seed=3):
    """Combinations of neighbouring channels with noise, up to n channels."""
    names, rng, result = channels_of(rows), random.Random(seed), []
    spread = {c: max(number(r[c]) for r in rows) - min(number(r[c]) for r in rows) for c in names}
    for r in rows:
        more = {}
        for i in range(n - len(names)):
            a, b = names[i % len(names)], names[(i + 1) % len(names)]
            more[f"extra{i}"] = repr(0.7 * number(r[a]) + 0.5 * number(r[b]) + 0.005 * spread[a] * rng.gauss(0, 1))
        result.append({**r, **more})
    return result


def swapped(rows, share=0.01, seed=4):
    rows, labels = [dict(r) for r in rows], [c for c in COMPONENTS if c in rows[0]]
    chosen = random.Random(seed).sample(range(len(rows)), int(share * len(rows)) // 2 * 2)
    for a, b in zip(chosen[::2], chosen[1::2]):
        for label in labels:
            rows[a][label], rows[b][label] = rows[b][label], rows[a][label]
    return rows


def channels_changed(rows, change, only=lambda row: True):
    """change(channel's number, value, its least, its width) for each row that is chosen."""
    names = channels_of(rows)
    least = {c: min(number(r[c]) for r in rows) for c in names}
    width = {c: max(number(r[c]) for r in rows) - least[c] for c in names}
    return [{**r, **{c: repr(change(k, number(r[c]), least[c], width[c])) for k, c in enumerate(names)}} if only(r) else r
            for r in rows]


def in_sessions(rows):
    """In two sessions, halves of the time, if there are none."""
    if "session" in rows[0]:
        return rows
    return [{**r, "session": str(1 + (i >= len(rows) // 2))} for i, r in enumerate(rows)]


def second(row):
    return row["session"] == "2"


def standardised(rows, only=lambda row: True):
    names, some = channels_of(rows), [r for r in rows if only(r)]
    mean = {c: sum(number(r[c]) for r in some) / len(some) for c in names}
    sd = {c: math.sqrt(sum((number(r[c]) - mean[c]) ** 2 for r in some) / len(some)) for c in names}
    return [{**r, **{c: repr((number(r[c]) - mean[c]) / sd[c]) for c in names}} if only(r) else r for r in rows]


def turned(rows):
    """In its second session the sensor is mounted with another order of channels and another zero."""
    names = channels_of(rows)
    return [{**r, **{c: repr(number(r[names[(k + 3) % len(names)]]) + 5) for k, c in enumerate(names)}} if second(r) else r for r in rows]


# way: (change of the rows to calibrate on, change of the rows to judge by)
WAYS = {
    "whole": (lambda rows: rows, None),
    "rows1000": (lambda rows: evenly(rows, 1000), None),
    "rows300": (lambda rows: evenly(rows, 300), None),
    "rows100": (lambda rows: evenly(rows, 100), None),
    "rows60": (lambda rows: evenly(rows, 60), None),
    "first100": (lambda rows: rows[:100], None),
    "random100": (lambda rows: shuffled(rows)[:100], None),
    "shuffled": (shuffled, None),
    "shuffled_no_t": (lambda rows: without(shuffled(rows), "t_s"), None),
    "shuffled_bare": (lambda rows: without(shuffled(rows), "t_s", "session"), lambda rows: without(rows, "session")),
    "no_t": (lambda rows: without(rows, "t_s"), None),
    "no_session": (lambda rows: without(rows, "session"), lambda rows: without(rows, "session")),
    "mN": (lambda rows: with_labels(rows, lambda c, v: 1000 * v), lambda rows: with_labels(rows, lambda c, v: 1000 * v)),
    "one_axis": (lambda rows: without(rows, *[c for c in COMPONENTS if c in rows[0]][1:]), None),
    "constant": (lambda rows: [{**r, "dead": "7"} for r in rows], lambda rows: [{**r, "dead": "7"} for r in rows]),
    "copy": (lambda rows: [{**r, "again": r[channels_of(rows)[0]]} for r in rows],
             lambda rows: [{**r, "again": r[channels_of(rows)[0]]} for r in rows]),
    "doubled": (lambda rows: [r for r in rows for _ in (0, 1)], None),
    "file_twice": (lambda rows: rows + rows, None),
    "nan": (lambda rows: with_gaps(rows, "nan"), None),
    "NaN_word": (lambda rows: with_gaps(rows, "NaN"), None),
    "gaps": (lambda rows: with_gaps(rows, ""), None),
    "wide": (lambda rows: widened(rows), lambda rows: widened(rows)),
    "rounded": (lambda rows: with_labels(rows, lambda c, v: round(v / 0.5) * 0.5 if c.endswith("_N") else v), None),
    "press_up": (lambda rows: with_labels(rows, lambda c, v: -v if c == "fz_N" else v),
                 lambda rows: with_labels(rows, lambda c, v: -v if c == "fz_N" else v)),
    "crlf": (lambda rows: rows, None),
    "own_zero": (lambda rows: channels_changed(in_sessions(rows), lambda k, v, least, width: v + width * (-1) ** k * 0.2, second),
                 lambda rows: channels_changed(in_sessions(rows), lambda k, v, least, width: v + width * (-1) ** k * 0.2, second)),
    "standard_2": (lambda rows: standardised(in_sessions(rows), second), lambda rows: standardised(in_sessions(rows), second)),
    "gain_2": (lambda rows: channels_changed(in_sessions(rows), lambda k, v, least, width: 2 * v, second),
               lambda rows: channels_changed(in_sessions(rows), lambda k, v, least, width: 2 * v, second)),
    "turned_2": (lambda rows: turned(in_sessions(rows)), lambda rows: turned(in_sessions(rows))),
    "saturated": (lambda rows: channels_changed(rows, lambda k, v, least, width: min(v, least + 0.7 * width) if k < 3 else v), None),
    "counts": (lambda rows: channels_changed(rows, lambda k, v, least, width: round(8e6 + 3000 * v)),
               lambda rows: channels_changed(rows, lambda k, v, least, width: round(8e6 + 3000 * v))),
    "epoch": (lambda rows: [{**r, "t_s": repr(1.7e9 + number(r.get("t_s", "0")))} for r in rows], None),
    "swapped": (lambda rows: swapped(rows), None),
    "every10th": (lambda rows: rows[::10], None),
}


def judge(rows, folder, train, tared):
    write([{"t_s": repr(0.01 * i), **r} for i, r in enumerate(rows)], folder / "test.csv")
    subprocess.run([GIVEN.tactilectl, "decouple", "--calibration", folder / "c.toml", "--in", folder / "test.csv", "--out",
                    folder / "forces.csv"], check=True, capture_output=True)
    forces, result, miss = rows_of(folder / "forces.csv"), [], False
    for label in (c for c in COMPONENTS if c in train[0]):
        scale = max(abs(number(r[label])) for r in train if number(r[label]) == number(r[label]))
        zero = dict.fromkeys((r.get("session") for r in rows), 0.0)
        for session in zero if tared else ():
            rest = [number(f[label]) - number(r[label]) for r, f in zip(rows, forces)
                    if r.get("session") == session and r[label] and f[label] and abs(number(r[label])) < 0.02 * scale]
            zero[session] = sum(rest) / max(1, len(rest))
        known = [(number(f[label]) - number(r[label]) - zero[r.get("session")], number(f.get("sd_" + label, "")), f["quality"] == "good")
                 for r, f in zip(rows, forces) if r[label] and f[label]]
        rms = math.sqrt(sum(e * e for e, _, _ in known) / len(known))
        good = [(e, sd) for e, sd, g in known if g]
        if not good:
            result.append(f"{label[:2]} {100 * rms / scale:.2f} none GOOD")
            continue
        within = 100 * sum(abs(e) <= sd for e, sd in good) / len(good)
        beyond = 100 * sum(abs(e) > 5 * sd for e, sd in good) / len(good)
        wrong = within < 60 or beyond > 3
        miss = miss or wrong
        result.append(f"{label[:2]} {100 * rms / scale:.2f} {within:.0f} {beyond:.1f} {sorted(sd for _, sd in good)[len(good) // 2] / rms:.2f}"
                      + f" G{100 * len(good) / len(known):.0f}" + ("!" if wrong else ""))
    return ("MISS " if miss else "") + "  ".join(result)


def main():
    global GIVEN, DATA
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--tactilectl", default=ROOT / "build/release/bin/tactilectl")
    arguments.add_argument("--data", type=pathlib.Path, default=DATA)
    arguments.add_argument("--sets", default="skin,cross,back,shear,tongs,cell")
    arguments.add_argument("--ways", default=",".join(WAYS))
    arguments.add_argument("--methods", default="matrix,quadratic,rbf,mlp,auto")
    arguments.add_argument("--every", type=int, default=1, help="of the rows to calibrate on, only every nth")
    arguments.add_argument("--said", action="store_true", help="print all messages")
    GIVEN = arguments.parse_args()
    DATA = GIVEN.data
    print("set way method: per axis error % of full scale, within 1 sd %, beyond 5 sd %, median sd over error, share GOOD %")
    with tempfile.TemporaryDirectory() as name:
        folder, known = pathlib.Path(name), sets()
        for set_name in GIVEN.sets.split(","):
            for way in GIVEN.ways.split(","):
                train, test = known[set_name]
                train = WAYS[way][0](train[::GIVEN.every])
                test = (WAYS[way][1] or (lambda rows: rows))(test)
                write(train, folder / "train.csv")
                if way == "crlf":
                    text = (folder / "train.csv").read_bytes().replace(b"\r\n", b"\n").replace(b"\n", b"\r\n")
                    (folder / "train.csv").write_bytes(b"\xef\xbb\xbf" + text)
                for method in GIVEN.methods.split(","):
                    begun = time.monotonic()
                    done = subprocess.run([GIVEN.tactilectl, "calibrate", "--model", "generic", "--method", method, "--in",
                                           folder / "train.csv", "--out", folder / "c.toml", "--force", "--json"],
                                          capture_output=True, text=True)
                    took = f" [{time.monotonic() - begun:.1f} s]"
                    if done.returncode:
                        print(f"{set_name} {way} {method}: refused ({done.returncode}): {done.stderr.strip()}{took}", flush=True)
                        continue
                    report = json.loads(done.stdout)
                    text = "" if report["validation"] else "NOT VALIDATED "
                    text += judge(test, folder, train, report["own_zero_per_session"])
                    out = sum(s["left_out"] for s in report["suspects"])
                    print(f"{set_name} {way} {method}{'=' + report['method'] if method == 'auto' else ''}: {text}"
                          f"  named {len(report['suspects'])} out {out}; {report['validation']}{took}", flush=True)
                    if GIVEN.said:
                        print("".join(f"    {w}\n" for w in report["warnings"]), end="", flush=True)


if __name__ == "__main__":
    main()
