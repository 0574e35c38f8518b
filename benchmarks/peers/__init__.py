"""The race against other codes at equal error: `python -m benchmarks peers`."""
