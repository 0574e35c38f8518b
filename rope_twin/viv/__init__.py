"""Vortex-induced vibration of a whole rope at a time: modes, lock-in, modal response.

What stands here knows a rope as a Span: tension, mass and water speed along a line. The running
twin and the studies both make one and ask the same code.
"""
