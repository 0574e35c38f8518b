"""A payload with six degrees of freedom, on slings or a pin below the rope's end, or on a deck.

The rope ends at the hook, a point with the hook's mass. Slings reach from there to places of the
body, each with its length, so that a centre of gravity out of line tilts the load until slings of
other lengths level it; a single pin lets it swing. Mass, volume, added mass and drag are those of
the scene's payload, along the body's own axes (x, y along its sides, z up), other up than down if
that says so; this effect takes the place of `payload`. Equations: core/body/loads.py.

What the size says unless it is given: moments of inertia of an even box; added inertia of added
mass that is spread evenly over the faces, M·b²/12 for each side b, and drag of turning of even
strips, CdA·b³/32 (strip theory: of a face that turns each strip meets the water by itself).

Inside the stage the body is solved for the motion of the hook, and what it leaves there is handed
to the rope's equations: stiff slings and light bodies are no harder than others. Rope and hook do
not twist it: about the vertical it turns freely.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import pi, radians
from typing import Any

import numpy as np

from rope_twin.core.body import afloat as body_afloat
from rope_twin.core.body import bed as body_bed
from rope_twin.core.body import contact as body_contact
from rope_twin.core.body import state as body_state
from rope_twin.core.body.kinds import with_parts
from rope_twin.core.body.state import Deck, Immersed, RigidBody
from rope_twin.core.solve.remembering import new_memory
from rope_twin.quantity import quantity, text

at = body_state
PARTS = (body_afloat, body_contact, body_bed)  # which register what is built here
Triple = tuple[float, float, float]
STEEL = 7850.0  # kg/m³, of the hook
MIDDLE = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Sling:
    """One leg of the rigging: it pulls with k·stretch + c·its rate, and never pushes."""

    to_m: Triple = quantity("where it holds the body, from its middle: x, y, z", "m", -100.0, 100.0)
    length_m: float = quantity("length without load", "m", 0.1, 500.0)
    stiffness_n_per_m: float = quantity("EA over length", "N/m", 1e3, 1e9)
    damping_newton_seconds_per_m: float = quantity(
        "force per rate of its length", "N·s/m", 0.0, 1e8, default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class DeckHeave:
    """A sine of the deck's own, up from its rest, faded in at the start."""

    amplitude_m: float = quantity("amplitude", "m", 0.0, 10.0)
    period_s: float = quantity("period", "s", 1.0, 60.0)
    phase_deg: float = quantity("of its sine at t = 0", "°", -360.0, 360.0, default=0.0)
    ramp_s: float = quantity("fades in over this time", "s", 0.0, 600.0, default=8.0)


@dataclass(frozen=True, kw_only=True)
class DeckParams:
    """A level deck that the payload stands on at the start; it pushes and never pulls."""

    height_m: float = quantity("of the deck at rest, z", "m", -1e3, 1e3)
    with_ship: bool = text("it heaves as the hang-off does", False)
    heave: DeckHeave | None = text("a heave of its own, as of a barge", None)
    penetration_m: float = quantity(
        "how far the payload's weight in air sinks into it", "m", 1e-4, 1.0, default=0.005
    )
    damping_s_per_m: float = quantity("χ of N = k·d·(1 - χ·v)", "s/m", 0.0, 10.0, default=0.5)
    friction: float = quantity("coefficient μ", "", 0.0, 2.0, default=0.4)


@dataclass(frozen=True, kw_only=True)
class RigidBodyParams:
    """Size, masses and rigging; exactly one of `slings` and `pinned_at_m`."""

    size_m: Triple = quantity("its outline along its own x, y, z", "m", 0.05, 200.0)
    centre_of_gravity_m: Triple = quantity(
        "from the middle: x, y, z", "m", -100.0, 100.0, default=MIDDLE
    )
    centre_of_buoyancy_m: Triple = quantity(
        "from the middle: x, y, z", "m", -100.0, 100.0, default=MIDDLE
    )
    centre_of_drag_m: Triple = quantity(
        "where added mass and drag act, from the middle: x, y, z", "m", -100.0, 100.0,
        default=MIDDLE,
    )  # fmt: skip
    inertia_kg_m2: Triple | None = quantity(
        "moments of inertia about its axes at the centre of gravity; absent: an even box", "kg·m²",
        1e-6, 1e13, default=None,
    )  # fmt: skip
    added_inertia_kg_m2: Triple | None = quantity(
        "the same of the water; absent: added mass spread over the faces", "kg·m²", 0.0, 1e13,
        default=None,
    )  # fmt: skip
    turning_drag_m5: Triple | None = quantity(
        "C of the moment ½·ρ·C·Ω² about its axes; absent: by strips", "m⁵", 0.0, 1e10, default=None
    )
    footprint_m: tuple[Triple, ...] = quantity(
        "places that touch deck and seabed, from the middle; absent: the corners of its outline",
        "m", -100.0, 100.0, default=(),
    )  # fmt: skip
    heading_deg: float = quantity(
        "of its x axis at the start, from east to north", "°", -360.0, 360.0, default=0.0
    )
    hook_mass_kg: float = quantity("hook and rigging, of steel", "kg", 0.0, 1e6, default=0.0)
    slings: tuple[Sling, ...] = text("from the hook to the body", ())
    pinned_at_m: Triple | None = quantity(
        "where the hook itself holds it, from its middle: x, y, z", "m", -100.0, 100.0, default=None
    )
    pin_stiffness_n_per_m: float = quantity("of that pin", "N/m", 1e3, 1e12, default=1e9)
    pin_damping_newton_seconds_per_m: float = quantity(
        "of that pin", "N·s/m", 0.0, 1e9, default=1e4
    )
    deck: DeckParams | None = text("what it stands on at the start", None)

    def check(self) -> str | None:
        """Held once, by something above what it holds; inertia of a body."""
        if bool(self.slings) == (self.pinned_at_m is not None):
            given = "slings and a pin" if self.slings else "nothing that"
            return f"{given} hold{'' if self.slings else 's'} it; give slings or pinned_at_m"
        I = self.inertia_kg_m2
        if I is not None and max(I) > 0.5 * sum(I) * (1.0 + 1e-9):
            x, y, z = I
            what = f"no body has moments of inertia of {x:g}, {y:g}, {z:g} kg·m²"
            return f"{what}; give none above the sum of the other two"
        if self.deck is not None and self.deck.with_ship and self.deck.heave is not None:
            return "the deck heaves with the ship and by itself; keep with_ship or heave"
        held = [sling.to_m for sling in self.slings] or [self.pinned_at_m or MIDDLE]
        highest, G = max(place[2] for place in held), self.centre_of_gravity_m[2]
        if self.pinned_at_m is not None and highest <= G:
            what = f"it is pinned at {highest:g} m, not above its centre of gravity at {G:g} m"
            return f"{what}; raise pinned_at_m, or it turns over"
        return None


def build(params: RigidBodyParams, payload: Any, around: Any) -> RigidBody:
    """From the payload's figures along the body's axes, and the water."""
    density, g = around.water_density_kg_per_m3, around.gravity_m_per_s2
    G = np.array(params.centre_of_gravity_m)
    m, displaced = float(payload.mass_kg), float(density * payload.volume_m3)
    added, area = np.array(payload.added_mass_kg, float), np.array(payload.drag_area_m2, float)
    half_added = 0.5 * float(payload.rising_added_mass_kg - added[2])
    half_k = 0.25 * float(density * (payload.rising_drag_area_m2 - area[2]))
    hook_weight = params.hook_mass_kg * (1.0 - density / STEEL) * g
    points = _points(params) - G
    corners, carrying = _corners(params)
    farthest = np.linalg.norm(np.vstack([points, corners - G, _box(params) - G]), axis=1).max()
    body = RigidBody(
        memory=new_memory(1, 0, around.room),
        records=np.zeros((at.RECORDS, at.RECORD)),
        stage=_first_stage(),
        matrix=np.zeros((6, at.COLUMNS)),
        hold=np.zeros((3, at.MISS)),
        changes=np.zeros((6, at.CHANGES)),
        told=np.zeros(at.TOLD),
        W=float((m - displaced) * g + hook_weight),
        hook=float(params.hook_mass_kg),
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
    )
    return with_parts(body, (Immersed(1.0), *_deck(params.deck, m * g / carrying)))


def _first_stage() -> Any:
    stage = np.zeros(at.STAGE)
    stage[at.FRESH] = stage[at.WET] = stage[at.WET_HELD] = 1.0
    return stage


def _points(params: RigidBodyParams) -> Any:
    """Where it is held, (legs, 3) [m]."""
    if params.pinned_at_m is not None:
        return np.array([params.pinned_at_m], float)
    return np.array([sling.to_m for sling in params.slings], float)


def _legs(params: RigidBodyParams, points: Any) -> Any:
    """(legs, LEG)."""
    if params.pinned_at_m is not None:
        figures = [(0.0, params.pin_stiffness_n_per_m, params.pin_damping_newton_seconds_per_m)]
    else:
        figures = [
            (one.length_m, one.stiffness_n_per_m, one.damping_newton_seconds_per_m)
            for one in params.slings
        ]
    return np.hstack([points, np.array(figures, float)])


def _box(params: RigidBodyParams) -> Any:
    """The corners of its outline, from its middle, (8, 3) [m]."""
    return np.array(list(product((-0.5, 0.5), repeat=3))) * np.array(params.size_m)


def _corners(params: RigidBodyParams) -> tuple[Any, float]:
    """Places that touch deck and bed, from its middle, and how many of them carry it."""
    if params.footprint_m:
        return np.array(params.footprint_m, float), float(len(params.footprint_m))
    return _box(params), 4.0


def _inertia(params: RigidBodyParams, m: float) -> Any:
    """About the centre of gravity, (3, 3)."""
    if params.inertia_kg_m2 is not None:
        return np.diag(params.inertia_kg_m2)
    return m / 12.0 * np.diag(_others(np.array(params.size_m) ** 2))


def _others(values: Any) -> Any:
    """Of each axis the sum of the other two's."""
    return values.sum() - values


def _added_inertia(params: RigidBodyParams, added: Any) -> Any:
    """About the axes at the middle of the water's forces, (3,): M_z·b_y²/12 + M_y·b_z²/12, ..."""
    if params.added_inertia_kg_m2 is not None:
        return np.array(params.added_inertia_kg_m2)
    return _by_strips(added, np.array(params.size_m) ** 2 / 12.0)


def _turning_drag(params: RigidBodyParams, area: Any) -> Any:
    """C of ½·ρ·C·Ω² about its axes, (3,): strips of CdA/b·dr at r, ∫|r|³·dr = b⁴/32."""
    if params.turning_drag_m5 is not None:
        return np.array(params.turning_drag_m5)
    return _by_strips(area, np.array(params.size_m) ** 3 / 32.0)


def _by_strips(along_axes: Any, arms: Any) -> Any:
    """About x: what acts along z times the arm along y, and along y times the arm along z; ..."""
    a, b = along_axes, arms
    return np.array([
        a[2] * b[1] + a[1] * b[2], a[0] * b[2] + a[2] * b[0], a[1] * b[0] + a[0] * b[1],
    ])  # fmt: skip


def _deck(params: DeckParams | None, load: float) -> tuple[Deck, ...]:
    """The deck, if there is one; load: on each corner that carries [N]."""
    if params is None:
        return ()
    own = params.heave
    deck = Deck(
        height=float(params.height_m),
        with_ship=float(params.with_ship),
        amplitude=own.amplitude_m if own else 0.0,
        omega=2.0 * pi / own.period_s if own else 0.0,
        phase=radians(own.phase_deg) if own else 0.0,
        ramp=own.ramp_s if own else 0.0,
        k=load / params.penetration_m,
        chi=float(params.damping_s_per_m),
        mu=float(params.friction),
    )
    return (deck,)
