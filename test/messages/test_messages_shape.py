"""Touchdown and tightest bend as messages, as words, and in the view."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from sample_snapshot import hanging_rope
from view_session import EPOCH_NS, Session

from rope_twin import messages
from rope_twin.messages import Level, Status, statuses
from rope_twin.topics import due_topics
from rope_twin.twin.snapshot import Bend, RopeBend, Snapshot, Touchdown

CABLE = Touchdown("cable", (120.0, -3.0, -299.0), 362.2, 162.2, 12340.0, 0.5)
TIGHT = Bend("cable", 2.5, 361.0, 17.3, 3.0, 1.5)


def lying(**changed: float) -> Snapshot:
    bend = RopeBend(replace(TIGHT, radius_m=40.0), (119.0, -3.0, -298.9), replace(TIGHT, **changed))
    return replace(hanging_rope(21, time_s=1.0), touchdowns=(CABLE,), bends=(bend,))


def row(name: str, snapshot: Snapshot) -> Status:
    return next(one for one in statuses(snapshot, None) if one.name == f"simulation: {name}")


def figures(topic: str, snapshot: Snapshot) -> dict[str, float]:
    reported = messages.decode(topic, messages.Encoder(EPOCH_NS).encode(topic, snapshot))
    assert (
        reported.header.stamp.sec * 10**9 + reported.header.stamp.nanosec
        == EPOCH_NS + snapshot.stamp_ns
    )
    rows = messages.read_cloud(reported)
    return {
        f"{row['name'].decode()}/{name}": float(row[name])
        for row in rows
        for name in (rows.dtype.names or ())[1:]
    }


def test_figures_come_by_name() -> None:
    snapshot = lying()
    assert figures("seabed/touchdown", snapshot) == {
        "cable/x": 120.0, "cable/y": -3.0, "cable/z": -299.0, "cable/line_out_m": 362.2,
        "cable/layback_m": 162.2, "cable/tension_n": 12340.0, "cable/angle_deg": 0.5,
    }  # fmt: skip
    assert figures("ropes/bend_radius", snapshot) == {
        "cable/radius_m": 40.0, "cable/line_out_m": 361.0, "cable/x": 119.0, "cable/y": -3.0,
        "cable/z": -298.9, "cable/smallest_radius_m": 2.5, "cable/minimum_radius_m": 3.0,
    }  # fmt: skip


def test_topics_are_there_where_the_scene_has_them() -> None:
    """A touchdown wherever there is a bed: without names while no rope touches it."""
    above = replace(lying(), touchdowns=())
    assert figures("seabed/touchdown", above) == {}
    every = {"seabed/touchdown", "ropes/bend_radius"}
    assert every <= set(due_topics(2, 20_000_000, above))
    assert every.isdisjoint(due_topics(2, 20_000_000, replace(above, seabed=None, bends=())))


def test_words_tell_the_tightest_and_warn_below_the_minimum() -> None:
    touchdown = row("touchdown", lying()).message
    assert all(words in touchdown for words in ("362.2 m", "layback 162.2 m", "12.3 kN"))
    tight = row("bend", lying())
    assert tight.level == Level.WARN
    assert all(words in tight.message for words in ("2.5 m", "361.0 m", "17.3 s", "MBR of 3 m"))
    assert tight.values["cable: smallest bend radius now [m]"] == "40"
    wide = row("bend", lying(radius_m=3.1))
    assert wide.level == Level.OK
    assert wide.message.endswith("at 17.3 s; MBR 3 m")
    coarse = row("bend", lying(radius_m=3.1, element_m=4.0))
    assert "not resolved by elements of 4 m" in coarse.message
    straight = row("bend", lying(radius_m=math.inf))
    assert "straight" in straight.message


def test_of_several_ropes_the_worst_and_all_too_tight_are_named() -> None:
    snapshot = lying()
    (first,) = snapshot.bends
    named = [replace(TIGHT, name="aft", radius_m=radius) for radius in (9.0, 2.0)]
    for other, words in zip(named, (["cable"], ["aft", "cable"]), strict=True):
        both = replace(snapshot, bends=(first, replace(first, now=other, tightest=other)))
        parts = row("bend", both).message.split("; ")
        assert [part.split("'")[1] for part in parts] == words


def test_they_are_drawn(tmp_path: Path) -> None:
    session = Session(tmp_path / "view.rrd")
    session.epoch()
    session.rope(1.0)
    for topic in ("seabed/touchdown", "ropes/bend_radius"):
        session.show(topic, session.encoder.encode(topic, lying()), EPOCH_NS + 10**9)
    found = session.finish()
    assert found.column("plots/shape/layback/cable", "Scalars:scalars") == [[162.2]]
    assert found.column("plots/shape/tension/cable", "Scalars:scalars") == [[12.34]]
    assert found.column("plots/shape/bend/cable", "Scalars:scalars") == [[40.0]]
    ((spot,),) = found.column("overview/touchdown", "Points3D:positions")
    assert spot[2] == pytest.approx(-299.0)
