"""Kernels of a payload with six degrees of freedom."""
