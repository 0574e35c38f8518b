"""Where joints and payloads hang, about: a first guess from which statics finds the rest.

Points under gravity, ropes that are no longer than they are, bars that are as long as they are:
position-based dynamics (Müller et al. 2007, J. Vis. Commun. Image R. 18, 109), in which a few
rounds of moving points until each length is right take the place of forces.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.scene.rigging_rules import meeting_points, places
from rope_twin.scene.schema import Scene

ROUNDS, DROPS = 12, 150
FALL = 0.05  # of the longest rope: how far points fall in a round at first
SPREAD = 0.05  # of a rope: how far aside points begin, so that a bar knows where to point
GOLDEN = 2.399963  # an angle that spreads points evenly
LITTLE = 1e-9
TAUT, NARROW = 1e-6, 1e-2  # of a rope's length: less slack, and least span of a slack one


def first_places(scene: Scene) -> dict[str, Floats]:
    """Hang-offs, payloads and joints by name, (3,) each [m]."""
    known = {name: np.array(place, dtype=float) for name, place in places(scene).items()}
    found = _hung(scene, known)
    names = meeting_points(scene)
    aside = {
        name: np.array([cos(GOLDEN * k), 0.3 * sin(GOLDEN * k), 0.0])
        for k, name in enumerate(names)
    }
    shortest = min(line.length_m for line in scene.ropes)
    for name in names:
        found[name] = found[name] + SPREAD * shortest * aside[name]
    fall = FALL * max(line.length_m for line in scene.ropes)
    for drop in range(DROPS):
        for name in names:
            found[name][2] -= fall * (1.0 - drop / DROPS)
        for _ in range(ROUNDS):
            _keep_lengths(scene, found, known)
    return found


def _hung(scene: Scene, known: dict[str, Floats]) -> dict[str, Floats]:
    """Each point straight below the first rope that leads there."""
    found = {name: place.copy() for name, place in known.items()}
    waiting = True
    while waiting:
        waiting = False
        for line in scene.ropes:
            if line.to and line.from_ in found and line.to not in found:
                found[line.to] = found[line.from_] - [0.0, 0.0, line.length_m]
                waiting = True
        for strut in scene.struts:
            one, other = strut.between
            if (one in found) != (other in found):
                there, missing = (one, other) if one in found else (other, one)
                found[missing] = found[there] + [strut.length_m, 0.0, 0.0]
                waiting = True
    return found


def _keep_lengths(scene: Scene, found: dict[str, Floats], known: dict[str, Floats]) -> None:
    """Pull together what a rope holds, and push or pull what a bar keeps apart."""
    for line in scene.ropes:
        foot = np.array(line.fixed_at_m) if line.fixed_at_m else found[line.to]
        held = (line.from_ in known, line.fixed_at_m is not None)
        _move(found[line.from_], foot, line.length_m, held, only_shorter=True)
    for strut in scene.struts:
        one, other = (found[name] for name in strut.between)
        _move(one, other, strut.length_m, (False, False), only_shorter=False)


def _move(
    one: Floats, other: Floats, length: float, held: tuple[bool, bool], *, only_shorter: bool
) -> None:
    """Move two points along their line until they are so far apart."""
    between = other - one
    distance = float(np.sqrt(between @ between)) + LITTLE
    if all(held) or (only_shorter and distance <= length):
        return
    change = between * ((distance - length) / distance)
    share = 0.5 if not any(held) else 1.0
    if not held[0]:
        one += share * change
    if not held[1]:
        other -= share * change


def laid(low: Floats, high: Floats, s: Floats, up: bool) -> Floats:
    """Nodes of a rope between two places [m], (3, nodes): straight, or a catenary if it is longer.

    s: unstretched distance of the nodes from the lower end [m], (nodes,); up: the rope floats. The
    catenary of a rope that does not stretch (Irvine 1981, section 1.2): with the span h, the rise v
    and the length L, sinh(b)/b = √(L² - v²)/h and its lowest point where the two arms say.
    """
    length, chord = float(s[-1]), high - low
    share = s / length
    straight: Floats = low[:, None] + chord[:, None] * share
    if float(np.sqrt(chord @ chord)) >= (1.0 - TAUT) * length:
        return straight
    span = max(float(np.hypot(chord[0], chord[1])), NARROW * length)
    aside = np.array([chord[0], chord[1], 0.0])
    size = float(np.sqrt(aside @ aside))
    aside = aside / size if size > LITTLE else np.array([1.0, 0.0, 0.0])
    rise = -float(chord[2]) if up else float(chord[2])
    ratio = float(np.sqrt(length**2 - rise**2)) / span
    if ratio <= 1.0 + TAUT:  # all but vertical and all but taut
        return straight
    b = _half_parameter(ratio)
    a = 0.5 * span / b
    # arc length from the lowest point to the lower end, by the two heights
    middle = 0.5 * (length - rise / np.tanh(b))
    arc = s - middle
    along = a * (np.arcsinh(arc / a) - np.arcsinh(-middle / a))
    height = np.hypot(a, arc) - np.hypot(a, middle)
    along *= size / along[-1]  # a vertical loop has been given a little span
    nodes: Floats = low[:, None] + aside[:, None] * along
    nodes[2] += -height if up else height
    return nodes


def _half_parameter(ratio: float) -> float:
    """b of sinh(b)/b = ratio > 1, by Newton on its logarithm."""
    b = float(np.sqrt(6.0 * (ratio - 1.0))) if ratio < 3.0 else float(np.log(2.0 * ratio) + 1.0)
    for _ in range(30):
        value = np.log(np.sinh(b) / b) - np.log(ratio)
        b -= float(value / (1.0 / np.tanh(b) - 1.0 / b))
    return b
