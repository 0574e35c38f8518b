"""Banded direct solvers of the node equations: node algebra and sweeps."""
