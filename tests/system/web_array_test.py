#!/usr/bin/env python3
"""Arrays of taxels over HTTP: /api/array and /api/places, beside a simulated device that sends datagrams."""
import json
import pathlib
import shutil
import sys
import unittest

import jsonschema

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from array_test import PRESS_N, ArrayCase  # noqa: E402
from daemon import ROOT, wait_for  # noqa: E402
from web_server import PROGRAM, Stream, Web  # noqa: E402

SCHEMA = json.loads((ROOT / "node/web/api.schema.json").read_text())


def valid(body, kind):
    jsonschema.validate(body, {"$ref": f"#/definitions/{kind}", **{key: SCHEMA[key] for key in ("definitions", "properties")}})


class Page(ArrayCase):
    def setUp(self):
        if not PROGRAM.exists():
            self.skipTest("tactiled-web is not built: libmicrohttpd-dev was missing")
        super().setUp()
        self.web = Web(self.daemon.name)
        self.addCleanup(shutil.rmtree, self.web.folder)
        self.addCleanup(self.web.__exit__)
        wait_for(lambda: self.web.status()["alive"], "the first tick")

    def ask(self, path, code=200):
        got, _, body = self.web.ask(path)
        self.assertEqual(got, code, body)
        return json.loads(body)

    def test_the_array_is_that_of_read_and_the_places_are_those_of_the_device(self):
        array, places = self.ask("/api/array?sensor=skin"), self.ask("/api/places?sensor=skin")
        valid(array, "array")
        valid(places, "places")
        self.assertEqual(set(self.array()) | {"t_s", "wall_ms"}, set(array))
        self.assertEqual(array["epoch"], places["epoch"])
        self.assertEqual((places["rows"], places["columns"], places["taxels"]), (8, 12, 96))
        for i, (x, y, z) in enumerate(self.skin.places_m):
            self.assertAlmostEqual(places["x_m"][i], x, 6)
            self.assertAlmostEqual(places["y_m"][i], y, 6)
        self.assertAlmostEqual(-sum(force or 0 for force in array["fz_N"]), PRESS_N, delta=0.2)
        status = self.web.status()
        jsonschema.validate(status, SCHEMA)
        self.assertEqual(status["sensors"][0]["taxels"], 96)
        stream = Stream(self.web)
        hello = stream.until(lambda name, _: name == "hello")
        self.assertEqual((hello["sensors"][0]["taxels"], hello["taxel_states"][:3]), (96, ["missing", "saturated", "dead"]))
        stream.close()

    def test_each_request_has_the_newest_array(self):
        first = self.ask("/api/array?sensor=skin")
        wait_for(lambda: self.ask("/api/array?sensor=skin")["sequence"] > first["sequence"] + 20, "newer arrays")
        self.skin.body = lambda _: (0.004, 0.002, 1.0, 4e-3)
        wait_for(lambda: abs((self.ask("/api/array?sensor=skin")["cop_S_m"][0] or 0) - 0.004) < 2e-4, "the other place")

    def test_names_that_are_no_array_are_refused(self):
        for path, code in (("/api/array", 400), ("/api/array?sensor", 400), ("/api/array?sensor=", 404), ("/api/places?sensor=other", 404), ("/api/array?sensor=" + "x" * 2000, 404)):
            self.assertIn("error", self.ask(path, code))

    def test_nothing_of_a_dead_daemon_has_a_value(self):
        self.ask("/api/array?sensor=skin")
        self.daemon.process.kill()
        self.daemon.process.wait()
        wait_for(lambda: not self.web.status()["alive"], "the end")
        array = self.ask("/api/array?sensor=skin")
        valid(array, "array")
        self.assertTrue(array["quality"].startswith("bad:"))
        self.assertEqual((set(array["fz_N"]), array["peak_N"], array["cop_S_m"]), ({None}, None, [None] * 3))


if __name__ == "__main__":
    unittest.main()
