"""The race against other codes at equal error: `rope_twin bench peers`."""
