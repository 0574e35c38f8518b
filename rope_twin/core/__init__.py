"""The rope solver: nodes, elements and hooks. It knows no effect, no YAML and no ROS."""

# Raised with every change of the results beyond rounding: convergence studies then are outdated.
SOLVER_VERSION = 1
# The same for scenes with several ropes, whose studies alone it ages; 1 is not named.
CONNECTIONS_VERSION = 2
