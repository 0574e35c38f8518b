"""Static equilibrium by Newton's method on positions and element forces at once, for active sets.

A seabed that pushes only nodes below it leaves rope that carries no tension, and a shape laid along
its forces (core/statics/shape.py) then moves far with the least change of them. So both are unknown
here, the node positions x and the element forces S_e:

    balance  S_i - S_{i-1} + f_i(x) = 0,    law  (Δx - S/k)·m = l0·S  with  m = √(|S|² + ε²).

The law with ε = 0 is that of a tension-only element, with any length up to l0 at zero force; ε [N]
rounds its corner, and equilibrium is followed from a large ε to a negligible one (continuation).
Written as a product it is nearly linear in x and S, so that full Newton steps converge where the
quotient Δx = S·(l0/m + 1/k) diverges: the primal-dual method of Chan, Golub and Mulet (1999, SIAM
J. Sci. Comput. 20, 1964), with whose symmetric, definite element stiffness it also shares

    K = m·C⁻¹,  C = (l0 + m/k)·I - (r·Sᵀ + S·rᵀ)/(2·m),  r = Δx - S/k, shortened to l0.

Nothing depends on the guess. Where rope lies without tension any position balances; the solution is
the one of the last ε: as evenly spread as the other conditions allow.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.guards import FORCE_MIN
from rope_twin.core.state import Floats
from rope_twin.core.statics.forces import SYMMETRIC, Elastic, Equilibrium, Forces, StillRope
from rope_twin.core.statics.shape import (
    PERTURBATION,
    Shape,
    first_forces,
    is_off,
    largest,
    load_change,
    refreshed,
    shape_of,
    solve_blocks,
)

# The first ε as a fraction of the sum of all loads, and the largest move of a node, as a fraction
# of the rope's length, at which ε shrinks: for 13 ropes on seabeds and two mesh sizes the first
# pair needs 3 to 21 rounds; the second, slower one is used where the first diverges.
CONTINUATIONS = ((1e-3, 0.3), (1e-2, 0.03))
ROUNDS = 60
SHRINK = 0.1  # factor on ε, each time
MIN_EPS = 1e-14  # of the sum of all loads
TANGENT_MOVE = 1e-2  # of the rope's length: exact tangents are used for smaller moves
BUNCH_LENGTH = 1e-2  # of the rope's length: extent of the bunched rope that gives the first loads
MAX_RATIO = 0.3  # converged iterations go on while moves shrink by this factor
MOVE_TOL = 1e-9  # of the rope's length: a negligible move


def solve_primal_dual(still: StillRope, enough: tuple[float, float]) -> Equilibrium:
    """Solve the static equilibrium for positions and forces, and move the nodes there.

    enough: tolerance of the residual force at a node [N], and the same as a fraction of the largest
    tension. Without equilibrium the nodes end in the last shape.
    """
    for share, within in CONTINUATIONS:
        end = _follow(still, enough, share, within)
        if end.found:
            break
    return end


def _follow(
    still: StillRope, enough: tuple[float, float], share: float, within: float
) -> Equilibrium:
    """Follow equilibrium for a decreasing ε from one starting value."""
    law, length = still.elastic(), float(still.rest.sum())
    x, S, forces, weight = _start(still, law)
    eps, least = share * weight, MIN_EPS * weight
    end, last, move, slow = Equilibrium(False, np.inf, 0.0, np.inf, 0), np.inf, np.inf, False
    for rounds in range(1, ROUNDS + 1):
        if move < TANGENT_MOVE * length and is_off(S, forces.tension):
            law = refreshed(still, law, x)
        K, force = _elements(law, S, np.diff(x, axis=1), eps)
        change = load_change if slow and still.flows else _local_change
        stiffness = -change(still, Shape(S, x, forces, forces.load))
        S = S + force
        miss = forces.load + S
        miss[:, 1:] -= S[:, :-1]
        miss[:, : still.first] = 0.0
        dx = solve_blocks(still, K, stiffness, miss)
        x, S = x + dx, S + np.einsum("kce,ce->ke", K, np.diff(dx, axis=1))
        before, move, forces = move, largest(dx), still.forces(x)
        slow = MAX_RATIO * before < move < TANGENT_MOVE * length
        residual, tension = largest(forces.total), float(forces.tension.max())
        found = residual <= max(enough[0], enough[1] * tension)
        end = Equilibrium(found, residual, tension, move, rounds)
        if not np.isfinite(residual) or (
            found and (not move < MAX_RATIO * last or move < MOVE_TOL * length)
        ):
            break
        last = move if found else np.inf
        if not found and move < within * length:
            eps = max(SHRINK * eps, least)
    still.rest_at(x)
    return end


def _start(still: StillRope, law: Elastic) -> tuple[Floats, Floats, Forces, float]:
    """Return initial positions and element forces, loads there, and their total size [N].

    The loads are those of a rope bunched below its hang-off, or towards its fixed end: with water,
    but without seabed contact.
    """
    top = still.place[:, -1:].copy()
    hold = still.place[:, 0].copy() if still.first else None
    length = float(still.rest.sum())
    low = top - [[0.0], [0.0], [length]] if hold is None else hold[:, None]
    share = np.concatenate([[0.0], np.cumsum(still.rest)]) / length
    bunched = top + BUNCH_LENGTH * (1.0 - share) * (low - top)
    if hold is not None:
        bunched[:, 0] = hold
    load = still.forces(bunched).load
    shape = shape_of(still, law, hold, first_forces(still, hold, load))
    size = float(np.sqrt((shape.forces.load**2).sum(axis=0)).sum())
    return shape.place, shape.S, shape.forces, max(size, MIN_EPS)


def _elements(law: Elastic, S: Floats, span: Floats, eps: float) -> tuple[Floats, Floats]:
    """Return K of each element, (3, 3, n), and the correction of S for its residual, (3, n)."""
    m = np.sqrt((S * S).sum(axis=0) + eps * eps)
    r = span - S / law.stiffness
    miss = r * m - law.slack * S
    r *= np.minimum(1.0, law.slack / (np.sqrt((r * r).sum(axis=0)) + FORCE_MIN))
    half, length = 0.5 / m * S, law.slack + m / law.stiffness
    xx, yy, zz = length - 2.0 * r * half
    xy, xz, yz = (-r[k] * half[c] - r[c] * half[k] for k, c in ((0, 1), (0, 2), (1, 2)))
    inverse = np.stack(
        [
            yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy,
            xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy,
        ]
    )  # fmt: skip
    inverse /= xx * inverse[0] + xy * inverse[1] + xz * inverse[2]
    force = np.einsum("kce,ce->ke", inverse[SYMMETRIC], miss)
    return m * inverse[SYMMETRIC], force


def _local_change(still: StillRope, shape: Shape) -> Floats:
    """Return `load_change` without the loads' dependence on the rope's direction.

    All nodes move by the same. It is exact in still water and with effects that do not depend on
    neighbours.
    """
    if still.reach > 1:
        return load_change(still, shape)
    change = np.zeros((3, 3, 3, still.n))
    step = PERTURBATION * float(still.rest.min())
    for c in range(3):
        place = shape.place.copy()
        place[c] += step
        change[1, :, c] = (still.forces(place).load - shape.forces.load) / step
    return change
