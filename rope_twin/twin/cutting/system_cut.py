"""Cut of a rope in a multi-line system: the system of the parts, and its first step.

The lower part is an additional rope. Its upper end is a connection with no other rope, so that it
moves freely; the connection or payload at the rope's lower end is now at that of the lower part.
The upper part keeps its upper end and has nothing at its lower end. All are advanced in one step,
whether the part below the cut is still held by other ropes or falls freely.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import LOOSE, System, new_system
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.core.step import advance_joined
from rope_twin.errors import SolverError, phrase
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.twin.cutting.parted import SUBSTEPS, boundary_at
from rope_twin.twin.cutting.rope_cut import (
    INSTANT_S,
    CutPosition,
    Nodes,
    falling_part,
    inserted_nodes,
    nodes_of,
    upper_part,
    without_load,
)
from rope_twin.twin.internal_variables import state_arrays

_A = slice(rows.ACCELERATION, rows.ACCELERATION + 3)


class CutSystem(NamedTuple):
    """Multi-line system with one rope cut in two; the lower part is the last rope."""

    system: System
    lost_m: float  # unstretched length of the lower part


def cut_system(system: System, border: Boundary, place: CutPosition) -> CutSystem:
    """Cut a rope of a system without sheaves; the argument is unchanged.

    border: of all ropes, (ropes, 1, MOTIONS).

    Raises:
        SolverError: the forces at a new end are not finite.
    """
    r, joints = place.rope, system.joints
    whole = system.ropes[r]
    at_ship = bool(joints.upper[r] == LOOSE)
    nodes, k = nodes_of(
        whole, float(border.rate[r, 0, rows.LINE]) if at_ship else 0.0
    ).with_node_at(place.at_m)
    lost = float(nodes.s[k])
    for above in inserted_nodes(nodes.s[k:] - lost, place.least_m) if at_ship else ():
        nodes, _ = nodes.with_node_at(lost + above)
    nodes, k = _of_two_elements(nodes, k)
    nodes.motion[:, -1] = whole.state.nodes[:, int(whole.state.counts[rows.ELEMENTS])]
    upper = upper_part(whole, nodes, k, without_load(whole.effects), loaded=not at_ship)
    lower = falling_part(whole, nodes, k)
    ropes = [*system.ropes, lower]
    ropes[r] = upper
    below = [*joints.lower.tolist(), int(joints.lower[r])]
    below[r] = LOOSE
    tolerance = min(system.ropes[0].model.tolerance, upper.model.tolerance, lower.model.tolerance)
    ropes[0] = ropes[0]._replace(model=ropes[0].model._replace(tolerance=tolerance))
    above_it = [*joints.upper.tolist(), joints.nodes.shape[1]]
    parts = new_system(tuple(ropes), below, above_it, joints.ties)
    for own, before in zip(parts.ropes, ropes, strict=True):
        n = int(before.state.counts[rows.ELEMENTS])
        own.work[rows.TENSION, :n] = before.work[rows.TENSION, :n]
    _find_accelerations(parts, (r, len(ropes) - 1), _with_one_more(border), place.time)
    return CutSystem(parts, lost)


def scene_of_parts(scene: Scene, number: int, lost_m: float) -> Scene:
    """Return the scene after the cut: the rope ends nowhere, the last rope comes from nowhere."""
    line = scene.ropes[number]
    upper = replace(line, to="", fixed_at_m=None)
    lower: RopeLine = replace(line, name=f"{line.name}/lower", from_="", length_m=lost_m)
    lines = [*scene.ropes, lower]
    lines[number] = upper
    return replace(scene, ropes=tuple(lines))


def advance_in_substeps(system: System, boundary: Boundary, time: float) -> Floats | None:
    """Advance the first step after a cut in doubling substeps (see `parted`).

    boundary: (ropes, 2, MOTIONS). Returns the forces on the upper ends after it [N], (ropes, 1,
    PULL_COLUMNS), or None if it failed and all is unchanged.
    """
    pull = np.zeros((len(system.ropes), 1, rows.PULL_COLUMNS))
    kept = copy.deepcopy(([rope.state for rope in system.ropes], system.joints))
    memories = [array for rope in system.ropes for array in state_arrays(rope.effects)]
    remembered = [array.copy() for array in memories]
    h = system.ropes[0].model.step
    each = [boundary_at(Boundary(*own), SUBSTEPS, h) for own in zip(*boundary, strict=True)]
    value, rate = (np.array(tables) for tables in zip(*each, strict=True))
    for k, (begin, end) in enumerate(pairwise(SUBSTEPS)):
        some = Boundary(value[:, k : k + 2].copy(), rate[:, k : k + 2].copy())
        piece = _with_step(system, (end - begin) * h)
        if advance_joined(piece, some, pull, time + begin * h, 1) < 1:
            for rope, state in zip(system.ropes, kept[0], strict=True):
                for mine, other in zip(rope.state, state, strict=True):
                    mine[...] = other
            for mine, other in zip(system.joints[2:4], kept[1][2:4], strict=True):
                mine[...] = other
            for mine, other in zip(memories, remembered, strict=True):
                mine[...] = other
            return None
    system.ropes[0].state.health[rows.STEPS] -= len(SUBSTEPS) - 2
    return pull


def _with_step(system: System, step: float) -> System:
    return system._replace(
        ropes=tuple(rope._replace(model=rope.model._replace(step=step)) for rope in system.ropes)
    )


def _of_two_elements(nodes: Nodes, k: int) -> tuple[Nodes, int]:
    """Divide parts of one element in two, as a rope between connections needs two elements."""
    if k == 1:
        nodes, _ = nodes.with_node_at(0.5 * float(nodes.s[1]))
        k = 2
    if k == len(nodes.s) - 2:
        nodes, _ = nodes.with_node_at(0.5 * float(nodes.s[k] + nodes.s[k + 1]))
    return nodes, k


def _with_one_more(border: Boundary) -> Boundary:
    """Return a boundary with a row for the lower part, which is not used."""
    return Boundary(*(np.concatenate([table, table[-1:]]) for table in border))


def _find_accelerations(
    system: System, parts: tuple[int, int], border: Boundary, time: float
) -> None:
    """Set the accelerations of the parts' nodes from their forces; all else is unchanged."""
    value, rate = border
    both = Boundary(
        np.concatenate([value, value + INSTANT_S * rate], axis=1),
        np.concatenate([rate, rate], axis=1),
    )
    pull = np.zeros((len(system.ropes), 1, rows.PULL_COLUMNS))
    still = [
        rope._replace(model=rope.model._replace(split_above=np.inf, merge_below=0.0))
        for rope in system.ropes
    ]
    for _ in range(2):
        trial = copy.deepcopy(_with_step(system._replace(ropes=tuple(still)), INSTANT_S))
        if advance_joined(trial, both, pull, time, 1) < 1:
            what = "the forces at its new end are not finite"
            raise SolverError(phrase("the rope's cut", what, "check the scene"))
        for r in parts:
            _take_accelerations(system.ropes[r], trial.ropes[r], held=r == parts[0])
        system.joints.nodes[_A, -1] = trial.joints.nodes[_A, -1]


def _take_accelerations(rope: Rope, trial: Rope, *, held: bool) -> None:
    """Copy accelerations from a trial step; held: except that of the upper end."""
    n = int(rope.state.counts[rows.ELEMENTS]) + (0 if held else 1)
    rope.state.nodes[_A, :n] = trial.state.nodes[_A, :n]
