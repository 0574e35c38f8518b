"""Initial guess of the positions of connections and payloads (core/joined/hanging.py)."""

from __future__ import annotations

from rope_twin.core.joined.hanging import Link, guess_positions
from rope_twin.core.state import Floats
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import meeting_points, places


def first_places(scene: Scene) -> dict[str, Floats]:
    """Return approximate positions of hang-offs, payloads and joints by name, (3,) each [m]."""
    feet = {
        f"foot of {line.name}, {number}": line.fixed_at_m
        for number, line in enumerate(scene.ropes)
        if line.fixed_at_m
    }
    ropes: list[Link] = [
        (line.from_, line.to or f"foot of {line.name}, {number}", line.length_m)
        for number, line in enumerate(scene.ropes)
    ]
    bars: list[Link] = [(*strut.between, strut.length_m) for strut in scene.struts]
    found = guess_positions({**places(scene), **feet}, meeting_points(scene), ropes, bars)
    return {str(name): place for name, place in found.items()}
