"""Estimation of a lift's figures (weight, mass, drag, stiffness) from the measured tension."""
