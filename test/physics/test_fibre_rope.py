"""Fibre ropes: relaxation, dynamic stiffness and working curve against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from math import cos, exp, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from joint_rigs import JointBench, cut
from payout_rigs import WINCH
from rigs import Bench, Rig, frequency, march, still, with_nothing_below
from table_rigs import tabled

from rope_twin import Twin
from rope_twin.core.energy import measure
from rope_twin.core.state import LINE, PULL, PULL_COLUMNS, TENSION, Boundary
from rope_twin.core.step import advance
from rope_twin.scene.rope_data import DynamicStiffness, StiffnessTable, WorkingCurve
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene

STATIC, FAST, TAU = 20e6, 50e6, 30.0  # N, N, s
LINEAR = DynamicStiffness(constant_n=FAST, relaxation_s=TAU)
STRAIGHT = ((0.0, 0.0), (0.1, 0.1 * STATIC))
SYROPE = StiffnessTable(
    table=((0.0, 0.0), (0.01, 0.1e6), (0.05, 1.5e6)),
    dynamic=DynamicStiffness(constant_n=60e6, per_mean_tension=50.0, relaxation_s=1.5),
    working_curve=WorkingCurve(permanent=0.3, curvature=0.2, max_mean_tension_n=0.15e6),
)
LENGTH = 100.0


def held(strain: float, fibre: StiffnessTable, **figures: float) -> Scene:
    """Return a weightless rope that is held at both ends with this strain."""
    rig = Rig(
        length=LENGTH, elements=4, mass=0.5, damping=1e4, gravity=0.0,
        fixed_at=(0.0, 0.0, -LENGTH * (1.0 + strain)), **figures,  # type: ignore[arg-type]
    )  # fmt: skip
    return with_nothing_below(tabled(rig, fibre))


def moved(
    motion: Callable[[float], float], rate: Callable[[float], float]
) -> Callable[[float], tuple[float, float]]:
    """Return the hang-off's motion for a strain history."""
    return lambda t: (LENGTH * motion(t), LENGTH * rate(t))


def test_stress_relaxation_to_the_static_curve() -> None:
    """Stretched in 2 s and held: T = S(ε) + (E_d - EA)·e, e the convolution with exp(-t/τ)."""
    fibre = StiffnessTable(table=STRAIGHT, dynamic=LINEAR)
    start, more, over = 0.01, 0.005, 2.0
    motion = moved(lambda t: more * min(t / over, 1.0), lambda t: more / over if t < over else 0.0)
    twin = Twin(held(start, fibre, step=0.02))
    assert twin.snapshot().tension_top_n == pytest.approx(start * STATIC, rel=1e-9)
    seen = [
        (snapshot.time_s, snapshot.tension_top_n)
        for snapshot in march(twin, motion, 60.0, every=50)
    ]
    for t, tension in seen[3:]:
        e = more / over * TAU * (exp(-(t - over) / TAU) - exp(-t / TAU))
        expected = STATIC * (start + more) + (FAST - STATIC) * e
        assert tension == pytest.approx(expected, rel=2e-5)


@pytest.mark.parametrize("period", [10.0, 200.0])
def test_storage_and_loss_modulus(period: float) -> None:
    """Storage and loss modulus of the standard linear solid (Zener 1948)."""
    fibre = StiffnessTable(table=STRAIGHT, dynamic=LINEAR)
    omega, swing, mean = 2.0 * pi / period, 0.002, 0.01
    motion = moved(
        lambda t: swing * (1.0 - cos(omega * t)), lambda t: swing * omega * sin(omega * t)
    )
    whole = max(6.0 * TAU, period)
    last = (int(whole / period) + 2) * period
    snapshots = [
        (snapshot.time_s, snapshot.tension_top_n)
        for snapshot in march(Twin(held(mean, fibre, step=0.05)), motion, last, every=1)
    ]
    t, T = np.array(snapshots).T
    within = t > last - period + 1e-6
    strain = -swing * np.exp(1j * omega * t[within])
    factor = 2.0 * np.mean(T[within] * np.exp(-1j * omega * t[within])) / -swing
    wt = omega * TAU
    rise = FAST - STATIC
    complex_modulus = STATIC + rise * (wt * wt + 1j * wt) / (1.0 + wt * wt)
    assert len(strain) == round(period / 0.05)
    assert factor.real == pytest.approx(complex_modulus.real, rel=2e-3)
    assert factor.imag == pytest.approx(complex_modulus.imag, rel=2e-2)


def test_axial_frequency_by_the_dynamic_stiffness() -> None:
    """E_d at the mean tension, not the tangent of the static curve."""
    stiff = DynamicStiffness(constant_n=30e6, per_mean_tension=100.0, relaxation_s=3600.0)
    fibre = StiffnessTable(table=STRAIGHT, dynamic=stiff)
    rig = Rig(length=LENGTH, elements=4, mass=1e-3, load=20e3, step=0.005)
    weight = 20e3 * 9.80665
    bench = Bench(tabled(rig, fibre))
    assert bench.position[2, 0] == pytest.approx(
        -LENGTH * (1.0 + (weight + 0.5 * rig.weight * LENGTH) / STATIC), rel=1e-10
    )
    bench.velocity[2, :4] = 1e-3 * np.linspace(1.0, 0.25, 4)
    height = []
    for _ in range(1200):
        bench.hold(1)
        height.append(bench.position[2, 0])
    expected = sqrt((30e6 + 100.0 * weight) / LENGTH / 20e3) / (2.0 * pi)
    assert frequency(np.array(height), rig.step) == pytest.approx(expected, rel=2e-3)


def test_dynamic_stiffness_falls_with_amplitude() -> None:
    """E_d = a + b·M - c·A, where A is E_d times the strain amplitude."""
    stiff = DynamicStiffness(
        constant_n=40e6, per_mean_tension=50.0, per_tension_amplitude=100.0, relaxation_s=60.0
    )
    fibre = StiffnessTable(table=STRAIGHT, dynamic=stiff)
    omega, swing = 2.0 * pi / 4.0, 0.003
    motion = moved(lambda t: swing * sin(omega * t), lambda t: swing * omega * cos(omega * t))
    snapshots = [
        (snapshot.time_s, snapshot.tension_top_n)
        for snapshot in march(Twin(held(0.01, fibre, step=0.02, ramp=20.0)), motion, 400.0, every=1)
    ]
    t, T = np.array(snapshots).T
    within = t > 396.0 + 1e-6
    factor = 2.0 * np.mean(T[within] * np.exp(-1j * omega * t[within])) / (-1j * swing)
    mean = T[within].mean()
    wt = omega * 60.0
    lag = (wt * wt + 1j * wt) / (1.0 + wt * wt)  # of ε - ε_m over ε
    E = (40e6 + 50.0 * mean) / (1.0 + 100.0 * swing * abs(lag))
    assert pytest.approx(40e6 + 50.0 * mean - 100.0 * E * swing * abs(lag), rel=1e-12) == E
    assert factor.real == pytest.approx(STATIC + (E - STATIC) * lag.real, rel=3e-3)


def test_working_curve_after_a_high_mean_tension() -> None:
    """Up the original curve, down the working curve, up again and on: the slow loop of Syrope."""
    table = ((0.0, 0.0), (0.02, 0.3e6), (0.06, 1.5e6))
    own = WorkingCurve(permanent=0.4, curvature=0.3, max_mean_tension_n=0.2e6)
    fibre = StiffnessTable(
        table=table, dynamic=DynamicStiffness(constant_n=90e6, relaxation_s=2.0), working_curve=own
    )
    plain = StiffnessTable(table=table)
    begin = fibre.strain_at(0.1e6)
    twin = Twin(held(begin, fibre, step=0.05))
    assert twin.snapshot().tension_top_n == pytest.approx(0.1e6, rel=1e-8)
    ways = (
        (0.0, 0.0),
        (600.0, 0.05 - begin),
        (1000.0, 0.035 - begin),
        (1400.0, 0.05 - begin),
        (1600.0, 0.055 - begin),
    )
    at, to = np.array(ways).T

    def rate(t: float) -> float:
        k = min(int(np.searchsorted(at, t, side="right")) - 1, len(at) - 2)
        return float((to[k + 1] - to[k]) / (at[k + 1] - at[k]))

    motion = moved(lambda t: float(np.interp(t, at, to)), rate)
    seen = {
        round(snapshot.time_s): snapshot.tension_top_n
        for snapshot in march(twin, motion, 1600.0, every=20)
    }

    def curve(strain: float, top: float) -> float:
        highest = plain.tension_n(top)
        xi = (strain - 0.4 * top) / (0.6 * top)
        return highest * xi * (0.7 + 0.3 * xi)

    def lag(t: float) -> float:  # ε - ε_m in slow, even motion is the rate times τ
        return rate(t - 1e-6) * 2.0

    for t in (300, 500, 600):  # on the original curve, and E_d·τ·rate above it
        strain = begin + float(np.interp(t, at, to)) - lag(t)
        assert seen[t] == pytest.approx(plain.tension_n(strain) + 90e6 * lag(t), rel=2e-4)
    top = 0.05 - lag(600)
    for t in (800, 1000, 1200):
        strain = begin + float(np.interp(t, at, to)) - lag(t)
        assert seen[t] == pytest.approx(curve(strain, top) + 90e6 * lag(t), rel=3e-3)
    strain = 0.055 - lag(1600)
    assert seen[1600] == pytest.approx(plain.tension_n(strain) + 90e6 * lag(1600), rel=2e-4)


def test_energy_is_never_created() -> None:
    """A load dropped on a slack rope: the balance closes, and the rope only ever loses energy."""
    rig = Rig(length=LENGTH, elements=5, mass=1.0, load=10e3, damping=2e4, step=0.001)
    bench = Bench(tabled(rig, SYROPE))
    bench.position[2, :5] += 1.0 * (1.0 - bench.rope.state.s[:5] / LENGTH)
    total, seen = [], []
    for _ in range(6000):
        bench.hold(1)
        seen.append(bench.rope.work[TENSION, : bench.n].min())
        total.append(measure(bench.rope, np.zeros(3), bench.time, 0.0).store.total)
    assert min(seen) == 0.0
    scale = 10e3 * 9.80665
    assert np.diff(total).max() < 1e-9 * scale
    assert total[-1] < total[0] - 0.5 * scale


def test_fibre_rope_payout_has_no_tension_jump() -> None:
    """Splits and merges where the tension differs from the static curve."""
    fibre = StiffnessTable(
        table=STRAIGHT,
        dynamic=DynamicStiffness(constant_n=FAST, per_mean_tension=20.0, relaxation_s=5.0),
    )
    rig = Rig(length=205.0, elements=20, mass=2.9, load=20e3, damping=1e6, winch=WINCH)
    twin = Twin(tabled(rig, fibre))
    snapshots = list(march(twin, still, 40.0, speeds=[(1.0, 1.0), (20.0, -1.0)]))
    tension = np.array([snapshot.tension_top_n for snapshot in snapshots])
    count = np.array([snapshot.solver.splits + snapshot.solver.merges for snapshot in snapshots])
    events = np.flatnonzero(np.diff(count)) + 1
    assert len(events) >= 3
    bend = np.abs(np.diff(tension, 2))
    assert max(bend[at - 1 : at + 10].max() for at in events) <= 1e-4 * tension.mean()


@dataclass(frozen=True)
class FibreRig(Rig):
    """A rig of fibre rope."""

    def scene(self) -> Scene:
        """Return the scene with the rope's curves."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return tabled(Rig(**given), SYROPE)


@pytest.mark.long
def test_a_fibre_rope_in_three_parts_equals_the_whole() -> None:
    """A multi-line system: the load bounces as on a single rope."""
    rig = FibreRig(
        length=100.0, elements=20, mass=2.9, load=20e3, EA=206e6, damping=1e6, tolerance=1e-3
    )
    rope, steps = build(rig.scene()), 30
    rope.state.nodes[2, : rig.elements + 1] = rope.state.s[: rig.elements + 1] - rig.length
    bench = JointBench(cut(rig, (8, 14), (0.0, 0.0, 0.0)))
    motion = bench.still(steps)
    motion.value[0, :, LINE] = rig.length
    whole = np.zeros((steps, PULL_COLUMNS))
    own = Boundary(motion.value[0].copy(), motion.rate[0].copy())
    assert advance(rope, own, whole, 0.0, steps) == steps
    parts = bench.follow(bench.still(steps))[0]
    assert np.ptp(whole[:, PULL]) > 1e3
    assert np.abs(parts - whole).max() < 1e-6 * whole[:, PULL].max()


def test_a_fibre_rope_resumes_bit_identically(tmp_path: Path) -> None:
    """Internal variables are part of the state."""
    scene = tabled(Rig(length=LENGTH, elements=6, mass=2.0, load=20e3, damping=1e5), SYROPE)
    motion = moved(lambda t: 0.01 * sin(t), lambda t: 0.01 * cos(t))
    unbroken = [snapshot.tension_top_n for snapshot in march(Twin(scene), motion, 8.0, every=1)]
    twin = Twin(scene)
    first = [snapshot.tension_top_n for snapshot in march(twin, motion, 4.0, every=1)]
    twin.save(tmp_path / "state")
    again = Twin.restore(tmp_path / "state", scene)
    rest = [snapshot.tension_top_n for snapshot in march(again, motion, 4.0, every=1)]
    assert [*first, *rest] == unbroken


def test_a_working_curve_needs_a_dynamic_stiffness() -> None:
    """The reader rejects a working curve without one."""
    alone = StiffnessTable(table=STRAIGHT, working_curve=WorkingCurve(permanent=0.3))
    assert "give the dynamic stiffness too" in (alone.check() or "")
    assert replace(alone, dynamic=LINEAR).check() is None
