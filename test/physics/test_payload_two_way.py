"""A payload with separate ascent and descent coefficients: force, derivative, steady speeds."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from effect_cases import apply, loads, some_stage, some_work
from rigs import Rig, Vector, march, still

from rope_twin import load_scene
from rope_twin.core import state as rows
from rope_twin.core.jit.wide import LANES
from rope_twin.core.loads.accounts import Place, account_sum
from rope_twin.core.loads.hooks import all_wide
from rope_twin.effects import Surroundings
from rope_twin.effects.payload import Payload, PayloadParams, TwoWayPayload, build
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.effects.waves import build as build_waves
from rope_twin.messages.encoder import ropes_of
from rope_twin.scene.relations import faults
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.schema import Payload as PayloadScene
from rope_twin.scene.schema import RegularHeave, Rising, Scene, ScheduleRow, SeaState, Winch
from rope_twin.scene.shapes import Grab, PayloadFigures, payload_figures
from rope_twin.studies.ensemble import make_plan, read_axis, variations
from rope_twin.twin.ensemble.ensemble import Ensemble
from rope_twin.twin.snapshot import RopeSnapshot
from rope_twin.twin.twin import Twin

WATER = Surroundings(1025.0, 9.80665, 0.0)
SINKING = PayloadFigures(2e3, 0.4, (150.0, 200.0, 900.0), (1.0, 1.2, 3.0))
BOTH = replace(SINKING, added_mass_rising_kg=300.0, drag_area_rising_m2=1.0)
RISING = replace(SINKING, added_mass_kg=(150.0, 200.0, 300.0), drag_area_m2=(1.0, 1.2, 1.0))


def effect(figures: PayloadFigures) -> Any:
    return build(PayloadParams(), figures, WATER)


def force(figures: PayloadFigures, work: Vector) -> Vector:
    computed = loads((effect(figures),), work) - loads((), work)
    return computed[3:6, 0]


def test_equal_ascent_coefficients_give_the_one_way_payload() -> None:
    """Scenes without ascent coefficients keep their effect; both kinds can be stepped in lanes."""
    assert type(effect(SINKING)) is Payload
    same = replace(SINKING, drag_area_rising_m2=SINKING.drag_area_m2[2])
    assert type(effect(same)) is Payload
    assert type(effect(BOTH)) is TwoWayPayload
    assert all_wide([TwoWayPayload])


@pytest.mark.parametrize(("w", "other"), [(-3.0, SINKING), (3.0, RISING)])
def test_ascent_and_descent_use_their_own_coefficients(w: float, other: PayloadFigures) -> None:
    """At 3 m/s the blend has gone but for δ²/(2·w²) = 1.4e-4 of half the difference."""
    work = some_work()
    work[rows.VELOCITY + 2, 0] = w
    assert force(BOTH, work) == pytest.approx(force(other, work), rel=2e-4)


@pytest.mark.parametrize("w", [-1.0, -0.06, -0.01, 0.0, 0.02, 0.3])
def test_two_way_blocks_are_the_derivative_of_the_residual(w: float) -> None:
    """A = -dR/da, its symmetric part, by central differences, turning or not."""
    work = some_work()
    work[rows.VELOCITY + 2, 0] = w
    effects, stage, step = (effect(BOTH),), some_stage(), 1e-3
    exact = np.zeros((3, 3))
    for k in range(3):
        ends = []
        for sign in (1.0, -1.0):
            moved = work.copy()
            moved[rows.ACCELERATION + k, 0] += sign * step
            moved[rows.VELOCITY + k, 0] += sign * step * stage.q
            ends.append(loads(effects, moved)[3:6, 0])
        exact[:, k] = (ends[1] - ends[0]) / (2.0 * step)
    xx, xy, xz, yy, yz, zz = loads(effects, work)[6:12, 0]
    block = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    assert block == pytest.approx(0.5 * (exact + exact.T), rel=1e-5, abs=1e-3)


@pytest.mark.parametrize("w", [-1.0, -0.03, 0.02, 0.7])
def test_two_way_power_is_force_times_velocity(w: float) -> None:
    """F·v = power - d(kinetic + potential)/dt."""
    work, effects = some_work(), (effect(BOTH),)
    work[rows.VELOCITY + 2, 0], work[rows.FLOW_RATE + 2, 0] = w, 0.8
    water = work[rows.FLOW_RATE : rows.FLOW_RATE + 3, :1]
    v, a = (work[row : row + 3, :1] for row in (rows.VELOCITY, rows.ACCELERATION))
    done = float(force(BOTH, work) @ v[:, 0])

    def place(dt: float) -> Place:
        x = work[rows.POSITION : rows.POSITION + 3, :1]
        nothing = {name: np.zeros(1) for name in Place._fields} | {"flow_rate": water}
        return Place(**{**nothing, "position": x + dt * v, "velocity": v + dt * a,
                        "acceleration": a, "flow": np.zeros((3, 1))})  # fmt: skip

    def stored(at: Place) -> float:
        return account_sum("kinetic_end", effects, at) + account_sum("potential_end", effects, at)

    rate = (stored(place(1e-5)) - stored(place(-1e-5))) / 2e-5
    assert done == pytest.approx(account_sum("power_end", effects, place(0.0)) - rate, rel=1e-6)


@pytest.mark.parametrize("w", [-3.0, 0.0, 3.0])
def test_two_way_added_mass_acts_on_the_acceleration_relative_to_the_water(w: float) -> None:
    """A payload that accelerates with the water feels its weight and the water's pressure alone.

    So it is in ascent, in descent and in between: no added mass is left in the balance.
    """
    inertia = replace(BOTH, drag_area_m2=(0.0,) * 3, drag_area_rising_m2=0.0)
    swell = WavesParams(regular=RegularWave(height_m=10.0, period_s=18.0), ramp_s=0.0)
    effects = effect(inertia), build_waves(swell, inertia, WATER)
    work, water = some_work(), some_work()
    apply(effects, water, some_stage(), 0, 1)
    for k in range(3):
        work[rows.VELOCITY + k, 0] = water[rows.FLOW + k, 0]
        work[rows.ACCELERATION + k, 0] = water[rows.FLOW_RATE + k, 0]
    work[rows.VELOCITY + 2, 0] += w
    a = work[rows.ACCELERATION : rows.ACCELERATION + 3, 0]
    on_rope = loads((build_waves(swell, None, WATER),), work)
    whole = (loads(effects, work) - on_rope)[3:6, 0]
    lifted = 1025.0 * inertia.volume_m3 - inertia.mass_kg
    expected = lifted * (a + np.array([0.0, 0.0, 9.80665]))
    assert abs(a[2]) > 0.05
    assert whole == pytest.approx(expected, rel=1e-12)


def towed(speed: float) -> float:
    """Tension at a grab that is lowered (+) or hauled in (-) at a steady speed [N]."""
    rig = Rig(
        length=60.0, elements=6, mass=2.0, load=500.0, volume=0.1, density=1025.0, area=(4.0,) * 3,
        added=(500.0,) * 3, damping=1e5, step=0.02,
        winch=Winch(speed_limit_m_per_s=1.5, acceleration_limit_m_per_s2=0.5,
                    min_line_out_m=5.0, max_line_out_m=200.0,
                    schedule=(ScheduleRow(at_s=0.0, speed_m_per_s=speed),)),
    )  # fmt: skip
    scene = rig.scene()
    payload = replace(scene.payloads[0], rising=Rising(drag_area_m2=1.0, added_mass_kg=100.0))
    twin = Twin(replace(scene, payloads=(payload,)))
    for snapshot in march(twin, still, 20.0, every=1000, speeds=[(0.0, speed)]):
        last = snapshot
    assert last.payload_velocity_m_per_s[2] == pytest.approx(-speed, abs=1e-3)
    return last.tension_payload_n


def test_tension_of_steady_lowering_and_hauling() -> None:
    """Static tension plus ½·ρ·CdA·w² with the area of that direction, blended at 1 m/s."""
    share = 1.0 / math.sqrt(1.0 + 0.05**2)
    sinking, rising = (0.5 * 1025.0 * (2.5 + sign * 1.5 * share) for sign in (1.0, -1.0))
    at_rest = towed(0.0)
    assert at_rest - towed(1.0) == pytest.approx(sinking, rel=2e-3)
    assert towed(-1.0) - at_rest == pytest.approx(rising, rel=5e-3)


def hauled(text: str, folder: Path) -> list[RopeSnapshot]:
    """Ropes after 12 s in which every winch hauls at 0.8 m/s."""
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    scene = load_scene(str(path))
    twin = Twin(scene)
    for name in winches_by_name(scene):
        assert twin.submit_speed(0, -0.8, name) == ""
    twin.advance(round(12.0 / twin.step_s))
    return list(ropes_of(twin.snapshot()))


SET = (
    "{{name: {name}, mass_kg: 4000.0, displaced_volume_m3: 0.5, added_mass_kg: [900.0, 900.0, "
    "2000.0], drag_area_m2: [2.0, 2.0, 4.0]{rising}}}\n"
)
RISES = ", rising: {drag_area_m2: 1.0, added_mass_kg: 500.0}"
WINCH = (
    "{speed_limit_m_per_s: 1.0, acceleration_limit_m_per_s2: 0.4, min_line_out_m: 20.0, "
    "max_line_out_m: 120.0}"
)
ROPE = "rope: steel_wire_40mm, elements: 12, damping: {newton_seconds: 1.0e+5}"
LISTED = (
    "effects:\n  - weight: {}\n  - drag: {normal: 1.2, tangential: 0.02}\n  - payload: {}\n"
    "time: {step_s: 0.02, newton_tolerance_n: 0.01}\n"
)


def lone(rising: str, length_m: float) -> str:
    return (
        "about: x\nsource: x\nlook_at: x\nropes:\n"
        f"  - {{name: a, {ROPE}, length_m: {length_m}, to: x}}\n"
        f"payloads:\n  - {SET.format(name='x', rising=rising)}winch: {WINCH}\n{LISTED}"
    )


@pytest.mark.long
def test_separate_two_way_payloads_rise_independently(tmp_path: Path) -> None:
    """One that differs in ascent, and one that does not, in one scene."""
    both = hauled(
        "about: x\nsource: x\nlook_at: x\nropes:\n"
        f"  - {{name: a, {ROPE}, length_m: 80.0, to: x}}\n"
        f"  - {{name: b, {ROPE}, length_m: 70.0, from: stern, to: y}}\n"
        f"payloads:\n  - {SET.format(name='x', rising='')}  - {SET.format(name='y', rising=RISES)}"
        f"hang_offs: [{{name: stern, at_m: [-30.0, 0.0, 0.0], winch: {WINCH}}}]\n"
        f"winch: {WINCH}\n{LISTED}",
        tmp_path,
    )
    differs, same = (hauled(lone(rising, 70.0), tmp_path)[0] for rising in (RISES, ""))
    (other,) = hauled(lone("", 80.0), tmp_path)
    assert both[1].tension_top_n == pytest.approx(differs.tension_top_n, rel=1e-6)
    assert both[0].tension_top_n == pytest.approx(other.tension_top_n, rel=1e-6)
    assert abs(same.tension_top_n - differs.tension_top_n) > 500.0


@pytest.mark.long
def test_a_two_way_payload_in_lanes_equals_a_single_twin() -> None:
    """To the bit; half a minute, nearly all of it to compile: `pytest -m long` on this file."""
    scene = replace(splashing(), effects=())
    scene = replace(load_scene("still_water"), payloads=scene.payloads, sea_state=SeaState(
        heave=RegularHeave(amplitude_m=2.0, period_s=7.0)))  # fmt: skip
    masses = [read_axis("", f"payloads[0].mass_kg=18e3..22e3:{LANES}")]
    own = variations(scene, make_plan(masses, None, 1), 20.0)
    together, alone = Ensemble(scene, own), Ensemble(scene, own, max_lanes=1)
    assert together.lanes().members == LANES
    for ensemble in (together, alone):
        ensemble.advance(20.0)
    assert together.figures() == alone.figures()


def test_grab_coefficients_by_hoerners_hemispheres() -> None:
    open_one = Grab(width_m=2.0, length_m=3.0, height_m=1.5, solid_m3=0.8)
    full = replace(open_one, closed=True, solid_m3=4.0)
    assert open_one.drag_area_m2()[2] == pytest.approx(1.42 * 6.0)
    assert open_one.rising_drag_area_m2() == pytest.approx(0.38 * 6.0)
    assert (full.drag_area_m2()[2], full.rising_drag_area_m2()) == pytest.approx((2.52, 7.02))
    held = open_one.added_mass_m3()[2] - full.added_mass_m3()[2]
    assert held == pytest.approx(math.pi / 6.0 * 9.0)
    assert "more than its outline" in (replace(full, solid_m3=9.5).check() or "")
    computed = payload_figures(PayloadScene(name="grab", mass_kg=6e3, shape=open_one), 1025.0)
    assert computed.differs_rising
    assert computed.rising_added_mass_kg == computed.added_mass_kg[2]
    reported = PayloadScene(name="grab", mass_kg=6e3, shape=open_one, drag_area_m2=(1.0, 1.0, 2.0))
    assert not payload_figures(reported, 1025.0).differs_rising


def test_invalid_ascent_coefficients_are_rejected() -> None:
    assert "no value is given" in (Rising().check() or "")
    scene = splashing()
    ((where, what, right),) = faults(scene)
    assert where == "payloads[0]"
    assert what == "'module' has different properties in ascent and descent"
    assert right.startswith("remove `splash_zone`")


def splashing() -> Scene:
    scene = load_scene("splash_zone")
    payload = replace(scene.payloads[0], rising=Rising(drag_area_m2=1.0))
    return replace(scene, payloads=(payload,))
