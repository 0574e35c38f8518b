"""Contributions of effects to the step: hooks, loads and terms, composed at compile time."""
