"""Plausibility checks of a rigid body: its size relative to the payload's shape, and its slings."""

from __future__ import annotations

from collections.abc import Iterator
from math import asin, degrees, hypot, sqrt

from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.errors import phrase
from rope_twin.scene.figures import LiftFigures
from rope_twin.scene.rules.body import body_of
from rope_twin.scene.schema import Scene
from rope_twin.scene.shapes.outline import Box

ANOTHER_SIZE = 0.2  # relative difference of a length of shape and outline that is accepted
FLATTEST_DEG = 60.0  # of a sling from the vertical: its tension is then twice its share
LONGEST_STRETCH = 0.1  # of a sling's length


def check_body(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check the outline, and slings that are too flat or too soft."""
    body = body_of(scene)
    if body is None:
        return
    yield from _size(scene, body)
    told: dict[str, list[str]] = {}
    for number, sling in enumerate(body.slings):
        for warning in _sling(body, sling, figures.payload_weight_n):
            told.setdefault(warning, []).append(str(number))
    for warning, numbers in told.items():
        yield f"effects.rigid_body.slings[{', '.join(numbers)}]{warning}"


def _size(scene: Scene, body: RigidBodyParams) -> Iterator[str]:
    shape = scene.payloads[0].shape
    if not isinstance(shape, Box):
        return
    box = (shape.length_m, shape.width_m, shape.height_m)
    if any(abs(a - b) > ANOTHER_SIZE * max(a, b) for a, b in zip(box, body.size_m, strict=True)):
        sides = [" × ".join(f"{side:g}" for side in one) for one in (body.size_m, box)]
        what = f"{sides[0]} m, and the payload's shape is a box of {sides[1]} m"
        right = "give one size: inertia and contact use the first, drag and added mass this one"
        yield phrase("effects.rigid_body.size_m", what, right)


def _sling(body: RigidBodyParams, sling: Sling, weight_n: float) -> Iterator[str]:
    """Check one sling, with the hook above the middle of the attachment points."""
    middle = [sum(one.to_m[axis] for one in body.slings) / len(body.slings) for axis in (0, 1)]
    aside = hypot(sling.to_m[0] - middle[0], sling.to_m[1] - middle[1])
    length = sling.length_m
    if aside >= length:
        what = f"{length:g} m does not reach the hook at a lateral offset of {aside:.2f} m"
        yield phrase(".length_m", what, f"give more than {aside:.2f} m")
        return
    angle = degrees(asin(aside / length))
    if angle > FLATTEST_DEG:
        what = (
            f"{length:g} m is {angle:.0f}° from the vertical: more than twice its share of the load"
        )
        yield phrase(".length_m", what, f"give {aside / sqrt(0.75):.1f} m or more")
    pull = max(weight_n, 0.0) / len(body.slings) * length / sqrt(length**2 - aside**2)
    stretch = pull / sling.stiffness_n_per_m
    if stretch > LONGEST_STRETCH * length:
        what = f"its share of the load, {pull / 1e3:.0f} kN, stretches it by {stretch:.2g} m"
        yield phrase(".stiffness_n_per_m", what, "give EA over length in N/m, not kN/m")
