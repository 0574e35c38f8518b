"""Passive heave compensator at the winch: a flying sheave on a gas spring."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from rigs import Rig, march, march_to_end, sine, still

from rope_twin import Twin, load_scene
from rope_twin.errors import SceneError
from rope_twin.files import share_dir
from rope_twin.scene.winch import PassiveCompensation, Winch
from rope_twin.studies.modes import find_modes
from rope_twin.twin.winch.components import root

MASS, AREA, VOLUME, EXPONENT, FALLS, SHEAVE = 50e3, 0.1, 1.2, 1.3, 2, 2000.0
RIG = Rig(
    length=300.0, elements=20, mass=6.4, EA=1e8, diameter=0.04, damping=1e6, load=MASS, step=0.0025,
    tolerance=1.0,
)  # fmt: skip
TOP_N = RIG.top_weight
UNIT = PassiveCompensation(
    stroke_m=4.0, piston_area_m2=AREA, gas_pressure_pa=FALLS * TOP_N / AREA, gas_volume_m3=VOLUME,
    exponent=EXPONENT, falls=FALLS, sheave_mass_kg=SHEAVE,
)  # fmt: skip
SPRING = EXPONENT * FALLS * TOP_N * AREA / VOLUME  # at mid stroke [N/m]


def winch(unit: PassiveCompensation) -> Winch:
    return Winch(
        speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=1.0, min_line_out_m=20.0,
        max_line_out_m=300.0, passive_compensation=unit,
    )  # fmt: skip


def twin_of(unit: PassiveCompensation, **changes: object) -> Twin:
    return Twin(replace(RIG, winch=winch(unit), **changes).scene())


def states(snapshot: object) -> dict[str, float]:
    (own,) = snapshot.winches  # type: ignore[attr-defined]
    return dict(own.figures)


@pytest.mark.long
def test_static_stroke_of_a_flying_sheave() -> None:
    """Stroke of p_0·A·(V_0/V)^n = falls·tension at rest, at the given line out."""
    soft = replace(UNIT, gas_pressure_pa=0.95 * UNIT.gas_pressure_pa)
    snapshot = march_to_end(twin_of(soft), still, 30.0)
    stroke = 2.0 + VOLUME * (1.0 - 0.95 ** (1.0 / EXPONENT)) / AREA
    assert states(snapshot)["passive_stroke_m"] == pytest.approx(stroke, abs=1e-3)
    assert snapshot.line_out_m == pytest.approx(RIG.length, abs=1e-3)
    assert states(snapshot)["passive_gas_force_n"] == pytest.approx(FALLS * TOP_N, rel=1e-4)


@pytest.mark.parametrize(
    "period", [6.0, *(pytest.param(period, marks=pytest.mark.long) for period in (12.0, 30.0))]
)
def test_heave_transmissibility_of_a_flying_sheave(period: float) -> None:
    """Spring, damper and sheave act by 1/falls² on a rod with a mass; within 1 % of the heave."""
    c, omega = 2.0 * 0.3 * sqrt(SPRING * MASS) * FALLS, 2.0 * pi / period
    twin = twin_of(replace(UNIT, damping_newton_seconds_per_m=c))
    seen = [
        (snapshot.time_s, snapshot.payload_position_m[2], snapshot.heave_m)
        for snapshot in march(twin, sine(0.02, period), 60.0 + 4.0 * period, every=8)
    ]
    t, z, heave = np.array(seen)[-round(3.0 * period / (8.0 * RIG.step)) :].T
    base = np.stack([np.cos(omega * t), np.sin(omega * t), np.ones_like(t), t], axis=1)
    moved, lifted = (
        complex(*np.linalg.lstsq(base, own, rcond=None)[0][:2]).conjugate() for own in (z, heave)
    )
    s = 1j * omega
    # line is counted unstretched: a stroke moves the rope by its stretch in addition
    flown = (SPRING + s * c + s * s * SHEAVE) / (FALLS**2 * (1.0 + TOP_N / RIG.EA))
    # waves along the rope for a unit motion of the payload: its upper end, and the tension there
    EA = RIG.EA + s * RIG.damping
    k = omega * np.sqrt(RIG.mass / EA)
    sine_part, phase = MASS * s * s / (EA * k), k * RIG.length
    end = np.cos(phase) + sine_part * np.sin(phase)
    pull = EA * k * (sine_part * np.cos(phase) - np.sin(phase))
    expected = 1.0 / (end + pull / flown)
    assert abs(moved / lifted - expected) < 0.01


@pytest.mark.parametrize("stroke_m", [4.0, 0.4], ids=["between its stops", "at a stop"])
def test_axial_mode_with_a_flying_sheave(stroke_m: float) -> None:
    """1/(M·ω²) = L/EA + falls²/k with the gas spring at 1.2 times its mid-stroke load; 1e-3."""
    rig = replace(RIG, mass=1e-3, diameter=1e-4)
    unit = replace(
        UNIT, stroke_m=stroke_m, gas_pressure_pa=FALLS * rig.top_weight / AREA / 1.2,
        stop_stiffness_n_per_m=3e6,
    )  # fmt: skip
    spring = EXPONENT * FALLS * rig.top_weight * AREA / (VOLUME / 1.2 ** (1.0 / EXPONENT))
    spring += 3e6 if stroke_m < 1.0 else 0.0
    expected = 2.0 * pi * sqrt(MASS * (rig.length / rig.EA + FALLS**2 / spring))
    (first, *_) = find_modes(replace(rig, winch=winch(unit)).scene(), 4).axial
    assert first.period_s == pytest.approx(expected, rel=1e-3)


def test_a_flying_sheave_reports_its_stops() -> None:
    """A heave beyond falls times its stroke; it returns within its stroke afterwards."""
    twin, messages, strokes = twin_of(replace(UNIT, stroke_m=1.0)), set(), []
    for snapshot in march(twin, sine(3.0, 8.0), 40.0):
        strokes.append(states(snapshot)["passive_stroke_m"])
        messages.add(snapshot.winch_at_limit)
    assert {"passive heave compensator extended to its end stop",
            "passive heave compensator retracted to its end stop"} <= messages  # fmt: skip
    assert -0.2 < min(strokes) < 0.0
    assert 1.0 < max(strokes) < 1.2


def test_a_flying_sheave_branch_is_bit_identical() -> None:
    """Stroke and seals are part of the state."""
    twin = twin_of(replace(UNIT, friction_n=5e4))
    march_to_end(twin, sine(1.0, 8.0), 10.0)
    last = []
    for run in (twin.branch(), twin):
        run.advance(500)
        last.append(run.snapshot())
    assert states(last[0]) == states(last[1])
    assert last[0].tension_top_n == last[1].tension_top_n


def test_root_of_a_kinked_function() -> None:
    """Regula falsi where the slope changes by seven orders."""

    def kinked(x: float) -> float:
        return x - 0.3 if x < 1.0 else 0.7 + 1e7 * (x - 1.0)

    assert root(kinked, -5.0, 5.0) == pytest.approx(0.3, abs=1e-12)


def test_a_flying_sheave_on_a_rendering_winch_is_rejected(tmp_path: Path) -> None:
    """Only one of the two may use the tension feedback."""
    scene = share_dir() / "config" / "scenes" / "flying_sheave_lift.yaml"
    drive = (
        "winch:\n  drum: {core_radius_m: 0.8, turns_per_layer: 40}\n"
        "  drive: {inertia_kg_m2: 3.0e+4, torque_limit_n_m: 5.0e+5}\n"
    )
    path = tmp_path / "scene.yaml"
    path.write_text(scene.read_text(encoding="utf-8").replace("winch:\n", drive), encoding="utf-8")
    with pytest.raises(SceneError, match="a winch that holds its line, and this one renders"):
        load_scene(str(path))
