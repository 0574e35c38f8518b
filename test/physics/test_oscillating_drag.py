"""Drag by Keulegan-Carpenter number: the number of known motions, and the force that follows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from oscillation_rigs import by_one, in_time, oscillating
from rigs import Rig, march, march_to_end, sine, still, with_nothing_below

from rope_twin import Twin
from rope_twin.core.state import ELEMENTS
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams, KeuleganCarpenter, OscillatingDrag, RoughnessTable
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors import Monitors
from rope_twin.vortex.drag_amplification import MEAN, MORE, RATE2, SQUARE

D = 0.25
SMOOTH = RoughnessTable(roughness=1e-4, rows=((2.0, 0.8), (12.0, 1.6), (60.0, 0.7)))
ROUGH = RoughnessTable(roughness=1e-2, rows=((2.0, 1.2), (12.0, 2.0), (80.0, 1.1)))
# A stiff upright pipe that holds still: what moves is the water.
PIPE = Rig(
    length=20.0, elements=8, mass=60.0, EA=1e9, diameter=D, density=1025.0, drag=(1.0, 0.0),
    added_mass=1.0, hang_off=(0.0, 0.0, -5.0), fixed_at=(0.0, 0.0, -25.05), step=0.02,
)  # fmt: skip
WINDOW_S = 40.0


def drag_of(*tables: RoughnessTable, roughness: float | None = None) -> DragParams:
    by_number = KeuleganCarpenter(tables=tables, roughness=roughness, window_s=WINDOW_S)
    return DragParams(normal=1.0, tangential=0.0, over_keulegan_carpenter=by_number)


def scene_of(rig: Rig, *more: object) -> Scene:
    """A rig's scene with further effects, each in the place of the rig's own of its kind."""
    scene = rig.scene()
    return in_time(scene if rig.fixed_at is None else with_nothing_below(scene), *more)


def tide(of_time: object, seconds: float) -> CurrentParams:
    """One m/s to the east at all depths, times a function of time."""
    times = np.arange(0.0, seconds + 0.05, 0.05)
    return CurrentParams(
        profile=((0.0, (1.0, 0.0)),),
        over_time=tuple((float(t), float(of_time(t))) for t in times),  # type: ignore[operator]
    )


def memory_of(twin: Twin) -> np.ndarray:
    (own,) = (effect for effect in twin.rope.effects if isinstance(effect, OscillatingDrag))
    return np.asarray(own.memory)


def number_at(twin: Twin, node: int) -> float:
    """The number that the means at a node give, without what keeps it from 0/0."""
    m = memory_of(twin)[:, node]
    mean = m[MEAN : MEAN + 3]
    sigma = math.sqrt(m[SQUARE] - mean @ mean)
    period = 2.0 * math.pi * sigma / math.sqrt(m[RATE2])
    return float((np.linalg.norm(mean) + math.sqrt(2.0) * sigma) * period / D)


def regular(t: float) -> float:
    return 1.2 * math.sin(2.0 * math.pi * t / 6.0)


def with_flow(t: float) -> float:
    return 0.5 + regular(t)


def two_waves(t: float) -> float:
    return 0.6 * math.sin(2.0 * math.pi * t / 5.0) + 0.9 * math.sin(2.0 * math.pi * t / 9.0)


# σ² and the mean square of the rate of two sines, and the number of the one that has both
SIGMA2 = 0.5 * (0.6**2 + 0.9**2)
RATES2 = 0.5 * ((0.6 / 5.0) ** 2 + (0.9 / 9.0) ** 2)  # over 4·π²
TWO = math.sqrt(2.0 * SIGMA2) * math.sqrt(SIGMA2 / RATES2) / D


@pytest.mark.parametrize(
    ("motion", "expected", "within"),
    [(regular, 1.2 * 6.0 / D, 0.02), (with_flow, 1.7 * 6.0 / D, 0.03), (two_waves, TWO, 0.08)],
)
def test_keulegan_carpenter_number_of_known_motions(
    motion: object, expected: float, within: float
) -> None:
    """U·T/d of a sine, with a mean flow added; of two sines by σ and Rice's period.

    What is left is how the fading mean follows the single cycles, 6 s and 9 s in 40 s; averaged
    over the last 45 s, a whole number of them.
    """
    twin = Twin(scene_of(PIPE, tide(motion, 255.0), drag_of(SMOOTH)))
    results = []
    for snapshot in march(twin, still, 250.0, every=25):
        if snapshot.time_s > 250.0 - 90.0:
            results.append(number_at(twin, 4))
    assert np.mean(results) == pytest.approx(expected, rel=within)


@pytest.mark.parametrize(
    ("tables", "roughness", "factor"),
    [
        pytest.param((SMOOTH,), None, 1.6, marks=pytest.mark.long),
        ((SMOOTH, ROUGH), 1e-3, 1.8),
        pytest.param((SMOOTH, ROUGH), 1e-2, 2.0, marks=pytest.mark.long),
    ],
)
def test_peak_drag_has_the_tabulated_factor(
    tables: tuple[RoughnessTable, ...], roughness: float | None, factor: float
) -> None:
    """At KC 12 the peak of the pull on the hang-off is that of the table's row; half-way between.

    Half of ½·ρ·d·C_d·U²·L, with 1e-3 more for the water's acceleration at the peak, which is none.
    """
    speed, period = 0.75, 4.0
    assert speed * period / D == 12.0
    motion = tide(lambda t: speed * math.sin(2.0 * math.pi * t / period), 165.0)
    twin = Twin(scene_of(PIPE, motion, drag_of(*tables, roughness=roughness)))
    pulls = [s.hang_off_force_n[0] for s in march(twin, still, 160.0) if s.time_s > 152.0]
    expected = 0.5 * 0.5 * 1025.0 * D * speed**2 * factor * PIPE.length
    assert max(pulls) == pytest.approx(expected, rel=0.02)


def test_steady_flow_uses_the_last_row() -> None:
    """At rest and later: half of ½·ρ·d·C_d·U²·L with the factor 0.7, and nothing begins to move."""
    twin = Twin(scene_of(PIPE, tide(lambda t: 0.8, 0.1), drag_of(SMOOTH)))
    expected = 0.25 * 1025.0 * D * 0.8**2 * 0.7 * PIPE.length
    assert twin.snapshot().hang_off_force_n[0] == pytest.approx(expected, rel=2e-3)
    snapshot = march_to_end(twin, still, 5.0)
    assert snapshot.hang_off_force_n[0] == pytest.approx(expected, rel=2e-3)
    assert memory_of(twin)[MORE, :8] == pytest.approx(-0.3, abs=1e-9)


def test_drag_factors_of_one_change_nothing() -> None:
    """To the rounding, in waves."""
    sea = WavesParams(regular=RegularWave(height_m=4.0, period_s=8.0), ramp_s=4.0)
    rig = replace(PIPE, fixed_at=None, load=8e3, volume=1.0, EA=4e7, drag=(1.1, 0.02))
    plain = replace(rig.scene(), effects=(*rig.scene().effects, sea))
    positions = []
    for scene in (plain, in_time(plain)):
        snapshot = march_to_end(Twin(scene), still, 12.0)
        positions.append(snapshot.node_position_m)
    assert np.ptp(positions[0][:, 0]) > 0.1
    assert np.abs(positions[0] - positions[1]).max() < 1e-9


@pytest.mark.long
def test_connected_ropes_have_their_own_keulegan_carpenter_numbers() -> None:
    """A bridle: with a factor of one as without; with a table, each node has its own factor."""
    scene = load_scene("bridle_lift")
    own = scene.listed(DragParams)
    assert own is not None
    table = replace(own, over_keulegan_carpenter=KeuleganCarpenter(tables=(SMOOTH,)))
    positions = []
    for each in (scene, oscillating(scene, by_one(own)), oscillating(scene, table)):
        twin = Twin(each)
        snapshot = march_to_end(twin, sine(1.0, 5.0), 4.0)
        positions.append(np.concatenate([rope.node_position_m for rope in snapshot.ropes]))
    n = int(twin.rope.state.counts[ELEMENTS])
    factors = memory_of(twin)[MORE, 1:n]
    assert np.abs(positions[0] - positions[1]).max() < 1e-9
    assert np.abs(positions[0] - positions[2]).max() > 1e-4
    assert np.ptp(factors) > 1e-3


@pytest.mark.long
def test_energy_balance_with_varying_drag_factors() -> None:
    """A factor that is held over a step is late by a part of it: an error of the first order.

    At 5 ms it is below 3e-5 of what is exchanged, and it halves with the step. With a factor that
    does not change it would be 4e-7 and of the second order.
    """
    sea = WavesParams(regular=RegularWave(height_m=4.0, period_s=8.0), ramp_s=4.0)
    shares = []
    for step in (0.01, 0.005):
        rig = replace(PIPE, fixed_at=None, load=8e3, volume=1.0, EA=4e7, damping=4e5, step=step)
        drag = drag_of(SMOOTH, ROUGH, roughness=1e-3)
        twin = Twin(scene_of(rig, sea, drag), Monitors(energy=True))
        snapshot = march_to_end(twin, still, 16.0)
        energy = snapshot.energy
        assert energy is not None
        assert np.ptp(memory_of(twin)[MORE, :8]) > 0.05
        shares.append(energy.residual_j / energy.exchanged_j)
    assert abs(shares[1]) < 3e-5
    assert shares[0] / shares[1] == pytest.approx(2.0, rel=0.1)
