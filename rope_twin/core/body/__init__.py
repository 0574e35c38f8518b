"""A payload with six degrees of freedom, as the kernels see it."""
