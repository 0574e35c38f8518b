"""VIV models of a running twin: mode search in parts, followed through changes, resumed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_vibration import CABLE

from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.errors import InputError
from rope_twin.scene.schema import Scene, Winch
from rope_twin.studies.driven_twin import march
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.vortex.decomposed_response import DecomposedResponse
from rope_twin.vortex.line_model import Span, line_model, refined
from rope_twin.vortex.modal_response import ModalResponse
from rope_twin.vortex.modes import ModeSearch
from rope_twin.vortex.power_in import POWER_MIN, ExcitationSearch, decomposed, near_driven
from rope_twin.vortex.results import FREQUENCY_DOMAIN, MonitorSettings, RopeVibration
from rope_twin.vortex.shedding import Shedding
from validation.rigs import sine

WINCH = Winch(
    speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=2.0, min_line_out_m=5.0,
    max_line_out_m=240.0,
)  # fmt: skip


def asked_for(model: str, curve: str = "") -> Monitors:
    return Monitors(vortex=MonitorSettings(model, curve))


def watched(scene: Scene, model: str, curve: str = "") -> Any:
    return Twin(scene, asked_for(model, curve))


def shaking(snapshot: Snapshot) -> RopeVibration:
    assert snapshot.vibration is not None
    return snapshot.vibration


def fine_span(ends: bool = True) -> Span:
    span = refined(line_model(CABLE.twin().rope), 1.0)
    return span if ends else span._replace(end_mass=None)


@pytest.mark.parametrize(("ends", "EI"), [(True, 0.0), (False, 0.0), (True, 5e3), (False, 1e5)])
@pytest.mark.parametrize("part", [1, 7, 400])
def test_a_mode_search_in_parts_equals_one_at_once(part: int, ends: bool, EI: float) -> None:
    span = fine_span(ends)._replace(stiffness=EI)
    whole = ModeSearch(span, 3.0).found()
    search = ModeSearch(span, 3.0, part)
    assert search.left > 10 / part
    search.go_on()
    computed = search.found()
    assert len(computed.frequency) == len(whole.frequency) > 15
    assert computed.frequency == pytest.approx(whole.frequency, rel=1e-9)
    assert np.abs(computed.shape - whole.shape).max() < 1e-6


@pytest.mark.parametrize("varying", [True, False])
def test_an_excitation_search_in_parts_equals_one_at_once(varying: bool) -> None:
    span, model = fine_span()._replace(speed=np.linspace(0.1, 0.5, 202)), decomposed(varying)
    span = span._replace(mass=0.5 * span.mass)
    whole = ExcitationSearch(span, model).found()
    search = ExcitationSearch(span, model, 5)
    promised = search.left
    for _ in range(promised):
        search.go_on()
    assert (search.left, promised > 5) == (0, True)
    computed = search.found()
    assert computed.dominant == whole.dominant > 5
    assert computed.frequency == pytest.approx(whole.frequency, rel=1e-5)
    assert computed.power == pytest.approx(whole.power, rel=1e-4)
    np.testing.assert_allclose(computed.zones, whole.zones, atol=1e-6)


def test_a_search_near_driven_modes_finds_all_driven_modes() -> None:
    """Fewer modes are looked for, and those that the current feeds are the same."""
    span, model = fine_span()._replace(speed=np.linspace(0.1, 0.5, 202)), decomposed()
    span = span._replace(mass=0.5 * span.mass)
    whole = ExcitationSearch(span, model).found()
    near = near_driven(whole)
    assert near is not None
    computed = ExcitationSearch(span, model, 5, near).found()
    kept = len(computed.power)
    assert kept < 0.8 * len(whole.power)
    assert not whole.zones[:, kept:].any()
    fed = whole.power > POWER_MIN * whole.power.max()
    assert computed.power[fed[:kept]] == pytest.approx(whole.power[fed], rel=1e-4)
    np.testing.assert_allclose(computed.zones, whole.zones[:, :kept], atol=1e-6)


def test_the_line_model_keeps_its_mesh_within_a_range() -> None:
    """Up to 1.25 times as many elements or half as many: one mesh for grids that differ little."""
    span = line_model(CABLE.twin().rope)
    length = float(span.s[-1])
    assert len(span.tension) < 98
    for wanted, made in ((200, 200), (249, 200), (251, 251), (101, 200), (99, 99)):
        fine = refined(span, length / (wanted - 0.5), 1, 200)
        assert len(fine.tension) == made
        assert fine.s[-1] == span.s[-1]


def test_decomposed_response_is_continuous_when_modes_are_updated() -> None:
    """Phases, motion and what was read of it are carried over; to another, it goes on near."""
    span = fine_span()
    one, other = (DecomposedResponse(span, decomposed()) for _ in range(2))
    for _ in range(8):
        one.advance(1.0)
        other.advance(1.0)
        other.follow(span)
    assert np.abs(one.motion).max() > 0.01
    assert other.motion == pytest.approx(one.motion, abs=1e-9)
    assert other.amplitude == pytest.approx(one.amplitude, abs=1e-7)
    longer = refined(span._replace(s=1.05 * span.s, tension=1.1 * span.tension), 1.0)
    before = np.abs(other.motion).max()
    other.follow(longer)
    assert len(other.motion) == len(longer.s) > len(span.s)
    assert np.abs(other.motion).max() == pytest.approx(before, rel=0.05)
    other.advance(20.0)
    assert 0.2 < other.amplitude.max() < 1.5


def test_live_response_of_a_static_rope_equals_constant_tension() -> None:
    scene = CABLE.scene()
    twin = watched(scene, FREQUENCY_DOMAIN)
    alone = ModalResponse(line_model(Twin(scene).rope), Shedding())
    twin.advance(1000)
    alone.advance(20.0)
    seen = shaking(twin.snapshot())
    nodes = np.linspace(alone.span.s[-1], 0.0, len(seen.cross_flow))
    expected = np.interp(nodes, alone.span.s, alone.amplitude)
    assert seen.cross_flow.max() > 0.5
    assert np.abs(seen.cross_flow - expected).max() < 0.05
    assert (seen.solves, seen.every_s, seen.note) == (20, 1.0, "")
    assert seen.in_line is None


def test_live_viv_follows_payout_and_resumes_bit_identically() -> None:
    """To the bit, also if saved between two searches; and the twin's own run is untouched."""
    scene = replace(CABLE, winch=WINCH).scene()
    course: Any = (sine(0.3, 6.0), 8.0, 1, [(2.0, 2.0)])
    plain = [snapshot.tension_top_n for snapshot in march(Twin(scene), *course)]
    twin = watched(scene, FREQUENCY_DOMAIN)
    assert [snapshot.tension_top_n for snapshot in march(twin, *course)] == plain
    twin.advance(17)
    again = Twin.restore(twin.capture(), scene, asked_for(FREQUENCY_DOMAIN))
    for run in (twin, again):
        for _ in march(run, sine(0.3, 6.0), 6.0, 1):
            pass
    seen, same = shaking(twin.snapshot()), shaking(again.snapshot())
    assert len(seen.cross_flow) > 43
    assert 0.05 < seen.cross_flow.max() < 1.5
    assert np.array_equal(seen.cross_flow, same.cross_flow)
    assert np.array_equal(seen.cross_flow_hz, same.cross_flow_hz)
    assert seen.solves == same.solves == 15


def test_slack_keeps_the_last_modes_and_is_reported() -> None:
    twin = watched(CABLE.scene(), FREQUENCY_DOMAIN)
    notes = [shaking(snapshot).note for snapshot in march(twin, sine(4.0, 4.0), 10.0, 5)]
    assert any("elements are slack" in note for note in notes)
    assert "" in notes


def test_viv_bending_fatigue_damage() -> None:
    """Stress of a wave on the rope: E·d/2·k²·A, k² = m·ω²/T; rainflow of it over the run."""
    twin = watched(replace(CABLE, diameter=0.032).scene(), FREQUENCY_DOMAIN, "stranded_wire")
    twin.advance(1000)
    before = twin.snapshot()
    twin.advance(500)
    snapshot = twin.snapshot()
    seen, wear = shaking(snapshot), snapshot.fatigue
    assert wear is not None and wear.bending  # noqa: PT018
    cycles = seen.cross_flow_hz[seen.worst] * 10.0
    per_metre = 6.4 + 1025.0 * 0.25 * np.pi * 0.032**2
    wave = per_metre * (2.0 * np.pi * seen.cross_flow_hz) ** 2 / snapshot.node_tension_n
    stress = 6.5e7 / (6.4 / 7850.0) * 0.016 * wave * seen.cross_flow * 0.032
    expected = cycles * (2e-6 * stress.max()) ** 4 / 3.4e14
    assert before.fatigue is not None
    grown = (wear.used - before.fatigue.used).max()
    assert 0.4 * expected < grown < 1.6 * expected


def test_a_second_viv_model_is_rejected() -> None:
    scene = CABLE.scene()
    scene = replace(scene, effects=(*scene.effects, WakeOscillatorParams()))
    with pytest.raises(InputError, match=r"own wake_oscillator computes.*ask for time-domain"):
        watched(scene, FREQUENCY_DOMAIN)
