"""Initial guess of the static shape of a multi-line system, and its coarsening.

**Guess**: straight ropes or catenaries between points from position-based dynamics (Müller et al.
2007, J. Vis. Commun. Image R. 18, 109): points fall by gravity and are projected iteratively onto
the constraints of rope length (inequality) and bar length (equality).

**Coarse to fine**: equilibrium on few elements first. The number of iterations depends on the
initial shape and not on the number of elements, but the cost of a step does.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from math import cos, sin, sqrt
from typing import Any

import numpy as np

from rope_twin.core.joined.joints import (
    ANCHORED,
    FIRST,
    LEAST,
    LENGTH,
    LOOSE,
    SECOND,
    System,
    new_system,
    with_flows,
)
from rope_twin.core.payout import TRIALS
from rope_twin.core.state import ELEMENTS, END, POSITION, Floats, Rope, new_state

ROUNDS, DROPS = 12, 150
FALL = 0.05  # of the longest rope: fall of a point in the first round
SPREAD = 0.05  # of a rope: initial lateral offset of points, so that bars have a direction
GOLDEN = 2.399963  # golden angle, spreads points evenly
LITTLE = 1e-9
TAUT, NARROW = 1e-6, 1e-2  # of a rope's length: largest slack of a taut one, least span

Point = list[float]
Link = tuple[Hashable, Hashable, float]  # a rope's upper and lower end or a bar's ends; length [m]


def guess_positions(
    known: Mapping[Any, Any],
    free: Sequence[Hashable],
    ropes: Sequence[Link],
    bars: Sequence[Link],
    drops: int = DROPS,
) -> dict[Hashable, Floats]:
    """Return the approximate positions of the ends of ropes and bars, (3,) each [m].

    known: fixed points with their positions; free: all others, spread in this order. Every rope
    must be connected to a fixed point, directly or through other ropes.
    """
    positions: dict[Hashable, Point] = {name: [float(x) for x in at] for name, at in known.items()}
    _hang_straight(positions, ropes, bars)
    spread = SPREAD * min(length for *_, length in ropes)
    for k, name in enumerate(free):
        positions[name][0] += spread * cos(GOLDEN * k)
        positions[name][1] += spread * 0.3 * sin(GOLDEN * k)
    fall = FALL * max(length for *_, length in ropes)
    fixed = set(known)
    for drop in range(drops):
        for name in free:
            positions[name][2] -= fall * (1.0 - drop / drops)
        for _ in range(ROUNDS):
            for link in ropes:
                _move(positions, fixed, link, only_shorter=True)
            for link in bars:
                _move(positions, fixed, link, only_shorter=False)
    return {name: np.array(position) for name, position in positions.items()}


def _hang_straight(
    positions: dict[Hashable, Point], ropes: Sequence[Link], bars: Sequence[Link]
) -> None:
    """Place each point vertically below its first rope, or beside its first bar.

    A sheave is the upper end of the ropes that meet at it; it is placed below their lower ends.
    """
    waiting = True
    while waiting:
        waiting = False
        for upper, lower, length in ropes:
            if upper in positions and lower not in positions:
                x, y, z = positions[upper]
                positions[lower] = [x, y, z - length]
                waiting = True
        for first, second, length in bars:
            if (first in positions) != (second in positions):
                placed, missing = (first, second) if first in positions else (second, first)
                x, y, z = positions[placed]
                positions[missing] = [x + length, y, z]
                waiting = True
        if not waiting:
            for upper, lower, length in ropes:
                if lower in positions and upper not in positions:
                    x, y, z = positions[lower]
                    positions[upper] = [x, y, z - length]
                    waiting = True
                    break


def _move(
    positions: dict[Hashable, Point], fixed: set[Hashable], link: Link, *, only_shorter: bool
) -> None:
    """Move two points along the line between them until their distance satisfies the link."""
    a, b, length = link
    first, second = positions[a], positions[b]
    x, y, z = second[0] - first[0], second[1] - first[1], second[2] - first[2]
    distance = sqrt(x * x + y * y + z * z) + LITTLE
    if (a in fixed and b in fixed) or (only_shorter and distance <= length):
        return
    fraction = (distance - length) / distance * (0.5 if a not in fixed and b not in fixed else 1.0)
    for point, names, sign in ((first, a, fraction), (second, b, -fraction)):
        if names not in fixed:
            point[0] += sign * x
            point[1] += sign * y
            point[2] += sign * z


def initial_shape(low: Floats, high: Floats, s: Floats, up: bool) -> Floats:
    """Return the nodes of a rope between two points [m], (3, nodes), straight or a catenary.

    s: unstretched distance of the nodes from the lower end [m], (nodes,); up: the rope floats. The
    inextensible catenary (Irvine 1981, section 1.2): with the span h, the rise v and the length L,
    sinh(b)/b = √(L² - v²)/h, and its lowest point follows from the two arms.
    """
    length, chord = float(s[-1]), high - low
    fraction = s / length
    straight: Floats = low[:, None] + chord[:, None] * fraction
    if float(np.sqrt(chord @ chord)) >= (1.0 - TAUT) * length:
        return straight
    span = max(float(np.hypot(chord[0], chord[1])), NARROW * length)
    horizontal = np.array([chord[0], chord[1], 0.0])
    size = float(np.sqrt(horizontal @ horizontal))
    horizontal = horizontal / size if size > LITTLE else np.array([1.0, 0.0, 0.0])
    rise = -float(chord[2]) if up else float(chord[2])
    ratio = float(np.sqrt(length**2 - rise**2)) / span
    if ratio <= 1.0 + TAUT:  # nearly vertical and nearly taut
        return straight
    b = _half_parameter(ratio)
    a = 0.5 * span / b
    # arc length from the lowest point to the lower end, by the two heights
    middle = 0.5 * (length - rise / np.tanh(b))
    arc = s - middle
    along = a * (np.arcsinh(arc / a) - np.arcsinh(-middle / a))
    height = np.hypot(a, arc) - np.hypot(a, middle)
    along *= size / along[-1]  # the span of a vertical loop was increased
    nodes: Floats = low[:, None] + horizontal[:, None] * along
    nodes[2] += -height if up else height
    return nodes


def _half_parameter(ratio: float) -> float:
    """Solve sinh(b)/b = ratio > 1 for b by Newton's method on the logarithm."""
    b = float(np.sqrt(6.0 * (ratio - 1.0))) if ratio < 3.0 else float(np.log(2.0 * ratio) + 1.0)
    for _ in range(30):
        value = np.log(np.sinh(b) / b) - np.log(ratio)
        b -= float(value / (1.0 / np.tanh(b) - 1.0 / b))
    return b


SPARE_NODES = 4
COARSE_DROPS = 25  # enough for an initial guess


def coarsen(system: System, max_elements: int) -> System:
    """Return the system with at most `max_elements` per rope, on a subset of its nodes."""
    joints, sheaves = system.joints, system.sheaves
    ropes = tuple(_coarser_rope(rope, max_elements) for rope in system.ropes)
    coarse = new_system(ropes, list(joints.lower), list(joints.upper), joints.ties.copy())
    if sheaves is not None:
        flows = with_flows(coarse.joints, sheaves.figures.shape[1])
        coarse = coarse._replace(joints=flows, sheaves=sheaves)
    coarse.joints.nodes[POSITION : POSITION + 3] = joints.nodes[POSITION : POSITION + 3]
    return coarse


def _coarser_rope(rope: Rope, max_elements: int) -> Rope:
    """Return a rope on an evenly spaced subset of its nodes, including those at section ends."""
    n = int(rope.state.counts[ELEMENTS])
    s = rope.state.s[: n + 1]
    ends = [int(np.abs(s - end).argmin()) for end in rope.sections[END] if end < s[-1]]
    kept_nodes = np.union1d(
        np.round(np.linspace(0, n, min(n, max_elements) + 1)).astype(int), ends
    ).astype(int)
    state = new_state(len(kept_nodes) + SPARE_NODES + TRIALS)
    state.s[: len(kept_nodes)] = s[kept_nodes]
    positions = rope.state.nodes[POSITION : POSITION + 3]
    state.nodes[POSITION : POSITION + 3, : len(kept_nodes)] = positions[:, kept_nodes]
    state.counts[ELEMENTS] = len(kept_nodes) - 1
    return rope._replace(state=state)


def interpolate_from(fine: System, coarse: System) -> None:
    """Interpolate nodes and connections of the fine system linearly from the coarse one."""
    for fine_rope, coarse_rope in zip(fine.ropes, coarse.ropes, strict=True):
        n, m = (int(rope.state.counts[ELEMENTS]) + 1 for rope in (fine_rope, coarse_rope))
        for k in range(POSITION, POSITION + 3):
            fine_rope.state.nodes[k, :n] = np.interp(
                fine_rope.state.s[:n], coarse_rope.state.s[:m], coarse_rope.state.nodes[k, :m]
            )
    fine.joints.nodes[POSITION : POSITION + 3] = coarse.joints.nodes[POSITION : POSITION + 3]


def set_initial_guess(system: System) -> None:
    """Replace the ropes' shapes by the initial guess for their lengths."""
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
    positions = guess_positions(known, free, links, bars, COARSE_DROPS)
    for r, rope in enumerate(ropes):
        n = int(rope.state.counts[ELEMENTS])
        upper, lower = _ends(system, r)
        s = rope.state.s[: n + 1] - rope.state.s[0]
        rope.state.nodes[POSITION : POSITION + 3, : n + 1] = initial_shape(
            positions[lower], positions[upper], s, up=False
        )
    for j in {*joints.lower, *joints.upper} - {LOOSE}:
        joints.nodes[POSITION : POSITION + 3, j] = positions[int(j)]


def _ends(system: System, r: int) -> tuple[Hashable, Hashable]:
    """Return keys of the upper and lower end of rope r: the connection's number, if any."""
    upper, lower = int(system.joints.upper[r]), int(system.joints.lower[r])
    return (
        ("top", r) if upper == LOOSE else upper,
        ("foot", r) if lower == LOOSE else lower,
    )
