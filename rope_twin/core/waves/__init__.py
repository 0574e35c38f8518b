"""The water of a sea at the nodes: figures of components, sums, reach."""
