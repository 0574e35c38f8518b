"""Ropes that meet at joints and sheaves: their step, their statics, their energy."""
