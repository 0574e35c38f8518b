"""Slings: closed forms by hand of one to four, skew load, factors, and a plan with slings."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from rope_twin.planning.cells import RowStore
from rope_twin.planning.plan_reader import read_plan
from rope_twin.planning.run import run_plan
from rope_twin.planning.slings import SlingFactors, Slings, hang, sling_shares
from rope_twin.planning.tables import further_tables, sling_loads

W, EA = 2.0e5, 1.0e8  # N
CORNERS = ((2.0, 1.5, 1.0), (2.0, -1.5, 1.0), (-2.0, 1.5, 1.0), (-2.0, -1.5, 1.0))


def four(**keys: object) -> Slings:
    """Return four equal slings of 6 m."""
    usual: dict = {"attachments_m": CORNERS, "lengths_m": (6.0,), "axial_stiffness_n": EA,
                   "mbl_n": 1e6}  # fmt: skip
    return Slings(**(usual | keys))


def test_one_sling_carries_all() -> None:
    """It hangs in line with the centre of gravity, tilted by atan(x/z)."""
    hook, tension = hang(np.array([[0.3, 0.0, 1.0]]), np.array([4.0]), EA, W)
    assert tension[0] == pytest.approx(W, rel=1e-9)
    assert hook[0] / hook[2] == pytest.approx(0.3, rel=1e-9)


@pytest.mark.parametrize("apex_deg", [20.0, 60.0, 90.0, 120.0])
def test_two_slings_by_their_apex_angle(apex_deg: float) -> None:
    """T = W/(2·cos(apex/2)), with the angle of the stretched slings."""
    half = math.radians(0.5 * apex_deg)
    points = np.array([[3.0, 0.0, 1.0], [-3.0, 0.0, 1.0]])
    stretched = 3.0 / math.sin(half)
    tension = W / (2.0 * math.cos(half))
    length = stretched / (1.0 + tension / EA)  # T = EA·e/L
    hook, found = hang(points, np.full(2, length), EA, W)
    # e = k·T with k = L/EA
    assert found == pytest.approx([tension] * 2, rel=1e-8)
    assert hook[2] == pytest.approx(1.0 + 3.0 / math.tan(half), rel=1e-9)


def test_two_slings_with_the_weight_off_the_middle() -> None:
    """Level by their lengths: T1·sin a1 = T2·sin a2, and the vertical parts carry W."""
    a, b, high = 1.0, 3.0, 5.0
    lengths = np.array([math.hypot(a, high), math.hypot(b, high)])
    _, found = hang(np.array([[a, 0.0, 1.0], [-b, 0.0, 1.0]]), lengths, 1e12, W)
    sin, cos = np.array([a, b]) / lengths, high / lengths
    right = np.linalg.solve(np.array([[sin[0], -sin[1]], cos]), [0.0, W])
    assert found == pytest.approx(right, rel=1e-6)
    assert found @ cos == pytest.approx(W, rel=1e-6)


def test_four_equal_slings_and_three() -> None:
    """W/(n·cos a) each."""
    for points in (np.array(CORNERS), _around(3, 2.5)):
        reach = math.hypot(*points[0, :2])
        cos = math.sqrt(36.0 - reach**2) / 6.0
        _, found = hang(points, np.full(len(points), 6.0), 1e12, W)
        assert found == pytest.approx([W / (len(points) * cos)] * len(points), rel=1e-6)


def _around(count: int, radius: float) -> np.ndarray:
    angle = 2.0 * math.pi * np.arange(count) / count
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.ones(count)])


@given(
    some.floats(-0.5, 0.5), some.floats(-0.5, 0.5),
    some.lists(some.floats(5.9, 6.1), min_size=4, max_size=4),
)  # fmt: skip
def test_resultant_is_the_weight_through_the_centre_of_gravity(
    x: float, y: float, lengths: list[float]
) -> None:
    """Whatever the lengths and the centre of gravity: forces and moments are in balance."""
    points = np.array(CORNERS) - [x, y, 0.0]
    hook, tension = hang(points, np.array(lengths), EA, W)
    arms = hook - points
    forces = tension[:, None] * arms / np.linalg.norm(arms, axis=1)[:, None]
    assert forces.sum(axis=0) == pytest.approx(W * hook / np.linalg.norm(hook), abs=1e-4 * W)
    assert np.cross(points, forces).sum(axis=0) == pytest.approx([0.0] * 3, abs=1e-3 * W)


def test_skew_of_a_diagonal_that_is_too_long() -> None:
    """Slings 2·d longer on one diagonal of a square carry k·d less, the others k·d more.

    By hand: the object stays level by symmetry, so the stretch differs from its mean by ∓d.
    """
    points, length, d = _around(4, 2.0), 6.0, 2e-3
    lengths = np.array([length + d, length - d, length + d, length - d])
    _, found = hang(points, lengths, EA, W)
    mean = W / (4.0 * math.sqrt(36.0 - 4.0) / 6.0)
    skew = EA / length * d
    assert found == pytest.approx([mean - skew, mean + skew] * 2, rel=2e-3)
    loose = four(attachments_m=tuple(map(tuple, points)), length_tolerance_m=d)
    assert sling_shares(loose, W).largest.max() * W == pytest.approx(mean + skew, rel=2e-3)


def test_skew_load_factor_multiplies_each() -> None:
    """1.25 on each diagonal pair in turn (0027/ND 5.6.12), and the tilt factor."""
    plain = sling_shares(four(skew_load_factor=1.0), W)
    found = sling_shares(four(skew_load_factor=1.25, tilt_factor=1.03), W)
    assert found.largest == pytest.approx(1.25 * 1.03 * plain.nominal)
    assert found.tilt_deg == pytest.approx(0.0, abs=1e-6)


def test_shifted_centre_of_gravity_tilts() -> None:
    """A short pendulum: the hook stays above the weight, tan(tilt) = shift over height at first
    order, and the sling that is nearer carries more.
    """
    shifted = sling_shares(
        four(skew_load_factor=1.0, centre_of_gravity_within_m=(0.1, 0.0), axial_stiffness_n=1e11), W
    )
    height = 1.0 + math.sqrt(36.0 - 6.25)
    assert math.tan(math.radians(shifted.max_tilt_deg)) == pytest.approx(0.1 / height, rel=0.02)
    assert shifted.largest.max() > shifted.nominal.max()


def test_nominal_safety_factor() -> None:
    """Both products of 0027/ND 7.3.1 by hand."""
    assert SlingFactors().nominal == pytest.approx(1.3 * 1.3 * 1.5)
    low = SlingFactors(load=1.3, consequence=1.0, material=1.35, reduction=1.25, wear=1.1)
    assert low.nominal == pytest.approx(2.3 * 1.25 * 1.1)
    assert four(wll_n=1e5).strength_n == 1e5
    assert four().strength_n == pytest.approx(1e6 / 2.535)


PLAN = """scene: deep_lift
vessel: {responses: vessel_120m, crane_tip_m: [10.0, 18.0, 12.0]}
sea:
  hs_m: {from: 1.0, to: 4.0, step: 0.5}
  tp_s: [9.0]
  headings_deg: [135.0]
phases:
  - at_depth: {depth_m: 1000.0, exposure_s: 60.0}
slings:
  attachments_m: [[1.8, 1.3, 1.2], [1.8, -1.3, 1.2], [-1.8, 1.3, 1.2], [-1.8, -1.3, 1.2]]
  lengths_m: [5.0]
  diameter_m: 0.032
  skew_load_factor: 1.25
  mbl_n: 4.3e+5
method: {seeds: {start: 8, most: 8}, settle_s: 20.0, elements: 12, step_s: 0.1}
"""


def test_slings_limit_a_plan(tmp_path: Path) -> None:
    """The use is that of the slings: load at the lower end, times the share, over MBL/γ."""
    path = tmp_path / "lift.yaml"
    path.write_text(PLAN)
    own, scene = read_plan(path)
    result = run_plan(own, scene, RowStore(), threads=1)
    (cell,) = result.cells
    assert cell.governing == "slings"
    assert cell.judged is not None
    assert cell.height_m is not None
    load, use = cell.judged.values["lower_end_load"].value, cell.judged.uses["slings"].value
    assert load > result.works[0].weight_n
    cos = math.sqrt(25.0 - 1.8**2 - 1.3**2) / 5.0
    by_hand = load * 1.25 / (4.0 * cos) / (4.3e5 / 2.535)
    assert use == pytest.approx(by_hand, rel=1e-3)
    loads = list(sling_loads(result))
    assert len(loads) == 4
    assert max(one["utilisation"] for one in loads) == pytest.approx(use)
    tables = {table.title: table.rows for table in further_tables(result)}
    assert list(tables) == ["Utilisation", "Further characteristic values", "Snap check", "Slings"]
    uses = {row[4]: row for row in tables["Utilisation"][1:]}
    assert uses["slings"][-1] == f"{100.0 * use:.0f}"
    assert uses["slings"][5].startswith(f"{1e-3 * load:.3g} ± ")
    snap = max(one.snap_n for one in cell.simplified)
    whole = 1e-3 * (result.works[0].static_hook_n + snap)
    assert tables["Snap check"][1][6:8] == [f"{1e-3 * snap:.0f}", f"{whole:.0f}"]
