"""Coarse-to-fine static solution: equilibrium of a multi-line system on few elements first.

What makes the problem hard, arbitrary initial shapes, does not depend on the number of elements;
the cost of a step does.
"""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

from rope_twin.core.joined.hanging import Link, guess_positions, initial_shape
from rope_twin.core.joined.joints import LOOSE, System, new_system, with_flows
from rope_twin.core.joined.ties import ANCHORED, FIRST, LEAST, LENGTH, SECOND
from rope_twin.core.payout import TRIALS
from rope_twin.core.state import ELEMENTS, END, POSITION, Floats, Rope, new_state

SPARE_NODES = 4
DROPS = 25  # enough for an initial guess


def coarsen(system: System, most: int) -> System:
    """Return the system with at most `most` elements per rope, at a subset of its nodes."""
    joints, sheaves = system.joints, system.sheaves
    ropes = tuple(_coarser_rope(rope, most) for rope in system.ropes)
    found = new_system(ropes, list(joints.lower), list(joints.upper), joints.ties.copy())
    if sheaves is not None:
        flows = with_flows(found.joints, sheaves.figures.shape[1])
        found = found._replace(joints=flows, sheaves=sheaves)
    found.joints.nodes[POSITION : POSITION + 3] = joints.nodes[POSITION : POSITION + 3]
    return found


def _coarser_rope(rope: Rope, most: int) -> Rope:
    """Return a rope on evenly spaced ones of its nodes; nodes at section ends are kept."""
    n = int(rope.state.counts[ELEMENTS])
    s = rope.state.s[: n + 1]
    ends = [int(np.abs(s - end).argmin()) for end in rope.sections[END] if end < s[-1]]
    kept = np.union1d(np.round(np.linspace(0, n, min(n, most) + 1)).astype(int), ends).astype(int)
    state = new_state(len(kept) + SPARE_NODES + TRIALS)
    state.s[: len(kept)] = s[kept]
    places = rope.state.nodes[POSITION : POSITION + 3]
    state.nodes[POSITION : POSITION + 3, : len(kept)] = places[:, kept]
    state.counts[ELEMENTS] = len(kept) - 1
    return rope._replace(state=state)


def interpolate_from(fine: System, coarse: System) -> None:
    """Interpolate nodes and connections of the fine system linearly from the coarse one."""
    for one, other in zip(fine.ropes, coarse.ropes, strict=True):
        n, few = (int(rope.state.counts[ELEMENTS]) + 1 for rope in (one, other))
        for k in range(POSITION, POSITION + 3):
            one.state.nodes[k, :n] = np.interp(
                one.state.s[:n], other.state.s[:few], other.state.nodes[k, :few]
            )
    fine.joints.nodes[POSITION : POSITION + 3] = coarse.joints.nodes[POSITION : POSITION + 3]


def set_initial_guess(system: System) -> None:
    """Replace the ropes' shapes by the initial guess that follows from their lengths."""
    joints, ropes = system.joints, system.ropes
    known: dict[Hashable, Floats] = {}
    links: list[Link] = []
    for r, rope in enumerate(ropes):
        n, x = int(rope.state.counts[ELEMENTS]), rope.state.nodes[POSITION : POSITION + 3]
        upper, lower = _ends(system, r)
        if joints.upper[r] == LOOSE:
            known[upper] = x[:, n]
        if joints.lower[r] == LOOSE and rope.model.first_free == 1:
            known[lower] = x[:, 0]
        links.append((upper, lower, float(rope.state.s[n] - rope.state.s[0])))
    bars: list[Link] = [
        (int(tie[FIRST]), int(tie[SECOND]), float(tie[LENGTH]))
        for tie in joints.ties.T
        if tie[SECOND] != ANCHORED and tie[LEAST] == -np.inf
    ]
    points = dict.fromkeys(name for link in links for name in link[:2])
    free = [name for name in points if name not in known]
    found = guess_positions(known, free, links, bars, DROPS)
    for r, rope in enumerate(ropes):
        n = int(rope.state.counts[ELEMENTS])
        upper, lower = _ends(system, r)
        s = rope.state.s[: n + 1] - rope.state.s[0]
        rope.state.nodes[POSITION : POSITION + 3, : n + 1] = initial_shape(
            found[lower], found[upper], s, up=False
        )
    for j in {*joints.lower, *joints.upper} - {LOOSE}:
        joints.nodes[POSITION : POSITION + 3, j] = found[int(j)]


def _ends(system: System, r: int) -> tuple[Hashable, Hashable]:
    """Return keys of the upper and lower end of rope r: the connection's number, if any."""
    upper, lower = int(system.joints.upper[r]), int(system.joints.lower[r])
    return (
        ("top", r) if upper == LOOSE else upper,
        ("foot", r) if lower == LOOSE else lower,
    )
