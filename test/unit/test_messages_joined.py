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


def test_ropes_are_in_one_family_of_topics() -> None:
    top, length = (decoded(f"ropes/{name}", lifted()) for name in ("tension_top", "length"))
    assert list(top.name) == list(length.name) == ["hoist", "port", "starboard"]
    assert list(length.position) == [100.0, 8.0, 8.0]
    assert list(length.velocity) == [0.5, 0.0, 0.0]
    assert list(top.effort)[1:] == [6e3, 6e3 + 1]
    assert list(decoded("ropes/tension_bottom", lifted()).effort)[1:] == [5e3, 5e3]
    for one in (top, length):
        assert (one.header.stamp.sec, one.header.stamp.nanosec) == (2, 500_000_000)


def test_a_strut_has_its_ends_length_and_tension() -> None:
    """And nothing where there are none."""
    shot = lifted()
    (row,) = messages.read_cloud(decoded("struts/state", shot)).tolist()
    name, *ends, length_m, tension_n = row
    assert (name, length_m, tension_n) == (b"bar", 2.0, -4e3)
    assert ends == shot.struts[0].ends_m.ravel().tolist()
    assert "struts/state" in due_topics(2, 20_000_000, shot)
    assert "struts/state" not in due_topics(2, 20_000_000, replace(shot, struts=()))


def test_state_of_payloads() -> None:
    shot = lifted()
    state = decoded("payloads/state", shot)
    assert list(state.joint_names) == ["port", "starboard"]
    for one, pose, twist in zip(shot.payloads, state.transforms, state.twist, strict=True):
        at, speed = pose.translation, twist.linear
        assert [at.x, at.y, at.z] == one.position_m.tolist()
        assert [speed.x, speed.y, speed.z] == one.velocity_m_per_s.tolist()


def test_nodes_and_elements_of_all_ropes() -> None:
    shot = lifted()
    nodes = messages.read_cloud(decoded("ropes/nodes", shot))
    assert nodes.dtype.names == ("x", "y", "z", "tension_n", "rope")
    assert nodes["rope"].tolist() == [0.0] * 5 + [1.0] * 3 + [2.0] * 4
    port = np.stack([nodes[axis][5:8] for axis in "xyz"], axis=1)
    assert port.tolist() == np.float32(shot.ropes[1].node_position_m).tolist()
    assert nodes["tension_n"][8:].tolist() == np.float32(shot.ropes[2].node_tension_n).tolist()
    elements = messages.read_cloud(decoded("ropes/element_tension", shot))
    assert elements["tension_n"][4:6].tolist() == shot.ropes[1].element_tension_n.tolist()
    assert elements["rope"].tolist() == [0.0] * 4 + [1.0] * 2 + [2.0] * 3


def test_one_rope_has_the_same_topics() -> None:
    shot = hanging_rope()
    assert list(decoded("ropes/tension_top", shot).effort) == [shot.tension_top_n]
    assert list(decoded("payloads/state", shot).joint_names) == ["payload"]
    one, many = (set(due_topics(2, 20_000_000, seen)) for seen in (shot, lifted()))
    assert many - one == {"struts/state"}


def test_markers_show_all_of_it() -> None:
    shot = lifted()
    drawn = {marker.ns: marker for marker in decoded("ropes/markers", shot).markers}
    assert len(drawn["rope"].points) == 2 * (4 + 2 + 3)
    for one in shot.payloads:
        at = drawn[f"payload {one.name}"].pose.position
        assert (at.x, at.y, at.z) == tuple(one.position_m)
    ends = [[point.x, point.y, point.z] for point in drawn["bars"].points]
    assert ends == shot.struts[0].ends_m.tolist()
