"""The hard cases of the rope solver: `rope_twin stability`."""
