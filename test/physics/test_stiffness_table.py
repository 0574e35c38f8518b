"""Tabulated axial stiffness: statics, waves and energy; a straight table equals constant EA."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import pi, sqrt

import numpy as np
import pytest
from joint_rigs import JointBench, cut
from payout_rigs import WINCH
from rigs import Bench, Rig, frequency, march, sine, still, top_tension, with_nothing_below
from table_rigs import HMPE, tabled

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.axial_law import elastic_state, tension_at
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.step import advance
from rope_twin.scene.rope_data import StiffnessTable
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene

RIG = Rig(length=1000.0, elements=100, mass=2.9, load=20e3, EA=206e6, damping=1e6)


@jit_entry
def _fill(law, strain, out) -> None:
    for i in range(len(strain)):
        out[i, 0], out[i, 1] = tension_at(law, 0, strain[i])


def _tabled(law, strain) -> np.ndarray:
    """Return tension and tangent [N] at each strain, as the kernels read the table."""
    out = np.empty((len(strain), 2))
    _fill(law, np.asarray(strain), out)
    return out


def test_table_interpolation_is_monotone_and_smooth() -> None:
    """Points are met, tension and tangent rise steadily between them, both without a jump."""
    law = HMPE.cubics
    strain = np.linspace(-0.002, 0.010, 240001)
    curve = _tabled(law, strain[::100])
    for point, tension in HMPE.table:
        assert _tabled(law, [point])[0, 0] == pytest.approx(tension, abs=1e-6)
        assert HMPE.strain_at(tension) == pytest.approx(point, abs=1e-12)
        below, above = _tabled(law, [point - 1e-10, point + 1e-10])
        assert below[1] == pytest.approx(above[1], rel=1e-4)
    assert (curve[:, 1] > 0.0).all()
    slope = np.gradient(curve[:, 0], strain[::100])
    assert slope[2:-2] == pytest.approx(curve[2:-2, 1], rel=0.02)
    own = [(HMPE.tension_n(e), HMPE.tangent_n(HMPE.tension_n(e))) for e in (0.0004, 0.003, 0.009)]
    assert np.array(own) == pytest.approx(_tabled(law, [0.0004, 0.003, 0.009]), rel=1e-9)


def test_static_stretch_is_the_integral_of_the_strain() -> None:
    """Depth of the payload = L + ∫strain(T(s)) ds; an element has the tension of its middle."""
    twin = Twin(tabled(RIG, HMPE))
    snapshot = twin.snapshot()
    tension = RIG.load_weight + RIG.weight * 10.0 * (np.arange(100) + 0.5)
    strains = [HMPE.strain_at(float(T)) for T in tension]
    assert snapshot.element_tension_n[::-1] == pytest.approx(tension, rel=1e-7)
    assert -snapshot.payload_position_m[2] == pytest.approx(1000.0 + 10.0 * sum(strains), abs=1e-6)
    fine = RIG.load_weight + RIG.weight * (np.arange(10000) + 0.5) * 0.1
    whole = 1000.0 + 0.1 * sum(HMPE.strain_at(float(T)) for T in fine)
    assert -snapshot.payload_position_m[2] == pytest.approx(whole, abs=1e-3)


@pytest.mark.parametrize("load", [10e3, 60e3])
def test_small_waves_follow_the_tangent(load: float) -> None:
    """A fixed rope without weight, plucked along by 1 mm: its first mode is c/2L, c = √(T'/m)."""
    rig = replace(RIG, fixed_at=(0.0, 0.0, -1000.0), gravity=0.0, damping=0.0, step=0.005)
    strain = HMPE.strain_at(load * 9.80665)
    stretched = replace(rig, fixed_at=(0.0, 0.0, -1000.0 * (1.0 + strain)))
    bench = Bench(with_nothing_below(tabled(stretched, HMPE)))
    s = bench.rope.state.s[: bench.n + 1]
    bench.position[2] += 1e-3 * np.sin(pi * s / s[-1])
    moved = []
    for _ in range(600):
        bench.hold(1)
        moved.append(bench.position[2, 50])
    expected = sqrt(HMPE.tangent_n(load * 9.80665) / RIG.mass) / 2000.0
    assert frequency(np.array(moved), rig.step) == pytest.approx(expected, rel=1e-3)


def stored(table: StiffnessTable, strain: float) -> float:
    """∫T dstrain, by Gauss between points of the table and beyond."""
    edges = np.array([*(point for point, _ in table.table if point < strain), strain])
    x, w = np.polynomial.legendre.leggauss(4)
    half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    return float(
        sum(
            h * w[k] * table.tension_n(m + h * x[k])
            for h, m in zip(half, middle, strict=True)
            for k in range(4)
        )
    )


def test_energy_of_a_bounce_is_conserved() -> None:
    """One heavy payload on an undamped light rope: kinetic, elastic and potential sum up."""
    rig = replace(RIG, length=100.0, elements=3, mass=1e-3, damping=0.0, step=0.002)
    bench = Bench(tabled(rig, HMPE))
    still_at = bench.position[2, 0]
    bench.position[2, :3] -= 0.1 * (1.0 - bench.rope.state.s[:3] / 100.0)
    energy = []
    for _ in range(400):
        bench.hold(1)
        z, v = bench.position[2, 0], bench.velocity[2, 0]
        elastic = 100.0 * stored(HMPE, -z / 100.0 - 1.0)
        energy.append(0.5 * 20e3 * v * v + 20e3 * 9.80665 * (z - still_at) + elastic)
    swing = 0.5 * HMPE.tangent_n(20e3 * 9.80665) / 100.0 * 0.1**2
    assert np.ptp(energy) < 0.01 * swing
    assert energy[-1] < energy[0] + 1e-4 * swing


def test_the_energy_account_uses_the_table() -> None:
    """Tension and stored energy of its account against the kernel's law and the integral."""
    strain = np.array([-0.001, 0.0, 0.0005, 0.0015, 0.006, 0.012])
    law, section = HMPE.cubics, np.zeros(6, dtype=int)
    tension, energy = elastic_state(law, np.ones(6), section, strain)
    assert tension == pytest.approx([max(HMPE.tension_n(float(e)), 0.0) for e in strain], rel=1e-12)
    assert energy == pytest.approx([stored(HMPE, max(float(e), 0.0)) for e in strain], rel=1e-12)


def test_a_straight_table_equals_constant_stiffness() -> None:
    """Tensions agree to round-off under heave, through slack, payout and haul-in."""
    straight = StiffnessTable(table=((0.0, 0.0), (0.002, 0.412e6), (0.01, 2.06e6)))
    rig = replace(RIG, length=200.0, elements=20)
    plain = top_tension(Twin(rig.scene()), sine(1.5, 4.0), 6.0)
    table = top_tension(Twin(tabled(rig, straight)), sine(1.5, 4.0), 6.0)
    assert table == pytest.approx(plain, rel=1e-6, abs=1.0)


def test_a_table_converges_through_a_snap() -> None:
    """A light load that falls slack and snaps: converged, with little more work than EA needs."""
    rig = replace(RIG, load=2e3, length=1000.0)
    counts = []
    for scene in (rig.scene(), tabled(rig, HMPE)):
        *_, snapshot = march(Twin(scene), sine(4.0, 8.0), 20.0, every=2000)
        assert snapshot.solver.unconverged_substeps == 0
        counts.append(snapshot.solver.solves)
    assert counts[1] < 1.5 * counts[0]


def test_tabled_rope_payout_has_no_tension_jump() -> None:
    """Splits and merges leave no jump: at most 0.01 % of the mean."""
    rig = replace(RIG, length=205.0, elements=20)
    twin = Twin(tabled(replace(rig, winch=WINCH), HMPE))
    snapshots = list(march(twin, still, 40.0, speeds=[(1.0, 1.0), (20.0, -1.0)]))
    tension = np.array([snapshot.tension_top_n for snapshot in snapshots])
    count = np.array([snapshot.solver.splits + snapshot.solver.merges for snapshot in snapshots])
    events = np.flatnonzero(np.diff(count)) + 1
    assert len(events) >= 3
    bend = np.abs(np.diff(tension, 2))
    assert max(bend[at - 1 : at + 10].max() for at in events) <= 1e-4 * tension.mean()


@dataclass(frozen=True)
class TabledRig(Rig):
    """A rig whose rope has a table in place of EA."""

    def scene(self) -> Scene:
        """Return the scene with the table."""
        return tabled(
            Rig(**{field.name: getattr(self, field.name) for field in fields(self)}), HMPE
        )


@pytest.mark.long
def test_a_tabled_rope_in_three_parts_equals_the_whole() -> None:
    """A multi-line system takes the table of each rope: the load bounces as on the whole rope."""
    rig = TabledRig(
        length=100.0, elements=20, mass=2.9, load=20e3, EA=206e6, damping=1e6, tolerance=1e-3
    )
    rope, steps = build(rig.scene()), 30
    position = rope.state.s[: rig.elements + 1] - rig.length
    rope.state.nodes[2, : rig.elements + 1] = position
    bench = JointBench(cut(rig, (8, 14), (0.0, 0.0, 0.0)))
    motion = bench.still(steps)
    motion.value[0, :, rows.LINE] = rig.length
    whole = np.zeros((steps, rows.PULL_COLUMNS))
    own = rows.Boundary(motion.value[0].copy(), motion.rate[0].copy())
    assert advance(rope, own, whole, 0.0, steps) == steps
    parts = bench.follow(bench.still(steps))[0]
    assert np.ptp(whole[:, rows.PULL]) > 1e3
    assert np.abs(parts - whole).max() < 1e-6 * whole[:, rows.PULL].max()
