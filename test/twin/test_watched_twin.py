"""Monitors beside the tension: fatigue used of each metre of rope, and vibration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from whole_history import WholeHistory

from rope_twin.core import state as rows
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.errors import InputError, StateError
from rope_twin.messages import decode, read_cloud, statuses
from rope_twin.recording.bag import BagReader
from rope_twin.recording.session import RunSetup
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import run_unpaced
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import RopeSection, Scene, Winch
from rope_twin.scene.winch import TopSheave
from rope_twin.studies.driven_twin import march, still
from rope_twin.twin import twin as twin_module
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.vortex_monitor import VortexMonitor
from rope_twin.vortex.fatigue import STRESS_CURVES, wire_curve_warning
from rope_twin.vortex.line_model import diameters, turned
from rope_twin.vortex.monitor import MeasuredVibration, RopeMonitor
from rope_twin.vortex.results import MonitorSettings
from validation.rigs import Rig, sine

STEEL = Rig(length=100.0, elements=20, mass=6.4, EA=6.5e7, diameter=0.032, damping=5e4, load=5e3)
AREA = 6.4 / 7850.0  # of metal
STRANDED = STRESS_CURVES["stranded_wire"]
WINCH = Winch(
    speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=1.0, min_line_out_m=10.0,
    max_line_out_m=130.0,
)  # fmt: skip
WORN = MonitorSettings(fatigue="stranded_wire")


def watched(scene: Scene, watch: MonitorSettings = WORN) -> Any:
    return Twin(scene, Monitors(vortex=watch))


def monitor_of(twin: Twin) -> RopeMonitor:
    monitor = twin.monitor(VortexMonitor)
    assert monitor is not None
    return monitor.lines[0,]


def used(snapshot: Snapshot) -> np.ndarray:
    assert snapshot.fatigue is not None
    return snapshot.fatigue.used


def test_a_rope_cycled_at_a_known_amplitude_uses_what_miner_says() -> None:
    """Held below and stretched by 2·a, n times: n·(2·a·EA/(L·A))^4/K in every metre.

    The stretch is 0.4 m/km; slower than the rope's axial waves by 30, so that mass adds 0.3 %.
    """
    rig = replace(STEEL, load=0.0, fixed_at=(0.0, 0.0, -100.1), gravity=0.0)
    a, period, n = 0.02, 2.0, 10
    omega = 2.0 * np.pi / period

    def pushed(t: float) -> tuple[float, float]:
        return a * (1.0 - float(np.cos(omega * t))), a * omega * float(np.sin(omega * t))

    twin = watched(rig.scene())
    (*_, last) = march(twin, pushed, n * period + 1.0, 10)
    stress_mpa = 2.0 * a / rig.length * rig.EA / AREA * 1e-6
    assert last.fatigue is not None
    assert len(last.fatigue.used) == 100
    # ten full cycles and the half of the way up again, the largest range but for the mass
    assert last.fatigue.used == pytest.approx((n + 0.5) * stress_mpa**4 / 3.4e14, rel=0.03)
    assert last.fatigue.used[50] == pytest.approx((n + 0.5) * stress_mpa**4 / 3.4e14, rel=0.01)
    assert last.fatigue.counted_s == pytest.approx(21.0)


def lifted(twin: Twin, seconds: float = 44.0) -> Iterator[Snapshot]:
    """Heaved all the time; hauled in by 30 m and paid out by 40 m on the way."""
    speeds = [(2.0, -2.0), (17.0, 0.0), (19.0, 2.0), (39.0, 0.0)]
    return march(twin, sine(0.5, 3.0), seconds, 2, speeds)


def test_a_metre_keeps_its_damage_through_the_winch() -> None:
    """Aboard it stands still, below it grows; each equals rainflow of the whole history.

    The independent count keeps the turning points of every metre and asks the rainflow package.
    """
    scene = replace(STEEL, winch=WINCH).scene()
    twin = watched(scene)
    other = WholeHistory(130.0, AREA)
    snapshots, marked = [], 84  # hauled aboard and paid out again
    for snapshot in lifted(twin):
        other.take(snapshot)
        if snapshot.stamp_ns % 10**9 == 0:
            snapshots.append(snapshot)
    assert twin.snapshot().solver.splits > 3
    assert twin.snapshot().solver.merges > 3
    places = np.array([snapshot.fatigue.from_hang_off_m[marked] for snapshot in snapshots])  # type: ignore[union-attr]
    history = np.array([used(snapshot)[marked] for snapshot in snapshots])
    aboard = places < -1.0
    assert aboard.sum() > 5
    first, last = np.flatnonzero(aboard)[[0, -1]]
    assert history[first] > 0.0
    assert len(set(history[first : last + 1])) == 1  # kept to the bit
    assert history[-1] > history[last]
    assert (np.diff(history) >= 0.0).all()
    assert used(snapshots[-1]) == pytest.approx(other.damage(STRANDED), rel=1e-9)
    assert (
        used(snapshots[-1])[:60].min() > used(snapshots[-1])[105] > 0.0 == used(snapshots[-1])[115]
    )


def test_a_metre_that_runs_over_the_sheave_is_bent_once_each_time() -> None:
    """Hauled in by 30 m and paid out by 40 m, in no heave: E·δ/(D + d) once for each passage.

    Another count, that keeps turning points of tension and asks the rainflow package, agrees.
    """
    sheave = TopSheave(diameter_m=0.8, outer_wire_m=0.0015)
    scene = replace(STEEL, winch=replace(WINCH, sheave=sheave)).scene()
    stress_pa = sheave.bending_stress_pa(0.032)
    assert stress_pa == pytest.approx(1.96e11 * 0.0015 / 0.832)
    other = WholeHistory(130.0, AREA, stress_pa)
    speeds = [(2.0, -2.0), (17.0, 0.0), (19.0, 2.0), (39.0, 0.0)]
    for snapshot in march(watched(scene), still, 42.0, 2, speeds):
        other.take(snapshot)
    once = (1e-6 * stress_pa) ** 4 / 3.4e14
    # metre 84 in and out again, 105 out for the first time, 40 below all the time, 125 aboard;
    # tension, which swings as the winch starts and stops, adds a little to the range
    assert 2.0 * once < used(snapshot)[84] < 2.3 * once
    assert once < used(snapshot)[105] < 1.15 * once
    assert used(snapshot)[40] < 0.01 * once
    assert used(snapshot)[125] == 0.0
    assert used(snapshot)[130:] == pytest.approx(0.0)  # on the sheave when all is out
    assert used(snapshot)[:130] == pytest.approx(other.damage(STRANDED), rel=1e-9)


def test_the_run_is_the_same_to_the_bit_and_a_saved_one_goes_on_to_the_bit() -> None:
    scene = replace(STEEL, winch=WINCH).scene()
    alone = [snapshot.tension_top_n for snapshot in lifted(Twin(scene), 12.0)]
    twin = watched(scene)
    assert [snapshot.tension_top_n for snapshot in lifted(twin, 12.0)] == alone
    with_books = Twin(scene, Monitors(energy=True, error_interval=True, vortex=WORN))
    assert [snapshot.tension_top_n for snapshot in lifted(with_books, 3.0)] == alone[:150]
    state = twin.capture()
    again = Twin.restore(state, scene, Monitors(vortex=WORN))
    assert len(again.capture().arrays) == len(state.arrays)
    for one in (twin, again):
        (*_, last) = march(one, sine(0.5, 3.0), 8.0, 2)
        alone.append(last.tension_top_n)
    assert alone[-1] == alone[-2]
    assert np.array_equal(used(twin.snapshot()), used(again.snapshot()))
    assert twin.snapshot().fatigue.counted_s == again.snapshot().fatigue.counted_s == 20.0


def test_a_state_is_taken_with_and_without_what_was_counted() -> None:
    scene = STEEL.scene()
    twin = watched(scene)
    twin.advance(200)
    state = twin.capture()
    assert Twin.restore(state, scene).snapshot().fatigue is None
    words = RunSetup(feeds_itself=True).make(scene, state).notice
    assert words == (
        "saved state in memory: its fatigue by the curve stranded_wire is not counted on, and not "
        "saved again; ask for fatigue stranded_wire to continue it."
    )
    assert not RunSetup(feeds_itself=True, fatigue="stranded_wire").make(scene, state).notice
    plain = Twin(scene)
    plain.advance(200)
    late = Twin.restore(plain.capture(), scene, Monitors(vortex=WORN))
    late.advance(100)
    assert late.snapshot().fatigue.counted_s == pytest.approx(1.0)
    by_tension = Monitors(vortex=MonitorSettings(fatigue="six_strand_tension"))
    with pytest.raises(StateError, match=r"counted by the curve stranded_wire, .*; ask for str"):
        Twin.restore(state, scene, by_tension)


def test_below_a_cut_nothing_more_is_used_and_metres_keep_their_names() -> None:
    scene = replace(STEEL, winch=WINCH).scene()
    twin = watched(scene)
    (*_, before) = march(twin, sine(0.5, 3.0), 4.0, 2)
    assert twin.submit_cut(None, 40.0) == ""
    (*_, after) = march(twin, sine(0.5, 3.0), 8.0, 2)
    lost = after.cut.lost_m
    assert 50.0 < lost < 65.0
    below = after.fatigue.from_lower_end_m < lost
    assert np.array_equal(used(after)[below], used(before)[below])
    above = (after.fatigue.from_hang_off_m > 0.0) & ~below
    assert (used(after)[above] > used(before)[above]).all()
    assert after.fatigue.from_hang_off_m[~below][0] == pytest.approx(after.line_out_m, abs=1.0)


def test_what_cannot_be_reported_is_refused() -> None:
    with pytest.raises(InputError, match=r"fatigue: no curve 'wire'; did you mean 'spiral_wire'"):
        MonitorSettings(fatigue="wire")
    with pytest.raises(InputError, match=r"fatigue: no curve 'x'; known: own, polyester_tension"):
        MonitorSettings(fatigue="x")
    words = r"vibration: no model 'time_domain'; did you mean 'time-domain'"
    with pytest.raises(InputError, match=words):
        MonitorSettings(vibration="time_domain")
    with pytest.raises(InputError, match="lists no VIV model"):
        watched(STEEL.scene(), MonitorSettings(vibration="time-domain"))
    with pytest.raises(InputError, match=r"not all of steel.*six_strand_tension"):
        watched(load_scene("hmpe_lift"))
    assert STEEL.twin().snapshot().vibration is None
    still_water = watched(STEEL.scene(), MonitorSettings(vibration="frequency-domain"))
    assert "the current excites no mode on 33 nodes; modes are computed" in still_water.notice


def test_a_section_that_is_no_wire_is_reported() -> None:
    """Links of chain displace more than a bar of their diameter."""
    scene = STEEL.scene()
    assert watched(scene).notice == ""
    link = replace(scene.ropes[0].rope, diameter_m=0.032 / 1.8)
    sections = (RopeSection(rope=link, length_m=40.0),
                RopeSection(rope=scene.ropes[0].rope, length_m=60.0))  # fmt: skip
    chained = replace(scene, ropes=(replace(scene.ropes[0], rope=None, sections=sections),))
    words = "stranded_wire is a curve of wire rope, and of rope 'rope' section 1 is chain; "
    assert watched(chained).notice.startswith(f"fatigue: {words}")
    riser, cable = (load_scene(name).ropes[0] for name in ("riser_300m", "deep_tow_turn"))
    assert "section 1 is a pipe" in wire_curve_warning(riser, "stranded_wire", 8.6e6)
    assert "section 1 is not all of steel" in wire_curve_warning(cable, "six_strand_tension", 0.0)


def test_a_rope_of_fibre_is_refused_before_its_step_is_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(twin_module, "RopeSystem", lambda *given: pytest.fail("it is built"))
    with pytest.raises(InputError, match="not all of steel"):
        watched(load_scene("hmpe_lift"))


def test_stress_of_bending_is_that_of_the_curvature() -> None:
    """A rope bent along an arc: E·d/2·κ at two of eight places, 1/√2 of it at four."""
    rig = replace(STEEL, EI=100.0)
    twin = watched(rig.scene())
    twin.advance(2)
    monitor, rope = monitor_of(twin), twin.rope
    (wear,) = monitor.damages
    n, radius = int(rope.state.counts[rows.ELEMENTS]), 400.0
    angle = rope.state.s[: n + 1] / radius
    rope.state.nodes[rows.POSITION, : n + 1] = radius * (1.0 - np.cos(angle))
    rope.state.nodes[rows.POSITION + 2, : n + 1] = radius * np.sin(angle)
    bent = monitor.bent(rope, wear.middles)
    assert bent.shape == (2, 100)
    assert bent[0, 20:80] == pytest.approx(1.0 / radius, rel=1e-3)
    assert np.abs(bent[1]).max() < 1e-12
    wear.take(rope, 5e4, np.zeros_like(bent))
    tension = wear._count._last.reshape(8, 100)[0, 50]
    wear.take(rope, 5e4, bent)
    stress = wear._count._last.reshape(8, 100)[:, 50] - tension
    full = rig.EA / AREA * 0.016 / radius
    half = full / np.sqrt(2.0)
    assert stress == pytest.approx(
        [full, half, 0.0, -half, -full, -half, 0.0, half], abs=2e-3 * full
    )


def test_leaning_a_rope_over_turns_its_sides_without_twist() -> None:
    """Lengths and angles stay, an upright rope keeps east and north."""
    rng = np.random.default_rng(3)
    along = rng.normal(size=(3, 50))
    along /= np.linalg.norm(along, axis=0)
    along[2] = np.abs(along[2])
    across = np.cross(rng.normal(size=(3, 50)), along, axis=0)
    assert np.linalg.norm(turned(across, along), axis=0) == pytest.approx(
        np.linalg.norm(across, axis=0)
    )
    upright = np.zeros((3, 50))
    upright[2] = 1.0
    assert turned(across, upright) == pytest.approx(across[:2])


def shaken(
    seconds: float, hz: float, extra: dict[str, float]
) -> tuple[MeasuredVibration, np.ndarray]:
    """A rope whose nodes swing north in a half sine of 0.7 d, and east with twice the frequency.

    It drifts east, sways slowly and is paid out, as a rope does.
    """
    twin = STEEL.twin()
    rope, sample = twin.rope, 1.0 / (24.0 * 2.5)
    n = int(rope.state.counts[rows.ELEMENTS])
    at = rope.state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1].copy()
    shape = np.sin(np.pi * rope.state.s[: n + 1] / 100.0)
    rope.work[rows.FLOW, : n + 1] = 0.5
    rope.work[rows.FLOW + 1 : rows.FLOW + 3, : n + 1] = 0.0
    tracker = MeasuredVibration(rope, sample, 2.5)
    for k in range(1, round(seconds / sample)):
        t = k * sample
        place = rope.state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1]
        place[:] = at
        sway = extra["sway_m"] * np.sin(2.0 * np.pi * 0.1 * t)
        place[0] += 0.2 * 0.032 * shape * np.sin(4.0 * np.pi * hz * t + 0.3) + sway
        place[1] += 0.7 * 0.032 * shape * np.sin(2.0 * np.pi * hz * t) + sway
        place[0] += extra["drift_m_per_s"] * t
        place[2] -= extra["payout_m_per_s"] * t
        tracker.take(rope, sample, 2.5)
    return tracker, shape


@pytest.mark.parametrize("hz", [1.7, 2.5])
def test_shaking_of_known_amplitude_and_frequency_is_reported(hz: float) -> None:
    """Also beside a drift, payout and a sway of three diameters, of which 1/600 is left."""
    extra = {"drift_m_per_s": 0.2, "payout_m_per_s": 1.0, "sway_m": 0.1}
    tracker, shape = shaken(40.0, hz, extra)
    assert tracker.known
    diameter = diameters(STEEL.twin().rope)
    across, along = tracker.amplitudes_m() / diameter
    assert across == pytest.approx(0.7 * shape, abs=0.007)
    assert along == pytest.approx(0.2 * shape, abs=0.007)
    across_hz, along_hz = tracker.frequencies_hz()
    assert across_hz[2:-2] == pytest.approx(hz, rel=0.002)
    assert along_hz[3:-3] == pytest.approx(2.0 * hz, rel=0.005)
    # mean of |u|·u of a flow of 0.5 m/s past that motion, over 0.25 (m/s)²
    angle = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)[:, None]
    rate = 2.0 * np.pi * hz * 0.032 * shape
    u = 0.5 - 2.0 * rate * 0.2 * np.cos(2.0 * angle + 0.3), 0.7 * rate * np.cos(angle)
    expected = (np.hypot(*u) * u[0]).mean(axis=0) / 0.25
    assert expected.max() > 1.05
    assert tracker.drag_amplification() == pytest.approx(expected, rel=0.01)


def test_nothing_is_reported_before_the_filter_has_settled() -> None:
    extra = {"drift_m_per_s": 0.0, "payout_m_per_s": 0.0, "sway_m": 0.0}
    assert not shaken(4.0, 2.5, extra)[0].known
    assert shaken(5.0, 2.5, extra)[0].known


CABLE = replace(
    STEEL, length=60.0, elements=60, load=1e3, density=1025.0, current=((0.0, (0.5, 0.0)),),
    drag=(1.2, 0.02), added_mass=1.0, step=0.004, damping=1e4,
    winch=replace(WINCH, max_line_out_m=80.0),
)  # fmt: skip


def test_a_rope_that_its_vortices_shake_tells_so_and_goes_on_from_a_state() -> None:
    """Near Strouhal's frequency, under payout that splits elements; in line at twice of it."""
    scene = CABLE.scene()
    scene = replace(scene, effects=(*scene.effects, WakeOscillatorParams()))
    asked = Monitors(vortex=MonitorSettings("time-domain", "stranded_wire"))
    twin = Twin(scene, asked)
    assert monitor_of(twin).every == 5
    twin.submit_speed(2_000_000_000, 0.5)
    for _ in range(1000):  # also right after an element has split, between two looks
        twin.advance(3)
        seen = twin.snapshot()
        if seen.vibration is not None:
            assert len(seen.vibration.in_line) == len(seen.node_position_m)
    state = twin.capture()
    again = Twin.restore(state, scene, asked)
    for one in (twin, again):
        one.advance(1000)
    snapshot, other = twin.snapshot(), again.snapshot()
    assert snapshot.solver.splits > 3
    shaking, same = snapshot.vibration, other.vibration
    assert shaking is not None
    assert same is not None
    assert len(shaking.cross_flow) == len(snapshot.node_position_m)
    assert shaking.cross_flow[0] < 0.02
    assert 0.3 < shaking.cross_flow.max() < 2.0
    strouhal = 0.17 * 0.5 / 0.032
    assert shaking.cross_flow_hz[shaking.worst] == pytest.approx(strouhal, rel=0.15)
    assert shaking.in_line is not None
    assert shaking.in_line_hz is not None
    assert shaking.in_line_hz[shaking.in_line.argmax()] > 1.5 * strouhal
    for name in ("cross_flow", "cross_flow_hz", "in_line", "in_line_hz"):
        assert np.array_equal(getattr(shaking, name), getattr(same, name)), name
    assert np.array_equal(used(snapshot), used(other))
    rows_reported = {row.name: row for row in statuses(snapshot, None)}
    assert "cross-flow A/D" in rows_reported["simulation: vibration"].message
    assert "accumulated damage" in rows_reported["simulation: fatigue"].message


def test_a_run_records_and_sums_up(tmp_path: Path) -> None:
    """The scene is one that users have; without monitoring there is no such message."""
    options = RunOptions(
        scene="shallow_lift", end_s=3.0, speed=0.0, record=tmp_path / "bag", watch=WORN
    )
    summary = run_unpaced(options, lambda run: None)
    assert summary.fatigue is not None
    assert "fatigue (stranded_wire): " in summary.as_text()
    with BagReader(tmp_path / "bag") as bag:
        reported = [decode("ropes/fatigue", data) for _, data in bag.messages("/ropes/fatigue")]
        assert "/ropes/vibration" not in {n for n, c in bag.topics.items() if c.messages}
    assert len(reported) == 3
    table = read_cloud(reported[-1])
    assert table["damage"].max() == summary.fatigue["used"] > 0.0
    line_out = table["from_lower_end_m"] + table["from_hang_off_m"]
    assert line_out == pytest.approx(line_out[0])
