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
from rope_twin.studies.faults.campaign import (
    FROM_S,
    PATIENCE_S,
    UNTIL_S,
    Course,
    judge,
    plan,
)
from rope_twin.studies.faults.injection import (
    HEAVE,
    INPUTS,
    PAIR,
    SECOND_NS,
    Fault,
    Message,
    faults_of,
    laid_over,
)

SOUND = [
    Message(HEAVE, k * 50_000_000 + 1_000_000, k * 50_000_000, (0.01 * k, 0.2)) for k in range(1000)
]
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


def course(errors_n: float, from_s: float, level: Level = Level.OK, level_s: float = 0.0) -> Course:
    """A tension of ±100 N that is off by so much from a time on, and a row raised from another."""
    made = Course()
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
    assert main(["faults", "deep_lift", "--input", "ship/heav"]) == 1
    assert "did you mean 'ship/heave'" in capsys.readouterr().err
    assert main(["faults", "still_water", "--fault", "stuck"]) == 1
    assert "name a scene with a sea" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize("scene", ["deep_lift", "wave_zone", "storm"])
def test_every_fault_is_flagged(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["faults", scene, "--json"]) == 0
