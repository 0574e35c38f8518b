"""Compile kernels with numba and keep their code on disk; all private numba API is used here."""
