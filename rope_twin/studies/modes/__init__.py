"""Natural frequencies and modes of a rope at rest: `rope_twin modes`."""
