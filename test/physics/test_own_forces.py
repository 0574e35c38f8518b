"""A user's force table: reading, refusals, and the motion that it causes."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scene_text import GOOD, assert_refused, written

from rope_twin.effects.coupled_vibration import CustomForceTable, DecomposedForceParams
from rope_twin.scene.convergence import scene_digest
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import strouhal_number
from rope_twin.vortex.coupled import decomposed_of
from rope_twin.vortex.decomposed_response import DecomposedResponse
from rope_twin.vortex.line_model import Span
from rope_twin.vortex.power_in import ExcitationSearch

L, D, T, M, EI = 90.0, 0.03, 3700.0, 2.268, 3640.0
DENSITY, ZETA, SPEED = 1025.0, 0.04, 0.4
HEAD = "frequency,amplitude,C_Lv,C_a\n"


def grid(f: Any = (0.1, 0.18, 0.3), a: Any = (0.0, 0.5, 1.0), **given: Any) -> str:
    """Table with C_Lv 0.6 at mid band up to the second last amplitude, else -0.2; C_a 1.

    given: by name of a column, (frequency, amplitude, value) to put in.
    """
    text = HEAD
    for x in f:
        for y in a:
            cells = {"C_Lv": 0.6 if x == f[1] and y < a[-1] else -0.2, "C_a": 1.0}
            for name, (at, beside, value) in given.items():
                if (x, y) == (at, beside):
                    cells[name] = value
            text += f"{x},{y},{cells['C_Lv']},{cells['C_a']}\n"
    return text


def text_of(keys: str) -> str:
    """The good scene with this effect."""
    return GOOD.replace("  - weight: {}\n", f"  - weight: {{}}\n  - decomposed_force: {keys}\n")


def params_of(scene: Scene) -> DecomposedForceParams:
    computed = scene.listed(DecomposedForceParams)
    assert computed is not None
    return computed


NOT_THERE = "{table: {path: ./no.csv}}"
BESIDE = "{table: {path: forces.csv}}"
AT = "effects[4].decomposed_force.table"
BROKEN: dict[str, tuple[str, str, str, tuple[str, ...]]] = {
    "no file": (NOT_THERE, "", AT, ("no.csv: there is no such file", "give the path of a table")),
    "no name": ("{table: {path: fited_forces}}", "", AT, ("did you mean 'fitted_forces'?",)),
    "a column less": (BESIDE, "frequency,amplitude,C_Lv\n0.1,0,1\n", AT,
                      ("there is no column C_a", "must name frequency, amplitude, C_Lv, C_a")),
    "no number": (BESIDE, grid().replace("0.18,0.5,0.6", "0.18,0.5,nan"), AT,
                  ("forces.csv, line 6: 'nan'", "give a finite number")),
    "one frequency": (BESIDE, grid(f=(0.1,) * 3), AT, ("one value of frequency", "two or more")),
    "a row less": (BESIDE, grid().replace("0.18,0.5,0.6,1.0\n", ""), AT,
                   ("8 rows of 3 frequency and 3 amplitude",
                    "9 rows, frequency 0.18 with amplitude 0.5 is missing")),
    "a row twice": (BESIDE, grid(f=(0.1, 0.18, 0.18)), AT,
                    ("frequency 0.18 with amplitude 0 is double",)),
    "a frequency in rad/s": (BESIDE, grid(f=(0.6, 1.1, 6.0)), AT,
                             ("frequency is 6", "give 0.01 to 2")),
    "a negative amplitude": (BESIDE, grid(a=(-0.5, 0.5, 1.0)), AT,
                             ("amplitude is -0.5", "give 0 to 3")),
    "a force in newtons": (BESIDE, grid(C_Lv=(0.18, 0.5, 60.0)), AT,
                           ("C_Lv at frequency 0.18, amplitude 0.5 is 60", "give -20 to 5")),
    "an added mass in kg": (BESIDE, grid(C_a=(0.3, 1.0, 500.0)), AT,
                            ("C_a at frequency 0.3, amplitude 1 is 500", "give -5 to 10")),
    "the other sign": (BESIDE, grid().replace(",0.6,", ",-0.6,"), AT,
                       ("C_Lv is nowhere positive", "positive where it excites")),
    "no limit": (BESIDE, grid(C_Lv=(0.18, 1.0, 0.3)), AT,
                 ("C_Lv is still 0.3 at frequency 0.18, amplitude 1", "limits the motion")),
    "compared beyond": ("{table: {path: forces.csv, power_amplitude: 1.5}}", grid(), AT,
                        ("power_amplitude 1.5 is outside the table's 0 to 1",)),
    "compared where nothing is": (
        "{table: {path: forces.csv, power_amplitude: 1.0}}", grid(), AT,
        ("nowhere positive at power_amplitude 1", "an amplitude that is excited")),
    "band beyond": ("{table: {path: forces.csv, band: [0.15, 0.4]}}", grid(), AT,
                    ("band from 0.15 to 0.4", "of the table's 0.1 to 0.3")),
    "band upside down": ("{table: {path: forces.csv, band: [0.2, 0.15]}}", grid(), AT,
                         ("band from 0.2 to 0.15", "two ascending frequencies")),
    "centre beyond": ("{table: {path: forces.csv, centre: 0.25, band: [0.15, 0.2]}}", grid(), AT,
                      ("centre 0.25 is outside the band of 0.15 to 0.2",)),
    "two bands": ("{band: [0.1, 0.2], table: {path: forces.csv}}", grid(),
                  "effects[4].decomposed_force", ("`band` is given beside `table`",)),
}  # fmt: skip


@pytest.mark.parametrize("fault", BROKEN)
def test_invalid_force_tables_are_rejected(fault: str, tmp_path: Path) -> None:
    keys, table, position, words = BROKEN[fault]
    (tmp_path / "forces.csv").write_text(table)
    assert_refused(text_of(keys), position, words, tmp_path)


def test_a_force_table_file_and_its_power_in_band(tmp_path: Path) -> None:
    """Zeros of the straight lines 0.6 to -0.2 at half D; read again once the file has changed."""
    (tmp_path / "forces.csv").write_text(grid())
    scene = load_scene(written(tmp_path, text_of(BESIDE)))
    own = params_of(scene).table
    assert own is not None
    assert own.path == str(tmp_path / "forces.csv")
    computed = own.figures()
    assert computed.band == pytest.approx((0.1 + 0.08 * 0.25, 0.18 + 0.12 * 0.75))
    assert (computed.centre, computed.amplitude) == (0.18, 0.5)
    assert strouhal_number(scene) == 0.18
    (tmp_path / "forces.csv").write_text(grid(f=(0.1, 0.2, 0.3)) + "# changed\n")
    assert own.figures().centre == 0.2
    given = replace(own, band=(0.13, 0.22), centre=0.15, power_amplitude=0.25)
    assert given.figures()[1:] == ((0.13, 0.22), 0.15, 0.25)


def test_the_digest_depends_on_table_content_not_path(tmp_path: Path) -> None:
    """Scenes without a table keep their digest; one with it has another where its table changes."""
    assert "table" not in repr(DecomposedForceParams())
    digests = []
    for folder, table in (("one", grid()), ("two", grid()), ("two", grid(a=(0.0, 0.5, 1.1)))):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / "forces.csv").write_text(table)
        digests.append(scene_digest(load_scene(written(tmp_path / folder, text_of(BESIDE)))))
    assert digests[0] == digests[1] != digests[2]


def riser(speed: float = SPEED, n: int = 180) -> Span:
    s, same = np.linspace(0.0, L, n + 1), np.ones(n + 1)
    return Span(s, T * same[1:], M * same[1:], D * same, speed * same, EI)


def test_the_default_table_given_explicitly_changes_nothing() -> None:
    """Band 0.125 to 0.2, centre 0.17: the zeros and the largest value of that table, to the bit."""
    own = DecomposedForceParams(table=CustomForceTable(path="fitted_forces"))
    models = [decomposed_of(params, DENSITY) for params in (own, DecomposedForceParams())]
    assert models[0].band == models[1].band
    assert models[0].centre == models[1].centre
    responses = [DecomposedResponse(riser(), model) for model in models]
    for response in responses:
        response.advance(2.0)
    assert np.array_equal(*(response.motion for response in responses))
    assert np.abs(responses[0].motion).max() > 0.01 * D


def test_steady_amplitude_by_a_tabulated_lift(tmp_path: Path) -> None:
    """C_Lv 0.25 below 1.5 D: the steady riser moves by F/(2·m·ω²·ζ), F = 4/π·½·C_Lv·ρ·D·U²."""
    lift, knots = 0.25, (0.05, 0.051, 0.399, 0.4)
    rows = [(f, a, lift if 0.05 < f < 0.4 and a < 2.0 else 0.0)
            for f in knots for a in (0.0, 1.5, 2.0)]  # fmt: skip
    path = tmp_path / "flat.csv"
    path.write_text(HEAD + "".join(f"{f},{a},{value},1.0\n" for f, a, value in rows))
    table = CustomForceTable(path=str(path), band=(0.1, 0.3))
    assert table.check() is None
    params = DecomposedForceParams(table=table, damping_fraction=ZETA)
    span, model = riser(), decomposed_of(params, DENSITY)
    actual = ExcitationSearch(span, model).found()
    k = actual.dominant - 1
    omega, water = 2.0 * pi * actual.frequency[k], DENSITY * 0.25 * pi * D**2
    push = 0.5 * lift * DENSITY * D * SPEED**2 * 4.0 / pi
    expected = push / (2.0 * ZETA * omega**2 * (M + water))
    assert 0.1 * D < expected < 1.4 * D
    response = DecomposedResponse(span, model)
    count = int(40.0 / response.step_s)
    motion = np.zeros((count, len(span.s)))
    for row in range(count):
        response.advance(response.step_s)
        motion[row] = response.motion
    amplitude = np.sqrt(2.0) * motion[count // 2 :].std(axis=0)
    antinode = np.abs(actual.modes.shape[:, k]) > 0.999
    np.testing.assert_allclose(amplitude[antinode], expected, rtol=0.02)
