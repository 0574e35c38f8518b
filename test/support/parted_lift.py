"""A lift, and the same lift with its rope in two parts joined by a massless ring."""

from __future__ import annotations

from dataclasses import replace

from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Damping, Joint, Scene


def whole_and_parted() -> tuple[Scene, Scene]:
    """Return a lift, and the same with a massless ring in the middle of its rope."""
    scene = load_scene("shallow_lift")
    line = replace(scene.ropes[0], damping=Damping(newton_seconds=1e6))
    time = replace(scene.time, newton_tolerance_n=2.0)
    whole = replace(scene, ropes=(line,), time=time)
    half = replace(line, length_m=100.0, elements=20)
    upper = replace(half, name="upper", to="ring")
    lower = replace(half, name="lower", from_="ring")
    return whole, replace(whole, ropes=(upper, lower), joints=(Joint(name="ring"),))
