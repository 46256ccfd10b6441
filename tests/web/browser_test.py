#!/usr/bin/python3
"""The page of tactiled-web in a headless Chromium, as a person sees it.

    ./node/install-packages.sh browser && /usr/bin/python3 tests/web/browser_test.py
    MINUTES=10 /usr/bin/python3 tests/web/browser_test.py Long      memory of server and page with four clients
    PICTURES=1 /usr/bin/python3 tests/web/browser_test.py Pictures Arrays    writes node/web/*.png

Prints what it measured. Skips without Chromium; TACTILED_MUST=1: fails instead."""
import collections
import json
import math
import os
import pathlib
import shutil
import signal
import socket
import sys
import tempfile
import threading
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/system"))
from array_device import ArrayDevice, array_daemon  # noqa: E402
from daemon import Daemon, wait_for  # noqa: E402
from simulated_node import simulated_node  # noqa: E402
from unit_daemon import CALIBRATION, quality_is, unit_daemon  # noqa: E402
from mcap_bytes import with_checksums  # noqa: E402
from web_server import TOKEN, Stream, Web  # noqa: E402

if not os.environ.get("TACTILED_MUST"):
    for program in ("chromium", "chromedriver"):
        if shutil.which(program) is None:
            print(f"no {program}: ./node/install-packages.sh browser")
            sys.exit(0)
from selenium import webdriver  # noqa: E402
from selenium.webdriver.chrome.options import Options  # noqa: E402
from selenium.webdriver.chrome.service import Service  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402

STALE_LIMIT_S = 0.5
# Noise of 20 mN beside the forces, so that no channel looks frozen; 7 rows, so that the page shows all of them.
ROWS = "".join(f"{n / 200},{1 + (n * 37 % 7 - 3) / 100},{2 + (n * 53 % 7 - 3) / 100},{-3 + (n * 71 % 7 - 3) / 100}\n" for n in range(140))


def browser(folder, width=1000, height=900):
    options = Options()
    options.binary_location = shutil.which("chromium")
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--no-first-run",
                 f"--user-data-dir={folder}", f"--window-size={width},{height}", "--hide-scrollbars"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    return webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)


class Base(unittest.TestCase):
    rows, rate = ROWS, 200

    def setUp(self):
        self.daemon = unit_daemon(self.rows, self.rate).start()
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        wait_for(quality_is(self.daemon, "good"), "a good value")
        self.start_page()

    def start_page(self):
        self.web = self.start_web()
        profile = tempfile.mkdtemp(prefix="tactiled-chromium-")
        self.addCleanup(shutil.rmtree, profile, True)
        self.page = browser(profile)
        self.addCleanup(self.page.quit)
        self.open()

    def start_web(self, **kinds):
        web = Web(self.daemon.name, token=TOKEN, **kinds)
        self.addCleanup(shutil.rmtree, web.folder)
        self.addCleanup(web.__exit__)
        return web

    def open(self):
        self.page.get(f"http://{self.web.host}/")
        wait_for(lambda: not self.is_stale(), "a page that is not stale")

    def js(self, code, *args):
        return self.page.execute_script(code, *args)

    def is_stale(self):
        return self.js("return document.body.classList.contains('stale') && document.getElementById('stale').offsetHeight > 30 && document.title.startsWith('STALE')")

    def shown(self):
        return self.js("return Object.fromEntries([...document.querySelectorAll('[data-sensor=left] [data-component]')].map((r) => [r.dataset.component, [r.querySelector('b').textContent, r.querySelector('small').textContent]]))")

    def text(self, selector):
        return self.js("return document.querySelector(arguments[0]).textContent", selector)


class Delayed:
    """A way to the server on which everything takes `delay_s` in each direction."""

    def __init__(self, port, delay_s):
        self.target, self.delay_s = port, delay_s
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                near, _ = self.listener.accept()
            except OSError:
                return
            far = socket.create_connection(("127.0.0.1", self.target))
            for a, b in ((near, far), (far, near)):
                queue = collections.deque()
                threading.Thread(target=self.take, args=(a, queue), daemon=True).start()
                threading.Thread(target=self.give, args=(b, queue), daemon=True).start()

    def take(self, s, queue):
        data = b"x"
        while data:
            try:
                data = s.recv(1 << 16)
            except OSError:
                data = b""
            queue.append((time.monotonic() + self.delay_s, data))

    def give(self, s, queue):
        while True:
            if not queue:
                time.sleep(0.002)
                continue
            due, data = queue.popleft()
            time.sleep(max(0, due - time.monotonic()))
            try:
                if not data:
                    s.shutdown(socket.SHUT_RDWR)
                s.sendall(data)
            except OSError:
                return


class Page(Base):
    rows = "0,1,2,-3\n0.01,1,2,-3\n"

    def registers(self):
        """Floats of sensor 0 as a PLC reads them."""
        import struct
        from pymodbus.client import ModbusTcpClient
        with ModbusTcpClient("127.0.0.1", port=self.daemon.port) as client:
            words = client.read_holding_registers(2100, count=25, slave=1).registers
        return [round(struct.unpack(">f", struct.pack(">HH", *words[i:i + 2]))[0], 3) for i in range(0, 24, 2)]

    def test_displayed_values_equal_the_registers(self):
        shown = self.shown()
        self.assertEqual({name: value[0] for name, value in shown.items()}, {"fx": "1.000", "fy": "2.000", "fz": "-3.000"})
        floats = self.registers()
        self.assertTrue(any(floats[i:i + 3] == [1, 2, -3] for i in range(10)), floats)
        self.assertEqual(shown["fz"][1], "± 0.010 N")
        self.assertEqual(self.text("[data-sensor=left] .quality"), "● GOOD")

    def test_stale_after_the_daemon_was_killed_and_back_after_it_starts(self):
        self.daemon.process.kill()
        took = self.time_to_stale("kill -9 of the daemon")
        self.assertLess(took, STALE_LIMIT_S)
        self.assertEqual({value[0] for value in self.shown().values()}, {"–"})
        self.assertNotIn("GOOD", self.text("[data-sensor=left] .quality"))
        self.daemon.process.wait()
        self.daemon.start()
        wait_for(lambda: not self.is_stale(), "the successor")
        self.assertEqual(self.shown()["fx"][0], "1.000")
        changes = self.text("#changes")
        self.assertIn("does not respond", changes)
        self.assertIn("started, pid", changes)

    def test_stale_after_the_server_was_killed_and_back_after_it_starts(self):
        self.web.process.kill()
        took = self.time_to_stale("kill -9 of the server")
        self.assertLess(took, STALE_LIMIT_S)
        self.assertEqual({value[0] for value in self.shown().values()}, {"–"})

    def test_stale_where_the_server_hangs_and_the_connection_stays(self):
        self.web.process.send_signal(signal.SIGSTOP)
        took = self.time_to_stale("SIGSTOP of the server")
        self.assertLess(took, STALE_LIMIT_S)
        self.web.process.send_signal(signal.SIGCONT)
        wait_for(lambda: not self.is_stale(), "the server")

    def test_a_way_that_is_slow_from_the_beginning_is_no_zero_of_the_ages(self):
        way = Delayed(self.web.port, 1.0)
        self.addCleanup(way.listener.close)
        self.page.get(f"http://127.0.0.1:{way.port}/")
        wait_for(lambda: "a request takes 2." in self.text("#stale-why"), "the reason")
        until = time.monotonic() + 5
        while time.monotonic() < until:
            self.assertTrue(self.is_stale())
        self.assertEqual({value[0] for value in self.shown().values()}, {"–"})
        way.delay_s = 0.05
        wait_for(lambda: not self.is_stale(), "a faster way")

    def test_a_clock_that_stood_still_makes_the_page_ask_anew(self):
        # A paused virtual machine, with daemon and server in it: from then on all its times are late by the pause.
        self.js("const now = performance.now.bind(performance); performance.now = () => now() + 1500")
        wait_for(self.is_stale, "STALE")
        wait_for(lambda: not self.is_stale(), "a new connection")
        self.js("const now = performance.now.bind(performance); performance.now = () => now() - 4500")  # the browser's machine slept
        time.sleep(0.5)
        wait_for(lambda: not self.is_stale(), "a page that goes on")
        self.web.process.send_signal(signal.SIGSTOP)
        self.addCleanup(self.web.process.send_signal, signal.SIGCONT)
        self.assertLess(self.time_to_stale("SIGSTOP after the clock was set back"), STALE_LIMIT_S)

    def test_a_tab_that_slept_shows_no_old_value_when_it_wakes(self):
        self.page.execute_cdp_cmd("Page.setWebLifecycleState", {"state": "frozen"})
        time.sleep(1)
        self.web.process.send_signal(signal.SIGSTOP)
        self.addCleanup(self.web.process.send_signal, signal.SIGCONT)
        time.sleep(1)
        self.page.execute_cdp_cmd("Page.setWebLifecycleState", {"state": "active"})
        self.assertLess(self.time_to_stale("a sleeping tab, after it woke"), STALE_LIMIT_S)
        self.web.process.send_signal(signal.SIGCONT)
        wait_for(lambda: not self.is_stale(), "the server")

    def test_a_time_without_data_is_no_line_in_the_plot(self):
        self.web.process.send_signal(signal.SIGSTOP)
        time.sleep(2)
        self.web.process.send_signal(signal.SIGCONT)
        wait_for(lambda: not self.is_stale(), "the server")
        gaps = "const p = cards[0].past; return p.t_s.map((t, i) => [t - p.t_s[i - 1], p.columns[0].value[i - 1]]).filter(([d]) => d > 0.5)"
        for _ in range(2):  # first the frames as they arrived, then the history
            found = self.js(gaps)
            self.assertEqual([value for _, value in found], [None] * len(found))
            self.assertTrue(any(1.5 < d < 3 for d, _ in found), found)
            self.page.refresh()
            wait_for(lambda: not self.is_stale(), "the page")

    def test_a_page_that_is_open_for_weeks_keeps_200_changes(self):
        self.js("""for (let id = 1000; id < 3000; ++id)
            source.dispatchEvent(new MessageEvent("changes", {data: JSON.stringify([{id, wall_ms: id, t_s: id, last_t_s: id, times: 1, severity: 0, subject: "x", text: `<b>${id}`}])}))""")
        self.assertEqual(self.js("return [changes.size, document.querySelectorAll('#changes li').length, document.querySelectorAll('#changes b').length]"), [200, 200, 0])
        self.assertIn("<b>2999", self.text("#changes li"))

    def test_the_page_of_an_older_server_loads_itself_anew(self):
        self.js("window.mark = 1; source.dispatchEvent(new MessageEvent('hello', {data: JSON.stringify({...hello, t_s: frame.t_s})}))")
        time.sleep(1)
        self.assertEqual(self.js("return window.mark"), 1)  # a reload of the configuration greets with the same page
        self.js("source.dispatchEvent(new MessageEvent('hello', {data: JSON.stringify({...hello, t_s: frame.t_s, page: 'another'})}))")
        wait_for(lambda: self.js("return window.mark === undefined && document.readyState === 'complete'"), "the new page")
        wait_for(lambda: not self.is_stale(), "values")

    def time_to_stale(self, what):
        began = time.monotonic()
        wait_for(self.is_stale, "STALE")
        took = time.monotonic() - began
        print(f"{what}: STALE after {took:.3f} s")
        return took

    def test_a_tare_works_with_the_token_and_not_without_by_keyboard_alone(self):
        tare = self.page.find_element(By.CSS_SELECTOR, "[data-sensor=left] button[data-command=tare]")
        self.assertFalse(tare.is_enabled())
        field = self.page.find_element(By.ID, "token")
        field.send_keys("wrong-" + TOKEN + Keys.ENTER)
        wait_for(tare.is_enabled, "the buttons")
        tare.send_keys(Keys.ENTER)
        wait_for(lambda: "token is wrong" in self.text("#outcome"), "the refusal")
        self.assertEqual(self.web.status()["sensors"][0]["tare_count"], 0)
        field.send_keys(TOKEN + Keys.ENTER)
        wait_for(tare.is_enabled, "the buttons")
        tare.send_keys(Keys.ENTER)
        wait_for(lambda: self.text("#outcome") == "tare left: done", "the tare")
        wait_for(lambda: self.shown()["fz"][0] == "0.000", "the new zero")

    def test_sixty_seconds_of_history_after_a_reload_and_no_request_leaves_the_machine(self):
        wait_for(lambda: self.js("return cards[0].past.t_s.at(-1) - cards[0].past.t_s[0]") > 61, "a minute", 90)
        self.page.refresh()
        wait_for(lambda: not self.is_stale(), "the page")
        span_s, n = self.js("const t = cards[0].past.t_s; return [t.at(-1) - t[0], t.length]")
        print(f"after a reload: {span_s:.1f} s of history, {n} points")
        self.assertGreater(span_s, 59.5)
        self.assertGreater(n, 1700)
        asked = [json.loads(entry["message"])["message"] for entry in self.page.get_log("performance")]
        urls = {m["params"]["request"]["url"] for m in asked if m["method"] == "Network.requestWillBeSent"}
        self.assertGreater(sum(u.startswith(f"http://{self.web.host}/") for u in urls), 5)
        # data: is in the page; chrome: is the browser's own first page.
        self.assertEqual({u for u in urls if not u.startswith((f"http://{self.web.host}/", "data:", "chrome:"))}, set())
        wrong = [entry for entry in self.page.get_log("browser") if entry["level"] == "SEVERE"]
        self.assertEqual(wrong, [])  # a violation of the content security policy would be here

    def test_a_script_in_a_name_or_a_page_of_another_origin_does_nothing(self):
        self.page.get("data:text/html,<title>x</title>")
        for code in (f"return fetch('http://{self.web.host}/api/status').then(() => 'read', () => 'refused')",
                     f"return fetch('http://{self.web.host}/api/command', {{method: 'POST', mode: 'no-cors', body: '{{}}'}}).then((r) => r.type, () => 'refused')",
                     f"return new Promise((f) => {{ const s = new EventSource('http://{self.web.host}/api/stream'); s.onmessage = () => f('read'); s.onerror = () => f('refused'); }})"):
            self.assertIn(self.js(code), ("refused", "opaque"))
        self.assertEqual(self.web.status()["sensors"][0]["tare_count"], 0)


class Others(Base):
    """Other sets of sensors than one."""

    def setUp(self):
        self.daemon = simulated_node(2)
        self.addCleanup(self.stop_daemon)
        self.start_page()

    def stop_daemon(self):
        self.daemon.__exit__()
        shutil.rmtree(self.daemon.folder)

    def errors(self):
        return [entry for entry in self.page.get_log("browser") if entry["level"] == "SEVERE"]

    def names(self):
        return self.js("return [...document.querySelectorAll('#sensors h3')].map((e) => e.textContent)")

    def test_a_daemon_with_other_sensors_replaces_the_cards(self):
        name = self.daemon.name
        for sensors in (16, 1, 3):
            self.stop_daemon()
            self.daemon = simulated_node(sensors, node=name)
            wait_for(lambda: self.names() == [f"s{n}" for n in range(sensors)] and not self.is_stale(), f"{sensors} sensors")
            wait_for(lambda: self.js("return document.querySelectorAll('#links tbody tr').length") == sensors, "the links")
        self.assertEqual(self.errors(), [])

    def test_sixteen_sensors_with_the_longest_names_fit_on_a_phone(self):
        name = self.daemon.name
        self.stop_daemon()
        self.daemon = simulated_node(16, "a_sensor_with_a_long_name_no_{n:02}", name)
        self.page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 320, "height": 640, "deviceScaleFactor": 2, "mobile": True})
        wait_for(lambda: len(self.names()) == 16 and not self.is_stale(), "16 sensors")
        time.sleep(2)
        self.assertEqual(self.js("""return [...document.querySelectorAll('main *')].filter((e) => !e.closest('.wide') && !e.closest('.uplot') && e.getBoundingClientRect().right > 320.5)
            .map((e) => e.className + e.tagName)"""), [])
        self.assertLessEqual(self.js("return document.documentElement.scrollWidth"), 320)
        self.assertFalse(self.is_stale())
        self.assertEqual(self.errors(), [])

    def test_names_in_a_file_from_anywhere_run_no_script(self):
        name = self.daemon.name
        self.stop_daemon()
        self.daemon = simulated_node(2, "a_sensor_with_a_long_name_no_{n:02}", name)
        file = self.daemon.folder / "odd.mcap"
        self.assertEqual(self.daemon.ctl("record", file, "--node", name, "--seconds", "1").returncode, 0)
        odd = "<img src=x onerror=alert(1)>\"'>".encode()
        file.write_bytes(with_checksums(file.read_bytes().replace(b"a_sensor_with_a_long_name_no_00", odd.ljust(31, b"&"))))
        web = Web("unused", file)
        self.addCleanup(shutil.rmtree, web.folder)
        self.addCleanup(web.__exit__)
        self.page.get(f"http://{web.host}/")
        wait_for(lambda: not self.is_stale(), "the recording")
        self.assertEqual(self.names()[0], odd.decode())
        self.assertEqual(self.js("return document.querySelectorAll('main img').length"), 0)
        self.assertEqual(self.errors(), [])


class Arrays(Base):
    """A pad with taxels that are out, and a curved fingertip."""
    TIP_M = [(8e-3 * math.sin(0.28 * k), 2.4e-3 * row, 8e-3 * math.cos(0.28 * k) - 8e-3) for row in range(-4, 5) for k in range(-4, 5)]

    def setUp(self):
        self.pad, self.tip = (self.enterContext(device) for device in (ArrayDevice("pad", 16, 16), ArrayDevice("tip", values=3, places_m=self.TIP_M)))
        self.pad.body = lambda t_s: (6e-3 * math.sin(t_s / 3), 5e-3 * math.cos(t_s / 4), 4.0, 8e-3)
        self.tip.body = lambda t_s: (2e-3, 3e-3, 1.5 + 0.5 * math.sin(t_s), 5e-3)
        self.pad.missing |= {3, 40, 41}
        self.daemon = array_daemon(self.pad, self.tip, dead=[20, 68])
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        self.start_page()

    def heat(self, sensor):
        """Pixels of the map with a strong colour."""
        return self.js("""const c = document.querySelector(`[data-sensor=${arguments[0]}] .map canvas`), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
            let n = 0; for (let i = 0; i < d.length; i += 4) n += d[i + 3] > 0 && Math.max(d[i], d[i + 1], d[i + 2]) - Math.min(d[i], d[i + 1], d[i + 2]) > 60; return n""", sensor)

    def map_text(self, sensor):
        return self.text(f"[data-sensor={sensor}] .map-text")

    def test_the_maps_show_press_centre_scale_and_the_taxels_that_are_out(self):
        wait_for(lambda: self.heat("pad") > 500 and self.heat("tip") > 300, "colours")
        self.assertRegex(self.map_text("pad"), r"^centre x -?\d+\.\d\d ± 0\.\d\d, y -?\d+\.\d\d ± 0\.\d\d mm; area \d+ ± \d+ mm²; peak 0\.\d+ ± 0\.\d+ N$")
        legend = self.text("[data-sensor=pad] .map-legend")
        self.assertRegex(legend, r"^00\.\d+ N.*dead 2.*$")
        self.assertIn("missing 3", legend)
        self.pad.saturated = {100}
        wait_for(lambda: "saturated 1" in self.text("[data-sensor=pad] .map-legend"), "the saturated taxel")
        wait_for(lambda: self.map_text("pad").startswith("▲ UNCERTAIN"), "the mark")
        self.assertEqual([entry for entry in self.page.get_log("browser") if entry["level"] == "SEVERE"], [])

    def test_a_map_without_new_values_is_empty_within_half_a_second(self):
        def is_empty():
            return self.heat("pad") == 0 and "no values" in self.map_text("pad")
        for what, stop, go in (("a silent server", lambda: self.web.process.send_signal(signal.SIGSTOP), lambda: self.web.process.send_signal(signal.SIGCONT)),
                               ("requests that fail", lambda: self.js("window.before = fetch; fetch = () => Promise.reject(new Error())"), lambda: self.js("fetch = before")),
                               ("requests that hang", lambda: self.js("window.before = fetch; fetch = () => new Promise(() => {})"), lambda: self.js("fetch = before; cards.forEach((c) => { c.map.is_busy = false; })"))):
            wait_for(lambda: self.heat("pad") > 500, "colours")
            began = time.monotonic()
            stop()
            wait_for(is_empty, f"an empty map after {what}")
            took = time.monotonic() - began
            print(f"{what}: the map is empty after {took:.3f} s")
            self.assertLess(took, STALE_LIMIT_S + 0.3)
            go()
        wait_for(lambda: self.heat("pad") > 500, "colours")
        self.pad.is_paused = True
        wait_for(is_empty, "a BAD array")
        self.assertGreater(self.heat("tip"), 300)
        self.web.process.kill()
        wait_for(lambda: self.heat("tip") == 0 and "no values" in self.map_text("tip"), "an empty map of a killed server")

    def test_a_map_asks_five_to_ten_times_a_second_and_only_where_it_can_be_seen(self):
        count = "return performance.getEntriesByType('resource').filter((e) => e.name.includes('/api/array?sensor=pad')).length"
        self.js("performance.setResourceTimingBufferSize(5000)")
        before = self.js(count)
        time.sleep(5)
        rate_Hz = (self.js(count) - before) / 5
        print(f"{rate_Hz:.1f} arrays/s")
        self.assertLess(rate_Hz, 10)
        self.assertGreater(rate_Hz, 2)  # a busy machine
        self.js("document.querySelector('[data-sensor=pad]').style.display = 'none'")
        wait_for(lambda: not self.js("return cards[0].visible"), "the observer")
        time.sleep(0.5)
        before = self.js(count)
        time.sleep(1)
        self.assertEqual(self.js(count), before)

    def test_light_dark_and_phone(self):
        folder = pathlib.Path(tempfile.mkdtemp())
        self.tip.missing.add(10)
        self.pad.saturated = {130}
        time.sleep(8)
        for name, width, height, scheme in (("light", 900, 520, "light"), ("dark", 900, 520, "dark"), ("phone", 390, 844, "light")):
            self.page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": name == "phone"})
            self.page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
            for _ in range(2):  # maps and plots change their sizes first
                self.js("document.querySelector('[data-sensor=pad] .map').scrollIntoView(); window.scrollBy(0, -20)")
                wait_for(lambda: self.heat("pad") > 500, "colours")
                time.sleep(1)
            self.assertLessEqual(self.js("return document.documentElement.scrollWidth"), width, "nothing is cut off at the right")
            self.page.save_screenshot(str(folder / f"{name}.png"))
        if os.environ.get("PICTURES"):
            shutil.copy(folder / "light.png", ROOT / "node/web/arrays.png")
        print(f"pictures in {folder}")


class Pictures(Base):
    """Two jaws press every ten seconds; once a device is silent, and once a channel is missing for a while."""
    CONFIG = """
[[link]]
name = "usb{n}"
driver = "uart"
device = "{{folder}}/dev{n}"
path = "direct"
format = "lines"
channels = 3
sequence = true
simulated = true

[[sensor]]
name = "{name}"
link = "usb{n}"
model = "generic"
calibration = "{{folder}}/unit.toml"
stale_ms = 100
"""

    def setUp(self):
        self.daemon = Daemon("".join(self.CONFIG.format(n=n, name=name) for n, name in enumerate(("left", "right"))), name="gripper")
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        (self.daemon.folder / "unit.toml").write_text(CALIBRATION.replace("100.0, 100.0, 100.0", "10.0, 10.0, 10.0").replace("[0.01, 0.01, 0.01]", "[0.1, 0.15, 0.25]"))
        for n in range(2):
            rows = "t_s,c1,c2,c3\n"
            for k in range(8000):
                press = max(0, 1 - abs((k % 2000) / 800 - 1))
                x = (-1) ** n * 1.2 * press + (k * 37 % 7 - 3) / 100
                y = f"{0.5 * press + (k * 53 % 7 - 3) / 100:.3f}" if n == 0 or not 3000 < k < 3600 else ""
                rows += f"{k / 200},{x:.3f},{y},{-6 * press + (k * 71 % 7 - 3) / 100:.3f}\n"
            (self.daemon.folder / f"rows{n}.csv").write_text(rows)
        self.players = [self.daemon.play("--in", self.daemon.folder / f"rows{n}.csv", "--pty", self.daemon.folder / f"dev{n}", "--format", "lines", "--sequence", "--rate", 200, "--loop")
                        for n in range(2)]
        self.daemon.start()
        self.start_page()

    def test_light_dark_and_phone(self):
        folder = ROOT / "node/web" if os.environ.get("PICTURES") else pathlib.Path(tempfile.mkdtemp())
        wait_for(lambda: "SIMULATED" in self.text("#flags"), "the mark of simulated data")
        time.sleep(40)
        self.players[0].send_signal(signal.SIGSTOP)
        time.sleep(0.6)
        self.players[0].send_signal(signal.SIGCONT)
        time.sleep(22)
        # The canvas has no background: of the band's pixels alpha is up to 0x38. Without it few are left, of the lines' edges.
        pixels = """const p = cards[0].plots[0].plot; if (!arguments[0]) p.bands.forEach((b) => { b.fill = () => null; });
            const keep = arguments[0]; return new Promise((done) => setTimeout(() => {
              const c = p.ctx.canvas, d = p.ctx.getImageData(0, 0, c.width, c.height).data; let n = 0;
              for (let i = 3; i < d.length; i += 4) n += d[i] > 10 && d[i] < 0x40;
              if (!keep) cards[0].plots[0].forget();
              done(n);
            }, 400))"""
        with_band, without = self.js(pixels, True), self.js(pixels, False)
        print(f"{with_band} faint pixels with the band, {without} without")
        self.assertGreater(with_band, 2 * without)
        for name, width, height, scheme in (("light", 900, 800, "light"), ("dark", 900, 800, "dark"), ("phone", 390, 844, "light")):
            self.page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": name == "phone"})
            self.page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
            time.sleep(1)
            self.assertLessEqual(self.js("return document.documentElement.scrollWidth"), width, "nothing is cut off at the right")
            self.page.save_screenshot(str(folder / f"{name}.png"))
        self.daemon.process.kill()
        wait_for(self.is_stale, "STALE")
        time.sleep(0.3)
        self.page.save_screenshot(str(folder / "stale.png"))
        print(f"pictures in {folder}")


class Long(Base):
    def test_memory_with_four_clients(self):
        minutes = float(os.environ.get("MINUTES", "1"))
        stop = threading.Event()

        def client():
            stream = Stream(self.web, timeout=20)
            while not stop.is_set():
                stream.next()
            stream.close()
        clients = [threading.Thread(target=client) for _ in range(3)]
        for each in clients:
            each.start()
        try:
            time.sleep(70)  # the history is full
            heap = "if (window.gc) gc(); return performance.memory.usedJSHeapSize"
            begun = self.web.rss_kB(), self.js(heap), self.web.cpu_s(), time.monotonic()
            time.sleep(60 * minutes)
            ended = self.web.rss_kB(), self.js(heap), self.web.cpu_s(), time.monotonic()
        finally:
            stop.set()
            for each in clients:
                each.join()
        print(f"{minutes:g} min, 4 clients: server {begun[0]} kB -> {ended[0]} kB, {100 * (ended[2] - begun[2]) / (ended[3] - begun[3]):.2f} % of a CPU; "
              f"page's heap {begun[1] / 1e6:.1f} MB -> {ended[1] / 1e6:.1f} MB")
        self.assertFalse(self.is_stale())
        self.assertLess(ended[0] - begun[0], 500)


if __name__ == "__main__":
    unittest.main()
