"""Static equilibrium of a single rope."""
