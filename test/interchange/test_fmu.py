"""FMU of a scene, run by FMPy against a twin with the same motion."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

from rope_twin.cli import main
from rope_twin.errors import InputError
from rope_twin.interchange.fmu import (
    INPUTS,
    LOWER_INPUTS,
    OUTPUTS,
    SceneModel,
    export_fmu,
    inputs_of,
    outputs_of,
)
from rope_twin.scene.load import load_scene
from rope_twin.studies.driven_twin import march
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin

AMPLITUDE_M, OMEGA = 0.3, 2.0 * math.pi / 6.0
STEP_S, SECONDS = 0.02, 4.0
SPEED = 0.2  # of the winch, from 2 s on


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the FMU of a shallow lift."""
    path = tmp_path_factory.mktemp("fmu") / "shallow_lift.fmu"
    export_fmu("shallow_lift", path)
    return path


def heave(time: float) -> tuple[float, float]:
    """Return height and speed of the hang-off."""
    return AMPLITUDE_M * math.sin(OMEGA * time), AMPLITUDE_M * OMEGA * math.cos(OMEGA * time)


@pytest.fixture(scope="module")
def right() -> list[Snapshot]:
    """Return snapshots of a twin with the exact motion."""
    twin = Twin(load_scene("shallow_lift"))
    every = round(STEP_S / twin.step_s)
    speeds = ((0.0, 0.0), (2.0, SPEED))
    return list(march(twin, heave, SECONDS, every, speeds))


def test_fmpy_accepts_it(fmu: Path) -> None:
    """The model description is valid FMI 3.0."""
    validation = pytest.importorskip("fmpy.validation")
    assert validation.validate_fmu(str(fmu)) == []
    described = pytest.importorskip("fmpy").read_model_description(str(fmu))
    assert described.fmiVersion == "3.0"
    causes = {one.name: one.causality for one in described.modelVariables}
    assert {name for name, cause in causes.items() if cause == "input"} == set(INPUTS)
    assert {name for name, cause in causes.items() if cause == "output"} == set(OUTPUTS)


def test_every_variable_has_its_si_unit(fmu: Path) -> None:
    """Units are declared with their exponents, so that an importer can check what it connects."""
    described = pytest.importorskip("fmpy").read_model_description(str(fmu))
    units = {one.name: one.unit for one in described.modelVariables}
    assert set(units) == {"time", *INPUTS, *OUTPUTS}
    assert units["time"] == "s"
    assert {name for name, unit in units.items() if unit == "N"} == {
        "hook_force_x_n", "hook_force_y_n", "hook_force_z_n", "hook_load_n", "payload_tension_n",
        "min_tension_n",
    }  # fmt: skip
    assert (units["tip_x_m"], units["line_out_m"], units["payload_z_m"]) == ("m", "m", "m")
    assert (units["tip_vz_m_per_s"], units["winch_speed_m_per_s"]) == ("m/s", "m/s")
    assert units["tip_az_m_per_s2"] == "m/s2"
    base = {one.name: one.baseUnit for one in described.unitDefinitions}
    newton = base["N"]
    assert (newton.kg, newton.m, newton.s, newton.factor) == (1, 1, -2, 1.0)
    assert (base["m/s2"].m, base["m/s2"].s) == (1, -2)


@pytest.mark.parametrize(("derivatives", "within"), [(2, 2e-5), (1, 1e-3)])
def test_run_by_fmpy_is_that_of_the_twin(
    fmu: Path, right: list[Snapshot], derivatives: int, within: float
) -> None:
    """Hook load, payload and line out; with velocity alone less exact than with acceleration."""
    fmpy = pytest.importorskip("fmpy")
    time = np.arange(round(SECONDS / STEP_S) + 1) * STEP_S
    names = ["time", *INPUTS]
    signals = np.zeros(len(time), dtype=[(name, float) for name in names])
    signals["time"] = time
    wave = AMPLITUDE_M * np.exp(1j * (OMEGA * time - 0.5 * math.pi))
    keys = ("tip_z_m", "tip_vz_m_per_s", "tip_az_m_per_s2")[: derivatives + 1]
    for order, key in enumerate(keys):
        signals[key] = (wave * (1j * OMEGA) ** order).real
    signals["winch_speed_m_per_s"] = np.where(time >= 2.0 - 1e-9, SPEED, 0.0)
    found = fmpy.simulate_fmu(
        str(fmu), stop_time=SECONDS, step_size=STEP_S, output_interval=STEP_S, input=signals
    )[1:]
    assert len(found) == len(right)
    hook = np.array([snapshot.tension_top_n for snapshot in right])
    assert np.abs(found["hook_load_n"] - hook).max() < within * hook.mean()
    assert np.abs(found["hook_load_n"] - hook).max() < 0.1 * np.ptp(hook)
    depth = np.array([snapshot.payload_position_m[2] for snapshot in right])
    assert found["payload_z_m"] == pytest.approx(depth, abs=1e-3)
    line = np.array([snapshot.line_out_m for snapshot in right])
    assert found["line_out_m"] == pytest.approx(line, abs=1e-6)
    assert line[-1] - line[0] > 0.2


def test_tip_may_rest() -> None:
    """Inputs are left at their starts for 3 s, then the tip rises by 0.3 m in 2 s and rests."""
    path = load_scene("shallow_lift").path
    model = SceneModel(str(path.parent), path.name)
    still, step_s, rise = dict.fromkeys(INPUTS, 0.0), 0.1, 0.5 * math.pi
    depth, at_rest = model.outputs()["payload_z_m"], model.outputs()["hook_load_n"]
    for step in range(100):
        time = step * step_s
        turn, moves = rise * min(max(time - 3.0, 0.0), 2.0), 3.0 <= time < 5.0
        tip = {
            "tip_z_m": 0.15 * (1.0 - math.cos(turn)),
            "tip_vz_m_per_s": 0.15 * rise * math.sin(turn) * moves,
            "tip_az_m_per_s2": 0.15 * rise**2 * math.cos(turn) * moves,
        }
        model.step(still | tip, time, step_s)
        if step == 29:
            assert model.outputs()["hook_load_n"] == pytest.approx(at_rest, rel=1e-4)
    assert model.outputs()["payload_z_m"] == pytest.approx(depth + 0.3, abs=0.05)


def test_lower_end_is_an_input_where_the_scene_leaves_it_so(tmp_path: Path) -> None:
    """An ROV on a tether, moved through the model: the force is that of a twin with its motion."""
    text = load_scene("rov_tether").path.read_text()
    text = text.replace("-860.0]", "-860.0]\n    end_motion: {from_outside: true}")
    text = text.replace("sea_state: {bag: sea_2p5m}\n", "").replace("elements: 50", "elements: 10")
    (tmp_path / "led.yaml").write_text(text)
    scene = load_scene(tmp_path / "led.yaml")
    assert set(inputs_of(scene)) - set(INPUTS) == set(LOWER_INPUTS)
    model, twin = SceneModel(str(tmp_path), "led.yaml"), Twin(scene)
    twin.prescribe_motion()
    twin.submit_speed(0, 0.0)
    still, place = dict.fromkeys(inputs_of(scene), 0.0), scene.ropes[0].fixed_at_m
    assert place is not None
    for step in range(100):
        time, then = STEP_S * step, STEP_S * (step + 1)
        x, v, a = 0.1 * time**3, 0.3 * time**2, 0.6 * time
        model.step(still | {"low_x_m": x, "low_vx_m_per_s": v, "low_ax_m_per_s2": a}, time, STEP_S)
        moved = x + STEP_S * (v + 0.5 * STEP_S * a)
        at = (place[0] + moved, *place[1:])
        assert twin.submit_lower_end(round(then * 1e9), at, (v + STEP_S * a, 0.0, 0.0)) == ""
        twin.advance(round(STEP_S / twin.step_s))
        found = model.outputs()
        right = twin.snapshot().lower_end_force_n
        assert [found[f"low_force_{axis}_n"] for axis in "xyz"] == pytest.approx(right, rel=1e-8)
    assert found["payload_x_m"] - place[0] == pytest.approx(0.1 * 2.0**3, rel=0.01)
    assert set(found) == set(outputs_of(scene))
    if importlib.util.find_spec("fmpy") and importlib.util.find_spec("pythonfmu3"):
        import fmpy

        export_fmu(str(tmp_path / "led.yaml"), tmp_path / "led.fmu")
        described = fmpy.read_model_description(str(tmp_path / "led.fmu"))
        assert {one.name for one in described.modelVariables} >= {"low_x_m", "low_force_z_n"}


def test_steps_that_do_not_fit() -> None:
    """Parts of a time step, gaps and impossible motion are refused in one sentence."""
    path = load_scene("shallow_lift").path
    still = dict.fromkeys(INPUTS, 0.0)

    def model() -> SceneModel:
        return SceneModel(str(path.parent), path.name)

    with pytest.raises(
        InputError, match=r"a communication step of 0\.015 s; give a multiple of the"
    ):
        model().step(still, 0.0, 0.015)
    with pytest.raises(InputError, match="a step from 5 s, where the twin is at 0 s; step without"):
        model().step(still, 5.0, 0.02)
    with pytest.raises(InputError, match="m above its rest; a ship stays within"):
        model().step(still | {"tip_z_m": 1e3}, 0.0, 0.02)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["deep_lift", "--fmu", "--out", "deep.zip"], "no name of an FMU; give a name of letters"),
        (["deep_lift", "--fmu", "--out", "a b.fmu"], "no name of an FMU"),
        (["bridle_lift", "--fmu", "--out", "b.fmu"], "the ropes of 'bridle_lift' meet; give"),
        (["deep_lift", "--out", "b.fmu"], "no format is named; give --moordyn or --fmu"),
        (["deep_lift", "--fmu", "--moordyn", "--out", "b.fmu"], "two formats are named"),
    ],
)  # fmt: skip
def test_wrong_exports(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    """One sentence each."""
    assert main(["scene", "export", *words]) == 1
    assert said in capsys.readouterr().err
