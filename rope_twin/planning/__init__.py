"""Lift planning: limiting sea states, characteristic loads, load chart and report of an operation.

`plan` runs a plan file from Python; on the command line it is `rope_twin plan`.
"""
