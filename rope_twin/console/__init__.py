"""Operator console: a web page with the numbers of a running twin, or of a recorded run."""
