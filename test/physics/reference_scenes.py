"""The scenes of the solver study: one set of cases that several codes have run.

smooth_2km and slack_5km as rigs, in the study's own figures (g 9.81 m/s²). The rope's weight in
water is given there as a figure of its own; here the hydrodynamic diameter is the one that has this
volume, and the coefficients are scaled so that drag and added mass stay those of the nominal one.
"""

from __future__ import annotations

import math
from dataclasses import replace

from rigs import STILL_WATER, Rig

WATER, GRAVITY = 1025.0, 9.81


def _rope(displaced: float, nominal: float) -> Rig:
    """3.6 kg/m, EA 150 MN, displaced mass in kg/m; Cdn 1.2, Cdt 0.01, Ca 1 on `nominal` [m]."""
    diameter = math.sqrt(4.0 * displaced / (math.pi * WATER))
    scale = nominal / diameter
    return Rig(
        mass=3.6, EA=1.5e8, diameter=diameter, density=WATER, gravity=GRAVITY,
        drag=(1.2 * scale, 0.01 * scale), added_mass=scale**2,
    )  # fmt: skip


SMOOTH_2KM = replace(
    _rope(displaced=3.6 - 0.04, nominal=0.076), length=2000.0, damping=5e5, load=20e3,
    volume=2.927, added=(WATER * 2.927,) * 3, area=(6.0,) * 3,
    current=((0.0, (0.5, 0.0)), (-2000.0, (0.0, 0.0))), ramp=8.0,
)  # fmt: skip
SNAP_VERTICAL = replace(
    SMOOTH_2KM, load=2e3, volume=0.5, added=(WATER * 0.5,) * 3, area=(8.0,) * 3,
    current=STILL_WATER,
)  # fmt: skip
SNAP_2KM = replace(SNAP_VERTICAL, current=((0.0, (0.2, 0.0)),))
SLACK_5KM = replace(
    _rope(displaced=3.6 * WATER / 975.0, nominal=0.08), length=5000.0, elements=1000, load=20e3,
    volume=4.0, added=(8e3,) * 3, area=(8.0,) * 3,
    current=((0.0, (1.0, 0.0)), (-5000.0, (0.2, 0.0))), ramp=16.0,
)  # fmt: skip
