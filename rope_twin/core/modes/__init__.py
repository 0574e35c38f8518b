"""Compiled kernels of the modal VIV models, decoupled from the step (rope_twin.viv)."""
