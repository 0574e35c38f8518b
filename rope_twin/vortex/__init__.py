"""Vortex-induced vibration (VIV) of a rope, the drag that it amplifies, and fatigue damage.

The models represent a rope as a `line_model.Span`: tension, mass and water speed along a line. A
running twin and the studies both build one and call the same code.
"""
