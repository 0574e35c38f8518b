"""Overload protection as an operator sees it: a row, a sentence, a count."""

from __future__ import annotations

import pytest
from ros_bench import ros_ahead_ns

from rope_twin.messages import Level, Status
from rope_twin.ros.paced_twin import PacedTwin
from rope_twin.ros.params import SimulationParams
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.load import load_scene


def paced(**parameters: object) -> PacedTwin:
    params = SimulationParams(scene="shallow_lift", **parameters)  # type: ignore[arg-type]
    return PacedTwin(load_scene("shallow_lift"), params, lambda name, data: None)


def rung_rows(twin: PacedTwin) -> list[Status]:
    return [row for row in twin.rows(ros_ahead_ns()) if row.name == "simulation: accuracy level"]


def test_a_machine_with_room_is_on_the_scenes_own_rung() -> None:
    twin = paced()
    (row,) = rung_rows(twin)
    assert row.level is Level.OK
    assert row.values["elements"] == "40"
    assert row.values["step [s]"] == "0.01"
    assert row.values["changes"] == "0"
    assert list(twin.notices()) == []
    assert twin.summary().level_changes == 0


def test_a_lower_rung_is_reported_once_in_a_sentence_and_stays_in_the_diagnostics() -> None:
    twin = paced()
    assert twin.protection is not None
    assert twin.protection.start_at(2.0)
    (sentence,) = twin.notices()
    assert sentence.startswith(
        "stepping down to accuracy level 3 of 4, 40 elements and steps of 50 ms, error"
    )
    assert sentence.endswith(": it would take 200% of the time there is")
    assert list(twin.notices()) == []
    (row,) = rung_rows(twin)
    assert row.level is Level.WARN
    assert "level 3 of 4, 40 elements and steps of 50 ms, error" in row.message
    assert row.values["step [s]"] == "0.05"
    assert twin.summary().level_changes == 1
    assert twin.summary().step_s == 0.05
    assert twin.twin.level == AccuracyLevel(50_000_000)


def test_without_a_ladder_nothing_is_said_of_one() -> None:
    twin = paced(overload_protection=False)
    assert twin.protection is None
    assert rung_rows(twin) == []
    assert twin.summary().level_changes == 0


@pytest.mark.parametrize("halvings", [0, 1])
def test_the_words_say_how_many_elements_are_left(halvings: int) -> None:
    twin = paced()
    assert twin.protection is not None
    twin.protection.start_at(100.0 if halvings else 1.0)
    (sentence,) = twin.notices()
    assert ("20 elements in place of 40" in sentence) == bool(halvings)
