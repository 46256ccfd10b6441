#!/usr/bin/env python3
"""The Debian packages in a fresh Debian: installed, upgraded, removed and purged, as dpkg does it on a user's machine.

    cmake --build --preset release --target deb && /usr/bin/python3 tests/package/package_test.py

Needs root, debootstrap, lintian, and once the network. Skips where it cannot run, and says why; TACTILED_MUST=1: fails instead."""
import os
import pathlib
import re
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
ROOT = pathlib.Path(__file__).resolve().parents[2]
DEB = ROOT / "build/release/deb"
# Folder of the trees. Outside the build folder: a tree is a Debian, and outlives a build.
TREES = pathlib.Path(os.environ.get("TREES", "/var/tmp/tactiled-trees"))
# Files that belong to dpkg, apt and the tools for users.
BOOKKEEPING = re.compile(r"/(var/(lib/(dpkg|apt|systemd/deb-systemd-helper-enabled)|log|cache)|etc/(passwd|group|shadow|gshadow|\.pwd\.lock|subuid|subgid)-?$"
                         r"|srv/deb|tmp|proc|run/lock|etc/ld.so.cache)")


def cannot(test, why):
    if os.environ.get("TACTILED_MUST"):
        test.fail(why)
    test.skipTest(why)


class Tree:
    """A Debian in a folder; commands in it have a mount namespace of their own, which ends with them."""

    def __init__(self, path):
        self.path = path

    def run(self, *words, status=0):
        script = ('tree=$1; shift; mount -t proc proc "$tree/proc"; mount -t tmpfs tmpfs "$tree/dev/shm" 2>/dev/null || '
                  '{ mkdir -p "$tree/dev/shm"; mount -t tmpfs tmpfs "$tree/dev/shm"; }; '
                  'exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 chroot "$tree" "$@"')
        done = subprocess.run(["unshare", "--mount", "--propagation", "private", "bash", "-c", script, "_", self.path, *map(str, words)],
                              capture_output=True, text=True, timeout=300)
        assert status is None or done.returncode == status, f"{words}: {done.returncode}\n{done.stdout}{done.stderr}"
        return done.stdout + done.stderr

    def files(self):
        """Returns every path except bookkeeping of other programs, with the lines of files on users and groups."""
        found = {f"/{p.relative_to(self.path)}" for p in self.path.rglob("*")}
        found = {p for p in found if not BOOKKEEPING.match(p)}
        for table in ("passwd", "group", "shadow", "gshadow"):
            found |= {f"{table}: {line.split(':')[0]}" for line in (self.path / "etc" / table).read_text().splitlines()}
        return found


def deb(name):
    return next(DEB.glob(f"{name}_*.deb"))


def make_tree(test, name, packages):
    made = subprocess.run([pathlib.Path(__file__).parent / "tree.sh", TREES / name, packages], capture_output=True, text=True, timeout=580)
    if made.returncode == 77:
        cannot(test, made.stderr.strip())
    assert made.returncode == 0, made.stderr
    return Tree(TREES / name)


def dependencies(package):
    """Returns the dependencies of a package, each the first of its alternatives."""
    text = subprocess.run(["dpkg-deb", "-f", deb(package), "Depends"], capture_output=True, text=True, check=True).stdout
    return [re.match(r"\S+", part.strip()).group(0).split("|")[0] for part in text.split(",")]


def next_version(folder):
    """The same package with a higher version."""
    subprocess.run(["dpkg-deb", "-R", deb("tactiled"), folder / "next"], check=True)
    control = folder / "next/DEBIAN/control"
    control.write_text(re.sub(r"^Version: (.*)$", r"Version: \1+next", control.read_text(), flags=re.M))
    subprocess.run(["dpkg-deb", "-b", folder / "next", folder / "next.deb"], check=True, capture_output=True)


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        TREES.mkdir(parents=True, exist_ok=True)
        cls.ready = make_tree(cls(), "ready", ",".join(dependencies("tactiled")))

    def setUp(self):
        path = TREES / "package"
        subprocess.run(f"rm -rf {path} && cp -a {self.ready.path} {path}", shell=True, check=True)
        self.tree = Tree(path)
        self.before = self.tree.files()

    def install(self):
        return self.tree.run("dpkg", "-i", "/srv/deb/" + deb("tactiled").name)

    def configure(self):
        """Configures the daemon like a user: the example, and an own calibration."""
        self.tree.run("cp", "/usr/share/doc/tactiled/examples/simulated.toml", "/etc/tactiled/tactiled.toml")
        (self.tree.path / "etc/tactiled/mine.toml").write_text("# work\n")
        self.tree.run("install", "-d", "-o", "tactiled", "-g", "tactile", "/var/lib/tactiled")
        (self.tree.path / "var/lib/tactiled/gripper.settings.toml").write_text("# saved by a PLC\n")

    def test_installing_makes_the_user_in_the_groups_of_its_devices_and_no_other(self):
        self.install()
        self.assertEqual(set(self.tree.run("id", "-nG", "tactiled").split()), {"tactile", "dialout", "i2c", "gpio"})
        self.assertIn("nologin", self.tree.run("getent", "passwd", "tactiled"))

    def test_the_service_is_enabled_and_waits_for_a_configuration(self):
        self.install()
        self.assertEqual(self.tree.run("systemctl", "is-enabled", "tactiled").strip(), "enabled")
        unit = (self.tree.path / "usr/lib/systemd/system/tactiled.service").read_text()
        condition = re.search(r"^ConditionPathExists=(.*)$", unit, re.M).group(1)
        self.assertIn(condition, unit.split("ExecStart=")[1].split("\n")[0])
        self.assertFalse((self.tree.path / condition[1:]).exists())
        self.assertTrue((self.tree.path / condition[1:]).parent.is_dir())

    def test_the_example_without_hardware_is_good_and_runs(self):
        self.install()
        self.configure()
        self.tree.run("tactiled", "--check", "--config", "/etc/tactiled/tactiled.toml")
        said = self.tree.run("bash", "-c", "mkdir -p /run/tactiled; tactiled & for i in $(seq 50); do sleep 0.1; "
                             "tactilectl status && break; done; kill %1; wait %1")
        self.assertRegex(said, r"left .* uncertain:sd-unknown")

    def test_it_needs_no_library_of_fits_and_the_laboratory_is_a_package_of_its_own(self):
        for name in ("ceres", "lapack", "cholmod", "glog", "atlas", "blas"):
            self.assertNotIn(name, " ".join(dependencies("tactiled")))
        self.assertIn("libcholmod", " ".join(dependencies("tactiled-lab")))
        self.install()
        self.assertIn("tactiled-lab, which is not installed", self.tree.run("tactilectl", "calibrate", status=2))

    def test_an_upgrade_keeps_configuration_state_and_the_request_not_to_start(self):
        self.install()
        self.configure()
        self.tree.run("systemctl", "disable", "tactiled")
        next_version(self.tree.path / "srv/deb")
        self.tree.run("dpkg", "-i", "/srv/deb/next.deb")
        self.assertIn("+next", self.tree.run("dpkg-query", "-W", "-f", "${Version}", "tactiled"))
        self.assertEqual(self.tree.run("systemctl", "is-enabled", "tactiled", status=None).strip(), "disabled")
        for kept in ("etc/tactiled/tactiled.toml", "etc/tactiled/mine.toml", "var/lib/tactiled/gripper.settings.toml"):
            self.assertTrue((self.tree.path / kept).exists(), kept)

    def test_removing_keeps_what_a_user_made_and_purging_keeps_only_their_files(self):
        self.install()
        self.configure()
        self.tree.run("dpkg", "-r", "tactiled")
        for path, there in (("usr/bin/tactiled", False), ("var/lib/tactiled/gripper.settings.toml", True), ("etc/tactiled/mine.toml", True)):
            self.assertEqual((self.tree.path / path).exists(), there, path)
        self.tree.run("dpkg", "--purge", "tactiled")
        self.assertEqual(self.tree.files() - self.before - {"group: i2c", "group: gpio", "gshadow: i2c", "gshadow: gpio"},
                         {"/etc/tactiled", "/etc/tactiled/tactiled.toml", "/etc/tactiled/mine.toml"})

    def test_after_a_purge_nothing_is_left_but_two_groups(self):
        """i2c and gpio are names that i2c-tools and Raspberry Pi OS use, too, so the creator of the groups is
        unknown."""
        self.install()
        self.tree.run("install", "-d", "-o", "tactiled", "-g", "tactile", "/var/lib/tactiled")
        self.tree.run("dpkg", "--purge", "tactiled")
        self.assertEqual(self.tree.files() - self.before, {"group: i2c", "group: gpio", "gshadow: i2c", "gshadow: gpio"})
        self.assertEqual(self.before - self.tree.files(), set())

    def test_lintian_finds_nothing(self):
        try:
            for package in sorted(DEB.glob("*.deb")):
                done = subprocess.run(["lintian", "--allow-root", package], capture_output=True, text=True)
                self.assertEqual((done.returncode, done.stdout), (0, ""), package.name)
        except FileNotFoundError:
            cannot(self, "lintian is missing: apt install lintian")


if __name__ == "__main__":
    unittest.main(verbosity=2)
