#!/usr/bin/env python3
"""Access to tactiled-web: commands need token and origin, and its page loads nothing from elsewhere."""
import hashlib
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import ROOT, wait_for  # noqa: E402
from web_server import PROGRAM, TOKEN, WebCase  # noqa: E402

PAGE = ROOT / "node/web/page"


class Access(WebCase):
    def setUp(self):
        super().setUp()
        self.locked = self.web()
        self.open = self.web("--host-name", "gripper.example", token=TOKEN)

    def tares(self):
        return self.open.status()["sensors"][0]["tare_count"]

    def test_a_tare_works_with_the_token_and_is_refused_without(self):
        tare = {"command": "tare", "sensor": "left"}
        own = f"http://{self.open.host}"
        for code, fields in ((401, {"token": "wrong-" + TOKEN}), (401, {"Authorization": None}), (401, {"Authorization": TOKEN}), (401, {"token": TOKEN + "x"}),
                             (401, {"token": TOKEN[:-1]}), (403, {"Origin": None}), (403, {"Origin": "http://evil.example"}), (403, {"Origin": "null"}),
                             (403, {"Origin": f"http://127.0.0.1:{self.locked.port}"}), (403, {"Origin": own + ".evil.example"}), (403, {"Host": "evil.example", "Origin": "http://evil.example"}),
                             (403, {"Sec_Fetch_Site": "cross-site"}), (415, {"Content_Type": "text/plain"}), (415, {"Content_Type": None})):
            with self.subTest(fields):
                self.assertEqual(self.open.command(tare, **fields)[0], code)
        self.assertEqual(self.locked.command(tare)[0], 403)
        for method in ("GET", "PUT", "DELETE"):
            self.assertEqual(self.open.ask("/api/command", method, Origin=own, Authorization=f"Bearer {TOKEN}")[0], 405)
        self.assertEqual(self.tares(), 0)
        code, answer = self.open.command(tare)
        self.assertEqual((code, answer["result"]), (200, 0), answer)
        wait_for(lambda: self.tares() == 1, "the tare")
        self.assertEqual(self.open.command({"command": "untare", "sensor": "all"})[0], 200)
        wait_for(lambda: self.tares() == 0, "the tare to be gone")
        self.assertEqual(self.open.command({"command": "clear"}, Host="gripper.example:99", Origin="https://gripper.example:99")[0], 200)

    def test_teaching_without_a_grasp_is_refused_by_the_daemon_in_words(self):
        code, answer = self.open.command({"command": "teach", "object": "bolt"})
        self.assertEqual((code, answer["result"]), (409, 4))
        self.assertIn("[grasp]", answer["why"])

    def test_a_body_that_is_no_command_changes_nothing_and_says_what_is_right(self):
        for body in ('{"command":"teach","object":"a b"}', '{"command":"teach","object":"' + "x" * 32 + '"}', '{"command":"teach"}', "", "{", "[]", "null", '{"command":"tare"}', '{"command":"tare","sensor":"right"}', '{"command":"tare","sensor":"left ; clear"}', '{"command":"reboot"}',
                     '{"command":["tare"],"sensor":"left"}', '{"command":"weigh","weigh":-1}', '{"command":"weigh","weigh":1e999}', '{"command":"weigh","weigh":"start clear"}',
                     '{"command":"tare","sensor":"left","more":1}', "[" * 4000, '"\\ud800"', b"\xff\xfe"):
            with self.subTest(body):
                code, answer = self.open.command(body)
                self.assertEqual(code, 400)
                self.assertNotEqual(answer["error"], "")
        self.assertEqual(self.open.command('{"command":"' + "x" * 5000 + '"}')[0], 413)
        self.assertEqual(self.tares(), 0)

    def test_names_of_strangers_and_pages_of_other_origins_may_not_read(self):
        paths = ["/", "/app.js", "/api/status", "/api/stream", "/metrics", "/api/events", "/api/array?sensor=left", "/api/places?sensor=left"]
        for path in paths:
            for host in ("evil.example", "evil.example:8080", "localhost.evil.example", "127.0.0.1.evil.example", "127.0.0.1@evil.example", "127.1", "0x7f000001", "[::1", ""):
                self.assertIn(self.locked.ask(path, Host=host)[0], (400, 403), (path, host))
            self.assertEqual(self.locked.ask(path, Origin="http://evil.example")[0], 403)
            self.assertEqual(self.locked.ask(path, Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="no-cors")[0], 403)
        for host in ("localhost", f"localhost:{self.locked.port}", "LOCALHOST:1", "127.0.0.1", "[::1]:80", "192.168.1.7:8080"):
            self.assertEqual(self.locked.ask("/api/status", Host=host)[0], 200, host)
        self.assertEqual(self.locked.ask("/api/status", Host="gripper.example")[0], 403)
        self.assertEqual(self.open.ask("/api/status", Host="gripper.example")[0], 200)

    def test_every_answer_has_the_strict_fields(self):
        for path, code in (("/", 200), ("/app.js", 200), ("/look.css", 200), ("/uPlot.js", 200), ("/api/status", 200), ("/metrics", 200), ("/api/schema", 200), ("/api/array", 400), ("/api/places?sensor", 400), ("/api/array?sensor=left", 404), ("/nothing", 404), ("/../etc/passwd", 404)):
            got, fields, body = self.locked.ask(path)
            self.assertEqual(got, code, path)
            policy = dict(part.strip().split(" ", 1) for part in fields["content-security-policy"].split(";"))
            self.assertEqual((policy["default-src"], policy["script-src"], policy["connect-src"], policy["frame-ancestors"]), ("'none'", "'self'", "'self'", "'none'"))
            self.assertEqual((fields["x-content-type-options"], fields["referrer-policy"], fields["cross-origin-resource-policy"]), ("nosniff", "no-referrer", "same-origin"))
            self.assertNotIn("access-control-allow-origin", fields)
            head = self.locked.ask(path, "HEAD")
            self.assertEqual((head[0], head[2]), (code, b""))

    def test_a_token_that_is_short_or_missing_is_refused(self):
        for text in ("", "short", "with a space in it but long enough"):
            with tempfile.NamedTemporaryFile("w") as file:
                file.write(text)
                file.flush()
                done = subprocess.run([PROGRAM, "--token-file", file.name], capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("at least 16", done.stderr)


class Page(unittest.TestCase):
    def test_nothing_in_the_page_is_loaded_from_elsewhere(self):
        for file in PAGE.glob("*.*"):
            if file.suffix in (".html", ".js", ".css"):
                for url in re.findall(r"(?:https?:)?//[a-z0-9.-]+\.[a-z]{2,}", file.read_text()):
                    self.assertIn("github.com/leeoniya/uPlot", file.read_text()[file.read_text().index(url):][:80], (file, url))
                self.assertNotIn("@import", file.read_text())

    def test_every_result_of_a_command_has_words(self):
        page = (PAGE / "app.js").read_text()
        words = re.findall(r'"((?:[^"])+)"', page[page.index("const kResults"):page.index("const byId")])
        layout = (ROOT / "node/include/tactiled/layout.h").read_text()
        self.assertEqual(len(words), 1 + max(map(int, re.findall(r"TACTILED_COMMAND_\w+\s*=\s*(\d+)", layout))))

    def test_texts_have_the_contrast_that_wcag_asks_for_in_light_and_dark(self):
        def luminance(colour):
            digits = colour if len(colour) == 6 else "".join(2 * c for c in colour)
            linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (int(digits[i:i + 2], 16) / 255 for i in (0, 2, 4))]
            return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
        schemes = re.findall(r":root \{(.*?)\}", (PAGE / "look.css").read_text(), re.S)
        self.assertEqual(len(schemes), 2)
        for scheme in schemes:
            colours = dict(re.findall(r"--(\w+): #([0-9a-f]+)", scheme))
            for paper in ("paper", "card"):
                for text, least in (("ink", 4.5), ("faint", 4.5), ("good", 4.5), ("uncertain", 4.5), ("bad", 4.5), ("x", 3), ("y", 3), ("z", 3)):
                    a, b = sorted((luminance(colours[paper]), luminance(colours[text])))
                    self.assertGreaterEqual((b + 0.05) / (a + 0.05), least, (paper, text, colours))

    def test_the_plot_library_is_the_released_file(self):
        for line in (PAGE / "SHA256SUMS").read_text().splitlines():
            pinned, name = line.split()
            self.assertEqual(hashlib.sha256((PAGE / name).read_bytes()).hexdigest(), pinned, name)


if __name__ == "__main__":
    unittest.main(verbosity=2)
