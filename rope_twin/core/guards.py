"""Regularisation constants that keep a quotient from 0/0: added to a divisor, or below its root.

In a physical law they are added, never compared with, so that the law stays smooth where its
divisor goes through zero; they are far below any value that a scene can resolve. A name that ends
with 2 denotes a square.
"""

from __future__ import annotations

import sys

# For divisors of any unit whose dividend vanishes with them: zero areas and volumes, a build-up of
# zero duration.
DIVISOR_MIN = 1e-300
FORCE_MIN = sys.float_info.min  # likewise for forces in numpy arrays

SPEED2_MIN = 1e-20  # (m/s)²: a body that drifts with the water keeps a speed of 1e-10 m/s
TURN2 = 0.05**2  # (m/s)²: the figures of a payload blend over 5 cm/s from descent to ascent
RATE_MIN = 1e-9  # m/s, rad/s or N: still water, a wake at rest, a rope without tension
WAVE_MIN = 1e-30  # any unit: no wave component reaches this depth, so none has an error there
SHEDDING_MIN = 1e-12  # rad/s: a node without shedding has zero amplitude, whatever its history

TANGENT2_MIN = 1e-12  # of the sum of two unit tangents: none where the rope folds back on itself
STRETCH2_MIN = 1e-16  # of the unstretched length: an element whose nodes coincide has no direction
SLING2_MIN = 1e-20  # m²: a sling whose ends coincide
LINK2_MIN = 1e-16  # m²: a link whose ends coincide
ANGLE2_MIN = 1e-40  # rad²: a body without rotation has no rotation axis
