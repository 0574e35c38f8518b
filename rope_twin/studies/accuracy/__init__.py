"""Convergence study of a scene, and its accuracy table: `rope_twin accuracy`."""
