"""What the kernels of a rigid body see: its figures, its records, and where numbers stand in them.

Vectors of the body are in its own axes and from its centre of gravity G.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.bed import Grid, Plane
from rope_twin.core.state import Floats


# Not Python's integers: numba compiles a kernel again for each literal that it is given.
def _places(first: int, last: int, width: int = 3) -> Any:
    return (np.int64(place) for place in range(first, last, width))


# A record: the body at one time. Rates of momentum and angular momentum about G, place of G,
# velocity, spin, velocity and acceleration of the water at it, orientation; where the middle of the
# wetted part is, from the middle of the whole, and the wetted share.
FORCE, MOMENT, X, V, SPIN, WATER, GROWS, Q = _places(0, 24)
ARM_THEN = np.int64(25)
WET_THEN = 28
RECORD = 29
RECORDS = 4  # now, at the end of the stage, at the start of the step, and one to write into

# The stage. What it starts from: place, turn, momentum, angular momentum; the water: velocity now,
# velocity that the momentum of the water is counted from, acceleration. Then what is sought, and
# what belongs to it; the substep's start and the end of its first stage; speed and turn rate that a
# correction began with.
(X_HAT, TURN_HAT, P_HAT, L_HAT, FLOW_NOW, FROZEN, FLOW_GROWS,
 SPEED, TURN_RATE, PLACE, TURN, SPIN_NOW, PULL, TWIST, P_NOW, L_NOW, ON_HOOK,
 P_START, L_START, X_MIDDLE, TURN_MIDDLE, P_MIDDLE, L_MIDDLE, SPEED_MIDDLE, RATE_MIDDLE,
 SPEED_BEFORE, RATE_BEFORE) = _places(0, 81)  # fmt: skip
ATTITUDE, Q_START = _places(81, 89, 4)  # quaternions
DECK_Z, DECK_SPEED, DECK_PUSH = 89, 90, 91  # height [m], rate [m/s], its push on the body [N]
FRESH = 92  # 1: the body has yet to be put where it rests
SHIP_Z = 93  # height of the hang-off at rest [m]
FORCES = 94  # sum of the sizes of all forces on the body [N]
SHARE = 95  # of the slings' stiffness that counts: less than 1 while rest is sought
HOOK = np.int64(96)  # where the rope ends while rest is sought, 3 numbers [m]
# The wetted part: where its middle is from that of the whole, and its share; the same as the
# momenta have it over a substep; rates; the surface above the body's middle, slopes along its x, y.
WET_ARM, ARM_HELD, ARM_GROWS = _places(99, 108)
WET, WET_HELD, WET_GROWS, SURFACE_Z, SURFACE_X, SURFACE_Y = 108, 109, 110, 111, 112, 113
STAGE = 114

# What the rope's equations were last told: the pull on the hook, and minus its derivative, as xx,
# xy, xz, yy, yz, zz. The motion of the hook that the balance was last found for; how far the pull
# may be another than foretold [N].
TOLD_PULL, TOLD_SLOPE, TOLD_ELSE, SOLVED_PLACE, SOLVED_SPEED = _places(0, 15)
ALLOWED = 15
TOLD = 16

# Columns of the matrix: A; what the hook's acceleration brings, without q; residual.
HELD, MISS, COLUMNS = 6, 9, 10
# A change of the body's motion (core/body/change.py): δx, δv, ψ, δΩ.
D_PLACE, D_SPEED, D_TURN, D_SPIN = _places(0, 12)
CHANGES = 12

# A leg: where it holds the body, its length (0: a pin), stiffness, damping
LENGTH, STIFFNESS, DAMPING, LEG = 3, 4, 5, 6


class Immersed(NamedTuple):
    """A body that is wet all over, as a part."""

    share: float  # of it: 1


class Afloat(NamedTuple):
    """A body in the water's surface, as a part; see core/body/afloat.py."""

    columns: Floats  # middle (3), share of the volume, place along x and y from the middle, (n, 6)
    height: float  # of the columns [m]
    side_x: float  # sides of each [m]
    side_y: float
    span_x: float  # how far from the middle the surface is looked at, along x and y [m]
    span_y: float
    aside: Floats  # of the centre of buoyancy from the middle, (3,) [m]
    slam: float  # ½·ρ·C_s·A of the whole bottom [kg/m]


class Deck(NamedTuple):
    """What the body can stand on, as a part: a level plane."""

    height: float  # at rest [m]
    with_ship: float  # 1: it heaves as the hang-off does
    amplitude: float  # of a heave of its own [m]
    omega: float  # [rad/s]
    phase: float  # [rad]
    ramp: float  # [s]
    k: float  # stiffness at each corner [N/m]
    chi: float  # N = k·d·(1 - χ·v) [s/m]
    mu: float  # friction


class PlaneBed(NamedTuple):
    """The seabed below a body, as a part."""

    shape: Plane
    k: float  # stiffness at each corner [N/m]
    chi: float  # N = k·d·(1 - χ·v) [s/m]
    mu: float  # friction


class GridBed(NamedTuple):
    """The same of soundings."""

    shape: Grid
    k: float  # as of a PlaneBed
    chi: float
    mu: float


class RigidBody(NamedTuple):
    """A payload with six degrees of freedom that hangs on slings, or by a pin, from the hook."""

    memory: Floats  # number of the record that holds; see core/solve/remembering.py
    records: Floats  # (RECORDS, RECORD)
    stage: Floats  # scratch, (STAGE,)
    matrix: Floats  # scratch, (6, COLUMNS)
    hold: Floats  # scratch: changes of the slings' pull with what is sought, and with the
    # acceleration of the hook, (3, 9)
    changes: Floats  # scratch, (6, CHANGES)
    told: Floats  # scratch, (TOLD,)
    W: float  # weight in water, the hook's with it [N]
    hook: float  # its mass [kg]
    hook_weight: float  # in water [N]
    m: float  # of the body [kg]
    g: float  # [m/s²]
    displaced: float  # ρ·V [kg]
    inertia: Floats  # moments of inertia about G, (3, 3) [kg·m²]
    added: Floats  # added mass along, added inertia about the axes at the middle of the water's
    # forces, (6,); along z the mean of rising and sinking
    rising: float  # half of rising less sinking, of the added mass along z [kg]
    k: Floats  # ½·ρ·CdA along, ½·ρ·C about them, (6,) [kg/m], [kg·m²]
    rising_k: float  # half of rising less sinking, along z
    buoyed: Floats  # where buoyancy acts, (3,) [m]
    watered: Floats  # where the water's forces act, (3,)
    middle: Floats  # the middle of the body's outline, (3,)
    size: Floats  # its outline, (3,) [m]
    legs: Floats  # (legs, LEG)
    corners: Floats  # places that can touch a deck or the bed, (corners, 3)
    carrying: float  # how many of them carry it where it stands
    parts: tuple[Any, ...]  # what else acts on it (core/body/parts.py)
    heading: float  # of its x axis at the start, from east to north [rad]
    reach: float  # from G to the farthest of all this [m]
    stiffness: float  # of legs and deck, their sum [N/m]
