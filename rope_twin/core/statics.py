"""Static equilibrium of a single rope with all its effects.

The unknowns are the element forces S_e, not the node positions. For given loads f the balance S_i -
S_{i-1} + f_i = 0 determines them, except for the three components of the reaction at a fixed lower
end, which follow from a convex problem (core/still_rope.py). The shape is the integral of the
elements along their forces, x_{e+1} - x_e = l(|S_e|)·S_e/|S_e|. In this compliance form axial
stiffness does not affect convergence, no intermediate shape is slack, and the initial guess only
serves to evaluate the first loads. Loads and shape are made consistent by fixed-point iteration on
the loads (fast where weight dominates), then by Newton's method with the derivative of the loads to
the shape, which is not symmetric (drag turns with the tangent). Where loads have an active set, as
on a seabed, and where both fail, positions and forces are solved together (below). The last
fallback is dynamic relaxation with growing steps, followed by Newton's method.

**Primal-dual Newton method**, for active sets (`solve_primal_dual`). Rope on a seabed may carry no
tension, and the integral along the forces is then ill-conditioned. So the unknowns are both the
node positions x and the element forces S_e:

    balance  S_i - S_{i-1} + f_i(x) = 0,    law  (Δx - S/k)·m = l0·S  with  m = √(|S|² + ε²).

The law with ε = 0 is that of a tension-only element, with any length up to l0 at zero force; ε [N]
regularises its corner and is reduced by continuation. Written as a product the law is nearly linear
in x and S, so that full Newton steps converge where the quotient Δx = S·(l0/m + 1/k) diverges. This
is the primal-dual method of Chan, Golub and Mulet (1999, SIAM J. Sci. Comput. 20, 1964), including
the symmetric, positive definite element stiffness

    K = m·C⁻¹,  C = (l0 + m/k)·I - (r·Sᵀ + S·rᵀ)/(2·m),  r = Δx - S/k, shortened to l0.

The result does not depend on the initial guess. The position of rope without tension is not unique;
the solution is that of the last ε, in which the rope is spread as evenly as possible.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import (
    FORCE_MIN,
    NODE_ROWS,
    PULL_COLUMNS,
    SUBSTEPS_UNCONVERGED,
    VELOCITY,
    Floats,
    Rope,
)
from rope_twin.core.step import advance
from rope_twin.core.still_rope import (
    FORCE_TOL_N,
    MAX_RATIO,
    MIN_FRACTION,
    PERTURBATION,
    ROUND_OFF,
    SYMMETRIC,
    TENSION_TOL,
    Elastic,
    Equilibrium,
    Forces,
    Shape,
    StillRope,
    element_forces,
    first_forces,
    is_off,
    largest,
    load_change,
    newton_change,
    refreshed,
    shape_of,
    solve_blocks,
)

ROUNDS = 60  # iterations of each method; typically 1 to 4 under weight, up to 9 in strong currents
MIN_REFRESHES = 2  # first iterations, which always update the axial tangent
BALANCE_TOL = 1e-11  # of the largest tension: final residual; round-off is 1e-14
RELAXATIONS, STEP_FIRST, STEP_LAST, STEP_MIN, GROWTH, SHRINK = 30, 1.0, 3e3, 1e-4, 4.0, 0.1
ATTEMPTS = 5  # alternating relaxation and Newton's method


def find_equilibrium(rope: Rope, L: float) -> float:
    """Move the nodes to equilibrium at paid-out length L; return the estimated position error [m].

    The error is infinite if no equilibrium was found; `solve_statics` returns details.
    """
    end = solve_statics(rope, L)
    return end.left_m if end.found else float("inf")


def solve_statics(rope: Rope, L: float) -> Equilibrium:
    """Solve the static equilibrium at paid-out length L [m] and move the nodes there.

    The hang-off is fixed. If no equilibrium is found, the nodes end at the shape with the smallest
    residual. Solver counters and length corrections are reset.
    """
    rope.state.offset[:] = 0.0
    still = StillRope(rope, L)
    with np.errstate(all="ignore"):  # a shape that overflows is rejected as not better
        best, position = _residual_at(still, still.place.copy(), 0.0, 0), still.place.copy()
        methods = (_solve_pair, _solve_forces) if still.switches else (_solve_forces, _solve_pair)
        for settle_by in methods:
            if not best.found and np.isfinite(best.residual_n):
                best, position = _better(still, settle_by(still), best, position)
                still.rest_at(position)
        for attempt in range(ATTEMPTS):
            if best.found or not np.isfinite(best.residual_n):
                break
            end = _relax(rope, still, STEP_LAST * SHRINK**attempt)
            relaxed = still.place.copy()
            best, position = _better(still, end, best, position)
            if not end.found:
                best, position = _better(still, _solve_forces(still, near=True), best, position)
                still.rest_at(relaxed)
        still.rest_at(position)
    return best


def _better(
    still: StillRope, end: Equilibrium, best: Equilibrium, position: Floats
) -> tuple[Equilibrium, Floats]:
    """Return the new result and its shape if it is better than the best one, else the best one."""
    if end.found or end.residual_n < best.residual_n:
        return end, still.place.copy()
    return best, position


def _solve_forces(still: StillRope, near: bool = False) -> Equilibrium:
    """Solve for the element forces from the present shape, and move the nodes to the best shape.

    near: start Newton's method from the present element forces, which are close to the solution.
    """
    position, law = still.place.copy(), still.elastic()
    forces, round_off = still.forces(position), _round_off(still)
    lower_end = position[:, 0].copy() if still.first else None
    S = element_forces(position, forces) if near else first_forces(still, lower_end, forces.load)
    shape = shape_of(still, law, lower_end, S)
    move, newton, rounds, converged = np.inf, near, 0, False
    tension = float(shape.forces.tension.max())
    while rounds < ROUNDS and np.isfinite(shape.size):
        rounds += 1
        if rounds <= MIN_REFRESHES or is_off(shape.S, shape.forces.tension):
            law = refreshed(still, law, shape.place)
        change = newton_change(still, law, shape) if newton else -np.cumsum(shape.miss, axis=1)
        following, fraction = _line_search(still, law, lower_end, shape, change)
        better = following.size < shape.size
        fast = following.size < MAX_RATIO * shape.size
        distance = largest(following.place - shape.place)
        if better:
            move = distance * following.size / shape.size
            shape = following
        elif not np.isfinite(move):  # the first shape was right except for round-off
            move = distance
        tension = float(shape.forces.tension.max())
        converged = shape.residual <= max(FORCE_TOL_N, round_off, TENSION_TOL * tension)
        if converged and not (fast and shape.size > BALANCE_TOL * tension):
            break
        if newton and fraction < MIN_FRACTION:
            break
        newton = newton or not fast
    still.rest_at(shape.place)
    return Equilibrium(converged, shape.residual, tension, move, rounds)


def _solve_pair(still: StillRope) -> Equilibrium:
    return solve_primal_dual(still, (max(FORCE_TOL_N, _round_off(still)), TENSION_TOL))


def _round_off(still: StillRope) -> float:
    """Return the force due to round-off of the positions in an element's length [N]."""
    reach = float(np.abs(still.place[:, -1]).max() + still.rest.sum())
    return ROUND_OFF * float(still.elastic().stiffness.max()) * reach


def _line_search(
    still: StillRope, law: Elastic, lower_end: Floats | None, shape: Shape, change: Floats
) -> tuple[Shape, float]:
    """Return the shape found by backtracking along the change, and the fraction taken."""
    fraction = 1.0
    while True:
        following = shape_of(still, law, lower_end, shape.S + fraction * change)
        if following.size <= (1.0 - 1e-4 * fraction) * shape.size or fraction < MIN_FRACTION:
            return following, fraction
        fraction *= 0.5


def _relax(rope: Rope, still: StillRope, longest: float) -> Equilibrium:
    """Dynamic relaxation with steps that grow up to the longest [s], and zero velocity after each.

    A step minimises the convex energy, regularised by mass over step squared. Convergence is slow
    but robust for slack elements, whose force and direction are undefined.
    """
    boundary, round_off = still.boundary, _round_off(still)
    model = rope.model._replace(
        split_above=np.inf, merge_below=0.0, tolerance=max(FORCE_TOL_N, round_off)
    )
    pull = np.zeros((1, PULL_COLUMNS))
    nodes, health, step = rope.state.nodes, rope.state.health, STEP_FIRST
    end, last = Equilibrium(False, np.inf, 0.0, np.inf, 0), np.inf
    for rounds in range(RELAXATIONS):
        before = still.place.copy()
        nodes[VELOCITY:NODE_ROWS] = 0.0
        health[:] = 0
        relaxing = rope._replace(model=model._replace(step=step))
        done = advance(relaxing, boundary, pull, -step, 1)  # before time 0 the sea is flat
        if done < 1 or health[SUBSTEPS_UNCONVERGED] > 0:
            still.rest_at(before)
            step *= SHRINK
            if step < STEP_MIN:
                break
            continue
        position = still.place.copy()
        end = _residual_at(still, position, largest(position - before), rounds)
        if end.found and not end.left_m < MAX_RATIO * last:  # no progress: round-off
            break
        last = end.left_m if end.found else np.inf
        step = min(step * GROWTH, longest)
    return end


def _residual_at(still: StillRope, position: Floats, move: float, rounds: int) -> Equilibrium:
    """Return the residual of equilibrium at `position`, where the nodes are left."""
    forces, round_off = still.forces(position), _round_off(still)
    still.rest_at(position)
    residual, tension = largest(forces.total), float(forces.tension.max())
    converged = residual <= max(FORCE_TOL_N, round_off, TENSION_TOL * tension)
    return Equilibrium(converged, residual, tension, move, rounds)


# Initial ε as a fraction of the sum of all loads, and the largest displacement of a node, as a
# fraction of the rope's length, at which ε is reduced. For 13 ropes on seabeds and two mesh sizes
# the first pair converges in 3 to 21 iterations; the second is the fallback where it diverges.
CONTINUATIONS = ((1e-3, 0.3), (1e-2, 0.03))
PAIR_ROUNDS = 60
EPS_FACTOR = 0.1  # reduction factor of ε
MIN_EPS = 1e-14  # of the sum of all loads
TANGENT_MOVE = 1e-2  # of the rope's length: exact tangents are used for smaller moves
BUNCH_LENGTH = 1e-2  # of the rope's length: extent of the bunched rope that gives the first loads
PAIR_MAX_RATIO = 0.3  # after convergence, iteration continues while moves shrink by this factor
MOVE_TOL = 1e-9  # of the rope's length: a negligible move


def solve_primal_dual(still: StillRope, tolerances: tuple[float, float]) -> Equilibrium:
    """Solve the static equilibrium for positions and forces, and move the nodes there.

    tolerances: of the residual force at a node, in N and as a fraction of the largest tension.
    Without equilibrium the nodes end in the last shape.
    """
    for fraction, max_move in CONTINUATIONS:
        end = _continue(still, tolerances, fraction, max_move)
        if end.found:
            break
    return end


def _continue(
    still: StillRope, tolerances: tuple[float, float], fraction: float, max_move: float
) -> Equilibrium:
    """Solve for decreasing ε (continuation), from the fraction `fraction` of the loads."""
    law, length = still.elastic(), float(still.rest.sum())
    x, S, forces, weight = _start(still, law)
    eps, eps_min = fraction * weight, MIN_EPS * weight
    end, last, move, slow = Equilibrium(False, np.inf, 0.0, np.inf, 0), np.inf, np.inf, False
    for rounds in range(1, PAIR_ROUNDS + 1):
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
        slow = PAIR_MAX_RATIO * before < move < TANGENT_MOVE * length
        residual, tension = largest(forces.total), float(forces.tension.max())
        converged = residual <= max(tolerances[0], tolerances[1] * tension)
        end = Equilibrium(converged, residual, tension, move, rounds)
        if not np.isfinite(residual) or (
            converged and (not move < PAIR_MAX_RATIO * last or move < MOVE_TOL * length)
        ):
            break
        last = move if converged else np.inf
        if not converged and move < max_move * length:
            eps = max(EPS_FACTOR * eps, eps_min)
    still.rest_at(x)
    return end


def _start(still: StillRope, law: Elastic) -> tuple[Floats, Floats, Forces, float]:
    """Return initial positions and element forces, loads there, and their total size [N].

    The loads are those of a rope bunched below its hang-off, or towards its fixed end: with water,
    but without seabed contact.
    """
    top = still.place[:, -1:].copy()
    lower_end = still.place[:, 0].copy() if still.first else None
    length = float(still.rest.sum())
    low = top - [[0.0], [0.0], [length]] if lower_end is None else lower_end[:, None]
    fraction = np.concatenate([[0.0], np.cumsum(still.rest)]) / length
    bunched = top + BUNCH_LENGTH * (1.0 - fraction) * (low - top)
    if lower_end is not None:
        bunched[:, 0] = lower_end
    load = still.forces(bunched).load
    shape = shape_of(still, law, lower_end, first_forces(still, lower_end, load))
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
    """Return the node-diagonal part of `load_change`, from a common displacement of all nodes.

    It is exact in still water, for effects that do not depend on neighbouring nodes.
    """
    if still.reach > 1:
        return load_change(still, shape)
    change = np.zeros((3, 3, 3, still.n))
    step = PERTURBATION * float(still.rest.min())
    for c in range(3):
        position = shape.place.copy()
        position[c] += step
        change[1, :, c] = (still.forces(position).load - shape.forces.load) / step
    return change
