"""Dozens of variables over many runs, from a file: `rope_twin study`."""
