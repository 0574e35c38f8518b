"""Ropes of two sections, from the ropes of the payout study."""

from __future__ import annotations

from dataclasses import replace

from rigs import Rig

from rope_twin.scene.schema import RopeSection, Scene


def joined(low: Rig, high: Rig, low_length: float) -> Scene:
    """Return the scene of `low` whose rope goes on as that of `high` after `low_length` metres."""
    scene = low.scene()
    line = replace(
        scene.ropes[0],
        rope=None,
        sections=(
            RopeSection(rope=low.scene().ropes[0].rope, length_m=low_length),
            RopeSection(rope=high.scene().ropes[0].rope),
        ),
    )
    return replace(scene, ropes=(line,))


def hanging(low: Rig, high: Rig, low_length: float, line_out: float) -> tuple[float, float]:
    """Return top tension [N] and payload depth [m] of two sections with own weight and EA."""
    first = min(low_length, line_out)
    rest = line_out - first
    middle = low.load_weight + low.weight * first
    top = middle + high.weight * rest
    stretch = 0.5 * (low.load_weight + middle) * first / low.EA
    stretch += 0.5 * (middle + top) * rest / high.EA
    return top, line_out + stretch
