#!/usr/bin/env python3
"""Every session on every page has the output on the page, in page order, in a fresh folder, as root and as a normal
user.

    pages_test.py                        the sessions, and five planted errors that the test must find
    PAGE=node/guide/plc.md pages_test.py one page
"""
import concurrent.futures
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from daemon import BIN, ROOT
from page_session import FENCE, HARDWARE, commands, faults, matches

MAX_HARDWARE = 15
# Root gives each page a loopback interface of its own, so that several pages can use the ports that they name at once.
OWN_NETWORK = ("unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh")
if os.geteuid() != 0 or subprocess.run([*OWN_NETWORK, "true"], capture_output=True).returncode != 0:
    OWN_NETWORK = ()
USER = 65534  # user "nobody"
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
COMMAND = re.compile(r"(?:^\s+|[\s/$(])tactilectl ([a-z]+)(.*)$")


def pages():
    """Returns each page with a session, the main page first."""
    tracked = shutil.which("git") and subprocess.run(["git", "-C", ROOT, "ls-files", "-co", "--exclude-standard", "*.md"], capture_output=True, text=True)
    if tracked and tracked.returncode == 0:
        files = tracked.stdout.split()
    else:  # an archive, or a machine without git
        files = [str(p.relative_to(ROOT)) for p in ROOT.rglob("*.md") if "build" not in p.relative_to(ROOT).parts]
    return sorted((f for f in files if FENCE.search((ROOT / f).read_text())), key=lambda f: (f != "README.md", f))


class Fresh(unittest.TestCase):
    def fresh(self, uid):
        """Makes a folder like a clone with the built programs, and an environment; they belong to the user."""
        folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-page-"))
        self.addCleanup(shutil.rmtree, folder, True)
        for entry in ROOT.iterdir():
            if entry.name not in ("build", ".git"):
                (folder / entry.name).symlink_to(entry)
        (folder / "build").mkdir()
        (folder / "build/release").symlink_to(BIN.parent)
        run = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-page-", dir="/run" if os.geteuid() == 0 else os.environ["XDG_RUNTIME_DIR"]))
        self.addCleanup(shutil.rmtree, run, True)
        run.chmod(0o755)
        env = {key: value for key, value in os.environ.items() if key in ("PATH", "LANG")}
        env.update(HOME=str(folder), TACTILED_RUNTIME_DIR=str(run), LC_ALL="C.UTF-8", TERM="dumb", TACTILED_BUILT="1")
        before = OWN_NETWORK
        if uid != os.geteuid():
            for path in (folder, folder / "build", run):
                os.chown(path, uid, uid)
            before = (*before, "setpriv", f"--reuid={uid}", f"--regid={uid}", "--clear-groups")
        folder.chmod(0o755)
        return folder, env, before


class Sessions(Fresh):
    def test_each_page_as_root_and_as_a_normal_user(self):
        chosen = [os.environ["PAGE"]] if "PAGE" in os.environ else pages()
        self.assertGreater(len(chosen), 0)
        users = {os.geteuid()}
        if all(path.stat().st_mode & 1 for path in (BIN, *BIN.parents)):
            users |= {USER} if os.geteuid() == 0 else set()
        elif os.geteuid() == 0:
            print(f"as root alone: no other user can reach {BIN}", flush=True)
        sessions = [(page, uid, self.fresh(uid)) for uid in users for page in chosen]

        def judge(session):
            return faults(session[0], (ROOT / session[0]).read_text(), *session[2])

        # The demo weighs in real time: a processor that other pages load makes its sensors stale. Its pages run alone.
        alone = [each for each in sessions if "run.sh" in (ROOT / each[0]).read_text()]
        together = [each for each in sessions if each not in alone]
        with concurrent.futures.ThreadPoolExecutor(3 if OWN_NETWORK else 1) as pool:
            found = [*pool.map(judge, together), *map(judge, alone)]
        for (page, uid, _), errors in zip(together + alone, found, strict=True):
            with self.subTest(page=page, uid=uid):
                self.assertEqual(errors, [])


class Planted(Fresh):
    """The test finds errors of each kind that pages had."""

    PLANTS = [
        ("a wrong option", "--out eflesh.toml", "--output eflesh.toml"),
        ("a file that is not there", "normal_labelled.csv", "normal_labeled.csv"),
        ("a wrong number", "15 channels", "16 channels"),
        ("a misspelt verb", "tactilectl calibrate", "tactilectl calibarte"),
        ("a missing step", "$ PATH=$PWD/build/release/bin:$PATH\n", ""),
    ]

    def test_five_planted_errors_are_found(self):
        page = "node/guide/calibration.md"
        right = (ROOT / page).read_text()
        for what, old, new in self.PLANTS:
            with self.subTest(what):
                self.assertIn(old, right)
                folder, env, before = self.fresh(os.geteuid())
                self.assertNotEqual(faults(page, right.replace(old, new), folder, env, before), [])

    def test_output_is_compared_line_by_line(self):
        self.assertEqual(matches(["a … c", "…", "z"], ["a b c", "anything", "z"]), "")
        self.assertEqual(matches([], []), "")
        for expected, seen in ((["a"], []), ([], ["a"]), (["a 1"], ["a 2"]), (["a", "b"], ["b", "a"]), (["a …"], ["b"]), (["1.5"], ["1x5"])):
            self.assertNotEqual(matches(expected, seen), "", (expected, seen))


class Pages(unittest.TestCase):
    def test_the_main_page_is_short(self):
        self.assertLessEqual(len((ROOT / "README.md").read_text().split()), 900)

    def test_few_commands_need_hardware(self):
        marked = [c for page in pages() for c in commands(page, (ROOT / page).read_text()) if HARDWARE in c.text]
        self.assertLessEqual(len(marked), MAX_HARDWARE)

    def test_the_packaging_recipe_installs_what_it_needs(self):
        """The recipe itself needs root, the network and minutes; it failed for want of `file`, and of GTest."""
        first, second = [line.strip() for line in (ROOT / "systemd/README.md").read_text().splitlines() if line.startswith("    ")][:2]
        self.assertEqual(first, "./node/install-packages.sh build packaging")
        self.assertIn("-DTACTILED_TESTS=OFF", second)
        self.assertIn("--target deb", second)
        lists = dict(re.findall(r"^(\w+)=\(([^)]*)\)", (ROOT / "node/install-packages.sh").read_text(), re.M))
        self.assertLessEqual({"file", "dpkg-dev", "help2man"}, set(lists["packaging"].split()))

    @unittest.skipIf(os.geteuid() != 0, "only root can act as a user without sudo")
    def test_a_user_without_sudo_is_told_what_to_type(self):
        tools = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-tools-", dir="/run"))
        self.addCleanup(shutil.rmtree, tools)
        tools.chmod(0o755)
        for tool in ("bash", "env", "grep", "id"):
            (tools / tool).symlink_to(shutil.which(tool))
        (tools / "script").write_text((ROOT / "node/install-packages.sh").read_text())  # dpkg-query is missing: so is each package
        done = subprocess.run([shutil.which("setpriv"), f"--reuid={USER}", f"--regid={USER}", "--clear-groups", tools / "bash", tools / "script", "packaging"],
                              env={"PATH": str(tools)}, capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("As root: apt-get update && apt-get install --no-install-recommends help2man dpkg-dev file", done.stderr)

    def test_links_of_the_guide_lead_somewhere(self):
        for page in [ROOT / "README.md", *sorted((ROOT / "node/guide").glob("*.md"))]:
            for target in LINK.findall(page.read_text()):
                if "://" not in target:
                    self.assertTrue((page.parent / target).exists(), f"{page}: {target}")

    def test_every_verb_and_option_that_a_page_prints_exists(self):
        """Covers also the commands that are in no session: long ones, and those for a service."""
        def help_of(*words):
            return subprocess.run([BIN / "tactilectl", *words, "--help"], capture_output=True, text=True, check=True).stdout
        verbs = set(re.findall(r"^  ([a-z]+) ", help_of(), re.M)) | {"help"}
        options = {verb: set(re.findall(r"--[a-z][a-z0-9-]*", help_of(verb))) for verb in verbs - {"help"}}
        seen = 0
        for page in ROOT.rglob("*.md"):
            if "build" in page.relative_to(ROOT).parts:
                continue
            for number, line in enumerate(page.read_text().splitlines(), 1):
                if not line.startswith(("    ", "$ ")):
                    continue
                for verb, words in COMMAND.findall(line):
                    seen += 1
                    where = f"{page.relative_to(ROOT)}:{number}: {line.strip()}"
                    self.assertIn(verb, verbs, where)
                    for option in re.findall(r"(?<!\S)\[?(--[a-z][a-z0-9-]*)", re.split(r"\s{3,}|#|;|\|", words)[0]):
                        self.assertIn(option, options[verb], where)
        self.assertGreater(seen, 20)


if __name__ == "__main__":
    unittest.main(verbosity=2)
