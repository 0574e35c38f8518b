"""Rope solver: nodes, elements and hooks for effects, independent of effects, YAML and ROS."""

# Increased with every change of the results beyond rounding, which invalidates convergence studies.
SOLVER_VERSION = 1
# Increased where only results of multi-line scenes change; invalidates their studies only, whose
# version reads "1, connections 2".
CONNECTIONS_VERSION = 2
