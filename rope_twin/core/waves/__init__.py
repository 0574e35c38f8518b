"""Wave kinematics at the nodes: tables of components, sums, and truncation depths."""
