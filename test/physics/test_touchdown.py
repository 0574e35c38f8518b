"""Touchdown point against catenaries, taut legs and polygons in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rope_twin.core.bed import Plane, Soil
from rope_twin.scene.load import load_scene
from rope_twin.twin.contact import touchdown_at, touchdown_of
from rope_twin.twin.snapshot import Touchdown, Vector
from rope_twin.twin.snapshot_builder import RopeShape
from rope_twin.twin.twin import Twin

A = 70.0  # H/w of the catenaries [m]
HANGS = 200.0  # arc length from the upper end to the touchdown [m]
LEVEL = Plane(0.0, 0.0, 0.0, Soil(1e5, 0.0, 0.0, 0.0))


def catenary(arc: Vector, rise: float = 0.0) -> tuple[Vector, Vector]:
    """Nodes whose rope lies on a plane z = rise·x from HANGS on, and their heights above it."""
    flat = math.hypot(1.0, rise)
    s = HANGS - arc  # from the touchdown up; tan(phi) = rise + s/A there
    begin = A * math.asinh(rise)
    x = np.where(s > 0.0, A * np.arcsinh(rise + s / A) - begin, s / flat)
    z = np.where(s > 0.0, A * (np.hypot(1.0, rise + s / A) - flat), rise * s / flat)
    nodes = np.stack([x, np.zeros_like(x), z], axis=1)
    return nodes, np.where(s > 0.0, z - rise * x, 0.0)


def found_at(length: float, shift: float, rise: float = 0.0) -> float:
    """On elements of a length, the first of them so much shorter."""
    arc = np.concatenate([[0.0], np.arange(length - shift, HANGS + 5.0 * length, length)])
    nodes, height = catenary(arc, rise)
    at_m, angle = touchdown_at(nodes, arc, height)
    assert angle == 0.0
    return at_m


@pytest.mark.parametrize("rise", [0.0, 0.1, -0.2])
def test_touchdown_of_a_catenary_within_half_an_element(rise: float) -> None:
    """Nodes on the curve itself are no polygon in balance; the error converges."""
    worst = [
        max(
            abs(found_at(length, share * length, rise) - HANGS)
            for share in np.arange(0.0, 1.0, 0.1)
        )
        for length in (8.0, 4.0)
    ]
    assert worst[0] < 0.5 * 8.0
    assert worst[0] / worst[1] == pytest.approx(2.0, rel=0.1)


def discrete(hung_share: float, length: float, free: int = 6) -> tuple[Vector, Vector, Vector]:
    """A polygon under weights at its nodes; the first node on the bed has that share of its own.

    Runs are 1, the slope grows by 1/A for each whole weight.
    """
    slope = (np.arange(free) + hung_share) * length / A
    height = np.concatenate([np.cumsum(slope * length)[::-1], np.zeros(4)])
    nodes = np.zeros((free + 4, 3))
    nodes[:, 0], nodes[:, 2] = length * np.arange(free + 4), height
    return nodes, length * np.arange(free + 4), height


def test_touchdown_moves_evenly_while_a_node_is_laid() -> None:
    """Exactly the weight that hangs: half an element above that node, and its share."""
    for share in np.linspace(0.02, 1.0, 50):
        nodes, arc, height = discrete(float(share), 3.0)
        at_m, _ = touchdown_at(nodes, arc, height)
        assert at_m == pytest.approx(3.0 * (6.0 - 0.5 + share), abs=1e-9)


def test_touchdown_is_continuous_when_a_node_lands() -> None:
    """The first node of the bed is another one just before and after."""
    before, _ = touchdown_at(*discrete(1.0, 3.0, free=5))
    after, _ = touchdown_at(*discrete(1e-9, 3.0, free=6))
    assert before == pytest.approx(after, abs=1e-6)


@pytest.mark.parametrize("steep_deg", [10.0, 45.0, 90.0])
@pytest.mark.parametrize("rise", [0.0, 0.15])
def test_touchdown_of_a_straight_leg(steep_deg: float, rise: float) -> None:
    arc, steep = np.arange(0.0, 40.0, 4.0), math.radians(steep_deg)
    slope = math.tan(steep - math.atan(rise)) if steep_deg < 90.0 or rise else math.inf
    meets = 18.7
    run = math.cos(steep - math.atan(rise)) if math.isfinite(slope) else 0.0
    fall = math.sin(steep - math.atan(rise)) if math.isfinite(slope) else 1.0
    nodes = np.stack([run * arc, 0.0 * arc, (meets - arc) * fall], axis=1)
    bed = -rise * 0.0 + rise * (run * (arc - meets))  # rises along the rope's way
    at_m, angle = touchdown_at(nodes, arc, nodes[:, 2] - bed)
    assert at_m == pytest.approx(meets, abs=1e-9)
    assert math.degrees(angle) == pytest.approx(steep_deg, abs=1e-6)


def test_touchdown_is_continuous_between_straight_and_level() -> None:
    """The slope of the lowest element goes within the next one, or less and less of it."""
    arc, lowest = np.arange(0.0, 28.0, 4.0), 0.1
    positions, angles = [], []
    for above in lowest * np.linspace(3.0, 0.5, 251):
        height = np.array([above + lowest, lowest, 0.0, 0.0, 0.0, 0.0]) * 4.0 - 0.1
        nodes = np.stack([arc[:6], 0.0 * height, height], axis=1)
        at_m, angle = touchdown_at(nodes, arc[:6], height)
        positions.append(at_m)
        angles.append(angle)
    cut = 8.0 - 0.1 / lowest
    assert positions[0] == pytest.approx(6.0 + 4.0 * 0.5), "half of it goes within half an element"
    assert max(positions) == pytest.approx(6.0 + 4.0, abs=0.05)
    assert positions[-1] == pytest.approx(cut)
    assert np.abs(np.diff(positions)).max() < 0.05
    assert (angles[0], angles[-1]) == (0.0, pytest.approx(math.atan(lowest)))
    assert np.abs(np.diff(angles)).max() < 0.01 * 0.11


def hung(nodes: Vector, arc: Vector) -> RopeShape:
    scene = load_scene("chain_on_bottom")
    tension = np.linspace(2e4, 1e4, len(arc) - 1)
    return RopeShape("leg", scene.ropes[0], None, nodes, arc, tension)  # type: ignore[arg-type]


def test_touchdown_is_reported() -> None:
    arc = np.arange(0.0, 231.0, 3.0)
    nodes, _ = catenary(arc)
    reported = touchdown_of(hung(nodes, arc), LEVEL)
    assert reported is not None
    assert reported.line_out_m == pytest.approx(HANGS, abs=0.3)
    assert reported.layback_m == pytest.approx(A * math.asinh(HANGS / A), abs=0.3)
    assert reported.position_m[2] == pytest.approx(0.0, abs=0.03)
    assert reported.tension_n == pytest.approx(
        2e4 - 1e4 * (HANGS - 1.5) / (arc[-1] - 3.0), rel=2e-3
    )


def test_touchdown_of_a_rope_listed_from_its_anchor() -> None:
    """Line out counts from its upper end, which lies on the bed; the layback is the buoy's."""
    arc = np.arange(0.0, 231.0, 3.0)
    nodes, _ = catenary(arc)
    down = touchdown_of(hung(nodes, arc), LEVEL)
    turned = hung(nodes[::-1], arc)
    up = touchdown_of(turned._replace(element_tension_n=turned.element_tension_n[::-1]), LEVEL)
    assert isinstance(down, Touchdown)
    assert isinstance(up, Touchdown)
    assert up.line_out_m == pytest.approx(arc[-1] - down.line_out_m)
    assert (up.position_m, up.layback_m) == (down.position_m, down.layback_m)
    assert up.tension_n == pytest.approx(down.tension_n)


def test_no_touchdown_without_contact_or_with_both_ends_on_the_bed() -> None:
    arc = np.arange(0.0, 231.0, 3.0)
    nodes, _ = catenary(arc)
    assert touchdown_of(hung(nodes + np.array([0.0, 0.0, 1.0]), arc), LEVEL) is None
    arch = np.stack([arc, 0.0 * arc, arc * (arc[-1] - arc)], axis=1)
    assert touchdown_of(hung(arch, arc), LEVEL) is None


def test_no_touchdown_without_a_seabed() -> None:
    snapshot = Twin(load_scene("still_water")).snapshot()
    assert (snapshot.seabed, snapshot.touchdowns, snapshot.bends) == (None, (), ())


@pytest.mark.parametrize("name", ["hybrid_lift", "two_line_lift", "two_line_loop"])
def test_reported_arc_length_sums_to_the_line_out(name: str) -> None:
    """Also of ropes that have run over a sheave; elements are as long as they hang, but stretch."""
    twin = Twin(load_scene(name))
    twin.submit_speed(None, 0.5)
    twin.advance(300)
    snapshot = twin.snapshot()
    ropes = twin.inspect().ropes.shapes(twin.rope, snapshot)
    out = [rope.line_out_m for rope in snapshot.ropes] or [snapshot.line_out_m]
    for hanging, line_out in zip(ropes, out, strict=True):
        assert hanging.arc_m[-1] == pytest.approx(line_out, rel=1e-9)
        chords = np.sqrt((np.diff(hanging.position_m, axis=0) ** 2).sum(axis=1))
        assert chords == pytest.approx(np.diff(hanging.arc_m), rel=0.03)
