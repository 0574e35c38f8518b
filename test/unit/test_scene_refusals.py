"""Bad scenes: each gets one sentence that names the file, the place, the fault and the way out."""

from pathlib import Path

import pytest
from scene_text import GOOD, spoilt, written

from rope_twin.errors import SceneError
from rope_twin.scene.load import load_scene

LENGTH = "length_m: 500.0"
ROPE = "rope: steel_wire_40mm"
TO = "    to: tool\n"
DAMPING = "{fraction_of_first_axial_mode: 0.02}"
PROFILE = "[[0.0, [0.5, 0.0]], [-900.0, [0.1, 0.05]]]"
SECOND_ROW = "{at_s: 20.0, speed_m_per_s: -0.5}"
SECOND_ROPE = """\
  - {name: second, rope: hmpe_25mm, length_m: 90.0, elements: 9, damping: {newton_seconds: 1.0},
     fixed_at_m: [0.0, 0.0, -90.0]}
"""

# name: (scene text, path in the file, words that the sentence must hold)
BAD: dict[str, tuple[str, str, tuple[str, ...]]] = {
    # keys
    "misspelt key": (
        spoilt(LENGTH, "lenght_m: 500.0"),
        "ropes[0].lenght_m",
        ("unknown key", "did you mean 'length_m'?"),
    ),
    "unknown key at the top": (GOOD + "winsch: {}\n", "winsch", ("did you mean 'winch'?",)),
    "unknown key without a like": (
        GOOD + "zzzz: 1\n",
        "zzzz",
        ("unknown key", "known: about", "winch"),
    ),
    "key that the reader sets": (GOOD + "digest: abc\n", "digest", ("unknown key",)),
    "key of the wrong part": (
        spoilt("mass_kg: 20000.0", "mass_kg: 20000.0\n    length_m: 3.0"),
        "payloads[0].length_m",
        ("unknown key",),
    ),
    "missing key": (
        spoilt(f"    {LENGTH}\n", ""),
        "ropes[0]",
        ("length_m missing", "line out at the start", "1 to 20000 m"),
    ),
    "missing part": (
        spoilt("time: {step_s: 0.01, newton_tolerance_n: 100.0}\n", ""),
        "",
        ("time missing",),
    ),
    "several missing keys": (
        spoilt(f"    {LENGTH}\n    elements: 50\n", ""),
        "ropes[0]",
        ("length_m, elements missing",),
    ),
    "duplicate key": (
        spoilt(LENGTH, "length_m: 500.0\n    length_m: 600.0"),
        "ropes[0].length_m",
        ("second time", "first in line 7", "keep one"),
    ),
    "duplicate part": (GOOD + "about: again\n", "about", ("second time", "first in line 1")),
    "key that is a list": (GOOD + "? [a, b]\n: 1\n", "", ("key", "list", "word")),
    "merge key": (GOOD + "<<: {about: x}\n", "'<<'", ("unknown key",)),
    # kinds of values
    "quoted number": (
        spoilt(LENGTH, 'length_m: "500"'),
        "ropes[0].length_m",
        ("'500' is not a number", "without quotes"),
    ),
    "words for a number": (
        spoilt(LENGTH, "length_m: long"),
        "ropes[0].length_m",
        ("'long' is not a number", "1 to 20000 m"),
    ),
    "number with a unit": (
        spoilt(LENGTH, "length_m: 500 m"),
        "ropes[0].length_m",
        ("'500 m' is not a number",),
    ),
    "true for a number": (
        spoilt(LENGTH, "length_m: true"),
        "ropes[0].length_m",
        ("true", "is not a number"),
    ),
    "no value": (spoilt(LENGTH, "length_m:"), "ropes[0].length_m", ("no value", "leave the key")),
    "list for a number": (
        spoilt(LENGTH, "length_m: [500.0]"),
        "ropes[0].length_m",
        ("a list is not a number",),
    ),
    "exponent without a dot": (
        spoilt(LENGTH, "length_m: 5e2"),
        "ropes[0].length_m",
        ("'5e2' is text", "YAML 1.1", "a number: 500.0"),
    ),
    "exponent without a sign": (
        spoilt("mass_kg: 20000.0", "mass_kg: 2.0e4"),
        "payloads[0].mass_kg",
        ("'2.0e4' is text", "a number: 20000.0"),
    ),
    "octal": (spoilt("elements: 50", "elements: 050"), "ropes[0].elements", ("different numbers",)),
    "hexadecimal": (
        spoilt("elements: 50", "elements: 0x32"),
        "ropes[0].elements",
        ("different numbers", "plain number"),
    ),
    "sexagesimal": (
        spoilt("start_s: 10.0", "start_s: 1:30"),
        "sea_state.start_s",
        ("'1:30'", "different numbers"),
    ),
    "underscores": (
        spoilt("mass_kg: 20000.0", "mass_kg: 20_000"),
        "payloads[0].mass_kg",
        ("'20_000'", "different numbers"),
    ),
    "decimal comma": (
        spoilt(LENGTH, 'length_m: "500,0"'),
        "ropes[0].length_m",
        ("'500,0' is not a number",),
    ),
    "yes for true": (
        spoilt("loop: true", "loop: yes"),
        "sea_state.loop",
        ("'yes'", "write true or false"),
    ),
    "one for true": (spoilt("loop: true", "loop: 1"), "sea_state.loop", ("is not true or false",)),
    "no for a name": (
        spoilt("name: hoist", "name: no"),
        "ropes[0].name",
        ("'no' is true or false in YAML 1.1", "quotes"),
    ),
    "number for a name": (
        spoilt("name: hoist", "name: 40"),
        "ropes[0].name",
        ("the number 40 is not text", "quotes"),
    ),
    "date for a text": (
        spoilt("source: made up", "source: 2024-01-01"),
        "source",
        ("is a date", "quotes"),
    ),
    "empty name": (spoilt("name: hoist", 'name: ""'), "ropes[0].name", ("name is empty",)),
    "fraction for a count": (
        spoilt("elements: 50", "elements: 50.5"),
        "ropes[0].elements",
        ("50.5 is not a whole number", "3 to 20000"),
    ),
    "whole float for a count": (
        spoilt("elements: 50", "elements: 50.0"),
        "ropes[0].elements",
        ("not a whole number",),
    ),
    "text for a mapping": (
        spoilt("time: {step_s: 0.01, newton_tolerance_n: 100.0}", "time: fast"),
        "time",
        ("the text 'fast' instead of a mapping", "step_s"),
    ),
    "mapping for a list": (
        spoilt(
            "  - payload: {}\n  - drag: {normal: 1.2, tangential: 0.02}\n"
            f"  - current: {{profile: {PROFILE}}}\n  - weight: {{}}\n",
            "  weight: {}\n",
        ),
        "effects",
        ("a mapping instead of a list", "- weight: {}"),
    ),
    # ranges
    "negative length": (
        spoilt(LENGTH, "length_m: -500.0"),
        "ropes[0].length_m",
        ("-500 m is out of range", "1 to 20000 m"),
    ),
    "step too long": (spoilt("step_s: 0.01", "step_s: 1.0"), "time.step_s", ("1e-05 to 0.2 s",)),
    "nan": (spoilt(LENGTH, "length_m: .nan"), "ropes[0].length_m", ("nan m is not finite",)),
    "infinity": (spoilt(LENGTH, "length_m: -.inf"), "ropes[0].length_m", ("-inf m is not finite",)),
    "overflow": (
        spoilt(LENGTH, "length_m: 1.0e+999"),
        "ropes[0].length_m",
        ("inf m is not finite",),
    ),
    "number of a thousand digits": (
        spoilt("elements: 50", f"elements: {'9' * 5000}"),
        "ropes[0].elements",
        ("not a whole number",),
    ),
    "two elements": (spoilt("elements: 50", "elements: 2"), "ropes[0].elements", ("3 to 20000",)),
    "short list": (
        spoilt("[0.0, 0.0, 0.0]", "[0.0, 0.0]"),
        "ship.hang_off_m",
        ("2 values", "give 3"),
    ),
    "long list": (
        spoilt("[0.0, 0.0, 0.0]", "[0.0, 0.0, 0.0, 0.0]"),
        "ship.hang_off_m",
        ("4 values", "give 3"),
    ),
    "words in a list": (
        spoilt("[0.0, 0.0, 0.0]", "[0.0, up, 0.0]"),
        "ship.hang_off_m[1]",
        ("'up' is not a number",),
    ),
    # references and what must hold between values
    "unknown preset": (
        spoilt(ROPE, "rope: steel_wire_41mm"),
        "ropes[0].rope",
        ("'steel_wire_41mm'", "did you mean 'steel_wire_40mm'?"),
    ),
    "rope as a number": (spoilt(ROPE, "rope: 40"), "ropes[0].rope", ("is no rope", "preset")),
    "rope with a figure missing": (
        spoilt(ROPE, "rope: {diameter_m: 0.04, mass_kg_per_m: 6.4}"),
        "ropes[0].rope",
        ("hydrodynamic_diameter_m, axial_stiffness_n, breaking_load_n missing",),
    ),
    "payload that is not there": (
        spoilt("to: tool", "to: tol"),
        "ropes[0].to",
        ("no payload 'tol'", "did you mean 'tool'?"),
    ),
    "lower end left open": (spoilt(TO, ""), "ropes[0]", ("neither", "`to`", "`fixed_at_m`")),
    "lower end held twice": (
        spoilt(TO, TO + "    fixed_at_m: [0.0, 0.0, -500.0]\n"),
        "ropes[0]",
        ("both `to` and `fixed_at_m`",),
    ),
    "payload that nobody holds": (
        spoilt(TO, "    fixed_at_m: [0.0, 0.0, -500.0]\n"),
        "payloads[0]",
        ("no rope holds 'tool'",),
    ),
    "two payloads with one name": (
        spoilt("payloads:\n", "payloads:\n  - {name: tool, mass_kg: 1.0, shape: {sphere: "
               "{diameter_m: 1.0}}}\n"),
        "payloads[0].name",
        ("2 payloads are named 'tool'",),
    ),
    "no rope": (GOOD[: GOOD.index("ropes:")] + "ropes: []\n" + GOOD[GOOD.index("payloads:") :],
                "ropes", ("0 ropes are given", "exactly one")),
    "two ropes": (
        spoilt("payloads:\n", SECOND_ROPE + "payloads:\n"),
        "ropes",
        ("2 ropes", "exactly one"),
    ),
    "two ropes with one name": (
        spoilt("payloads:\n", SECOND_ROPE.replace("name: second", "name: hoist") + "payloads:\n"),
        "ropes[0].name",
        ("2 ropes are named 'hoist'",),
    ),
    "no damping": (spoilt(DAMPING, "{}"), "ropes[0].damping", ("no damping", "exactly one")),
    "two dampings": (
        spoilt(DAMPING, "{fraction_of_first_axial_mode: 0.02, newton_seconds: 1000.0}"),
        "ropes[0].damping",
        ("two dampings", "exactly one"),
    ),
    "unknown shape": (
        spoilt("{box: {length_m: 3.0, width_m: 2.0, height_m: 1.5}}", "{boks: {}}"),
        "payloads[0].shape.boks",
        ("did you mean 'box'?",),
    ),
    "two shapes": (
        spoilt("{box: {length_m: 3.0, width_m: 2.0, height_m: 1.5}}", "{box: {}, sphere: {}}"),
        "payloads[0].shape",
        ("2 keys instead of one", "box, cylinder, sphere"),
    ),
    "shape with a side missing": (
        spoilt(", height_m: 1.5", ""),
        "payloads[0].shape.box",
        ("height_m missing", "along z"),
    ),
    "neither shape nor figures": (
        spoilt("    shape: {box: {length_m: 3.0, width_m: 2.0, height_m: 1.5}}\n", ""),
        "payloads[0]",
        ("displaced_volume_m3, added_mass_kg, drag_area_m2", "add a shape"),
    ),
    # winch
    "line out beyond the rope there is": (
        spoilt("most_line_out_m: 800.0", "most_line_out_m: 400.0"),
        "ropes[0].length_m",
        ("500 m lies outside", "50 to 400 m"),
    ),
    "line out below the least": (
        spoilt("least_line_out_m: 50.0", "least_line_out_m: 600.0"),
        "ropes[0].length_m",
        ("500 m lies outside",),
    ),
    "least above most": (
        spoilt("least_line_out_m: 50.0", "least_line_out_m: 900.0"),
        "winch.least_line_out_m",
        ("not below most_line_out_m (800 m)",),
    ),
    "schedule out of order": (
        spoilt(SECOND_ROW, SECOND_ROW + "\n    - {at_s: 10.0, speed_m_per_s: 0.0}"),
        "winch.schedule[2].at_s",
        ("10 s comes after 20 s", "order"),
    ),
    "one time twice": (
        spoilt(SECOND_ROW, "{at_s: 0.0, speed_m_per_s: -0.5}"),
        "winch.schedule[1].at_s",
        ("each time once",),
    ),
    "faster than the winch": (
        spoilt(SECOND_ROW, "{at_s: 20.0, speed_m_per_s: -1.5}"),
        "winch.schedule[1].speed_m_per_s",
        ("-1.5 m/s is over the winch's 1",),
    ),
    "repeat before the last row": (
        spoilt("repeats_every_s: 40.0", "repeats_every_s: 20.0"),
        "winch.schedule_repeats_every_s",
        ("20 s cuts off the row at 20 s",),
    ),
    "repeat of nothing": (
        spoilt("schedule:\n    - {at_s: 0.0, speed_m_per_s: 0.5}\n    - " + SECOND_ROW, "schedule: []"),
        "winch.schedule_repeats_every_s",
        ("no schedule to repeat",),
    ),
    # effects
    "unknown effect": (
        spoilt("- weight: {}", "- wieght: {}"),
        "effects[3].wieght",
        ("did you mean 'weight'?",),
    ),
    "effect as a word": (
        spoilt("- weight: {}", "- weight"),
        "effects[3]",
        ("'weight' alone", "`weight: {}`"),
    ),
    "effect without a value": (
        spoilt("- weight: {}", "- weight:"),
        "effects[3].weight",
        ("nothing instead of a mapping", "{}"),
    ),
    "effect listed twice": (
        spoilt("- weight: {}", "- weight: {}\n  - payload: {}"),
        "effects[4].payload",
        ("second time",),
    ),
    "key that an effect does not have": (
        spoilt("- weight: {}", "- weight: {kg: 1.0}"),
        "effects[3].weight.kg",
        ("unknown key", "leave it out"),
    ),
    "drag without a coefficient": (
        spoilt(", tangential: 0.02", ""),
        "effects[1].drag",
        ("tangential missing",),
    ),
    "payload effect without payloads": (
        spoilt(TO, "    fixed_at_m: [0.0, 0.0, -500.0]\n").replace(
            GOOD[GOOD.index("payloads:") : GOOD.index("winch:")], ""
        ),
        "effects",
        ("`payload` is listed but no payload is",),
    ),
    "current out of order": (
        spoilt(PROFILE, "[[-900.0, [0.1, 0.05]], [0.0, [0.5, 0.0]]]"),
        "effects[2].current",
        ("z = 0 m follows z = -900 m", "from the surface down"),
    ),
    "current without rows": (spoilt(PROFILE, "[]"), "effects[2].current", ("no row",)),
    "current with a flat row": (
        spoilt(PROFILE, "[[0.0, 0.5, 0.0]]"),
        "effects[2].current.profile[0]",
        ("3 values", "give 2"),
    ),
    "current that is not finite": (
        spoilt(PROFILE, "[[0.0, [.nan, 0.0]]]"),
        "effects[2].current.profile[0][1][0]",
        ("not finite",),
    ),
    # bags
    "bag that is not there": (
        spoilt("{start_s", "{bag: sea_2p6m, start_s"),
        "sea_state.bag",
        ("no bag 'sea_2p6m' in bags/",),
    ),
    "path of no bag": (
        spoilt("{start_s", "{bag: ./nowhere/bag, start_s"),
        "sea_state.bag",
        ("there is no bag at", "nowhere/bag"),
    ),
    # YAML itself
    "empty file": ("", "", ("file is empty", "mapping")),
    "only a comment": ("# nothing\n", "", ("file is empty",)),
    "a list at the top": ("- about: x\n", "", ("its top is a list, not a mapping",)),
    "a word at the top": ("about\n", "", ("its top is the text 'about'",)),
    "two documents": (GOOD + "---\nabout: x\n", "", ("not YAML", "single document")),
    "bracket left open": (spoilt("loop: true}", "loop: true"), "", ("not YAML", "brackets")),
    "tab as indentation": (spoilt("    to: tool", "\tto: tool"), "", ("not YAML",)),
    "control character": (GOOD + "look_at: \x07\n", "", ("not YAML",)),
    "python object": (GOOD + "x: !!python/object:os.system {}\n", "", ("tag", "not read")),
    "tagged number": (spoilt(LENGTH, "length_m: !!float 5"), "", ("tag", "leave it out")),
    "alias": (
        spoilt("name: hoist", "name: &n hoist").replace("to: tool", "to: *n"),
        "",
        ("alias", "write the value out"),
    ),
    "alias bomb": (
        "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\nd: [*c, *c]\n",
        "",
        ("alias",),
    ),
    "alias of itself": ("a: &a [*a]\n", "", ("alias",)),
    "endless nesting": ("a: " + "[" * 20000, "", ("32 levels of nesting",)),
    "huge file": ("# " + "x" * 1_000_001, "", ("larger than 1000 kB",)),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_scene_gets_its_sentence(name: str, tmp_path: Path) -> None:
    text, place, words = BAD[name]
    path = written(tmp_path, text)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert len(sentence) < 500
    assert sentence[-1] in ".?"
    where, what, right = _parts(sentence)
    assert where.startswith(str(path))
    assert where.removeprefix(str(path)).partition(", line ")[2].partition(", ")[2] == place
    assert what
    assert right
    for word in words:
        assert word in sentence


def _parts(sentence: str) -> tuple[str, str, str]:
    where, _, rest = sentence.partition(": ")
    what, _, right = rest.partition("; ")
    return where, what, right


def test_the_line_is_that_of_the_key(tmp_path: Path) -> None:
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
def test_a_file_that_is_no_text(data: bytes, words: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=words):
        load_scene(written(tmp_path, data))


def test_paths_that_are_no_scene(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="there is no such file"):
        load_scene(tmp_path / "nowhere.yaml")
    with pytest.raises(SceneError, match="it is a folder"):
        load_scene(tmp_path)
    with pytest.raises(SceneError, match="there is no such file"):
        load_scene("nowhere.yaml")


def test_unknown_name_is_told_the_nearest() -> None:
    with pytest.raises(SceneError, match=r"'deep_lft'.* did you mean 'deep_lift'\?"):
        load_scene("deep_lft")
    with pytest.raises(SceneError, match="no such scene"):
        load_scene("")
