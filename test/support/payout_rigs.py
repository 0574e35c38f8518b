"""The ropes of the payout study: 20 t, vertical, in vacuum, elements of 10 m."""

from __future__ import annotations

from dataclasses import replace

from rigs import Rig

from rope_twin.scene.schema import Winch

WINCH = Winch(
    speed_limit_m_per_s=3.0,
    acceleration_limit_m_per_s2=0.3,
    min_line_out_m=12.0,
    max_line_out_m=3000.0,
)
STEEL = Rig(length=1000.0, elements=100, mass=6.4, EA=65e6, ramp=8.0, winch=WINCH)
HMPE = replace(STEEL, mass=2.9, EA=206e6)
SEA = replace(
    STEEL, density=1025.0, diameter=0.05, drag=(1.2, 0.02), added_mass=1.0, volume=2.0,
    added=(3e3, 3e3, 3e3), area=(5.0, 5.0, 5.0), current=((0.0, (0.9, 0.4)),),
)  # fmt: skip
HMPE_SEA = replace(SEA, mass=2.9, EA=206e6, diameter=0.08, length=990.0)
KELVIN_VOIGT_S = 0.01  # c = EA·tau
