"""Contact between the payloads and hooks of a multi-line system, as spheres with friction.

The equations are in `core.joined.payload_contact`. A hook is a joint, at which ropes meet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rope_twin.core.joined.payload_contact import PayloadContact
from rope_twin.quantity import quantity, text


@dataclass(frozen=True, kw_only=True)
class ContactSphere:
    """A payload or joint of the scene, as a sphere."""

    name: str = text("name of the payload or joint")
    radius_m: float = quantity("distance of its centre from what it touches", "m", 0.01, 50.0)


@dataclass(frozen=True, kw_only=True)
class PayloadContactParams:
    """Bodies that touch each other, and stiffness, damping and friction of a contact."""

    bodies: tuple[ContactSphere, ...] = text("payloads and joints that touch, at least two")
    stiffness_n_per_m: float = quantity(
        "normal force over penetration", "N/m", 1e2, 1e10, default=1e6
    )
    damping_s_per_m: float = quantity(
        "damping χ of N = k·d·(1 - χ·v)", "s/m", 0.0, 10.0, default=0.5
    )
    friction: float = quantity("friction coefficient μ", "", 0.0, 2.0, default=0.2)

    def check(self) -> str | None:
        """Return a fault of the bodies, or None."""
        names = [body.name for body in self.bodies]
        if len(names) < 2:
            return f"bodies lists {len(names)}; give at least two"
        twice = next((name for name in names if names.count(name) > 1), None)
        return f"bodies lists '{twice}' twice; list each once" if twice else None


def build(params: PayloadContactParams, payload: Any, environment: Any) -> PayloadContact:
    """Return the kernel data, of bodies that are not connections yet (`placed`)."""
    return PayloadContact(
        joints=np.zeros(0, dtype=np.int64),
        radii=np.array([float(body.radius_m) for body in params.bodies]),
        k=float(params.stiffness_n_per_m),
        chi=float(params.damping_s_per_m),
        mu=float(params.friction),
    )


def placed(
    contact: PayloadContact, params: PayloadContactParams, joint_of: Mapping[str, int]
) -> PayloadContact:
    """Return the kernel data with the connections of the bodies, by their names."""
    return contact._replace(joints=np.array([joint_of[body.name] for body in params.bodies]))
