"""What keeps a quotient off 0/0: added to a divisor that may vanish, or under its root.

In a law it is added, never compared with, so that the law stays smooth where its divisor goes
through 0; and it is far below what a figure of a scene can show. A guard whose name ends with 2 is
a square.
"""

from __future__ import annotations

import sys

# A divisor of any unit whose dividend is 0 where it is: areas and volumes of a rope without any,
# a ramp that lasts no time.
NONE_AT_ALL = 1e-300
SMALLEST = sys.float_info.min  # the same of forces, in arrays of numpy

STILL2 = 1e-20  # (m/s)²: a body that goes with its water still has a speed, 1e-10 m/s
STOPPED = 1e-9  # m/s, rad/s or N: water that stands, a wake that does, rope without pull
NO_WAVES = 1e-30  # any unit: no component is felt so deep, and nothing of it can be wrong
UNSHED = 1e-12  # rad/s: a node that sheds nothing has no amplitude, whatever it remembers

FOLDED2 = 1e-12  # of two unit tangents' sum: rope folded back on itself has no mean direction
CRUSHED2 = 1e-16  # of the rest length: an element whose nodes meet has no direction
TOUCHING2 = 1e-20  # m²: a sling whose ends meet
TIED2 = 1e-16  # m²: a bar or tether whose ends meet
UNTURNED2 = 1e-40  # rad²: a body that has not turned has no axis of its turn
