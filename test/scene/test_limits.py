"""Limits of a scene: strict reading, evaluation at every step, reports and exit code."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from rope_twin.cli import main
from rope_twin.errors import SceneError
from rope_twin.messages import Encoder, Level, Status, decode, read_cloud, statuses
from rope_twin.messages.diagnostics import BreachWords, breach_words, landing_words
from rope_twin.scene.convergence import scene_digest
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Joint, Limits, RopeSection, Scene
from rope_twin.twin.snapshot import LimitBreach, Snapshot
from rope_twin.twin.statics import weak_ropes
from rope_twin.twin.twin import Twin

STILL = load_scene("still_water")
AT_REST_N = 210442.5  # its tension at the hang-off


def written(folder: Path, limits: str) -> Path:
    """Write still_water with these limits."""
    path = folder / "limited.yaml"
    text = STILL.path.read_text(encoding="utf-8")
    path.write_text(f"{text}\nlimits: {limits}\n", encoding="utf-8")
    return path


def limited(scene: Scene = STILL, **limits: float) -> Scene:
    return replace(scene, limits=Limits(**limits))  # type: ignore[arg-type]


def breaches(snapshot: Snapshot) -> dict[str, LimitBreach]:
    return {breach.limit: breach for breach in snapshot.breaches}


def row(snapshot: Snapshot) -> Status:
    return next(one for one in statuses(snapshot, None) if one.name == "simulation: limits")


def run(path: Path, *words: str) -> int:
    return main(["run", str(path), "--speed", "0", "--duration", "1", "--no-record", *words])


@pytest.mark.parametrize("weak_n", [180e3, 195e3], ids=["parted", "sound"])
def test_utilisation_is_that_of_the_most_used_section(weak_n: float) -> None:
    """Static tension at the upper end of each section over its own MBL; half an element less.

    A lower section whose MBL the top tension exceeds is sound as long as its own tension is lower.
    """
    line = STILL.ropes[0]
    assert line.rope is not None
    lower, upper = (replace(line.rope, breaking_load_n=mbl_n) for mbl_n in (weak_n, 2e6))
    heavy = replace(upper, mass_kg_per_m=30.0)
    sections = (RopeSection(rope=lower, length_m=0.5 * line.length_m), RopeSection(rope=heavy))
    scene = replace(STILL, ropes=(replace(line, rope=None, sections=sections),))
    (weak, at_joint_n), (strong, at_top_n) = lift_figures(scene).upper_ends(line.length_m)
    assert at_top_n > 1.5 * weak_n
    shares = (at_joint_n / weak.breaking_load_n, at_top_n / strong.breaking_load_n)
    snapshot = Twin(scene).snapshot()
    (strength,) = snapshot.strength
    half_n = 0.5 * lift_figures(scene).bars[0].weight_n_per_m * line.length_m / line.elements
    assert strength.utilisation == pytest.approx(max(shares), abs=1.01 * half_n / weak_n)
    assert strength.utilisation_now == strength.utilisation
    assert strength.max_n == pytest.approx(at_top_n)
    assert ("utilisation" in breaches(snapshot)) == (max(shares) > 1.0)


def test_a_section_is_weak_by_its_own_tension() -> None:
    """Heavy wire above a sling: a warning for a sling whose own load is above MBL/3."""
    line = STILL.ropes[0]
    assert line.rope is not None
    heavy = replace(line.rope, mass_kg_per_m=60.0, breaking_load_n=5e6)
    upper = replace(line, length_m=200.0, elements=5, to="ring")
    warned = []
    for mbl_n in (6e5, 4e5):
        sling = replace(line.rope, breaking_load_n=mbl_n)
        sections = (RopeSection(rope=sling, length_m=20.0), RopeSection(rope=heavy))
        lower = replace(
            line, name="lower", rope=None, sections=sections, length_m=800.0, elements=40,
            from_="ring",
        )  # fmt: skip
        scene = replace(STILL, ropes=(upper, lower), joints=(Joint(name="ring"),))
        warned.append(list(weak_ropes(scene, Twin(scene).all_ropes)))
    assert warned[0] == []
    (weak,) = warned[1]
    assert "'lower' carries 156 kN at rest against a breaking load of 400 kN" in weak


def test_a_broken_limit_is_exit_code_4_unless_it_is_allowed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, "{tension_n: 200000.0}")
    assert run(path, "--json") == 4
    out, messages = capsys.readouterr()
    reported = json.loads(out)
    (broken,) = reported["limits_broken"]
    assert (broken["limit"], broken["where"], broken["first_s"]) == ("tension_n", "hoist", 0.0)
    assert reported["steps"] == 100, "the run is not ended early"
    words = "limit violated: tension of 'hoist' 210.4 kN, above the limit of 200.0 kN"
    assert messages.count(words) == 1
    assert run(path, "--allow-overload") == 0
    assert "limit violated: tension of 'hoist'" in capsys.readouterr().out
    assert run(written(tmp_path, "{tension_n: 220000.0}")) == 0


def test_a_scene_that_exceeds_a_limit_in_static_equilibrium_has_a_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scene", "check", str(written(tmp_path, "{utilisation: 0.2}"))]) == 1
    out = capsys.readouterr().out
    assert (
        "critical: in static equilibrium, utilisation of 'hoist' 0.208, above the limit of 0.2"
        in out
    )
    assert "1 critical warning" in out
    assert main(["scene", "check", str(written(tmp_path, "{utilisation: 0.21}"))]) == 0
    assert ": valid, " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ("{tensoin_n: 1.0}", "limits.tensoin_n: unknown key; did you mean 'tension_n'"),
        ("{strain: 5.0}", "limits.strain: 5 is out of range; give 0.0001 to 1"),
        ("{landing_speed_m_per_s: 1.0}", "landing_speed_m_per_s: the scene has no seabed"),
        ("{bed_clearance_m: 5.0}", "limits.bed_clearance_m: the scene has no seabed"),
        ("{line_clearance_m: 1.0}", "limits.line_clearance_m: the scene has no two lines"),
        ("{bend_radius: true}", "limits.bend_radius: no rope of the scene has a minimum bend"),
    ],
)
def test_limits_are_read_strictly(tmp_path: Path, limits: str, words: str) -> None:
    with pytest.raises(SceneError, match="limits") as refused:
        load_scene(written(tmp_path, limits))
    assert words in str(refused.value)


def test_limits_leave_study_and_saved_states_valid(tmp_path: Path) -> None:
    scene = limited(tension_n=1e5)
    assert scene_digest(scene) == scene_digest(STILL)
    Twin(STILL).save(tmp_path / "state")
    assert Twin.restore(tmp_path / "state", scene).snapshot().breaches


def test_breaking_load_and_strain_are_limits_of_every_scene() -> None:
    line = STILL.ropes[0]
    assert line.rope is not None
    weak = replace(line, rope=replace(line.rope, breaking_load_n=2e5))
    assert breaches(Twin(replace(STILL, ropes=(weak,))).snapshot())["utilisation"].allowed == 1.0
    soft = replace(line, rope=replace(line.rope, axial_stiffness_n=2e6))
    computed = breaches(Twin(replace(STILL, ropes=(soft,))).snapshot())
    assert list(computed) == ["strain"]
    assert computed["strain"].worst == pytest.approx(AT_REST_N / 2e6, rel=0.01)
    assert not Twin(STILL).snapshot().breaches


def test_a_peak_between_two_snapshots_breaks_a_limit(tmp_path: Path) -> None:
    """The winch jerks; at the snapshot the tension is down again. A restart remembers it."""
    scene = limited(tension_n=1.05 * AT_REST_N)
    twin = Twin(scene)
    assert row(twin.snapshot()).level is Level.OK
    twin.submit_speed(None, -0.5)
    twin.advance(500)
    twin.submit_speed(None, 0.0)
    twin.advance(1500)
    snapshot = twin.snapshot()
    assert snapshot.tension_top_n < scene.limits.tension_n  # type: ignore[operator]
    broken = breaches(snapshot)["tension_n"]
    assert broken.worst == twin.statistics().tension_top_max_n > broken.allowed
    assert row(snapshot).level is Level.ERROR
    twin.save(tmp_path / "state")
    back = Twin.restore(tmp_path / "state", scene)
    for one in (twin, back):
        one.advance(6500)
    after = twin.snapshot()
    assert after.breaches == back.snapshot().breaches == snapshot.breaches
    assert row(after).level is Level.WARN, "kept again for more than a minute"


def test_a_breach_is_logged_once_when_it_happens() -> None:
    twin, messages = Twin(limited(tension_n=1.005 * AT_REST_N)), BreachWords()
    assert messages.of(twin.snapshot()) == []
    twin.submit_speed(None, -0.5)
    words = []
    for _ in range(100):
        twin.advance(2)
        words += messages.of(twin.snapshot())
    (sentence,) = words
    (broken,) = twin.snapshot().breaches
    assert 0.0 < broken.first_s < broken.worst_s <= broken.last_s <= 2.0
    assert f"first at {broken.first_s:.2f} s" in sentence


def test_a_value_just_over_its_limit_is_not_printed_as_the_limit() -> None:
    breach = LimitBreach("utilisation", "hoist", 0.15, 61.28, 61.28, 0.150042, 61.28)
    assert "'hoist' 0.150042, above the limit of 0.15 (" in breach_words(breach)


def test_limits_of_payload_speed_depth_and_slack() -> None:
    limits = {"payload_speed_m_per_s": 0.3, "payload_depth_m": 1004.0, "min_tension_n": 140e3}
    twin = Twin(limited(**limits))
    assert not twin.snapshot().breaches
    twin.submit_speed(None, 0.5)
    for _ in range(300):
        twin.advance(2)
        snapshot = twin.snapshot()
        depth_m = -float(snapshot.payload_position_m[2])
        speed = float(math.dist(snapshot.payload_velocity_m_per_s, (0.0, 0.0, 0.0)))
        computed = breaches(snapshot)
        for name, value in (("payload_speed_m_per_s", speed), ("payload_depth_m", depth_m)):
            if value > limits[name]:
                assert computed[name].last_s == snapshot.time_s
                assert computed[name].worst >= value
    assert set(computed) == set(limits)
    assert computed["payload_depth_m"].worst == depth_m
    assert computed["min_tension_n"].worst < 140e3


def test_a_landing_speed_limit(tmp_path: Path) -> None:
    """Lowered onto a bed just below it: the payload meets it at the winch's speed.

    With a current of none the step is that of abandonment_and_recovery, compiled already.
    """
    more = "  - seabed: {depth_m: 1007.0}\n  - current: {profile: [[0.0, [0.0, 0.0]]]}"
    text = STILL.path.read_text(encoding="utf-8").replace(
        "effects:",
        f"limits: {{landing_speed_m_per_s: 0.3, bed_clearance_m: 0.5}}\neffects:\n{more}",
    )
    path = tmp_path / "bed.yaml"
    path.write_text(text.replace("elements: 50", "elements: 20"), encoding="utf-8")
    twin = Twin(load_scene(path))
    twin.submit_speed(None, 0.5)
    while not (bed := twin.snapshot().seabed) or not bed.payload_landed:
        expected = {"bed_clearance_m"} if bed and bed.payload_height_m < 0.5 else set()
        assert set(breaches(twin.snapshot())) == expected
        twin.advance(2)
        assert twin.time_ns < 30e9
    twin.advance(10)
    landing = breaches(twin.snapshot())["landing_speed_m_per_s"]
    assert landing.where == "module"
    assert landing.worst == pytest.approx(0.5, abs=0.25)
    near = breaches(twin.snapshot())["bed_clearance_m"]
    assert near.worst <= 0.0 < near.allowed, "it lies on the bed"


def test_landings_are_counted_with_their_speeds(tmp_path: Path) -> None:
    """Without a limit: set down at 0.5 m/s, lifted off, and set down again more slowly."""
    more = "  - seabed: {depth_m: 1007.0}\n  - current: {profile: [[0.0, [0.0, 0.0]]]}"
    text = STILL.path.read_text(encoding="utf-8").replace("effects:", f"effects:\n{more}")
    path = tmp_path / "bed.yaml"
    path.write_text(text.replace("elements: 50", "elements: 20"), encoding="utf-8")
    twin = Twin(load_scene(path))
    assert twin.snapshot().landings is None
    seen = []
    for speed, seconds in ((0.5, 16), (-0.5, 10), (0.15, 40)):
        twin.submit_speed(None, speed)
        for _ in range(round(50 * seconds)):
            twin.advance(2)
            snapshot = twin.snapshot()
            if snapshot.landings is not None and (
                not seen or snapshot.landings.count > seen[-1].count
            ):
                seen.append(snapshot.landings)
    first, last = seen[0], seen[-1]
    assert first.count == 1
    assert first.first_m_per_s == pytest.approx(0.5, abs=0.25)
    assert last.count > 1
    assert (last.first_s, last.first_m_per_s) == (first.first_s, first.first_m_per_s)
    assert last.fastest_m_per_s >= last.first_m_per_s
    (row,) = (one for one in statuses(snapshot, None) if one.name == "simulation: seabed")
    assert row.values["landings"] == str(last.count)
    words = f"at {first.first_s:.1f} s with {first.first_m_per_s:.2f} m/s"
    assert landing_words(first) == f"landed {words}"
    assert landing_words(last).startswith(f"landed {last.count} times, first {words}, fastest")


def test_a_limit_of_line_clearance() -> None:
    scene = load_scene("two_line_loop")
    nearest_m = 0.0
    for limit_m in (1e-3, 1e3):
        twin = Twin(replace(scene, limits=Limits(line_clearance_m=limit_m)))
        twin.advance(2)
        snapshot = twin.snapshot()
        assert snapshot.lines is not None
        nearest_m = snapshot.lines.nearest.distance_m
        computed = breaches(snapshot).get("line_clearance_m")
        assert (computed is not None) == (nearest_m < limit_m)
    assert computed is not None
    assert computed.worst == nearest_m
    assert computed.allowed == 1e3


def test_the_minimum_bend_radius_of_a_rope_is_a_limit(tmp_path: Path) -> None:
    """A rope of the shipped scene that lies in a curve on the bed."""
    scene = load_scene("chain_on_bottom")
    line = scene.ropes[0]

    def strict(rope: object) -> object:
        return replace(rope, minimum_bend_radius_m=900.0)  # type: ignore[type-var]

    if line.rope is not None:
        line = replace(line, rope=strict(line.rope))  # type: ignore[arg-type]
    else:
        parts = tuple(replace(section, rope=strict(section.rope)) for section in line.sections)  # type: ignore[arg-type]
        line = replace(line, sections=parts)
    for allowed in (False, True):
        limits = Limits(bend_radius=not allowed)
        twin = Twin(replace(scene, ropes=(line,), limits=limits))
        found = breaches(twin.snapshot())
        assert ("bend_radius" in found) is not allowed
    assert allowed
    found = breaches(
        Twin(replace(scene, ropes=(line,), limits=Limits(bend_radius=True))).snapshot()
    )
    assert found["bend_radius"].worst < found["bend_radius"].allowed == 900.0


def test_dynamic_amplification_refers_to_static_tension_at_the_same_line_out() -> None:
    """The weight of the rope that is paid out is no dynamic load."""
    twin = Twin(STILL)
    (first,) = twin.snapshot().strength
    assert first.dynamic_amplification == pytest.approx(1.0, abs=1e-6)
    twin.submit_speed(None, 0.5)
    expected = 1.0
    for _ in range(1000):
        twin.advance(2)
        snapshot = twin.snapshot()
        (now,) = snapshot.strength
        assert now.static_n is not None
        expected = max(expected, snapshot.tension_top_max_n / now.static_n)
    weight_n_per_m = (6.38352 - 1025.0 * 8.0424772e-4) * 9.80665
    paid_out_m = twin.snapshot().line_out_m - 1000.0
    assert now.static_n == pytest.approx(first.static_n + weight_n_per_m * paid_out_m, abs=5.0)  # type: ignore[operator]
    assert now.dynamic_amplification == pytest.approx(expected, rel=1e-12)
    assert 1.0 < expected < 1.1
    snapshot = twin.snapshot()
    message = decode("ropes/utilisation", Encoder(0).encode("ropes/utilisation", snapshot))
    (reported,) = read_cloud(message)
    assert reported["name"] == b"hoist"
    assert reported["utilisation"] == now.utilisation == now.max_n / 1013440.0
    assert reported["dynamic_amplification"] == now.dynamic_amplification
    assert reported["static_tension_n"] == now.static_n


@pytest.mark.parametrize("name", ["smooth_5km", "two_line_loop"])
def test_dynamic_amplification_is_one_at_rest_where_the_top_does_not_pull_most(name: str) -> None:
    """A floating rope pulls most at its load, the lines of a loop pull most below it."""
    twin = Twin(load_scene(name))
    before = twin.snapshot()
    twin.advance(20)
    first = before.strength[0]
    assert first.static_n is not None
    assert first.max_n > 1.01 * first.static_n
    for rope in (*before.strength, *twin.snapshot().strength):
        assert rope.dynamic_amplification == pytest.approx(1.0, abs=1e-3)
