"""Shared kernels of several models of vortex-induced vibration."""
