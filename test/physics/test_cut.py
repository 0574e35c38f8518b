"""A cut rope: conservation at the cut, and closed forms of the motion of both parts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from cut_rigs import VACUUM, WATER, Sums, fallen, parts, sums, swinging
from effect_cases import data_of, loads, some_work
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.effects import EFFECTS
from rope_twin.twin.rope_cut import is_at_end, without_load

Vector = NDArray[np.float64]
STUB = 1.0  # m of rope that stays on the payload of a rope cut at its end


@pytest.mark.parametrize("at", [101.0, 207.3, 391.0])
def test_a_cut_conserves_mass_momentum_and_energy(at: float) -> None:
    """Mass, momentum, stretch and height stay; the cut element loses its relative motion."""
    twin = swinging(VACUUM)
    before = sums(twin.rope, VACUUM, VACUUM.load)
    n = int(twin.rope.state.counts[rows.ELEMENTS])
    s, v = twin.rope.state.s[: n + 1].copy(), twin.rope.state.nodes[3:6, : n + 1].copy()
    assert twin.split(at) == pytest.approx(at, abs=0.01 * 20.0)
    both = Sums(*(a + b for a, b in zip(*parts(twin, VACUUM), strict=True)))
    assert both.mass == pytest.approx(before.mass, rel=1e-13)
    np.testing.assert_allclose(both.momentum, before.momentum, rtol=1e-12, atol=1e-9)
    assert both.stretch == pytest.approx(before.stretch, rel=1e-9)
    assert both.height == pytest.approx(before.height, rel=1e-12)
    e = int(np.searchsorted(s, at)) - 1
    share = (at - s[e]) / (s[e + 1] - s[e])
    apart = float(((v[:, e + 1] - v[:, e]) ** 2).sum())
    lost = 0.25 * VACUUM.mass * (s[e + 1] - s[e]) * share * (1.0 - share) * apart
    lost *= 0.01 <= share <= 0.99  # else the node beside it was taken
    if at < 380.0:  # the halved piece at the hang-off may lose a little more
        assert before.motion - both.motion == pytest.approx(lost, rel=1e-3, abs=1e-6)


def test_the_lower_part_falls_freely_in_vacuum() -> None:
    """Its momentum grows by its weight to round-off from the first step on; energy only falls."""
    twin = swinging(VACUUM)
    twin.submit_cut(None, 250.0)
    before = sums(twin.rope, VACUUM, VACUUM.load)
    energy = before.motion + before.stretch + before.height
    twin.advance(1)
    last = parts(twin, VACUUM)[1]
    for _ in range(300):
        twin.advance(1)
        upper, now = parts(twin, VACUUM)
        gained = now.momentum - last.momentum
        np.testing.assert_allclose(gained, [0.0, 0.0, -now.mass * 9.80665 * 0.01], atol=1e-8)
        assert sum(upper[2:]) + sum(now[2:]) < energy + 1e-5 * before.stretch
        last = now


def test_the_release_wave_velocity_after_a_cut() -> None:
    """End velocity V = T/√(EA·m) until the wave has reached an end.

    Behind it the upper part moves with V and is as taut as its own weight makes it. In the lower
    part the wave meets tensions T - w·c·t, leaves rope that is slack, and that falls:
    v = -V + g·t_a - g·(t - t_a) where it came at t_a.
    """
    rig = replace(VACUUM, elements=400, damping=6500.0, step=5e-4, tolerance=1.0)
    twin = rig.twin()
    twin.submit_cut(None, 200.0)
    twin.advance(80)
    T, t, reached = (rig.load + 200.0 * rig.mass) * rig.gravity, 0.04, 0.8
    V, c = T / math.sqrt(rig.EA * rig.mass), math.sqrt(rig.EA / rig.mass)
    snapshot, below = twin.snapshot(), fallen(twin).state
    behind = 200.0 - reached * c * t
    rising = snapshot.node_velocity_m_per_s[snapshot.arc_length_m > behind, 2].mean()
    falling = below.nodes[5, :201][below.s[:201] > behind].mean()
    assert rising == pytest.approx(V, rel=0.005)
    assert falling == pytest.approx(-V - (1.0 - reached) * rig.gravity * t, rel=0.005)


@pytest.mark.parametrize("below", [math.inf, 80.0])
def test_terminal_velocity_of_payload_and_rope(below: float) -> None:
    """W + w·l = (½·ρ·CdA + ½·ρ·Ct·π·d·l)·v² while the rope trails taut behind the payload."""
    rig = replace(WATER, drag=(1.2, 0.1))
    twin = rig.twin()
    twin.submit_cut(None, below)
    twin.advance(1500)
    assert twin.cut is not None
    length = twin.cut.lost_m
    assert length == pytest.approx(STUB if math.isinf(below) else 200.0 - below)
    half_rho = 0.5 * rig.density
    k = half_rho * (rig.area[2] + rig.drag[1] * math.pi * rig.diameter * length)
    speed = math.sqrt((rig.load_weight + rig.weight * length) / k)
    snapshot = twin.snapshot()
    assert snapshot.payload_velocity_m_per_s[2] == pytest.approx(-speed, rel=1e-6)
    assert snapshot.tension_payload_n > 0.0, "the rope trails taut"


def test_a_cut_removes_the_lower_end_effects() -> None:
    """The upper part keeps the compiled effects, with parameters that do nothing."""
    effects = data_of("payload", "splash_zone", "net", "fairing")
    bare = without_load(effects)
    assert [type(effect) for effect in bare] == [type(effect) for effect in effects]
    work = some_work()
    assert np.abs(loads(effects, work)[:, 0]).max() > 1e3
    assert (loads(bare, work) == loads((), work)).all()


def test_every_lower_end_effect_can_be_removed() -> None:
    """An unknown effect is reported by its name."""
    for effect in EFFECTS:
        (before,) = data_of(effect.name)
        (after,) = without_load((before,))
        assert (after is not before) == is_at_end(before)
        assert type(after) is type(before)
