"""The seabed: rest, sliding, rebound and lift-off against closed forms and a fine integration."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import NODES, apply, some_stage, some_work
from hypothesis import given
from hypothesis import strategies as st
from rigs import Rig, march, still, with_nothing_below
from scipy.integrate import solve_ivp

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid
from rope_twin.core.bed_shape import clearance
from rope_twin.effects import Surroundings
from rope_twin.effects.seabed import SeabedParams, Soundings, build
from rope_twin.scene.schema import Winch
from rope_twin.twin.twin import Twin

G = 9.80665
WATER = Surroundings(1025.0, G, 0.0)
BED = SeabedParams(depth_m=100.0)


def on_bed(rig: Rig, bed: SeabedParams) -> Any:
    """The rig's scene with a bed; the last of its effects is the payload, if it has one."""
    scene = rig.scene()
    return replace(scene, effects=(*scene.effects[:4], bed, *scene.effects[4:]))


def pushes(bed: SeabedParams, work: Any) -> Any:
    """Force on rope nodes, (3, NODES)."""
    work = work.copy()
    work[rows.MASS] = 0.0
    apply((build(bed, None, WATER),), work, some_stage(), 1, NODES)
    return work[rows.RESIDUAL : rows.RESIDUAL + 3]


@given(seed=st.integers(0, 1000), chi=st.floats(0.0, 10.0), east=st.floats(-1.0, 1.0))
def test_the_seabed_never_pulls(seed: int, chi: float, east: float) -> None:
    """Whatever the motion: along the normal it pushes or does nothing; above it nothing."""
    bed = SeabedParams(depth_m=45.0, slope=(east, 0.2), damping_s_per_m=chi)
    work = some_work(seed)
    force = pushes(bed, work)
    normal = np.array([-east, -0.2, 1.0]) / math.sqrt(1.04 + east**2)
    along = normal @ force
    assert (along >= 0.0).all()
    above = work[2] > -45.0 + east * work[0] + 0.2 * work[1]
    assert above.any()
    assert (force[:, above] == 0.0).all()
    sliding = force - normal[:, None] * along
    assert (np.linalg.norm(sliding, axis=0) <= bed.friction * along * (1.0 + 1e-12)).all()


def test_a_sounding_grid_of_a_plane_equals_the_plane() -> None:
    """Soundings of a plane push as the plane does, and tell the same clearance."""
    x, y = (-200.0, -20.0, 30.0, 200.0), (-300.0, 5.0, 300.0)
    depth = tuple(tuple(45.0 - 0.1 * a + 0.05 * b for a in x) for b in y)
    plane = SeabedParams(depth_m=45.0, slope=(0.1, -0.05))
    grid = SeabedParams(soundings=Soundings(x_m=x, y_m=y, depth_m=depth))
    work = some_work(3)
    assert pushes(grid, work) == pytest.approx(pushes(plane, work), rel=1e-9, abs=1e-9)
    built = build(grid, None, WATER)
    assert isinstance(built, Grid)
    assert clearance(built, work[:3]) == pytest.approx(
        clearance(build(plane, None, WATER), work[:3]), rel=1e-12
    )


MOORED = Rig(
    length=300.0, elements=150, mass=20.0, EA=2e8, diameter=0.05, density=1025.0,
    fixed_at=(230.0, 0.0, -100.0), damping=1e5,
)  # fmt: skip


def test_a_rope_laid_on_the_bed_is_a_catenary() -> None:
    """Anchored 230 m away on a smooth bed: T_top = H + w·h, and the scope of the hanging part.

    Hanging part s = √(h² + 2·h·H/w), its span H/w·asinh(w·s/H), the rest lies straight under H
    (Irvine 1981). 2 m elements: 0.2 %.
    """
    scene = on_bed(MOORED, replace(BED, friction=0.0, stiffness_n_per_m3=1e6))
    twin = Twin(with_nothing_below(scene))  # the step of the shipped landing
    snapshot = twin.snapshot()
    w, h = MOORED.weight, 100.0
    tension = snapshot.element_tension_n
    H = float(tension[-1])
    assert snapshot.tension_top_n - H == pytest.approx(w * h, rel=2e-3)
    s = math.sqrt(h * h + 2.0 * h * H / w)
    span = H / w * math.asinh(w * s / H) + (300.0 - s)
    assert span == pytest.approx(230.0, rel=2e-3)
    assert np.abs(tension[-40:] / H - 1.0).max() < 1e-3  # what lies carries H


def test_rebound_of_a_payload_by_hunt_and_crossley() -> None:
    """A payload meets the bed at 1 m/s: motion and rebound of the ODE."""
    mass, chi = 5e3, 1.0
    k = mass * G / 0.05
    rig = Rig(length=120.0, elements=6, load=mass, mass=0.01, diameter=1e-3, step=1e-3, EA=1e5)
    twin = Twin(on_bed(rig, replace(BED, damping_s_per_m=chi)))
    assert twin.snapshot().payload_position_m[2] == pytest.approx(-100.05, abs=1e-3)
    nodes = twin.rope.state.nodes
    nodes[2, 0] = -99.99
    nodes[rows.VELOCITY + 2, 0] = -1.0
    seen = np.array(
        [
            (snapshot.payload_position_m[2], snapshot.payload_velocity_m_per_s[2])
            for snapshot in march(twin, still, 0.4)
        ]
    )

    def motion(_: float, y: Any) -> Any:
        d = max(-100.0 - y[0], 0.0)
        return [y[1], k * d * max(1.0 - chi * y[1], 0.0) / mass - G]

    times = np.arange(1, len(seen) + 1) * 1e-3
    exact = solve_ivp(motion, (0.0, 0.4), [-99.99, -1.0], t_eval=times, rtol=1e-10, atol=1e-12).y
    assert np.abs(seen[:, 1] - exact[1]).max() < 0.01
    assert np.abs(seen[:, 0] - exact[0]).max() < 1e-3
    assert 0.1 < seen[:, 1].max() < 1.0


def test_a_payload_slides_to_rest() -> None:
    """On a level bed at 2 m/s: the way is v²/(2·μ·g), 2 %; friction does not turn it back."""
    rig = Rig(length=120.0, elements=6, load=5e3, mass=0.01, diameter=1e-3, EA=1e5, step=0.01)
    twin = Twin(on_bed(rig, replace(BED, friction=0.4)))
    for snapshot in march(twin, still, 20.0, every=100):
        last = snapshot
    assert abs(last.payload_velocity_m_per_s[2]) < 1e-3
    assert last.payload_position_m[2] == pytest.approx(-100.05, abs=1e-3)
    twin.rope.state.nodes[rows.VELOCITY, 0] = 2.0
    before = float(last.payload_position_m[0])
    way = [float(snapshot.payload_position_m[0]) - before for snapshot in march(twin, still, 3.0)]
    assert max(way) == pytest.approx(2.0**2 / (2.0 * 0.4 * G), rel=0.02)
    assert way[-1] == pytest.approx(max(way), abs=2e-3)


def test_landing_and_lift_off() -> None:
    """20 t are set down and lifted again: the rope goes slack, the bed carries all, then none."""
    rig = Rig(
        length=95.0, elements=19, mass=6.4, damping=1e6, load=20e3, volume=2.0, density=1025.0,
        added=(5e3,) * 3, area=(10.0,) * 3, drag=(1.2, 0.01), added_mass=1.0,
        winch=Winch(speed_limit_m_per_s=0.5, acceleration_limit_m_per_s2=0.3, min_line_out_m=10.0,
                    max_line_out_m=200.0),
    )  # fmt: skip
    twin = Twin(on_bed(rig, BED))
    speeds = [(0.0, 0.5), (14.0, 0.0), (24.0, -0.5), (38.0, 0.0)]
    snapshots = list(march(twin, still, 60.0, every=10, speeds=speeds))
    seen = [(s.tension_payload_n, s.payload_position_m[2], s.tension_top_n) for s in snapshots]
    tension, height, top = np.array(seen).T
    reported = [snapshot.seabed for snapshot in snapshots]
    assert all(reported[k] is not None for k in (0, 215, -1))
    assert reported[0].payload_height_m == pytest.approx(100.0 + height[0])
    assert not reported[0].payload_landed
    assert reported[215].payload_landed
    assert reported[215].payload_reaction_n == pytest.approx(rig.load_weight, rel=0.01)
    assert reported[-1].payload_reaction_n == reported[-1].rope_on_bed_m == 0.0
    assert tension[0] == pytest.approx(rig.load_weight, rel=0.05)
    rest = slice(190, 240)  # set down, before the winch hauls
    assert np.abs(tension[rest]).max() < 1e-2 * rig.load_weight
    assert height[rest] == pytest.approx(-100.05, abs=5e-3)
    assert top[rest].max() < 1.1 * rig.weight * 103.0
    assert top[-1] == pytest.approx(rig.load_weight + rig.weight * 95.0, rel=0.02)
    assert height[-1] > -96.0
