"""VIV models with internal variables in multi-line systems: a rope in parts equals the whole."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from joint_rigs import JointBench, Vector, cut
from rigs import Rig

from rope_twin.core import state as rows
from rope_twin.core.step import advance
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.rope_model import build

ROPE = Rig(
    length=100.0, elements=40, mass=3.6, EA=1.5e6, diameter=0.05, damping=1e4, load=3e3,
    density=1025.0, drag=(1.2, 0.0), added_mass=1.0,
    current=((0.0, (0.0, 0.5)), (-200.0, (0.0, 0.3))), tolerance=1e-3,
)  # fmt: skip
STEPS = 400


def swayed(line_out: float) -> rows.Boundary:
    """Hang-off motion 0.05·sin³(2t) m across the current, from rest."""
    t = ROPE.step * np.arange(STEPS + 1)
    value, rate = np.zeros((2, STEPS + 1, rows.MOTIONS))
    value[:, 0] = 0.05 * np.sin(2.0 * t) ** 3
    rate[:, 0] = 0.3 * np.sin(2.0 * t) ** 2 * np.cos(2.0 * t)
    value[:, rows.LINE] = line_out
    return rows.Boundary(value, rate)


def whole(effects: tuple[Any, ...]) -> tuple[Vector, rows.Rope]:
    """Pulls of one rope with these further effects, and the rope after the last step."""
    scene = ROPE.scene()
    rope = build(replace(scene, effects=(*scene.effects, *effects)))
    n = ROPE.elements
    rope.state.nodes[:3, : n + 1] = 0.0
    rope.state.nodes[2, : n + 1] = rope.state.s[: n + 1] - ROPE.length
    pull = np.zeros((STEPS, rows.PULL_COLUMNS))
    assert advance(rope, swayed(ROPE.length), pull, 0.0, STEPS) == STEPS
    return pull, rope


@pytest.mark.long
@pytest.mark.parametrize("model", [WakeOscillatorParams(start_per_s=0.0), StrouhalForcingParams()])
def test_a_rope_in_three_parts_vibrates_like_the_whole_one(model: Any) -> None:
    """Massless joints, with calls of one step and of many."""
    pull, rope = whole((model,))
    lines = [replace(line, more=(model,)) for line in cut(ROPE, (7, 20), (0.0, 0.0, 0.0))]
    bench, motion = JointBench(lines), swayed(ROPE.length)
    still = bench.still(STEPS)
    still.value[0, :, :3], still.rate[0, :, :3] = motion.value[:, :3], motion.rate[:, :3]
    parts = []
    for first, last in ((0, 1), (1, 2), (2, 100), (100, STEPS)):
        some = (np.ascontiguousarray(table[:, first : last + 1]) for table in still)
        parts.append(bench.follow(rows.Boundary(*some))[0])
    x = rope.state.nodes[:3, : ROPE.elements + 1]
    position = np.concatenate(
        [bench.nodes(2), bench.nodes(1)[:, 1:], bench.nodes(0)[:, 1:]], axis=1
    )
    _, smooth = whole(())
    vibration = np.abs(x - smooth.state.nodes[:3, : ROPE.elements + 1]).max()
    assert vibration > 2e-3
    assert np.abs(position - x).max() < 1e-4 * vibration
    assert np.abs(np.concatenate(parts) - pull).max() < 1e-6 * pull[:, rows.PULL].max()
    assert bench.health[rows.SOLVES] <= 1.1 * rope.state.health[rows.SOLVES]
