"""The topics of ropes that meet, and what RViz and Foxglove are told of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from sample_snapshot import hanging_rope

from rope_twin import messages
from rope_twin.cadence import due_topics
from rope_twin.twin.snapshot import PayloadShot, RopeShot, Snapshot, StrutShot


def lifted() -> Snapshot:
    """A hoist and two slings, a bar, two payloads."""
    first = hanging_rope(5, length_m=100.0)
    ropes = [
        RopeShot(
            name="hoist",
            node_position_m=first.node_position_m,
            node_tension_n=first.node_tension_n,
            element_tension_n=first.element_tension_n,
            tension_top_n=first.tension_top_n,
            line_out_m=100.0,
            payout_speed_m_per_s=0.5,
        )
    ]
    for k, name in enumerate(("port", "starboard")):
        end = first.node_position_m[-1]
        nodes = end + np.linspace(0.0, 1.0, 3 + k)[:, None] * [2.0 * k - 1.0, 0.0, -8.0]
        ropes.append(
            RopeShot(
                name=name,
                node_position_m=nodes,
                node_tension_n=np.linspace(6e3, 5e3, 3 + k),
                element_tension_n=np.linspace(6e3, 5e3, 2 + k),
                tension_top_n=6e3 + k,
                line_out_m=8.0,
                payout_speed_m_per_s=0.0,
            )
        )
    payloads = [
        PayloadShot(
            name=rope.name,
            position_m=rope.node_position_m[-1],
            velocity_m_per_s=np.array([0.1, 0.0, -0.2]) * (k + 1),
        )
        for k, rope in enumerate(ropes[1:])
    ]
    ends = np.stack([one.position_m for one in payloads])
    return replace(
        first,
        ropes=tuple(ropes),
        payloads=tuple(payloads),
        struts=(StrutShot(name="bar", ends_m=ends, pull_n=-4e3),),
    )


def decoded(topic: str, snapshot: Snapshot) -> Any:
    return messages.decode(topic, messages.Encoder(0).encode(topic, snapshot))


def test_state_of_ropes_and_bars() -> None:
    state = decoded("ropes/state", lifted())
    assert list(state.name) == ["hoist", "port", "starboard", "bar"]
    assert list(state.position) == [100.0, 8.0, 8.0, 2.0]
    assert list(state.velocity) == [0.5, 0.0, 0.0, 0.0]
    assert list(state.effort)[1:] == [6e3, 6e3 + 1, -4e3]
    assert (state.header.stamp.sec, state.header.stamp.nanosec) == (2, 500_000_000)


def test_ends_of_bars() -> None:
    """Where each bar begins and ends, and nothing where there are none."""
    shot = lifted()
    state = decoded("bars/state", shot)
    assert list(state.name)[:4] == ["bar/from_x", "bar/from_y", "bar/from_z", "bar/to_x"]
    assert list(state.position) == shot.struts[0].ends_m.ravel().tolist()
    assert "bars/state" in due_topics(2, 20_000_000, shot)
    assert "bars/state" not in due_topics(2, 20_000_000, replace(shot, struts=()))


def test_state_of_payloads() -> None:
    shot = lifted()
    state = decoded("payloads/state", shot)
    assert list(state.name)[2:4] == ["port/z", "starboard/x"]
    assert (
        list(state.position) == np.concatenate([one.position_m for one in shot.payloads]).tolist()
    )
    assert list(state.velocity) == [0.1, 0.0, -0.2, 0.2, 0.0, -0.4]


def test_nodes_of_all_ropes() -> None:
    shot = lifted()
    cloud = decoded("ropes/nodes", shot)
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "tension", "rope"]
    points = np.frombuffer(bytes(cloud.data), dtype="<f4").reshape(-1, 5)
    assert points[:, 4].tolist() == [0.0] * 5 + [1.0] * 3 + [2.0] * 4
    assert points[5:8, :3].tolist() == np.float32(shot.ropes[1].node_position_m).tolist()
    assert points[8:, 3].tolist() == np.float32(shot.ropes[2].node_tension_n).tolist()


def test_one_rope_has_none_of_these_topics() -> None:
    """They are empty, and a runner does not publish them."""
    shot = hanging_rope()
    assert list(decoded("ropes/state", shot).name) == []
    assert list(decoded("payloads/state", shot).name) == []
    assert decoded("ropes/nodes", shot).width == 0
    names = due_topics(2, 20_000_000, shot)
    assert "rope/nodes" in names
    assert not {"ropes/state", "ropes/nodes", "payloads/state"}.intersection(names)
    names = due_topics(2, 20_000_000, lifted())
    assert {"ropes/state", "ropes/nodes", "payloads/state"}.issubset(names)


def test_markers_show_all_of_it() -> None:
    shot = lifted()
    drawn = {marker.ns: marker for marker in decoded("rope/markers", shot).markers}
    assert len(drawn["rope"].points) == 2 * (4 + 2 + 3)
    for one in shot.payloads:
        at = drawn[f"payload {one.name}"].pose.position
        assert (at.x, at.y, at.z) == tuple(one.position_m)
    ends = [[point.x, point.y, point.z] for point in drawn["bars"].points]
    assert ends == shot.struts[0].ends_m.tolist()
