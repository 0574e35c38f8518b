"""Robustness tests of the rope solver: `python -m validation --hard-cases`."""
