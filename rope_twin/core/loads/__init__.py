"""Loads on the nodes: hooks of effects, balance of forces, internal variables."""
