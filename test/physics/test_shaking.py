"""VIV models of a scene that are computed after the step: results, sampling, resumption."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rigs import Vector, march, sine, still
from test_vibration import CABLE
from test_vibration_live import WINCH, asked_for, watched

from rope_twin import Snapshot, Twin
from rope_twin.effects.coupled_vibration import DecomposedForceParams, ModalVibrationParams
from rope_twin.effects.drag import DragParams
from rope_twin.errors import InputError
from rope_twin.scene.schema import Scene
from rope_twin.studies.viv_frequency_domain import run_frequency_domain, span_of
from rope_twin.studies.viv_time_domain import run_time_domain
from rope_twin.vortex.drag_amplification import GROWTH, DragGrowth
from rope_twin.vortex.results import FREQUENCY_DOMAIN, TIME_DOMAIN, RopeVibration
from rope_twin.vortex.shedding import Shedding

MODELS = [ModalVibrationParams(), DecomposedForceParams()]
ENOUGH_S = 60.0


def shaken(model: Any, scene: Scene | None = None) -> Scene:
    scene = CABLE.scene() if scene is None else scene
    return replace(scene, effects=(*scene.effects, model))


def shaking(snapshot: Snapshot) -> RopeVibration:
    assert snapshot.vibration is not None
    return snapshot.vibration


def settled(scene: Scene) -> tuple[Snapshot, Twin]:
    twin = Twin(scene)
    twin.advance(round(ENOUGH_S / twin.step_s))
    return twin.snapshot(), twin


def grown(twin: Twin) -> Vector:
    """g of the free nodes, from the lower end up."""
    own = next(effect for effect in twin.rope.effects if isinstance(effect, DragGrowth))
    return np.array(own.memory[GROWTH, : len(twin.snapshot().element_tension_n)])


def around_nodes(twin: Twin, snapshot: Snapshot) -> Vector:
    """Vandiver's growth, the mean of two thousand places around each free node.

    Their weight falls to 0 at the neighbours, and at half a wave of St·U/d to both sides at least;
    at the ends of the rope they are mirrored.
    """
    assert twin.viv_drag is not None
    s, amplitude, half_wave = twin.viv_drag.trackers[0].at_model_nodes()
    steps = np.diff(snapshot.node_position_m[::-1], axis=0)
    below = np.concatenate([[0.0], np.cumsum(np.sqrt((steps * steps).sum(axis=1)))])
    below -= below[-1]
    step = np.diff(below)
    half = np.interp(below, s, half_wave)[:-1]
    down, up = np.maximum(np.append(step[:1], step[:-1]), half), np.maximum(step, half)
    growth = 1.043 * (np.sqrt(2.0) * amplitude) ** 0.65
    part = np.linspace(-1.0, 1.0, 4001)
    results = []
    for at, low, high in zip(below[:-1], down, up, strict=True):
        side = np.where(part < 0.0, low, high)
        position = at + part * side
        position = np.where(position > 0.0, -position, position)
        position = np.where(position < below[0], 2.0 * below[0] - position, position)
        weight = (1.0 - np.abs(part)) * side
        results.append((np.interp(position, s, growth) * weight).sum() / weight.sum())
    return np.array(results)


def test_live_viv_equals_the_frequency_domain_assessment() -> None:
    """`rope_twin viv` has the rope at rest: without growth of the drag the twin is that, too."""
    scene = shaken(ModalVibrationParams(drag_growth=(0.0, 1.0)))
    snapshot, _ = settled(scene)
    alone = run_frequency_domain(span_of(scene), Shedding(), ENOUGH_S)
    seen = shaking(snapshot)
    expected = np.interp(snapshot.arc_length_m, alone.from_top_m[::-1], alone.rms()[::-1])
    assert (seen.model, seen.note) == ("modal_vibration", "")
    assert seen.cross_flow.max() / np.sqrt(2.0) == pytest.approx(expected.max(), rel=0.03)
    assert np.abs(seen.cross_flow / np.sqrt(2.0) - expected).max() < 0.03


@pytest.mark.parametrize("model", MODELS)
def test_mean_offset_with_drag_amplification(model: Any) -> None:
    """The mean offset is that of a rope whose drag coefficient is as much larger all along."""
    snapshot, twin = settled(shaken(model))
    growth = grown(twin)
    assert growth == pytest.approx(around_nodes(twin, snapshot), abs=1e-3)
    assert growth.mean() > 0.8
    assert shaking(snapshot).drag_amplification[:0:-1] == pytest.approx(1.0 + growth, abs=1e-6)

    def lean(scene: Scene) -> float:
        seen, _ = settled(scene)
        return float(seen.node_position_m[-1, 0])

    # what counts of f(s) for the lean of the lower end is ∫f·s ds/T: of the rope further up more
    s = twin.rope.state.s[: len(growth)]
    share = s / snapshot.node_tension_n[:0:-1]
    factor = 1.0 + float((growth * share).sum() / share.sum())
    own = CABLE.scene()
    more = DragParams(normal=1.2 * factor, tangential=0.02)
    dragged = tuple(more if isinstance(effect, DragParams) else effect for effect in own.effects)
    found, plain = float(snapshot.node_position_m[-1, 0]), lean(own)
    assert found == pytest.approx(lean(replace(own, effects=dragged)), rel=0.03)
    assert found > 1.7 * plain


def test_nodal_drag_amplification_integrates_between_nodes() -> None:
    """Six nodes to some thirty half waves: the sum over them is the integral, within 0.1 %."""
    model = ModalVibrationParams()
    scene = shaken(model, replace(CABLE, elements=5).scene())
    snapshot, twin = settled(scene)
    assert twin.viv_drag is not None
    reported = shaking(snapshot).drag_amplification[::-1]
    steps = np.sqrt((np.diff(snapshot.node_position_m[::-1], axis=0) ** 2).sum(axis=1))
    shares = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    s, amplitude, _ = twin.viv_drag.trackers[0].at_model_nodes()
    all_along = 1.0 + 1.043 * (np.sqrt(2.0) * amplitude) ** 0.65
    assert len(s) > 15 * len(reported)
    integral = 0.5 * ((all_along[1:] + all_along[:-1]) * np.diff(s)).sum()
    assert (reported * shares).sum() == pytest.approx(integral, rel=1e-3)
    pointwise = np.interp(np.append(np.cumsum(steps)[::-1], 0.0) * -1.0, s, all_along)
    assert abs((pointwise * shares).sum() / integral - 1.0) > 2e-3


@pytest.mark.parametrize("model", [MODELS[0], pytest.param(MODELS[1], marks=pytest.mark.long)])
def test_the_time_domain_assessment_equals_the_live_twin(model: Any) -> None:
    """`rope_twin viv --time-domain` looks at the motion itself, the twin reports live."""
    scene = shaken(model, replace(CABLE, diameter=0.032).scene())
    (found,) = run_time_domain(scene, 30.0, "stranded_wire")
    snapshots = [
        snapshot for snapshot in march(Twin(scene), still, 30.0, 5) if snapshot.time_s >= 15.0
    ]
    seen = [shaking(snapshot) for snapshot in snapshots]
    depth = snapshots[0].arc_length_m

    def at_nodes(values: Vector) -> Vector:
        return np.interp(depth, found.from_hang_off_m, values)

    rms = np.sqrt(0.5 * np.mean([own.cross_flow**2 for own in seen], axis=0))
    assert rms.max() > 0.2
    assert np.abs(at_nodes(found.rms[0]) - rms).mean() < 0.05 * rms.max()
    drag = np.mean([own.drag_amplification for own in seen], axis=0)
    assert at_nodes(found.drag_amplification) == pytest.approx(drag, rel=0.03)
    hertz = np.average(at_nodes(found.frequency_hz[0]), weights=rms)
    live = [np.average(own.cross_flow_hz, weights=rms) for own in seen]
    assert hertz == pytest.approx(np.mean(live), rel=0.05)
    # a wave of that frequency bends the wire by k²·A, k = 2π·f·√(m/T)
    moved = 6.4 + 1025.0 * np.pi * 0.016**2
    square = (2.0 * np.pi * hertz) ** 2 * moved / float(snapshots[-1].node_tension_n.mean())
    modulus = 6.5e7 / (6.4 / 7850.0)
    stress = modulus * 0.016 * square * 0.032 * rms.max()
    assert found.stress_rms_pa.max() == pytest.approx(stress, rel=0.3)
    np.testing.assert_allclose(found.stress_rms_pa, modulus * found.strain_rms, rtol=1e-9)
    assert found.damage_per_year.max() > 0.0
    assert np.isnan(found.rms[1]).all()


@pytest.mark.parametrize("model", MODELS)
def test_viv_resumes_bit_identically(model: Any) -> None:
    """Under heave and payout, saved between two searches; watched for wear it is the same run."""
    scene = shaken(model, replace(CABLE, diameter=0.032, winch=WINCH).scene())
    course: Any = (sine(0.3, 6.0), 6.0, 1, [(2.0, 2.0)])
    twin, worn = Twin(scene), watched(scene, "", "stranded_wire")
    for run in (twin, worn):
        list(march(run, *course))
        run.advance(17)
    others = [Twin.restore(twin.capture(), scene), twin.branch(), worn]
    others.append(Twin.restore(worn.capture(), scene, asked_for("", "stranded_wire")))
    (last,) = list(march(twin, sine(0.3, 6.0), 4.0, 200))
    assert len(last.element_tension_n) > 40
    assert shaking(last).cross_flow.max() > 0.05
    for other in others:
        (same,) = list(march(other, sine(0.3, 6.0), 4.0, 200))
        assert np.array_equal(last.element_tension_n, same.element_tension_n)
        assert np.array_equal(shaking(last).cross_flow, shaking(same).cross_flow)
        assert np.array_equal(grown(twin), grown(other))
    assert same.fatigue is not None
    assert same.fatigue.bending
    assert same.fatigue.used.max() > 0.0


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("every_s", [1.0, 0.2])
def test_mode_search_cost_is_spread_evenly(model: Any, every_s: float) -> None:
    """No sample pays for a search that others should have made."""
    rig = replace(CABLE, diameter=0.032, current=((0.0, (1.2, 0.0)),))
    twin = Twin(shaken(replace(model, modes_every_s=every_s), rig.scene()))
    assert twin.viv_drag is not None
    tracker, left = twin.viv_drag.trackers[0], []
    for _ in range(round(3.0 / twin.step_s)):
        twin.advance(1)
        search = tracker._search
        assert search is not None
        left.append(search.left)
    assert tracker.solves == 1 + round(3.0 / every_s - 0.5)
    shares = [before - after for before, after in itertools.pairwise(left) if after <= before]
    assert max(left) > 3
    assert max(shares) <= 1 + max(left) // round(every_s / twin.step_s - 1)
    # where a search begins nothing is left of the one before
    begun = range(round(every_s / twin.step_s), len(left), round(every_s / twin.step_s))
    assert [left[number - 1] for number in begun] == [0] * len(begun)
    assert all(left[number] > 3 for number in begun)


def test_a_slack_rope_keeps_its_modes_and_is_reported() -> None:
    twin = Twin(shaken(ModalVibrationParams()))
    notes = [shaking(snapshot).note for snapshot in march(twin, sine(4.0, 4.0), 10.0, 5)]
    assert any("elements are slack" in note for note in notes)
    assert "" in notes
    assert twin.snapshot().solver.unconverged_substeps == 0


def test_no_viv_without_a_current() -> None:
    """And shakes when one comes: looks are made for it then."""
    scene = replace(CABLE, current=((0.0, (0.0, 0.0)),)).scene()
    twin = Twin(shaken(DecomposedForceParams(), scene))
    (snapshot,) = list(march(twin, still, 3.0, 150))
    assert shaking(snapshot).cross_flow.max() == 0.0
    assert grown(twin).max() == 0.0
    assert twin.submit_current(np.array([[0.0, 0.3, 0.0]])) == ""
    (snapshot,) = list(march(twin, still, 20.0, 1000))
    assert shaking(snapshot).cross_flow.max() > 0.2
    assert grown(twin).max() > 0.3


def test_viv_of_a_scene_model_is_reported_without_an_option() -> None:
    """To ask for it changes nothing; a second model is rejected."""
    scene = shaken(ModalVibrationParams())
    plain, asked = Twin(scene), watched(scene, TIME_DOMAIN)
    for twin in (plain, asked):
        twin.advance(500)
    one, other = shaking(plain.snapshot()), shaking(asked.snapshot())
    assert one.model == other.model == "modal_vibration"
    assert np.array_equal(one.cross_flow, other.cross_flow)
    words = "the scene's own modal_vibration computes the vibration already; leave it out"
    with pytest.raises(InputError, match=words):
        watched(scene, FREQUENCY_DOMAIN)
