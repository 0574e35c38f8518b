"""How fast the solver is, and how right: `rope_twin bench`."""
