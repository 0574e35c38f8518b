"""Lines of a multi-line system for VIV: ropes that continue each other count as one.

Two ropes are one line where the lower end of one and the upper end of the other meet at a bare
connection: no third rope, bar, sheave or payload, and no mass. Any other connection is held across
the line: that of several ropes, and that of a hook or payload, whose mass is many times that of
half a wave length of rope at the frequencies of vortices. A payload at the lower end of one rope
alone moves as below a single rope. With bending stiffness a connection is a hinge, and each rope is
a line.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import FIRST, LOOSE, SECOND, System
from rope_twin.core.joined.sheaves import POINT
from rope_twin.core.state import Floats, Rope, State
from rope_twin.effects.payload import Payload, TwoWayPayload
from rope_twin.vortex.sampling import bending_stiffness


def lines_of(system: System, count: int | None = None) -> list[tuple[int, ...]]:
    """Return the numbers of the ropes of each line, from its lower end up.

    count: number of the first ropes that are looked at; None: all. Lines are in the order of their
    uppermost ropes.
    """
    joints = system.joints
    ropes = range(len(joints.lower) if count is None else count)
    below: dict[int, int] = {}  # by rope, the one that continues it at its lower end
    for j in _bare(system):
        upper = [r for r in ropes if joints.lower[r] == j]
        lower = [r for r in ropes if joints.upper[r] == j]
        if len(upper) == len(lower) == 1 and not _loaded(system.ropes[upper[0]]):
            below[upper[0]] = lower[0]
    lines = []
    for top in ropes:
        if top in below.values():
            continue
        line = [top]
        while line[-1] in below:
            line.append(below[line[-1]])
        lines.append(tuple(reversed(line)))
    return lines


def _bare(system: System) -> list[int]:
    """Return the connections of two rope ends, without bar, sheave or hinge."""
    joints, sheaves = system.joints, system.sheaves
    if bending_stiffness(system.ropes[0].effects) > 0.0:
        return []
    held = {*joints.ties[FIRST].astype(int), *joints.ties[SECOND].astype(int)}
    if sheaves is not None:
        held |= {*sheaves.figures[POINT].astype(int)}
    ends = [*joints.lower, *joints.upper]
    return [j for j in set(ends) - held - {LOOSE} if ends.count(j) == 2]


def _loaded(rope: Rope) -> bool:
    """Return whether a payload or connection at the rope's lower end has mass."""
    loads = [own for own in rope.effects if isinstance(own, Payload | TwoWayPayload)]
    return any(own.Mx > 0.0 for own in loads)


def one_rope(ropes: Sequence[Rope]) -> Rope:
    """Return the ropes of a line, given from its lower end up, as one rope.

    The arrays are copies, but for those of a single rope; effects are those of the lowest.
    """
    if len(ropes) == 1:
        return ropes[0]
    last, lowest = len(ropes) - 1, ropes[0]
    nodes, works, s, offset, sections = [], [], [], [], []
    below_m = 0.0
    for k, rope in enumerate(ropes):
        n = int(rope.state.counts[rows.ELEMENTS])
        own = slice(n + 1 if k == last else n)  # a connection is the first node of the upper rope
        nodes.append(rope.state.nodes[:, own])
        works.append(rope.work[:, own])
        s.append(below_m + rope.state.s[own])
        offset.append(rope.state.offset[own])
        length_m = float(rope.state.s[n])
        sections.append(_sections(rope, below_m, np.inf if k == last else length_m))
        below_m += length_m
    counts = lowest.state.counts.copy()
    counts[rows.ELEMENTS] = sum(int(rope.state.counts[rows.ELEMENTS]) for rope in ropes)
    state = State(
        np.concatenate(nodes, axis=1),
        np.concatenate(s),
        np.concatenate(offset),
        counts,
        lowest.state.health,
    )
    work, made = np.concatenate(works, axis=1), np.concatenate(sections, axis=1)
    return lowest._replace(state=state, work=work, sections=made)


def _sections(rope: Rope, below_m: float, length_m: float) -> Floats:
    """Return the sections of a rope that begins at a coordinate, up to its length [m]."""
    ends = rope.sections[rows.END]
    begins = np.concatenate([[0.0], ends[:-1]])
    own: Floats = rope.sections[:, begins < length_m].copy()
    own[rows.END] = below_m + np.minimum(own[rows.END], length_m)
    return own
