#!/bin/sh
# Runs the benchmarks that pages cite, writes tests/figures/results.json, and renders tests/bench/RESULTS.md and the figures on
# other pages. Options: tests/figures.sh --help
cd "$(dirname "$0")/.." || exit 1
exec /usr/bin/python3 tests/figures/figures.py "$@"
