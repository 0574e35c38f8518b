"""Rest: the static equilibrium of one rope."""
