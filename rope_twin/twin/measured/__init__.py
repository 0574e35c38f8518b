"""Measured tension, line out and payload depth: checks, and comparison with the twin."""
