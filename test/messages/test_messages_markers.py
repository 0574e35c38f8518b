"""Markers that RViz and Foxglove draw."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sample_snapshot import hanging_rope

from rope_twin import messages
from rope_twin.messages.templates import SLACK_RGB, scale_above, shade, tension_colours


def markers(snapshot: Any, encoder: messages.Encoder | None = None) -> dict[str, Any]:
    encoder = encoder or messages.Encoder(0)
    decoded = messages.decode("ropes/markers", encoder.encode("ropes/markers", snapshot))
    return {marker.ns: marker for marker in decoded.markers}


@pytest.mark.parametrize("nodes", [2, 3, 8, 101])
def test_rope_is_one_coloured_segment_an_element(nodes: int) -> None:
    snapshot = hanging_rope(nodes)
    rope = markers(snapshot)["rope"]
    points = np.array([[p.x, p.y, p.z] for p in rope.points])
    assert (points[0::2] == snapshot.node_position_m[:-1]).all()
    assert (points[1::2] == snapshot.node_position_m[1:]).all()
    colours = np.array([[c.r, c.g, c.b, c.a] for c in rope.colors], dtype=np.float32)
    peak = snapshot.element_tension_n.max()
    expected = tension_colours(snapshot.element_tension_n, scale_above(peak))
    assert (colours[0::2] == expected).all()
    assert (colours[1::2] == expected).all()
    assert (rope.type, rope.scale.x) == (rope.LINE_LIST, 3.0)


def test_symbols_are_where_the_things_are() -> None:
    snapshot = hanging_rope()
    drawn = markers(snapshot)
    payload, hang_off = drawn["payload"], drawn["hang_off"]
    assert (payload.type, hang_off.type) == (payload.CUBE, payload.SPHERE)
    for marker, place in (
        (payload, snapshot.payload_position_m),
        (hang_off, snapshot.hang_off_position_m),
    ):
        at = marker.pose.position
        assert (at.x, at.y, at.z) == tuple(place)
        assert marker.scale.x == marker.scale.y == marker.scale.z > 0.0
        assert marker.color.a == 1.0


def test_every_marker_stands_by_itself() -> None:
    drawn = markers(hanging_rope(time_s=2.5))
    assert len(drawn) == 4  # namespaces are unique
    for marker in drawn.values():
        assert marker.header.frame_id == "map"
        assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (2, 500_000_000)
        assert marker.pose.orientation.w == 1.0
        assert marker.lifetime.sec == 1
        assert marker.action == marker.ADD


def test_slack_has_a_colour_of_its_own() -> None:
    snapshot = hanging_rope(6)
    tension = snapshot.element_tension_n.copy()
    tension[2] = 0.0
    rope = markers(replace(snapshot, element_tension_n=tension))["rope"]
    colours = np.array([[c.r, c.g, c.b] for c in rope.colors])
    red = (colours == np.array(SLACK_RGB, dtype=np.float32)).all(axis=1)
    assert list(red) == [False] * 4 + [True] * 2 + [False] * 4
    on_the_map = shade(np.linspace(0.0, 1.0, 500))
    assert np.abs(on_the_map - np.array(SLACK_RGB)).max(axis=1).min() > 0.3


def test_scale_grows_with_the_tension_and_never_shrinks() -> None:
    encoder = messages.Encoder(0)
    snapshot = hanging_rope(6)
    texts = [
        markers(replace(snapshot, element_tension_n=np.full(5, peak)), encoder)[
            "tension_scale"
        ].text
        for peak in (100e3, 480e3, 100e3)
    ]
    assert "yellow 150 kN" in texts[0]
    assert "yellow 600 kN" in texts[1]
    assert texts[2] == texts[1]


@given(st.floats(0.0, 1e12))
def test_scale_is_a_round_number_above_the_peak(peak: float) -> None:
    scale = scale_above(peak)
    assert 1.1 * peak <= scale
    assert scale <= max(10.0, 1.1 * peak) * 1.5000001
    assert float(f"{scale:.1e}") == pytest.approx(scale, rel=1e-12)


def test_lightness_rises_evenly() -> None:
    # CIE 1931 relative luminance of sRGB (IEC 61966-2-1), then CIE 1976 lightness
    rgb = shade(np.linspace(0.0, 1.0, 101)).astype(float)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lightness = 116.0 * np.cbrt(linear @ [0.2126, 0.7152, 0.0722]) - 16.0
    steps = np.diff(lightness)
    assert steps.min() > 0.5
    assert steps.max() < 1.1
