"""Fluid forces that build up: a time factor on each of them and on nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from effect_cases import apply, data_of, some_stage, some_work
from ramp_rigs import in_time
from rigs import Rig, march, sine, still
from shedding_rigs import HAULED
from small_scene import SMALL_SCENE

from rope_twin import load_scene
from rope_twin.core import state as rows
from rope_twin.core.loads.hooks import WATER, RampedEffects, factors_at, scales_with_ramp
from rope_twin.effects.depth_profiles import DepthProfilesParams
from rope_twin.effects.drag import Drag
from rope_twin.effects.fluid_ramp import Curve, FluidRampParams, LoadCurve
from rope_twin.effects.fluid_ramp import build as build_ramp
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.errors import SceneError
from rope_twin.messages import Level, statuses
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.twin import Twin

RIG = Rig(
    length=100.0, elements=20, mass=6.4, load=3e3, volume=0.3, density=1025.0, drag=(1.2, 0.01),
    area=(4.0,) * 3, added_mass=1.0, damping=1e5, step=0.05,
    current=((0.0, (0.6, 0.0)), (-100.0, (0.2, 0.1))),
)  # fmt: skip
TABLE = LoadCurve(over_time=((2.0, 0.5), (4.0, 1.5), (10.0, 1.0)))


def ramped(scene: Scene, **curves: LoadCurve) -> Scene:
    """Return a rig's scene with a fluid ramp, sharing one compiled step."""
    return in_time(scene, FluidRampParams(**curves))


@pytest.mark.parametrize(
    ("time", "expected"),
    [(-3.0, 0.5), (2.0, 0.5), (3.0, 1.0), (7.0, 1.25), (10.0, 1.0), (99.0, 1.0)],
)
def test_a_load_curve_is_linear_between_its_rows(time: float, expected: float) -> None:
    """Values between rows are interpolated; the ends hold beyond them."""
    ramp = build_ramp(FluidRampParams(water=TABLE), None, None)
    assert factors_at((ramp,), time)[WATER] == pytest.approx(expected, rel=1e-12)


def test_a_ramp_is_smooth() -> None:
    """From 0 to 1, 0.5 at half the time, with zero first and second derivatives at both ends."""
    ramp = build_ramp(FluidRampParams(water=LoadCurve(ramp_s=8.0)), None, None)
    at = [factors_at((ramp,), t)[WATER] for t in (-1.0, 0.0, 4.0, 8.0, 20.0)]
    assert at == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0], abs=1e-15)
    for end, side in ((0.0, 1.0), (8.0, -1.0)):
        near = factors_at((ramp,), end + side * 8e-3)[WATER]
        assert abs(near - factors_at((ramp,), end)[WATER]) == pytest.approx(1e-8, rel=2e-2)  # 10·u³


def test_the_ramp_scales_every_fluid_force_and_nothing_else() -> None:
    """R and block equal those without flow forces plus the factor times the difference."""
    names = ("weight", "added_mass", "waves", "drag", "payload", "net", "wind", "splash_zone")
    work = some_work()
    none, half, whole = (
        _loaded(names, LoadCurve(over_time=((0.0, factor),)), work) for factor in (0.0, 0.5, 1.0)
    )
    assert half == pytest.approx(0.5 * (none + whole), rel=1e-12, abs=1e-9)
    assert np.abs(whole - none).max() > 1.0
    still_water = _loaded(("weight", "added_mass"), LoadCurve(ramp_s=1e5), work)
    assert none[:, 1:] == pytest.approx(still_water[:, 1:], rel=1e-12, abs=1e-9)


def _loaded(names: tuple[str, ...], curve: LoadCurve, work: np.ndarray) -> np.ndarray:
    """Return residual and block after these effects with a ramp."""
    own = work.copy()
    effects = (*data_of(*names), build_ramp(FluidRampParams(water=curve), None, None))
    apply(effects, own, some_stage(), 0, work.shape[1] - 1)
    return own[rows.RESIDUAL : rows.BLOCK + 6, : work.shape[1] - 1]


def test_fairings_have_a_factor_of_their_own() -> None:
    """A fairing's drag is scaled by the product of both factors, the payload's by one."""
    work, seen = some_work(), []
    for names, water, own in (
        (("payload",), 1.0, None), (("payload",), 0.5, None),
        (("payload", "fairing"), 1.0, None), (("payload", "fairing"), 0.5, 0.4),
    ):  # fmt: skip
        curves = {"water": LoadCurve(over_time=((0.0, water),))}
        if own is not None:
            curves["fairings"] = LoadCurve(over_time=((0.0, own),))
        after = work.copy()
        effects = (*data_of(*names), build_ramp(FluidRampParams(**curves), None, None))
        apply(effects, after, some_stage(), 0, 1)
        seen.append(after[rows.RESIDUAL : rows.RESIDUAL + 3, 0])
    whole, half, faired, scaled = seen
    assert scaled - half == pytest.approx(0.2 * (faired - whole), rel=1e-12)


def test_a_ramped_run_starts_in_still_water_and_ends_in_the_current() -> None:
    """Straight down at t = 0; the final offset is that of the steady current; 0.5 %."""
    steady = Twin(RIG.scene()).snapshot().payload_position_m
    twin = Twin(ramped(RIG.scene(), water=LoadCurve(ramp_s=60.0)))
    assert np.abs(twin.snapshot().payload_position_m[:2]).max() < 1e-9
    for snapshot in march(twin, still, 400.0, every=400):
        last = snapshot.payload_position_m
    assert last[:2] == pytest.approx(steady[:2], rel=5e-3)
    assert np.hypot(*steady[:2]) > 0.5


@pytest.mark.long
def test_a_ramped_multi_line_system_starts_in_still_water() -> None:
    """A bridle in a current hangs plumb at a factor of 0 and drifts off as the factor grows.

    A profile of the scene's own density changes nothing: test_depth_profiles has this step too.
    """
    scene = load_scene("bridle_lift")
    density = scene.environment.water_density_kg_per_m3
    alike = DepthProfilesParams(density_kg_per_m3=((0.0, density),))
    ramp = FluidRampParams(water=LoadCurve(ramp_s=4.0))
    twin = Twin(replace(scene, effects=(*scene.effects, alike, ramp)))
    first = twin.snapshot()
    assert first.fluid_factors == (0.0, 0.0, 0.0)
    twin.advance(round(6.0 / twin.step_s))
    then = twin.snapshot()
    assert then.fluid_factors == (1.0, 1.0, 1.0)
    plumb = Twin(load_scene("bridle_lift")).snapshot()
    x = [snapshot.payload_position_m[:2] for snapshot in (first, then, plumb)]
    assert np.linalg.norm(x[1] - x[0]) > 1e-3
    assert np.linalg.norm(x[2] - x[0]) > np.linalg.norm(x[1] - x[0])


def test_a_constant_factor_equals_scaled_coefficients() -> None:
    """Half of every coefficient, to 1e-9 of the tension, after five seconds of heave."""
    half = replace(RIG, drag=(0.6, 0.005), area=(2.0,) * 3, tolerance=1e-6).scene()
    own = ramped(replace(RIG, tolerance=1e-6).scene(), water=LoadCurve(over_time=((0.0, 0.5),)))
    pulls = [
        [snapshot.tension_top_n for snapshot in march(Twin(scene), sine(0.5, 6.0), 5.0, every=10)]
        for scene in (half, own)
    ]
    assert pulls[1] == pytest.approx(pulls[0], rel=1e-9)
    assert np.ptp(pulls[0]) > 100.0


def test_the_ramp_scales_the_vortex_lift() -> None:
    """No cross-flow motion before the VIV ramp begins; afterwards there is."""
    scene = replace(HAULED, tolerance=1e-6).scene()
    scene = replace(scene, effects=(*scene.effects, StrouhalForcingParams()))
    still_until = LoadCurve(over_time=((2.0, 0.0), (3.0, 1.0)))
    across = []
    for snapshot in march(Twin(ramped(scene, vortices=still_until)), still, 8.0, every=20):
        across.append((snapshot.time_s, np.abs(snapshot.node_velocity_m_per_s[:, 1]).max()))
    early = max(speed for time, speed in across if time < 1.99)
    late = max(speed for time, speed in across if time > 5.0)
    assert early < 1e-9
    assert late > 1e-3


def test_energy_balance_during_the_ramp() -> None:
    """The balance closes to 0.1 % of the energy exchanged."""
    twin = Twin(ramped(RIG.scene(), water=LoadCurve(ramp_s=20.0)), ENERGY)
    for snapshot in march(twin, sine(0.5, 6.0), 30.0, every=100):
        balance = snapshot.energy
    assert balance is not None
    assert abs(balance.residual_j) < 1e-3 * balance.exchanged_j


def test_diagnostics_say_that_forces_are_scaled(tmp_path: Path) -> None:
    path = tmp_path / "ramp.yaml"
    own = "  - fluid_ramp: {water: {ramp_s: 2.0}}\ntime: {step"
    path.write_text(SMALL_SCENE.replace("time: {step", own))
    twin = Twin(in_time(load_scene(path)))
    twin.advance(100)
    snapshot = twin.snapshot()
    assert snapshot.fluid_factors == pytest.approx((0.5, 0.5, 0.5))
    (row,) = (one for one in statuses(snapshot, None) if one.name == "simulation: fluid ramp")
    assert row.level == Level.WARN
    assert "50% of the water's forces" in row.message
    twin.advance(100)
    (row,) = (one for one in statuses(twin.snapshot(), None) if "fluid ramp" in one.name)
    assert row.level == Level.OK


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        ("{}", "no factor is given"),
        ("{water: {}}", "no ramp_s, no over_time; give one of them"),
        ("{water: {ramp_s: 3, over_time: [[0, 0]]}}", "both ramp_s and over_time"),
        ("{water: {over_time: [[3, 0], [3, 1]]}}", "order the rows"),
        ("{water: {over_time: [[0, -0.1]]}}", "a factor of -0.1 at 0 s"),
        ("{vortices: {ramp_s: 3}}", "no VIV model is listed"),
        ("{fairings: {ramp_s: 3}}", "no fairing is listed"),
        ("{water: {ramp_s: 3}}\n  - modal_vibration: {}", "does not scale the forces of `modal_v"),
    ],
)
def test_invalid_fluid_ramps_are_rejected(tmp_path: Path, effect: str, words: str) -> None:
    path = tmp_path / "ramp.yaml"
    path.write_text(SMALL_SCENE.replace("time: {step", f"  - fluid_ramp: {effect}\ntime: {{step"))
    with pytest.raises(SceneError, match=words.replace("[", "\\[")):
        load_scene(path)


def test_a_factor_that_does_not_end_at_one_is_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "ramp.yaml"
    own = "{water: {over_time: [[0.0, 0.0], [20.0, 0.5]]}}"
    path.write_text(SMALL_SCENE.replace("time: {step", f"  - fluid_ramp: {own}\ntime: {{step"))
    reported = [line for line in sense_checks(load_scene(path)) if "fluid_ramp" in line]
    assert len(reported) == 1
    assert "the forces stay at 0.5 times their own from 20 s on" in reported[0]


def test_without_a_ramp_effects_are_not_copied() -> None:
    """Kernels get the effects themselves; with a ramp, copies."""
    built = data_of("drag", "payload"), data_of("drag", "payload", "fluid_ramp")
    plain, scaled = (
        RampedEffects([numba.typeof(effect) for effect in effects]) for effects in built
    )
    assert plain.lines == []
    assert [plain.of(i) for i in (0, 1)] == ["effects[0]", "effects[1]"]
    assert scaled.of(0) == "Drag(share_0 * effects[0].kn, share_0 * effects[0].kt)"
    assert len(scaled.lines) == 1


def test_a_scaled_field_is_declared_once() -> None:
    for kind, name in ((Drag, "kn"), (Curve, "slope")):
        with pytest.raises(ValueError, match="cannot be declared"):
            scales_with_ramp(kind, name)
