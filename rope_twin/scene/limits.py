"""Limits of a lift: loads and motions that a run must stay within.

They judge a run and change no result, so they are part of no digest. Two limits apply to every
scene by default: a tension above the minimum breaking load (MBL), and a strain of 10 %.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rope_twin.quantity import quantity, text
from rope_twin.scene.rules.fault import Fault


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of every rope and payload of the scene; a run that exceeds one ends with code 4."""

    tension_n: float | None = quantity("maximum tension of a rope", "N", 1.0, 1e9, default=None)
    utilisation: float = quantity(
        "maximum utilisation: tension over the MBL of the rope's weakest section", "",
        1e-3, 100.0, default=1.0,
    )  # fmt: skip
    min_tension_n: float | None = quantity(
        "minimum tension along a rope; below it the line counts as slack", "N", 0.1, 1e9,
        default=None,
    )  # fmt: skip
    strain: float = quantity(
        "maximum strain, from the maximum tension and the rope's stiffness", "", 1e-4, 1.0,
        default=0.1,
    )  # fmt: skip
    bend_radius: bool = text("apply the ropes' minimum_bend_radius_m as a limit", False)
    payload_speed_m_per_s: float | None = quantity(
        "maximum speed of a payload", "m/s", 1e-3, 1e2, default=None
    )
    payload_depth_m: float | None = quantity(
        "maximum depth of a payload below the mean water level", "m", 0.0, 1.2e4, default=None
    )
    landing_speed_m_per_s: float | None = quantity(
        "maximum landing velocity of a payload on the seabed", "m/s", 1e-3, 1e2, default=None
    )


def limit_faults(limits: Limits, bed: bool, radius: bool) -> Iterator[Fault]:
    """Yield limits that nothing in the scene can reach.

    Args:
        bed: the scene lists a seabed.
        radius: some rope has a minimum_bend_radius_m.
    """
    if limits.landing_speed_m_per_s is not None and not bed:
        right = "add the effect `seabed`, or remove this limit"
        yield "limits.landing_speed_m_per_s", "the scene has no seabed to land on", right
    if limits.bend_radius and not radius:
        right = "give a rope its minimum_bend_radius_m, or remove this limit"
        yield "limits.bend_radius", "no rope of the scene has a minimum bend radius", right
