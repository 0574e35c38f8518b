"""Settings of feeds: nothing about units and signs is assumed; one sentence for each error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from feed_samples import LINES, MOTIONS, SETTINGS

from rope_twin.errors import InputError, SceneError
from rope_twin.feeds.configuration import FORMATS, FeedSettings, read_settings, with_source
from rope_twin.files import share_dir

SHIPPED = sorted(path.stem for path in (share_dir() / "config" / "feeds").glob("*.yaml"))


@pytest.mark.parametrize("name", SHIPPED)
def test_settings_that_come_with_the_program_are_valid(name: str) -> None:
    feeds = read_settings(name)
    assert all(one.source and one.check() is None for one in feeds.values())


@pytest.mark.parametrize("name", FORMATS)
def test_every_unit_and_sign_must_be_given(name: str) -> None:
    given = SETTINGS[name]
    assert FeedSettings(format=name, **given).check() is None
    form = FORMATS[name]
    assert form.signs
    for table, needed in (("units", form.units), ("positive", form.signs)):
        for quantity in needed:
            if quantity not in given.get(table, {}):
                continue  # a feed by columns has only what its columns have
            left = {key: word for key, word in given[table].items() if key != quantity}
            fault = FeedSettings(format=name, **{**given, table: left}).check()
            assert fault is not None
            assert fault.startswith(f"{table} has no {quantity}; there is no default")


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("lci90", {"format": "lci9"}, "did you mean 'lci90'?"),
        ("lci90", {"tension_of": ""}, "tension_of is missing; give load_pin or motor"),
        ("lci90", {"units": {"tension": "lb", "payout": "m", "speed": "m/s"}}, "tension is 'lb'"),
        ("lci90", {"positive": {"payout": "up", "speed": "in"}}, "give out or in"),
        ("lci90", {"units": {"tension": "lbf", "payout": "m", "speed": "m/s", "heave": "m"}},
         "does not take"),
        ("tss1", {"heave_of": ""}, "heave_of is missing"),
        ("tss1", {"heave_of": "reference"}, "rest_heading_deg is missing"),
        ("tss1", {"stamp": "instrument"}, "tss1 has no time"),
        ("tss1", {"units": {"heave": "m"}}, "remove it"),
        ("wir", {"checksum": ""}, "checksum is missing; give sum or none"),
        ("rcwd", {"length_at": "drum"}, "length_at is 'drum'; give block or motor"),
        ("columns", {"start": ""}, "start is missing"),
        ("columns", {"columns": {"tensoin": 1}}, "did you mean 'tension'?"),
        ("columns", {"columns": {"tension": 0}}, "give a number from 1 to 99"),
        ("lci90", {"checksum": "sum"}, "checksum has no effect with lci90; remove it"),
        ("lci90", {"heave_of": "crane_tip"}, "heave_of has no effect"),
        ("tss1", {"rest_heading_deg": 10.0}, "rest_heading_deg has no effect"),
        ("rcwd", {"tension_of": "motor"}, "tension_of has no effect"),
        ("octans", {"sentences": "PHTRO"}, "sentences is 'PHTRO'"),
        ("octans", {"sentences": "PHLIN PHSPD", "heave_of": "reference", "rest_heading_deg": 0.0},
         "without roll and pitch; give PHTRO PHLIN PHSPD"),
        ("tss1", {"forward": "tcp://:4001"}, "give tcp-server://HOST:PORT"),
        ("columns", {"start": "$R30C,1"}, "before the first comma"),
        ("columns", {"columns": {"tension": 2, "payout": 2}}, "that of tension; give its own"),
    ],
)  # fmt: skip
def test_wrong_settings_are_refused_in_one_sentence(
    name: str, change: dict[str, Any], words: str
) -> None:
    fault = FeedSettings(**{"format": name, **SETTINGS[name], **change}).check()
    assert fault is not None
    assert words in fault
    assert fault.count("; ") == 1 or "did you mean" in fault


def test_a_file_is_read_with_its_lines(tmp_path: Path) -> None:
    path = tmp_path / "ship.yaml"
    path.write_text("feeds:\n  mru:\n    format: tss1\n    positiv: {heave: up}\n", "utf-8")
    with pytest.raises(
        SceneError,
        match=r"ship\.yaml, line 4, feeds\.mru\.positiv: unknown key; did you mean 'positive'\?",
    ):
        read_settings(str(path))
    path.write_text("feeds: {}\n", "utf-8")
    with pytest.raises(SceneError, match="feeds is empty"):
        read_settings(str(path))
    with pytest.raises(InputError, match="did you mean 'seapath'"):
        read_settings("seapaht")


def test_a_source_replaces_that_of_the_named_feed(tmp_path: Path) -> None:
    feeds = {"a": FeedSettings(format="tss1", source="x"), "b": FeedSettings(format="tss1")}
    assert with_source(feeds, "udp://:1", "b")["b"].source == "udp://:1"
    assert with_source(feeds, "", "a")["a"].source == "x"
    with pytest.raises(InputError, match="name one: a, b"):
        with_source(feeds, "udp://:1")
    with pytest.raises(InputError, match="feed 'c'"):
        with_source(feeds, "udp://:1", "c")


def test_every_format_is_a_line_monitor_or_a_motion_sensor() -> None:
    assert {*LINES, *MOTIONS} == set(FORMATS) == set(SETTINGS)
