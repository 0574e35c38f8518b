"""Lift planning: limiting sea states, loads, load chart, report, and how often the weather allows.

`plan` runs a plan file from Python; on the command line it is `rope_twin plan`.
"""
