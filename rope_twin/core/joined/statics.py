"""Static equilibrium of a multi-line system, from any initial guess, with every effect.

Dynamic relaxation with growing steps and the velocity reset to zero after each: a step of h is a
Newton solve of the convex energy with the mass over h² as a regulariser. Slack elements are no
harder for it than taut ones, and at the longest steps the mass is negligible, so that the last
steps are Newton steps of the static problem (except for the derivative of the loads to the shape,
which the step leaves out). They end at time 0: before it the sea is flat.

It is solved on few elements first (core/joined/levels.py); a hard initial guess is replaced by one
derived from the ropes' lengths. Where there is no progress the ropes fall freely for a while.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.body.state import RigidBody
from rope_twin.core.body.step import start
from rope_twin.core.joined.joints import LOOSE, System
from rope_twin.core.joined.levels import coarsen, interpolate_from, set_initial_guess
from rope_twin.core.loads.memory import forget_memories
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
)
from rope_twin.core.statics.equilibrium import FORCE_TOL_N, MAX_RATIO, ROUND_OFF, TENSION_TOL
from rope_twin.core.statics.shape import INSTANT, SYMMETRIC, Equilibrium, largest
from rope_twin.core.step import advance_joined

ROUNDS, STEP_FIRST, STEP_LAST, STEP_LEAST, GROWTH, SHRINK = 40, 1.0, 3e3, 1e-4, 4.0, 0.1
ATTEMPTS, FALL_STEPS, FALL_STEP = 8, 300, 0.05
STEP_NEAR = 64.0  # first step where ropes are near equilibrium
LEVELS = (6, 30)  # maximum elements per rope of the coarse levels
HARD_SOLVES = 600  # solves on a coarse level that mark a hard initial guess
EASY_SUBSTEPS = 4  # substeps of a step that is short enough


def solve_joined_statics(system: System, place: Floats) -> Equilibrium:
    """Solve the static equilibrium of ropes and connections.

    place: (ropes, MOTIONS), each rope's hang-off and paid-out length [m]; rows of ropes whose upper
    end is connected are not read. Without equilibrium the nodes end at the best shape found.
    Afterwards the solver's counters start from zero and length corrections are removed.
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
    """Leave tension, stiffness and nodal masses of the static state in the ropes' scratch.

    place: as for `solve_joined_statics`. The blocks of nodes are mass alone, including added mass.
    """
    boundary = _boundary(system, place)
    _residual(system, boundary, np.zeros((len(system.ropes), 1, PULL_COLUMNS)))


def _settle_coarsely(system: System, place: Floats) -> None:
    """Solve on a coarse mesh and then on a finer one (coarse-to-fine).

    An initial guess that is hard on the coarse mesh is replaced.
    """
    first = STEP_FIRST
    for most in LEVELS:
        few = coarsen(system, most)
        boundary = _boundary(few, place)
        pull = np.zeros((len(few.ropes), 1, PULL_COLUMNS))
        end, _ = _take_long_steps(few, boundary, pull, first, most_solves=HARD_SOLVES)
        if not end.found:
            set_initial_guess(few)
            _stop(few)
            _relax(few, boundary, first)
        interpolate_from(system, few)
        _stop(system)
        first = STEP_NEAR
    _boundary(system, place)


def _boundary(system: System, place: Floats) -> Boundary:
    """Return hang-offs fixed for one step, and place the ropes' upper nodes there."""
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
    """Reset velocities, counters and internal variables; a body rests below its hook again."""
    for table in _tables(system):
        table[VELOCITY:NODE_ROWS] = 0.0
    for rope in system.ropes:
        rope.state.health[:] = 0
        forget_memories(rope.effects)
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

    One step of a femtosecond moves nothing, and yields the acceleration a = A⁻¹·F of every node.
    """
    places = _places(system)
    _stop(system)
    still = _stopped(system, INSTANT, np.inf)
    finite = advance_joined(still, boundary, pull, 0.0, 1) == 1
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
    most = 0.0
    for r, rope in enumerate(system.ropes):
        rest = np.diff(rope.state.s[: _count(system, r)])
        reach = np.abs(rope.state.nodes[POSITION : POSITION + 3, : len(rest) + 1]).max()
        stiffness = float(rope.sections[EA].max() / rest.min())
        most = max(most, ROUND_OFF * stiffness * float(reach + rest.sum()))
    return most


def _relax(system: System, boundary: Boundary, first: float) -> Equilibrium:
    """Take long steps; without progress let the ropes fall for a while and try again."""
    pull = np.zeros((len(system.ropes), 1, PULL_COLUMNS))
    for _ in range(ATTEMPTS):
        end, nearest = _take_long_steps(system, boundary, pull, first)
        if nearest:
            break
        if not end.found:
            _fall(system, boundary, pull)
    return end


def _fall(system: System, boundary: Boundary, pull: Floats) -> None:
    """Take dynamic steps and reset velocities whenever kinetic energy falls (Cundall 1976).

    Slack ropes far from equilibrium get close to it by their weight.
    """
    tolerance = max(system.ropes[0].model.tolerance, _round_off(system))
    falling, energy = _stopped(system, FALL_STEP, tolerance), 0.0
    _stop(system)
    for _ in range(FALL_STEPS):
        if advance_joined(falling, boundary, pull, -FALL_STEP, 1) < 1:
            _stop(system)
            continue
        now = sum(float((t[VELOCITY:ACCELERATION] ** 2).sum()) for t in _tables(system))
        if now < energy:
            _stop(system)
        energy = now if now >= energy else 0.0


def _take_long_steps(
    system: System, boundary: Boundary, pull: Floats, first: float, most_solves: float = np.inf
) -> tuple[Equilibrium, bool]:
    """Return the state of the static solution, and whether it ended for lack of progress.

    most_solves: the iteration ends if this many solves were not enough to reach the longest steps.
    """
    tolerance = max(FORCE_TOL_N, _round_off(system))
    health, step, solves = system.ropes[0].state.health, first, 0
    last, before = np.inf, _places(system)
    for rounds in range(ROUNDS):
        before = _places(system)
        _stop(system)
        done = advance_joined(_stopped(system, step, tolerance), boundary, pull, -step, 1)
        solves += int(health[SOLVES])
        if step < STEP_LAST and solves > most_solves:
            break
        if done < 1 or health[SUBSTEPS_UNCONVERGED] > 0:
            _put(system, before)
            step *= SHRINK
            if step < STEP_LEAST:
                break
            continue
        substeps = int(health[SUBSTEPS])
        if step >= STEP_LAST:  # before, a move is no error estimate
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
    found = residual <= max(tolerance, TENSION_TOL * tension)
    return Equilibrium(found, residual, tension, np.inf, 0)
