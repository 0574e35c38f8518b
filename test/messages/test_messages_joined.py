"""Topics of multi-line systems, and what RViz and Foxglove draw of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from sample_snapshot import hanging_rope, lifted

from rope_twin import messages
from rope_twin.topics import due_topics
from rope_twin.twin.snapshot import Snapshot


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
    snapshot = lifted()
    (row,) = messages.read_cloud(decoded("struts/state", snapshot)).tolist()
    name, *ends, length_m, tension_n = row
    assert (name, length_m, tension_n) == (b"bar", 2.0, -4e3)
    assert ends == snapshot.struts[0].ends_m.ravel().tolist()
    assert "struts/state" in due_topics(2, 20_000_000, snapshot)
    assert "struts/state" not in due_topics(2, 20_000_000, replace(snapshot, struts=()))


def test_state_of_payloads() -> None:
    snapshot = lifted()
    state = decoded("payloads/state", snapshot)
    assert list(state.joint_names) == ["port", "starboard"]
    for one, pose, twist in zip(snapshot.payloads, state.transforms, state.twist, strict=True):
        at, speed = pose.translation, twist.linear
        assert [at.x, at.y, at.z] == one.position_m.tolist()
        assert [speed.x, speed.y, speed.z] == one.velocity_m_per_s.tolist()


def test_nodes_and_elements_of_all_ropes() -> None:
    snapshot = lifted()
    nodes = messages.read_cloud(decoded("ropes/nodes", snapshot))
    assert nodes.dtype.names == ("x", "y", "z", "tension_n", "rope")
    assert nodes["rope"].tolist() == [0.0] * 5 + [1.0] * 3 + [2.0] * 4
    port = np.stack([nodes[axis][5:8] for axis in "xyz"], axis=1)
    assert port.tolist() == np.float32(snapshot.ropes[1].node_position_m).tolist()
    assert nodes["tension_n"][8:].tolist() == np.float32(snapshot.ropes[2].node_tension_n).tolist()
    elements = messages.read_cloud(decoded("ropes/element_tension", snapshot))
    assert elements["tension_n"][4:6].tolist() == snapshot.ropes[1].element_tension_n.tolist()
    assert elements["rope"].tolist() == [0.0] * 4 + [1.0] * 2 + [2.0] * 3


def test_one_rope_has_the_same_topics() -> None:
    snapshot = hanging_rope()
    assert list(decoded("ropes/tension_top", snapshot).effort) == [snapshot.tension_top_n]
    assert list(decoded("payloads/state", snapshot).joint_names) == ["payload"]
    one, many = (set(due_topics(2, 20_000_000, seen)) for seen in (snapshot, lifted()))
    assert many - one == {"struts/state"}


def test_markers_show_all_of_it() -> None:
    snapshot = lifted()
    drawn = {marker.ns: marker for marker in decoded("ropes/markers", snapshot).markers}
    assert len(drawn["rope"].points) == 2 * (4 + 2 + 3)
    for one in snapshot.payloads:
        at = drawn[f"payload {one.name}"].pose.position
        assert (at.x, at.y, at.z) == tuple(one.position_m)
    ends = [[point.x, point.y, point.z] for point in drawn["bars"].points]
    assert ends == snapshot.struts[0].ends_m.tolist()
