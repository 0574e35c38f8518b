"""Vortex-induced vibration of a whole rope: modes, lock-in, modal response.

The models represent a rope as a Span: tension, mass and water speed along a line. The running twin
and the studies both build one and call the same code.
"""
