"""The fault campaign: what it injects, how it judges, and that the border holds.

All faults of a livelier sea: `pytest -m long test/studies/test_faults.py`, some minutes; the
figures are those of `rope_twin faults SCENE --json`.
"""

from __future__ import annotations

import json
import random

import pytest

from rope_twin.cli import main
from rope_twin.messages import Level
from rope_twin.scene.load import load_scene
from rope_twin.studies.fault_campaign import (
    FROM_S,
    PATIENCE_S,
    UNTIL_S,
    TopTensionRecord,
    judge,
    plan,
)
from rope_twin.studies.fault_injection import (
    DEPTH,
    HEAVE,
    INPUTS,
    JUDGING,
    PAIR,
    SECOND_NS,
    SENSORS,
    Fault,
    Message,
    Truth,
    faults_of,
    instrumented,
    laid_over,
    readings,
)

SOUND = [
    Message(HEAVE, k * 50_000_000 + 1_000_000, k * 50_000_000, (0.01 * k, 0.2)) for k in range(1000)
]
MS_20 = 20_000_000
SPARSE = ["off", "stuck", "times 10", "clock +9 s", "another sender", "rate of opposite sign"]


def fault(name: str) -> Fault:
    (found,) = (one for one in faults_of(HEAVE) if one.name == name)
    return found


@pytest.mark.parametrize("topic", INPUTS)
def test_names_are_unique_and_pairs_are_of_single_faults(topic: str) -> None:
    faults = faults_of(topic)
    names = [one.name for one in faults]
    assert len(set(names)) == len(names)
    pairs = [name.split(PAIR) for name in names if PAIR in name]
    assert all(len(pair) == 2 and set(pair) <= set(names) for pair in pairs)
    assert bool(pairs) == topic.startswith("ship/")


def test_there_are_at_least_two_hundred_runs() -> None:
    assert len(plan(load_scene("deep_lift"), INPUTS)) >= 200


@pytest.mark.parametrize("one", faults_of(HEAVE), ids=lambda one: str(one.name))
def test_a_fault_changes_what_comes_after_it_begins_and_nothing_before(one: Fault) -> None:
    from_ns = 10 * SECOND_NS
    found = laid_over(SOUND, one, from_ns, 1)
    before = [message for message in SOUND if message.stamp_ns < from_ns]
    assert found[: len(before)] == before
    assert found != SOUND
    assert laid_over(SOUND, one, from_ns, 1) == found, "the same seed gives the same messages"
    arrivals = [message.received_ns for message in found]
    assert arrivals == sorted(arrivals)


def test_every_message_has_its_bytes() -> None:
    rng = random.Random(1)
    for topic in INPUTS:
        for one in faults_of(topic):
            if topic == HEAVE:
                assert all(isinstance(m.encoded(SECOND_NS), bytes) for m in one.change(SOUND, rng))


def measured(topic: str) -> list[Message]:
    """Readings of a line that is paid out at 0.5 m/s while its tension swings."""
    truths = [
        Truth(k * MS_20, 1e3 + 0.01 * k, 0.5 + 1e-4 * k, 3e5 + 1e4 * (k % 50), 990.0 + 0.01 * k)
        for k in range(1500)
    ]
    found = readings(instrumented(load_scene("deep_lift")), truths, 10_000_000, 1)
    return [one for one in found if one.topic == topic]


def test_instruments_scatter_by_their_uncertainty() -> None:
    rows = [one.content.rows[0] for one in measured(SENSORS)]
    assert len(rows) == 300
    scatter = [place - (1000.0 + 0.05 * k) for k, (_, place, _, _) in enumerate(rows)]
    assert sum(one * one for one in scatter) / len(rows) == pytest.approx(0.02**2, rel=0.3)
    assert [row[2] for row in rows] == pytest.approx([0.5 + 5e-4 * k for k in range(300)])
    depths = [one.content.rows[0][1] for one in measured(DEPTH)]
    scatter = [one - (990.0 + 0.05 * k) for k, one in enumerate(depths)]
    assert sum(one * one for one in scatter) / len(rows) == pytest.approx(0.5**2, rel=0.3)


@pytest.mark.parametrize(
    ("topic", "one"),
    [(topic, one) for topic in JUDGING for one in faults_of(topic)],
    ids=lambda one: one.name if isinstance(one, Fault) else one,
)
def test_a_fault_of_an_instrument_changes_what_comes_after_it_begins(
    topic: str, one: Fault
) -> None:
    sound, from_ns = measured(topic), 10 * SECOND_NS
    found = laid_over(sound, one, from_ns, 1)
    assert [message for message in found if message.stamp_ns < from_ns][:50] == sound[:50]
    assert found != sound
    assert laid_over(sound, one, from_ns, 1) == found
    assert all(message.encoded(10**18) for message in found)


@pytest.mark.parametrize(
    ("name", "column", "factor"),
    [
        ("tension in lbf", 3, 1.0 / (0.45359237 * 9.80665)),
        ("line out in ft", 1, 1.0 / 0.3048),
        ("line speed of opposite sign", 2, -1.0),
    ],
)
def test_a_wrong_unit_or_sign_changes_one_value_and_leaves_the_others(
    name: str, column: int, factor: float
) -> None:
    sound = measured(SENSORS)
    (one,) = (one for one in faults_of(SENSORS) if one.name == name)
    for before, after in zip(sound, laid_over(sound, one, 0, 1), strict=True):
        old, new = before.content.rows[0], after.content.rows[0]
        assert new[column] == pytest.approx(factor * old[column], rel=1e-12)
        assert [a == b for a, b in zip(old, new, strict=True)].count(False) == 1


def test_a_fault_of_a_measurement_must_lower_the_index() -> None:
    """It makes no error of the twin: only the index can show it."""
    sound, off = course(0.0, 0.0), fault("off")
    assert not judge(SENSORS, off, sound, course(0.0, 0.0)).met
    assert judge(SENSORS, off, sound, course(0.0, 0.0, Level.WARN, FROM_S + 9.0)).met
    assert not judge(SENSORS, off, sound, course(0.0, 0.0, Level.WARN, FROM_S + 11.0)).met


def course(
    errors_n: float, from_s: float, level: Level = Level.OK, level_s: float = 0.0
) -> TopTensionRecord:
    """A tension of ±100 N that is off by so much from a time on, and a row raised from another."""
    made = TopTensionRecord()
    for k in range(1, round(UNTIL_S / 0.02) + 1):
        time_s = 0.02 * k
        made.time_s.append(time_s)
        swing = 100.0 if k % 2 else -100.0
        made.tension_n.append(1000.0 + swing + (errors_n if time_s > from_s else 0.0))
        raised = level if level_s and time_s > level_s else Level.OK
        made.quality.append((0.6, "input: words") if raised else (0.7, "residual: unknown"))
        made.rows.append({"simulation: input heave": (raised, "words")})
    return made


@pytest.mark.parametrize(
    ("error_n", "flagged_s", "met"),
    [
        (50.0, 0.0, False),  # off and never flagged
        (50.0, FROM_S + 1.9, True),
        (50.0, FROM_S + 2.5, False),
        (14.0, 0.0, True),  # 14 % of the standard deviation: within the allowance
    ],
)
def test_the_verdict_follows_from_error_and_flag(
    error_n: float, flagged_s: float, met: bool
) -> None:
    sound = course(0.0, 0.0)
    found = judge(HEAVE, fault("off"), sound, course(error_n, FROM_S, Level.WARN, flagged_s))
    assert found.met == met
    assert found.worst_error_pct == pytest.approx(error_n, rel=1e-3)
    if flagged_s:
        assert found.flagged_after_s == pytest.approx(flagged_s - FROM_S, abs=0.03)
        assert found.level == "WARN"
        assert found.quality_after_s == found.flagged_after_s
        assert (found.dropped, found.quality_reason) == (True, "input: words")
    else:
        assert found.flagged_after_s is None
        assert found.quality_after_s is None
        assert not found.dropped
        assert (found.off_while_ok_s > PATIENCE_S) == (error_n > 15.0)


def test_a_twin_that_ends_has_not_survived() -> None:
    sound, ended = course(0.0, 0.0), course(0.0, 0.0)
    ended.ended = "SolverError: no next state"
    assert not judge(HEAVE, fault("off"), sound, ended).met


def test_the_command_prints_one_object(capsys: pytest.CaptureFixture[str]) -> None:
    words = [word for name in SPARSE for word in ("--fault", name)]
    assert main(["faults", "deep_lift", "--input", HEAVE, "--json", "--jobs", "1", *words]) == 0
    found = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (found["runs"], found["missed"]) == (len(SPARSE), 0)
    assert all(row["survived"] and row["met"] for row in found["findings"])
    flagged = {row["fault"]: row["flagged_after_s"] for row in found["findings"]}
    assert all(seconds is not None for seconds in flagged.values()), flagged
    assert found["quality_dropped"] == found["detectable"] == len(SPARSE)
    assert all(row["quality_after_s"] <= 10.0 for row in found["findings"])


def test_without_a_fault_the_quality_index_does_not_fall(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["faults", "deep_lift", "--sound", "0.06", "--json"]) == 0
    found = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (found["hours"], found["drops"], found["findings"]) == (0.06, 0, [])
    assert main(["faults", "deep_lift", "--sound", "-1"]) == 1
    assert "no duration" in capsys.readouterr().err


def test_an_unknown_fault_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["faults", "deep_lift", "--fault", "stuk"]) == 1
    assert "did you mean 'stuck'" in capsys.readouterr().err


def test_options_that_have_no_effect_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["faults", "deep_lift", "--jobs", "0"]) == 1
    assert "--jobs: 0 runs in parallel; give 1 or more." in capsys.readouterr().err
    assert main(["faults", "deep_lift", "--sound", "1", "--fault", "lost"]) == 1
    assert "--sound: a run without a fault has no other option" in capsys.readouterr().err
    assert main(["faults", "deep_lift", "--input", "ship/heav"]) == 1
    assert "did you mean 'ship/heave'" in capsys.readouterr().err
    assert main(["faults", "still_water", "--fault", "stuck"]) == 1
    assert "name a scene with a sea" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize("scene", ["deep_lift", "wave_zone", "storm"])
def test_every_fault_is_flagged(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["faults", scene, "--json"]) == 0
