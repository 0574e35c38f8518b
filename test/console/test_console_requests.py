"""Limits of the crew and requests to learning: who may make them, and what is answered."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from console_rig import ConsoleRig, replies

from rope_twin import load_scene
from rope_twin.console.control import FEEDBACK_S
from rope_twin.console.pages import Page
from rope_twin.console.requests import scene_facts
from rope_twin.scene.winch import Drum


def seated() -> tuple[ConsoleRig, Page]:
    """A rig and a page that has the seat."""
    rig = ConsoleRig()
    page = rig.page(signed_in=True)
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    replies(page)
    return rig, page


def asked(rig: ConsoleRig, page: Page, ticks: int = 2, **content: Any) -> list[dict[str, Any]]:
    """Make a request, and return its answers."""
    rig.desk.take(page, {"id": 7, **content})
    found = []
    for _ in range(ticks):
        rig.tick()
        found += replies(page)
    return found


def test_a_limit_is_sent_and_answered_when_the_twin_reports_it() -> None:
    rig, page = seated()
    first, second = asked(rig, page, do="limit", name="tension_n", value=450e3)
    assert rig.commander.alert_words == ["limit tension_n 450000.0"]
    assert (first["stage"], second["stage"], second["ok"]) == ("sent", "done", True)


def test_a_limit_that_the_twin_does_not_take_is_answered_with_why() -> None:
    rig, page = seated()
    rig.commander.obeys = False
    ticks = round(FEEDBACK_S / 0.05) + 2
    *_, last = asked(rig, page, ticks, do="limit", name="tension_n", value=450e3)
    assert not last["ok"]
    assert "stricter than the scene's" in last["words"]


@pytest.mark.parametrize(
    ("name", "value"),
    [("tension_n", math.nan), ("tension_n", -1.0), ("tension_n", 0), ("tension_n", "4e5"),
     ("tension_n", True), ("tension_n", 10**400), ("tension", 4e5),
      (None, 4e5), (["tension_n"], 4e5)],
)  # fmt: skip
def test_what_is_no_limit_is_refused_in_one_sentence(name: object, value: object) -> None:
    rig, page = seated()
    (answer,) = asked(rig, page, do="limit", name=name, value=value)
    assert not answer["ok"]
    assert answer["words"].startswith("limit")
    assert not rig.commander.alert_words


def test_learning_is_asked_and_its_answer_passed_on() -> None:
    rig, page = seated()
    *_, last = asked(rig, page, do="learning", what="tare")
    assert rig.commander.called == ["estimate/tare"]
    assert (last["ok"], last["words"]) == (True, "estimate/tare: done")
    (refused,) = asked(rig, page, do="learning", what="tar")
    assert "did you mean 'tare'" in refused["words"]


def test_without_an_answer_learning_is_not_there() -> None:
    rig, page = seated()
    rig.commander.obeys = False
    *_, last = asked(rig, page, round(FEEDBACK_S / 0.05) + 2, do="learning", what="apply")
    assert not last["ok"]
    assert "--learn" in last["words"]


@pytest.mark.parametrize("content", [{"do": "limit", "name": "tension_n", "value": 1e5},
                                     {"do": "learning", "what": "tare"}])  # fmt: skip
def test_only_the_page_with_the_seat_may(content: dict[str, Any]) -> None:
    rig, _ = seated()
    other = rig.page(signed_in=True)
    replies(other)
    (answer,) = asked(rig, other, **content)
    assert "has the seat" in answer["words"]
    (answer,) = asked(rig, rig.page(), **content)
    assert "token" in answer["words"]
    reading = ConsoleRig(control=False)
    (answer,) = asked(reading, reading.page(), **content)
    assert not answer["ok"]
    assert not rig.commander.alert_words + rig.commander.called


def test_a_limit_of_what_the_scene_has_not_is_refused_at_once() -> None:
    rig, page = seated()
    (answer,) = asked(rig, page, do="limit", name="line_clearance_m", value=2.0)
    assert not answer["ok"]
    assert "the scene has not two lines" in answer["words"]
    assert rig.commander.alert_words == []


def test_the_drum_has_layers_of_the_upper_section() -> None:
    """Not of the compensator at the lower end."""
    scene = load_scene("passive_lift")
    assert scene.winch is not None
    drum = Drum(core_radius_m=0.5, turns_per_layer=20)
    scene = replace(scene, winch=replace(scene.winch, drum=drum))
    rise_m = scene_facts(scene)["winches"]["winch"]["layer_rise_m"]
    assert rise_m == pytest.approx(0.9 * 0.04)
