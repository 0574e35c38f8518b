"""Static equilibrium of a multi-line system with all effects.

Dynamic relaxation with growing steps and the velocity reset to zero after each. A step of h is a
Newton solve of the convex energy, regularised by mass over h², and is robust for slack elements. In
the longest steps the mass is negligible, so that they are Newton steps of the static problem
(without the derivative of the loads to the shape). They end at time 0, before which the sea is
flat.

A coarse mesh is solved first (core/joined/initial_guess.py); an initial guess that converges slowly
is replaced by one derived from the ropes' lengths. Without progress a phase of damped free fall
follows.

**Reeving over sheaves**: two ropes of a system that form one line. In equilibrium without friction
the tension on both sides of a sheave is equal. With locked wheels rope is transferred by the secant
method on the tension difference; finally the wheels are released.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.body.state import RigidBody
from rope_twin.core.body.step import start
from rope_twin.core.joined.initial_guess import coarsen, interpolate_from, set_initial_guess
from rope_twin.core.joined.joints import LOOSE, System
from rope_twin.core.joined.stack import FRICTION, FROM, INTO, WHEEL, Sheaves
from rope_twin.core.loads.memory import reset_internal_variables
from rope_twin.core.payout import TRIALS
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    EA,
    ELEMENTS,
    LINE,
    NODE_ROWS,
    POSITION,
    PULL_COLUMNS,
    SOLVES,
    SUBSTEPS,
    SUBSTEPS_UNCONVERGED,
    TENSION,
    VELOCITY,
    Boundary,
    Floats,
    Rope,
)
from rope_twin.core.step import advance_joined
from rope_twin.core.still_rope import (
    FORCE_TOL_N,
    INSTANT,
    MAX_RATIO,
    ROUND_OFF,
    SYMMETRIC,
    TENSION_TOL,
    Equilibrium,
    largest,
)

ROUNDS, STEP_FIRST, STEP_LAST, STEP_MIN, GROWTH, SHRINK = 40, 1.0, 3e3, 1e-4, 4.0, 0.1
ATTEMPTS, FALL_STEPS, FALL_STEP = 8, 300, 0.05
STEP_NEAR = 64.0  # first step where ropes are near equilibrium
LEVELS = (6, 30)  # maximum elements per rope of the coarse levels
HARD_SOLVES = 600  # solves on a coarse level that mark a hard initial guess
EASY_SUBSTEPS = 4  # substeps of a step that is short enough


def solve_joined_statics(system: System, place: Floats) -> Equilibrium:
    """Solve the static equilibrium of ropes and connections.

    place: (ropes, MOTIONS), each rope's hang-off and paid-out length [m]; rows of ropes whose upper
    end is connected are not read. If no equilibrium is found, the nodes end at the shape with the
    smallest residual. Solver counters and length corrections are reset.
    """
    if all(_count(system, r) - 1 <= LEVELS[0] for r in range(len(system.ropes))):
        return refine_joined_statics(system, place, STEP_FIRST)
    with np.errstate(all="ignore"):  # a shape that overflows is rejected as not better
        _boundary(system, place)
        _settle_coarsely(system, place)
    return refine_joined_statics(system, place)


def refine_joined_statics(system: System, place: Floats, first: float = STEP_NEAR) -> Equilibrium:
    """Solve the equilibrium from a shape close to it; first: the first of the long steps [s]."""
    for rope in system.ropes:
        rope.state.offset[:] = 0.0
    with np.errstate(all="ignore"):
        end = _relax(system, _boundary(system, place), first)
    for rope in system.ropes:
        rope.state.health[:] = 0
    return end


def weigh(system: System, place: Floats) -> None:
    """Store tension, stiffness and nodal masses of the static state in the ropes' work arrays.

    place: as for `solve_joined_statics`. The blocks of nodes are mass alone, including added mass.
    """
    boundary = _boundary(system, place)
    _residual(system, boundary, np.zeros((len(system.ropes), 1, PULL_COLUMNS)))


def _settle_coarsely(system: System, place: Floats) -> None:
    """Solve on a coarse mesh and then on a finer one (coarse-to-fine).

    An initial guess that does not converge on the coarse mesh is replaced.
    """
    first = STEP_FIRST
    for max_elements in LEVELS:
        coarse = coarsen(system, max_elements)
        boundary = _boundary(coarse, place)
        pull = np.zeros((len(coarse.ropes), 1, PULL_COLUMNS))
        end, _ = _take_long_steps(coarse, boundary, pull, first, max_solves=HARD_SOLVES)
        if not end.found:
            set_initial_guess(coarse)
            _stop(coarse)
            _relax(coarse, boundary, first)
        interpolate_from(system, coarse)
        _stop(system)
        first = STEP_NEAR
    _boundary(system, place)


def _boundary(system: System, place: Floats) -> Boundary:
    """Return the boundary of fixed hang-offs for one step; move the ropes' upper nodes there."""
    value = np.repeat(place[:, None, :], 2, axis=1)
    for r, rope in enumerate(system.ropes):
        if system.joints.upper[r] == LOOSE:
            n = int(rope.state.counts[ELEMENTS])
            rope.state.nodes[POSITION : POSITION + 3, n] = place[r, :LINE]
            rope.state.s[n] = place[r, LINE]
    return Boundary(value, np.zeros_like(value))


def _stopped(system: System, step: float, tolerance: float) -> System:
    """Return the system with another step size, without remeshing."""
    return system._replace(
        ropes=tuple(
            rope._replace(
                model=rope.model._replace(
                    step=step, tolerance=tolerance, split_above=np.inf, merge_below=0.0
                )
            )
            for rope in system.ropes
        )
    )


def _tables(system: System) -> list[Floats]:
    """Return views of the nodes of ropes and connections, (NODE_ROWS, any) each."""
    tables = [rope.state.nodes[:, : _count(system, r)] for r, rope in enumerate(system.ropes)]
    return [*tables, system.joints.nodes]


def _count(system: System, r: int) -> int:
    return int(system.ropes[r].state.counts[ELEMENTS]) + 1


def _stop(system: System) -> None:
    """Reset velocities, counters and internal variables; a body starts at rest below its hook."""
    for table in _tables(system):
        table[VELOCITY:NODE_ROWS] = 0.0
    for rope in system.ropes:
        rope.state.health[:] = 0
        reset_internal_variables(rope.effects)
        for body in rope.effects:
            if isinstance(body, RigidBody):
                start(body, rope, 0)


def _places(system: System) -> list[Floats]:
    return [table[POSITION : POSITION + 3].copy() for table in _tables(system)]


def _put(system: System, places: list[Floats]) -> None:
    for table, place in zip(_tables(system), places, strict=True):
        table[POSITION : POSITION + 3] = place
    _stop(system)


def _residual(system: System, boundary: Boundary, pull: Floats) -> tuple[float, float]:
    """Return the largest residual force and the largest tension [N]; the nodes do not move.

    A step of 1e-15 s leaves the positions unchanged and yields the acceleration a = A⁻¹·F.
    """
    places = _places(system)
    _stop(system)
    frozen = _stopped(system, INSTANT, np.inf)
    finite = advance_joined(frozen, boundary, pull, 0.0, 1) == 1
    residual, tension = 0.0, 0.0
    at_joints = np.zeros((3, system.joints.nodes.shape[1]))
    for r, rope in enumerate(system.ropes):
        n = _count(system, r) - 1
        a = rope.state.nodes[ACCELERATION : ACCELERATION + 3, : n + 1]
        mass = rope.work[BLOCK : BLOCK + 6, : n + 1]
        force = np.einsum("kcn,cn->kn", mass[SYMMETRIC], a)
        if system.joints.lower[r] != LOOSE:
            at_joints[:, system.joints.lower[r]] += force[:, 0]
        if system.joints.upper[r] != LOOSE:
            at_joints[:, system.joints.upper[r]] += force[:, n]
        residual = max(residual, largest(force[:, rope.model.first_free : n]))
        tension = max(tension, float(rope.work[TENSION, :n].max()))
    if at_joints.size:
        residual = max(residual, largest(at_joints))
    _put(system, places)
    return (residual, tension) if finite else (np.inf, np.inf)


def _round_off(system: System) -> float:
    """Return the force due to round-off of the positions in an element's length [N]."""
    round_off = 0.0
    for r, rope in enumerate(system.ropes):
        rest = np.diff(rope.state.s[: _count(system, r)])
        reach = np.abs(rope.state.nodes[POSITION : POSITION + 3, : len(rest) + 1]).max()
        stiffness = float(rope.sections[EA].max() / rest.min())
        round_off = max(round_off, ROUND_OFF * stiffness * float(reach + rest.sum()))
    return round_off


def _relax(system: System, boundary: Boundary, first: float) -> Equilibrium:
    """Alternate long steps and, without progress, free fall, until equilibrium is found."""
    pull = np.zeros((len(system.ropes), 1, PULL_COLUMNS))
    for _ in range(ATTEMPTS):
        end, nearest = _take_long_steps(system, boundary, pull, first)
        if nearest:
            break
        if not end.found:
            _fall(system, boundary, pull)
    return end


def _fall(system: System, boundary: Boundary, pull: Floats) -> None:
    """Dynamic relaxation with kinetic damping (Cundall 1976): reset velocities at energy peaks.

    Slack ropes far from equilibrium approach it by their weight.
    """
    tolerance = max(system.ropes[0].model.tolerance, _round_off(system))
    falling, energy = _stopped(system, FALL_STEP, tolerance), 0.0
    _stop(system)
    for _ in range(FALL_STEPS):
        if advance_joined(falling, boundary, pull, -FALL_STEP, 1) < 1:
            _stop(system)
            continue
        kinetic = sum(float((t[VELOCITY:ACCELERATION] ** 2).sum()) for t in _tables(system))
        if kinetic < energy:
            _stop(system)
        energy = kinetic if kinetic >= energy else 0.0


def _take_long_steps(
    system: System, boundary: Boundary, pull: Floats, first: float, max_solves: float = np.inf
) -> tuple[Equilibrium, bool]:
    """Return the state of the static solution, and whether it ended for lack of progress.

    max_solves: the iteration ends if this many solves were not enough to reach the longest steps.
    """
    tolerance = max(FORCE_TOL_N, _round_off(system))
    health, step, solves = system.ropes[0].state.health, first, 0
    last, before = np.inf, _places(system)
    for rounds in range(ROUNDS):
        before = _places(system)
        _stop(system)
        done = advance_joined(_stopped(system, step, tolerance), boundary, pull, -step, 1)
        solves += int(health[SOLVES])
        if step < STEP_LAST and solves > max_solves:
            break
        if done < 1 or health[SUBSTEPS_UNCONVERGED] > 0:
            _put(system, before)
            step *= SHRINK
            if step < STEP_MIN:
                break
            continue
        substeps = int(health[SUBSTEPS])
        if step >= STEP_LAST:  # the move of shorter steps is no error estimate
            move = _largest_move(before, _places(system))
            end = _rest(system, boundary, pull, tolerance)._replace(left_m=move, rounds=rounds)
            if end.found and not move < MAX_RATIO * last:  # no progress: round-off
                return end, True
            last = move if end.found else np.inf
        if substeps == 1:
            step = min(step * GROWTH, STEP_LAST)
        elif substeps > EASY_SUBSTEPS:
            step /= GROWTH
    end = _rest(system, boundary, pull, tolerance)
    return end._replace(left_m=_largest_move(before, _places(system)), rounds=ROUNDS), False


def _largest_move(before: list[Floats], after: list[Floats]) -> float:
    return max(largest(b - a) for a, b in zip(before, after, strict=True) if a.size)


def _rest(system: System, boundary: Boundary, pull: Floats, tolerance: float) -> Equilibrium:
    """Return the residual of equilibrium at the present positions."""
    residual, tension = _residual(system, boundary, pull)
    converged = residual <= max(tolerance, TENSION_TOL * tension)
    return Equilibrium(converged, residual, tension, np.inf, 0)


HELD = 1e30  # kg: inertia of a locked wheel
REEVING_ROUNDS = 12
COORDINATE_ROUND_OFF = 1e-15  # of the largest coordinate
ALIKE = 1e-3  # of a tension: largest difference at which the wheel is released
SHORTEST, LONGEST = 0.5, 1.5  # of the element length: the last element of a stretch


def solve_reeved_statics(system: System, place: Floats) -> Equilibrium:
    """Solve the static equilibrium, with rope running over sheaves until both tensions are equal.

    The flow over every sheave is 0 afterwards.
    """
    sheaves = system.sheaves
    if sheaves is None:
        return solve_joined_statics(system, place)
    locked = sheaves.figures[[WHEEL, FRICTION]].copy()
    sheaves.figures[WHEEL], sheaves.figures[FRICTION] = HELD, 0.0
    end = _settle_held(system, sheaves, place)
    sheaves.figures[WHEEL] = locked[0]
    if end.found:
        end = refine_joined_statics(system, place)
    sheaves.figures[FRICTION] = locked[1]
    _drop_round_off(system)
    return end


def _drop_round_off(system: System) -> None:
    """Set coordinates at round-off level to 0.

    A plane loop would otherwise sway out of plane with an amplitude that decays to subnormal
    numbers, on which operations take several times as long.
    """
    tables = [rope.state.nodes[: POSITION + 3] for rope in system.ropes]
    tables.append(system.joints.nodes[: POSITION + 3])
    reach = max(float(np.abs(table).max()) for table in tables)
    for table in tables:
        table[np.abs(table) < COORDINATE_ROUND_OFF * reach] = 0.0


def _settle_held(system: System, sheaves: Sheaves, place: Floats) -> Equilibrium:
    """Solve the equilibrium with locked wheels, and transfer rope until both tensions are equal."""
    pairs = sheaves.figures[[INTO, FROM]].T.astype(int)
    slope = np.array([-sum(_stiffness(system.ropes[r]) for r in pair) for pair in pairs])
    moved, before = np.zeros(len(pairs)), np.full(len(pairs), np.nan)
    settle = solve_joined_statics
    for _ in range(REEVING_ROUNDS):
        end = settle(system, place)
        settle = refine_joined_statics
        pulls = np.array([[_last_tension(system.ropes[r]) for r in pair] for pair in pairs])
        difference = pulls[:, 0] - pulls[:, 1]
        if not end.found or (np.abs(difference) <= ALIKE * pulls.max(axis=1)).all():
            break
        secant = (difference - before) / np.where(moved == 0.0, np.nan, moved)
        slope = np.where(secant < 0.0, secant, slope)
        moved, before = -difference / slope, difference
        for pair, more in zip(pairs, moved, strict=True):
            for r, sign in zip(pair, (1.0, -1.0), strict=True):
                sheaves.base[r] = _lay_again(system.ropes[r], sign * float(more))
    return end


def _stiffness(rope: Rope) -> float:
    """Return the axial stiffness of the whole rope [N/m]."""
    return float(rope.sections[EA, 0] / rope.state.s[rope.state.counts[ELEMENTS]])


def _last_tension(rope: Rope) -> float:
    """Return the tension of the element at the sheave [N]."""
    return float(rope.work[TENSION, rope.state.counts[ELEMENTS] - 1])


def _lay_again(rope: Rope, more: float) -> float:
    """Change a rope's length by `more` [m] at its last node, in the same shape; return the length.

    At least two elements remain, and at most as many as its arrays have capacity for.
    """
    state, size = rope.state, rope.model.element_length
    n = int(state.counts[ELEMENTS])
    s, x = state.s[: n + 1].copy(), state.nodes[POSITION : POSITION + 3, : n + 1].copy()
    max_nodes = len(state.s) - TRIALS - 2
    max_length = float(s[n]) + (max_nodes - n) * size
    length = min(max(float(s[n]) + more, 2.0 * SHORTEST * size), max_length)
    inner = [float(coordinate) for coordinate in s[:-1] if coordinate <= length - SHORTEST * size]
    while length - inner[-1] > LONGEST * size:
        inner.append(inner[-1] + size)
    if len(inner) < 2:
        inner = [0.0, 0.5 * length]
    new = np.array([*inner, length])
    count = len(new)
    state.s[:count], state.counts[ELEMENTS] = new, count - 1
    for row, old in zip(state.nodes[POSITION : POSITION + 3], x, strict=True):
        row[:count] = np.interp(new * (s[n] / length), s, old)
    return length
