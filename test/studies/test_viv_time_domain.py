"""`rope_twin viv SCENE --time-domain` reports what the VIV model did in a run of the scene."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from rope_twin import load_scene
from rope_twin.cli import main
from rope_twin.core.state import Floats
from rope_twin.effects.coupled_vibration import ModalVibrationParams
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import InputError, SceneError
from rope_twin.scene.schema import RegularHeave, Scene, SeaState, Time
from rope_twin.studies.viv_pictures import time_domain_words
from rope_twin.studies.viv_samplers import resampled
from rope_twin.studies.viv_time_domain import (
    TimeDomainRun,
    _amplification,
    _figures,
    _worst_rms,
    run_time_domain,
    with_model,
)
from rope_twin.vortex.results import MaterialFatigue
from validation.rigs import Rig

U = 0.5
CABLE = Rig(
    length=200.0, elements=40, mass=6.4, EA=6.5e7, diameter=0.04, load=3e3, density=1025.0,
    damping=1e5, current=((0.0, (0.3, 0.0)),), drag=(1.2, 0.02), added_mass=1.0, step=0.02,
)  # fmt: skip


def relative(in_line: float, across: float) -> Floats:
    """Water less a rope that swings in and across a flow of U, over whole periods, one place."""
    angle = 2.0 * math.pi * np.arange(0.0, 10.0, 0.001)
    rows = (U - in_line * np.cos(2.0 * angle), -across * np.sin(angle), np.zeros(len(angle)))
    return np.stack(rows, axis=1)[:, :, None]


def amplified(across: Floats) -> Floats:
    return _amplification(across, np.ones(across.shape[::2]))


def test_drag_amplification_of_a_sine() -> None:
    """In line mean(|u|·u)/U² is 1 + a²/2U²; across it is the mean of √(U² + b²·sin²)/U."""
    assert amplified(relative(0.0, 0.0)) == pytest.approx(1.0)
    assert amplified(relative(0.3, 0.0)) == pytest.approx(1.0 + 0.5 * (0.3 / U) ** 2)
    sine = np.sin(2.0 * math.pi * np.arange(0.0, 1.0, 0.001))
    expected = np.sqrt(U**2 + (0.8 * sine) ** 2).mean() / U
    assert amplified(relative(0.0, 0.8)) == pytest.approx(expected)
    assert amplified(relative(0.3, 0.8) * 0.0) == pytest.approx(1.0)
    grown = np.linspace(1.5, 2.5, 10_000)[:, None]
    assert _amplification(relative(0.0, 0.0), grown) == pytest.approx(2.0)


def test_samples_of_two_intervals_are_resampled() -> None:
    """From 20 ms to 10 ms: on 10 ms all the way; equal ones stay as they are."""
    t = np.concatenate([np.arange(0.0, 1.0, 0.02), np.arange(1.0, 2.0, 0.01)])
    even, line, table = resampled(t, 3.0 * t, np.stack([t, -t], axis=1))
    assert even == pytest.approx(np.arange(0.0, 1.995, 0.01))
    assert line == pytest.approx(3.0 * even)
    assert table[:, 1] == pytest.approx(-even)
    (same,) = resampled(even)
    assert same is even


def test_the_worst_direction_of_bending() -> None:
    """Along (3, 4) with a deviation of 2, whatever is steady."""
    swing = math.sqrt(2.0) * 2.0 * np.sin(2.0 * math.pi * np.arange(0.0, 4.0, 0.01))
    bent = np.stack([7.0 + 0.6 * swing, 0.8 * swing - 1.0], axis=1)[:, :, None]
    assert _worst_rms(bent) == pytest.approx(2.0)


def test_figures_of_a_standing_wave() -> None:
    """Rice's frequency of a sine is its own, rms its amplitude over √2; damage is per year."""
    t, shape = 0.02 * np.arange(5000), np.sin(math.pi * np.linspace(0.0, 1.0, 21))
    across = np.outer(0.6 * np.sin(2.0 * math.pi * 2.0 * t), shape)
    in_line = np.outer(0.1 * np.sin(2.0 * math.pi * 4.0 * t), shape)
    below = np.linspace(0.0, 20.0, 21)
    middles = 0.5 + np.arange(20.0)
    fatigue = MaterialFatigue(
        "stranded_wire", 3600.0, middles, 20.0 - middles, 1e-6 * (20.0 - middles), True
    )
    motion = np.stack([across, in_line])
    ones = np.ones(21)
    run = TimeDomainRun(
        "s", "l", "m", 2.0, 0.02, below, t, motion, 1e4 + 0.0 * t, ones, ones, ones, fatigue
    )
    assert run.rms[0].max() == pytest.approx(0.6 / math.sqrt(2.0), rel=1e-3)
    assert run.frequency_hz[0, 10] == pytest.approx(2.0, rel=1e-3)
    assert run.frequency_hz[1, 10] == pytest.approx(4.0, rel=1e-3)
    assert run.damage_per_year[10] == pytest.approx(1e-5 * 365.25 * 24.0, rel=1e-6)
    assert run.growth == pytest.approx(1.0, abs=1e-3)
    assert "settled" not in time_domain_words(run)
    built_up = replace(run, motion=motion * np.linspace(0.5, 1.5, len(t))[:, None])
    # rms of what grows evenly from 0.5 to 1, and from 1 to 1.5: √(19/7)
    assert built_up.growth == pytest.approx(math.sqrt(19.0 / 7.0), rel=1e-2)
    assert "not settled: the rms of the second half of the time that counts is 1.6 times" in (
        time_domain_words(built_up)
    )
    assert run.vandiver[10] == pytest.approx(1.0 + 1.043 * (math.sqrt(2.0) * 0.6) ** 0.65, rel=1e-3)


def test_modulation_has_side_bands() -> None:
    """A standing half wave of 2 Hz, its size swelling by a part of itself at 1/8 Hz."""
    t, shape = 0.04 * np.arange(4000), np.sin(math.pi * np.linspace(0.0, 1.0, 31))
    ones, carrier = np.ones(31), np.sin(4.0 * math.pi * t)
    runs = []
    for part in (0.0, 0.6):
        across = np.outer(0.5 * (1.0 + part * np.sin(0.25 * math.pi * t)) * carrier, shape)
        motion = np.stack([across, np.full_like(across, np.nan)])
        runs.append(
            TimeDomainRun(
                "s", "l", "m", 2.0, 0.04, ones, t, motion, 0.0 * t, ones, ones, ones, None
            )
        )
    steady, modulated = runs
    assert steady.modulation < 0.01
    assert steady.spectrum.centre_hz == pytest.approx(2.0, abs=1e-3)
    assert modulated.spectrum.centre_hz == pytest.approx(2.0, abs=1e-3)
    # a carrier of power 1 with two side bands of (0.6/2)² each
    side = 2.0 * 0.3**2 / (1.0 + 2.0 * 0.3**2)
    assert modulated.spectrum.bandwidth_hz == pytest.approx(0.125 * math.sqrt(side), rel=0.05)
    assert modulated.modulation > 0.3


@pytest.mark.long
def test_heave_widens_the_spectrum() -> None:
    """One lift in heave and at constant tension, for 48 s: the same mean tension."""
    heave, calm = (
        run_time_domain(load_scene(name), 48.0, "stranded_wire")[0]
        for name in ("viv_in_heave", "viv_calm")
    )
    assert heave.tension_top_n.mean() == pytest.approx(calm.tension_top_n.mean(), rel=0.03)
    assert np.ptp(heave.tension_top_n) > 20e3
    assert np.ptp(calm.tension_top_n) < 2e3
    assert heave.spectrum.bandwidth_hz > 1.5 * calm.spectrum.bandwidth_hz
    assert 0.3 < calm.rms[0].max() < 1.0


def test_a_scene_without_a_model_gets_the_modal_one() -> None:
    """Its modes follow the tension; options are those of the model."""
    calm = CABLE.scene()
    heave = RegularHeave(amplitude_m=0.7, period_s=5.0)
    hove = replace(calm, sea_state=SeaState(heave=heave))
    steady, moving = (run_time_domain(scene, 40.0, "stranded_wire")[0] for scene in (calm, hove))
    assert steady.model == moving.model == "modal_vibration"
    assert not steady.in_line
    assert 0.2 < steady.rms[0].max() < 1.0
    assert np.ptp(moving.tension_top_n) > 5e3 > 100.0 > np.ptp(steady.tension_top_n)
    assert np.abs(moving.rms[0] - steady.rms[0]).max() > 0.02
    own = with_model(calm, 0.2, 0.05).listed(ModalVibrationParams)
    assert own == ModalVibrationParams(strouhal=0.2, damping_fraction=0.05)
    modal = load_scene("vortices_modal")
    assert with_model(modal) is modal
    changed = with_model(modal, damping=0.05).listed(ModalVibrationParams)
    assert changed == replace(modal.listed(ModalVibrationParams), damping_fraction=0.05)


def test_a_scene_and_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The cable at Strouhal's frequency, its motion below that of the limiter; tables agree."""
    words = [
        "viv",
        "cable_waves",
        "--time-domain",
        "--duration",
        "24",
        "--out",
        str(tmp_path),
        "--json",
    ]
    assert main(words) == 0
    printed = capsys.readouterr()
    assert "lock-in at 1.7 Hz requires elements below" in printed.err
    reported = json.loads(printed.out)
    assert {Path(path).name for path in reported["files"]} == {
        "time_along.png", "time_motion.png", "time_along.parquet", "time_motion.parquet",
    }  # fmt: skip
    assert reported["model"] == "travelling_waves"
    assert reported["frequency_there_hz"] == pytest.approx(1.7, rel=0.02), "Strouhal's"
    assert 0.02 < reported["rms_max_diameters"] < 0.72
    assert reported["steady_s"] == pytest.approx(12.0, abs=0.1)
    along = pyarrow.parquet.read_table(tmp_path / "time_along.parquet").to_pydict()
    motion = pyarrow.parquet.read_table(tmp_path / "time_motion.parquet").to_pydict()
    assert max(along["rms_diameters"]) == pytest.approx(reported["rms_max_diameters"])
    some = [np.std(motion[name]) for name in motion if name.startswith("y_over_d")]
    assert max(some) == pytest.approx(reported["rms_max_diameters"], rel=0.05)
    # a motion that small at 1.7 Hz: 2π·1.7·A against 0.2 m/s, across the flow
    rate = 2.0 * math.pi * 1.7 * 0.02 * max(along["rms_diameters"]) / 0.2
    assert 1.0 < reported["drag_amplification_max"] < math.sqrt(1.0 + rate**2) + 0.01
    assert reported["stress_rms_max_pa"] is reported["damage_per_year_max"] is None, (
        "5500 kg/m³: not steel"
    )
    assert np.isnan(along["damage_per_year"]).all()
    # strain needs no steel: d/2·k²·A of waves with k = 2π·f·√(m/T), m with the water, T at the top
    assert max(along["strain_rms"]) == pytest.approx(reported["strain_rms_max"])
    moved = 1.728 + 1025.0 * math.pi * 0.01**2
    square = (2.0 * math.pi * 1.7) ** 2 * moved / reported["tension_top_mean_n"]
    strain = 0.01 * square * 0.02 * reported["rms_max_diameters"]
    assert reported["strain_rms_max"] == pytest.approx(strain, rel=0.2)


def test_what_it_tells_does_not_hang_on_where_a_run_ends() -> None:
    """The filter's end showed 0.6 d that were none: a rope that runs on must have shaken the same.

    Forward and backward over all that both looked at, filtered motions differ by what comes after.
    """
    cable = load_scene("cable_waves")
    short, long = (run_time_domain(cable, seconds, "stranded_wire")[0] for seconds in (24.0, 33.6))
    from_s, to_s = long.time_s[0] - 1e-6, short.time_s[-1] + 1e-6
    assert (short.time_s[0], to_s) == pytest.approx((12.0, 24.0), abs=0.03), "the second half"
    early = short.motion[:, short.time_s > from_s]
    late = long.motion[:, long.time_s < to_s]
    assert np.abs(early - late).max() < 0.02 * np.abs(late).max()


@pytest.mark.long
def test_a_scene_beside_the_step_and_its_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In line its model has no motion: nothing is reported of one.

    `pytest -n 0 -m long test/studies/test_viv_time_domain.py`
    """
    words = ["viv", "vortices_modal", "--time-domain", "--duration", "10", "--out", str(tmp_path)]
    assert main(words) == 0
    printed = capsys.readouterr()
    assert "computed decoupled from the step" in printed.err
    assert "in line not in the model" in printed.out
    assert "by the model's drag amplification" in printed.out
    along = pyarrow.parquet.read_table(tmp_path / "time_along.parquet").to_pydict()
    motion = pyarrow.parquet.read_table(tmp_path / "time_motion.parquet").to_pydict()
    assert 0.05 < max(along["rms_diameters"]) < 1.0
    assert np.isnan(along["in_line_rms_diameters"]).all()
    assert not [name for name in motion if name.startswith("x_over_d")]
    some = [np.std(motion[name]) for name in motion if name.startswith("y_over_d")]
    assert max(some) == pytest.approx(max(along["rms_diameters"]), rel=0.1)
    assert (tmp_path / "time_motion.png").stat().st_size > 20_000


def test_stress_is_known_of_steel() -> None:
    """E·d/2 of a wire of 7850 kg/m³, and of the thickness that the water sees."""
    scene = load_scene("viv_calm")
    rope = scene.ropes[0].made_of[0].rope
    thick, radius, stiff = _figures(scene.ropes[0], np.array([1.0, 199.0]), 0.0)
    modulus = rope.tangent_n(0.0) / (rope.mass_kg_per_m / 7850.0)
    assert stiff == pytest.approx(0.5 * rope.diameter_m * modulus)
    assert radius == pytest.approx(0.5 * rope.diameter_m)
    assert thick == pytest.approx(rope.hydrodynamic_diameter_m)


def without(scene: Scene, kind: type) -> Scene:
    return replace(scene, effects=tuple(own for own in scene.effects if not isinstance(own, kind)))


def test_what_cannot_be_shaken_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """One sentence each, before anything is stepped."""
    cable = load_scene("cable_waves")
    with pytest.raises(SceneError, match="nothing flows, so no vortices"):
        run_time_domain(load_scene("still_water"), 60.0, "stranded_wire")
    with pytest.raises(InputError, match="its sea is not a regular heave"):
        run_time_domain(load_scene("deep_lift"), 60.0, "stranded_wire")
    with pytest.raises(SceneError, match="nothing flows, so no vortices; give 'current' a speed"):
        run_time_domain(without(cable, CurrentParams), 60.0, "stranded_wire")
    with pytest.raises(InputError, match=r"5 s are too short for vortices of 1.7 Hz; give 12 or"):
        run_time_domain(cable, 5.0, "stranded_wire")
    slow = replace(load_scene("vortices_modal"), time=Time(step_s=0.1))
    with pytest.raises(
        InputError, match=r"100 ms are 3.8 samples in a period of 2.65 Hz; give 94 ms"
    ):
        run_time_domain(slow, 60.0, "stranded_wire")
    assert main(["viv", "cable_waves", "--time-domain", "--damping", "0.1"]) == 1
    words = "the scene's own travelling_waves is not the modal model; leave them out.\n"
    assert capsys.readouterr().err == f"--strouhal, --damping: {words}"
