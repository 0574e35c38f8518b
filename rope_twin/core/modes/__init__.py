"""Compiled sums of what knows a rope by its modes, beside the step (rope_twin.viv)."""
