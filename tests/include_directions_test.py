#!/usr/bin/env python3
"""include_directions.py on a small tree: each kind of comparison with an entry's name is found, and its near misses are not."""
import contextlib
import io
import pathlib
import tempfile
import unittest
from unittest import mock

import entry_names
import include_directions

ENTRIES = {  # the forms in which entry objects are written
    "drivers/uart.cpp": 'const DriverEntry uart{"uart", make};\nconst DriverEntry tcp{"tcp", make_tcp};\n',
    "drivers/can.cpp": 'const DriverEntry entry{.name = "can", .measures = true, .make = make};\n',
    "drivers/sim/driver.cpp": 'const DriverEntry entry{\n    "sim", [](Options& o) { return o.text("scene"); }};\n',
    "drivers/chips/ad7746.cpp": 'const ChipEntry entry{"ad7746", 0x48, {"a", "b"}, make};\n',
    "drivers/wire/cobs.cpp": 'const StreamFormat format{"cobs", make};  // "lines"\n',
    "drivers/wire/lines.cpp": 'constinit const StreamFormat format("lines", make);\n',
    "decoupling/table/linear.cpp": 'const MethodEntry entry{"table", "linear", make};\n',
    "decoupling/table/map.cpp": 'const MethodEntry entry{.model = "table", .method = "map", .make = make};\n',
    "decoupling/hair/matrix.cpp": 'const MethodEntry entry{\n    .model = "hair", .method = "matrix", .place = 10, .make = make};\n',
    "decoupling/fit/table_fit.cpp": 'constexpr FitEntry kFits[] = {{"table", "linear", fit}, {"table", "bent", fit}};\n',
    "decoupling/decoupler.hpp": 'struct MethodEntry {\n    MethodEntry(std::string_view model, int make);\n    Registry<MethodEntry> in_list{this};\n};\n',
}
FEW = {"driver": 4, "chip": 1, "format": 2, "model": 2, "method": 3, "fit": 2}


class Names(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        for name, text in ENTRIES.items():
            self.write(name, text)
        patch = mock.patch.dict(entry_names.AT_LEAST, FEW)
        patch.start()
        self.addCleanup(patch.stop)

    def write(self, name, text):
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def errors(self, exceptions=None):
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            status = include_directions.main(self.root, exceptions or {})
        lines = output.getvalue().split("\n")
        self.assertEqual(status, 1 if lines[0] else 0)
        return [line for line in lines if line]

    def found(self, code, file="node/a.cpp"):
        self.write(file, code)
        errors = self.errors()
        (self.root / file).unlink()
        return errors

    def test_the_tree_itself_has_no_error(self):
        self.assertEqual(self.errors(), [])

    def test_a_comparison_is_found(self):
        for code in ('if (driver == "sim") f();', 'if (driver != "sim") f();', 'if ("sim" == link.driver) f();',
                     'const bool a = model == "hair" ? 1 : 0;', 'if (x == std::string_view("cobs")) f();',
                     'if (x == std::string{"cobs"}) f();', 'if ("cobs"sv == x) f();', 'if (x == "cobs"sv) f();',
                     'if (std::string_view(plan.method) == "matrix") f();', 'if (decoupler->method() == "map") f();',
                     'if (c.chip\n    == "ad7746") f();', 'if (fit == "bent") f();', 'if (x == R"(sim)") f();'):
            with self.subTest(code):
                errors = self.found("\n" + code + "\n")
                self.assertEqual(len(errors), 1, errors)
                self.assertIn("node/a.cpp:", errors[0])
                self.assertIn("compares", errors[0])

    def test_a_search_is_found(self):
        for code in ('name.compare("sim") == 0;', 'std::strcmp(name, "sim") == 0;', 'driver.starts_with("can");',
                     'find_driver("sim")->make();', 'std::find(names.begin(), names.end(), "hair");', 'methods.count("map");'):
            with self.subTest(code):
                self.assertEqual(len(self.found(code)), 1)

    def test_a_table_a_constant_an_index_and_a_case_are_found(self):
        for code in ('const Row kRows[] = {{"sim", 1}, {"other", 2}};', 'const std::map<std::string, int> a{{"x", 1}, {"hair", 2}};',
                     'options.one_of("format", {"cobs", "other"});', 'verb->check(IsMember({"x", "lines"}));',
                     'constexpr std::string_view kSim = "sim";', 'constexpr std::string_view kSim{"sim"};', 'makers["hair"] = make;',
                     'switch (hash(name)) { case hash("hair"): f(); }'):
            with self.subTest(code):
                self.assertEqual(len(self.found(code)), 1, self.found(code))

    def test_near_misses_are_not_found(self):
        for code in ('if (channel == "map") f();', 'if (sensor.channels[0] == "map") f();', 'if (verb == "map") f();', 'add_verb(app, "map", "The map");',
                     'file.has("matrix"); file.rows("matrix");', 'parameters.find("linear");', 'tables["map"];', '// driver == "sim"',
                     '/* x == "sim" */', 'log("driver == \\"sim\\"");', 'throw Error("not \\"sim\\"");', 'options.one_of("course", {"linear", "smooth"});',
                     'if (driver == "simulator") f();', 'if (word == "other") f();', 'thread_.start("sim", 0);',
                     'const CostEntry cost{"map", "density", measure};', 'cost.columns = {"map", "points"};', 'constexpr const char* kTables[] = {"map", "other"};', '#include "table"'):
            with self.subTest(code):
                self.assertEqual([e for e in self.found(code) if "may not include" not in e], [])

    def test_a_name_is_free_in_its_own_files(self):
        for file, name in (("drivers/uart.cpp", "tcp"), ("drivers/can_plan.cpp", "can"), ("drivers/sim/scene.cpp", "sim"),
                           ("decoupling/hair/setup.cpp", "hair")):
            with self.subTest(file):
                before = ENTRIES.get(file, "")
                self.assertEqual(self.found(f'{before}bool a = x == "{name}";', file), [])
                self.write(file, before)
        for file, name in (("drivers/uart.cpp", "can"), ("drivers/canopen.cpp", "can"), ("decoupling/table/setup.cpp", "map"),
                           ("decoupling/hair/setup.cpp", "table"), ("decoupling/hair.cpp", "hair")):
            with self.subTest(file):
                before = ENTRIES.get(file, "")
                self.assertEqual(len(self.found(f'{before}bool a = x == "{name}";', file)), 1)
                self.write(file, before)

    def test_exceptions_are_few_and_needed(self):
        self.write("node/a.cpp", 'bool a = x == "sim";')
        self.assertEqual(self.errors({"node/a.cpp": ("sim", "why")}), [])
        self.assertIn('the exception for "can" in node/a.cpp is no longer needed',
                      self.errors({"node/a.cpp": ("sim can", "why")})[0])
        many = {f"node/a{i}.cpp": ("sim", "why") for i in range(11)}
        for file in many:
            self.write(file, 'bool a = x == "sim";')
        self.assertTrue(any("at most 10" in e for e in self.errors(many)))

    def test_entries_that_are_not_found_are_an_error(self):
        for file in ENTRIES:
            if file in ("decoupling/decoupler.hpp",):
                continue
            with self.subTest(file):
                self.write(file, ENTRIES[file].replace("Entry ", "Thing ").replace("StreamFormat ", "Thing "))
                self.assertTrue(any("adapt ENTRIES" in e for e in self.errors()), file)
                self.write(file, ENTRIES[file])
        self.write("drivers/can.cpp", "const DriverEntry entry{kName, make};\n")
        self.assertTrue(any("no name as a string literal" in e for e in self.errors()))
        self.write("drivers/can.cpp", 'const DriverEntry entry{.name = kName, .unit = "can"};\n')
        self.assertTrue(any("no name as a string literal" in e for e in self.errors()))

    def test_includes(self):
        self.write("drivers/b.cpp", '#include "decoupling/decoupler.hpp"\n#include <toml++/toml.h>\n')
        errors = self.errors()
        self.assertIn("drivers/b.cpp:1: may not include decoupling/decoupler.hpp", errors[0])
        self.assertIn("drivers/b.cpp:2: toml++/toml.h belongs in config/", errors[1])

    def test_a_quality_is_computed(self):
        for code in ("s.quality = TACTILED_GOOD;", "Sample s{.quality = TACTILED_UNCERTAIN};", "s.quality = ok ? TACTILED_GOOD : 0;",
                     "std::uint32_t quality{TACTILED_GOOD};", "out.sensor_quality[n] = TACTILED_GOOD;"):
            with self.subTest(code):
                self.write("node/a.cpp", code)
                self.assertIn("node/a.cpp:1: chooses a quality", "".join(self.errors()))
        for code in ("s.quality = TACTILED_BAD;", "if (s.quality == TACTILED_GOOD) return;", "s.quality = other.quality;",
                     "s.quality = tactiled_verdict(s.reasons, has_value);", "out = s.quality == TACTILED_GOOD ? bit : 0u;"):
            with self.subTest(code):
                self.write("node/a.cpp", code)
                self.assertEqual(self.errors(), [])
        self.write("node/a.cpp", "")
        self.write("node/include/tactiled/layout.h", "tool->quality = TACTILED_GOOD;")
        self.assertEqual(self.errors(), [])


if __name__ == "__main__":
    unittest.main()
