#!/usr/bin/env python3
"""Computes each number of a certificate again, from the recording, the published forces and the calibration file.

    tactilectl calibrate --model generic --in rows.csv --out skin.toml --certificate skin.xml --reference "..." ...
    tactilectl decouple --calibration skin.toml --in rows.csv --out forces.csv
    python3 tests/system/certificate_check.py rows.csv forces.csv skin.toml skin.xml

Standard library only, and no code of the project. The CSV has columns t_s, fx_N .. mz_Nm, session, temperature_C. Prints
the numbers of each figure, and each difference; exit status 1 if there is one.
"""
import collections
import csv
import math
import sys
import tomllib
import xml.etree.ElementTree as ET

SAME, REST, ROWS = 0.01, 0.02, 3  # parts of full scale; rows of a hold
UNITS = {"fx": "N", "fy": "N", "fz": "N", "mx": "Nm", "my": "Nm", "mz": "Nm"}
DSI = {"N": r"\newton", "Nm": r"\newton\metre"}
FIGURES = ("interpolation", "reproducibility", "repeatability", "reversibility", "zero", "creep")
SPACES = {"dcc": "https://ptb.de/dcc", "si": "https://ptb.de/si"}


def number(text):
    return float(text) if text.strip() else math.nan


def mean(values):
    return math.fsum(values) / len(values)


class Recording:
    """The labelled rows of a file with their published forces."""

    def __init__(self, rows_csv, forces_csv, calibration):
        self.axes = calibration["components"]
        self.full_scale = dict(zip(self.axes, calibration["full_scale"]))
        self.rows = []
        with open(rows_csv, newline="") as rows, open(forces_csv, newline="") as forces:
            for row, force in zip(csv.DictReader(rows), csv.DictReader(forces), strict=True):
                label = {a: number(row.get(f"{a}_{UNITS[a]}", "")) for a in self.axes}
                if all(math.isnan(x) for x in label.values()):
                    continue
                self.rows.append({"label": label, "session": row.get("session", ""), "t_s": number(row["t_s"]),
                                  "good": force["quality"] == "good", "celsius": number(row.get("temperature_C") or ""),
                                  "d": {a: number(force[f"{a}_{UNITS[a]}"]) - label[a] for a in self.axes}})
        self.holds = list(self.find_holds())

    def same(self, a, b):
        return all(math.isnan(a[x]) == math.isnan(b[x]) and not abs(a[x] - b[x]) > SAME * self.full_scale[x] for x in self.axes)

    def find_holds(self):
        groups, before, rest = [], None, None
        for i, row in enumerate(self.rows):
            first = self.rows[groups[-1][0]] if groups else None
            if first and first["session"] == row["session"] and self.same(first["label"], row["label"]):
                groups[-1].append(i)
            else:
                groups.append([i])
        for group in groups:
            good = [self.rows[i] for i in group if self.rows[i]["good"]]
            if len(good) < ROWS:
                continue
            hold = {"rows": group, "session": good[0]["session"],
                    "load": {a: mean([r["label"][a] for r in good]) for a in self.axes},
                    "d": {a: mean([r["d"][a] for r in good]) for a in self.axes}}
            hold["rest"] = not any(abs(hold["load"][a]) > REST * self.full_scale[a] for a in self.axes)
            if before and before["session"] != hold["session"]:
                before = rest = None
            hold["before"], hold["zero"] = before, rest
            yield hold
            before = hold
            rest = hold if hold["rest"] else rest

    def way(self, hold, axis):
        """+1 rising, -1 falling, 0 neither."""
        if not hold["before"]:
            return 0
        margin = SAME * self.full_scale[axis]
        ends = [hold["before"]["load"][axis], hold["load"][axis]]
        sign = math.copysign(1, max(ends, key=abs))
        start, end = (sign * x for x in ends)
        low, high = sorted((start, end))
        passed = [sign * self.rows[i]["label"][axis] for i in range(hold["before"]["rows"][-1] + 1, hold["rows"][0])]
        if not high - low > margin or low < -REST * self.full_scale[axis]:
            return 0
        if not all(low - margin <= x <= high + margin for x in passed):
            return 0
        return 1 if end > start else -1

    def levels(self, axis):
        """[[(hold, deviation less that of the rest, way)]], one list for each load after a rest."""
        found = []
        for hold in self.holds:
            if not hold["zero"] or not abs(hold["load"][axis]) > REST * self.full_scale[axis]:
                continue
            visit = (hold, hold["d"][axis] - hold["zero"]["d"][axis], self.way(hold, axis))
            if math.isnan(visit[1]):
                continue
            for level in found:
                if self.same(level[0][0]["load"], hold["load"]):
                    level.append(visit)
                    break
            else:
                found.append([visit])
        return found


def spread(visits, axis):
    deviations = [d for _, d, _ in visits]
    return (max(deviations) - min(deviations)) / abs(mean([h["load"][axis] for h, _, _ in visits]))


def figures(recording, axis):
    """{figure: [(load, value as a part)]}, and the whole loads of the interpolation."""
    result, loads = {figure: [] for figure in FIGURES}, []
    for level in recording.levels(axis):
        rising = collections.defaultdict(list)
        for visit in level:
            if visit[2] > 0:
                rising[visit[0]["session"]].append(visit)
        if rising:
            first = [visits[0] for visits in rising.values()]
            load = mean([h["load"][axis] for h, _, _ in first])
            result["interpolation"].append((load, mean([d for _, d, _ in first]) / load))
            loads.append(level[0][0]["load"])
            if len(first) > 1:
                result["reproducibility"].append((load, spread(first, axis)))
            repeated = [visits for visits in rising.values() if len(visits) > 1]
            if repeated:
                worst = max(repeated, key=lambda visits: spread(visits, axis))
                result["repeatability"].append((mean([h["load"][axis] for h, _, _ in worst]), spread(worst, axis)))
        pairs = []
        for rest in {id(h["zero"]): h["zero"] for h, _, _ in level}.values():
            series = [visit for visit in level if visit[0]["zero"] is rest]
            up = next((k for k, visit in enumerate(series) if visit[2] > 0), None)
            down = [visit for visit in series[up:] if visit[2] < 0] if up is not None else []
            if down:
                pairs.append((series[up], down[-1]))
        if pairs:
            load = mean([visit[0]["load"][axis] for pair in pairs for visit in pair])
            result["reversibility"].append((load, mean([abs(b[1] - a[1]) for a, b in pairs]) / abs(load)))
    result["zero"] = list(zero(recording, axis))
    result["creep"] = list(creep(recording, axis))
    return result, loads


def zero(recording, axis):
    for rest in recording.holds:
        if not (rest["rest"] and rest["zero"]):
            continue
        series = [h["load"][axis] for h in recording.holds if h["zero"] is rest["zero"] and not h["rest"]]
        change = rest["d"][axis] - rest["zero"]["d"][axis]
        if series and abs(max(series, key=abs)) > REST * recording.full_scale[axis] and not math.isnan(change):
            yield max(series, key=abs), change / recording.full_scale[axis]


def creep(recording, axis):
    full = (1 - SAME) * recording.full_scale[axis]
    for hold in recording.holds:
        after = hold["rest"] and hold["before"] and abs(hold["before"]["load"][axis]) >= full
        if abs(hold["load"][axis]) < full and not after:
            continue
        rows = [recording.rows[i] for i in hold["rows"]]
        start_ns = round(rows[0]["t_s"] * 1e9)
        at = [next((r["d"][axis] for r in rows if r["good"] and round(r["t_s"] * 1e9) >= start_ns + s * 10**9), None) for s in (30, 300)]
        if None not in at:
            yield hold["load"][axis], abs(at[1] - at[0]) / recording.full_scale[axis]


def expanded(calibration, axis, load, reference):
    """Expanded uncertainty (k = 2) at a whole load. The sd of the calibration is after a peak at full scale."""
    i = calibration["components"].index(axis)
    per_axis = {key: (calibration.get(key) or [0] * 6)[i] for key in ("sd", "sd_slope", "sd_load", "sd_unloading")}
    full = dict(zip(calibration["components"], calibration["full_scale"]))
    counting = [a for a in full if a[0] == "f"] or list(full)
    part = math.sqrt(math.fsum(load[a] ** 2 for a in counting if not math.isnan(load[a]))) / max(full[a] for a in counting)
    of_reference = reference["percent"] / 100 * abs(load[axis]) + reference["N" if axis[0] == "f" else "Nm"]
    return 2 * math.hypot(per_axis["sd"], per_axis["sd_slope"] * load[axis], per_axis["sd_load"] * part,
                          per_axis["sd_unloading"] * max(0, 1 - part), of_reference / 2)


class Certificate:
    def __init__(self, path):
        self.root = ET.parse(path).getroot()
        self.reference = {"percent": 0, "N": 0, "Nm": 0}
        for quantity in self.all(".//dcc:measuringEquipmentQuantity"):
            unit = {r"\percent": "percent", **{v: k for k, v in DSI.items()}}[quantity.find("si:real/si:unit", SPACES).text]
            self.reference[unit] = float(quantity.find("si:real/si:value", SPACES).text)

    def all(self, path, under=None):
        return (self.root if under is None else under).findall(path, SPACES)

    def named(self):
        """{name: value of a single quantity} of the conditions and of the data about the recording."""
        result = {}
        for parent in self.all(".//dcc:influenceCondition") + self.all(".//dcc:metaData"):
            value = parent.find(".//si:value", SPACES)
            result[parent.find("dcc:name/dcc:content", SPACES).text] = math.nan if value is None else float(value.text)
        return result

    def result(self, name):
        """Returns {what: [numbers]}, {what: unit} and the reason why the result is absent. The percentage of a figure is `value`."""
        result = self.root.find(f".//dcc:result[@id='{name}']", SPACES)
        if result is None:
            raise KeyError(f"the certificate has no result {name}")
        numbers, units = {}, {}
        for quantity in self.all("dcc:data/dcc:quantity", result):
            if (reason := quantity.find("dcc:noQuantity/dcc:content", SPACES)) is not None:
                return {}, {}, reason.text
            what = {"applied load": "load", "published force": "published"}.get(quantity.find("dcc:name/dcc:content", SPACES).text, "value")
            for key, tags in ((what, ("valueXMLList", "value")), ("expanded", ("valueExpandedMUXMLList", "valueExpandedMU"))):
                for element in (e for tag in tags for e in self.all(f".//si:{tag}", quantity)):
                    numbers[key] = [float(x) for x in element.text.split()]
            units[what] = next(e.text for tag in ("unitXMLList", "unit") for e in self.all(f".//si:{tag}", quantity))
        return numbers, units, ""


def differences(rows_csv, forces_csv, calibration_toml, certificate_xml, tell=lambda *_: None):
    """Yields a sentence for each number that differs. `tell(figure, numbers)` gets the numbers of each figure."""
    with open(calibration_toml, "rb") as file:
        calibration = tomllib.load(file)
    recording, certificate = Recording(rows_csv, forces_csv, calibration), Certificate(certificate_xml)

    def compare(name, got, wanted, scale):
        if len(got or []) != len(wanted) or any(not abs(g - w) <= 1e-9 * scale for g, w in zip(got or [], wanted)):
            yield f"{name}: {got} in the certificate, {wanted} from the rows"

    celsius = [r["celsius"] for r in recording.rows if not math.isnan(r["celsius"])]
    named = certificate.named()
    for name, wanted in (("lowest temperature", min(celsius, default=math.nan)), ("highest temperature", max(celsius, default=math.nan)),
                         ("rows with a label", len(recording.rows)),
                         ("rows with a label whose published force is GOOD", sum(r["good"] for r in recording.rows))):
        if not (math.isnan(wanted) and math.isnan(named[name])):
            yield from compare(name, [named[name]], [wanted], 1)
    for axis in recording.axes:
        full, unit = recording.full_scale[axis], DSI[UNITS[axis]]
        found, loads = figures(recording, axis)
        numbers, units, _ = certificate.result(f"{axis}.full_scale")
        alone = {a: full if a == axis else 0 for a in recording.axes}
        yield from compare(f"{axis}: full scale", numbers["value"], [full], full)
        yield from compare(f"{axis}: U at full scale", numbers["expanded"], [expanded(calibration, axis, alone, certificate.reference)], full)
        for figure in FIGURES:
            name, wanted = f"{axis}.{figure}", found[figure]
            numbers, units, absent = certificate.result(name)
            tell(name, wanted)
            if bool(absent) == bool(wanted):
                yield f"{name}: {absent or 'present'} in the certificate, {wanted} from the rows"
                continue
            if absent:
                continue
            if units["load"] != unit or units["value"] != r"\percent":
                yield f"{name}: units {units}"
            yield from compare(f"{name}: load", numbers["load"], [load for load, _ in wanted], full)
            yield from compare(f"{name}: value", numbers["value"], [100 * value for _, value in wanted], 1)
            if figure == "interpolation":
                yield from compare(f"{name}: published", numbers["published"], [load * (1 + value) for load, value in wanted], full)
                yield from compare(f"{name}: U", numbers["expanded"],
                                   [expanded(calibration, axis, load, certificate.reference) for load in loads], full)


def main():
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    found = list(differences(*sys.argv[1:], lambda name, numbers: print(f"{name}: {len(numbers)} numbers")))
    print("\n".join(found) or "no difference")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
