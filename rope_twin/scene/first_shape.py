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


def laid(low: Floats, high: Floats, s: Floats) -> Floats:
    """Nodes of a rope between two places [m], (3, nodes): straight, or sagging if it is longer.

    s: unstretched distance of the nodes from the lower end [m], (nodes,).
    """
    length, chord = float(s[-1]), high - low
    distance = float(np.sqrt(chord @ chord))
    share = s / length
    straight: Floats = low[:, None] + chord[:, None] * share
    if distance >= length:
        return straight
    along = chord / (distance + LITTLE)
    down = np.array([0.0, 0.0, -1.0]) + along * along[2]
    size = float(np.sqrt(down @ down))
    down = down / size if size > 1e-3 else np.array([1.0, 0.0, 0.0])
    depth = float(np.sqrt(0.25 * (length**2 - distance**2)))
    return straight + down[:, None] * (depth * (1.0 - np.abs(2.0 * share - 1.0)))
