"""Payload with six degrees of freedom, on slings or a pin below the rope's end, or on a deck.

The rope ends at the hook, a point with the hook's mass. Slings lead from there to points of the
body, each with its length, so that an eccentric centre of gravity tilts the load until slings of
different lengths level it; a single pin lets it swing. Mass, volume, added mass and drag are those
of the scene's payload, along the body's own axes (x, y along its sides, z up), different in ascent
if specified; this effect replaces `payload`. Equations: core/body/loads.py.

Derived from the size unless given: moments of inertia of a homogeneous box; added inertia of added
mass spread evenly over the faces, M·b²/12 for each side b; and rotational drag by strip theory,
CdA·b³/32 (each strip of a rotating face meets the water independently).

Inside the stage the body is solved for the motion of the hook, and its condensed equations are
added to the rope's: stiff slings and light bodies are no harder than others. Rope and hook transmit
no torque: about the vertical it turns freely.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import pi, radians
from typing import Any

import numpy as np

from rope_twin.core.body import state as at
from rope_twin.core.body.state import Deck, Immersed, RigidBody
from rope_twin.core.body.step import with_parts
from rope_twin.core.loads.memory import new_memory
from rope_twin.quantity import SparingRepr, quantity, text

Triple = tuple[float, float, float]
STEEL = 7850.0  # kg/m³, density of the hook
MIDDLE = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Sling:
    """One sling: its tension is k·elongation + c·its rate, never compression."""

    to_m: Triple = quantity("attachment point from the body's middle: x, y, z", "m", -100.0, 100.0)
    length_m: float = quantity("unstretched length", "m", 0.1, 500.0)
    stiffness_n_per_m: float = quantity("axial stiffness EA/L", "N/m", 1e3, 1e9)
    damping_newton_seconds_per_m: float = quantity(
        "damping coefficient c", "N·s/m", 0.0, 1e8, default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class DeckHeave:
    """Independent sinusoidal heave of the deck about its mean height, with a build-up ramp."""

    amplitude_m: float = quantity("amplitude", "m", 0.0, 10.0)
    period_s: float = quantity("period", "s", 1.0, 60.0)
    phase_deg: float = quantity("phase of the sine at t = 0", "°", -360.0, 360.0, default=0.0)
    ramp_s: float = quantity("build-up time", "s", 0.0, 600.0, default=8.0)


@dataclass(frozen=True, kw_only=True, repr=False)
class DeckParams(SparingRepr):
    """A level deck on which the payload stands at the start; unilateral contact."""

    _later = frozenset(("heaves",))

    height_m: float = quantity("mean elevation z of the deck", "m", -1e3, 1e3)
    with_ship: bool = text("the deck heaves with the hang-off", False)
    heave: DeckHeave | None = text("independent heave, e.g. of a barge", None)
    heaves: tuple[DeckHeave, ...] = text("further harmonics of an irregular heave", ())
    penetration_m: float = quantity(
        "penetration under the payload's weight in air", "m", 1e-4, 1.0, default=0.005
    )
    damping_s_per_m: float = quantity(
        "damping χ of N = k·d·(1 - χ·v)", "s/m", 0.0, 10.0, default=0.5
    )
    friction: float = quantity("friction coefficient μ", "", 0.0, 2.0, default=0.4)


@dataclass(frozen=True, kw_only=True)
class RigidBodyParams:
    """Size, inertia and rigging; exactly one of `slings` and `pinned_at_m`."""

    payload: str = text("name of the payload that it is; default: the only one", "")
    size_m: Triple = quantity("outer dimensions along the body's x, y, z", "m", 0.05, 200.0)
    centre_of_gravity_m: Triple = quantity(
        "centre of gravity from the middle: x, y, z", "m", -100.0, 100.0, default=MIDDLE
    )
    centre_of_buoyancy_m: Triple = quantity(
        "centre of buoyancy from the middle: x, y, z", "m", -100.0, 100.0, default=MIDDLE
    )
    centre_of_drag_m: Triple = quantity(
        "centre of added mass and drag from the middle: x, y, z", "m", -100.0, 100.0,
        default=MIDDLE,
    )  # fmt: skip
    inertia_kg_m2: Triple | None = quantity(
        "moments of inertia about the centre of gravity; default: homogeneous box", "kg·m²",
        1e-6, 1e13, default=None,
    )  # fmt: skip
    added_inertia_kg_m2: Triple | None = quantity(
        "added moments of inertia; default: added mass spread over the faces", "kg·m²", 0.0, 1e13,
        default=None,
    )  # fmt: skip
    turning_drag_m5: Triple | None = quantity(
        "C of the drag moment ½·ρ·C·Ω² about its axes; default: strip theory",
        "m⁵",
        0.0,
        1e10,
        default=None,
    )
    footprint_m: tuple[Triple, ...] = quantity(
        "contact points with deck and seabed, from the middle; default: outline corners",
        "m", -100.0, 100.0, default=(),
    )  # fmt: skip
    heading_deg: float = quantity(
        "initial heading of its x axis: 0 east, 90 north", "°", -360.0, 360.0, default=0.0
    )
    hook_mass_kg: float = quantity("mass of hook and rigging (steel)", "kg", 0.0, 1e6, default=0.0)
    slings: tuple[Sling, ...] = text("slings from the hook to the body", ())
    pinned_at_m: Triple | None = quantity(
        "pin connection to the hook, from the middle: x, y, z", "m", -100.0, 100.0, default=None
    )
    pin_stiffness_n_per_m: float = quantity("stiffness of the pin", "N/m", 1e3, 1e12, default=1e9)
    pin_damping_newton_seconds_per_m: float = quantity(
        "damping of the pin", "N·s/m", 0.0, 1e9, default=1e4
    )
    deck: DeckParams | None = text("deck on which it stands at the start", None)

    def check(self) -> str | None:
        """Return a fault of rigging, inertia, deck or pin, or None."""
        if bool(self.slings) == (self.pinned_at_m is not None):
            given = "slings and a pin" if self.slings else "nothing that"
            return f"{given} hold{'' if self.slings else 's'} it; give slings or pinned_at_m"
        I = self.inertia_kg_m2
        if I is not None and max(I) > 0.5 * sum(I) * (1.0 + 1e-9):
            x, y, z = I
            problem = f"moments of inertia {x:g}, {y:g}, {z:g} kg·m² are impossible"
            return f"{problem}; give none above the sum of the other two"
        own = self.deck
        if own is not None and own.with_ship and (own.heave is not None or own.heaves):
            return "the deck heaves with the ship and independently; keep with_ship or heave"
        held = [sling.to_m for sling in self.slings] or [self.pinned_at_m or MIDDLE]
        highest, G = max(place[2] for place in held), self.centre_of_gravity_m[2]
        if self.pinned_at_m is not None and highest <= G:
            problem = f"it is pinned at {highest:g} m, not above its centre of gravity at {G:g} m"
            return f"{problem}; raise pinned_at_m, or it capsizes"
        return None


def build(params: RigidBodyParams, payload: Any, environment: Any) -> RigidBody:
    """Return the body for the payload's properties along the body axes, and the water.

    payload: without mass on a rope that does not carry the body, while another one does.
    """
    density, g = environment.water_density_kg_per_m3, environment.gravity_m_per_s2
    G = np.array(params.centre_of_gravity_m)
    m, displaced = float(payload.mass_kg), float(density * payload.volume_m3)
    added, area = np.array(payload.added_mass_kg, float), np.array(payload.drag_area_m2, float)
    half_added = 0.5 * float(payload.rising_added_mass_kg - added[2])
    half_k = 0.25 * float(density * (payload.rising_drag_area_m2 - area[2]))
    hook = params.hook_mass_kg if m > 0.0 else 0.0
    hook_weight = hook * (1.0 - density / STEEL) * g
    points = _points(params) - G
    corners, carrying = _corners(params)
    farthest = np.linalg.norm(np.vstack([points, corners - G, _box(params) - G]), axis=1).max()
    body = RigidBody(
        memory=new_memory(1, 0, environment.room),
        records=np.zeros((at.RECORDS, at.RECORD)),
        stage=_first_stage(),
        matrix=np.zeros((6, at.COLUMNS)),
        hold=np.zeros((3, at.MISS)),
        changes=np.zeros((6, at.CHANGES)),
        tangent=np.zeros(at.TANGENT),
        W=float((m - displaced) * g + hook_weight),
        hook=float(hook),
        hook_weight=float(hook_weight),
        m=m,
        g=float(g),
        displaced=displaced,
        inertia=_inertia(params, m),
        added=np.concatenate([added, _added_inertia(params, added)])
        + np.array([0.0, 0.0, half_added, 0.0, 0.0, 0.0]),
        rising=half_added,
        k=0.5 * density * np.concatenate([area, _turning_drag(params, area)])
        + np.array([0.0, 0.0, half_k, 0.0, 0.0, 0.0]),
        rising_k=half_k,
        buoyed=np.array(params.centre_of_buoyancy_m) - G,
        watered=np.array(params.centre_of_drag_m) - G,
        middle=-G,
        size=np.array(params.size_m),
        legs=_legs(params, points),
        corners=corners - G,
        carrying=carrying,
        parts=(),
        heading=radians(params.heading_deg),
        reach=float(farthest),
        stiffness=0.0,
        here=float(m > 0.0),
    )
    return with_parts(body, (Immersed(1.0), *_deck(params.deck, m * g / carrying)))


def _first_stage() -> Any:
    stage = np.zeros(at.STAGE)
    stage[at.FRESH] = stage[at.SUBMERGED] = stage[at.SUBMERGED_HELD] = 1.0
    return stage


def _points(params: RigidBodyParams) -> Any:
    """Return the attachment points, (legs, 3) [m]."""
    if params.pinned_at_m is not None:
        return np.array([params.pinned_at_m], float)
    return np.array([sling.to_m for sling in params.slings], float)


def _legs(params: RigidBodyParams, points: Any) -> Any:
    """Return the properties of the legs, (legs, LEG)."""
    if params.pinned_at_m is not None:
        figures = [(0.0, params.pin_stiffness_n_per_m, params.pin_damping_newton_seconds_per_m)]
    else:
        figures = [
            (one.length_m, one.stiffness_n_per_m, one.damping_newton_seconds_per_m)
            for one in params.slings
        ]
    return np.hstack([points, np.array(figures, float)])


def _box(params: RigidBodyParams) -> Any:
    """Return the corners of the outline from its middle, (8, 3) [m]."""
    return np.array(list(product((-0.5, 0.5), repeat=3))) * np.array(params.size_m)


def _corners(params: RigidBodyParams) -> tuple[Any, float]:
    """Return the contact points from the middle, and the number of those that carry it."""
    if params.footprint_m:
        return np.array(params.footprint_m, float), float(len(params.footprint_m))
    return _box(params), 4.0


def _inertia(params: RigidBodyParams, m: float) -> Any:
    """Return the inertia tensor about the centre of gravity, (3, 3)."""
    if params.inertia_kg_m2 is not None:
        return np.diag(params.inertia_kg_m2)
    return m / 12.0 * np.diag(_others(np.array(params.size_m) ** 2))


def _others(values: Any) -> Any:
    """Return for each axis the sum of the values of the other two."""
    return values.sum() - values


def _added_inertia(params: RigidBodyParams, added: Any) -> Any:
    """Return the added inertia about the reference point, (3,): M_z·b_y²/12 + M_y·b_z²/12, ..."""
    if params.added_inertia_kg_m2 is not None:
        return np.array(params.added_inertia_kg_m2)
    return _by_strips(added, np.array(params.size_m) ** 2 / 12.0)


def _turning_drag(params: RigidBodyParams, area: Any) -> Any:
    """Return C of ½·ρ·C·Ω² about the axes, (3,): strips of CdA/b·dr at r, ∫|r|³·dr = b⁴/32."""
    if params.turning_drag_m5 is not None:
        return np.array(params.turning_drag_m5)
    return _by_strips(area, np.array(params.size_m) ** 3 / 32.0)


def _by_strips(along_axes: Any, arms: Any) -> Any:
    """Return about x: value along z times arm along y plus value along y times arm along z; ..."""
    a, b = along_axes, arms
    return np.array([
        a[2] * b[1] + a[1] * b[2], a[0] * b[2] + a[2] * b[0], a[1] * b[0] + a[0] * b[1],
    ])  # fmt: skip


def _deck(params: DeckParams | None, load: float) -> tuple[Deck, ...]:
    """Return the deck as a component, if there is one; load: on each carrying corner [N]."""
    if params is None:
        return ()
    own = (*((params.heave,) if params.heave else ()), *params.heaves)
    heaves = [
        (one.amplitude_m, 2.0 * pi / one.period_s, radians(one.phase_deg), one.ramp_s)
        for one in own
    ]
    deck = Deck(
        height=float(params.height_m),
        with_ship=float(params.with_ship),
        heaves=np.array(heaves, dtype=float).reshape(-1, 4),
        k=load / params.penetration_m,
        chi=float(params.damping_s_per_m),
        mu=float(params.friction),
    )
    return (deck,)
