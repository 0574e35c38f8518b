"""Plan files: the shipped ones are read, wrong ones are refused in one sentence with their line."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from rope_twin.errors import RopeTwinError
from rope_twin.files import share_dir
from rope_twin.planning.plan_file import Heights, Lowering
from rope_twin.planning.plan_reader import read_plan, spreading_of, tip_of

PLANS = sorted(path.stem for path in (share_dir() / "config" / "plans").glob("*.yaml"))

GOOD = """scene: deep_lift
vessel:
  responses: vessel_120m
  crane_tip_m: [10.0, 18.0, 12.0]
sea:
  hs_m: {from: 1.0, to: 4.0, step: 0.5}
  tp_s: [7.0, 9.0]
  headings_deg: [150.0, 180.0]
phases:
  - lowering: {from_m: 1000.0, to_m: 2000.0, speed_m_per_s: 0.5}
  - at_depth: {depth_m: 2000.0}
criteria: {swl_n: 400000.0}
method: {within: 0.05}
"""
AT_DEPTH = "  - at_depth: {depth_m: 2000.0}\n"
VESSEL = "vessel:\n  responses: vessel_120m\n  crane_tip_m: [10.0, 18.0, 12.0]\n"
PHASES = GOOD[GOOD.index("phases:") : GOOD.index("criteria:")]
SPLASH = "  - splash_zone: {above_m: 4.0, below_m: 6.0, speed_m_per_s: 0.3}\n"

SLINGS = """slings:
  attachments_m: [[2.0, 1.0, 1.0], [2.0, -1.0, 1.0], [-2.0, 1.0, 1.0], [-2.0, -1.0, 1.0]]
  lengths_m: [6.0]
  diameter_m: 0.04
  skew_load_factor: 1.25
  mbl_n: 1.0e+6
method:"""


def slings(old: str, new: str) -> str:
    """Return slings with a change of text."""
    assert old in SLINGS
    return SLINGS.replace(old, new, 1)


def uncertain(key: str, distribution: str) -> str:
    """Return a section of one uncertain number before that of the method."""
    return f"uncertainties: [{{key: '{key}', {distribution}, source: x}}]\nmethod:"


# name: text to replace, replacement, line of the fault (0: none), words of the sentence
WRONG = {
    "unknown key": ("scene:", "scenes: x\nscene:", 1, "scenes: unknown key; did you mean 'scene'?"),
    "no scene": ("scene: deep_lift\n", "", 0, "scene missing; add scene"),
    "unknown scene": ("deep_lift", "deep_lft", 1, "no such scene; did you mean 'deep_lift'?"),
    "scene file": ("deep_lift", "none/deep_lift.yaml", 1, "deep_lift.yaml"),
    "no sea": (GOOD[GOOD.index("sea:") : GOOD.index("phases:")], "", 0, "sea missing; add sea"),
    "no phases": (PHASES, "", 0, "phases missing; add phases"),
    "empty phases": (PHASES, "phases: []\n", 0, "phases is empty; give one phase or more"),
    "phases no list": (PHASES, "phases: {}\n", 9, "a mapping instead of a list"),
    "ropes that meet": ("deep_lift", "bridle_lift", 1, "the ropes of 'bridle_lift' meet, and"),
    "no payload": ("deep_lift", "rov_tether", 1, "'rov_tether' has no payload"),
    "feedback": ("deep_lift", "flying_sheave_lift", 1, "depends on the tension"),
    "no vessel": (VESSEL, "", 0, "no vessel is given, and 'deep_lift' has none on its waves"),
    "vessel without tip": ("  crane_tip_m: [10.0, 18.0, 12.0]\n", "", 2, "crane_tip_m missing"),
    "tip of two": ("[10.0, 18.0, 12.0]", "[10.0, 18.0]", 4, "2 values in the list; give 3"),
    "tip far away": ("[10.0, 18.0, 12.0]", "[10.0, 1800.0, 12.0]", 4, "1800 m is out of range"),
    "unknown RAOs": ("vessel_120m", "vessel_12m", 3, "; did you mean 'vessel_120m'?"),
    "RAOs no text": ("vessel_120m", "120", 3, "the number 120 is not text"),
    "bow": ("[10.0, 18.0, 12.0]", "[10.0, 18.0, 12.0]\n  bow_deg: 400.0", 5, "400 ° is out of"),
    "heights reversed": ("from: 1.0, to: 4.0", "from: 5.0, to: 4.0", 6, "from 5 m is above to 4 m"),
    "heights many": ("step: 0.5", "step: 0.01", 6, "301 heights; give at most 200"),
    "height step": ("step: 0.5", "step: 0.0", 6, "0 m is out of range; give 0.01 to 5 m"),
    "height text": ("from: 1.0", "from: low", 6, "the text 'low' is not a number"),
    "no height step": (", step: 0.5", "", 6, "step missing; add step"),
    "no periods": ("[7.0, 9.0]", "[]", 5, "tp_s is empty; give one value or more"),
    "period twice": ("[7.0, 9.0]", "[7.0, 7.0]", 5, "tp_s has 7 twice; keep one of them"),
    "periods mixed": ("[7.0, 9.0]", "[9.0, 7.0]", 5, "tp_s is not ascending; order it"),
    "period zero": ("[7.0, 9.0]", "[0.0, 9.0]", 7, "0 s is out of range; give 1 to 40 s"),
    "period not finite": ("[7.0, 9.0]", "[.nan, 9.0]", 7, "nan s is not finite"),
    "period breaks": ("[7.0, 9.0]", "[2.0, 9.0]", 7, "waves of Tp 2 s break at Hs 1 m"),
    "no heading": ("[150.0, 180.0]", "[]", 5, "headings_deg is empty"),
    "heading twice": ("[150.0, 180.0]", "[150.0, 150.0]", 5, "headings_deg has 150 twice"),
    "head seas twice": ("[150.0, 180.0]", "[180.0, -180.0]", 5, "which are one heading"),
    "heading far": ("[150.0, 180.0]", "[200.0]", 8, "200 ° is out of range"),
    "symmetric both sides": (
        "[150.0, 180.0]", "[-150.0, 150.0]\n  symmetric: true", 5,
        "symmetric, and headings_deg has both sides; give those of one side",
    ),
    "gamma": ("phases:", "  gamma: 0.5\nphases:", 9, "0.5 is out of range; give 1 to 10"),
    "spreading": ("phases:", "  spreading: 0.0\nphases:", 9, "0 is out of range; give 1 to 100"),
    "phase of nothing": (AT_DEPTH, "  - name: rest\n", 11, "no kind of phase given; give exactly"),
    "phase of two": (
        AT_DEPTH, "  - {at_depth: {depth_m: 9.0}, landing: {speed_m_per_s: 0.1}}\n", 11,
        "at_depth and landing given; give exactly one of",
    ),
    "phase twice": (AT_DEPTH, AT_DEPTH + AT_DEPTH, 0, "two phases are called 'at_depth'"),
    "unknown phase": (AT_DEPTH, "  - at_dept: {depth_m: 2000.0}\n", 11, "did you mean 'at_depth'"),
    "upward": ("from_m: 1000.0", "from_m: 2500.0", 10, "from_m 2500 is not less than to_m 2000"),
    "too fast": ("speed_m_per_s: 0.5", "speed_m_per_s: 1.5", 10, "1.5 m/s is above the winch's 1"),
    "still": ("speed_m_per_s: 0.5", "speed_m_per_s: 0.0", 10, "0 m/s is out of range"),
    "legs": ("speed_m_per_s: 0.5", "speed_m_per_s: 0.5, legs: 0", 10, "0 is out of range"),
    "too deep": ("depth_m: 2000.0", "depth_m: 4000.0", 11, "4000 m below the water is beyond"),
    "too shallow": ("from_m: 1000.0", "from_m: 50.0", 10, "50 m below the water is beyond the"),
    "exposure": ("depth_m: 2000.0", "depth_m: 2000.0, exposure_s: 5.0", 11, "5 s is out of range"),
    "no bed": (AT_DEPTH, "  - landing: {speed_m_per_s: 0.1}\n", 11, "'deep_lift' has no seabed"),
    "no splash zone": (AT_DEPTH, SPLASH, 11, "'deep_lift' lacks the effect splash_zone and waves"),
    "SWL": ("swl_n: 400000.0", "swl_n: 0.0", 12, "0 N is out of range"),
    "SWL unit": ("swl_n: 400000.0", "swl_n: 400kN", 12, "the text '400kN' is not a number"),
    "SWL name": ("swl_n", "swl_kn", 12, "swl_kn: unknown key; did you mean 'swl_n'?"),
    "factor": ("swl_n: 400000.0", "safety_factor: 0.5", 12, "0.5 is out of range; give 1 to 20"),
    "uplift": ("swl_n: 400000.0", "uplift_share: 9.0", 12, "9 is out of range; give 0.1 to 1"),
    "no landing": (
        "swl_n: 400000.0", "landing_speed_m_per_s: 0.5", 12, "no phase lands; add a phase `landing`"
    ),
    "no compensation": ("swl_n: 400000.0", "stroke_m: 2.0", 12, "has no heave compensation"),
    "seeds": ("within: 0.05", "seeds: {start: 9, most: 8}", 13, "start 9 is above most 8"),
    "two seeds": ("within: 0.05", "seeds: {start: 2}", 13, "2 is out of range; give 3 to 1000"),
    "seeds a half": ("within: 0.05", "seeds: {most: 8.5}", 13, "8.5 is not a whole number"),
    "percentile": ("within: 0.05", "percentile: 100.0", 13, "100 % is out of range"),
    "confidence": ("within: 0.05", "confidence: 95.0", 13, "95 is out of range; give 0.5 to 0.99"),
    "within": ("within: 0.05", "within: 0.0", 13, "0 is out of range; give 0.001 to 1"),
    "half a setting": ("within: 0.05", "elements: 20", 13, "elements alone; give elements"),
    "seed": ("within: 0.05", "seed: -1", 13, "-1 is out of range"),
    "no skew": ("method:", slings("  skew_load_factor: 1.25\n", ""), 13,
                "4 slings are statically indeterminate and no skew load given; give one of"),
    "two skews": ("method:", slings("mbl_n", "length_tolerance_m: 0.02\n  mbl_n"), 13,
                  "both skew_load_factor and length_tolerance_m given"),
    "skew of three": ("method:", slings(", [-2.0, -1.0, 1.0]", ""), 13,
                      "3 slings are statically determinate; leave skew_load_factor out"),
    "sling lengths": ("method:", slings("[6.0]", "[6.0, 6.0]"), 13, "2 lengths for 4 slings"),
    "sling strength": ("method:", slings("  mbl_n: 1.0e+6\n", ""), 13, "give mbl_n or wll_n"),
    "sling stiffness": ("method:", slings("  diameter_m: 0.04\n", ""), 13, "no stiffness is given"),
    "slings apart": ("method:", slings("[6.0]", "[2.0]"), 13, "the slings do not meet at a hook"),
    "slings below": (
        "method:",
        "slings: {attachments_m: [[0.0, 0.0, -3.0]], lengths_m: [1.0], diameter_m: 0.04, "
        "mbl_n: 1.0e+6}\nmethod:", 13, "the object capsizes; attach slings above",
    ),
    "sling factor": ("method:", slings("mbl_n", "factors: {material: 0.5}\n  mbl_n"), 18,
                     "0.5 is out of range; give 1 to 4"),
    "uncertain of nothing": (
        "method:", "uncertainties: [{key: 'scene.payloads[0].mass_kg', source: x}]\nmethod:", 13,
        "no distribution given; give exactly one of uniform, normal, triangular",
    ),
    "uncertain without source": (
        "method:", "uncertainties: [{key: a.b, uniform: {from: 1, to: 2}}]\nmethod:", 13,
        "source missing",
    ),
    "uncertain key": (
        "method:", uncertain("criteria.swl", "uniform: {from: 300000.0, to: 400000.0}"), 13,
        "criteria.swl: unknown key; did you mean 'swl_n'?",
    ),
    "uncertain key of the scene": (
        "method:", uncertain("scene.payloads[0].mas_kg", "normal: {mean: 20000.0, std: 100}"), 13,
        "payloads[0].mas_kg: unknown key; did you mean 'mass_kg'?",
    ),
    "uncertain beyond its range": (
        "method:", uncertain("criteria.swl_n", "normal: {mean: 1000.0, std: 1000.0}"), 13,
        "criteria.swl_n: -2000 N is out of range",
    ),
    "uncertain method": (
        "method:", uncertain("method.seed", "uniform: {from: 1, to: 2}"), 13,
        "'method.seed' is no property of the lift; give a key of vessel, sea",
    ),
    "uncertain range reversed": (
        "method:", uncertain("criteria.swl_n", "uniform: {from: 400000.0, to: 300000.0}"), 13,
        "from 400000 is not below to 300000",
    ),
    "uncertain mode outside": (
        "method:", uncertain("criteria.swl_n", "triangular: {from: 3.0, mode: 1.0, to: 4.0}"), 13,
        "the mode 1 is not from 3 to 4",
    ),
    "current beyond the sea": (
        "phases:", "current: {speed_m_per_s: 20.0, direction_deg: 0}\nphases:", 9,
        "20 m/s is out of range; give 0 to 10",
    ),
    "current without direction": (
        "phases:", "current: {speed_m_per_s: 0.5}\nphases:", 9, "direction_deg missing",
    ),
    "current from below": (
        "phases:",
        "current: {speed_m_per_s: 0.5, direction_deg: 0, profile: [[-9, 1], [0, 1]]}\nphases:", 9,
        "heights of the profile do not descend; order the rows from the surface down",
    ),
    "current against itself": (
        "phases:", "current: {speed_m_per_s: 0.5, direction_deg: 0, profile: [[0, -1]]}\nphases:",
        9, "the profile has the row [0, -1]; give an elevation of at most 0 and a share of 0",
    ),
    "motion factor": (
        "  crane_tip_m", "  motion_factor: -1.0\n  crane_tip_m", 4, "-1 is out of range",
    ),
    "uncertain current of the scene": (
        "method:",
        "current: {speed_m_per_s: 0.5, direction_deg: 0}\n"
        + uncertain("scene.effects.current.profile[0]", "uniform: {from: 0.1, to: 0.2}"), 14,
        "is replaced by the plan's `current`; give current.speed_m_per_s",
    ),
    "key twice": ("method:", "criteria: {}\nmethod:", 13, "the key 'criteria' is given a second"),
    "not YAML": ("method: {within: 0.05}", "method: {within: 0.05", 14, "it is not YAML"),
    "list at the top": (GOOD, "- scene: deep_lift\n", 0, "its top is a list, not a mapping"),
    "empty": (GOOD, "", 0, "the file is empty"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_plans_are_refused_in_one_sentence(name: str, tmp_path: Path) -> None:
    """File, line, place, fault and remedy, on one line."""
    old, new, line, words = WRONG[name]
    assert old in GOOD
    path = tmp_path / "lift.yaml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(RopeTwinError) as caught:
        read_plan(path)
    sentence = str(caught.value)
    assert words in sentence
    begin = f"{re.escape(str(path))}, line {line}[,:] " if line else re.escape(str(path))
    assert re.match(begin, sentence), sentence
    assert "\n" not in sentence
    assert re.search(r"[.?]$", sentence)
    assert "?;" not in sentence


def test_so_many_kinds_of_faults() -> None:
    """The table above is long."""
    assert len(WRONG) >= 60


def wrong_scene(tmp_path: Path, scene: str, old: str, new: str, plan: str) -> str:
    """Return the refusal of a plan for a changed copy of a scene."""
    text = (share_dir() / "config" / "scenes" / f"{scene}.yaml").read_text()
    assert old in text
    (tmp_path / "own.yaml").write_text(text.replace(old, new, 1))
    path = tmp_path / "lift.yaml"
    path.write_text(plan)
    with pytest.raises(RopeTwinError) as caught:
        read_plan(path)
    return str(caught.value)


HEAD_SEAS = """scene: own.yaml
sea:
  hs_m: {from: 0.5, to: 2.0, step: 0.5}
  tp_s: [8.0]
  headings_deg: [180.0]
phases:
  - splash_zone: {above_m: 4.0, below_m: 6.0, speed_m_per_s: 0.3}
"""


@pytest.mark.parametrize(
    ("old", "new", "plan", "words"),
    [
        ("spreading: 6.0", "spreading: 6.0", HEAD_SEAS.replace("[180.0]", "[150.0]"),
         "line 5, sea.headings_deg: the scene's box-like hull answers head seas alone"),
        ("jonswap: {significant_height_m: 1.5, peak_period_s: 7.5}\n      components: 100",
         "regular: {height_m: 1.0, period_s: 8.0}", HEAD_SEAS,
         "line 1, scene: the waves of 'own' are not one JONSWAP system"),
        ("max_line_out_m: 60.0", "max_line_out_m: 20.0", HEAD_SEAS,
         "line 7, phases[0].splash_zone.below_m: 6 m below the water is beyond the line"),
        ("spreading: 6.0", "spreading: 6.0", HEAD_SEAS.replace("above_m: 4.0", "above_m: 16.0"),
         "line 7, phases[0].splash_zone.above_m: 16 m is not below the crane tip"),
    ],
)  # fmt: skip
def test_plans_that_do_not_fit_their_scene(
    old: str, new: str, plan: str, words: str, tmp_path: Path
) -> None:
    """Relations of plan and scene, with the line in the plan."""
    assert words in wrong_scene(tmp_path, "splash_zone", old, new, plan)


def test_floating_payloads_are_refused(tmp_path: Path) -> None:
    """Slack and uplift have no meaning where nothing sinks."""
    volume, plan = "displaced_volume_m3: ", GOOD.replace("deep_lift", "own.yaml")
    said = wrong_scene(tmp_path, "deep_lift", volume + "4.0", volume + "25.0", plan)
    assert "line 1, scene: the payload of 'own' floats with 55.2 kN" in said


def test_depths_below_the_seabed_are_refused(tmp_path: Path) -> None:
    """A payload does not hang in the ground."""
    plan = GOOD.replace("deep_lift", "landing").replace(PHASES, "phases:\n  - at_depth: "
                                                        "{depth_m: 410.0}\n")  # fmt: skip
    path = tmp_path / "lift.yaml"
    path.write_text(plan)
    with pytest.raises(RopeTwinError, match=r"line 10, .*410 m is not above the seabed in 400 m"):
        read_plan(path)


def test_a_scene_in_place_of_a_plan_is_recognised() -> None:
    with pytest.raises(RopeTwinError, match="the file of a scene, not a plan; name it by the key"):
        read_plan(share_dir() / "config" / "scenes" / "landing.yaml")


def test_unknown_plans_are_refused() -> None:
    """With the nearest known one."""
    with pytest.raises(RopeTwinError, match="did you mean 'landing'"):
        read_plan("landin")


@pytest.mark.parametrize("name", PLANS)
def test_shipped_plans_are_read(name: str) -> None:
    """Each begins with the command that runs it."""
    plan, scene = read_plan(name)
    assert plan.path.read_text().startswith(f"# rope_twin plan {name}\n")
    assert plan.about
    assert plan.source
    assert tip_of(plan, scene).source


def test_scene_and_vessel_give_the_same_tip() -> None:
    """The crane tip of `ship_6dof` is where the plan would put it by hand."""
    path = share_dir() / "config" / "plans" / "landing.yaml"
    plan, _ = read_plan(path)
    by_plan = tip_of(plan, read_plan("landing")[1])
    assert by_plan.arm_m == (10.0, 18.0, 12.0)  # type: ignore[attr-defined]


def test_grid_of_heights() -> None:
    """Both ends are on it; an end that no step meets is left out."""
    assert Heights(from_=0.5, to=2.0, step=0.5).values == [0.5, 1.0, 1.5, 2.0]
    assert Heights(from_=0.5, to=2.2, step=0.5).values == [0.5, 1.0, 1.5, 2.0]
    assert Heights(from_=1.0, to=1.0, step=0.5).values == [1.0]


def test_heights_end_where_waves_break() -> None:
    """At Tp 7 s waves break between Hs 6 and 8 m, so that the grid ends below."""
    plan, _ = read_plan("deep_installation")
    high = replace(plan, sea=replace(plan.sea, hs_m=Heights(from_=0.5, to=8.0, step=0.25)))
    heights = high.heights_m(0, 0)
    assert heights[0] == 0.5
    assert 6.0 < heights[-1] < 8.0
    assert high.heights_m(3, 0)[-1] == 8.0


def test_legs_are_in_a_constant_ratio() -> None:
    """1,000 to 2,900 m: three legs, as 2.9 is between 1.5² and 1.5³."""
    borders = Lowering(from_m=1000.0, to_m=2900.0, speed_m_per_s=0.5).borders_m()
    assert len(borders) == 4
    ratios = [b / a for a, b in pairwise(borders)]
    assert max(ratios) == pytest.approx(min(ratios))
    assert borders[-1] == pytest.approx(2900.0)


def test_spreading_is_that_of_the_scene_unless_given() -> None:
    """Scenes with waves have their own."""
    assert spreading_of(*read_plan("splash_zone")) == 6.0
    assert spreading_of(*read_plan("deep_installation")) is None
