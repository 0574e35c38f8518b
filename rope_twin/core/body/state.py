"""Data layout of a rigid body: its properties, its records, and the offsets of numbers in them.

Vectors of the body are in its own axes and from its centre of gravity G.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.bed import Grid, Plane
from rope_twin.core.state import Floats


# numpy integers: numba compiles a kernel again for each Python literal that it is called with.
def _places(first: int, last: int, width: int = 3) -> Any:
    return (np.int64(place) for place in range(first, last, width))


# A record: the body at one time. Rates of momentum and angular momentum about G, position of G,
# velocity, angular velocity, velocity and acceleration of the water there, orientation; centre of
# the submerged part relative to the centre of the whole, and submergence ratio.
FORCE, MOMENT, X, V, SPIN, WATER, GROWS, Q = _places(0, 24)
ARM_THEN = np.int64(25)
WET_THEN = 28
RECORD = 29
RECORDS = 4  # current, end of the stage, start of the step, and one to write into

# The stage. Explicit parts of position, rotation, momentum, angular momentum; the water: current
# velocity, velocity held in the momentum of the added mass, acceleration. Then the unknowns and the
# quantities derived from them; start of the substep and end of its first stage; velocity and
# rotation rate before a correction.
(X_HAT, TURN_HAT, P_HAT, L_HAT, FLOW_NOW, FROZEN, FLOW_GROWS,
 SPEED, TURN_RATE, PLACE, TURN, SPIN_NOW, PULL, TWIST, P_NOW, L_NOW, ON_HOOK,
 P_START, L_START, X_MIDDLE, TURN_MIDDLE, P_MIDDLE, L_MIDDLE, SPEED_MIDDLE, RATE_MIDDLE,
 SPEED_BEFORE, RATE_BEFORE) = _places(0, 81)  # fmt: skip
ATTITUDE, Q_START = _places(81, 89, 4)  # quaternions
DECK_Z, DECK_SPEED = 89, 90  # height [m], velocity [m/s]
FRESH = 92  # 1: static equilibrium has yet to be solved
SHIP_Z = 93  # mean height of the hang-off [m]
FORCES = 94  # sum of the magnitudes of all forces on the body [N]
SHARE = 95  # factor on the slings' stiffness: less than 1 during the static solution
HOOK = np.int64(96)  # position of the rope's end during the static solution, 3 numbers [m]
# Submergence: centre of the submerged part relative to that of the whole, and ratio; the same as
# held in the momenta over a substep; rates; water surface above the body's middle, its x, y slopes.
WET_ARM, ARM_HELD, ARM_GROWS = _places(99, 108)
WET, WET_HELD, WET_GROWS, SURFACE_Z, SURFACE_X, SURFACE_Y = 108, 109, 110, 111, 112, 113
STAGE = 114

# Cached linearisation last given to the rope's equations: force on the hook, and minus its
# derivative, as xx, xy, xz, yy, yz, zz. Motion of the hook of the last solution; allowed difference
# between predicted and actual force [N].
TOLD_PULL, TOLD_SLOPE, TOLD_ELSE, SOLVED_PLACE, SOLVED_SPEED = _places(0, 15)
ALLOWED = 15
TOLD = 16

# Columns of the matrix: A; derivatives to the hook's acceleration, without q; residual.
HELD, MISS, COLUMNS = 6, 9, 10
# A change of the body's motion (core/body/motion.py): δx, δv, ψ, δΩ.
D_PLACE, D_SPEED, D_TURN, D_SPIN = _places(0, 12)
CHANGES = 12

# A leg: attachment point on the body, length (0: a pin), stiffness, damping
LENGTH, STIFFNESS, DAMPING, LEG = 3, 4, 5, 6


class Immersed(NamedTuple):
    """Component: a fully submerged body."""

    share: float  # submergence ratio: 1


class Afloat(NamedTuple):
    """Component: a body at the water surface; see core/body/components.py."""

    columns: Floats  # middle (3), volume fraction, x and y from the middle, (n, 6)
    height: float  # of the columns [m]
    side_x: float  # sides of each [m]
    side_y: float
    span_x: float  # distance from the middle where the surface is sampled, along x, y [m]
    span_y: float
    aside: Floats  # centre of buoyancy relative to the middle, (3,) [m]
    slam: float  # ½·ρ·C_s·A of the whole bottom [kg/m]


class Deck(NamedTuple):
    """Component: a deck on which the body can stand, a level plane."""

    height: float  # mean height [m]
    with_ship: float  # 1: it heaves with the hang-off
    heaves: Floats  # harmonics of an independent heave: amplitude [m], ω [rad/s], phase [rad],
    # build-up time [s], (harmonics, 4)
    k: float  # stiffness at each corner [N/m]
    chi: float  # N = k·d·(1 - χ·v) [s/m]
    mu: float  # friction


class PlaneBed(NamedTuple):
    """Component: a plane seabed below the body."""

    shape: Plane
    k: float  # stiffness at each corner [N/m]
    chi: float  # N = k·d·(1 - χ·v) [s/m]
    mu: float  # friction


class GridBed(NamedTuple):
    """Component: a gridded seabed below the body."""

    shape: Grid
    k: float  # k, χ, μ as in PlaneBed
    chi: float
    mu: float


class RigidBody(NamedTuple):
    """A payload with six degrees of freedom that hangs on slings, or by a pin, from the hook."""

    memory: Floats  # index of the valid record; see core/loads/memory.py
    records: Floats  # (RECORDS, RECORD)
    stage: Floats  # scratch, (STAGE,)
    matrix: Floats  # scratch, (6, COLUMNS)
    hold: Floats  # scratch: derivatives of the slings' force to the unknowns and to the
    # acceleration of the hook, (3, 9)
    changes: Floats  # scratch, (6, CHANGES)
    told: Floats  # scratch, (TOLD,)
    W: float  # weight in water, including the hook [N]
    hook: float  # mass of the hook [kg]
    hook_weight: float  # weight of the hook in water [N]
    m: float  # of the body [kg]
    g: float  # [m/s²]
    displaced: float  # ρ·V [kg]
    inertia: Floats  # moments of inertia about G, (3, 3) [kg·m²]
    added: Floats  # added mass along, added inertia about the axes at the reference point of the
    # water's forces, (6,); along z the mean of ascent and descent
    rising: float  # half the difference of the added mass along z, ascent less descent [kg]
    k: Floats  # ½·ρ·CdA along, ½·ρ·C about them, (6,) [kg/m], [kg·m²]
    rising_k: float  # half the difference of k along z, ascent less descent
    buoyed: Floats  # centre of buoyancy, (3,) [m]
    watered: Floats  # reference point of the water's forces, (3,)
    middle: Floats  # the middle of the body's outline, (3,)
    size: Floats  # dimensions of the outline, (3,) [m]
    legs: Floats  # (legs, LEG)
    corners: Floats  # contact points with a deck or the seabed, (corners, 3)
    carrying: float  # number of contact points that carry the body when it stands
    parts: tuple[Any, ...]  # further loads (core/body/loads.py)
    heading: float  # of its x axis at the start, from east to north [rad]
    reach: float  # largest distance from G to any of these points [m]
    stiffness: float  # sum of the stiffness of legs and deck [N/m]
    here: float = 1.0  # 0: another rope of the system carries it, or it hangs below a cut
