"""Invalid RAO files are rejected in one sentence that names file and remedy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rao_samples as samples

from rope_twin.errors import InputError, SceneError
from rope_twin.files import share_dir
from rope_twin.scene.load import load_scene
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.raos import NO_CONVENTIONS, RaoConventions

Model = dict[str, Any]


def kind(model: Model) -> Model:
    found: Model = model["VesselTypes"][0]
    return found


def raos(model: Model) -> Model:
    found: Model = kind(model)["Draughts"][0]["DisplacementRAOs"]
    return found


def table(model: Model, number: int = 0) -> list[list[Any]]:
    found: list[list[Any]] = raos(model)["RAOs"][number][samples.ORCAFLEX_KEY]
    return found


ORCAFLEX: dict[str, tuple[Callable[[Model], Any], str]] = {
    "no vessel types": (lambda m: m.pop("VesselTypes"), "there is no list VesselTypes"),
    "two vessel types": (lambda m: m["VesselTypes"].append({"Name": "Other"}),
                         "2 of VesselTypes: Hull, Other; name one with `vessel`"),
    "no draughts": (lambda m: kind(m).pop("Draughts"), "there is no list Draughts"),
    "two draughts": (lambda m: kind(m)["Draughts"].append({"Name": "Light"}),
                     "2 of Draughts: Operating, Light; name one with `draught`"),
    "no displacement RAOs": (lambda m: kind(m)["Draughts"][0].pop("DisplacementRAOs"),
                             "there are no DisplacementRAOs"),
    "no lead or lag": (lambda m: kind(m).pop("RAOPhaseConvention"),
                       "the convention RAOPhaseConvention is not stated; add it"),
    "empty symmetry": (lambda m: kind(m).update(Symmetry=None),
                       "the convention Symmetry is not stated"),
    "circular": (lambda m: kind(m).update(Symmetry="Circular"),
                 "Symmetry is 'Circular'; what is read is none, xz plane"),
    "neither lead nor lag": (lambda m: kind(m).update(RAOPhaseConvention="behind"),
                             "RAOPhaseConvention is 'behind'; what is read is leads, lags"),
    "gradians": (lambda m: kind(m).update(RAOPhaseUnitsConvention="gradians"),
                 "RAOPhaseUnitsConvention is 'gradians'"),
    "per wave height": (lambda m: kind(m).update(RAOWaveUnit="height"),
                        "RAOWaveUnit is 'height'; what is read is amplitude"),
    "by wave length": (lambda m: kind(m).update(WavesReferredToBy="length (m)"),
                       "WavesReferredToBy is 'length (m)'"),
    "surge to port": (lambda m: kind(m).update(SurgePositive="port"),
                      "SurgePositive is 'port'; what is read is forward, aft"),
    "no units": (lambda m: m.pop("General"), "the unit of length is not stated"),
    "yards": (lambda m: m.update(General={"UnitsSystem": "User", "LengthUnits": "yd"}),
              "the unit of length is not stated (UnitsSystem User)"),
    "no origin": (lambda m: raos(m).pop("RAOOrigin"), "RAOOrigin is not stated"),
    "origin of two": (lambda m: raos(m).update(RAOOrigin=[0, 1]), "RAOOrigin is not three numbers"),
    "origin in words": (lambda m: raos(m).update(PhaseOrigin=["bow", 0, 0]),
                        "'bow' is not a number"),
    "phases off the plane": (lambda m: raos(m).update(PhaseOrigin=[0, 4, 0]),
                             "the points of motion and of phase are not both in the xz_plane"),
    "no direction": (lambda m: raos(m)["RAOs"][1].pop("RAODirection"),
                     "an entry of RAOs has no RAODirection"),
    "other columns": (lambda m: raos(m)["RAOs"][0].update(
                          {"RAOPeriodOrFrequency, RAOHeaveAmp": raos(m)["RAOs"][0].pop(
                              samples.ORCAFLEX_KEY)}),
                      "its columns are not period or frequency and six amplitudes"),
    "short row": (lambda m: table(m)[2].pop(), "a row of 12 values; a row has 13 numbers"),
    "no rows": (lambda m: table(m).clear(), "it has no rows"),
    "words in a row": (lambda m: table(m)[0].__setitem__(3, "much"), "'much' is not a number"),
    "not finite": (lambda m: table(m)[0].__setitem__(3, float("nan")), "a number is not finite"),
    "negative amplitude": (lambda m: table(m)[0].__setitem__(1, -0.5), "an amplitude is negative"),
    "negative period": (lambda m: [table(m, k)[0].__setitem__(0, -5.0) for k in range(5)],
                        "a period or frequency is below 0"),
    "other periods": (lambda m: table(m, 2)[0].__setitem__(0, 51.0),
                      "RAODirection 90: other periods or frequencies than at 0"),
    "motion at period 0": (lambda m: [table(m, k)[0].__setitem__(0, 0.0) for k in range(5)],
                           "RAOs at the period 0 are not 0"),
    "one period": (lambda m: [table(m, k).__delitem__(slice(1, None)) for k in range(5)],
                   "it has one wave period"),
    "period twice": (lambda m: [table(m, k)[1].__setitem__(0, table(m, k)[0][0]) for k in range(5)],
                     "a wave period is double"),
    "both sides": (lambda m: raos(m)["RAOs"][1].update(RAODirection=-90.0),
                   "headings on both sides of the plane of symmetry"),
    "heading twice": (lambda m: raos(m)["RAOs"][1].update(RAODirection=90.0),
                      "the heading 90° is double, with other RAOs"),
    "head seas alone": (lambda m: raos(m).update(RAOs=raos(m)["RAOs"][4:]),
                        "no heading between 180° and 180°, with symmetry xz_plane"),
    "no tables": (lambda m: raos(m).update(RAOs=[]), "RAOs is empty"),
    "half a circle": (lambda m: kind(m).update(Symmetry="None"),
                      "no heading between 180° and 0°, with symmetry none"),
    "fore and aft": (lambda m: kind(m).update(Symmetry="xz and yz planes"),
                     "headings from ahead and from astern"),
}  # fmt: skip


def refused(path: Path, conventions: RaoConventions, words: str) -> None:
    """Check for one sentence with the file, the fault and a remedy."""
    with pytest.raises(InputError) as caught:
        read_responses(str(path), conventions)
    sentence = str(caught.value)
    assert words in sentence
    assert str(path) in sentence
    assert "; " in sentence
    assert sentence[-1] in ".?"
    assert "\n" not in sentence


@pytest.mark.parametrize("fault", ORCAFLEX)
def test_invalid_orcaflex_files_are_rejected(tmp_path: Path, fault: str) -> None:
    spoil, words = ORCAFLEX[fault]
    model, path = samples.orcaflex_model(samples.box_wide()), tmp_path / "vessel.yml"
    path.write_text(samples.orcaflex_text(model))
    read_responses(str(path))
    spoil(model)
    path.write_text(samples.orcaflex_text(model))
    refused(path, NO_CONVENTIONS, words)


WAMIT_SAID = RaoConventions(
    scale_length_m=1.0, origin_m=(0.0, 0.0, 0.0), phase_origin_m=(0.0, 0.0, 0.0),
    symmetry="xz_plane",
)  # fmt: skip
WAMIT: dict[str, tuple[Callable[[list[str]], Any], str]] = {
    "words": (lambda rows: rows.__setitem__(3, "50.0 0.0 one 1 0 1 0"), "line 4: '50.0 0.0 one"),
    "six numbers": (lambda rows: rows.__setitem__(2, "50.0 0.0 2 1.0 0.0 1.0"), "6 numbers"),
    "infinite period": (lambda rows: rows.__setitem__(2, "-1.0 0.0 2 1 0 1 0"), "PER is -1"),
    "seven modes": (lambda rows: rows.__setitem__(2, "50.0 0.0 7 1 0 1 0"), "mode 7; give the six"),
    "not finite": (lambda rows: rows.__setitem__(2, "50.0 0.0 2 nan 0 nan 0"), "is not finite"),
    "negative modulus": (lambda rows: rows.__setitem__(2, "50.0 0.0 2 -1 0 -1 0"), "modulus -1"),
    "phase in radians": (lambda rows: rows.__setitem__(1, "50.0 0.0 1 0.9 -1.57 0.0 -0.9"),
                         "line 2: modulus and phase are not those of real and imaginary part"),
    "missing row": (lambda rows: rows.pop(5), "mode 5 at PER 50 and BETA 0 is missing"),
    "double row": (lambda rows: rows.append(rows[9]), "is double; give six modes"),
    "titles alone": (lambda rows: rows.__delitem__(slice(1, None)), "it has no rows"),
}  # fmt: skip


@pytest.mark.parametrize("fault", WAMIT)
def test_invalid_wamit_files_are_rejected(tmp_path: Path, fault: str) -> None:
    spoil, words = WAMIT[fault]
    path, rows = tmp_path / "vessel.4", samples.wamit_text(samples.box()).splitlines()
    path.write_text("\n".join(rows))
    read_responses(str(path), WAMIT_SAID)
    spoil(rows)
    path.write_text("\n".join(rows))
    refused(path, WAMIT_SAID, words)


@pytest.mark.parametrize("name", ["scale_length_m", "origin_m", "phase_origin_m", "symmetry"])
def test_wamit_files_need_keys_that_they_do_not_state(tmp_path: Path, name: str) -> None:
    path = tmp_path / "vessel.4"
    path.write_text(samples.wamit_text(samples.box()))
    missing = replace(WAMIT_SAID, **{name: "" if name == "symmetry" else None})
    refused(path, missing, f"the file does not state its {name}; give it as `{name}`")


@pytest.mark.parametrize(
    ("name", "conventions", "words"),
    [
        ("vessel.yml", RaoConventions(symmetry="xz_plane"), "`symmetry` is given, and the file"),
        ("vessel.yml", RaoConventions(vessel="Hul"), "no vessel 'Hul'; did you mean 'Hull'?"),
        ("vessel.yml", RaoConventions(draught="Light"), "no draught 'Light'"),
        ("vessel.4", replace(WAMIT_SAID, draught="Light"), "a WAMIT file has one vessel"),
        ("vessel.4", replace(WAMIT_SAID, symmetry="xy"), "symmetry is 'xy'; known: none"),
        ("vessel.csv", RaoConventions(scale_length_m=9.0), "a CSV has fixed conventions but for"),
    ],
)
def test_keys_that_a_file_states_are_rejected(
    tmp_path: Path, name: str, conventions: RaoConventions, words: str
) -> None:
    path, vessel = tmp_path / name, samples.box()
    texts = {
        "vessel.yml": samples.orcaflex_text(samples.orcaflex_model(vessel)),
        "vessel.4": samples.wamit_text(vessel),
        "vessel.csv": samples.csv_text(vessel),
    }
    path.write_text(texts[name])
    refused(path, conventions, words)


XZ = RaoConventions(symmetry="xz_plane")
ORIGIN = (("space_coordinate",), np.array([0.0, np.nan, 0.0]))
CAPYTAINE: dict[str, tuple[dict[str, Any], RaoConventions, str]] = {
    "no symmetry": ({}, NO_CONVENTIONS, "the file does not state its symmetry"),
    "no rotation centre": ({"rotation_center": None}, XZ, "does not state its origin_m"),
    "origin twice": ({}, replace(XZ, origin_m=(0.0, 0.0, 0.0)), "`origin_m` is given, and the"),
    "no RAO": ({"RAO": None}, XZ, "there is neither RAO nor excitation_force"),
    "other body": ({"radiating_dof": (("radiating_dof",), ["Surge"] * 6)}, XZ,
                   "its degrees of freedom are Surge"),
    "other time factor": ({"attrs": {"incoming_waves_convention": "WAMIT"}}, XZ,
                          "incoming_waves_convention is 'WAMIT'"),
    "forward speed": ({"forward_speed": ((), np.float64(4.0))}, XZ, "with forward speed"),
    "no frequencies": ({"omega": None}, XZ, "there is no variable omega"),
    "frequency 0": ({"omega": (("omega",), np.arange(20.0))}, XZ, "omega is not finite and above"),
    "no parts": ({"complex": (("complex",), ["mod", "arg"])}, XZ, "the dimension complex is mod"),
    "nowhere": ({"rotation_center": ORIGIN}, XZ, "rotation_center is not finite"),
    "forces alone": ({"RAO": None, "excitation_force": (
        ("complex", "omega", "wave_direction", "influenced_dof"), np.zeros((2, 20, 5, 6)))}, XZ,
        "there is no RAO, and no inertia_matrix"),
}  # fmt: skip


@pytest.mark.parametrize("fault", CAPYTAINE)
def test_invalid_capytaine_files_are_rejected(tmp_path: Path, fault: str) -> None:
    pytest.importorskip("h5netcdf")
    pytest.importorskip("h5py")
    changes, conventions, words = CAPYTAINE[fault]
    path = tmp_path / "vessel.nc"
    samples.write_capytaine(path, samples.box(), **changes)
    refused(path, conventions, words)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("vessel.nc", b"CDF\x01", "it is not a netCDF 4 file"),
        ("vessel.nc", b"\x89HDF\r\n\x1a\nno", "it cannot be read ("),
        ("vessel.yml", b"a: [", "it is not YAML ("),
        ("vessel.yml", b"- 1\n", "its top is not a mapping"),
        ("vessel.4", b"\xff\xfe\x00", "it is not UTF-8 text (byte 0xff at 0)"),
        ("vessel.csv", b"\xff\xfe\x00", "it is not UTF-8 text (byte 0xff at 0)"),
    ],
)
def test_files_of_other_kinds_are_rejected(
    tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    if name.endswith(".nc"):
        pytest.importorskip("h5netcdf")
        pytest.importorskip("h5py")
    (tmp_path / name).write_bytes(content)
    refused(tmp_path / name, WAMIT_SAID if name == "vessel.4" else NO_CONVENTIONS, words)


SCENES = {
    "tip without origin": ("responses: vessel_120m, crane_tip_m: [1.0, 2.0, 3.0]", "",
                           "the table does not state the point that its RAOs are for"),
    "tip and reference": ("responses: ./vessel.yml, crane_tip_m: [1.0, 2.0, 3.0]",
                          "reference_m: [0.0, 0.0, -12.0]", "both `crane_tip_m` and"),
    "origin without tip": ("responses: ./vessel.yml", "",
                           "its RAOs are those of the point [0, 0, 0] m of the vessel"),
    "tip of a box": ("crane_tip_m: [1.0, 2.0, 3.0]", "", "are those of an RAO file"),
    "missing convention": ("responses: ./vessel.4, crane_tip_m: [1.0, 2.0, 3.0]", "",
                           "the file does not state its scale_length_m"),
}  # fmt: skip


@pytest.mark.parametrize("fault", SCENES)
def test_a_scene_says_where_its_crane_tip_is(tmp_path: Path, fault: str) -> None:
    riding, ship, words = SCENES[fault]
    vessel = samples.box()
    (tmp_path / "vessel.yml").write_text(samples.orcaflex_text(samples.orcaflex_model(vessel)))
    (tmp_path / "vessel.4").write_text(samples.wamit_text(vessel))
    text = (share_dir() / "config" / "scenes" / "ship_6dof.yaml").read_text()
    text = text.replace("responses: vessel_120m, heading_deg: 0.0", riding)
    text = text.replace("reference_m: [0.0, 0.0, -12.0]", ship)
    (tmp_path / "own.yaml").write_text(text)
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path / "own.yaml")
    assert words in str(caught.value)
    assert "sea_state.on_waves" in str(caught.value)
