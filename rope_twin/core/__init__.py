"""The rope solver: nodes, elements and hooks. It knows no effect, no YAML and no ROS."""

# Raised with every change of the results beyond rounding: convergence studies then are outdated.
SOLVER_VERSION = 1
# Raised likewise where only results of scenes with several ropes change: only their studies are
# outdated. Their version reads "1, connections 2"; while it was 1 it was left out.
CONNECTIONS_VERSION = 2
