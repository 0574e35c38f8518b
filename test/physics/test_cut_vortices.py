"""A rope cut while its VIV model with memory shakes it: each part keeps its nodes' wakes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cut_rigs import fallen
from shedding_rigs import HAULED, HAULING

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.state import Rope
from rope_twin.effects import strouhal_forcing, travelling_waves, wake_oscillator
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.regrid import has_state

RIG = replace(HAULED, winch=HAULING, mass=4.0, load=400.0, area=(0.3,) * 3)
# its parameters, numbers carried, and the row of the strength per node, with its value per metre
MODELS: dict[str, tuple[Any, int, int, float]] = {
    "strouhal_forcing": (
        StrouhalForcingParams(), strouhal_forcing.CARRIED, strouhal_forcing.STRENGTH,
        0.5 * RIG.density * RIG.diameter * RIG.drag[0],
    ),
    "wake_oscillator": (
        WakeOscillatorParams(), wake_oscillator.CARRIED, wake_oscillator.STRENGTH,
        0.25 * RIG.density * RIG.diameter * wake_oscillator.SETS["qu_metrikine"].lift,
    ),
    "travelling_waves": (
        TravellingWavesParams(ramp_s=1e-3), travelling_waves.CARRIED, travelling_waves.STRENGTH,
        0.5 * RIG.density * RIG.diameter,
    ),
}  # fmt: skip
EACH = pytest.mark.parametrize("model", list(MODELS))


def scene_of(model: str, speed: float = 0.5) -> Scene:
    """Return the rig in a current of this speed with this VIV model."""
    scene = replace(RIG, current=((0.0, (speed, 0.0)),)).scene()
    return replace(scene, effects=(*scene.effects, MODELS[model][0]))


def shaken(model: str) -> Twin:
    """Return a rope that vibrates and is paid out."""
    twin = Twin(scene_of(model))
    assert not twin.submit_speed(None, 0.3)
    twin.advance(1000)
    return twin


def memory_of(rope: Rope) -> Any:
    """Return the internal variables of the one effect that has them."""
    return next(effect for effect in rope.effects if has_state(effect)).memory


@EACH
@pytest.mark.parametrize("at", [12.0, 17.37])
def test_a_cut_keeps_the_wake_of_every_node(model: str, at: float) -> None:
    """Bit-identical in both parts; at the cut it lies between those of the neighbouring nodes."""
    twin, k = shaken(model), MODELS[model][1]
    n = int(twin.rope.state.counts[rows.ELEMENTS])
    s, memory = twin.rope.state.s[:n].copy(), memory_of(twin.rope).copy()
    assert np.ptp(memory[0, :n]) > 0.1, "it is shaken"
    lost = twin.split(at)
    lower, upper = fallen(twin), twin.rope
    for rope, start in ((lower, 0.0), (upper, lost)):
        own = memory_of(rope)
        count = int(own[3 * k, -1])
        marks = own[3 * k, :count] + start
        assert np.allclose(marks, rope.state.s[:count] + start)
        same = np.abs(marks[:, None] - s).argmin(axis=1)
        kept = np.abs(s[same] - marks) < 1e-9
        assert kept.sum() >= count - 2
        assert (own[:k, np.flatnonzero(kept)] == memory[:k, same[kept]]).all()
    below = memory_of(lower)[:k, int(memory_of(lower)[3 * k, -1]) - 1]
    assert (below == memory_of(upper)[:k, 0]).all(), "both ends at the cut"
    e = int(np.searchsorted(s, lost)) - 1
    low, high = np.sort(memory[:k, e : e + 2], axis=1).T
    assert ((below >= low - 1e-12) & (below <= high + 1e-12)).all()
    assert not np.shares_memory(memory_of(lower), memory_of(upper))


@EACH
def test_both_parts_shed_along_their_full_length(model: str) -> None:
    """Strength per metre times length, to half an element at the hang-off."""
    _, _, row, per_metre = MODELS[model]
    twin = shaken(model)
    assert not twin.submit_cut(None, 17.83)
    twin.advance(1)
    assert twin.cut is not None
    lost = twin.cut.lost_m
    lower, upper = fallen(twin), twin.rope
    n = int(upper.state.counts[rows.ELEMENTS])
    below = memory_of(lower)[row, : int(lower.state.counts[rows.ELEMENTS]) + 1]
    assert below.sum() == pytest.approx(per_metre * lost, abs=1.1e-3 * per_metre)
    half = 0.5 * (upper.state.s[n] - upper.state.s[n - 1])
    above = memory_of(upper)[row, :n]
    assert above.sum() == pytest.approx(per_metre * (upper.state.s[n] - half), rel=1e-6)


@EACH
def test_an_axially_falling_rope_sheds_no_vortices(model: str) -> None:
    """Terminal velocity W + w·l = (½·ρ·CdA + ½·ρ·Ct·π·d·l)·v², as without vortices."""
    rig = replace(RIG, current=((0.0, (0.0, 0.0)),), mass=1.0, winch=None)
    scene = rig.scene()
    twin = Twin(replace(scene, effects=(*scene.effects, MODELS[model][0])))
    twin.submit_cut(None, 10.0)
    twin.advance(2000)
    half_rho = 0.5 * rig.density
    k = half_rho * (rig.area[2] + rig.drag[1] * math.pi * rig.diameter * 20.0)
    submerged = rig.mass - rig.density * 0.25 * math.pi * rig.diameter**2
    weight = rig.load - rig.density * rig.volume + 20.0 * submerged
    speed = math.sqrt(weight * rig.gravity / k)
    assert twin.snapshot().payload_velocity_m_per_s[2] == pytest.approx(-speed, rel=1e-5)
    sideways = fallen(twin).state.nodes[3:5, :20]
    assert np.abs(sideways).max() < 1e-6


@EACH
def test_energy_balance_of_both_parts_with_vortices(model: str) -> None:
    """It closes over cut and fall, with the work of the vortices."""
    twin = Twin(scene_of(model), ENERGY)
    twin.advance(300)
    assert not twin.submit_cut(None, 12.0)
    twin.advance(500)
    balance = twin.snapshot().energy
    assert balance is not None
    assert balance.kinetic_j > 100.0
    assert abs(balance.residual_pct) < 0.5


@EACH
def test_a_cut_run_with_wakes_resumes_bit_identically(model: str) -> None:
    """In any call pattern, from a saved state and on a branch."""
    ends = []
    for chunk in (1, 7, 64):
        twin = Twin(scene_of(model))
        assert not twin.submit_cut(2_005_000_000, 12.0)
        for due in (150, 203, 400):
            while twin.steps < due:
                twin.advance(min(chunk, due - twin.steps))
            if chunk == 7:
                twin = Twin.restore(twin.capture(), twin.scene)
            if chunk == 64:
                twin = twin.branch()
        snapshot = twin.snapshot()
        ends.append(b"".join(rope.node_position_m.tobytes() for rope in snapshot.ropes))
    assert ends[0] == ends[1] == ends[2]


def test_the_remaining_part_sheds_at_its_strouhal_frequency() -> None:
    """St·U·cos θ/d of the bare rope, which leans by θ, after the transient."""
    twin = shaken("strouhal_forcing")
    assert not twin.submit_speed(None, 0.0)
    assert not twin.submit_cut(None, 12.0)
    twin.advance(3000)
    x = twin.rope.state.nodes[:3, :9].copy()
    before = memory_of(twin.rope)[0, :9].copy()
    twin.advance(200)
    turns_hz = (memory_of(twin.rope)[0, :9] - before) / (2.0 * math.pi * 2.0)
    along = x[:, 2:] - x[:, :-2]
    lean = np.arctan2(along[0], along[2])
    assert np.abs(lean).max() > 0.05
    expected = 0.2 * 0.5 * np.cos(lean) / RIG.diameter
    np.testing.assert_allclose(turns_hz[1:-1], expected, rtol=0.01)
