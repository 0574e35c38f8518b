"""Scenes from OrcaFlex text files: units, ends, waves and the vessel's RAOs; nothing is lost."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rao_samples as samples

from rope_twin import Twin
from rope_twin.cli import main
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import InputError
from rope_twin.interchange import write_scene
from rope_twin.interchange.orcaflex import scene_of_model
from rope_twin.recording.motion_source import open_sea
from rope_twin.scene.environment import reference_point_m

MBL_N = 1.2e6
ENDS = "Connection, ConnectionX, ConnectionY, ConnectionZ, ConnectionAzimuth"
Model = dict[str, Any]


def model() -> Model:
    """A manifold on a crane wire of two sections, and a mooring line to an anchor."""
    found = samples.orcaflex_model(samples.box(), None, (2.5, 0.0, -1.9))
    found["Environment"] = {
        "WaterSurfaceZ": 0, "Density": 1.03, "WaterDepth": 400, "SeabedNormalStiffness": 200,
        "RefCurrentSpeed": 0.5, "RefCurrentDirection": 90, "WindSpeed": 12,
        "CurrentDepth, CurrentFactor, CurrentRotation": [[0, 1, 0], [100, 0.6], [400, 0.2, 90]],
        "WaveTrains": [
            {"Name": "Wave1", "WaveType": "JONSWAP", "WaveDirection": 150, "WaveHs": 2.5,
             "WaveTp": 9, "WaveGamma": 1.5},
            {"Name": "Swell", "WaveType": "Single Airy", "WaveDirection": 20, "WaveHeight": 0.5,
             "WavePeriod": 14},
        ],
    }  # fmt: skip
    found["LineTypes"] = [
        {"Name": "Wire", "OD": 0.0403, "ID": 0, "MassPerUnitLength": 0.0067, "EA": "84e3",
         "EI": [0, None], "Cd": [1.9, None, 0.03], "Ca": [1, None, 0], "AllowableTension": 900},
        {"Name": "Hose", "OD": 0.2, "ID": 0.1, "MassPerUnitLength": 0.05, "EA": 50e3,
         "EI": [0, None], "Cd": [1.2, None, 0.008], "NormalDragLiftDiameter": 0.25,
         "AllowableTension": None, "SeabedLateralFrictionCoefficient": 0.6},
    ]  # fmt: skip
    found["Vessels"] = [{"Name": "Vessel1", "VesselType": "Hull", "Draught": "Operating",
                         "InitialPosition": [100, 50, 0], "Orientation": [0, 0, 30]}]  # fmt: skip
    found["Lines"] = [
        {"Name": "Mooring", "ContentsDensity": 0.8, ENDS: [
            ["Anchored", 400, 90, 0.5, 0], ["Vessel1", 60, 0, -4, 0]],
         "LineType, Length, NumberOfSegments": [["Hose", 500, 50]]},
        {"Name": "Crane wire", "TopEnd": "End A", ENDS: [
            ["Vessel1", 10, -18, 24, 0], ["Manifold", 0, 0, 2, 0]],
         "LineType, Length, TargetSegmentLength": [["Wire", 200, 5], ["Hose", 40, 4]]},
    ]  # fmt: skip
    found["3DBuoys"] = [
        {"Name": "Manifold", "Mass": 20, "Volume": 4, "DragArea": [12, 12, 20], "Cd": [1.2, 1.2, 2],
         "Ca": [1, 1, 1.5]},
        {"Name": "Marker", "Mass": 0.1, "Volume": 0.2},
    ]  # fmt: skip
    found["Winches"] = [{"Name": "Tugger"}, {"Name": "Tagline"}]
    return found


def write(folder: Path, content: Model) -> Path:
    path = folder / "lowering.yml"
    path.write_text(samples.orcaflex_text(content))
    return path


def test_a_model_becomes_a_scene_in_si_units(tmp_path: Path) -> None:
    path = write(tmp_path, model())
    found = scene_of_model(path, MBL_N, tmp_path)
    scene = write_scene(found, tmp_path / "scene.yaml")
    mooring, wire = scene.ropes
    assert (wire.name, wire.from_, wire.to) == ("Crane wire", "Crane wire_top", "Manifold")
    assert mooring.fixed_at_m == (400.0, 90.0, -399.5)
    assert (mooring.length_m, mooring.elements) == (500.0, 50)
    assert (wire.length_m, wire.elements) == (240.0, 50)
    lower, upper = wire.made_of  # from the lower end up: OrcaFlex counts from End A, at the vessel
    assert (lower.length_m, upper.length_m) == (40.0, None)
    assert upper.rope.axial_stiffness_n == 84e6
    assert upper.rope.mass_kg_per_m == pytest.approx(6.7)
    assert upper.rope.breaking_load_n == 900e3
    assert lower.rope.breaking_load_n == MBL_N
    # contents of the mooring's own line alone
    bore = 800.0 * 0.25 * math.pi * 0.1**2
    assert mooring.rope is not None
    assert mooring.rope.mass_kg_per_m == pytest.approx(50.0 + bore)
    assert lower.rope.mass_kg_per_m == pytest.approx(50.0)
    drag = scene.listed(DragParams)
    assert drag is not None
    assert (drag.normal, drag.tangential) == (1.9, 0.03)
    assert lower.rope.drag_normal == pytest.approx(1.2 * 0.25 / 0.2)
    assert lower.rope.drag_tangential == pytest.approx(0.008)
    assert upper.rope.drag_normal is None
    (payload,) = scene.payloads
    assert payload.mass_kg == 20e3
    assert payload.drag_area_m2 == pytest.approx((14.4, 14.4, 40.0))
    assert payload.added_mass_kg == pytest.approx((4120.0, 4120.0, 6180.0))
    assert scene.environment.water_density_kg_per_m3 == pytest.approx(1030.0)
    bed = scene.listed(SeabedParams)
    assert bed is not None
    assert (bed.depth_m, bed.stiffness_n_per_m3, bed.friction) == (400.0, 200e3, 0.6)
    current = scene.listed(CurrentParams)
    assert current is not None
    flow = [[0.0, 0.0, 0.5, 0.0], [-100.0, 0.0, 0.3, 0.0], [-400.0, -0.1, 0.0, 0.0]]
    assert current.table == pytest.approx(np.array(flow), abs=1e-12)
    waves = scene.listed(WavesParams)
    assert waves is not None
    assert waves.jonswap is not None
    assert (waves.jonswap.significant_height_m, waves.jonswap.peak_period_s) == (2.5, 9.0)
    assert waves.heading_deg == 150.0
    assert waves.also[0].regular is not None
    assert waves.also[0].regular.height_m == 0.5
    # with a splash zone far above the manifold: the step of two_line_landing
    zone = SplashZoneParams(height_m=1.0, bottom_area_m2=1.0)
    twin = Twin(replace(scene, effects=(*scene.effects, zone)))
    assert math.isfinite(twin.snapshot().tension_top_n)


def test_a_line_type_has_the_breaking_load_given_for_it(tmp_path: Path) -> None:
    """It goes before AllowableTension; that of all others does not."""
    loads = {"Wire": 2e6, "": 3e5}
    found = scene_of_model(write(tmp_path, model()), loads, tmp_path)
    scene = write_scene(found, tmp_path / "scene.yaml")
    assert [part.rope.breaking_load_n for part in scene.ropes[1].made_of] == [3e5, 2e6]


def test_the_vessel_rides_on_the_raos_of_the_same_file(tmp_path: Path) -> None:
    """The reference point is the phase origin: hang-off less the turned arm to it."""
    content = model()
    del content["Lines"][0]
    scene = write_scene(
        scene_of_model(write(tmp_path, content), MBL_N, tmp_path), tmp_path / "scene.yaml"
    )
    riding = scene.sea_state.on_waves
    assert riding is not None
    assert riding.heading_deg == 30.0
    assert riding.crane_tip_m == (10.0, -18.0, 24.0)
    assert reference_point_m(scene) == pytest.approx((100.0, 50.0, 0.0), abs=1e-9)
    sea = open_sea(scene)
    assert sea is not None
    assert abs(sea.between(30_000_000_000, 30_000_000_001)[0].position_m) > 0.0


def test_what_has_no_equal_is_listed(tmp_path: Path) -> None:
    said = scene_of_model(write(tmp_path, model()), MBL_N, tmp_path).left_out
    expected = (
        "Winches: Tugger, Tagline", "Environment: WindSpeed", "Lines Crane wire: TopEnd",
        "3DBuoys Marker: no imported line ends at it", "its offset [0, 0, 2] m",
    )  # fmt: skip
    for words in expected:
        assert sum(words in one for one in said) == 1, words


WRONG: dict[str, tuple[Callable[[Model], Any], str]] = {
    "US units": (lambda m: m["General"].update(UnitsSystem="US"), "its UnitsSystem is US; save it"),
    "no units": (lambda m: m.pop("General"), "its UnitsSystem is not stated"),
    "a raised surface": (lambda m: m["Environment"].update(WaterSurfaceZ=5), "not at z = 0"),
    "no lines": (lambda m: m.pop("Lines"), "none of its Lines hangs from a vessel"),
    "lines are no list": (lambda m: m.update(Lines={"Name": "L"}), "Lines is not a list"),
    "unknown type": (lambda m: m["Lines"][1].update({"LineType, Length": [["Rope", 9]]})
                     or m["Lines"][1].pop("LineType, Length, TargetSegmentLength"),
                     "there is no line type 'Rope'; known: Wire, Hose"),
    "no diameter": (lambda m: m["LineTypes"][0].update(OD=0), "OD: it is 0; give a number above 0"),
    "no segment": (lambda m: m["Lines"][1].update(
        {"LineType, Length, TargetSegmentLength": [["Wire", 200, 0]]}),
                   "TargetSegmentLength: it is 0; give a number above 0"),
    "no stiffness": (lambda m: m["LineTypes"][0].pop("EA"), "EA: it is not stated"),
    "a variable EA": (lambda m: m["LineTypes"][0].update(EA="Stiffness1"), "it is 'Stiffness1'"),
    "an infinite EA": (lambda m: m["LineTypes"][0].update(EA="Infinity"), "it is 'Infinity'"),
    "two of three": (lambda m: m["LineTypes"][0].update(Cd=[1.9, 0.03]),
                     "Cd: it has 2 numbers; give 3; ~ repeats the first"),
    "no depth": (lambda m: m["Environment"].pop("WaterDepth"), "the water depth is not stated"),
    "no period": (lambda m: m["Environment"]["WaveTrains"][0].pop("WaveTp"),
                  "its peak period is not stated; add WaveTp, or WaveTz and WaveGamma"),
    "no mass": (lambda m: m["3DBuoys"][0].pop("Mass"), "Mass: it is not stated"),
    "a heavy rope": (lambda m: m["LineTypes"][0].update(MassPerUnitLength=99), "no valid scene"),
}  # fmt: skip


@pytest.mark.parametrize("fault", WRONG)
def test_a_wrong_model_is_refused_in_one_sentence(
    tmp_path: Path, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    spoil, words = WRONG[fault]
    content = model()
    spoil(content)
    path, out = write(tmp_path, content), tmp_path / "scene.yaml"
    code = main(["scene", "import", str(path), "--breaking-load", "1.2MN", "--out", str(out)])
    said = capsys.readouterr().err
    assert code == 1
    assert words in said
    assert said.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("--breaking-load 1N --out s.yaml", "--breaking-load: it is 1 N; right is 100"),
        ("--breaking-load 1MN --out s.txt", "'s.txt' is no scene; end it in .yaml"),
    ],
)
def test_wrong_options_are_refused(
    words: str, fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, model())
    assert main(["scene", "import", str(path), *words.split()]) == 1
    assert fault in capsys.readouterr().err
    assert main(["scene", "import", str(path), "--breaking-load", "1MN", "--out", str(path)]) == 1
    assert "it is the file to import" in capsys.readouterr().err


def test_json_lists_what_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = write(tmp_path, model()), tmp_path / "scene.yaml"
    words = ["scene", "import", str(path), "--breaking-load", "1.2MN", "--out", str(out), "--json"]
    assert main(words) == 0
    shown = json.loads(capsys.readouterr().out)
    assert any(one.startswith("Winches") for one in shown["left_out"])


def lines_alone(*lines: tuple[list[Any], list[Any]]) -> Model:
    """A model of these lines, by their ends, with a vessel and a buoy."""
    content = model()
    content["Lines"] = [
        {"Name": f"L{k}", ENDS: list(ends), "LineType, Length": [["Wire", 100]]}
        for k, ends in enumerate(lines)
    ]
    return content


@pytest.mark.parametrize("buoy_z", [None, -90.0])
def test_a_line_hangs_from_its_higher_end(buoy_z: float | None, tmp_path: Path) -> None:
    """Whichever end is End A: a buoy below a fixed point, and two fixed points."""
    crane, manifold = ["Fixed", 0, 0, 10], ["Manifold", 0, 0, 0]
    for ends in ((crane, manifold), (manifold, crane)):
        content = lines_alone(ends)
        if buoy_z is not None:
            content["3DBuoys"][0]["InitialPosition"] = [0, 0, buoy_z]
        keys = scene_of_model(write(tmp_path, content), MBL_N, tmp_path).scene
        assert (keys["ropes"][0]["from"], keys["ropes"][0]["to"]) == ("winch", "Manifold")
        assert keys["ship"] == {"hang_off_m": [0.0, 0.0, 10.0]}
    low = ["Fixed", 30, 0, -80]
    for ends in ((low, crane), (crane, low)):
        found = scene_of_model(write(tmp_path, lines_alone(ends)), MBL_N, tmp_path)
        scene = write_scene(found, tmp_path / "scene.yaml")
        assert scene.ship.hang_off_m == (0.0, 0.0, 10.0)
        assert scene.ropes[0].fixed_at_m == (30.0, 0.0, -80.0)
        Twin(scene)


def test_a_buoy_above_a_fixed_point_holds_its_line(tmp_path: Path) -> None:
    """The line of the vessel to the buoy, and the one from it to a fixed anchor."""
    wire = ["Vessel1", 10, -18, 24], ["Manifold", 0, 0, 0]
    anchor = ["Fixed", 60, 0, -100], ["Manifold", 0, 0, 0]
    keys = scene_of_model(write(tmp_path, lines_alone(wire, anchor)), MBL_N, tmp_path).scene
    assert [rope["from"] for rope in keys["ropes"]] == ["winch", "Manifold"]


def test_a_line_between_two_places_of_the_vessel_moves_no_other(tmp_path: Path) -> None:
    wire = ["Vessel1", 10, -18, 24], ["Manifold", 0, 0, 0]
    between = ["Vessel1", 0, 0, 5], ["Vessel1", 20, 0, 5]
    alone = scene_of_model(write(tmp_path, lines_alone(wire)), MBL_N, tmp_path)
    found = scene_of_model(write(tmp_path, lines_alone(between, wire)), MBL_N, tmp_path)
    assert found.scene["ship"] == alone.scene["ship"]
    assert [rope["from"] for rope in found.scene["ropes"]] == ["winch"]
    assert "Lines L0: both its ends are at vessels" in found.left_out


def test_a_model_held_by_anchors_alone_is_refused(tmp_path: Path) -> None:
    content = lines_alone((["Manifold", 0, 0, 0], ["Anchored", 0, 0, 0]))
    with pytest.raises(InputError, match="none of its Lines hangs from a vessel"):
        scene_of_model(write(tmp_path, content), MBL_N, tmp_path)


@pytest.mark.parametrize(
    ("section", "key", "words"),
    [
        ("Environment", "", "Environment is not an object"),
        ("General", "", "General is not an object"),
        ("Environment", "WaveTrains", "WaveTrains is not a list of objects"),
    ],
)
def test_a_section_of_another_kind_is_refused(
    section: str, key: str, words: str, tmp_path: Path
) -> None:
    """Its waves, density or units would be those of a calm sea, without a word."""
    content = model()
    if key:
        content[section][key] = content[section][key][0]
    else:
        content[section] = [content[section]]
    with pytest.raises(InputError, match=words):
        scene_of_model(write(tmp_path, content), MBL_N, tmp_path)


def test_a_spectrum_without_height_is_a_calm_sea(tmp_path: Path) -> None:
    content = model()
    del content["Lines"][0]
    content["Environment"]["WaveTrains"][0]["WaveHs"] = 0
    found = scene_of_model(write(tmp_path, content), MBL_N, tmp_path)
    waves = write_scene(found, tmp_path / "scene.yaml").listed(WavesParams)
    assert waves is not None
    assert waves.jonswap is None
    assert waves.regular is not None
    assert not waves.also
