"""Vortex-induced vibration of a scene's rope: `rope_twin viv`."""
