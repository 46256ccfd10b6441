#!/usr/bin/env python3
"""Each bug of targets.toml can still be put where it says: its line stands there once. The ordinary run has no fuzzers to tell."""
import pathlib
import tomllib
import unittest

HERE = pathlib.Path(__file__).resolve().parent


class Plants(unittest.TestCase):
    def test_each_line_stands_once_in_its_file(self):
        plants = [(name, plant) for name, about in tomllib.loads((HERE / "targets.toml").read_text()).items() for plant in about["plants"]]
        self.assertGreater(len(plants), 50)
        for name, plant in plants:
            with self.subTest(target=name, file=plant["file"], line=plant["is"]):
                self.assertEqual((HERE.parents[1] / plant["file"]).read_text().count(plant["is"]), 1)


if __name__ == "__main__":
    unittest.main()
