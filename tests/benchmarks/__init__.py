"""Benchmarks; `python -m tests.benchmarks` prints their table. Speeds are ratios of things measured in one run."""
