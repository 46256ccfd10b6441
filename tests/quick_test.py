#!/usr/bin/env python3
"""quick.sh on a repository with the product's sources, whose build has one small program: finds each planted defect, and none without."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = """cmake_minimum_required(VERSION 3.25)
project(small LANGUAGES CXX)
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
find_package(GTest REQUIRED)
add_executable(drivers_test drivers/planted.cpp tests/unit/drivers/planted_test.cpp)
target_include_directories(drivers_test PRIVATE ${PROJECT_SOURCE_DIR})
target_compile_options(drivers_test PRIVATE -O0 -fpch-preprocess)
target_precompile_headers(drivers_test PRIVATE <string>)
target_link_libraries(drivers_test PRIVATE GTest::gtest_main)
"""
HEADER = """#pragma once
#include <string>
std::size_t twice(std::string text);
"""
SOURCE = """#include "drivers/planted.hpp"

#include <utility>

std::size_t twice(std::string text) {
    const std::string moved = std::move(text);
    return 2 * moved.size();
}
"""
TEST = """#include "drivers/planted.hpp"

#include <gtest/gtest.h>

TEST(Planted, Doubles) { EXPECT_EQ(twice("two"), 6U); }
"""
SCRIPT = "#!/bin/bash\necho planted\n"
# Check: (file, text, its replacement, what the report must say)
DEFECTS = {
    "format": ("drivers/planted.hpp", "std::size_t twice(", "std::size_t   twice(", r"drivers/planted\.hpp:4:\d+: error: code should be clang-formatted"),
    "includes": ("drivers/planted.hpp", "#include <string>", '#include <string>\n#include "decoupling/accuracy.hpp"',
                 r"drivers/planted\.hpp:3: may not include decoupling/accuracy\.hpp"),
    "prose": ("drivers/planted.cpp", "    return", "    // The lenght is doubled.\n    return", r"drivers/planted\.cpp:7: lenght \(1 times\)"),
    "language": ("config/README.md", "# ", "Whether this is a sentence is open.\n\n# ", r"config/README\.md:1"),
    "clang-tidy": ("drivers/planted.cpp", "return 2 * moved.size()", "return moved.size() + text.size()",
                   r"drivers/planted\.cpp:8:\d+: error: 'text' used after it was moved \[bugprone-use-after-move"),
    "units": ("tests/unit/drivers/planted_test.cpp", "6U", "7U", r"\[  FAILED  \] Planted\.Doubles"),
    "shell": ("tests/planted.sh", "echo planted", "if echo planted", r"tests/planted\.sh: line 4: syntax error"),
    "python": ("tests/planted.py", "print()", "return", r'File "tests/planted\.py", line 1'),
}
NEEDS = {"format": "clang-format-14", "clang-tidy": "clang-tidy-14", "prose": "hunspell"}


def can_run(check):
    return check not in NEEDS or shutil.which(NEEDS[check]) is not None


class Quick(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.root = pathlib.Path(folder.name, "small")
        cls.environment = {k: v for k, v in os.environ.items() if not k.startswith(("GIT_", "QUICK_", "TACTILED_MUST"))}
        inner = {str(path) for path in (ROOT / "tests").iterdir() if path.is_dir()}
        shutil.copytree(ROOT, cls.root, ignore=lambda of, names: [
            name for name in names if name in (".git", "__pycache__") or name.startswith("build") or os.path.join(of, name) in inner])
        for name, text in {"CMakeLists.txt": BUILD, "drivers/planted.hpp": HEADER, "drivers/planted.cpp": SOURCE, "tests/planted.sh": SCRIPT,
                           "tests/planted.py": "print()\n", "tests/unit/drivers/planted_test.cpp": TEST}.items():
            cls.write(name, text)
        subprocess.run([cls.root / "tests/language_check.py", "--record"], cwd=cls.root, env=cls.environment, stdout=subprocess.DEVNULL, check=True)
        cls.git("init", "--quiet")
        cls.commit("base")

    @classmethod
    def write(cls, name, text):
        (cls.root / name).parent.mkdir(parents=True, exist_ok=True)
        (cls.root / name).write_text(text)

    @classmethod
    def git(cls, *words):
        subprocess.run(["git", "-c", "user.name=test", "-c", "user.email=test@localhost", *words], cwd=cls.root, env=cls.environment, check=True)

    @classmethod
    def commit(cls, subject):
        cls.git("add", "--all")
        cls.git("commit", "--quiet", "--message", subject)

    def quick(self, *words, **environment):
        done = subprocess.run([self.root / "tests/quick.sh", *words], env={**self.environment, **environment}, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, check=False)
        return done.returncode, done.stdout

    def edit(self, name, old, new):
        text = (self.root / name).read_text()
        self.assertIn(old, text)
        self.write(name, text.replace(old, new, 1))

    def test_each_planted_defect_is_found_and_none_without(self):
        for name in ("drivers/planted.hpp", "drivers/planted.cpp", "tests/planted.sh", "tests/planted.py"):
            self.write(name, (self.root / name).read_text() + ("//" if name.endswith("pp") else "#") + " A comment at the end.\n")
        self.commit("a change without a defect")
        status, output = self.quick()
        self.assertEqual(status, 0, output)
        for check in DEFECTS:
            self.assertRegex(output, rf"(?m)^ *[\d.]+ s  {check} ", output)

        for number, (name, old, new, _) in enumerate(DEFECTS.values()):
            self.edit(name, old, new)
            if number == 2:
                self.commit("a part of the defects")
        self.write("drivers/untracked.hpp", '#include "node/log.hpp"\n')
        status, output = self.quick("HEAD~2")
        self.assertEqual(status, 1, output)
        self.assertIn("drivers/untracked.hpp:1: may not include node/log.hpp", output)
        reports = dict(re.findall(r"(?ms)^---- (\S+)\n(.*?)(?=^---- |\Z)", output))
        for check, (*_, said) in DEFECTS.items():
            with self.subTest(check):
                if can_run(check):
                    self.assertRegex(output, rf"(?m)^ *[\d.]+ s  {check} .*: FAILED$")
                    self.assertRegex(reports.get(check, ""), said)

    def test_a_missing_program_skips_its_check_or_fails_it(self):
        self.edit("drivers/planted.cpp", "2 *", "2U *")
        self.addCleanup(self.git, "checkout", "--quiet", ".")
        programs = self.root.parent / "programs"  # for as long as the build folder, which keeps their paths
        programs.mkdir()
        for program in pathlib.Path("/usr/bin").iterdir():
            if program.name != "clang-tidy-14":
                (programs / program.name).symlink_to(program)
        status, output = self.quick("HEAD", PATH=str(programs))
        self.assertRegex(output, r"clang-tidy +skipped: clang-tidy-14 is missing")
        self.assertEqual(status, 0, output)
        status, output = self.quick("HEAD", PATH=str(programs), TACTILED_MUST="1")
        self.assertEqual(status, 1, output)

    def test_the_hook_is_written_and_the_hook_of_another_stays(self):
        hook = self.root / ".git/hooks/pre-push"
        for _ in range(2):
            self.assertEqual(self.quick("--install")[0], 0)
        self.assertRegex(hook.read_text(), "tests/quick.sh")
        self.assertTrue(os.access(hook, os.X_OK))
        hook.write_text("#!/bin/sh\n")
        self.assertEqual(self.quick("--install")[0], 1)
        self.assertEqual(hook.read_text(), "#!/bin/sh\n")

    def test_an_unknown_base_is_refused(self):
        status, output = self.quick("no_such_commit")
        self.assertEqual(status, 2)
        self.assertIn("no_such_commit", output)


if __name__ == "__main__":
    if not shutil.which("git"):
        sys.exit(77)
    unittest.main()
