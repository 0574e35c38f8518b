"""Situations: limits with deadband and delay, slack against the weight, inputs, quality, events."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sample_snapshot import QUALITY, RESIDUAL, hanging_rope
from small_scene import SMALL_SCENE, small_scene

from rope_twin import load_scene
from rope_twin.alerts.alert_list import AlertList, Priority, State
from rope_twin.alerts.limits import SceneFigures
from rope_twin.alerts.monitor import AlertMonitor, rates
from rope_twin.alerts.situations import SituationMonitor
from rope_twin.errors import InputError
from rope_twin.messages.reports import Level, Status, decode_alerts, encode_alerts
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import UnpacedRun
from rope_twin.scene.schema import RopeSection
from rope_twin.twin.quality import QualityIndex
from rope_twin.twin.snapshot import (
    Bend,
    InputHealth,
    LimitBreach,
    RopeBend,
    RopeStrength,
    Snapshot,
    WinchSnapshot,
)

STEP_NS = 20_000_000
MBL_N = 1.0e6
LIMITED = SMALL_SCENE + "limits: {tension_n: 100000.0, payload_speed_m_per_s: 2.0}\n"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A scene with limits of tension and speed."""
    path = tmp_path_factory.mktemp("alerts") / "limited.yaml"
    path.write_text(LIMITED)
    return load_scene(path)


class Course:
    """A watch that sees one quiet snapshot after the other, with changes."""

    def __init__(self, scene: Any) -> None:
        self.watch, self.time_ns = SituationMonitor(scene), 0
        quiet = replace(
            hanging_rope(), residuals=(), quality=(), seabed=None, compensator=None,
            tension_top_max_n=5e4, tension_payload_n=6.5e4, line_out_m=200.0, inputs={},
            strength=(RopeStrength("hoist", 5e4, MBL_N),),
        )  # fmt: skip
        self.quiet = replace(quiet, payload_velocity_m_per_s=0.0 * quiet.payload_velocity_m_per_s)

    def see(self, seconds: float, **fields: Any) -> dict[tuple[int, str], Priority]:
        """Look for a time at snapshots with these fields; return the situations at its end."""
        found: list[Any] = []
        for _ in range(max(1, round(seconds * 1e9 / STEP_NS))):
            self.time_ns += STEP_NS
            snapshot: Snapshot = replace(self.quiet, stamp_ns=self.time_ns, **fields)
            self.last, found = snapshot, self.watch.observe(snapshot)
        return {(one.identifier, one.where): one.priority for one in found}


def test_tension_near_and_above_its_limit(scene: Any) -> None:
    course, key = Course(scene), (10001, "hoist")
    assert course.see(1.0) == {}
    assert course.see(0.02, tension_top_max_n=9.6e4) == {key: Priority.WARNING}
    assert course.see(0.02, tension_top_max_n=1.01e5) == {key: Priority.ALARM}
    assert course.see(10.0, tension_top_max_n=9.9e4) == {key: Priority.ALARM}, "within the deadband"
    assert course.see(29.9, tension_top_max_n=9.7e4) == {key: Priority.ALARM}, "it holds for 30 s"
    assert course.see(0.2, tension_top_max_n=9.7e4) == {key: Priority.WARNING}
    assert course.see(29.9) == {key: Priority.WARNING}
    assert course.see(0.2) == {}


def test_a_crew_can_only_be_stricter_than_the_scene(scene: Any) -> None:
    course, crew, key = Course(scene), AlertMonitor(scene), (10001, "hoist")
    course.watch = crew._watch
    assert crew.command("limit tension_n 60000") == "limit tension_n: 60000 N"
    assert crew.row().values == {"tension_n": "60000.0"}
    assert course.see(0.02, tension_top_max_n=6.1e4) == {key: Priority.ALARM}
    assert crew.command("limit payload_depth_m 2000") == "limit payload_depth_m: 2000 m"
    assert course.see(0.02)[10010, "tool depth"] is Priority.ALARM  # it hangs at 3,000 m
    crew.command("limit payload_depth_m scene")
    assert course.see(0.02) == {key: Priority.ALARM}, "held for the next wave"
    crew.command("limit tension_n 64000")
    assert course.see(0.02, tension_top_max_n=6.1e4) == {key: Priority.WARNING}
    crew.command("limit tension_n 60000")
    assert course.see(0.02, tension_top_max_n=6.1e4) == {key: Priority.ALARM}
    crew.command("limit tension_n 50000")
    assert course.see(0.02, tension_top_max_n=1e4) == {key: Priority.ALARM}, "stricter: held"
    crew.command("limit tension_n scene")
    assert course.see(0.02, tension_top_max_n=6.1e4) == {}, "no alarm quotes the scene's limit"
    assert crew.row().values == {}
    for words in ("tension_n 100000", "tension_n nan", "tension_n 0", "tension 5e4", "tension_n",
                  "payload_speed_m_per_s 2.5"):  # fmt: skip
        with pytest.raises(InputError):
            crew.command(f"limit {words}")
    assert course.see(1.0, tension_top_max_n=6.1e4) == {}


def test_sections_count_with_their_own_breaking_load(with_bed: Any) -> None:
    """A top tension above the MBL of the lowest section is no alarm; its own utilisation is."""
    key = (10001, "hoist")
    fields = {"max_n": 9e5, "breaking_load_n": 6e5, "section_n": 1.8e5}

    def used(now: float) -> Any:
        return (RopeStrength("hoist", utilisation_now=now, **fields),)

    course = Course(with_bed)
    assert course.see(0.02, tension_top_max_n=9e5, strength=used(0.3)) == {}
    assert course.see(0.02, tension_top_max_n=9e5, strength=used(1.01)) == {key: Priority.ALARM}
    course = commanded(with_bed, "utilisation 0.25")
    assert course.see(0.02, tension_top_max_n=9e5, strength=used(0.3)) == {key: Priority.ALARM}
    course = commanded(with_bed, "tension_n 850000")
    assert course.see(0.02, tension_top_max_n=9e5, strength=used(0.3)) == {key: Priority.ALARM}


@pytest.fixture(scope="module")
def with_bed(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A scene with a seabed, a minimum bend radius and a clearance from the bed."""
    path = tmp_path_factory.mktemp("alerts") / "bed.yaml"
    text = SMALL_SCENE.replace("effects:", "effects:\n  - seabed: {depth_m: 3100.0}")
    assert "seabed" in text
    path.write_text(text + "limits: {bed_clearance_m: 20.0, min_tension_n: 1000.0}\n")
    return load_scene(path)


def commanded(scene: Any, *limits: str) -> Course:
    """A course whose crew has set limits."""
    course = Course(scene)
    for words in limits:
        course.watch.crew.set(*words.split())
    return course


def test_a_crews_share_of_the_breaking_load_is_a_limit(scene: Any) -> None:
    course = commanded(scene, "utilisation 0.08")
    assert course.see(0.02, tension_top_max_n=8.1e4) == {(10001, "hoist"): Priority.ALARM}


def test_a_payload_near_the_bed_is_a_clearance(with_bed: Any) -> None:
    course, key = Course(with_bed), (10018, "bed")

    def at_height(height_m: float) -> Any:
        return replace(hanging_rope().seabed, payload_height_m=height_m, payload_reaction_n=0.0)

    assert course.see(0.02, seabed=at_height(22.0)) == {}
    assert course.see(0.02, seabed=at_height(20.5)) == {key: Priority.WARNING}
    assert course.see(0.02, seabed=at_height(19.9)) == {key: Priority.ALARM}
    assert course.see(0.02, seabed=at_height(-0.1)) == {key: Priority.ALARM}
    assert course.see(61.0, seabed=at_height(50.0)) == {}
    with pytest.raises(InputError, match="not stricter"):
        course.watch.crew.set("bed_clearance_m", "15")
    course.watch.crew.set("bed_clearance_m", "60")
    assert course.see(0.02, seabed=at_height(50.0)) == {key: Priority.ALARM}


def test_a_crews_limits_along_the_rope_and_of_a_landing(with_bed: Any) -> None:
    course = commanded(with_bed, "min_tension_n 5000", "landing_speed_m_per_s 0.3")
    low = course.quiet.element_tension_n * 0.0 + 4e3
    key = (10011, "hoist min_tension_n")
    assert course.see(0.02, element_tension_n=low) == {key: Priority.ALARM}
    assert course.see(9.9) == {key: Priority.ALARM}, "a moment that each wave brings is one alert"
    assert course.see(0.2) == {}
    falling = course.quiet.payload_velocity_m_per_s.copy()
    falling[2] = -0.4
    above = replace(hanging_rope().seabed, payload_reaction_n=0.0, payload_height_m=30.0)
    course.see(0.1, seabed=above, payload_velocity_m_per_s=falling)
    found = course.see(0.02, seabed=hanging_rope().seabed)
    assert [where for number, where in found if number == 10011] == ["tool landing_speed_m_per_s"]
    course.watch.crew.set("landing_speed_m_per_s", "scene")
    assert 10011 not in [number for number, _ in course.see(0.02, seabed=above)]


def test_a_crews_bend_radius(tmp_path: Any) -> None:
    path = tmp_path / "stiff.yaml"
    bending = "\n  - bending: {stiffness_n_m2: 20000.0}"
    path.write_text(SMALL_SCENE.replace("effects:", f"effects:{bending}"))
    course = commanded(load_scene(path), "bend_radius_m 400")

    def bends(radius_m: float) -> tuple[RopeBend, ...]:
        one = Bend("hoist", radius_m, 48.0, course.time_ns * 1e-9, 0.0, 2.0)
        return (RopeBend(one, (0.0, 0.0, -48.0), one),)

    assert course.see(1.0, bends=bends(400.5)) == {}
    key = (10011, "hoist bend_radius")
    assert course.see(0.02, bends=bends(399.5)) == {key: Priority.ALARM}
    (one,) = course.watch.observe(course.last)
    assert one.text.startswith("bend radius of 'hoist' 399.5 m, below the limit of 400 m")
    assert course.see(11.0, bends=bends(500.0)) == {}


def test_a_crew_sets_no_limit_of_what_the_scene_has_not(scene: Any, with_bed: Any) -> None:
    crew = AlertMonitor(scene)
    for words, lacks in (("bed_clearance_m 10", "a seabed"), ("bend_radius_m 2", "bend"),
                         ("line_clearance_m 1", "two lines")):  # fmt: skip
        with pytest.raises(InputError, match=lacks):
            crew.command(f"limit {words}")
    with pytest.raises(InputError, match="give more"):
        AlertMonitor(with_bed).command("limit min_tension_n 900")


def test_a_limit_that_each_wave_exceeds_is_one_alert(scene: Any) -> None:
    """Crests of a swell of 12 s over the limit for 5 min: raised once, acknowledged once."""
    course, alerts, raised = Course(scene), AlertList(), 0
    for k in range(3000):
        tension = 9e4 + 1.5e4 * math.sin(2.0 * math.pi * k * 0.1 / 12.0)
        snapshot = replace(course.quiet, stamp_ns=(k + 1) * 100_000_000, tension_top_max_n=tension)
        changed = alerts.update(course.watch.observe(snapshot), snapshot.stamp_ns)
        if any(one.state is State.UNACKNOWLEDGED and one.escalation == 0 for one in changed):
            raised += 1
            alerts.act("acknowledge", "all")
    assert raised == 2, "the warning, and the alarm that it becomes"


def test_without_a_limit_half_the_breaking_load_warns(tmp_path: Any) -> None:
    course, key = Course(small_scene(tmp_path)), (10001, "hoist")
    breaking = load_scene(tmp_path / "small.yaml").ropes[0].breaking_load_n
    assert course.see(0.02, tension_top_max_n=0.49 * breaking) == {}
    assert course.see(0.02, tension_top_max_n=0.51 * breaking) == {key: Priority.WARNING}
    assert course.see(0.02, tension_top_max_n=1.01 * breaking) == {key: Priority.ALARM}


def test_slack_is_measured_against_the_submerged_weight(scene: Any) -> None:
    """8 t of 1.5 m³ weigh (8000 - 1025·1.5)·9.81 = 63.4 kN in the water."""
    course, key = Course(scene), (10002, "payload")
    weight = (8000.0 - 1025.0 * 1.5) * 9.80665
    assert course.see(1.0, tension_payload_n=0.11 * weight) == {}
    assert course.see(0.02, tension_payload_n=0.09 * weight) == {key: Priority.WARNING}
    assert course.see(59.0) == {key: Priority.WARNING}, "the least of a minute"
    assert course.see(0.02, tension_payload_n=-1.0) == {key: Priority.ALARM}
    assert course.see(70.0) == {}
    landed = hanging_rope().seabed
    lying = course.see(61.0, tension_payload_n=0.0, seabed=landed)
    assert lying == {(10006, "payload"): Priority.CAUTION}, "what lies on the bed may be slack"


def test_delays_keep_short_troubles_out(scene: Any) -> None:
    course = Course(scene)
    apart = replace(RESIDUAL, outside=0.5, readings=600, span_s=60.0)
    assert course.see(29.0, residuals=(apart,)) == {}
    assert course.see(0.5) == {}
    assert course.see(29.0, residuals=(apart,)) == {}
    (key,) = course.see(1.5, residuals=(apart,))
    assert key == (10005, f"{apart.name} {apart.quantity}")
    course = Course(scene)
    apart = replace(apart, outside=None, half_width=None, mean=-75e3, explained=28e3)
    assert course.see(31.0, residuals=(apart,)) == {key: Priority.WARNING}
    (found,) = course.watch.observe(course.last)
    assert "apart by -75000 in the mean of a minute" in found.text
    course, winch = Course(scene), "the speed limit of 1.5 m/s"
    assert course.see(5.0, winch_at_limit=winch) == {}
    assert course.see(20.0) == {}
    assert course.see(1.2, winch_at_limit=winch) == {(10003, "winch"): Priority.WARNING}
    assert course.see(80.0) == {}


@pytest.mark.parametrize(
    ("name", "words", "text"),
    [
        ("heave", "its clock is doubtful", "heave: its clock is doubtful"),
        ("current", "current: it jumps; check it.", "current: it jumps; check it"),
        ("winch_measured", "winch/measured: it jumps.", "winch measured: it jumps"),
        ("heave", "ship/heave: of two", "heave: ship/heave: of two"),
    ],
)
def test_an_alert_names_its_input_once(scene: Any, name: str, words: str, text: str) -> None:
    course = Course(scene)
    inputs = {name: InputHealth(accepted=9, warning=words)}
    assert course.see(2.0, inputs=inputs) == {(10007, name): Priority.CAUTION}
    (found,) = course.watch.observe(replace(course.last, stamp_ns=course.time_ns + STEP_NS))
    assert found.text == text


def test_inputs_quality_and_diagnostics(scene: Any) -> None:
    course = Course(scene)
    stale = {"heave": InputHealth(accepted=9, stale=True, note="held"), "border": InputHealth()}
    assert course.see(2.0, inputs=stale) == {(10007, "heave"): Priority.WARNING}
    doubtful = {"heave": InputHealth(accepted=9, warning="its clock is doubtful")}
    assert course.see(6.0, inputs=doubtful) == {(10007, "heave"): Priority.CAUTION}
    course.see(6.0)
    for index, expected in ((0.7, {}), (0.65, Priority.CAUTION), (0.4, Priority.WARNING)):
        seen = course.see(11.0, quality=(replace(QUALITY, index=index),))
        assert seen == ({(10008, "twin"): expected} if expected else {})
    course.see(11.0, quality=(replace(QUALITY, index=0.65),))
    assert course.see(11.0, quality=(replace(QUALITY, index=0.7),)) == {}, "without a measurement"
    assert course.see(30.0, quality=(replace(QUALITY, index=0.1),), motion_ramp=0.5) == {}
    rising = QualityIndex().judge(replace(course.quiet, motion_ramp=0.99)).quality
    assert rising[0].index == 0.5
    assert course.see(30.0, quality=rising) == {}, "it rises for seconds after the start-up"
    poor = [replace(QUALITY, element=one, index=0.6) for one in ("top_tension", "slack", "fatigue")]
    fine = replace(QUALITY, element="payload_depth", index=0.9)
    assert course.see(11.0, quality=(*poor, fine)) == {(10008, "twin"): Priority.CAUTION}
    (one,) = course.watch.observe(course.last)
    assert one.text.startswith("quality of top tension, slack, fatigue 0.6"), "one situation"
    course.see(11.0)
    late = Status("simulation: pacing", Level.WARN, "2 missed deadlines, worst 1.5 ms late")
    course.watch.take_rows([late])
    assert course.see(6.0) == {(10014, "pacing"): Priority.CAUTION}
    course.watch.take_rows([replace(late, level=Level.ERROR, message="0.6 s behind")])
    assert course.see(6.0) == {(10014, "pacing"): Priority.WARNING}
    course.watch.take_rows([])
    assert course.see(11.0) == {}


def test_a_fault_alarm_lasts_until_its_service_ends_it(scene: Any) -> None:
    """10016 follows the row that the fault tests publish, at once, both ways."""
    course, key = Course(scene), (10016, "faults")
    watch = course.watch
    watch.take_rows([Status("simulation: faults", Level.OK, "no fault, tested until 300 s")])
    assert course.see(1.0) == {}
    words = "load pin offset or snag since 312 s"
    watch.take_rows([Status("simulation: faults", Level.ERROR, words)])
    assert course.see(0.02) == {key: Priority.WARNING}
    (found,) = watch.observe(replace(course.quiet, stamp_ns=course.time_ns))
    assert (found.name, found.category, found.text) == ("fault alarm", "A", words)
    watch.take_rows([Status("simulation: faults", Level.OK, "no fault, tested until 400 s")])
    assert course.see(0.02) == {}
    stands = "the rope of the tests cannot be stepped (step 7)"
    watch.take_rows([Status("simulation: faults", Level.WARN, stands)])
    assert course.see(0.02) == {key: Priority.CAUTION}
    watch.take_rows([])
    assert course.see(0.02) == {}, "a run that does not learn has no row"


def test_what_the_forecast_expects(scene: Any) -> None:
    """10017: possible is a caution, likely a warning; a forecast that falls silent ends it."""
    course = Course(scene)
    row = {"tension": 0.05, "slack": 0.0, "contact": math.nan, "tension_limit_n": 1e5,
           "contact_limit_m_per_s": 0.5}  # fmt: skip

    def see(seconds: float, **risks: float) -> dict[tuple[int, str], Priority]:
        found: dict[tuple[int, str], Priority] = {}
        for _ in range(round(seconds)):
            course.watch.take_risks([row | {"span_s": 10.0}, row | risks | {"span_s": 30.0}])
            found = course.see(1.0)
        return found

    tension, slack = (10017, "tension"), (10017, "slack")
    assert see(10) == {}
    assert see(2, tension=0.2) == {}, "one forecast alone is not yet a reason"
    assert see(3, tension=0.2) == {tension: Priority.CAUTION}
    assert see(5, tension=0.6, slack=0.7) == {
        tension: Priority.WARNING, slack: Priority.WARNING
    }  # fmt: skip
    assert see(20, tension=0.45) == {tension: Priority.WARNING}, "within the deadband"
    assert see(12, tension=0.2) == {tension: Priority.CAUTION}
    assert course.see(16.0) == {}, "the last forecast is older than 5 s"


def test_events_and_modes(scene: Any) -> None:
    course = Course(scene)
    fast = replace(course.quiet).payload_velocity_m_per_s.copy()
    fast[2] = -1.95
    assert course.see(0.1, payload_velocity_m_per_s=fast) == {
        (10010, "tool speed"): Priority.WARNING
    }
    course.see(31.0)
    landing = LimitBreach("landing_speed_m_per_s", "tool", 0.5, 45.0, 45.0, 0.8, 45.0)
    while course.time_ns < 45_000_000_000:
        course.see(0.1)
    assert course.see(5.0, breaches=(landing,)) == {
        (10011, "tool landing_speed_m_per_s"): Priority.ALARM
    }
    assert course.see(6.0, breaches=(landing,)) == {}
    stopped = WinchSnapshot("winch", "emergency_stop", 0.0, "no motion is obeyed", ())
    assert course.see(9.0, winches=(stopped,), winch_at_limit=stopped.at_limit) == {
        (10012, "winch"): Priority.WARNING
    }, "one situation has one alert"


def test_the_upper_section_is_on_the_drum(tmp_path: Any) -> None:
    """Turns and layers are those of its diameter."""
    path = tmp_path / "drum.yaml"
    drum = "drum: {core_radius_m: 0.5, turns_per_layer: 10}"
    path.write_text(
        SMALL_SCENE.replace("max_line_out_m: 400.0", f"max_line_out_m: 250.0\n  {drum}")
    )
    scene = load_scene(path)
    line = scene.ropes[0]
    assert line.rope is not None
    thin = RopeSection(rope=replace(line.rope, diameter_m=0.02), length_m=50.0)
    sections = (thin, RopeSection(rope=line.rope))
    scene = replace(scene, ropes=(replace(line, rope=None, sections=sections),))
    assert SceneFigures(scene).stores[0].diameter_m == line.rope.diameter_m


def test_a_drum_that_is_nearly_empty_and_its_layers(tmp_path: Any) -> None:
    """On r_0 = 0.5 m, 10 turns and 0.9 d a layer: 2π·10·(0.5 + 0.45 d) m in the first."""
    path = tmp_path / "drum.yaml"
    drum = "drum: {core_radius_m: 0.5, turns_per_layer: 10}"
    path.write_text(
        SMALL_SCENE.replace("max_line_out_m: 400.0", f"max_line_out_m: 250.0\n  {drum}")
    )
    made = load_scene(path)
    diameter_m = made.ropes[0].made_of[0].rope.diameter_m
    turn_m = 2.0 * math.pi * (0.5 + 0.45 * diameter_m)
    course = Course(made)
    assert course.see(1.0) == {}
    assert course.see(0.1, line_out_m=250.0 - 2.99 * turn_m) == {(10019, "winch"): Priority.ALARM}
    assert course.see(0.1, line_out_m=250.0 - 3.5 * turn_m) == {(10019, "winch"): Priority.ALARM}
    assert course.see(15.0, line_out_m=250.0 - 5.0 * turn_m) == {}
    changing = {(10019, "winch layer"): Priority.CAUTION}
    assert course.see(0.1, line_out_m=250.0 - 10.0 * turn_m + 4.9) == changing
    assert course.see(15.0, line_out_m=250.0 - 10.0 * turn_m - 7.0) == {}


def test_a_compensation_that_leaves_much_of_the_heave(scene: Any) -> None:
    course = Course(scene)

    def heave(seconds: float, left: float) -> dict[tuple[int, str], Priority]:
        seen: dict[tuple[int, str], Priority] = {}
        for _ in range(round(seconds / 0.5)):
            rate = math.cos(0.7 * course.time_ns * 1e-9)
            figures = (("compensation_on", 1.0), ("compensation_m_per_s", (1.0 - left) * rate))
            winch = WinchSnapshot("winch", "speed", 0.0, "", figures)
            seen = course.see(
                0.5, winches=(winch,), hang_off_velocity_m_per_s=np.array([0, 0, rate])
            )
        return seen

    assert heave(70.0, left=0.25) == {}
    assert heave(70.0, left=0.35) == {(10020, "winch"): Priority.CAUTION}
    assert course.see(15.0) == {}, "switched off"


def test_a_crew_commands_by_words_and_mistakes_are_answered(scene: Any) -> None:
    monitor = AlertMonitor(scene)
    snapshot = replace(Course(scene).quiet, stamp_ns=STEP_NS, tension_top_max_n=2e5)
    assert monitor.observe(snapshot)
    assert not monitor.observe(replace(snapshot, stamp_ns=2 * STEP_NS)), "nothing has changed"
    assert monitor.command("acknowledge 10001.1") == "alert 10001.1 acknowledged"
    assert monitor.observe(replace(snapshot, stamp_ns=3 * STEP_NS)), "a command is published"
    now_ns, listed = monitor.listed()
    back = decode_alerts(encode_alerts(10**18 + now_ns, now_ns, listed))
    assert back == (10**18 + now_ns, now_ns, tuple(listed))
    assert listed[0].state is State.ACKNOWLEDGED
    for words, right in (
        ("", "acknowledge"), ("acknowlege 10001.1", "did you mean 'acknowledge'"),
        ("silence", "write silence 10001.1"), ("shelve 10001.1", "write shelve"),
        ("shelve 10001.1 soon", "give seconds"), ("acknowledge 9.9", "there is no '9.9'"),
        ("a" * 100_000, "a text of 100000 characters; give 200 at most"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=right):
            monitor.command(words)


def test_the_first_list_is_published_though_it_is_empty(scene: Any) -> None:
    """The topic is latched: without it the alerts of a run before would stand there for ever."""
    monitor, snapshot = AlertMonitor(scene), Course(scene).quiet
    assert monitor.observe(replace(snapshot, stamp_ns=STEP_NS))
    assert monitor.listed() == (STEP_NS, [])
    assert not monitor.observe(replace(snapshot, stamp_ns=20 * STEP_NS))


def test_an_ordinary_lift_calls_for_nobody(tmp_path: Any) -> None:
    """EEMUA 191: about one in 10 min; the first 2 min of a sound lift have none."""
    options = RunOptions(scene="deep_lift", end_s=120.0, record=tmp_path / "bag")
    run = UnpacedRun(options)
    while run.twin.time_ns < 120_000_000_000:
        run.advance_slot()
    run.close()
    _, listed = run._alerts.listed()
    assert [one for one in listed if one.priority > Priority.CAUTION] == []


def test_rates_count_each_activation_once() -> None:
    from rope_twin.alerts.alert_list import SECOND, Situation

    alerts, lists = AlertList(), []
    for minute in range(30):  # on for 30 s of each minute, for 12 min: a flood of 12
        for half in (0, 1):
            now_ns = (60 * minute + 30 * half) * SECOND
            on = half == 0 and minute < 12
            present = [Situation(10001, "a", "B", "x", Priority.ALARM, "text")] if on else []
            if minute == 20:
                present.append(Situation(10006, "b", "B", "y", Priority.CAUTION, "text"))
            alerts.update(present, now_ns)
            lists.append((now_ns, tuple(alerts.listed())))
            if on:
                alerts.act("acknowledge", "all")
                lists.append((now_ns, tuple(alerts.listed())))
    found = rates(lists, 1800 * SECOND)
    assert (len(found.comings), found.cautions) == (12, 1)
    assert found.per_window == pytest.approx(4.0)
    assert (found.max_in_window, found.flood) == (10, False)
    assert found.comings[0].acknowledged_after_s == 0.0
    assert found.chattering == ()
