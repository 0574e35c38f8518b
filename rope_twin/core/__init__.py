"""The rope solver: nodes, elements and hooks. It knows no effect, no YAML and no ROS."""
