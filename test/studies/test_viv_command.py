"""`rope_twin viv`: what it tells of a scene is what its response in modes did."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from rope_twin import load_scene
from rope_twin.cli import main
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import SceneError
from rope_twin.studies.modes import find_modes
from rope_twin.studies.viv_frequency_domain import (
    chosen_places,
    count_fatigue,
    run_frequency_domain,
    span_of,
)
from rope_twin.vortex.fatigue import CURVES, StressCurve, pipe_area
from rope_twin.vortex.modes import ModeSearch
from rope_twin.vortex.shedding import Shedding

PICTURES = {"current.png", "modes.png", "along.png", "motion.png", "spectra.png"}
TABLES = {"along.parquet", "modes.parquet", "motion.parquet"}


def test_a_scene_and_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Summary, pictures and tables agree with each other."""
    folder = tmp_path / "viv"
    assert main(["viv", "deep_lift", "--duration", "40", "--out", str(folder), "--json"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert {path.name for path in folder.iterdir()} == PICTURES | TABLES
    along = pyarrow.parquet.read_table(folder / "along.parquet").to_pydict()
    modes = pyarrow.parquet.read_table(folder / "modes.parquet").to_pydict()
    motion = pyarrow.parquet.read_table(folder / "motion.parquet").to_pydict()
    assert max(along["rms_diameters"]) == pytest.approx(reported["rms_max_diameters"])
    assert max(along["strain_rms"]) == pytest.approx(reported["strain_rms_max"], rel=1e-3)
    assert max(along["strouhal_hz"]) == pytest.approx(reported["strouhal_max_hz"])
    assert reported["modes_known"] == len(modes["mode"])
    by_rms = [modes["rms_diameters"][row["mode"] - 1] for row in reported["modes"]]
    assert by_rms == [row["rms_diameters"] for row in reported["modes"]]
    names = [name for name in motion if name != "time_s"]
    assert np.all(np.array([motion[name] for name in names]).std(axis=1) <= max(
        along["rms_diameters"]) * 1.0001)  # fmt: skip
    assert motion["time_s"][-1] == pytest.approx(40.0, abs=0.1)
    # those that move, from the lowest up, and no other
    moved = np.array(modes["rms_diameters"])
    assert min(by_rms) > 0.01 * moved.max()
    assert {row["mode"] - 1 for row in reported["modes"]} == set(np.argsort(-moved)[: len(by_rms)])
    assert reported["rms_second_over_first_half"] == pytest.approx(1.0, abs=0.1)
    # a rope in at most 0.5 m/s, at its hang-off: the top of the current's Strouhal frequency
    assert reported["strouhal_max_hz"] == pytest.approx(0.17 * 0.5 / 0.032, rel=0.01)
    assert main(["modes", "deep_lift", "--count", "3", "--json"]) == 0
    of_modes = json.loads(capsys.readouterr().out)
    assert of_modes["strouhal_max_hz"] == pytest.approx(reported["strouhal_max_hz"], rel=1e-12)


def test_a_run_that_is_too_short_to_settle_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    """From rest, the response after 5 s is half of the steady one."""
    assert main(["viv", "deep_lift", "--duration", "5"]) == 0
    assert "not settled: the rms of the second half of the time that counts is 1.3 times" in (
        capsys.readouterr().out
    )
    assert main(["viv", "deep_lift", "--duration", "100"]) == 0
    assert "not settled" not in capsys.readouterr().out


def test_statistics_of_a_run() -> None:
    """rms by the modes' covariance is that of the motion; damage needs steel or a pipe."""
    scene = load_scene("deep_lift")
    run = run_frequency_domain(span_of(scene), Shedding(), 40.0)
    np.testing.assert_allclose(run.rms(), run.motion().std(axis=0), atol=1e-9)
    frequency, power = run.spectra(chosen_places(run, 5))
    assert power.shape == (len(frequency), 5)
    curve = CURVES["stranded_wire"]
    assert isinstance(curve, StressCurve)
    fatigue = count_fatigue(run, scene, curve)
    # a mode bends by its wave number squared: stress of all modes, worst place
    span = run.response.span
    number = 2.0 * np.pi * run.response.frequency / np.sqrt(span.tension.min() / span.mass.max())
    rope = scene.ropes[0].made_of[0].rope
    modulus = rope.tangent_n(0.0) / (rope.mass_kg_per_m / 7850.0)
    most = modulus * 0.5 * rope.diameter_m * np.abs(number**2 @ np.sqrt(np.diag(run.covariance)))
    assert 0.0 < np.nanmax(fatigue.stress_rms_pa) < most
    np.testing.assert_allclose(fatigue.stress_rms_pa, modulus * fatigue.strain_rms, rtol=1e-12)
    assert (fatigue.damage_per_year >= 0.0).all()


def test_span_of_a_scene_has_its_frequencies() -> None:
    """Out-of-plane modes of `rope_twin modes` about the same rest, in a current that does not turn.

    Where it turns with depth, the rope lies in no plane and its slowest swings differ by some
    per cent.
    """
    scene = load_scene("deep_lift")
    straight = CurrentParams(profile=((0.0, (0.5, 0.0)), (-3000.0, (0.1, 0.0))))
    effects = [straight if isinstance(p, CurrentParams) else p for p in scene.effects]
    scene = replace(scene, effects=tuple(effects))
    theirs = [m.frequency_hz for m in find_modes(scene, 12).lowest if m.kind == "out-of-plane"]
    ours = ModeSearch(span_of(scene).span, 0.3).found().frequency
    np.testing.assert_allclose(ours[: len(theirs)], theirs, rtol=2e-3)


def test_no_current_no_vortices() -> None:
    with pytest.raises(SceneError, match="no current, so no vortices"):
        span_of(replace(load_scene("deep_lift"), effects=()))


@pytest.mark.parametrize(
    "words",
    [
        ["--duration", "0"],
        ["--strouhal", "2"],
        ["--damping", "-1"],
        ["--fatigue", "six_strand_tension"],
    ],
)
def test_bad_options_are_one_sentence(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["viv", "deep_lift", *words]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_the_curves_that_are_reported_are_those_of_stress(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """In the help, and where one is named that there is not."""
    names = "spiral_wire, stranded_wire"
    with pytest.raises(SystemExit):
        main(["viv", "--help"])
    assert f"S-N curve of stress: {names}" in " ".join(capsys.readouterr().out.split())
    assert main(["viv", "curved_pipe", "--fatigue", "copper"]) == 1
    assert capsys.readouterr().err == f"--fatigue: no curve 'copper'; known: {names}.\n"
    assert main(["viv", "curved_pipe", "--fatigue", "six_strand_tension"]) == 1
    said = f"'six_strand_tension' is a curve of tension; give one of stress: {names}.\n"
    assert capsys.readouterr().err == f"--fatigue: {said}"


def testpipe_area() -> None:
    """EI/EA of a pipe gives its bore; a solid or loose section is none."""
    outer, inner, E = 0.25, 0.235, 2.05e11
    area = 0.25 * np.pi * (outer**2 - inner**2)
    EI = E * np.pi / 64.0 * (outer**4 - inner**4)
    assert pipe_area(EI, E * area, outer) == pytest.approx(area)
    assert pipe_area(0.0, 1e8, outer) == 0.0
