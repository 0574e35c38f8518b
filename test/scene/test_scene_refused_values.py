"""Scenes with an invalid key, value or text: one sentence with place, fault and remedy."""

from pathlib import Path

import pytest
from scene_text import GOOD, assert_refused, spoilt, written

from rope_twin.errors import SceneError
from rope_twin.files import share_dir
from rope_twin.scene.load import load_scene

LENGTH = "length_m: 500.0"
EFFECTS = GOOD[GOOD.index("  - payload") : GOOD.index("time:")]

FIGURES = (
    "{diameter_m: 0.04, mass_kg_per_m: 6.4, hydrodynamic_diameter_m: 0.032,"
    " axial_stiffness_n: 6.4e+7, breaking_load_n: 1.0e+6, "
)

Row = tuple[str, str, str, tuple[str, ...]]  # name, scene, path in it, words of the sentence

BAD: list[Row] = [
    ("misspelt key",
     spoilt(LENGTH, "lenght_m: 500.0"),
     "ropes[0].lenght_m", ("unknown key", "did you mean 'length_m'?")),
    ("unknown key at the top", GOOD + "winsch: {}\n", "winsch", ("did you mean 'winch'?",)),
    ("unknown key without a like",
     GOOD + "zzzz: 1\n", "zzzz", ("unknown key", "known: about", "winch")),
    ("key that the reader sets", GOOD + "digest: abc\n", "digest", ("unknown key",)),
    ("key of the wrong part",
     spoilt("mass_kg: 20000.0", "mass_kg: 20000.0\n    length_m: 3.0"),
     "payloads[0].length_m", ("unknown key",)),
    ("missing key",
     spoilt(f"    {LENGTH}\n", ""),
     "ropes[0]", ("length_m missing", "initial paid-out length", "1 to 20000 m")),
    ("missing part",
     spoilt("time: {step_s: 0.01, newton_tolerance_n: 100.0}\n", ""), "", ("time missing",)),
    ("several missing keys",
     spoilt(f"    {LENGTH}\n    elements: 50\n", ""), "ropes[0]", ("length_m, elements missing",)),
    ("duplicate key",
     spoilt(LENGTH, "length_m: 500.0\n    length_m: 600.0"),
     "ropes[0].length_m", ("second time", "first in line 7", "keep one")),
    ("duplicate part", GOOD + "about: again\n", "about", ("second time", "first in line 1")),
    ("key that is a list", GOOD + "? [a, b]\n: 1\n", "", ("key", "list", "word")),
    ("merge key", GOOD + "<<: {about: x}\n", "'<<'", ("unknown key",)),
    ("quoted number",
     spoilt(LENGTH, 'length_m: "500"'),
     "ropes[0].length_m", ("'500' is not a number", "without quotes")),
    ("words for a number",
     spoilt(LENGTH, "length_m: long"),
     "ropes[0].length_m", ("'long' is not a number", "1 to 20000 m")),
    ("number with a unit",
     spoilt(LENGTH, "length_m: 500 m"), "ropes[0].length_m", ("'500 m' is not a number",)),
    ("true for a number",
     spoilt(LENGTH, "length_m: true"), "ropes[0].length_m", ("true", "is not a number")),
    ("no value", spoilt(LENGTH, "length_m:"), "ropes[0].length_m", ("no value", "remove the key")),
    ("list for a number",
     spoilt(LENGTH, "length_m: [500.0]"), "ropes[0].length_m", ("a list is not a number",)),
    ("exponent without a dot",
     spoilt(LENGTH, "length_m: 5e2"),
     "ropes[0].length_m", ("'5e2' is text", "YAML 1.1", "a number: 500.0")),
    ("exponent without a sign",
     spoilt("mass_kg: 20000.0", "mass_kg: 2.0e4"),
     "payloads[0].mass_kg", ("'2.0e4' is text", "a number: 20000.0")),
    ("no bend radius",
     spoilt("steel_wire_40mm", FIGURES + "minimum_bend_radius_m: 0.0}"),
     "ropes[0].rope.minimum_bend_radius_m", ("0 m is out of range", "0.001 to 1000 m", "bend")),
    ("negative bend radius",
     spoilt("steel_wire_40mm", FIGURES + "minimum_bend_radius_m: -1.5}"),
     "ropes[0].rope.minimum_bend_radius_m", ("-1.5 m is out of range",)),
    ("octal", spoilt("elements: 50", "elements: 050"), "ropes[0].elements", ("different numbers",)),
    ("hexadecimal",
     spoilt("elements: 50", "elements: 0x32"),
     "ropes[0].elements", ("different numbers", "plain number")),
    ("sexagesimal",
     spoilt("start_s: 10.0", "start_s: 1:30"),
     "sea_state.start_s", ("'1:30'", "different numbers")),
    ("underscores",
     spoilt("mass_kg: 20000.0", "mass_kg: 20_000"),
     "payloads[0].mass_kg", ("'20_000'", "different numbers")),
    ("decimal comma",
     spoilt(LENGTH, 'length_m: "500,0"'), "ropes[0].length_m", ("'500,0' is not a number",)),
    ("yes for true",
     spoilt("loop: true", "loop: yes"), "sea_state.loop", ("'yes'", "write true or false")),
    ("one for true", spoilt("loop: true", "loop: 1"), "sea_state.loop", ("is not true or false",)),
    ("no for a name",
     spoilt("name: hoist", "name: no"),
     "ropes[0].name", ("'no' is true or false in YAML 1.1", "quotes")),
    ("number for a name",
     spoilt("name: hoist", "name: 40"), "ropes[0].name", ("the number 40 is not text", "quotes")),
    ("date for a text",
     spoilt("source: made up", "source: 2024-01-01"), "source", ("is a date", "quotes")),
    ("empty name", spoilt("name: hoist", 'name: ""'), "ropes[0].name", ("name is empty",)),
    ("fraction for a count",
     spoilt("elements: 50", "elements: 50.5"),
     "ropes[0].elements", ("50.5 is not a whole number", "3 to 20000")),
    ("whole float for a count",
     spoilt("elements: 50", "elements: 50.0"), "ropes[0].elements", ("not a whole number",)),
    ("text for a mapping",
     spoilt("time: {step_s: 0.01, newton_tolerance_n: 100.0}", "time: fast"),
     "time", ("the text 'fast' instead of a mapping", "step_s")),
    ("mapping for a list",
     spoilt(EFFECTS, "  weight: {}\n"),
     "effects", ("a mapping instead of a list", "- weight: {}")),
    ("negative length",
     spoilt(LENGTH, "length_m: -500.0"),
     "ropes[0].length_m", ("-500 m is out of range", "1 to 20000 m")),
    ("step too long", spoilt("step_s: 0.01", "step_s: 1.0"), "time.step_s", ("1e-05 to 0.2 s",)),
    ("nan", spoilt(LENGTH, "length_m: .nan"), "ropes[0].length_m", ("nan m is not finite",)),
    ("infinity", spoilt(LENGTH, "length_m: -.inf"), "ropes[0].length_m", ("-inf m is not finite",)),
    ("overflow",
     spoilt(LENGTH, "length_m: 1.0e+999"), "ropes[0].length_m", ("inf m is not finite",)),
    ("number of a thousand digits",
     spoilt("elements: 50", f"elements: {'9' * 5000}"),
     "ropes[0].elements", ("not a whole number",)),
    ("two elements", spoilt("elements: 50", "elements: 2"), "ropes[0].elements", ("3 to 20000",)),
    ("short list",
     spoilt("[0.0, 0.0, 0.0]", "[0.0, 0.0]"), "ship.hang_off_m", ("2 values", "give 3")),
    ("long list",
     spoilt("[0.0, 0.0, 0.0]", "[0.0, 0.0, 0.0, 0.0]"), "ship.hang_off_m", ("4 values", "give 3")),
    ("words in a list",
     spoilt("[0.0, 0.0, 0.0]", "[0.0, up, 0.0]"), "ship.hang_off_m[1]", ("'up' is not a number",)),
    ("empty file", "", "", ("file is empty", "mapping")),
    ("only a comment", "# nothing\n", "", ("file is empty",)),
    ("a list at the top", "- about: x\n", "", ("its top is a list, not a mapping",)),
    ("a word at the top", "about\n", "", ("its top is the text 'about'",)),
    ("two documents", GOOD + "---\nabout: x\n", "", ("not YAML", "single document")),
    ("bracket left open", spoilt("loop: true}", "loop: true"), "", ("not YAML", "brackets")),
    ("tab as indentation", spoilt("    to: tool", "\tto: tool"), "", ("not YAML",)),
    ("control character", GOOD + "look_at: \x07\n", "", ("not YAML",)),
    ("python object", GOOD + "x: !!python/object:os.system {}\n", "", ("tag", "not supported")),
    ("tagged number", spoilt(LENGTH, "length_m: !!float 5"), "", ("tag", "remove it")),
    ("alias",
     spoilt("name: hoist", "name: &n hoist").replace("to: tool", "to: *n"),
     "", ("alias", "write the value out")),
    ("alias bomb", "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\nd: [*c, *c]\n", "", ("alias",)),
    ("alias of itself", "a: &a [*a]\n", "", ("alias",)),
    ("endless nesting", "a: " + "[" * 20000, "", ("32 levels of nesting",)),
    ("huge file", "# " + "x" * 1_000_001, "", ("larger than 1000 kB",)),
]  # fmt: skip


@pytest.mark.parametrize("row", BAD, ids=[row[0] for row in BAD])
def test_invalid_values_are_rejected(row: Row, tmp_path: Path) -> None:
    _, text, position, words = row
    assert_refused(text, position, words, tmp_path)


def test_the_reported_line_is_that_of_the_key(tmp_path: Path) -> None:
    path = written(tmp_path, spoilt("    to: tool", "    to: nobody"))
    with pytest.raises(SceneError, match=r"scene\.yaml, line 10, ropes\[0\]\.to: "):
        load_scene(path)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\x89PNG\r\n\x1a\n\x00\x00", "not UTF-8"),
        (b"\x00\x01\x02", "not YAML"),
        ("about: ü\n".encode("latin-1"), "not UTF-8"),
        (GOOD.encode("utf-16"), "not UTF-8"),
    ],
)
def test_a_file_that_is_not_text_is_rejected(data: bytes, words: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=words):
        load_scene(written(tmp_path, data))


def test_paths_that_are_not_scenes_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="there is no such file"):
        load_scene(tmp_path / "nowhere.yaml")
    with pytest.raises(SceneError, match="it is a folder"):
        load_scene(tmp_path)
    with pytest.raises(SceneError, match="there is no such file"):
        load_scene("nowhere.yaml")


@pytest.mark.parametrize(("command", "name"), [("plan", "landing"), ("study", "sea_and_load")])
def test_files_of_other_commands_are_recognised(command: str, name: str) -> None:
    folder = {"plan": "plans", "study": "studies"}[command]
    with pytest.raises(SceneError, match=f"the file of a {command}, not a scene; run `rope_twin"):
        load_scene(share_dir() / "config" / folder / f"{name}.yaml")


def test_an_unknown_preset_lists_the_presets(tmp_path: Path) -> None:
    """Not the nearest name alone, which is another strength."""
    wrong = spoilt("steel_wire_40mm", "steel_wire_40")
    with pytest.raises(SceneError, match=r"by its properties, .* one of: .*steel_wire_40mm, steel"):
        load_scene(written(tmp_path, wrong))


def test_an_unknown_name_is_reported_with_the_nearest() -> None:
    with pytest.raises(SceneError, match=r"'deep_lft'.* did you mean 'deep_lift'\?"):
        load_scene("deep_lft")
    with pytest.raises(SceneError, match="no such scene"):
        load_scene("")
