"""Implausible values are warned of, and a scene accepts a warning with a reason."""

import dataclasses
from math import pi
from pathlib import Path

import pytest
from scene_text import GOOD, STEPPED, assert_refused, spoilt, written

from rope_twin.cli import main
from rope_twin.errors import SceneError
from rope_twin.files import share_dir
from rope_twin.messages import Level, Status, statuses
from rope_twin.scene.convergence import scene_digest
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import AcceptedWarning
from rope_twin.sea.spectrum import (
    breaking_fault,
    jonswap,
    read_spectrum,
    steepness_warning,
    zero_crossing_period_s,
)
from rope_twin.twin.state import scene_properties
from rope_twin.twin.twin import Twin

PROFILE = "[[0.0, [0.5, 0.0]], [-900.0, [0.1, 0.05]]]"
FIGURES = (
    "{diameter_m: 0.04, mass_kg_per_m: 6.4, hydrodynamic_diameter_m: 0.032,"
    " axial_stiffness_n: 6.4e+7, breaking_load_n: 1.0e+6, drag_normal: 0.1}"
)

# name: (scene, start of the warning, words in it)
ODD: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "current in knots": (
        spoilt("[0.0, [0.5, 0.0]]", "[0.0, [1.8, 2.4]]"),
        "effects current.profile: ",
        ("3 m/s at z = 0 m", "2.5 m/s", "3 kn would be 1.5 m/s"),
    ),
    "current that a curve makes strong": (
        spoilt(f"profile: {PROFILE}", f"profile: {PROFILE}, over_time: [[0.0, 1.0], [60.0, -6.0]]"),
        "effects current.profile: ",
        ("3 m/s at z = 0 m",),
    ),
    "strong layers": (
        spoilt(
            f"profile: {PROFILE}",
            "layers: {upper: [2.6, 0.0], lower: [0.1, 0.0], split_z_m: -9.0, bottom_z_m: -99.0}",
        ),
        "effects current.layers: ",
        ("2.6 m/s",),
    ),
    "little drag across": (
        spoilt("normal: 1.2", "normal: 0.29"),
        "effects drag.normal: ",
        ("0.29 is below the normal drag", "1 to 1.8"),
    ),
    "much drag along": (
        spoilt("tangential: 0.02", "tangential: 0.21"),
        "effects drag.tangential: ",
        ("0.21 is too large for tangential drag", "0.01 to 0.1"),
    ),
    "a rope's own odd drag": (
        spoilt("steel_wire_40mm", FIGURES),
        "ropes[0].rope.drag_normal: ",
        ("0.1 is below the normal drag",),
    ),
}


@pytest.mark.parametrize("name", ODD)
def test_implausible_values_are_warned_of(name: str, tmp_path: Path) -> None:
    """Each was taken without a word."""
    text, start, words = ODD[name]
    (warning,) = [one for one in sense_checks(load_scene(written(tmp_path, text)))
                  if one.startswith(start)]  # fmt: skip
    assert all(word in warning for word in words)
    assert "; " in warning


@pytest.mark.parametrize(
    "text",
    [
        # a crane tip; a current and drag at the edge of what there is; chain
        spoilt("hang_off_m: [0.0, 0.0, 0.0]", "hang_off_m: [0.0, 0.0, 40.0]"),
        spoilt("[0.0, [0.5, 0.0]]", "[0.0, [2.5, 0.0]]"),
        spoilt("normal: 1.2, tangential: 0.02", "normal: 0.3, tangential: 0.2"),
        spoilt("normal: 1.2, tangential: 0.02", "normal: 2.4, tangential: 0.366"),
    ],
)
def test_usual_values_give_no_warning(text: str, tmp_path: Path) -> None:
    assert sense_checks(load_scene(written(tmp_path, text))) == []


@pytest.mark.parametrize(
    ("height", "period", "steepness"), [(30.0, 3.0, "3.2"), (12.0, 4.0, "0.7"), (5.0, 5.0, "0.19")]
)
def test_a_breaking_sea_is_rejected(
    height: float, period: float, steepness: str, tmp_path: Path
) -> None:
    sea = f"{{significant_height_m: {height}, peak_period_s: {period}}}"
    text = spoilt("  - weight: {}\n", f"  - waves: {{jonswap: {sea}}}\n  - weight: {{}}\n")
    words = (f"a steepness of {steepness}", "waves break at 0.142; give at most Hs")
    assert_refused(text, "effects.waves", words, tmp_path)
    with pytest.raises(SceneError, match=r"line 31, effects\.waves: "):
        load_scene(tmp_path / "scene.yaml")


@pytest.mark.parametrize("period", [4.0, 8.0, 11.5, 15.0])
@pytest.mark.parametrize("gamma", [1.0, 3.3, 5.0])
def test_a_sea_is_judged_by_its_steepness(period: float, gamma: float) -> None:
    """2π·Hs/(g·Tp²) is at most 1/15 up to 8 s, 1/25 from 15 s on, and 0.142 with Tz."""
    most = 9.80665 * period**2 / (2.0 * pi)
    most *= 1.0 / 15.0 - (1.0 / 15.0 - 1.0 / 25.0) * min(max((period - 8.0) / 7.0, 0.0), 1.0)
    assert steepness_warning("here", jonswap(0.99 * most, period, gamma)) == ""
    assert f"at most {most:.1f} m" in steepness_warning("here", jonswap(1.02 * most, period, gamma))
    one = jonswap(1.0, period, gamma)
    breaking = 0.142 * 9.80665 * zero_crossing_period_s(one) ** 2 / (2.0 * pi)
    assert breaking > most
    if breaking < 30.0:
        assert breaking_fault(jonswap(0.99 * breaking, period, gamma)) is None
        assert breaking_fault(jonswap(1.02 * breaking, period, gamma)) is not None


def test_zero_crossing_period_of_pierson_and_moskowitz() -> None:
    """Tz is 0.710·Tp; the spectrum's end at five times the peak makes it a little longer."""
    assert zero_crossing_period_s(jonswap(2.0, 10.0, 1.0)) == pytest.approx(7.1, rel=0.03)


def test_no_bag_is_written_of_a_breaking_sea(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Hs 30 m at Tp 3 s became a bag without a word."""
    words = ["sea-state", "make", "--seed", "1", "--duration", "60", "--out"]
    assert main([*words, str(tmp_path / "a"), "--jonswap", "30", "3"]) == 1
    message = capsys.readouterr()
    assert message.err.startswith(
        "--jonswap 30 3: Hs 30 m at a mean period Tz of 2.46 s is a steepn"
    )
    assert not list(tmp_path.iterdir())
    assert main([*words, str(tmp_path / "b"), "--jonswap", "2", "4"]) == 0
    assert "warning: --jonswap 2 4: Hs 2 m at Tp 4 s is steeper" in capsys.readouterr().err
    assert main([*words, str(tmp_path / "c"), "--jonswap", "2", "8"]) == 0
    assert capsys.readouterr().err == ""
    for path in (share_dir() / "config" / "sea_states").glob("*.csv"):
        names = path.read_text(encoding="utf-8").splitlines()[0].split(",")[1:]
        seas = [read_spectrum(path, name) for name in names]
        assert not any(breaking_fault(sea) or steepness_warning("", sea) for sea in seas)


def test_a_strong_live_current_is_accepted_with_a_warning(tmp_path: Path) -> None:
    """Its row warns as long as it is in force."""
    twin = Twin(load_scene(written(tmp_path, STEPPED)))

    def row() -> Status:
        rows = statuses(twin.snapshot(), None)
        return next(row for row in rows if row.name == "simulation: input current")

    assert twin.submit_current([[0.0, 1.8, 2.4], [-500.0, 0.0, 0.0]]) == ""
    assert row().level is Level.WARN
    assert "3 m/s at z = 0 m exceeds the range of ocean currents, 2.5 m/s" in row().message
    assert twin.submit_current([[0.0, 0.9, 1.2], [-500.0, 0.0, 0.0]]) == ""
    assert "sea currents" not in row().message


@pytest.mark.parametrize(
    "name",
    [
        # its step is compiled for nothing else of the daily tests
        pytest.param(name, marks=pytest.mark.long) if name == "net_wall" else name
        for name in scene_names()
    ],
)
def test_shipped_scenes_check_without_a_warning(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Eight of them had warnings, of a crane tip above the water among others."""
    assert main(["scene", "check", name]) == 0
    out = capsys.readouterr().out
    assert "warning: " not in out
    assert ": valid, no warnings" in out


ACCEPT = """\
accept:
  - key: ropes[0].damping
    says: no limit
    reason: codes are compared without it
"""


def test_an_accepted_warning_is_shown_as_such(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One by its place and words; an entry without a warning is a warning itself."""
    undamped = STEPPED.replace("fraction_of_first_axial_mode: 0.02", "newton_seconds: 0.0")
    path = written(tmp_path, undamped + ACCEPT)
    assert sense_checks(load_scene(path)) == []
    assert main(["scene", "check", str(path)]) == 0
    out = capsys.readouterr().out
    assert "accepted: ropes[0].damping: without damping" in out
    assert "Reason: codes are compared without it.\n" in out
    assert out.endswith(": valid, no warnings, 1 accepted\n")
    coarse = written(tmp_path, undamped.replace("elements: 50", "elements: 9") + ACCEPT)
    (left,) = sense_checks(load_scene(coarse))
    assert left.startswith("ropes[0].elements: ")
    assert main(["scene", "check", str(written(tmp_path, STEPPED + ACCEPT))]) == 0
    assert "warning: accept[0]: the scene has no warning at 'rop" in capsys.readouterr().out
    with pytest.raises(SceneError, match=r"accept\[0\]: key, says or reason is empty"):
        load_scene(written(tmp_path, GOOD + ACCEPT.replace("no limit", '""')))


def test_accepted_warnings_do_not_change_the_digest(tmp_path: Path) -> None:
    """Accuracy studies stay current, and saved states are taken."""
    entry = AcceptedWarning(key="time.step_s", says="coarse", reason="a test")
    scene = load_scene("still_water")
    accepting = dataclasses.replace(scene, accept=(entry,))
    assert scene_digest(accepting) == scene_digest(scene)
    assert scene_properties(accepting) == scene_properties(scene)
