#!/usr/bin/env python3
"""The alert rules and the numbers at the top of the dashboard: which of them show each kind of trouble, by the model of promql.py and, where
it is installed, by promtool."""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import ROOT  # noqa: E402
from promql import DASHBOARD, Store, panel, rules  # noqa: E402

STEP_S = 5
STEPS = 240
TOP = [p["title"] for p in DASHBOARD["panels"] if p["type"] == "stat"]
DEAD, FAULT, NO_VALUE, UNCERTAIN = TOP[:4]
SENSOR, NODE = 'sensor="left"', 'node="cell3"'
# The words of the warnings, and the alerts that each causes: lost frames and doubts have metrics, and alerts, of their own.
WARNINGS = {word: [] if word in ("lost-frames", "jaws-differ") else ["TactiledWarning"]
            for word in re.findall(r'"([\w-]+)"', re.search(r"kWarningWords\{(.*?)\};", (ROOT / "node/web/timeline.cpp").read_text(), re.DOTALL).group(1))}
HEALTHY = {"up": 1, f"tactiled_up,{NODE}": 1, f'tactiled_sensor_quality,{SENSOR},quality="good"': 1, 'tactiled_fault,kind="sensor-lost"': 0,
           'tactiled_weight_doubt,kind="moves"': 0, 'tactiled_weight_doubt,kind="shares"': 0, 'tactiled_tool_quality,quality="good"': 1,
           f"tactiled_sensor_lost_frames_total,{SENSOR}": 0, "tactiled_rt_degraded": 0, "tactiled_slips_total": 0,
           "tactiled_simulated": 0, **{f'tactiled_warning,kind="{word}"': 0 for word in WARNINGS},
           **{f'tactiled_sensor_quality,{SENSOR},quality="{word}"': 0 for word in ("uncertain", "bad", "no-value")}}


def quality(word):
    return {f'tactiled_sensor_quality,{SENSOR},quality="good"': 0, f'tactiled_sensor_quality,{SENSOR},quality="{word}"': 1}


ONLY_UP = dict.fromkeys(HEALTHY.keys() - {"up"})
# Trouble of one of two grippers: (what differs from HEALTHY, the only alerts, the only numbers at the top that are not 0). A series that
# is None does not exist; a list has a value for each step, and the last one stays.
CASES = {
    "nothing": ({}, [], []),
    "the target does not answer": ({**ONLY_UP, "up": 0}, ["TactiledTargetDown"], [DEAD]),
    "the daemon is dead": ({**ONLY_UP, f"tactiled_up,{NODE}": 0}, ["TactiledDaemonDown"], [DEAD]),
    "another program answers": (ONLY_UP, ["TactiledDaemonDown"], [DEAD]),
    "a sensor is bad": (quality("bad"), ["TactiledSensorBad"], [NO_VALUE]),
    "a sensor has not begun": (quality("no-value"), ["TactiledSensorBad"], [NO_VALUE]),
    "a sensor is uncertain": (quality("uncertain"), ["TactiledSensorUncertain"], [UNCERTAIN]),
    "a fault": ({'tactiled_fault,kind="sensor-lost"': 1}, ["TactiledFault"], [FAULT]),
    "the load moves": ({'tactiled_weight_doubt,kind="moves"': 1}, [], []),
    "a doubted weight": ({'tactiled_weight_doubt,kind="shares"': 1}, ["TactiledWeightDoubted"], []),
    "a doubted wrench": ({'tactiled_tool_quality,quality="good"': 0, 'tactiled_tool_quality,quality="uncertain"': 1}, ["TactiledWrenchUncertain"], []),
    "frames are lost": ({f"tactiled_sensor_lost_frames_total,{SENSOR}": list(range(STEPS))}, ["TactiledFramesLost"], []),
    "frames were lost once": ({f"tactiled_sensor_lost_frames_total,{SENSOR}": [0] * 40 + [7]}, [], []),
    "a simulated gripper": ({"tactiled_simulated": 1}, ["TactiledSimulated"], []),
    **{f"the warning {word}": ({f'tactiled_warning,kind="{word}"': 1}, alerts, []) for word, alerts in WARNINGS.items()},
    "no real-time priority": ({"tactiled_rt_degraded": 1}, ["TactiledNoRealTime"], []),
}


def series(case):
    """Yields (text of the labels, values) of two grippers; the second one has the trouble."""
    for instance, differs in (("well:8080", {}), ("ill:8080", CASES[case][0])):
        for name, value in {**HEALTHY, **differs}.items():
            if value is not None:
                metric, _, labels = name.partition(",")
                values = value if isinstance(value, list) else [value]
                yield f'{metric}{{job="tactiled",instance="{instance}"{"," * bool(labels)}{labels}}}', values + values[-1:] * (STEPS - len(values))


def stored(case):
    store = Store()
    for text, values in series(case):
        labels = (("__name__", text.partition("{")[0]), *re.findall(r'(\w+)="([^"]*)"', text))
        for step, value in enumerate(values):
            store.add(step * STEP_S, labels, value)
    return store


def fires_from_s(store, alert):
    """Returns the time from which on the alert fires without a gap to the end, by the model, or None."""
    expression, for_s, _, _ = rules()[alert]
    since = None
    for step in range(STEPS):
        active = store.ask(expression, step * STEP_S)
        since = (step * STEP_S if since is None else since) if active else None
    return None if since is None else since + for_s


class Alerts(unittest.TestCase):
    def test_each_trouble_has_its_alert_and_no_other(self):
        for case, (_, alerts, _) in CASES.items():
            store = stored(case)
            fires = {alert: fires_from_s(store, alert) for alert in rules()}
            self.assertEqual([alert for alert, t_s in fires.items() if t_s is not None and t_s < STEPS * STEP_S], alerts, case)

    def test_each_trouble_shows_at_the_top_of_the_dashboard(self):
        for case, (_, _, shown) in CASES.items():
            store = stored(case)
            for title in TOP:
                (value,), = [store.ask(expression, 60).values() for expression in panel(title)]
                self.assertEqual(value, 1 if title in shown else 0, (case, title))

    def test_a_job_without_a_target_shows(self):
        empty = Store()
        self.assertEqual([alert for alert, (expression, *_) in rules().items() if empty.ask(expression, 60)], ["TactiledNoTarget"])
        self.assertEqual(list(empty.ask(*panel(DEAD), 60).values()), [1])

    def test_every_alert_is_shown_to_fire(self):
        self.assertEqual({alert for _, alerts, _ in CASES.values() for alert in alerts} | {"TactiledNoTarget"}, rules().keys())

    def test_each_value_of_the_dashboard_shows_its_quality(self):
        marked = 0
        for each in DASHBOARD["panels"]:
            for target in each["targets"]:
                if re.search(r"tactiled_(sensor|tool)_(force|torque)|tactiled_weight_kilograms|tactiled_grip_newtons", target["expr"]):
                    word, = re.findall(r'quality="(\w+)"', target["expr"])
                    self.assertEqual("uncertain" in target["legendFormat"], word == "uncertain", target)
                    marked += 1
        self.assertGreater(marked, 4)


def unit_test(case):
    """Returns a test of promtool: each alert, and each number at the top, with the outcome that the model gives."""
    store, alerts, top = stored(case), [], []
    for alert, (expression, for_s, labels, summary) in rules().items():
        t_s = fires_from_s(store, alert)
        for at_s in {STEPS * STEP_S - STEP_S} | ({t_s - STEP_S, t_s} if t_s else set()):
            active = store.ask(expression, at_s) if t_s is not None and at_s >= t_s else {}
            expected = []
            for found in active:
                of_series = {key: value for key, value in found if key != "__name__"}
                text = re.sub(r"\{\{ \$labels\.(\w+) \}\}", lambda m: of_series[m.group(1)], summary)
                expected.append({"exp_labels": {**of_series, **labels}, "exp_annotations": {"summary": text}})
            alerts.append({"eval_time": f"{at_s}s", "alertname": alert, "exp_alerts": expected})
    for title in TOP:
        (expression,) = panel(title)
        top.append({"expr": expression, "eval_time": "60s", "exp_samples": [{"labels": "{}", "value": value} for value in store.ask(expression, 60).values()]})
    return {"name": case, "interval": f"{STEP_S}s", "alert_rule_test": alerts, "promql_expr_test": top,
            "input_series": [{"series": text, "values": " ".join(map(str, values))} for text, values in series(case)]}


@unittest.skipUnless(shutil.which("promtool"), "promtool is not installed")
class Promtool(unittest.TestCase):
    def promtool(self, *words):
        done = subprocess.run(["promtool", *map(str, words)], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_the_rules_are_valid(self):
        self.promtool("check", "rules", ROOT / "node/bridges/alerts.yml")

    def test_promtool_agrees_with_the_model(self):
        tests = [unit_test(case) for case in CASES]
        self.assertGreater(sum(len(a["exp_alerts"]) for test in tests for a in test["alert_rule_test"]), len(CASES))
        with tempfile.NamedTemporaryFile("w", suffix=".yml") as file:
            json.dump({"rule_files": [str(ROOT / "node/bridges/alerts.yml")], "evaluation_interval": f"{STEP_S}s", "tests": tests}, file)
            file.flush()
            self.promtool("test", "rules", file.name)


if __name__ == "__main__":
    unittest.main(verbosity=2)
