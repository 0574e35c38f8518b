"""RAO files in four formats: one vessel, its conventions, and its motion in long waves."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rao_samples as samples
from hypothesis import given, settings
from hypothesis import strategies as st

from rope_twin.files import share_dir
from rope_twin.recording.motion_source import open_sea
from rope_twin.scene.load import load_scene
from rope_twin.sea.orcaflex_raos import read_orcaflex
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.raos import (
    NO_CONVENTIONS,
    SYMMETRIES,
    FileRaos,
    Point,
    RaoConventions,
    Responses,
    assemble,
    long_wave_doubts,
    moved_by,
)

TIP = (10.0, -18.0, 24.0)
ULEN_M = 60.0
FORMATS = {
    "vessel.csv": ((0.0, 0.0, 0.0), RaoConventions(origin_m=(0.0, 0.0, 0.0))),
    "vessel.yml": ((2.5, 0.0, -1.9), NO_CONVENTIONS),
    "vessel.4": (
        (-5.0, 0.0, 1.0),
        RaoConventions(scale_length_m=ULEN_M, origin_m=(-5.0, 0.0, 1.0),
                       phase_origin_m=(0.0, 0.0, 0.0), symmetry="xz_plane"),
    ),
    "vessel.nc": ((1.0, 0.0, -3.0), RaoConventions(symmetry="xz_plane")),
}  # fmt: skip


def write(folder: Path, name: str) -> Path:
    """Write the box in one of FORMATS, its motion given at that format's own point."""
    vessel, path, origin = samples.box(), folder / name, FORMATS[name][0]
    match path.suffix:
        case ".csv":
            path.write_text(samples.csv_text(vessel))
        case ".yml":
            model = samples.orcaflex_model(vessel, None, origin)
            path.write_text(samples.orcaflex_text(model))
        case ".4":
            path.write_text(samples.wamit_text(vessel, ULEN_M, origin))
        case _:
            pytest.importorskip("h5netcdf")
            pytest.importorskip("h5py")
            samples.write_capytaine(path, vessel, origin)
    return path


@pytest.mark.parametrize("name", FORMATS)
def test_crane_tip_motion_is_equal_in_four_rao_formats(tmp_path: Path, name: str) -> None:
    """To 1e-9 of what its closed form gives, at any heading and period, with arms written out."""
    table = read_responses(str(write(tmp_path, name)), FORMATS[name][1])
    assert table.origin_m == (0.0, 0.0, 0.0)
    f = np.linspace(0.01, 0.45, 60)
    beta = np.radians(np.linspace(-200.0, 400.0, 60))
    surge, sway, heave, roll, pitch, yaw = samples.box().at(f, beta)
    x, y, z = TIP
    expected = [surge + z * pitch - y * yaw, sway + x * yaw - z * roll,
                heave + y * roll - x * pitch, roll, pitch, yaw]  # fmt: skip
    assert np.abs(table.moved(TIP).at(f, beta) - expected).max() < 1e-9


@pytest.mark.parametrize("name", FORMATS)
def test_a_scene_moves_alike_with_any_rao_format(tmp_path: Path, name: str) -> None:
    """Its crane tip moves as in the scene that has the CSV and the arm in the sea's axes."""
    conventions = FORMATS[name][1]
    text = (share_dir() / "config" / "scenes" / "ship_6dof.yaml").read_text()
    text = text.replace("reference_m: [0.0, 0.0, -12.0]", "motion_ramp_s: 8.0")
    given = [f"{key}: {getattr(conventions, key)}" for key in conventions._later
            if getattr(conventions, key) not in (None, "")]  # fmt: skip
    message = ", ".join(one.replace("(", "[").replace(")", "]") for one in given)
    riding = f"responses: ./{name}, heading_deg: 30.0, crane_tip_m: [10.0, 18.0, 12.0]"
    text = text.replace("responses: vessel_120m, heading_deg: 0.0",
                        f"{riding}, conventions: {{{message}}}")  # fmt: skip
    (tmp_path / "own.yaml").write_text(text)
    write(tmp_path, name)
    scene = load_scene(tmp_path / "own.yaml")
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    plain = tmp_path / "plain.yaml"
    reference = [10.0 - (10.0 * c - 18.0 * s), 18.0 - (10.0 * s + 18.0 * c), -12.0]
    (tmp_path / "plain.csv").write_text(samples.csv_text(samples.box()))
    own = (share_dir() / "config" / "scenes" / "ship_6dof.yaml").read_text()
    own = own.replace("reference_m: [0.0, 0.0, -12.0]", f"reference_m: {reference}")
    plain.write_text(
        own.replace("responses: vessel_120m, heading_deg: 0.0",
                    "responses: ./plain.csv, heading_deg: 30.0")
    )  # fmt: skip
    seas = [open_sea(one) for one in (scene, load_scene(plain))]
    for stamp in (0, 3_650_000_000, 171_000_000_000):
        ours, other = (sea.between(stamp, stamp + 1)[0] for sea in seas if sea is not None)
        assert ours.position_m == pytest.approx(other.position_m, abs=1e-9)
        assert ours.lateral is not None
        assert np.array(ours.lateral) == pytest.approx(np.array(other.lateral), abs=1e-9)
    assert abs(other.position_m) > 0.02


conventions = st.builds(
    samples.Said,
    turns=st.sampled_from(["degrees", "radians"]),
    unit=st.sampled_from(["amplitude", "max wave slope", "wave steepness"]),
    waves=st.sampled_from(["period (s)", "frequency (rad/s)", "frequency (Hz)"]),
    phase=st.sampled_from(["lags", "leads"]),
    phase_unit=st.sampled_from(["degrees", "radians"]),
    relative=st.sampled_from(list(samples.LEADS_OF_EVENT)),
    flipped=st.tuples(*[st.booleans()] * 6),
    system=st.sampled_from(["SI", "US"]),
)


@given(said=conventions)
@settings(max_examples=40, deadline=None)
def test_orcaflex_conventions_give_one_vessel(
    tmp_path_factory: pytest.TempPathFactory, said: samples.Said
) -> None:
    """Units, lead or lag, relative to crest or crossings, and any positive directions."""
    vessel = samples.box_small()
    path = tmp_path_factory.mktemp("said") / "vessel.yml"
    path.write_text(samples.orcaflex_text(samples.orcaflex_model(vessel, said, (3.0, 0.0, -2.0))))
    table = assemble(read_orcaflex(path, NO_CONVENTIONS))
    assert np.abs(table.answer - vessel.answer).max() < 1e-9
    assert table.frequency_hz == pytest.approx(vessel.frequency_hz, rel=1e-12)


def test_the_limits_of_a_table_are_read(tmp_path: Path) -> None:
    """OrcaFlex writes Infinity for the longest wave, and a row of zeros for the period 0."""
    vessel, path = samples.box_wide(), tmp_path / "vessel.yml"
    model = samples.orcaflex_model(vessel)
    for table in model["VesselTypes"][0]["Draughts"][0]["DisplacementRAOs"]["RAOs"]:
        rows = table[samples.ORCAFLEX_KEY]
        rows.append(["Infinity", *([0, 0] * 2), 1, 0, *([0, 0] * 3)])
        rows.append([0, *([0] * 12)])
    path.write_text(samples.orcaflex_text(model))
    table = read_responses(str(path))
    assert table.frequency_hz == pytest.approx([0.0, *vessel.frequency_hz], abs=1e-12)
    half = table.at(np.array([0.5 * vessel.frequency_hz[0]]), np.zeros(1))[2, 0]
    assert half == pytest.approx(0.5 + 0.5 * vessel.answer[2, 0, 0], abs=1e-12)
    assert list(long_wave_doubts(table)) == []


def written(vessel: Responses, headings: object, answer: object, symmetry: str) -> FileRaos:
    return FileRaos("file", "file", np.asarray(headings, float), vessel.frequency_hz,
                   np.asarray(answer), symmetry, samples.MIDSHIPS, samples.MIDSHIPS)  # fmt: skip


def test_symmetry_of_orcaflex_raos() -> None:
    """A quarter, one side or the whole circle of a box: the same RAOs at every heading."""
    vessel = samples.box()
    around, all_sides = samples.full_circle(vessel)
    one_side = written(vessel, vessel.heading_deg, vessel.answer, "xz_plane")
    quarter = written(vessel, vessel.heading_deg[:3], vessel.answer[:, :3], "xz_and_yz_planes")
    right = [4, 5, 6, 7, 0]
    starboard = written(vessel, around[right] - 360.0, all_sides[:, right], "xz_plane")
    circle = written(vessel, around + 720.0, all_sides, "none")
    shuffled = written(vessel, around[::-1], all_sides[:, ::-1], "none")
    f, beta = np.full(73, 0.07), np.radians(np.linspace(-180.0, 360.0, 73))
    expected = vessel.at(f, beta)
    for own in (one_side, quarter, circle, shuffled, starboard):
        assert np.abs(assemble(own).at(f, beta) - expected).max() < 1e-12
        assert np.abs(assemble(own).around().at(f, beta) - expected).max() < 1e-12
    # without 0° and 180° in the table, RAOs there are the mean of both sides
    inner = written(vessel, vessel.heading_deg[1:4], vessel.answer[:, 1:4], "xz_plane")
    ahead = assemble(inner).at(np.array([0.08]), np.array([0.0]))[:, 0]
    own = assemble(inner)
    assert np.abs(own.around().at(f, beta) - own.at(f, beta)).max() < 1e-12
    mean = 0.5 * (vessel.answer[:, 1, 3] + samples.MIRRORED * vessel.answer[:, 1, 3])
    assert ahead == pytest.approx(mean, abs=1e-12)


arms = st.tuples(*[st.floats(-100.0, 100.0)] * 3)


@given(first=arms, second=arms)
def test_moving_the_rao_point_is_additive(first: Point, second: Point) -> None:
    """By way of another point, and there and back."""
    answer = samples.box_small().answer
    both = tuple(a + b for a, b in zip(first, second, strict=True))
    by_way = moved_by(moved_by(answer, first), second)
    assert np.abs(by_way - moved_by(answer, (both[0], both[1], both[2]))).max() < 1e-11
    back = moved_by(moved_by(answer, first), (-first[0], -first[1], -first[2]))
    assert np.abs(back - answer).max() < 1e-11


def test_long_wave_limit_of_the_box_raos() -> None:
    """Heave 1 in phase; pitch k·cos β a quarter ahead; roll k·sin β a quarter behind; no doubts.

    The surface a·cos(k·x·cos β + k·y·sin β - ω·t) at the origin, bow down and starboard down
    positive: pitch = -∂η/∂x, roll = +∂η/∂y.
    """
    vessel = samples.box()
    f = 0.004
    long = samples.box_at(np.array([f, 0.05]))
    k = (2.0 * np.pi * f) ** 2 / samples.G
    for degrees in (0.0, 45.0, 90.0, 135.0, 180.0, -45.0):
        beta = math.radians(degrees)
        surge, sway, heave, roll, pitch, _ = long.at(np.array([f]), np.array([beta]))[:, 0]
        assert heave == pytest.approx(1.0, abs=2e-3)
        assert surge == pytest.approx(-1j * math.cos(beta), abs=2e-3)
        assert sway == pytest.approx(-1j * math.sin(beta), abs=2e-3)
        assert pitch / k == pytest.approx(1j * math.cos(beta), abs=5e-3)
        assert roll / k == pytest.approx(-1j * math.sin(beta), abs=1e-2)
        # the heave of a point ahead is that of the water there: exp(-i·k·x·cos β)
        tip = moved_by(long.at(np.array([f]), np.array([beta])), (50.0, 0.0, 0.0))[2, 0]
        assert tip == pytest.approx(np.exp(-1j * k * 50.0 * math.cos(beta)), abs=3e-3)
    assert list(long_wave_doubts(vessel)) == []


def test_a_wrong_phase_convention_is_detected_in_long_waves() -> None:
    """Lag taken for lead turns pitch, a flipped heave turns heave, waves that come from 0 do so."""
    vessel = samples.box()
    lag = replace(vessel, answer=np.conj(vessel.answer))
    assert any(re.search(r"pitch is -?1[78]\d° off", one) for one in long_wave_doubts(lag))
    down = replace(vessel, answer=vessel.answer * np.array([1, 1, -1, 1, 1, 1])[:, None, None])
    assert any("heave is" in one for one in long_wave_doubts(down))
    backward = replace(vessel, answer=vessel.answer[:, ::-1])
    assert any("pitch is" in one for one in long_wave_doubts(backward))
    assert list(long_wave_doubts(samples.box_at(np.array([0.1, 0.2])))) == []


def test_capytaine_coefficients_give_the_motion_without_rao(tmp_path: Path) -> None:
    """A heaving cylinder by itself: (C - ω²·(M + A) - iω·B)·X = F, typed out for each freedom."""
    pytest.importorskip("h5netcdf")
    pytest.importorskip("h5py")
    vessel = samples.box_small()
    omega, count = 2.0 * np.pi * vessel.frequency_hz, len(vessel.heading_deg)
    M, C = np.diag([2.0, 2.0, 2.0, 3.0, 3.0, 3.0]), np.diag([0.0, 0.0, 5.0, 4.0, 4.0, 0.0])
    A, B = 0.5 * M, 0.3 * np.eye(6)
    F = np.tile((np.arange(6.0) + 1.0 + 0.5j), (len(omega), count, 1))
    names = [name.title() for name in reversed(samples.FREEDOMS)]  # in another order
    pair = ("influenced_dof", "radiating_dof")
    samples.write_capytaine(
        tmp_path / "box.nc", vessel, RAO=None,
        influenced_dof=(pair[:1], names), radiating_dof=(pair[1:], names),
        inertia_matrix=(pair, M[::-1, ::-1]), hydrostatic_stiffness=(pair, C[::-1, ::-1]),
        added_mass=(("omega", *pair), np.tile(A[::-1, ::-1], (len(omega), 1, 1))),
        radiation_damping=(("omega", *pair[::-1]), np.tile(B[::-1, ::-1], (len(omega), 1, 1))),
        excitation_force=(("complex", "omega", "wave_direction", pair[0]),
                          np.stack([F.real, F.imag])[..., ::-1]),
    )  # fmt: skip
    table = read_responses(str(tmp_path / "box.nc"), RaoConventions(symmetry="xz_plane"))
    for k in range(6):
        own = C[k, k] - omega**2 * (M[k, k] + A[k, k]) - 1j * omega * B[k, k]
        assert table.answer[k, 0] == pytest.approx(np.conj(F[:, 0, k] / own), rel=1e-12)


def test_a_bag_keeps_a_binary_table(tmp_path: Path) -> None:
    """Its text in the session gives the same bytes."""
    from rope_twin.recording.session import _bytes, _text

    pytest.importorskip("h5netcdf")
    pytest.importorskip("h5py")
    path = write(tmp_path, "vessel.nc")
    text = _text(path)
    assert text is not None
    assert text.startswith("data:")
    assert _bytes(text) == path.read_bytes()
    plain = write(tmp_path, "vessel.csv")
    assert _bytes(_text(plain) or "") == plain.read_bytes()
    assert SYMMETRIES == ("none", "xz_plane", "xz_and_yz_planes")
