"""The installed files: headers, package files and the Python module, used as in a user's build."""
import gzip
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from daemon import BIN, ROOT, Daemon
from map_test import CONFIG


def example(language, node):
    """Returns the example of node/guide/programs.md in that language, with the name of the test's own node."""
    text = re.search(rf"```{language}\n(.*?)```", (ROOT / "node/guide/programs.md").read_text(), re.S).group(1)
    return text.replace('"gripper"', f'"{node}"')


CMAKE = """
cmake_minimum_required(VERSION 3.16)
project(user C CXX)
find_package(tactiled 0.1 REQUIRED)
add_executable(example_c example.c)
add_executable(example_cxx example.cpp)
target_link_libraries(example_c PRIVATE tactiled::reader)
target_link_libraries(example_cxx PRIVATE tactiled::reader)
set_target_properties(example_cxx PROPERTIES CXX_STANDARD 17)
"""


SLEEPER = """
#include <stdio.h>
#include <sys/resource.h>
#include <tactiled/reader.h>
int main(int n, char **words) { /* waits for two seconds: size of time_t, whether it can be woken, samples, ms of CPU */
    struct tactiled_reader reader;
    struct tactiled_sample s;
    struct rusage used;
    const uint64_t until_ns = tactiled_now_ns() + 2000000000u;
    int samples = 0;
    tactiled_reader_init(&reader, words[n - 1], "table");
    while (tactiled_now_ns() < until_ns) samples += tactiled_reader_wait(&reader, &s, 100, TACTILED_BLOCK);
    getrusage(RUSAGE_SELF, &used);
    printf("%d %d %d %ld\\n", (int)sizeof(time_t), reader.wake != NULL, samples,
           (long)(used.ru_utime.tv_sec + used.ru_stime.tv_sec) * 1000 +
               (long)(used.ru_utime.tv_usec + used.ru_stime.tv_usec) / 1000);
    return 0;
}
"""


class Installed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-install-"))
        cls.prefix = cls.folder / "usr"
        subprocess.run(["cmake", "--install", BIN.parent, "--prefix", cls.prefix], check=True, capture_output=True)
        (cls.folder / "CMakeLists.txt").write_text(CMAKE)
        cls.daemon = Daemon(CONFIG)
        (cls.folder / "example.c").write_text(example("c", cls.daemon.name))
        (cls.folder / "example.cpp").write_text(example("cpp", cls.daemon.name))
        cls.daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", cls.daemon.folder / "table", "--format", "cobs",
                        "--bits", "32", "--counts-per-unit", "1e9", "--loop")
        cls.daemon.start()

    @classmethod
    def tearDownClass(cls):
        cls.daemon.__exit__()
        shutil.rmtree(cls.folder)

    def lines_of(self, *words):
        out = subprocess.run(words, capture_output=True, text=True, timeout=30, check=True).stdout
        return [line for line in out.splitlines() if re.fullmatch(r"\S+ N(, uncertain)?", line)]

    def test_pkg_config_builds_the_c_example(self):
        where = {**os.environ, "PKG_CONFIG_PATH": str(self.prefix / "share/pkgconfig")}
        words = subprocess.run(["pkg-config", "--cflags", "tactiled >= 0.1"], env=where,
                               capture_output=True, text=True, check=True).stdout.split()
        for standard in ("-std=gnu11", "-std=gnu17"):
            subprocess.run(["cc", "-Wall", "-Wextra", "-Werror", standard, *words, self.folder / "example.c", "-o",
                            self.folder / "c"], check=True)
        self.assertEqual(len(self.lines_of(self.folder / "c")), 100)

    def test_find_package_builds_both_examples(self):
        build = self.folder / "build"
        subprocess.run(["cmake", "-G", "Ninja", "-S", self.folder, "-B", build, f"-DCMAKE_PREFIX_PATH={self.prefix}"], check=True,
                       capture_output=True)
        subprocess.run(["cmake", "--build", build], check=True, capture_output=True)
        for program in ("example_c", "example_cxx"):
            self.assertEqual(len(self.lines_of(build / program)), 100, program)
        (self.folder / "CMakeLists.txt").write_text(CMAKE.replace("tactiled 0.1", "tactiled 9.0"))
        refused = subprocess.run(["cmake", "-G", "Ninja", "-S", self.folder, "-B", self.folder / "other",
                                  f"-DCMAKE_PREFIX_PATH={self.prefix}"], capture_output=True, text=True)
        self.assertNotEqual(refused.returncode, 0)
        (self.folder / "CMakeLists.txt").write_text(CMAKE)

    def test_the_examples_name_a_wrong_sensor(self):
        """The one on the page, table, is a word of theirs: a user types another one."""
        for file, compiler in (("wrong.c", ["cc", "-std=gnu11"]), ("wrong.cpp", ["c++", "-std=c++17"])):
            source = example(file.split(".")[1], self.daemon.name).replace('"table"', '"tabel"')
            (self.folder / file).write_text(source)
            subprocess.run([*compiler, f"-I{self.prefix}/include", self.folder / file, "-o", self.folder / "wrong"], check=True)
            seen = subprocess.run([self.folder / "wrong"], capture_output=True, text=True, timeout=30)
            self.assertEqual(seen.stdout, "")
            self.assertIn('has no sensor "tabel"; it has: table', seen.stderr, file)
        source = example("python", self.daemon.name).replace('"table"', '"tabel"')
        seen = subprocess.run(["/usr/bin/python3", "-c", source], env={**os.environ, "PYTHONPATH": str(ROOT / "node/python")},
                              capture_output=True, text=True, timeout=30)
        self.assertNotEqual(seen.returncode, 0)
        self.assertIn('has no sensor "tabel"; it has: table', seen.stderr)

    def build_32_bit(self, source, *flags):
        program = self.folder / "c32"
        built = subprocess.run(["cc", "-m32", "-Wall", "-Wextra", "-std=gnu11", *flags, f"-I{self.prefix}/include",
                                self.folder / source, "-o", program], capture_output=True, text=True)
        if "bits/libc-header-start.h" in built.stderr or "cannot find" in built.stderr:
            self.skipTest("no 32-bit C library here: apt install gcc-multilib")
        self.assertEqual((built.returncode, built.stderr), (0, ""))
        return program

    def test_a_32_bit_reader_sees_the_same(self):
        self.assertEqual(len(self.lines_of(self.build_32_bit("example.c"))), 100)

    def test_a_32_bit_reader_sleeps_whatever_its_time_t(self):
        (self.folder / "sleeper.c").write_text(SLEEPER)
        for size, flags in ((4, ()), (8, ("-D_FILE_OFFSET_BITS=64", "-D_TIME_BITS=64"))):
            with self.subTest(time_t=size):
                program = self.build_32_bit("sleeper.c", *flags)
                out = subprocess.run([program, self.daemon.name], capture_output=True, text=True, timeout=30, check=True).stdout
                time_t, woken, samples, cpu_ms = map(int, out.split())
                self.assertEqual((time_t, woken), (size, 1))
                self.assertGreater(samples, 100)
                self.assertLess(cpu_ms, 100)  # 4 to 9; 430 if the kernel misreads the limit as 0

    def test_the_python_module_is_found(self):
        environment = {**os.environ, "PYTHONPATH": str(self.prefix / "lib/python3/dist-packages")}
        out = subprocess.run(["/usr/bin/python3", "-c", example("python", self.daemon.name)], env=environment, capture_output=True,
                             text=True, timeout=30, check=True).stdout
        self.assertEqual(len(out.splitlines()), 100)

    def test_the_manual_page_is_there(self):
        with gzip.open(self.prefix / "share/man/man7/tactiled-registers.7.gz", "rt") as page:
            self.assertIn("MAGIC0", page.read())

    def test_tradeoff_finds_its_scenes(self):
        done = subprocess.run([self.prefix / "bin/tactilectl", "tradeoff", "--scene", self.prefix / "share/tactiled/scenes/tradeoff_hair_easy.toml",
                               "--samples", "10"], capture_output=True, text=True, timeout=60, check=True)
        self.assertIn("hair: ", done.stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
