"""Bends of a rope's material over sheaves and drum: exact counts, Miner's sum, restart, keys."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import log10, pi
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.core import state as rows
from rope_twin.errors import InputError, StateError
from rope_twin.messages import diagnostics
from rope_twin.run.summary import fatigue_figures, watch_words
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_data import BendingLife, FatigueData, TensionLife, endurance, own_curve
from rope_twin.scene.schema import Scene, Winch
from rope_twin.scene.winch import BendingSheave, Drum, HeaveCompensation, InboardSheave, TopSheave
from rope_twin.studies.driven_twin import march, still
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.twin import Twin
from rope_twin.vortex.fatigue import (
    CURVES,
    BendCount,
    BendPlace,
    Cycles,
    Endurance,
    wire_curve_warning,
)
from rope_twin.vortex.results import DamageSettings, MonitorSettings, RopeDamage
from validation.rigs import Rig, sine

ROPE = Endurance(0.05, 1e6, log10_a=1.5, exponent=4.0, d_ratio=20.0, d_ratio_exponent=2.0,
                 discard_bends=50.0, source="a test")  # fmt: skip
ARC_M = 0.25 * pi  # of a sheave of 1 m, wrapped by 90°
SHEAVE = TopSheave(diameter_m=1.0).places(0.0)
DRUM = BendPlace(10.0, 1.0, 1.0)
METRES = 100
ROOT = Path(__file__).parents[2]


def counted(path: tuple[BendPlace, ...], tops_m: Any, tension_n: float = 1e5) -> BendCount:
    count = BendCount(path, (ROPE,), np.zeros(METRES, np.int64), 1.0, 90.0)
    for top_m in tops_m:
        count.take(float(top_m), tension_n)
    return count


def test_a_sheave_bends_twice_on_the_way_in_and_out() -> None:
    """From 50 m of line out to 40 and back: what ran wholly over the sheave has two bends.

    The arc of contact is 0.785 m long: the sheave holds 50 to 50.785 m, then 40 to 40.785 m.
    Material that was on it at either end comes back the way that it went: one bend.
    """
    assert SHEAVE[1].inboard_m == pytest.approx(ARC_M)
    tops = [*np.linspace(50.0, 40.0, 21), *np.linspace(40.0, 50.0, 33)]
    bends = counted(SHEAVE, tops).bends
    at = (np.arange(10 * METRES) + 0.5) / 10.0
    expected = np.where((at > 40.0) & (at < 50.0), 1.0, 0.0)  # out and in again at the hang-off
    expected += np.where((at > 40.0 + ARC_M) & (at < 50.0 + ARC_M), 1.0, 0.0)
    assert np.array_equal(bends, expected)
    assert [bends[k] for k in (405, 455, 502)] == [1.0, 2.0, 1.0]


def test_the_drum_bends_once_on_the_way_in_and_out() -> None:
    """The drum 10 m inboard: onto it and off again is one bend, of rope 10 m further up."""
    bends = counted((DRUM,), [50.0, 45.5, 40.0, 47.5, 50.0]).result().bends
    assert np.array_equal(bends, [0.0] * 50 + [1.0] * 10 + [0.0] * 40)


def test_heave_compensation_bends_the_same_lengths_with_every_wave() -> None:
    """Line of 50 m + a·sin: within 2·a two bends a period where both ends of the arc pass.

    One bend a period where one end of the arc passes, none on the arc between.
    """
    periods, a = 25, 1.5
    tops = 50.0 + a * np.sin(np.linspace(0.0, 2.0 * pi * periods, 40 * periods + 1))
    bends = counted(SHEAVE, tops).bends
    at = (np.arange(10 * METRES) + 0.5) / 10.0
    ends = [(np.abs(at - 50.0 - place.inboard_m) < a).astype(float) for place in SHEAVE]
    assert np.array_equal(bends, periods * sum(ends))
    assert counted(SHEAVE, tops).result().bends.max() == 2.0 * periods
    small = counted(SHEAVE, 50.05 + 0.2 * np.sin(np.linspace(0.0, 2.0 * pi, 41)))
    # 40 cm to and fro: one bend at each end of the arc, although no middle of a metre passes
    assert np.array_equal(small.result().bends[48:53], [0.0, 1.0, 1.0, 0.0, 0.0])
    assert small.bends[503] == 0.0


@given(st.lists(st.integers(150, 850), min_size=2, max_size=30), st.floats(1.0, 3.0))
def test_no_travel_is_lost(tenths: list[int], weight: float) -> None:
    """Metres times bends are the travel times the cycles of all sheaves, for any motion."""
    tops = 0.1 * np.array(tenths) + 0.031  # between points: they pass as the line does
    sheave = tuple(place._replace(weight=weight) for place in SHEAVE)
    count = counted((*sheave, DRUM), tops)
    travel = np.abs(np.diff(tops)).sum()
    assert count.bends.sum() * 0.1 == pytest.approx(travel * (weight + 0.5), rel=1e-9)


def test_the_sum_does_not_depend_on_the_sampling() -> None:
    tops = [50.0, 20.0, 66.6, 50.0]
    fine = np.concatenate([np.linspace(a, b, 57) for a, b in pairwise(tops)])
    coarse, finely = counted((*SHEAVE, DRUM), tops), counted((*SHEAVE, DRUM), fine)
    assert np.array_equal(coarse.bends, finely.bends)
    assert coarse.damage == pytest.approx(finely.damage, rel=1e-12)


def test_miner_by_hand() -> None:
    """N = 10^1.5·(T/MBL)^-4·((D/d)/20)^2: 10 % of MBL on D/d = 20: 316 000; on 40 four times."""
    assert 1.0 / ROPE.used(1e5, 1.0) == pytest.approx(10.0**5.5)
    assert 1.0 / ROPE.used(1e5, 2.0) == pytest.approx(4.0 * 10.0**5.5)
    assert 1.0 / ROPE.used(2e5, 1.0) == pytest.approx(10.0**5.5 / 16.0)
    assert ROPE.used(0.0, 1.0) == ROPE.used(-1.0, 1.0) == 0.0
    count = counted(SHEAVE, [50.0, 40.0])
    count.take(50.0, 2e5)
    found = count.result()
    assert found.damage[45] == pytest.approx((1.0 + 16.0) / 10.0**5.5)
    assert found.discard[45] == pytest.approx(2.0 / 50.0)
    assert found.source == "a test"


def test_a_drum_has_the_diameter_of_its_layer() -> None:
    """Layer 1 holds 2π·10·(0.5 + 0.45·0.05) = 32.8 m; layer 2 is wider by 2·0.9·d."""
    path = Winch(
        speed_limit_m_per_s=1.0, acceleration_limit_m_per_s2=1.0, min_line_out_m=10.0,
        max_line_out_m=90.0, drum=Drum(core_radius_m=0.5, turns_per_layer=10.0),
    ).bend_path()  # fmt: skip
    low = counted(path, [80.0, 70.0])  # 10 to 20 m stored
    high = counted(path, [50.0, 45.0])  # 40 to 45 m
    assert low.damage[750] == pytest.approx(0.5 * ROPE.used(1e5, 1.0 + 0.9 * 0.05 - 0.05))
    assert high.damage[475] == pytest.approx(0.5 * ROPE.used(1e5, 1.0 + 2.7 * 0.05 - 0.05))


HMPE = Rig(length=60.0, elements=8, mass=1.0, EA=2e7, diameter=0.032, damping=5e4, load=2e4)
DATA = FatigueData(
    source="test report 7",
    bending=BendingLife(log10_a=1.0, exponent=5.0, d_ratio=20.0, d_ratio_exponent=2.0),
    tension=TensionLife(log10_k=log10(0.259), exponent=13.46),
    discard_bends=4.0,
)


@pytest.fixture(scope="module")
def scene() -> Scene:
    winch = Winch(
        speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=2.0, min_line_out_m=10.0,
        max_line_out_m=80.0, sheave=TopSheave(diameter_m=0.8),
        inboard_sheaves=(InboardSheave(diameter_m=0.64, inboard_m=5.0, bends=2.0),),
        drum=Drum(core_radius_m=0.4, turns_per_layer=20.0, inboard_m=30.0),
    )  # fmt: skip
    bare = replace(HMPE, winch=winch).scene()
    (line,) = bare.ropes
    return replace(bare, ropes=(replace(line, fatigue=DATA),))


SPEEDS = [(0.5, -2.0), (6.0, 0.0), (8.0, 2.0)]
REST = [(15.0, 0.0)]


def watched(scene: Scene, curve: str = "own") -> Any:
    return Twin(scene, Monitors(vortex=MonitorSettings(fatigue=curve)))


def test_a_lift_is_counted_and_goes_on_from_a_state_to_the_bit(scene: Scene) -> None:
    """11 m in, 14 m out: a passage over both sheaves is 3 bends, over the drum half a bend."""
    twin = watched(scene)
    winch, (line,) = scene.winch, scene.ropes
    assert winch is not None
    other = BendCount(
        winch.bend_path(), endurance(line), np.zeros(110, np.int64), 1.0, winch.max_line_out_m
    )
    snapshots = list(march(twin, still, 9.0, 2, SPEEDS))
    state = twin.capture()
    snapshots += list(march(twin, still, 9.0, 2, REST))
    for snapshot in snapshots:
        other.take(snapshot.line_out_m, snapshot.tension_top_n)
    wear, bent = snapshot.fatigue, snapshot.fatigue.bent
    # metre 51: in and out over the top sheave; 56: over the other one too, twice its two bends;
    # 85: off the drum, which is 30 m inboard, and onto it for part of the way
    assert [bent.bends[k] for k in (20, 51, 56)] == [0.0, 2.0, 6.0]
    assert [bent.bends[k] for k in (85, 91, 105)] == [1.0, 0.5, 0.0]
    assert len(wear.used) == 80 + 30
    assert np.array_equal(bent.bends, other.result().bends)
    assert bent.damage == pytest.approx(other.result().damage, rel=1e-9)
    assert (bent.damage > 0.0).sum() == (bent.bends > 0.0).sum() > 30
    assert bent.discard == pytest.approx(bent.bends / 4.0)
    again = Twin.restore(state, scene, Monitors(vortex=MonitorSettings(fatigue="own")))
    (*_, resumed) = march(again, still, 9.0, 2, REST)
    assert np.array_equal(resumed.fatigue.bent.bends, bent.bends)
    assert np.array_equal(resumed.fatigue.bent.damage, bent.damage)
    plain = Twin(scene)
    plain.advance(100)
    judged = watched(scene)
    judged.advance(100)
    assert np.array_equal(plain.snapshot().element_tension_n, judged.snapshot().element_tension_n)
    (words,) = [words for words in watch_words(None, fatigue_figures(snapshot)) if "bends" in words]
    assert "bends over sheaves and drum" in words
    assert "(data: test report 7)" in words
    row = diagnostics._fatigue(("", wear))
    assert row.values["source of its bending data"] == "test report 7"
    assert row.level.name == "WARN"  # over the 4 bends
    other_winch = replace(winch, sheave=replace(winch.sheave, bends=2.0))  # type: ignore[type-var]
    with pytest.raises(StateError, match=r"winch\.sheave\.bends is 1\.0 there"):
        Twin.restore(
            state,
            replace(scene, winch=other_winch),
            Monitors(vortex=MonitorSettings(fatigue="own")),
        )


def test_a_compensated_lift_bends_the_rope_at_the_sheave_twice_a_wave(scene: Scene) -> None:
    """Heave of ±0.5 m, compensated to 100 %: 1 m to and fro over an arc of 6 cm, once settled."""
    winch = scene.winch
    assert winch is not None
    unit = HeaveCompensation(
        efficiency=1.0, lag_s=0.0, stroke_m=2.0, speed_limit_m_per_s=2.0,
        acceleration_limit_m_per_s2=5.0,
    )  # fmt: skip
    sheave = TopSheave(diameter_m=0.64, wrap_deg=10.0)
    winch = replace(winch, sheave=sheave, inboard_sheaves=(), drum=None, heave_compensation=unit)
    twin = watched(replace(scene, winch=winch))
    (*_, before) = march(twin, sine(0.5, 4.0), 8.0, 2)
    (*_, after) = march(twin, sine(0.5, 4.0), 20.0, 2)
    more = after.fatigue.bent.bends - before.fatigue.bent.bends
    assert more[59] == more[60] == 2.0 * 5
    assert more[58] == more[62] == 0.0


def half(first_n: float, per_metre: float, length_m: float, elements: int) -> Any:
    """Return a rope as the count sees it, its tension linear from the lower end up."""
    s = np.linspace(0.0, length_m, elements + 1)
    work = np.zeros((rows.TENSION + 1, elements))
    work[rows.TENSION] = first_n + per_metre * 0.5 * (s[1:] + s[:-1])
    counts = np.zeros(rows.ELEMENTS + 1, int)
    counts[rows.ELEMENTS] = elements
    return SimpleNamespace(state=SimpleNamespace(s=s, counts=counts), work=work)


def test_material_keeps_its_place_over_a_sheave_between_two_ropes() -> None:
    """Tension 10 kN + 50 N/m up to the sheave and down again, before and after 3 m have run.

    Each metre has the tension of where it is, on whichever side.
    """
    line = HMPE.scene().ropes[0]
    groove = BendingSheave(diameter_m=0.8, wrap_deg=180.0)
    assert groove.arc_m == pytest.approx(0.4 * pi)
    path = groove.places(-0.5 * groove.arc_m)
    settings = DamageSettings("six_strand_tension", False, path=path, endurance=endurance(line))
    count = RopeDamage(line, [np.inf], 60.0, settings, 0.0)
    for first_m in (20.0, 23.0):
        other_m = 60.0 - first_m
        pulls = 1e4 + 50.0 * first_m, 1e4 + 50.0 * other_m
        ropes = half(1e4, 50.0, first_m, 7), half(1e4, 50.0, other_m, 9)
        count.take_over_sheave(*ropes, pulls)
        place = np.where(count.middles < first_m, count.middles, 60.0 - count.middles)
        loads = count._count._last * line.breaking_load_n
        assert loads == pytest.approx(1e4 + 50.0 * place, rel=1e-9)
    bent = count.snapshot(23.0, 1.0).bent
    assert bent is not None
    assert [bent.bends[k] for k in (18, 21, 24)] == [0.0, 1.0, 0.0]
    assert len(count.middles) == 60
    assert count.snapshot(23.0, 1.0).from_hang_off_m[22] == pytest.approx(0.5)


def test_rope_that_runs_between_two_ropes_is_counted_once() -> None:
    """The loop: what ran over the lower sheave has a bend a metre, published by the first rope."""
    scene = load_scene("two_line_loop")
    groove = BendingSheave(diameter_m=0.7, wrap_deg=180.0)
    (sheave,) = scene.sheaves
    ropes = tuple(replace(line, fatigue=DATA) if line.name == "below_ascending" else line
                  for line in scene.ropes)  # fmt: skip
    scene = replace(scene, sheaves=(replace(sheave, groove=groove),), ropes=ropes)
    twin = watched(scene, "polyester_tension")
    states = []
    for at, speed in ((0, 1.0), (1, 0.0), (2, -1.0)):
        twin.submit_speed(None, speed)
        twin.submit_speed(None, -speed, "haulback_sheave")
        twin.advance(400)
        states.append((at, twin.capture(), twin.snapshot()))
    snapshot = states[-1][2]
    by_name = {rope.name: rope for rope in snapshot.ropes}
    assert by_name["below_ascending"].fatigue is None
    wear = by_name["below_descending"].fatigue
    assert wear is not None
    assert wear.bent is not None
    assert len(wear.used) == 1500
    first_m = by_name["below_descending"].line_out_m
    assert wear.from_lower_end_m + wear.from_hang_off_m == pytest.approx(first_m)
    assert wear.bent.source == "test report 7"
    bent = np.flatnonzero(wear.bent.bends)
    assert 1 < len(bent) < 20
    assert np.abs(wear.from_hang_off_m[bent]).max() < 20.0  # those beside the sheave
    ends = [one.sheaves[0].passed_m for _, _, one in states]
    swept = max(ends) - min(ends)
    assert len(bent) == pytest.approx(swept + groove.arc_m, abs=3.0)
    assert (wear.bent.damage[bent] > 0.0).all()
    again = Twin.restore(
        states[1][1], scene, Monitors(vortex=MonitorSettings(fatigue="polyester_tension"))
    )
    again.submit_speed(None, -1.0)
    again.submit_speed(None, 1.0, "haulback_sheave")
    again.advance(400)
    same = {rope.name: rope for rope in again.snapshot().ropes}["below_descending"].fatigue
    assert np.array_equal(same.bent.bends, wear.bent.bends)
    assert np.array_equal(same.bent.damage, wear.bent.damage)
    assert np.array_equal(same.used, wear.used)


def test_keys_that_judge_are_in_no_digest(scene: Scene) -> None:
    (line,) = scene.ropes
    assert repr(line) == repr(replace(line, fatigue=None))
    winch = scene.winch
    assert winch is not None
    assert winch.drum is not None
    assert winch.sheave is not None
    other = replace(winch, inboard_sheaves=(), drum=replace(winch.drum, inboard_m=0.0),
                    sheave=replace(winch.sheave, wrap_deg=180.0, bends=2.0))  # fmt: skip
    assert repr(other) == repr(winch)


def test_curves_of_tension_of_fibre_ropes(scene: Scene) -> None:
    """DNV-OS-E301: 10 % of the characteristic strength, 0.95 MBL, 0.259·10^13.46 times."""
    cycles = Cycles(np.array([0.095]), np.array([0.2]), np.array([1.0]))
    used = CURVES["polyester_tension"].used(cycles)
    assert used == pytest.approx(1.0 / (0.259 * 10.0**13.46))
    (line,) = scene.ropes
    assert own_curve(line).exponent == 13.46
    with pytest.raises(InputError, match=r"fatigue own: rope '.*' has no|no curve of tension"):
        own_curve(replace(line, fatigue=replace(DATA, tension=None)))
    assert wire_curve_warning(line, "own", 0.0) == ""
    assert wire_curve_warning(line, "polyester_tension", 0.0) == ""
    assert "curve of wire rope" in wire_curve_warning(line, "six_strand_tension", 0.0)
    steel = replace(HMPE, mass=6.4, EA=6.5e7).scene().ropes[0]
    assert "section 1 is steel" in wire_curve_warning(steel, "polyester_tension", 0.0)


def test_data_without_a_source_or_figure_are_refused() -> None:
    assert FatigueData(source="x").check() is not None
    assert FatigueData(source=" ", discard_bends=5.0).check() is not None
    assert DATA.check() is None


def test_the_keys_of_the_how_to_page_fit_a_scene(tmp_path: Path) -> None:
    """The YAML of the page, put into the HMPE lift, is read, and its path has seven places."""
    page = (ROOT / "docs" / "how-to" / "live_viv.md").read_text("utf-8")
    (given,) = (
        yaml.safe_load(part.split("```")[0]) for part in page.split("```yaml")[1:]
        if "inboard_sheaves" in part.split("```")[0]
    )  # fmt: skip
    lift = yaml.safe_load((ROOT / "config" / "scenes" / "hmpe_lift.yaml").read_text("utf-8"))
    lift["ropes"][0] |= given["ropes"][0]
    lift["winch"] |= given["winch"]
    path = tmp_path / "lift.yaml"
    path.write_text(yaml.safe_dump(lift), "utf-8")
    scene = load_scene(path)
    assert scene.winch is not None
    assert len(scene.winch.bend_path()) == 7
    (life,) = endurance(scene.ropes[0])
    assert life.discard_bends == 20000.0
    assert own_curve(scene.ropes[0]).exponent == 12.0
