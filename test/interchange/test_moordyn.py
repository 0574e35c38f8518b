"""Scenes to MoorDyn decks and back: the same numbers, the same tension, nothing lost in silence."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.peers.codes import silence
from rope_twin import Twin
from rope_twin.cli import main
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.errors import InputError
from rope_twin.interchange import write_scene
from rope_twin.interchange.moordyn import deck_of, scene_of
from rope_twin.interchange.moordyn_deck import CURRENT_FILE, current_text, deck_text, read_deck
from rope_twin.scene.load import at_setting, load_scene
from rope_twin.scene.schema import Scene

MBL_N = 5e6


def exported(scene: Scene, folder: Path) -> tuple[Path, tuple[str, ...]]:
    """Write a scene's deck; return its file and what is left out."""
    deck, left_out = deck_of(scene)
    path = folder / "deck.txt"
    path.write_text(deck_text(deck))
    (folder / CURRENT_FILE).write_text(current_text(deck))
    return path, left_out


@pytest.fixture(scope="module")
def lift() -> Scene:
    """2,000 m of rope with 20 t in a current, coarse."""
    return at_setting(load_scene("smooth_2km"), 20)


def test_a_scene_comes_back_from_its_deck(lift: Scene, tmp_path: Path) -> None:
    """Every number of rope, payload, water and current, and the same static tension."""
    path, left_out = exported(lift, tmp_path)
    assert read_deck(path) == deck_of(lift)[0]
    assert [words for words in left_out if "motion of the ship" not in words] == []
    back = write_scene(scene_of(read_deck(path), path, MBL_N), tmp_path / "back.yaml")
    ours, theirs = lift.ropes[0], back.ropes[0]
    assert theirs.rope is not None
    assert ours.rope is not None
    for name in ("mass_kg_per_m", "hydrodynamic_diameter_m", "axial_stiffness_n"):
        assert getattr(theirs.rope, name) == getattr(ours.rope, name)
    assert theirs.damping == ours.damping
    assert (theirs.length_m, theirs.elements) == (ours.length_m, ours.elements)
    for name in ("mass_kg", "displaced_volume_m3", "added_mass_kg", "drag_area_m2"):
        assert getattr(back.payloads[0], name) == pytest.approx(getattr(lift.payloads[0], name))
    assert back.environment == lift.environment
    assert back.ship.hang_off_m == lift.ship.hang_off_m
    drag, own = back.listed(DragParams), lift.listed(DragParams)
    assert drag is not None
    assert own is not None
    assert (drag.normal, drag.tangential) == (own.normal, own.tangential)
    current, flow = back.listed(CurrentParams), lift.listed(CurrentParams)
    assert current is not None
    assert flow is not None
    for z in np.linspace(0.0, -2400.0, 49):
        row, other = (
            [np.interp(z, own.table[::-1, 0], own.table[::-1, k]) for k in (1, 2)]
            for own in (current, flow)
        )
        assert row == pytest.approx(other, abs=1e-12)
    tension = Twin(back).snapshot().tension_top_n
    assert tension == pytest.approx(Twin(lift).snapshot().tension_top_n, rel=1e-5)


@pytest.mark.parametrize("down", [False, True], ids=["bottom up", "top down"])
@pytest.mark.parametrize("gap_m", [0.0, 0.001], ids=["equal heights", "a millimetre"])
@pytest.mark.parametrize(("low", "high"), [(0.15, 0.4), (0.4, 0.15)])
def test_layers_of_a_current_come_back(
    lift: Scene, tmp_path: Path, gap_m: float, low: float, high: float, down: bool
) -> None:
    """Two layers are a step in a deck and a thin shear in a scene, elsewhere the same."""
    path, _ = exported(lift, tmp_path)
    rows = [(-900.0, low), (-200.0 - gap_m, low), (-200.0, high), (50.0, high)]
    rows = rows[::-1] if down else rows
    text = "\n".join(["layers", "", "", *(f"{z} {speed} 0 0" for z, speed in rows)])
    (tmp_path / CURRENT_FILE).write_text(text)
    found = scene_of(read_deck(path), path, MBL_N)
    assert any(words.startswith("current: its steps") for words in found.left_out)
    current = write_scene(found, tmp_path / "back.yaml").listed(CurrentParams)
    assert current is not None
    speeds = np.interp([-800.0, -200.1, -199.9, 0.0], *current.table[::-1, :2].T)
    assert speeds == pytest.approx([low, low, high, high])


@pytest.mark.parametrize(("name", "depth_m"), [("splash_zone", 300.0), ("deep_lift", 1.2 * 3200.0)])
def test_a_deck_without_a_seabed_has_water_below_all_that_is_lowered(
    name: str, depth_m: float
) -> None:
    """The depth that the waves feel, else 1.2 times the depth that the winch can reach."""
    scene = load_scene(name)
    assert scene.listed(SeabedParams) is None
    assert (repr(depth_m), "WtrDpth") in deck_of(scene)[0].options


def test_moordyn_has_the_same_static_tension(lift: Scene, tmp_path: Path) -> None:
    """Within 0.1 %, of two independent codes with equal segments, when MoorDyn's line is at rest.

    With more damping of the axial mode (3.5 s) it rests after 90 s.
    """
    moordyn = pytest.importorskip("moordyn")
    (line,) = lift.ropes
    still = replace(line, damping=replace(line.damping, newton_seconds=8e6))
    path, _ = exported(replace(lift, ropes=(still,)), tmp_path)
    with silence():
        system = moordyn.Create(str(path))
        moordyn.Init(system, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
        pulls = [moordyn.Step(system, [0.0] * 3, [0.0] * 3, 0.1 * k, 0.1) for k in range(900)]
        moordyn.Close(system)
    theirs = np.linalg.norm(np.array(pulls), axis=1)[-50:]
    ours = Twin(lift).snapshot().tension_top_n
    assert ours > 1.5e5
    assert np.ptp(theirs) < 1e-3 * ours
    assert theirs.mean() == pytest.approx(ours, rel=1e-3)


def test_sections_and_an_anchor_come_back(tmp_path: Path) -> None:
    """Wire over chain on the seabed: one rope of two sections, fixed at its lower end."""
    scene = load_scene("chain_on_bottom")
    path, left_out = exported(scene, tmp_path)
    assert any("effect bed_friction" in words for words in left_out)
    assert any(words.startswith("winches") for words in left_out)
    found = scene_of(read_deck(path), path, MBL_N)
    back = write_scene(found, tmp_path / "back.yaml")
    (line,), (own,) = back.ropes, scene.ropes
    assert line.fixed_at_m == own.fixed_at_m
    assert line.length_m == pytest.approx(own.length_m)
    masses = [one.rope.mass_kg_per_m for one in line.made_of]
    assert masses == [one.rope.mass_kg_per_m for one in own.made_of]
    assert line.lengths_m(line.length_m) == pytest.approx(own.lengths_m(own.length_m))
    bed = back.listed(SeabedParams)
    assert bed is not None
    assert bed.depth_m == 300.0
    assert any("its damping" in words for words in found.left_out)
    assert "# not imported: line 1: its damping" in (tmp_path / "back.yaml").read_text()


@pytest.mark.parametrize(
    ("name", "words"),
    [("bridle_lift", "its struts have no equal"), ("two_line_loop", "its sheaves have no"),
     ("manifold_lift", "its rigid body has no equal")],
)  # fmt: skip
def test_what_a_deck_cannot_have_is_refused(name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        deck_of(load_scene(name))


TWO_LINES = """two legs on one ring, and a clump on the ground line
--- LINE TYPES ---
Name Diam MassDen EA BA EI Cd Ca CdAx CaAx
(-) (m) (kg/m) (N) (N-s) (N-m2) (-) (-) (-) (-)
wire 0.05 8.0 1e8 -0.5 0 1.6 1.0 0.01 0.0
leg 0.04 5.0 6e7 -0.5 0 2.0 1.0 0.01 0.0
--- BODIES ---
1 Free 0 0 0
--- POINTS ---
ID Attachment X Y Z M V CdA Ca
(#) (-) (m) (m) (m) (kg) (m3) (m2) (-)
1 Vessel 0 0 0 0 0 0 0
2 Free 0 0 -100 0 0 0 0
3 Free -3 0 -104 500 0.1 1.0 1.0
4 Free 3 0 -104 600 0.1 1.0 1.0
5 Anchor 300 0 -200 0 0 0 0
6 Anchor 400 0 -200 0 0 0 0
--- LINES ---
ID LineType AttachA AttachB UnstrLen NumSegs Outputs
(#) (-) (#) (#) (m) (-) (-)
1 wire 1 2 100 20 p
2 leg 2 3 5 5 p
3 leg 2 4 5 5 p
4 wire 5 6 100 10 -
--- OPTIONS ---
9.81 g
1025 rho
200 depth
1e6 kBot
2 WaveKin
0.001 dtM
--- OUTPUTS ---
FairTen1
--- need this line ---
"""


def test_a_deck_by_another_hand_is_read(tmp_path: Path) -> None:
    """Other names of columns and sections; what has no equal is listed, each once."""
    path = tmp_path / "legs.txt"
    path.write_text(TWO_LINES.replace("100 20 p", "100 20.0 p"))  # as MoorDyn reads it too
    found = scene_of(read_deck(path), path, MBL_N)
    scene = write_scene(found, tmp_path / "legs.yaml")
    assert [line.name for line in scene.ropes] == ["line_1", "line_2", "line_3"]
    assert [(line.from_, line.to) for line in scene.ropes] == [
        ("winch", "point_2"), ("point_2", "point_3"), ("point_2", "point_4")
    ]  # fmt: skip
    assert [joint.name for joint in scene.joints] == ["point_2"]
    assert [own.mass_kg for own in scene.payloads] == [500.0, 600.0]
    assert scene.payloads[0].added_mass_kg == pytest.approx((102.5, 102.5, 102.5))
    rope = scene.ropes[1].rope
    assert rope is not None
    assert rope.drag_normal == 2.0
    said = "; ".join(found.left_out)
    for words in ("section BODIES", "section OUTPUTS", "option WaveKin 2", "option dtM 0.001",
                  "line 4: both its ends are held"):  # fmt: skip
        assert said.count(words) == 1
    # the pull on the crane: masses of 500 and 600 kg, a wire of 800 kg, two legs of 25 kg, in water
    area = np.pi / 4.0 * np.array([0.05**2 * 100.0, 0.04**2 * 10.0])
    weight = (1100.0 + 800.0 + 50.0 - 1025.0 * (0.2 + area.sum())) * 9.81
    # in a current and waves of none, and far below the surface: the step of two_line_landing
    idle = (
        CurrentParams(profile=((0.0, (0.0, 0.0)),)),
        WavesParams(regular=RegularWave(height_m=0.0, period_s=8.0)),
        SplashZoneParams(height_m=1.0, bottom_area_m2=1.0),
    )
    assert {type(own) for own in idle}.isdisjoint(type(own) for own in scene.effects)
    scene = replace(scene, effects=(*scene.effects, *idle))
    assert Twin(scene).snapshot().tension_top_n == pytest.approx(weight, rel=1e-3)


@pytest.mark.parametrize(
    ("words", "loads_n", "remarks"),
    [
        ("wire=2MN leg=900kN", (2e6, 9e5, 9e5), 0),
        ("leg=900kN 2MN", (2e6, 9e5, 9e5), 0),
        ("2MN", (2e6, 2e6, 2e6), 1),
    ],
)
def test_each_line_type_has_its_own_breaking_load(
    words: str, loads_n: tuple[float, ...], remarks: int, tmp_path: Path
) -> None:
    """One for types of several stiffnesses is right for one of them at most: it is remarked."""
    path, out = tmp_path / "legs.txt", tmp_path / "legs.yaml"
    path.write_text(TWO_LINES)
    given = [word for load in words.split() for word in ("--breaking-load", load)]
    assert main(["scene", "import", str(path), *given, "--out", str(out)]) == 0
    ropes = [line.rope for line in load_scene(str(out)).ropes]
    assert tuple(rope.breaking_load_n for rope in ropes if rope is not None) == loads_n
    assert out.read_text().count("wire, leg all have 2e+06 N") == remarks


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("wire=2MN", "line type 'leg': its breaking load is not known"),
        ("wire=2MN legs=1MN", "no line type 'legs'; did you mean 'leg'?"),
        ("wire=2MN wire=1MN 3MN", "line type 'wire' has two; give one"),
        ("1MN 3MN", "two have no line type; give one"),
        ("wire=2", "is 2 N"),
    ],
)
def test_wrong_breaking_loads_are_refused_in_one_sentence(
    words: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "legs.txt", tmp_path / "legs.yaml"
    path.write_text(TWO_LINES)
    given = [word for load in words.split() for word in ("--breaking-load", load)]
    assert main(["scene", "import", str(path), *given, "--out", str(out)]) != 0
    assert said in capsys.readouterr().err
    assert not out.exists()


def test_a_breaking_load_with_a_stray_equals_sign_is_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["scene", "import", "legs.txt", "--breaking-load", "=2MN", "--out", "legs.yaml"])
    assert "'=2MN' names no line type before its =" in capsys.readouterr().err


WRONG: dict[str, tuple[Callable[[str], str], str]] = {
    "no lines": (lambda t: t.replace("--- LINES ---", "--- CABLES ---"), "no section LINES"),
    "no types": (lambda t: t.replace("--- LINE TYPES ---", "--- CABLES ---"), "section LINE TYPES"),
    "unknown type": (lambda t: t.replace("1 wire 1 2", "1 wirr 1 2"), "no line type wirr"),
    "unknown point": (lambda t: t.replace("1 wire 1 2", "1 wire 1 9"), "there is no point 9"),
    "a rod": (lambda t: t.replace("1 wire 1 2", "1 wire R1A 2"), "'R1A' is not the number of"),
    "a body's point": (lambda t: t.replace("2 Free 0", "2 Body1 0"), "a point of type body1"),
    "a mooring": (lambda t: t.replace("4 wire 5 6 100 10 -", "4 wire 1 6 500 10 -").replace(
        "2 Free 0 0 -100", "2 Anchor 0 0 -100").replace("2 leg 2 3 5 5 p\n3 leg 2 4 5 5 p\n", ""),
                  "held at both ends, and no payload or joint is between them"),
    "superscript": (lambda t: t.replace("1 wire 1 2", "1 wire 1 ²"), "'²' is not the number of"),
    "NUL bytes": (lambda t: t + "\0\0", "not text (byte 0x00 in line 35); give a whole deck"),
    "words": (lambda t: t.replace("100 20 p", "long 20 p"), "UnstrLen is 'long'"),
    "not finite": (lambda t: t.replace("wire 0.05 8.0", "wire 0.05 nan"), "mass_kg_per_m is 'nan'"),
    "negative": (lambda t: t.replace("wire 0.05", "wire -0.05"), "diameter_m is -0.05; give 0"),
    "a lookup table": (lambda t: t.replace("8.0 1e8", "8.0 ea.txt"), "EA is 'ea.txt'"),
    "short row": (lambda t: t.replace("4 wire 5 6 100 10 -", "4 wire 5"), "3 values; the columns"),
    "no column": (lambda t: t.replace("UnstrLen NumSegs", "Length NumSegs"), "no column unstrlen"),
    "no segments": (lambda t: t.replace("100 20 p", "100 0 p"), "a line of 100 m in 0 segments"),
    "double point": (lambda t: t.replace("4 Free 3", "3 Free 3"), "point 3 is double"),
    "no current file": (lambda t: t.replace("9.81 g", "1 Currents"), "cannot be read"),
    "nothing hangs": (lambda t: t.replace("1 Vessel", "1 Free").replace("Anchor", "Free"),
                      "no line of it leads down from a coupled or fixed point"),
    "no table": (lambda t: t[: t.index("--- LINES ---") + 14] + "ID\n--- need this line ---\n",
                 "no names and units of its columns"),
    "massless rope": (lambda t: t.replace("wire 0.05 8.0", "wire 0.05 0.0"), "no valid scene"),
}  # fmt: skip


@pytest.mark.parametrize("fault", WRONG)
def test_a_wrong_deck_is_refused_in_one_sentence(
    tmp_path: Path, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    spoil, words = WRONG[fault]
    path, out = tmp_path / "deck.txt", tmp_path / "out.yaml"
    text = spoil(TWO_LINES)
    assert text != TWO_LINES
    path.write_text(text)
    code = main(["scene", "import", str(path), "--breaking-load", "5MN", "--out", str(out)])
    said = capsys.readouterr().err
    assert code == 1
    assert words in said
    assert said.count("\n") == 1
    assert not out.exists()
    assert list(tmp_path.glob("*.yaml")) == []


def test_a_deck_in_latin_1_is_refused_in_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "lines.txt"
    path.write_bytes(b"Str\xe4nge\n" + TWO_LINES.encode())
    with pytest.raises(InputError) as caught:
        read_deck(path)
    right = "it is not UTF-8 text (byte 0xe4 at 3); save it as UTF-8, or give the path of a text"
    assert f"lines.txt: {right}" in str(caught.value)


def test_the_commands_write_files_and_json(
    lift: Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    deck = tmp_path / "deck" / "lines.txt"
    assert main(["scene", "export", "smooth_2km", "--moordyn", "--out", str(deck), "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["files"] == [str(deck), str(deck.parent / CURRENT_FILE)]
    assert len(shown["left_out"]) == 1
    out = tmp_path / "back.yaml"
    words = ["scene", "import", str(deck), "--breaking-load", "5MN", "--out", str(out), "--json"]
    assert main(words) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["scene"] == str(out)
    assert any("dtM" in one for one in shown["left_out"])
    assert main(words[:-1]) == 0
    assert capsys.readouterr().out.startswith(f"{out}: 1 rope, 1 payload\n")
    assert main(["scene", "export", "smooth_2km", "--out", str(deck)]) == 1
    assert "give --moordyn" in capsys.readouterr().err


def test_a_new_type_of_rope_is_another_line_type(lift: Scene) -> None:
    """Damping as a fraction of one element is MoorDyn's own negative number."""
    (line,) = lift.ropes
    damping = replace(line.damping, newton_seconds=None, fraction_of_one_element=0.8)
    deck, _ = deck_of(replace(lift, ropes=(replace(line, damping=damping),)))
    assert deck.types[0].damping == -0.8
    assert ("9.81", "g") in deck.options
