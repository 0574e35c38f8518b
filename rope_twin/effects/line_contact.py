"""Contact between the ropes of a multi-line system; the equations are in `core.joined`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rope_twin.core.joined.line_contact import LineContact
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class LineContactParams:
    """Stiffness, damping and friction of a contact, and the distance at which it begins."""

    distance_m: float | None = quantity(
        "distance of the centre lines at contact; default: the largest diameter of the scene's "
        "ropes", "m", 1e-3, 2.0, default=None,
    )  # fmt: skip
    stiffness_n_per_m: float = quantity(
        "normal force over penetration, of a contact between two elements", "N/m", 1e3, 1e9,
        default=5e5,
    )  # fmt: skip
    damping_s_per_m: float = quantity(
        "damping χ of N = k·d·(1 - χ·v)", "s/m", 0.0, 10.0, default=0.5
    )
    friction: float = quantity("friction coefficient μ", "", 0.0, 2.0, default=0.2)


def build(params: LineContactParams, payload: Any, environment: Any) -> LineContact:
    """Return the kernel data."""
    reach = environment.diameter if params.distance_m is None else params.distance_m
    return LineContact(
        float(params.stiffness_n_per_m), float(params.damping_s_per_m), float(params.friction),
        float(reach),
    )  # fmt: skip
