"""Benchmarks of rope_twin from a clone: `python -m benchmarks`."""
