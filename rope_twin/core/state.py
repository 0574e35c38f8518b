"""Data layout of a rope: constants, state and work arrays; regularisation constants.

Nodes are numbered from the lower end (0: payload or fixed point) to the hang-off (n), so that
payout changes only the end of the arrays; element e joins nodes e and e + 1. Columns are nodes (or
elements), `capacity` of them, of which `counts[ELEMENTS]` are in use: a growing rope allocates no
memory. Quantities are rows with the names below; a vector takes three rows, x, y, z.

The work array is one matrix and not a struct of thirty arrays, because a kernel call passes each
array of a struct separately: the step compiles in three quarters of the time.
"""

from __future__ import annotations

import sys
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

# Regularisation constants prevent 0/0: they are added to a divisor, or under its square root. They
# are added and not used as thresholds, so that a physical law stays smooth where its divisor
# vanishes; they are far below any value that a scene can resolve. A suffix 2 denotes a square.

# For divisors of any unit whose dividend vanishes too: zero areas and volumes, a build-up of zero
# duration.
DIVISOR_MIN = 1e-300
FORCE_MIN = sys.float_info.min  # N: for forces in numpy arrays

SPEED2_MIN = 1e-20  # (m/s)²: a body that drifts with the water keeps a speed of 1e-10 m/s
TURN2 = 0.05**2  # (m/s)²: payload coefficients blend over 5 cm/s from descent to ascent
RATE_MIN = 1e-9  # m/s, rad/s or N: still water, a wake at rest, a rope without tension
WAVE_MIN = 1e-30  # any unit: no wave component reaches this depth, so none has an error there
SHEDDING_MIN = 1e-12  # rad/s: a node without shedding has zero amplitude, whatever its history

TANGENT2_MIN = 1e-12  # of the sum of two unit tangents, 0 where the rope folds back on itself
STRETCH2_MIN = 1e-16  # of the unstretched length: an element whose nodes coincide
SLING2_MIN = 1e-20  # m²: a sling whose ends coincide
LINK2_MIN = 1e-16  # m²: a link whose ends coincide
ANGLE2_MIN = 1e-40  # rad²: a body without rotation has no rotation axis


Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Rows of state.nodes and, as stage values, of work: position [m], velocity [m/s], acceleration.
POSITION, VELOCITY, ACCELERATION, NODE_ROWS = 0, 3, 6, 9
# Further rows of work. Vectors at nodes:
TANGENT = 9  # unit tangent, upward, of ghost nodes and of node 0
FLOW = 12  # water velocity [m/s]
RESIDUAL = 15  # R, out-of-balance force [N]
CORRECTION = 18  # Newton's correction of a [m/s²]
# vectors at elements:
DIRECTION = 21  # unit vector t from node e to e + 1
# node blocks and their factorisation:
BLOCK = 24  # symmetric A [kg]: xx, xy, xz, yy, yz, zz
ELIMINATED = 30  # 9 of the matrix, 3 of the vector, 6 of the inverse
# scalars at elements:
REST = 48  # unstretched length [m]
STIFFNESS, DAMPING = 49, 50  # EA/rest [N/m], c/rest [N·s/m]
TENSION = 51  # [N]; a result after `advance`
AXIAL = 52  # p·(axial stiffness) + q·(axial damping) - GEOMETRIC [kg]
GEOMETRIC = 53  # p·T/l, geometric stiffness [kg]
GROWTH = 54  # rate of the unstretched length over that length [1/s]; 0 below the top element
# scalars at nodes, lumped from the adjacent half elements:
MASS, VOLUME = 55, 56  # [kg], [m³] of displaced water
FRONTAL, SKIN = 57, 58  # reference areas of normal and tangential drag [m²]
LENGTH = 59  # unstretched length [m]
SECTION = 60  # of an element: index of its section
KEPT = 61  # NODE_ROWS of the state at the start of the step, to restore after a rejected step
CHANGE = KEPT  # change of element forces [N], three rows; in full steps, where KEPT is unused
FLOW_RATE = KEPT + NODE_ROWS  # acceleration of the water [m/s²]; set only by some effects
SURFACE = FLOW_RATE + 3  # elevation of the water surface above the node [m]; likewise
WORK_ROWS = SURFACE + 1
# and, only where an effect couples a node beyond its next neighbours:
LINK = WORK_ROWS  # c of the blocks c·I added between nodes i and i + 1, and i and i + 2 [kg]
FACTOR = LINK + 2  # of the factorisation: 6 entries of a symmetric matrix
COUPLED_ROWS = FACTOR + 6

# or in a rope between two connections of a loop (core/joined/chains):
FAR = WORK_ROWS  # 9 rows: H of the nodes
CHAIN_ROWS = FAR + 9
COUPLED_FAR = LINK + 2  # 9 rows: F of a node, by columns
COUPLED_CHAIN_ROWS = COUPLED_FAR + 9


LINE_DOUBLES = 8  # per cache line

# Rows of `sections`; one column per section of the rope, from the lower end up:
END = 0  # material coordinate of its upper end [m]; that of the last one is infinite
EA, C = 1, 2  # of T = EA·strain + C·strain rate [N], [N·s]; with a table EA is unused
# for a fibre rope (core/axial_law), 0 otherwise:
RELAXATION = 3  # 1/τ of the tension above the static curve [1/s]
DYNAMIC, PER_TENSION = 4, 5  # dynamic stiffness: constant part [N], and per mean tension
PER_AMPLITUDE = 6  # its loss per tension amplitude
PERMANENT, CURVATURE = 7, 8  # permanent fraction of the strain, and m of the working curve
HIGHEST = 9  # maximum mean tension in the rope's history [N]
PER_METRE = 10  # MASS to LENGTH per unstretched metre
SECTION_ROWS = 15

# state.counts
ELEMENTS, LOWEST_OFFSET, COUNTS = 0, 1, 2
# state.health: sums and maxima since the start
(STEPS, SOLVES, SOLVES_MAX, SUBSTEPS, SUBSTEPS_MAX, REJECTED, SUBSTEPS_UNCONVERGED, SPLITS, MERGES,
 HEALTH) = range(10)  # fmt: skip
# columns of `pull`, one row per step: magnitude and vector of the rope's force on the hang-off
PULL, PULL_X, PULL_Y, PULL_Z, PULL_COLUMNS = range(5)
# columns of the prescribed motion: hang-off x, y, z and the paid-out length L
X, Y, Z, LINE, MOTIONS = range(5)
STEPS_PER_CALL = 256  # number of steps for which a twin prescribes motion at most
# For kernel arguments: numba compiles a separate specialisation for each literal argument.
ZERO, KEPT_ROWS, LINE_COLUMN = np.int64(0), np.int64(KEPT), np.int64(LINE)

SAME_PLACE = 1e-6  # m: material coordinates closer than this are equal
# Columns of the ghost nodes for a split or merge, from the end of the arrays (core/payout):
LOW, MIDDLE, HIGH, AFTER = -4, -3, -2, -1


class Model(NamedTuple):
    """Constants of one rope."""

    element_length: float  # of a new element at the sheave [m]
    split_above: float  # top element splits above this length [m]
    merge_below: float  # top element merges below this length [m]
    absorb: float  # decay time of length corrections after split or merge [s]
    first_free: int  # 0: free lower end; 1: node 0 is fixed
    step: float  # time step [s]
    tolerance: float  # largest tension mismatch of an accepted stage [N]


class State(NamedTuple):
    """Complete restart data of the rope."""

    nodes: Floats  # position, velocity, acceleration, (NODE_ROWS, capacity)
    s: Floats  # material coordinate from the lower end, unstretched [m], (capacity,)
    offset: Floats  # length correction of each element, decaying after a split or merge [m]
    counts: Ints  # elements in use, lowest element with a length correction
    health: Ints  # see STEPS ... MERGES

    def copy(self) -> State:
        """Return a deep copy."""
        return State(
            self.nodes.copy(), self.s.copy(), self.offset.copy(), self.counts.copy(),
            self.health.copy(),
        )  # fmt: skip


class Table(NamedTuple):
    """Piecewise-cubic elastic tension T = EA(strain)·strain between knots; one row per section.

    Beyond knot j: T = tension + slope·u + v²·(curve + bend·v), u = strain - knot, v = max(u, 0).
    """

    knot: Floats  # strain, rising; the first 0, unused ones infinite, (sections, knots)
    tension: Floats  # at the knot [N]
    slope: Floats  # dT/dstrain there [N]
    curve: Floats  # [N]
    bend: Floats  # [N]


class Rope(NamedTuple):
    """Constants, state, work array and effects of one rope: the argument of the step's kernels."""

    model: Model
    state: State
    work: Floats  # work array, (WORK_ROWS or COUPLED_ROWS, capacity)
    sections: Floats  # properties of the sections, (SECTION_ROWS, sections)
    effects: tuple[Any, ...]  # their types select the compiled code
    law: Table | None = None  # None for T = EA·strain; its type selects the compiled code


class Boundary(NamedTuple):
    """Prescribed motion at the boundaries of the steps to come, (steps + 1, MOTIONS) each."""

    value: Floats  # hang-off x, y, z and paid-out length [m]
    rate: Floats  # [m/s]


class Stage(NamedTuple):
    """One implicit stage: its time and the weights in x = x_hat + p·a, v = v_hat + q·a."""

    time: float  # [s]
    p: float  # [s²]
    q: float  # [s]
    V: float  # payout speed dL/dt [m/s]


class LaneStage(NamedTuple):
    """One implicit stage of a batch of ropes (core/lanes)."""

    time: float  # [s]
    p: float  # [s²]
    q: float  # [s]
    V: Any  # payout speed of each lane [m/s]
    lanes: int  # bit mask of the lanes to evaluate; other lanes keep their internal variables
    each: Any  # data of the individual lanes (core/lanes/effects), or None


def new_state(capacity: int) -> State:
    """Return a state of zeros with space for `capacity` nodes."""
    return State(
        np.zeros((NODE_ROWS, capacity)),
        np.zeros(capacity),
        np.zeros(capacity),
        np.zeros(COUNTS, np.int64),
        np.zeros(HEALTH, np.int64),
    )


def columns_for(capacity: int) -> int:
    """Return the scratch columns for `capacity` nodes: an odd number of whole cache lines.

    All rows then begin at a cache line, so that no SIMD vector straddles two, and the rows of a
    node do not map to the same cache set.
    """
    return (ceil(capacity / LINE_DOUBLES) | 1) * LINE_DOUBLES


def new_work(columns: int, count: int = WORK_ROWS) -> Floats:
    """Return cache-aligned scratch, (count, columns); `hooks.work_rows` gives the count."""
    space = np.zeros(count * columns + LINE_DOUBLES)
    start = -(space.ctypes.data // space.itemsize) % LINE_DOUBLES
    return space[start : start + count * columns].reshape(count, columns)
