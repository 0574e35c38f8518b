"""The live error band of ropes that meet and of rigid bodies: companion, what is seen, bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.body import state as at
from rope_twin.messages import Encoder, decode, read_cloud, statuses
from rope_twin.scene.load import load_scene
from rope_twin.scene.model.joined import build_joined
from rope_twin.scene.model.rope import build
from rope_twin.studies.driven_twin import fed, variant
from rope_twin.twin.accuracy.error_bound import LOOSE, ROUGH_S, ErrorBound
from rope_twin.twin.accuracy.error_fraction import fraction_of_difference
from rope_twin.twin.accuracy.error_interval import SETTLING_S, ErrorIntervalTwin
from rope_twin.twin.accuracy.event_detection import EventDetector, is_slack
from rope_twin.twin.results import TensionInterval
from rope_twin.twin.snapshot import Snapshot


def pulls(shots: list[Snapshot]) -> list[list[float]]:
    return [[one.tension_top_n for one in shot.ropes] for shot in shots]


@pytest.mark.parametrize("name", ["two_line_lift", "two_line_loop"])
def test_the_companion_is_the_system_of_half_the_elements_and_twice_the_step(name: str) -> None:
    """Its tensions are those of a twin of such a scene, at both winches, over a sheave too."""
    scene = load_scene(name)
    twin, followed = ErrorIntervalTwin(scene), []
    last = [top.rope for top in twin._tops][-1]
    for _ in fed(twin, 14.0):
        followed.append([twin._coarse.further(r)[-1] for r in (0, last)])
    half = Twin(variant(scene, scene.ropes[0].elements // 2, 2.0 * scene.time.step_s))
    alone = [[one[0], one[last]] for one in pulls(list(fed(half, 14.0)))]
    assert np.allclose(followed, alone, rtol=1e-7)


def test_the_run_is_the_same_to_the_bit_and_so_is_a_branch_with_its_band() -> None:
    """Of all ropes of a bridle; the branch goes on beside it."""
    scene = load_scene("bridle_lift")
    twin = ErrorIntervalTwin(scene)
    assert pulls(list(fed(twin, 4.0))) == pulls(list(fed(Twin(scene), 4.0)))
    other = twin.branch()
    for _ in range(40):
        twin.advance(3)
        other.advance(3)
        assert other.snapshot().band == replace_cost(twin.snapshot(), other.snapshot())


def replace_cost(one: Snapshot, other: Snapshot) -> TensionInterval | None:
    """The band of one with the cost of the other: time is no state."""
    assert one.band is not None
    assert other.band is not None
    return replace(one.band, cost_pct=other.band.cost_pct)


def test_a_restored_twin_knows_its_band_when_the_companion_has_settled() -> None:
    """The halves of a system in motion come to agree with those that started at rest."""
    scene = load_scene("bridle_lift")
    twin = ErrorIntervalTwin(scene)
    for _ in fed(twin, 3.0):
        pass
    again = ErrorIntervalTwin.restore(twin.capture(), scene)
    bounds = []
    while again.time_ns < 25_000_000_000:
        twin.advance(2)
        again.advance(2)
        one, other = twin.snapshot(), again.snapshot()
        assert one.tension_top_n == other.tension_top_n
        assert (other.band is None) == (other.time_s < 3.0 + SETTLING_S)
        assert other.no_band.startswith("unknown until 23.0 s: ") == (other.band is None)
        if one.band is not None and other.band is not None:
            bounds.append((one.band.bound_n, other.band.bound_n))
    started, restored = np.median(bounds, axis=0)
    assert restored == pytest.approx(started, rel=0.2)


def test_every_rope_from_the_ship_has_a_band_and_no_other_and_all_are_told() -> None:
    twin = ErrorIntervalTwin(load_scene("two_line_lift"))
    twin.advance(10)
    shot = twin.snapshot()
    assert shot.band == shot.ropes[0].band
    for rope in shot.ropes:
        assert rope.band is not None
        assert rope.band.low_n < rope.tension_top_n < rope.band.high_n
        assert rope.band.high_n - rope.tension_top_n == pytest.approx(rope.band.bound_n)
    first, aft = (rope.band for rope in shot.ropes)
    assert first is not None
    assert aft is not None
    message = decode("ropes/tension_top_error", Encoder(0).encode("ropes/tension_top_error", shot))
    rows = read_cloud(message)
    assert rows["lower_n"].tolist() == [first.low_n, aft.low_n]
    assert rows["upper_n"].tolist() == [first.high_n, aft.high_n]
    assert rows["name"].tolist() == [rope.name.encode() for rope in shot.ropes]
    (row,) = (one for one in statuses(shot, None) if one.name == "simulation: error band")
    assert row.values["error bound of 'aft' [N]"] == f"{aft.bound_n:.3g}"
    legs = ErrorIntervalTwin(load_scene("bridle_lift")).snapshot().ropes
    assert [rope.band is not None for rope in legs] == [True, False, False, False, False]


def test_a_current_in_layers_makes_the_whole_difference_count() -> None:
    """A third for one rope, a half where ropes meet, all of it where the current jumps."""
    layered, even = (
        build_joined(load_scene(name)).system.ropes[0]
        for name in ("two_line_loop", "two_line_lift")
    )
    assert fraction_of_difference(layered, meets=True) == 1.0
    assert fraction_of_difference(even, meets=True) == 0.5
    assert fraction_of_difference(even, meets=False) == pytest.approx(1.0 / 3.0)


def test_a_step_of_the_current_errs_by_no_more_than_the_difference_of_the_halves() -> None:
    """Load of a current that sets in at a height, felt at nodes: the rule of `error_fraction`."""
    for step in np.linspace(40.0, 60.0, 41):
        loads = []
        for element in (10.0, 5.0):
            z = np.arange(0.0, 100.0 + element, element)
            share = np.where((z == 0.0) | (z == 100.0), 0.5, 1.0)
            loads.append(float((share * element)[z >= step].sum()))
        error, difference = loads[1] - (100.0 - step), loads[0] - loads[1]
        assert abs(error) <= abs(difference) + 1e-9
        assert abs(difference) == pytest.approx(2.5)


def test_a_module_on_two_lines_lands_and_a_leg_that_is_slack_is_seen() -> None:
    """The module is a joint, held by no place: either line's lower end tells."""
    ropes = build_joined(load_scene("two_line_landing")).system.ropes
    sight = EventDetector(ropes, [False, False])
    assert not sight.stands(ropes, sight.bed)
    for rope in ropes:
        rope.work[rows.TENSION] = 1.0
        rope.state.nodes[rows.POSITION + 2, 0] = -46.0
    assert sight.stands(ropes, sight.bed)
    assert not is_slack(ropes)
    ropes[1].work[rows.TENSION, 2] = 0.0
    assert is_slack(ropes)


def test_a_body_on_its_deck_and_slings_that_hang_loose_are_seen() -> None:
    rope = build(load_scene("lift_off"))
    rope.work[rows.TENSION] = 1.0
    (body,) = (one for one in rope.effects if hasattr(one, "records"))
    now, corner = body.records[0], -float(body.corners[:, 2].min())
    now[at.Q + 3] = 1.0
    body.stage[at.DECK_Z] = 5.0
    sight = EventDetector([rope], [False])
    for height, stands in ((4.99, True), (5.01, False)):
        now[at.X + 2] = height + corner
        assert sight.on_deck() == stands
        assert not sight.stands([rope], sight.bed)  # there is none
    for above, slack in ((3.0, True), (9.0, False)):  # slings are 7 m long
        rope.state.nodes[rows.POSITION : rows.POSITION + 3, 0] = now[at.X : at.X + 3]
        rope.state.nodes[rows.POSITION + 2, 0] += above
        assert sight.slack_legs() == 4 * [slack]
        assert sight.unloaded() == slack
        assert not is_slack([rope])


def test_a_rope_without_slings_is_never_without_its_load() -> None:
    rope = build(load_scene("shallow_lift"))
    assert not EventDetector([rope], [False]).unloaded()


def test_slings_and_a_deck_are_springs_and_a_snap_is_none() -> None:
    """A rope whose slings all hang loose snaps without its load, which is no snap either.

    A load on springs below a mass errs by the order 5/3 in the elements' length, so by
    1/(2^(5/3) - 1) of the difference at least, and by less than all of it, which is first order.
    """
    snap, sling, deck = (ErrorBound(100e3, 0.01) for _ in range(3))
    hook = ErrorBound(100e3, 0.01, unloaded=lambda: True)
    snap.slacken(0.0)
    hook.slacken(0.0)
    sling.loosen(0.0)
    deck.stand_on_deck(0.0)
    for band in (snap, sling, deck, hook):
        for k in range(1, 40):
            band.take(0.01 * k, 0.0, 90e3)
            band.compare(0.01 * k, 100.0)
    assert snap.bound_n(0.39) == pytest.approx(114.0)
    assert sling.bound_n(0.39) == deck.bound_n(0.39) == hook.bound_n(0.39)
    assert 100.0 / (2.0 ** (5.0 / 3.0) - 1.0) < hook.bound_n(0.39) < 100.0


def test_a_module_set_down_on_its_deck_is_not_taken_for_a_snap() -> None:
    """In lift_off the rope's tension is next to nothing for moments; all slings are slack then."""
    twin = ErrorIntervalTwin(load_scene("lift_off"))
    lowest_n = min(shot.tension_top_n for shot in fed(twin, 14.2))
    (top,) = twin._tops
    assert lowest_n < LOOSE * twin._rests_n[0]
    assert top.band._rough_until_s == 0.0
    assert top.band._sprung_until_s > ROUGH_S
