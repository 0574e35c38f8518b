"""Layered, time-varying and vertical currents; drag by Reynolds number and by current alone."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from effect_cases import NODES, apply, some_work
from ramp_rigs import in_time
from rigs import Rig, Vector, march, still

from rope_twin.core import state as rows
from rope_twin.effects import Surroundings
from rope_twin.effects.current import CurrentParams, Layers
from rope_twin.effects.current import build as build_current
from rope_twin.effects.drag import DragParams, ReynoldsDrag
from rope_twin.effects.drag import build as build_drag
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.payload import build as build_payload
from rope_twin.twin.twin import Twin

WATER = Surroundings(1025.0, 9.80665, 0.0)
LAYERS = Layers(upper=(0.8, 0.2), lower=(-0.3, 0.1), split_z_m=-40.0, bottom_z_m=-70.0)
BOTH = CurrentParams(layers=LAYERS)


def scratch_after(effects: tuple[Any, ...], work: Vector, time: float = 3.0) -> Vector:
    """Return scratch after the hooks of these effects."""
    work = work.copy()
    apply(effects, work, rows.Stage(time, 1e-4, 1e-2, 0.0), 0, NODES)
    return work


def flow(params: CurrentParams, time: float = 3.0) -> Vector:
    """Return the water velocity at the sample nodes, (3, NODES)."""
    return scratch_after((build_current(params, None, WATER),), some_work(), time)[
        rows.FLOW : rows.FLOW + 3
    ]


def test_a_two_layer_current() -> None:
    """One velocity above the split, another down to the bottom, none below, as published."""
    z = some_work()[2]
    seen = flow(BOTH)
    for east, north, part in ((0.8, 0.2, z > -39.9), (-0.3, 0.1, (z < -40.1) & (z > -69.9)),
                              (0.0, 0.0, z < -70.1)):  # fmt: skip
        assert part.any()
        assert seen[0, part] == pytest.approx(east, abs=1e-12)
        assert seen[1, part] == pytest.approx(north, abs=1e-12)


@pytest.mark.parametrize(
    ("time", "share"), [(-5.0, 0.0), (0.0, 0.0), (5.0, 0.5), (10.0, 1.0), (15.0, 0.75), (99.0, 0.5)]
)
def test_a_current_time_factor_is_linear_between_rows(time: float, share: float) -> None:
    """It is constant beyond the first and last row."""
    params = replace(BOTH, over_time=((0.0, 0.0), (10.0, 1.0), (20.0, 0.5)))
    assert flow(params, time) == pytest.approx(share * flow(BOTH), abs=1e-12)


def test_a_current_ramp_ends_at_the_steady_offset() -> None:
    """The rope hangs straight at t = 0 and ends at the offset of the steady current; 0.5 %."""
    rig = Rig(
        length=100.0, elements=20, mass=6.4, load=3e3, volume=0.3, density=1025.0, drag=(1.2, 0.01),
        area=(4.0,) * 3, added_mass=1.0, damping=1e5, step=0.05,
        current=((0.0, (0.6, 0.0)), (-100.0, (0.2, 0.1))),
    )  # fmt: skip
    steady = Twin(rig.scene()).snapshot().payload_position_m
    scene = rig.scene()
    current = replace(scene.effects[0], over_time=((0.0, 0.0), (60.0, 1.0)))
    twin = Twin(in_time(scene, current))
    assert np.abs(twin.snapshot().payload_position_m[:2]).max() < 1e-9
    for snapshot in march(twin, still, 400.0, every=400):
        last = snapshot.payload_position_m
    assert last[:2] == pytest.approx(steady[:2], rel=5e-3)
    assert np.hypot(*steady[:2]) > 0.5


RISING = CurrentParams(
    profile=((0.0, (0.8, 0.1, 0.0)), (-30.0, (0.3, 0.5, 0.2)), (-70.0, (-0.2, 0.4, -0.1)))
)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_vertical_current_is_linear_over_depth(share: float) -> None:
    """Horizontal components are bit-identical to those without a vertical one."""
    over_time = () if share == 1.0 else ((0.0, 0.0), (10.0, 1.0))
    params = replace(RISING, over_time=over_time)
    level = replace(params, profile=tuple((z, velocity[:2]) for z, velocity in params.profile))
    seen, z = flow(params, 5.0), some_work()[2]
    rising = params.table[::-1]
    assert seen[2] == pytest.approx(share * np.interp(z, rising[:, 0], rising[:, 3]), abs=1e-15)
    assert seen[:2].tobytes() == flow(level, 5.0)[:2].tobytes()
    assert np.ptp(seen[2]) > 0.1 * share


def test_drag_depends_on_relative_velocity() -> None:
    """Rope and payload that move with the water have no drag; otherwise as in still water."""
    up = (0.3, -0.2, 0.7)
    water = build_current(CurrentParams(profile=((0.0, up),)), None, WATER)
    load = SimpleNamespace(
        mass_kg=0.0, volume_m3=0.0, added_mass_kg=(0.0,) * 3, drag_area_m2=(1.0, 2.0, 3.0),
        differs_rising=False,
    )  # fmt: skip
    force = (
        build_drag(DragParams(normal=1.2, tangential=0.05), None, WATER),
        build_payload(PayloadParams(), load, WATER),
    )
    work = some_work()
    still = work.copy()
    still[rows.VELOCITY : rows.VELOCITY + 3] -= np.array(up)[:, None]
    part = slice(rows.RESIDUAL, rows.BLOCK + 6)
    assert scratch_after((water, *force), work)[part] == pytest.approx(
        scratch_after(force, still)[part], rel=1e-12, abs=1e-9
    )


@pytest.mark.parametrize("upward", [0.8, -0.8])
def test_tension_of_a_rope_in_a_vertical_current(upward: float) -> None:
    """T(s) = W - ½ρCdA·w·|w| + (weight - ½ρπd·Cdt·w·|w|)·s from the payload up."""
    rig = Rig(
        length=400.0, elements=40, mass=6.4, load=3e3, volume=0.3, density=1025.0, drag=(1.2, 0.02),
        area=(4.0, 4.0, 5.0), damping=1e5, diameter=0.04, EA=5e7, tolerance=1e-6,
        current=((0.0, (0.0, 0.0, upward)),),
    )  # fmt: skip
    snapshot = Twin(in_time(rig.scene())).snapshot()
    square = 0.5 * 1025.0 * upward * abs(upward)
    below = rig.load_weight - square * 5.0
    each = rig.weight - square * math.pi * 0.04 * 0.02
    middles = 10.0 * (np.arange(40) + 0.5)
    tension = np.sort(snapshot.element_tension_n)  # from the payload up
    assert tension == pytest.approx(below + each * middles, rel=1e-6)
    assert snapshot.tension_top_n == pytest.approx(below + each * 400.0, rel=1e-6)
    assert abs(each / rig.weight - 1.0) > 0.005
    assert np.abs(snapshot.payload_position_m[:2]).max() < 1e-9


def test_drag_coefficient_by_reynolds_number() -> None:
    """Linear in ln Re between rows, constant beyond; one factor on all of `normal`."""
    base = DragParams(normal=1.2, tangential=0.0)
    table = replace(base, over_reynolds=((1e3, 2.0), (1e5, 1.0), (1e6, 0.5)))
    built = build_drag(table, None, WATER)
    assert isinstance(built, ReynoldsDrag)
    work = some_work()
    plain, other = (scratch_after((build_drag(p, None, WATER),), work) for p in (base, table))
    bare = scratch_after((), work)
    v, t = work[rows.VELOCITY : rows.VELOCITY + 3], work[rows.TANGENT : rows.TANGENT + 3]
    speed = np.linalg.norm(v - (v * t).sum(axis=0) * t, axis=0)
    diameter = np.sqrt(4.0 / math.pi * work[rows.VOLUME] / work[rows.LENGTH])
    factor = np.interp(np.log(speed * diameter / 1.3e-6), np.log([1e3, 1e5, 1e6]), [2.0, 1.0, 0.5])
    force = slice(rows.RESIDUAL, rows.RESIDUAL + 3)
    expected = factor * (plain[force] - bare[force])
    assert other[force] - bare[force] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert np.ptp(factor) > 0.1


def test_reynolds_number_of_a_rope_with_its_own_coefficient() -> None:
    """It is that of the diameter: twice the coefficient of the rope is twice the force."""
    work = some_work()
    table = DragParams(normal=1.2, tangential=0.0, over_reynolds=((1e3, 2.0), (1e6, 0.5)))
    built = (build_drag(table, None, WATER),)
    own = work.copy()
    own[rows.FRONTAL] *= 2.0
    force = slice(rows.RESIDUAL, rows.RESIDUAL + 3)
    once, twice = ((scratch_after(built, at) - scratch_after((), at))[force] for at in (work, own))
    assert twice == pytest.approx(2.0 * once, rel=1e-12, abs=1e-12)


def test_drag_by_current_alone_has_no_damping() -> None:
    """Force of the current on a rope at rest, whatever its motion, without a block."""
    params = DragParams(normal=1.2, tangential=0.02, relative=False)
    effects = (build_current(BOTH, None, WATER), build_drag(params, None, WATER))
    work = some_work()
    resting = work.copy()
    resting[rows.VELOCITY : rows.VELOCITY + 3] = 0.0
    full = (effects[0], build_drag(replace(params, relative=True), None, WATER))
    seen, expected = scratch_after(effects, work), scratch_after(full, resting)
    force = slice(rows.RESIDUAL, rows.RESIDUAL + 3)
    assert seen[force] == pytest.approx(expected[force], rel=1e-12, abs=1e-12)
    blocks = slice(rows.BLOCK, rows.BLOCK + 6)
    assert seen[blocks] == pytest.approx(scratch_after((), work)[blocks], rel=1e-12)


@pytest.mark.parametrize(
    ("params", "words"),
    [
        (CurrentParams(profile=((0.0, (1.0, 0.0)),), layers=LAYERS), "keep one"),
        (CurrentParams(), "profile is empty"),
        (replace(BOTH, over_time=((3.0, 1.0), (3.0, 0.0))), "order the rows"),
        (CurrentParams(layers=replace(LAYERS, upper=(11.0, 0.0))), "not a plausible current"),
        (CurrentParams(profile=((0.0, (1.0, 0.0, -11.0)),)), "not a plausible current"),
        (CurrentParams(profile=((0.0, (1.0,)),)), "give [east, north] or [east, north, up]"),
        (CurrentParams(layers=replace(LAYERS, lower=(1.0,) * 4)), "has 4 components"),
    ],
)
def test_invalid_currents_are_rejected(params: CurrentParams, words: str) -> None:
    assert words in (params.check() or "")


def test_invalid_drag_and_layers_are_rejected() -> None:
    assert "order" in (replace(LAYERS, bottom_z_m=-30.0).check() or "")
    rows_back = DragParams(normal=1.0, tangential=0.0, over_reynolds=((1e5, 1.0), (1e4, 1.0)))
    assert "order the rows" in (rows_back.check() or "")
    both = replace(rows_back, over_reynolds=((1e4, 1.0),), relative=False)
    assert "remove one" in (both.check() or "")
