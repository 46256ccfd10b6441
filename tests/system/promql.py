"""A model of Prometheus: scrapes with staleness, and the part of PromQL that node/bridges/grafana.json and alerts.yml use. increase() and
rate() do not extrapolate to the ends of their range, so that only their sign is right. alerts_test.py compares it with promtool."""
import collections
import json
import re

from daemon import ROOT

LOOKBACK_S = 300
DASHBOARD = json.loads((ROOT / "node/bridges/grafana.json").read_text())
RULES = (ROOT / "node/bridges/alerts.yml").read_text()
TOKEN = re.compile(r'\s*(?:(?P<number>\d+(?:\.\d+)?)|(?P<string>"[^"]*")|(?P<word>[a-zA-Z_:][\w:]*)|(?P<range>\[\d+[smh]\])|(?P<symbol>==|!=|=~|!~|>=|<=|[-+*/><=(){},]))')
UNIT_S = {"s": 1, "m": 60, "h": 3600}
COMPARE = {"==": lambda a, b: a == b, "!=": lambda a, b: a != b, ">": lambda a, b: a > b, "<": lambda a, b: a < b, ">=": lambda a, b: a >= b, "<=": lambda a, b: a <= b}
COMPUTE = {"+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b}
LEVELS = [("or",), ("and", "unless"), tuple(COMPARE), ("+", "-"), ("*", "/")]  # the loosest first


def rules():
    """Returns {alert: (expression, seconds of `for`, labels, summary)}."""
    found = {}
    for text in RULES.split("- alert: ")[1:]:
        wait = re.search(r"for: (\d+)([smh])", text)
        labels = dict(pair.split(": ") for pair in re.search(r"labels: \{(.*)\}", text).group(1).split(", "))
        found[text.split("\n", 1)[0]] = (re.search(r"expr: (.*)", text).group(1), int(wait.group(1)) * UNIT_S[wait.group(2)] if wait else 0,
                                         labels, re.search(r'summary: "(.*)"', text).group(1))
    return found


def panel(title):
    """Returns the expressions of a panel of the dashboard, with every gripper chosen."""
    targets = next(p["targets"] for p in DASHBOARD["panels"] if p["title"] == title)
    return [target["expr"].replace("$gripper", ".*") for target in targets]


def parsed(text):
    """Returns {labels as a tuple of pairs: value} of the text that a target answers; `__name__` is the first label."""
    found = {}
    for line in text.splitlines():
        if line and not line.startswith("#"):
            name, labels, value = re.fullmatch(r"(\w+)(?:\{(.*)\})? (\S+)", line).groups()
            found[(("__name__", name), *re.findall(r'(\w+)="((?:[^"\\]|\\.)*)"', labels or ""))] = float(value)
    return found


class Store:
    def __init__(self):
        self.series = collections.defaultdict(list)  # frozenset of labels -> [(time, value)]; None: stale
        self.of_target = collections.defaultdict(set)

    def add(self, t_s, labels, value):
        self.series[frozenset(labels)].append((t_s, value))

    def scraped(self, t_s, target, text):
        """The answer of a target at that time; None: it did not answer. Series that it no longer has become stale."""
        where = (("job", "tactiled"), ("instance", target))
        now = {frozenset((*labels, *where)): value for labels, value in parsed(text or "").items()}
        for labels, value in now.items():
            self.add(t_s, labels, value)
        for labels in self.of_target[target] - now.keys():
            self.add(t_s, labels, None)
        self.of_target[target] = set(now)
        self.add(t_s, (("__name__", "up"), *where), 0 if text is None else 1)

    def ask(self, expression, t_s):
        """Returns the instant vector as {frozenset of labels: value}."""
        return Query(self, expression, t_s).result()


class Query:
    def __init__(self, store, expression, t_s):
        self.store, self.t_s = store, t_s
        self.tokens, at = [], 0
        while at < len(expression.rstrip()):
            match = TOKEN.match(expression, at)
            assert match, f"{expression!r}: not understood from {expression[at:]!r}"
            self.tokens.append(match.group(match.lastgroup))
            at = match.end()

    def result(self):
        value = self.level(0)
        assert not self.tokens, f"not understood: {self.tokens}"
        return value

    def is_next(self, *words):
        return bool(self.tokens) and self.tokens[0] in words

    def take(self, *words):
        assert not words or self.is_next(*words), f"{self.tokens[:3]} instead of {words}"
        return self.tokens.pop(0)

    def level(self, n):
        if n == len(LEVELS):
            return self.primary()
        left = self.level(n + 1)
        while self.is_next(*LEVELS[n]):
            operator, on = self.take(), None
            if self.is_next("on"):
                self.take()
                on = self.names()
            left = combined(operator, on, left, self.level(n + 1))
        return left

    def names(self):
        self.take("(")
        found = []
        while not self.is_next(")"):
            found.append(self.take())
            if self.is_next(","):
                self.take()
        self.take(")")
        return found

    def primary(self):
        if self.is_next("("):
            self.take()
            value = self.level(0)
            self.take(")")
            return value
        word = self.take()
        if word[0].isdigit():
            return float(word)
        if word in ("count", "sum", "max"):
            by = self.names() if self.is_next("by") and self.take() else []
            return aggregated(word, by, self.primary())
        if word in ("absent", "vector", "increase", "rate"):
            return getattr(self, word)(self.primary())
        return self.selected(word)

    def selected(self, name):
        wanted = [("__name__", "=", name)]
        if self.is_next("{"):
            self.take()
            while not self.is_next("}"):
                wanted.append((self.take(), self.take("=", "!=", "=~", "!~"), self.take()[1:-1]))
                if self.is_next(","):
                    self.take()
            self.take("}")
        range_s = int(self.tokens[0][1:-2]) * UNIT_S[self.take()[-2]] if self.tokens and self.tokens[0][0] == "[" else None
        self.equal = {label: text for label, operator, text in wanted[1:] if operator == "="}  # absent() has these labels
        found = {}
        for labels, points in self.store.series.items():
            if all(matches(dict(labels).get(label, ""), operator, text) for label, operator, text in wanted):
                within = [value for t_s, value in points if self.t_s - (range_s or LOOKBACK_S) < t_s <= self.t_s]
                if range_s is not None:
                    found[labels] = [value for value in within if value is not None]
                elif within and within[-1] is not None:
                    found[labels] = within[-1]
        return found

    def absent(self, vector):
        return {} if vector else {frozenset(self.equal.items()): 1.0}

    def vector(self, number):
        return {frozenset(): number}

    def increase(self, ranges):
        grown = {}
        for labels, values in ranges.items():
            if len(values) > 1:
                grown[without_name(labels)] = sum(b - a if b >= a else b for a, b in zip(values, values[1:]))
        return grown

    rate = increase


def matches(value, operator, text):
    is_equal = value == text if operator in ("=", "!=") else re.fullmatch(text, value) is not None
    return is_equal != operator.startswith("!")


def without_name(labels):
    return frozenset(pair for pair in labels if pair[0] != "__name__")


def aggregated(word, by, vector):
    groups = collections.defaultdict(list)
    for labels, value in vector.items():
        groups[frozenset(pair for pair in labels if pair[0] in by)].append(value)
    return {labels: float({"count": len, "sum": sum, "max": max}[word](values)) for labels, values in groups.items()}


def combined(operator, on, left, right):
    def key(labels):
        return frozenset(pair for pair in labels if pair[0] in on) if on is not None else without_name(labels)
    if operator in ("or", "and", "unless"):
        of_right, of_left = {key(labels) for labels in right}, {key(labels) for labels in left}
        if operator == "or":
            return {**left, **{labels: value for labels, value in right.items() if key(labels) not in of_left}}
        return {labels: value for labels, value in left.items() if (key(labels) in of_right) == (operator == "and")}
    if operator in COMPARE:
        assert isinstance(right, float), "a comparison with a number only"
        return {labels: value for labels, value in left.items() if COMPARE[operator](value, right)}
    compute = COMPUTE[operator]
    if isinstance(left, float):
        return {without_name(labels): compute(left, value) for labels, value in right.items()}
    if isinstance(right, float):
        return {without_name(labels): compute(value, right) for labels, value in left.items()}
    of_right = {key(labels): value for labels, value in right.items()}
    return {key(labels): compute(value, of_right[key(labels)]) for labels, value in left.items() if key(labels) in of_right}
