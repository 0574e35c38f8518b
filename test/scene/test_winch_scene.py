"""Winch components of a scene: invalid ones are rejected in one sentence with the remedy."""

from pathlib import Path

import pytest
from scene_text import GOOD, assert_refused, spoilt, written

from rope_twin.scene.convergence import scene_digest
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.winch import ScheduleRow

LEAST = "  min_line_out_m: 50.0\n"
SECOND_ROW = "{at_s: 20.0, speed_m_per_s: -0.5}"
DRUM = "  drum: {core_radius_m: 0.8, turns_per_layer: 40}\n"
DRIVE = "  drive: {inertia_kg_m2: 3000.0, torque_limit_n_m: 300000.0}\n"
BRAKE = "  brake: {holding_torque_n_m: 400000.0, delay_s: 0.5}\n"
HEAVE = (
    "  heave_compensation: {efficiency: 0.95, lag_s: 0.1, stroke_m: 3.0, speed_limit_m_per_s: 2.0,"
    " acceleration_limit_m_per_s2: 2.0}\n"
)
Row = tuple[str, str, str, tuple[str, ...]]


def with_parts(parts: str) -> str:
    return spoilt(LEAST, LEAST + parts)


def reported(row: str) -> str:
    return spoilt(SECOND_ROW, row)


BAD: list[Row] = [
    ("drive alone", with_parts(DRIVE), "winch.drive", ("there is none", "add `drum:")),
    ("brake alone", with_parts(DRUM + BRAKE), "winch.brake", ("and there is none", "add `drive:")),
    ("negative inertia", with_parts(DRUM + DRIVE.replace("3000.0", "-1.0")),
     "winch.drive.inertia_kg_m2", ("-1 kg·m² is out of range",)),
    ("no torque", with_parts(DRUM + "  drive: {inertia_kg_m2: 3000.0}\n"),
     "winch.drive", ("torque_limit_n_m missing",)),
    ("efficiency over all", with_parts(HEAVE.replace("0.95", "1.5")),
     "winch.heave_compensation.efficiency", ("1.5 is out of range", "0 to 1.2")),
    ("no stroke", with_parts(HEAVE.replace("stroke_m: 3.0, ", "")),
     "winch.heave_compensation", ("stroke_m missing",)),
    ("unknown part", with_parts("  breake: {delay_s: 0.5}\n"), "winch.breake",
     ("did you mean 'brake'?",)),
    ("gain of nothing", with_parts("  constant_tension: {gain_m_per_s_per_kn: 0.0}\n"),
     "winch.constant_tension.gain_m_per_s_per_kn", ("0 m/s/kN is out of range",)),
    ("jerk of nothing", with_parts("  jerk_limit_m_per_s3: 0.0\n"),
     "winch.jerk_limit_m_per_s3", ("out of range",)),
    ("sheave that is nowhere", with_parts("  inboard_sheaves: [{diameter_m: 0.8}]\n"),
     "winch.inboard_sheaves[0]", ("inboard_m missing", "distance along the rope")),
    ("inboard sheave narrower than its rope",
     with_parts("  inboard_sheaves: [{diameter_m: 0.03, inboard_m: 5.0}]\n"),
     "winch.inboard_sheaves[0].diameter_m", ("0.03 m is not wider than the rope's", "20 times")),
    ("wires that do not fit inboard",
     with_parts("  inboard_sheaves: [{diameter_m: 0.8, inboard_m: 5.0, outer_wire_m: 0.03}]\n"),
     "winch.inboard_sheaves[0].outer_wire_m", ("do not fit a rope of 0.04 m",)),
    ("a drum outboard of a sheave",
     with_parts(DRUM + "  inboard_sheaves: [{diameter_m: 0.8, inboard_m: 5.0}]\n"),
     "winch.drum.inboard_m", ("the drum at 0 m is outboard of a sheave", "from the hang-off")),
    ("sheave narrower than its rope",
     with_parts("  sheave: {diameter_m: 0.04, outer_wire_m: 0.0018}\n"),
     "winch.sheave.diameter_m", ("0.04 m is not wider than the rope's 0.04 m", "20 times")),
    ("wires thicker than half their rope",
     with_parts("  sheave: {diameter_m: 0.8, outer_wire_m: 0.03}\n"),
     "winch.sheave.outer_wire_m", ("do not fit a rope of 0.04 m", "one outer wire")),
    ("nothing to do without a commander", with_parts("  when_commander_lost: ramp\n"),
     "winch.when_commander_lost", ("'ramp' is unknown", "did you mean 'ramp_to_zero'?")),
    ("no brake to set without a commander", with_parts("  when_commander_lost: brake\n"),
     "winch.when_commander_lost", ("this winch has no brake", "or use ramp_to_zero")),
    ("a row that tells nothing", reported("{at_s: 20.0}"), "winch.schedule[1]",
     ("no command is given", "give exactly one")),
    ("a row that tells two things", reported("{at_s: 20.0, speed_m_per_s: 0.1, line_out_m: 600.0}"),
     "winch.schedule[1]", ("at once", "give exactly one")),
    ("a length that is not there", reported("{at_s: 20.0, line_out_m: 900.0}"),
     "winch.schedule[1].line_out_m", ("900 m is outside the winch's 50 to 800 m",)),
    ("a tension that nothing keeps", reported("{at_s: 20.0, tension_n: 1.0e+5}"),
     "winch.schedule[1].tension_n", ("no constant-tension mode", "add `constant_tension:")),
    ("a switch that is none", reported("{at_s: 20.0, switch: set_break}"),
     "winch.schedule[1].switch", ("'set_break' is unknown", "did you mean 'set_brake'?")),
    ("a switch of nothing", reported("{at_s: 20.0, switch: compensate}"),
     "winch.schedule[1].switch", ("no heave compensation", "add `heave_compensation`")),
    ("a depth of what is held",
     reported("{at_s: 20.0, payload_depth_m: 400.0}")
     .replace("    to: tool\n", "    fixed_at_m: [0.0, 0.0, -480.0]\n")
     .replace("payloads:\n", "x:\n").partition("x:\n")[0]
     + reported("{at_s: 20.0, payload_depth_m: 400.0}").partition("shape:")[2].partition("\n")[2]
     .replace("  - payload: {}\n", ""),
     "ropes[0].fixed_at_m", ("lower end is fixed", "give line_out_m instead")),
]  # fmt: skip


@pytest.mark.parametrize("row", BAD, ids=[row[0] for row in BAD])
def test_invalid_winch_components_are_rejected(row: Row, tmp_path: Path) -> None:
    _, text, position, words = row
    assert_refused(text, position, words, tmp_path)


def test_winch_components_are_read_and_change_the_digest(tmp_path: Path) -> None:
    plain = load_scene(written(tmp_path, GOOD))
    equipped = load_scene(written(tmp_path, with_parts(DRUM + DRIVE + BRAKE + HEAVE)))
    assert equipped.winch is not None
    assert equipped.winch.brake is not None
    assert equipped.winch.brake.holding_torque_n_m == 400e3
    assert scene_digest(plain) != scene_digest(equipped)
    reported_as_ever = "ScheduleRow(at_s=0.0, speed_m_per_s=0.5)"
    assert repr(ScheduleRow(at_s=0.0, speed_m_per_s=0.5)) == reported_as_ever, "studies know it so"
    assert "brake" not in repr(plain.winch)


@pytest.mark.parametrize(
    ("parts", "step", "words"),
    [
        (DRUM + DRIVE, "0.005", ""),
        (DRUM + DRIVE.replace("300000.0", "100000.0"), "0.005",
         "winch.drive: it holds 117 kN on layer 2, static tension is 133 kN; "
         "give more than 114 kN·m, or expect it to render."),
        (DRUM + DRIVE + BRAKE.replace("400000.0", "90000.0"), "0.005", "winch.brake: it holds 105"),
        (DRUM + DRIVE, "0.02", "winch.drive: a step of 0.02 s delays the tension feedback"),
    ],
    ids=["enough", "weak drive", "weak brake", "long step"],
)  # fmt: skip
def test_implausible_winches_are_warned_of(
    parts: str, step: str, words: str, tmp_path: Path
) -> None:
    text = with_parts(parts).replace("step_s: 0.01", f"step_s: {step}")
    reported = [w for w in sense_checks(load_scene(written(tmp_path, text))) if "winch." in w]
    if words:
        assert any(words in one for one in reported), reported
    else:
        assert not [one for one in reported if "winch.drive" in one]


@pytest.mark.parametrize(
    ("row", "warned"),
    [
        ("{at_s: 20.0, switch: compensate}", True),
        ("{at_s: 0.0, switch: compensate}", False),
        ("{at_s: 20.0, switch: stop_compensating}", False),
    ],
)
def test_switching_on_compensation_that_is_on_is_warned_of(
    row: str, warned: bool, tmp_path: Path
) -> None:
    first = "{at_s: 0.0, speed_m_per_s: 0.5}"
    text = with_parts(HEAVE).replace(first, f"{first}\n    - {row}", 1)
    reported = [
        w for w in sense_checks(load_scene(written(tmp_path, text))) if "from the start" in w
    ]
    assert bool(reported) == warned
    if warned:
        assert reported[0].startswith(
            "winch.heave_compensation: it is on from the start, and switched on at 20 s; "
            "begin with {at_s: 0.0, switch: stop_compensating}"
        )
