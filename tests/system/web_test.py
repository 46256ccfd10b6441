#!/usr/bin/env python3
"""tactiled-web over HTTP: the values are those of the registers, a dead daemon is visible, commands need token and
origin, history outlives a reload, and hostile clients delay no other client."""
import bisect
import itertools
import json
import math
import os
import pathlib
import re
import shutil
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time
import unittest

import jsonschema
from prometheus_client.parser import text_string_to_metric_families
from pymodbus.client import ModbusTcpClient

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import PATIENCE_S, ROOT, Stopwatch, free_port, wait_for  # noqa: E402
from forged_node import REASONS, UNCERTAIN, ForgedNode  # noqa: E402
from hostile_web import KINDS, Hostile, ordinary  # noqa: E402
from unit_daemon import CONFIG, quality_is, unit_daemon  # noqa: E402
from mcap_bytes import with_checksums, with_quality  # noqa: E402
from simulated_node import simulated_node, tactiled  # noqa: E402
from web_server import PROGRAM, TOKEN, Stream, Web, WebCase, column  # noqa: E402

BAD = 3
MAJOR_AT = 12  # offset of the layout's major version in tactiled_header
TOOL = """
[tool]

[[tool.sensor]]
sensor = "left"
x_S_in_G = [1, 0, 0]
z_S_in_G = [0, 0, 1]
"""
SCHEMA = json.loads((ROOT / "node/web/api.schema.json").read_text())


def of(metrics, name, **labels):
    """Returns the one sample of that name and those labels."""
    found = [s for family in text_string_to_metric_families(metrics.decode()) for s in family.samples
             if s.name == name and all(s.labels.get(k) == v for k, v in labels.items())]
    assert len(found) == 1, (name, labels, found)
    return found[0].value


def samples_of(metrics):
    """Returns {name: {labels: value}} of a text of metrics; refuses text that the format does not allow, and names that `promtool check metrics` complains of."""
    found, name, kind = {}, None, None
    for line in metrics.decode().splitlines():
        if line.startswith("# HELP "):
            name, text = line[7:].split(" ", 1)
            assert name not in found and text, line
            found[name] = {}
        elif line.startswith("# TYPE "):
            of_name, kind = line[7:].split(" ")
            assert of_name == name and (kind == "counter") == name.endswith("_total"), line
        else:
            labels, value = re.fullmatch(rf'{name}(?:\{{((?:[a-z_]+="(?:[^"\\\n]|\\[\\n"])*",?)+)\}})? (\S+)', line).groups()
            labels = tuple(re.findall(r'([a-z_]+)="((?:[^"\\]|\\.)*)"', labels or ""))
            assert labels not in found[name] and not math.isnan(float(value)), line
            assert ("quantile" in dict(labels)) == (kind == "summary"), line
            found[name][labels] = float(value)
    return {name: samples for name, samples in found.items() if samples}


class Metrics(WebCase):
    """The metrics of values that are not good."""

    config = CONFIG + TOOL

    def setUp(self):
        super().setUp()
        self.served = self.web()
        data = self.daemon.segment.read_bytes()
        self.daemon.stop()
        self.node = self.enterContext(ForgedNode(self.daemon.name, data))
        wait_for(lambda: self.served.status()["pid"] == os.getpid(), "the forged node")

    def samples(self, name):
        return samples_of(self.served.ask("/metrics")[2]).get(name, {})

    def is_marked(self, name, quality, n):
        """True if the metric has so many samples, all with this quality."""
        samples = self.samples(name)
        return len(samples) == n and all(("quality", quality) in labels for labels in samples)

    def test_a_force_is_in_the_series_of_its_quality_and_in_none_if_it_is_bad(self):
        force = "tactiled_sensor_force_newtons"
        wait_for(lambda: self.is_marked(force, "good", 3), "a good value")
        for bit, _, word, best in REASONS:
            self.node.show(bit)
            wait_for(lambda: self.samples("tactiled_sensor_reason").get((("sensor", "left"), ("reason", word))) == 1, word)
            set_now = [labels[1][1] for labels, value in self.samples("tactiled_sensor_reason").items() if value == 1]
            self.assertEqual(set_now, [word])
            quality = {1: "good", 2: "uncertain", BAD: "bad"}[best]
            self.assertEqual(self.samples("tactiled_sensor_quality")[("sensor", "left"), ("quality", quality)], 1)
            for name in (force, "tactiled_sensor_force_uncertainty_newtons"):
                self.assertTrue(self.is_marked(name, quality, 0 if best == BAD else 3), (name, word))

    def status_of_grasp(self):
        grasp = json.loads(self.served.ask("/api/status")[2])["grasp"]
        return grasp["quality"], grasp["weight_quality"]

    def test_a_weight_has_its_state_its_doubts_and_its_quality(self):
        states = dict(none=None, estimating="uncertain", stable="good", overload=None)
        states["not-observable"] = states["temperature"] = None
        for number, (state, quality) in enumerate(states.items()):
            doubts = 1 << 2 | 1 << 7 if state == "estimating" else 0
            self.node.show_grasp(state=4, weight_state=number, weight_kg=0.2 if quality else math.nan, weight_sd_kg=0.01, weight_doubts=doubts)
            labels = (("state", state), ("quality", quality or "bad"))
            wait_for(lambda: self.samples("tactiled_weight_state").get(labels) == 1, state)
            self.assertEqual(sum(self.samples("tactiled_weight_state").values()), 1)
            for name in ("tactiled_weight_kilograms", "tactiled_weight_uncertainty_kilograms"):
                self.assertTrue(self.is_marked(name, quality, 1 if quality else 0), (name, state))
            kinds = {labels[0][1] for labels, value in self.samples("tactiled_weight_doubt").items() if value == 1}
            self.assertEqual(kinds, {"dead-shear", "late"} if doubts else set())
            wait_for(lambda: self.status_of_grasp() == ("good", quality or "bad"), f"the status of {state}")
        self.node.show(next(bit for bit, _, _, best in REASONS if best == UNCERTAIN))
        wait_for(lambda: self.samples("tactiled_grip_state").get((("state", "holding"), ("quality", "uncertain"))) == 1, "an uncertain grasp")

    def test_the_wrench_on_the_gripper_has_its_quality_and_reasons(self):
        force = "tactiled_tool_force_newtons"
        self.node.show_tool(quality=0)
        wait_for(lambda: not self.samples("tactiled_tool_quality"), "a node without a tool")
        for quality, word, why, n in ((1, "good", 1 << 4, 3), (2, "uncertain", 1 << 3, 3), (BAD, "bad", 1 << 0, 0)):
            self.node.show_tool(quality=quality, why=why, force_G_N=(1, 2, 3) if n else [math.nan] * 3)
            wait_for(lambda: self.samples("tactiled_tool_quality").get((("quality", word),)) == 1, word)
            self.assertTrue(self.is_marked(force, word, n), word)
            reasons = [labels[0][1] for labels, value in self.samples("tactiled_tool_reason").items() if value == 1]
            self.assertEqual(reasons, [{1: "moves", 2: "doubted", BAD: "gravity"}[quality]])

    @unittest.skipUnless(shutil.which("promtool"), "promtool is not installed")
    def test_promtool_has_no_complaint(self):
        self.node.show_tool(quality=1, why=0)
        wait_for(lambda: self.samples("tactiled_tool_quality"), "a wrench")
        done = subprocess.run(["promtool", "check", "metrics"], input=self.served.ask("/metrics")[2], capture_output=True)
        self.assertEqual((done.returncode, done.stdout + done.stderr), (0, b""))


class Values(WebCase):
    def registers(self):
        """Returns fx fy fz of the first sensor as a PLC reads them, in N."""
        with ModbusTcpClient("127.0.0.1", port=self.daemon.port) as client:
            block = client.read_holding_registers(100, count=25, slave=1).registers
        rows = [line.split("|") for line in (ROOT / "node/modbus/MAP.md").read_text().splitlines()]
        at = {row[4].strip(): int(row[2]) for row in rows if len(row) > 5 and row[2].strip().isdigit() and 100 <= int(row[2]) < 125}
        words = [block[at[name] - 100] for name in ("FX", "FY", "FZ")]
        return [(word - 65536 if word > 32767 else word) / 100 for word in words]

    def test_status_metrics_and_stream_have_the_values_of_the_registers(self):
        web = self.web()
        status = web.status()
        jsonschema.validate(status, SCHEMA)
        force_N = status["sensors"][0]["force_S_N"]
        self.assertEqual(force_N, [1, 2, -3])
        self.assertEqual([round(f, 6) for f in self.registers()], force_N)
        metrics = web.ask("/metrics")[2]
        for axis, force in zip("xyz", force_N):
            self.assertEqual(of(metrics, "tactiled_sensor_force_newtons", sensor="left", axis=axis, quality="good"), force)
        self.assertEqual(of(metrics, "tactiled_up"), 1)
        self.assertEqual(of(metrics, "tactiled_sensor_quality", sensor="left", quality="good"), 1)
        self.assertGreater(of(metrics, "tactiled_link_events_total", link="usb0", kind="frames"), 2)
        stream = Stream(web)
        hello = stream.until(lambda name, _: name == "hello")
        self.assertEqual([s["name"] for s in hello["sensors"]], ["left"])
        self.assertEqual(len(hello["meanings"]), len(hello["reasons"]))
        self.assertTrue(all(hello["meanings"]))
        frame = stream.until(lambda name, _: name == "frame")
        self.assertEqual(frame["sensors"][0]["force_N"], force_N)
        self.assertEqual(frame["sensors"][0]["low"][2], -3.01)
        stream.close()

    def test_the_bound_of_the_age_is_that_of_the_status(self):
        config = CONFIG.replace('path = "direct"', 'path = "network"')
        with unit_daemon(config=config).start() as daemon, Web(daemon.name) as web:
            self.addCleanup(shutil.rmtree, daemon.folder)
            wait_for(quality_is(daemon, "good"), "a good value")

            def of_status():
                return json.loads(daemon.ctl("status", "--json").stdout)["sensors"][0]["age_bound_ms"]

            for player in daemon.others:
                player.kill()
            wait_for(quality_is(daemon, "bad"), "the end of the frames")
            wait_for(lambda: of_status() > 100, "a bound that grows with the age of the last frame")
            bounds_ms, status = [of_status()], web.status()
            jsonschema.validate(status, SCHEMA)
            bounds_ms += [status["sensors"][0]["age_bound_ms"], of_status()]
            bounds_ms += [1000 * of(web.ask("/metrics")[2], "tactiled_sensor_age_bound_seconds", sensor="left"), of_status()]
            stream = Stream(web)
            self.addCleanup(stream.close)
            bounds_ms += [stream.until(lambda name, _: name == "frame")["sensors"][0]["age_bound_ms"], of_status()]
            self.assertEqual(bounds_ms, sorted(bounds_ms))

    def test_a_killed_daemon_has_no_value_anywhere_and_its_successor_is_found(self):
        web = self.web()
        stream = Stream(web)
        stream.until(lambda name, data: name == "frame" and data["alive"])
        with Stopwatch() as watch:
            self.daemon.process.kill()
            self.daemon.process.wait()
            frame = stream.until(lambda name, data: name == "frame" and not data["alive"])
            self.assertLess(watch.seconds(), 0.5)
        self.assertIn("does not respond", frame["why"])
        self.assertEqual(frame["sensors"][0]["quality"], BAD)
        self.assertEqual(frame["sensors"][0]["force_N"], [None] * 3)
        self.assertIsNone(frame["sensors"][0]["rate_Hz"])
        status = web.status()
        jsonschema.validate(status, SCHEMA)
        self.assertEqual((status["alive"], status["sensors"][0]["force_S_N"]), (False, [None] * 3))
        metrics = web.ask("/metrics")[2]
        self.assertEqual(of(metrics, "tactiled_up"), 0)
        self.assertEqual(samples_of(metrics).keys(), {"tactiled_up", "tactiled_web_streams", "tactiled_web_missed_samples_total"})
        self.daemon.start()
        frame = stream.until(lambda name, data: name == "frame" and data["alive"] and data["sensors"][0]["quality"] == 1)
        self.assertEqual(frame["sensors"][0]["force_N"], [1, 2, -3])
        events = json.loads(web.ask("/api/events")[2])
        jsonschema.validate(events, {"$ref": "#/definitions/events", "definitions": json.loads(web.ask("/api/schema")[2])["definitions"]})
        texts = [e["text"] for e in events["events"]]
        self.assertTrue(any("does not respond" in t for t in texts), texts)
        self.assertTrue(any("started, pid" in t for t in texts), texts)
        past = self.past(web)
        self.assertIn(BAD, column(past["quality"], "I"))
        self.assertTrue(any(math.isnan(v) for v in column(past["value"][2], "f")))

    def test_the_schema_refuses_a_force_in_a_bad_sample(self):
        status = self.web().status()
        status["sensors"][0]["quality"] = "bad:stale"
        with self.assertRaises(jsonschema.ValidationError):
            jsonschema.validate(status, SCHEMA)

    def past(self, web):
        stream = Stream(web)
        past = stream.until(lambda name, _: name == "past")
        stream.close()
        return past

    def test_history_is_there_after_a_reload_and_goes_back_a_minute_at_most(self):
        web = self.web()

        def is_long():
            time.sleep(0.5)
            t_s = column(self.past(web)["t_s"], "d")
            return len(t_s) > 1 and t_s[-1] - t_s[0] > 2.5
        wait_for(is_long, "a past")
        past = self.past(web)
        t_s = column(past["t_s"], "d")
        self.assertEqual(set(b > a for a, b in zip(t_s, t_s[1:])), {True})
        self.assertEqual(len(t_s), len(column(past["value"][0], "f")))
        self.assertEqual(set(column(past["value"][2], "f")[-10:]), {-3.0})
        self.assertLessEqual(len(t_s), 1800)

    def test_a_segment_of_a_newer_layout_is_not_read_and_the_page_says_so(self):
        web = self.web()
        self.daemon.process.kill()
        self.daemon.process.wait()
        copy = self.daemon.segment.with_suffix(".new")
        data = bytearray(self.daemon.segment.read_bytes())
        major, = struct.unpack_from("<H", data, MAJOR_AT)
        self.assertEqual(major, 1)
        struct.pack_into("<H", data, MAJOR_AT, major + 1)
        copy.write_bytes(data)
        copy.chmod(self.daemon.segment.stat().st_mode & 0o777)
        os.replace(copy, self.daemon.segment)
        fresh = Web(self.daemon.name)
        self.addCleanup(shutil.rmtree, fresh.folder)
        self.addCleanup(fresh.__exit__)
        for server in (web, fresh):
            wait_for(lambda: "layout" in server.status()["why"], "the reason")
            status = server.status()
            jsonschema.validate(status, SCHEMA)
            self.assertFalse(status["alive"])
            self.assertEqual([s["force_S_N"] for s in status["sensors"]], [[None] * 3] if server is web else [])

    def test_another_set_of_sensors_replaces_the_first_and_keeps_the_past_of_the_same_name(self):
        web = self.web()
        stream = Stream(web)
        stream.until(lambda name, _: name == "past")
        time.sleep(1)
        self.daemon.stop()
        with simulated_node(3, ("new", "left", "third"), self.daemon.name) as other:
            hello = stream.until(lambda name, data: name == "hello" and data["pid"] == other.process.pid)
            self.assertEqual([s["name"] for s in hello["sensors"]], ["new", "left", "third"])
            pasts = [stream.until(lambda name, _: name == "past") for _ in range(3)]
            self.assertEqual([past["sensor"] for past in pasts], [0, 1, 2])
            of_left = column(pasts[1]["value"][2], "f")
            self.assertIn(-3.0, of_left)
            self.assertTrue(all(math.isnan(v) for v in column(pasts[0]["value"][2], "f")[:len(of_left) // 4]))
            frame = stream.until(lambda name, data: name == "frame" and len(data["sensors"]) == 3)
            self.assertEqual(len(frame["grasp"]["jaws"]), 3)
            jsonschema.validate(web.status(), SCHEMA)
        stream.close()

    def test_a_node_that_is_not_there_shows_so(self):
        with Web("nobody-has-this-name") as web:
            self.addCleanup(shutil.rmtree, web.folder)
            status = web.status()
            jsonschema.validate(status, SCHEMA)
            self.assertEqual((status["alive"], status["sensors"]), (False, []))
            self.assertNotEqual(status["why"], "")
            self.assertEqual(of(web.ask("/metrics")[2], "tactiled_up"), 0)


class Recording(WebCase):
    def test_a_recording_is_shown_with_its_samples_and_again_at_its_end(self):
        file = self.daemon.folder / "pick.mcap"
        done = self.daemon.ctl("record", file, "--node", self.daemon.name, "--seconds", "1", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        of_file = json.loads(done.stdout)["messages"] // 4  # a frame, a sample, a wrench and a quality each
        self.daemon.stop()
        with Web("gripper", file) as web:  # the file, and no daemon
            self.addCleanup(shutil.rmtree, web.folder)
            wait_for(lambda: web.status()["alive"], "the first sample")
            status = web.status()
            jsonschema.validate(status, SCHEMA)
            self.assertEqual((status["sensors"][0]["name"], status["sensors"][0]["force_S_N"]), ("left", [1, 2, -3]))
            self.assertEqual(of(web.ask("/metrics")[2], "tactiled_simulated"), 1)
            samples = of(web.ask("/metrics")[2], "tactiled_sensor_samples_total", sensor="left")
            wait_for(lambda: of(web.ask("/metrics")[2], "tactiled_sensor_samples_total", sensor="left") > samples + of_file, "the file once more")
            name = web.log().rpartition("node \"")[2].partition("\"")[0]
            segment = self.daemon.segment.parent / f"tactiled.{name}"
            self.assertTrue(segment.exists())
        self.assertFalse(segment.exists())

    def test_names_in_a_file_from_anywhere_are_shown_as_text(self):
        long = [f"a_sensor_with_a_long_name_no_{n:02}" for n in range(2)]
        odd = [b"<img src=x onerror=alert(1)>\"\n\\", b"\xff\xfe\x1b]0;x\x07\xe2\x82\xacsensor-of-bytes\r\n"]
        file = pathlib.Path(tempfile.mkdtemp()) / "odd.mcap"
        self.addCleanup(shutil.rmtree, file.parent)
        with simulated_node(2, "a_sensor_with_a_long_name_no_{n:02}") as daemon:
            self.assertEqual(daemon.ctl("record", file, "--node", daemon.name, "--seconds", "1").returncode, 0)
        data = file.read_bytes()
        for name, other in zip(long, odd):
            self.assertGreater(data.count(name.encode()), 2)
            self.assertLessEqual(len(other), len(name))
            data = data.replace(name.encode(), other.ljust(len(name), b"\xe9"))
        file.write_bytes(with_checksums(data))
        with Web("gripper", file) as web:
            self.addCleanup(shutil.rmtree, web.folder)
            wait_for(lambda: web.status()["alive"], "the first sample")
            status = web.status()
            jsonschema.validate(status, SCHEMA)
            names = [sensor["name"] for sensor in status["sensors"]]
            self.assertEqual(names, ["<img src=x onerror=alert(1)>\"?\\", "???]0;x????sensor-of-bytes?????"])
            metrics = web.ask("/metrics")[2]
            for name in names:
                self.assertGreater(of(metrics, "tactiled_sensor_samples_total", sensor=name), 0)
            stream = Stream(web)
            self.addCleanup(stream.close)
            self.assertEqual([sensor["name"] for sensor in stream.until(lambda name, _: name == "hello")["sensors"]], names)

    def test_a_quality_that_does_not_exist_has_no_value(self):
        file = self.daemon.folder / "odd.mcap"
        self.assertEqual(self.daemon.ctl("record", file, "--node", self.daemon.name, "--seconds", "1").returncode, 0)
        file.write_bytes(with_quality(file.read_bytes(), 77))
        with Web("gripper", file) as web:
            self.addCleanup(shutil.rmtree, web.folder)
            stream, seen = Stream(web), set()
            until = time.monotonic() + 2.5
            while time.monotonic() < until or len({quality for quality, _, _ in seen}) < 2:
                frame = stream.until(lambda name, _: name == "frame")
                seen |= {(s["quality"], s["worst"], s["force_N"][2]) for s in frame["sensors"]}
            stream.close()
            self.assertEqual({quality for quality, _, _ in seen}, {1, BAD})
            self.assertEqual({worst for _, worst, _ in seen} - {1, BAD}, set())
            self.assertEqual({force for quality, _, force in seen if quality == BAD}, {None})

    def test_a_file_that_is_no_recording_is_refused(self):
        file = self.daemon.folder / "rows.csv"
        for words in ((file,), (self.daemon.folder / "none.mcap",)):
            done = subprocess.run([PROGRAM, "--listen", f"127.0.0.1:{free_port()}", *words], capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 2, done.stderr)


class Peaks(WebCase):
    """One sample in a hundred is a peak of 50 N: a page that shows every 33rd millisecond must still show it."""
    rows = "".join(f"{n / 200},0,0,{-50 if n == 57 else -1 - n % 3 / 100}\n" for n in range(100))

    def test_no_peak_between_two_ticks_is_missed(self):
        web = self.web()
        with tactiled.open(self.daemon.name).follow("left", PATIENCE_S) as left:
            published_s = [sample.t_published_ns / 1e9 for sample in itertools.islice(left, 600) if sample.force_S_N[2] < -49]
        self.assertGreaterEqual(len(published_s), 5)
        stream = Stream(web)
        past = stream.until(lambda name, _: name == "past")
        stream.close()
        low, t_s = column(past["low"][2], "f"), column(past["t_s"], "d")
        ticks = {bisect.bisect(t_s, at_s) for at_s in published_s} - {0, len(t_s)}  # each follows a peak
        self.assertGreaterEqual(len(ticks), 4)
        self.assertGreaterEqual(sum(v < -49 for v in low), len(ticks))


class HostileClients(WebCase):
    def setUp(self):
        super().setUp()
        self.server = self.web(token=TOKEN)
        self.before = self.server.status()["sensors"][0]["tare_count"]

    def tearDown(self):
        self.assertIsNone(self.server.process.poll(), self.server.log())
        self.assertEqual(self.server.status()["sensors"][0]["tare_count"], self.before)
        super().tearDown()

    def connect(self, data=b""):
        s = socket.create_connection(("127.0.0.1", self.server.port), timeout=5)
        self.addCleanup(s.close)
        if data:
            s.sendall(data)
        return s

    def test_nobody_waits_beside_a_crowd(self):
        for kind in KINDS:
            with self.subTest(kind), Hostile(kind, self.server.port):
                took, silence = ordinary(self.server, 1.5)
                print(f"\n{kind}: {len(took)} requests, median {1000 * statistics.median(took):.1f} ms, longest {1000 * max(took):.1f} ms, silence of a page {1000 * silence:.0f} ms")
                self.assertLess(max(took), 1)
                self.assertLess(silence, 1)

    def test_a_connection_that_asks_nothing_or_half_is_closed_after_ten_seconds(self):
        kinds = (b"", b"GET / HT", b"POST /api/command HTTP/1.1\r\nHost: localhost\r\nContent-Length: 4000\r\n\r\n{")
        slow = [self.connect(data) for data in kinds]
        time.sleep(5)
        self.assertEqual([closed(s) for s in slow], [False] * 3)
        wait_for(lambda: all(closed(s) for s in slow), "the connections to be closed")

    def test_streams_that_take_nothing_cost_no_memory_and_delay_nobody(self):
        before_kB = self.server.rss_kB()
        for _ in range(12):
            s = self.connect()
            s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            s.sendall(b"GET /api/stream HTTP/1.1\r\nHost: localhost\r\n\r\n")
        took, silence = ordinary(self.server, 5)
        self.assertLess(max(*took, silence), 1)
        self.assertLess(self.server.rss_kB() - before_kB, 20_000)

    def test_more_pages_than_are_allowed_are_refused_and_the_others_go_on(self):
        streams = [Stream(self.server) for _ in range(16)]
        refused = Stream(self.server)
        self.assertEqual(refused.answer.status, 503)
        refused.close()
        for stream in streams:
            stream.until(lambda name, _: name == "frame")
            stream.close()
        wait_for(lambda: self.server.ask("/metrics")[2].count(b"tactiled_web_streams 0") == 1, "the places")

    def test_malformed_requests_change_nothing(self):
        head = b"POST /api/command HTTP/1.1\r\nHost: localhost\r\n"
        cases = [b"\x00" * 100, b"\xff" * 5000, b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"GET " + b"/a" * 20000 + b" HTTP/1.1\r\n\r\n", b"GET /%00%2e%2e/ HTTP/1.1\r\nHost: localhost\r\n\r\n",
                 b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 5000 + b"\r\n", b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n",
                 head + b"Content-Length: -1\r\n\r\n", head + b"Content-Length: 99999999999999999999\r\n\r\n", head + b"Content-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
                 head + b"Transfer-Encoding: chunked\r\n\r\nFFFFFFFFFFFFFFFFF\r\nx", head + b"Transfer-Encoding: chunked\r\n\r\n" + b"1000\r\n" + b"x" * 4096 + b"\r\n1000\r\n",
                 b"OPTIONS * HTTP/1.1\r\nHost: localhost\r\n\r\n", b"CONNECT evil.example:80 HTTP/1.1\r\nHost: localhost\r\n\r\n", b"TRACE / HTTP/1.1\r\nHost: localhost\r\n\r\n",
                 b"GET http://evil.example/ HTTP/1.1\r\nHost: evil.example\r\n\r\n", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"\x00" * 500,
                 b"GET / HTTP/1.1\nHost: localhost\n\n", b"GET / HTTP/1.1\r\nHost: localhost\r\n " + b"x" * 100 + b"\r\n\r\n", b"GET / HTTP/1.1\r\n: x\r\n\r\n"]
        for data in cases:
            with self.subTest(data[:60]):
                s = self.connect()
                try:
                    s.sendall(data)
                    s.shutdown(socket.SHUT_WR)
                    s.settimeout(12)
                    answer = s.recv(65536)
                except OSError:
                    answer = b""
                self.assertFalse(b"evil" in data and answer.startswith(b"HTTP/1.1 200"), answer[:200])
                self.assertTrue(answer == b"" or answer.startswith(b"HTTP/1."), answer[:100])
        self.assertLess(max(ordinary(self.server, 1)[0]), 1)


def closed(s):
    """Returns whether the server has closed it."""
    s.setblocking(False)
    try:
        return s.recv(65536) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


if __name__ == "__main__":
    unittest.main()
