"""Rainflow and damage: the standard's own example, closed forms, and rope that travels."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from whole_history import count_cycles

from rope_twin import load_scene
from rope_twin.errors import InputError
from rope_twin.scene.grid import ends_m
from rope_twin.scene.load import rope_preset
from rope_twin.scene.schema import Damping, RopeLine, RopeSection
from rope_twin.studies.ensemble import Plan, variations
from rope_twin.twin.ensemble.ensemble import Ensemble
from rope_twin.vortex.fatigue import (
    CURVES,
    Cycles,
    StressCurve,
    Vector,
    damage_of_series,
    find_curve,
    metal_area,
)
from rope_twin.vortex.results import DamageSettings, RopeDamage

STEEL = rope_preset("steel_wire_40mm")
FIBRE = rope_preset("hmpe_25mm")
LINE = RopeLine(name="hoist", rope=STEEL, length_m=100.0, elements=10,
                damping=Damping(newton_seconds=0.0), to="tool")  # fmt: skip


def table(cycles: Cycles) -> dict[float, float]:
    found: Counter[float] = Counter()
    for size, count in zip(cycles.range, cycles.count, strict=True):
        found[float(size)] += float(count)
    return dict(found)


def test_the_example_of_the_standard() -> None:
    """ASTM E1049-85, figure 6: A to I."""
    series = np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])
    assert table(count_cycles(series)) == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}


def test_short_series() -> None:
    assert table(count_cycles(np.zeros(0))) == {}
    assert table(count_cycles(np.array([4.0]))) == {}
    assert table(count_cycles(np.array([4.0, 4.0, 4.0]))) == {}
    assert table(count_cycles(np.array([4.0, 7.0]))) == {3.0: 0.5}
    assert table(count_cycles(np.array([4.0, 5.0, 6.0, 7.0]))) == {3.0: 0.5}


numbers = st.lists(st.integers(-5, 5).map(float), max_size=40)


@given(numbers)
def test_no_range_is_lost(values: list[float]) -> None:
    """The sum of count times range is half the way that the series goes."""
    series = np.array(values)
    cycles = count_cycles(series)
    way = np.abs(np.diff(series)).sum()
    assert 2.0 * (cycles.range * cycles.count).sum() == pytest.approx(way)


def over(cycles: Cycles, strength: float) -> Cycles:
    """Return cycles of tension over an area or a breaking load."""
    return Cycles(cycles.range / strength, cycles.mean / strength, cycles.count)


def test_damage_of_a_sine() -> None:
    """n cycles of one range: n·S^m/K and n·R^M/10^(3.20 - 2.79·L_m)."""
    mean, amplitude, n = 200e3, 40e3, 25
    phase = np.linspace(0.0, 2.0 * np.pi * n, 40 * n + 1) + 0.5 * np.pi
    cycles = count_cycles(mean + amplitude * np.sin(phase))
    area = metal_area(STEEL, 0.0)
    assert area == pytest.approx(3989.7 * 0.04**2 / 7850.0)
    stress_mpa = 2.0 * amplitude / area * 1e-6
    by_stress = CURVES["stranded_wire"].used(over(cycles, area)).sum()
    assert by_stress == pytest.approx(n * stress_mpa**4 / 3.4e14, rel=1e-9)
    load, share = mean / 1.01344e6, 2.0 * amplitude / 1.01344e6
    by_tension = CURVES["six_strand_tension"].used(over(cycles, STEEL.breaking_load_n)).sum()
    assert by_tension == pytest.approx(n * share**4.09 / 10 ** (3.20 - 2.79 * load), rel=1e-9)


def test_damage_of_stress_at_many_places() -> None:
    t = np.linspace(0.0, 10.0, 1001)[:, None]
    stress = 1e6 * np.array([10.0, 20.0, 0.0]) * np.cos(2.0 * np.pi * t)
    expected = 10.0 * np.array([20.0, 40.0, 0.0]) ** 3 / 1e12
    assert damage_of_series(stress, StressCurve(1e12, 3.0).used) == pytest.approx(expected)


def counted(line: RopeLine, max_m: float, piece_m: float, curve: str) -> RopeDamage:
    return RopeDamage(line, ends_m(line), max_m, DamageSettings(curve, False, piece_m=piece_m), 0.0)


def used(count: RopeDamage) -> Vector:
    return count.snapshot(0.0, 0.0).used


def take(count: RopeDamage, line_out_m: float, low_n: float, per_metre: float) -> None:
    """Let a count see a rope of 10 elements whose tension grows upwards."""
    s = np.linspace(0.0, line_out_m, 11)
    tension = low_n + per_metre * 0.5 * (s[1:] + s[:-1])
    count.take_tensions(s, tension, low_n + per_metre * line_out_m)


def test_material_keeps_its_history_on_its_way_through_the_winch() -> None:
    """Hauled in and paid out under a swinging load: aboard, a piece meets no cycle.

    The load swings by 2·5 kN at all times; a piece counts the swings while it is out. Another
    length of the line out moves no piece and makes no cycle, although every element changes.
    """
    count = counted(LINE, 100.0, 10.0, "stranded_wire")
    swings = 512  # a swing is sampled at four instants
    for k in range(4 * 2 * swings):
        line_out = 100.0 if k < 4 * swings else 43.0
        take(count, line_out, 50e3 + 5e3 * (0.0, 1.0, 0.0, -1.0)[k % 4], 30.0)
    assert count.middles == pytest.approx(np.arange(5.0, 100.0, 10.0))
    stress_mpa = 10e3 / metal_area(STEEL, 0.0) * 1e-6
    swung = used(count) / (stress_mpa**4 / 3.4e14)
    assert swung[:4] == pytest.approx(2.0 * swings, abs=1.0)
    assert swung[4:] == pytest.approx(1.0 * swings, abs=1.0)


def test_a_rope_that_runs_past_its_elements() -> None:
    """A rope that travels under a still load: each piece sees its own steady tension."""
    count = counted(LINE, 100.0, 5.0, "stranded_wire")
    for line_out in np.concatenate([np.linspace(100.0, 30.0, 300), np.linspace(30.0, 100.0, 300)]):
        take(count, float(line_out), 50e3, 30.0)
    hardly_mpa = 1e-6 / metal_area(STEEL, 0.0) * 1e-6  # of a millionth of a newton
    assert used(count) == pytest.approx(0.0, abs=600.0 * hardly_mpa**4 / 3.4e14)


def test_sections_have_strengths_of_their_own() -> None:
    parts = (RopeSection(rope=rope_preset("chain_42mm"), length_m=40.0), RopeSection(rope=STEEL))
    line = replace(LINE, rope=None, sections=parts)
    count = counted(line, 100.0, 20.0, "stranded_wire")
    for load in (50e3, 60e3, 50e3, 60e3):
        take(count, 100.0, load, 0.0)
    damage = used(count)
    areas = [metal_area(part.rope, 0.0) for part in parts]
    assert damage[0] / damage[-1] == pytest.approx((areas[1] / areas[0]) ** 4)
    assert np.all(damage[:2] == damage[0])
    assert np.all(damage[2:] == damage[-1])


def test_what_cannot_be_counted_is_refused() -> None:
    parts = (RopeSection(rope=FIBRE, length_m=40.0), RopeSection(rope=STEEL))
    with pytest.raises(InputError) as refused:
        counted(replace(LINE, rope=None, sections=parts), 1e2, 1.0, "spiral_wire")
    assert str(refused.value) == (
        "rope 'hoist', section 1: it is not all of steel: no stress is known; take a curve of "
        "tension (six_strand_tension, polyester_tension), if it holds for this rope."
    )
    with pytest.raises(InputError, match="no curve 'six_strand'; did you mean 'six_strand_tens"):
        find_curve("fatigue", "six_strand")


def test_a_rope_in_a_regular_heave() -> None:
    """The piece that hangs at the sheave meets the cycles of the top tension."""
    scene = load_scene("smooth_2km")
    ensemble = Ensemble(scene, variations(scene, Plan((), 1, ((),), 1), 40.0))
    count = counted(scene.ropes[0], 2000.0, 10.0, "six_strand_tension")
    top = []
    for _ in range(400):
        ensemble.advance(0.1)
        seen = ensemble.snapshot(0)
        from_lower_m = (seen.arc_length_m[-1] - seen.arc_length_m)[::-1]
        count.take_tensions(from_lower_m, seen.element_tension_n[::-1], seen.tension_top_n)
        top.append(seen.tension_top_n)
    cycles = over(count_cycles(np.array(top)), scene.ropes[0].breaking_load_n)
    expected = CURVES["six_strand_tension"].used(cycles).sum()
    assert used(count)[-1] == pytest.approx(expected, rel=0.01)
    assert np.all(used(count) > 0.0)
