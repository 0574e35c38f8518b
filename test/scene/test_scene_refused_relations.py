"""Scenes whose values contradict each other: one sentence with place, fault and remedy."""

from pathlib import Path

import pytest
from scene_text import GOOD, assert_refused, spoilt

ROPE = "rope: steel_wire_40mm"
TO = "    to: tool\n"
FIXED = "    fixed_at_m: [0.0, 0.0, -500.0]\n"
DAMPING = "{fraction_of_first_axial_mode: 0.02}"
SHAPE = "{box: {length_m: 3.0, width_m: 2.0, height_m: 1.5}}"
PROFILE = "[[0.0, [0.5, 0.0]], [-900.0, [0.1, 0.05]]]"
FIRST_ROW, SECOND_ROW = "{at_s: 0.0, speed_m_per_s: 0.5}", "{at_s: 20.0, speed_m_per_s: -0.5}"
SECOND_ROPE = """\
  - {name: second, rope: hmpe_25mm, length_m: 90.0, elements: 9, damping: {newton_seconds: 1.0},
     fixed_at_m: [0.0, 0.0, -90.0]}
"""

Row = tuple[str, str, str, tuple[str, ...]]  # name, scene, path in it, words of the sentence

BAD: list[Row] = [
    ("unknown preset",
     spoilt(ROPE, "rope: steel_wire_41"),
     "ropes[0].rope", ("'steel_wire_41'", "such as steel_wire_52mm, or one of: chain")),
    ("rope as a number", spoilt(ROPE, "rope: 40"), "ropes[0].rope", ("is not a rope", "preset")),
    ("rope with a figure missing",
     spoilt(ROPE, "rope: {diameter_m: 0.04, mass_kg_per_m: 6.4}"),
     "ropes[0].rope", ("hydrodynamic_diameter_m, breaking_load_n missing",)),
    ("payload that is not there",
     spoilt("to: tool", "to: tol"), "ropes[0].to", ("no payload 'tol'", "did you mean 'tool'?")),
    ("lower end left open", spoilt(TO, ""), "ropes[0]", ("neither", "`to`", "`fixed_at_m`")),
    ("lower end held twice",
     spoilt(TO, TO + FIXED),
     "ropes[0]", ("both `to` and `fixed_at_m`",)),
    ("payload that nobody holds",
     spoilt(TO, FIXED), "payloads[0]", ("no rope holds 'tool'",)),
    ("two payloads with one name",
     spoilt("payloads:\n", "payloads:\n  - {name: tool, mass_kg: 1.0, shape: {sphere: {}}}\n")
     .replace("{sphere: {}}", "{sphere: {diameter_m: 1.0}}"),
     "payloads[0].name", ("2 payloads are named 'tool'",)),
    ("no rope",
     GOOD[: GOOD.index("ropes:")] + "ropes: []\n" + GOOD[GOOD.index("payloads:") :],
     "ropes", ("no rope is given",)),
    ("two ropes of one winch",
     spoilt("payloads:\n", SECOND_ROPE + "payloads:\n"),
     "ropes[0].from", ("2 ropes come from the winch", "hang_offs")),
    ("two ropes with one name",
     spoilt("payloads:\n", SECOND_ROPE.replace("name: second", "name: hoist") + "payloads:\n"),
     "ropes[0].name", ("2 ropes are named 'hoist'",)),
    ("no damping", spoilt(DAMPING, "{}"), "ropes[0].damping", ("no damping", "exactly one")),
    ("two dampings",
     spoilt(DAMPING, "{fraction_of_first_axial_mode: 0.02, newton_seconds: 1000.0}"),
     "ropes[0].damping", ("two dampings", "exactly one")),
    ("diameter beside the rope",
     spoilt(ROPE, ROPE + "\n    diameter_m: 0.05"),
     "ropes[0].diameter_m", ("it belongs to `rope`, as `rope: {diameter_m: ...}`",)),
    ("unknown shape",
     spoilt(SHAPE, "{boks: {}}"),
     "payloads[0].shape.boks", ("did you mean 'box'?",)),
    ("two shapes",
     spoilt(SHAPE, "{box: {}, sphere: {}}"),
     "payloads[0].shape", ("2 keys instead of one", "box, cylinder, sphere")),
    ("shape with a side missing",
     spoilt(", height_m: 1.5", ""), "payloads[0].shape.box", ("height_m missing", "along z")),
    ("neither shape nor figures",
     spoilt(f"    shape: {SHAPE}\n", ""),
     "payloads[0]", ("displaced_volume_m3, added_mass_kg, drag_area_m2", "add a shape")),
    ("line out beyond the rope there is",
     spoilt("max_line_out_m: 800.0", "max_line_out_m: 400.0"),
     "ropes[0].length_m", ("500 m is outside", "50 to 400 m")),
    ("line out below the least",
     spoilt("min_line_out_m: 50.0", "min_line_out_m: 600.0"),
     "ropes[0].length_m", ("500 m is outside",)),
    ("least above most",
     spoilt("min_line_out_m: 50.0", "min_line_out_m: 900.0"),
     "winch.min_line_out_m", ("not below max_line_out_m (800 m)",)),
    ("schedule out of order",
     spoilt(SECOND_ROW, SECOND_ROW + "\n    - {at_s: 10.0, speed_m_per_s: 0.0}"),
     "winch.schedule[2].at_s", ("10 s comes after 20 s", "order")),
    ("one time twice",
     spoilt(SECOND_ROW, "{at_s: 0.0, speed_m_per_s: -0.5}"),
     "winch.schedule[1].at_s", ("each time once",)),
    ("faster than the winch",
     spoilt(SECOND_ROW, "{at_s: 20.0, speed_m_per_s: -1.5}"),
     "winch.schedule[1].speed_m_per_s", ("-1.5 m/s exceeds the winch's 1",)),
    ("repeat before the last row",
     spoilt("repeats_every_s: 40.0", "repeats_every_s: 20.0"),
     "winch.schedule_repeats_every_s", ("20 s cuts off the row at 20 s",)),
    ("repeat of nothing",
     spoilt(f"schedule:\n    - {FIRST_ROW}\n    - {SECOND_ROW}", "schedule: []"),
     "winch.schedule_repeats_every_s", ("no schedule to repeat",)),
    ("unknown effect",
     spoilt("- weight: {}", "- wieght: {}"), "effects[3].wieght", ("did you mean 'weight'?",)),
    ("effect as a word",
     spoilt("- weight: {}", "- weight"), "effects[3]", ("'weight' alone", "`weight: {}`")),
    ("effect without a value",
     spoilt("- weight: {}", "- weight:"),
     "effects[3].weight", ("nothing instead of a mapping", "{}")),
    ("effect listed twice",
     spoilt("- weight: {}", "- weight: {}\n  - payload: {}"),
     "effects[4].payload", ("second time",)),
    ("key that an effect does not have",
     spoilt("- weight: {}", "- weight: {kg: 1.0}"),
     "effects[3].weight.kg", ("unknown key", "remove it")),
    ("drag without a coefficient",
     spoilt(", tangential: 0.02", ""), "effects[1].drag", ("tangential missing",)),
    ("payload effect without payloads",
     spoilt(TO, FIXED).replace(GOOD[GOOD.index("payloads:") : GOOD.index("winch:")], ""),
     "effects", ("`payload` is listed but no payload is",)),
    ("current out of order",
     spoilt(PROFILE, "[[-900.0, [0.1, 0.05]], [0.0, [0.5, 0.0]]]"),
     "effects[2].current", ("z = 0 m follows z = -900 m", "from the surface down")),
    ("current without rows", spoilt(PROFILE, "[]"), "effects[2].current", ("profile is empty",)),
    ("current with a flat row",
     spoilt(PROFILE, "[[0.0, 0.5, 0.0]]"),
     "effects[2].current.profile[0]", ("3 values", "give 2")),
    ("current that is not finite",
     spoilt(PROFILE, "[[0.0, [.nan, 0.0]]]"),
     "effects[2].current.profile[0][1][0]", ("not finite",)),
    ("bag that is not there",
     spoilt("{start_s", "{bag: sea_2p6m, start_s"),
     "sea_state.bag", ("no bag 'sea_2p6m' in bags/",)),
    ("path of no bag",
     spoilt("{start_s", "{bag: ./nowhere/bag, start_s"),
     "sea_state.bag", ("there is no bag at", "nowhere/bag")),
]  # fmt: skip


@pytest.mark.parametrize("row", BAD, ids=[row[0] for row in BAD])
def test_contradicting_values_are_rejected(row: Row, tmp_path: Path) -> None:
    _, text, position, words = row
    assert_refused(text, position, words, tmp_path)
