"""VIV models in multi-line systems: every rope by its own modes, or by its own wakes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rope_twin import Snapshot, Twin, load_scene
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.schema import Scene, SeaState
from rope_twin.studies.viv_time_domain import run_time_domain
from rope_twin.twin.monitors import NO_MONITORS, Monitors
from rope_twin.twin.twin import Twin as CoreTwin
from rope_twin.vortex.results import RopeVibration

DAMPED = "damping: {newton_seconds: 2.0e+5}"
TOOL = """  - name: {name}
    mass_kg: {mass}
    displaced_volume_m3: 0.3
    added_mass_kg: [400.0, 400.0, 400.0]
    drag_area_m2: [0.0, 0.0, 0.0]
"""
WATER = """effects:
  - current: {{profile: [[0.0, [{speed}, 0.1]], [-300.0, [{speed}, 0.1]]]}}
  - weight: {{}}
  - drag: {{normal: 1.2, tangential: 0.02}}
  - added_mass: {{normal: 1.0}}
  - {model}: {{}}
  - payload: {{}}
time: {{step_s: 0.02, newton_tolerance_n: 0.01}}
"""
HEAD = "about: ropes that vortices shake\nsource: made up for a test\nlook_at: nothing\n"
MODELS = ["modal_vibration", "decomposed_force"]  # loosely coupled
WAKES = [  # inside the time step
    pytest.param("wake_oscillator", marks=pytest.mark.long),
    pytest.param("strouhal_forcing", marks=pytest.mark.long),
    pytest.param("travelling_waves", marks=pytest.mark.long),
]


def line(name: str, rope: str, length: float, elements: int, more: str) -> str:
    """A rope of a scene."""
    return (
        f"  - {{name: {name}, rope: {rope}, length_m: {length}, elements: {elements}, {DAMPED}, "
        f"{more}}}\n"
    )


def hanging(names: str, model: str, speed: float = 0.5) -> str:
    """Return a scene of ropes side by side, each with a tool: `a`, `b`, or both."""
    ropes = {
        "a": line("a", "steel_wire_40mm", 150.0, 30, "to: tool_a"),
        "b": line("b", "steel_wire_40mm", 100.0, 16, "from: stern, to: tool_b"),
    }
    ship = "hang_offs:\n  - {name: stern, at_m: [-30.0, 0.0, 0.0]}\n" if "b" in names else ""
    if names == "b":
        ropes["b"], ship = ropes["b"].replace("from: stern, ", ""), ""
    masses = {"a": 4000.0, "b": 3000.0}
    tools = [TOOL.format(name=f"tool_{name}", mass=masses[name]) for name in names]
    return (
        HEAD + "ropes:\n" + "".join(ropes[name] for name in names)
        + ship + "payloads:\n" + "".join(tools) + WATER.format(model=model, speed=speed)
    )  # fmt: skip


def scene_of(text: str, folder: Path) -> Scene:
    """The scene of this text."""
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(str(path))


def run(text: str, folder: Path, seconds: float) -> Snapshot:
    """The snapshot after some seconds in calm."""
    twin = Twin(scene_of(text, folder))
    twin.advance(round(seconds / twin.step_s))
    return twin.snapshot()


def shaking(snapshot: Snapshot, number: int = 0) -> RopeVibration:
    """The vibration of a rope."""
    computed = snapshot.ropes[number].vibration if snapshot.ropes else snapshot.vibration
    assert computed is not None
    return computed


@pytest.mark.parametrize("model", MODELS)
def test_modal_viv_of_separate_ropes_is_independent(model: str, tmp_path: Path) -> None:
    """Amplitude, frequency, drag and tool position of 150 m and of 100 m of wire."""
    both = run(hanging("ab", model), tmp_path, 30.0)
    for number, name in enumerate("ab"):
        alone = run(hanging(name, model), tmp_path, 30.0)
        own, expected = shaking(both, number), shaking(alone)
        assert expected.cross_flow.max() > 0.2, "it shakes"
        assert expected.drag_amplification.max() > 1.3
        for values in ("cross_flow", "cross_flow_hz", "drag_amplification"):
            found, known = getattr(own, values), getattr(expected, values)
            assert found == pytest.approx(known, abs=1e-3 * known.max())
        position = both.ropes[number].node_position_m
        moved = alone.node_position_m - alone.node_position_m[0]
        assert position - position[0] == pytest.approx(moved, abs=1e-4)


@pytest.mark.parametrize("model", WAKES)
def test_wakes_of_separate_ropes_are_independent(model: str, tmp_path: Path) -> None:
    """Positions of all nodes; each rope has its own tension and diameter."""
    both = run(hanging("ab", model), tmp_path, 20.0)
    calm = run(hanging("ab", model).replace(f"  - {model}: {{}}\n", ""), tmp_path, 20.0)
    for number, name in enumerate("ab"):
        alone = run(hanging(name, model), tmp_path, 20.0)
        position = both.ropes[number].node_position_m
        shaken = np.abs(position - calm.ropes[number].node_position_m).max()
        moved = alone.node_position_m - alone.node_position_m[0]
        assert shaken > 2e-3
        assert position - position[0] == pytest.approx(moved, abs=1e-2 * shaken)


def same(one: Snapshot, other: Snapshot) -> bool:
    """Return whether tension, nodes and vibration of all ropes are bit-identical."""
    rows = []
    for snapshot in (one, other):
        parts = [snapshot.hang_off_force_n]
        for rope in snapshot.ropes:
            parts += [rope.node_position_m, rope.node_tension_n]
            if rope.vibration is not None:
                parts += [rope.vibration.cross_flow, rope.vibration.drag_amplification]
        rows.append(np.concatenate([part.ravel() for part in parts]))
    return bool(len(rows[0]) == len(rows[1]) and (rows[0] == rows[1]).all())


TWO_CRANES = (
    HEAD + "ropes:\n"
    + line("port", "steel_wire_40mm", 90.0, 12, "to: ring")
    + line("starboard", "steel_wire_40mm", 90.0, 12, "from: stern, to: ring")
    + line("sling", "steel_wire_40mm", 60.0, 10, "from: ring, to: tool")
    + "joints: [{name: ring, mass_kg: 300.0}]\n"
    "hang_offs: [{name: stern, at_m: [-60.0, 0.0, 0.0]}]\n"
    "payloads:\n" + TOOL.format(name="tool", mass=5000.0)
)  # fmt: skip


def test_connected_ropes_vibrate_between_their_ends(tmp_path: Path) -> None:
    """Nodes of vibration at cranes and ring; amplified drag moves the tool further."""
    snapshot = run(TWO_CRANES + WATER.format(model=MODELS[0], speed=0.5), tmp_path, 60.0)
    for number in range(3):
        own = shaking(snapshot, number)
        assert len(own.cross_flow) == len(snapshot.ropes[number].node_position_m)
        assert own.cross_flow[0] == 0.0
        assert own.cross_flow.max() > 0.1, "it shakes"
        if number < 2:
            assert own.cross_flow[-1] < 1e-4, "and that by the stretch of a second"
    water = WATER.replace("{model}: {{}}", "{model}: {{drag_growth: [0.0, 0.65]}}")
    calm = run(TWO_CRANES + water.format(model=MODELS[0], speed=0.5), tmp_path, 60.0)
    assert shaking(calm, 2).drag_amplification.max() == 1.0
    east = [one.payloads[0].position_m[0] + 30.0 for one in (snapshot, calm)]
    assert east[0] > 1.2 * east[1] > 0.2


@pytest.mark.parametrize("model", [MODELS[1], *WAKES])
def test_a_system_with_viv_resumes_bit_identically(model: str, tmp_path: Path) -> None:
    """Restored and branched twins are bit-identical to the one that went on."""
    twin = CoreTwin(scene_of(hanging("ab", model), tmp_path))
    twin.advance(137)
    saved, branch = twin.capture(), twin.branch()
    restored = CoreTwin.restore(saved, twin.scene)
    for one in (twin, branch, restored):
        one.advance(210)
    snapshot = twin.snapshot()
    assert model not in MODELS or shaking(snapshot, 1).drag_amplification.max() > 1.1
    assert same(snapshot, branch.snapshot())
    assert same(snapshot, restored.snapshot())


def test_an_error_interval_does_not_change_the_viv_run(tmp_path: Path) -> None:
    """With an error interval all is bit-identical, and the interval is known."""
    snapshots = []
    for monitors in (NO_MONITORS, Monitors(error_interval=True)):
        twin = CoreTwin(scene_of(hanging("ab", MODELS[0]), tmp_path), monitors)
        for _ in range(40):
            twin.advance(25)
            snapshot = twin.snapshot()
        snapshots.append(snapshot)
    assert same(*snapshots)
    assert snapshots[1].error_interval is not None or snapshots[1].no_error_interval


def test_viv_of_the_remaining_ropes_after_a_cut(tmp_path: Path) -> None:
    """The other rope is unaffected; the fallen part has no VIV.

    The current is sheared: in a uniform one a change of the flow by the tolerance of the step,
    which the ropes of a system share, moves a whole rope over the edge of a mode's band.
    """
    text = hanging("ab", MODELS[0]).replace("[-300.0, [0.5,", "[-300.0, [0.1,")
    whole, cut = (CoreTwin(scene_of(text, tmp_path)) for _ in range(2))
    for twin in (whole, cut):
        twin.advance(500)
    assert not cut.submit_cut(None, 60.0, "b")
    for twin in (whole, cut):
        twin.advance(250)
    snapshot, other = cut.snapshot(), whole.snapshot()
    assert [rope.name for rope in snapshot.ropes] == ["a", "b", "b/lower"]
    assert shaking(snapshot) is snapshot.vibration
    assert shaking(snapshot).cross_flow == pytest.approx(shaking(other).cross_flow, abs=1e-6)
    left = shaking(snapshot, 1)
    assert len(left.cross_flow) == len(snapshot.ropes[1].node_position_m)
    assert left.cross_flow.max() > 0.1
    assert snapshot.ropes[2].vibration is None


@pytest.mark.parametrize("model", WAKES)
def test_wakes_survive_remeshing_and_cuts(model: str, tmp_path: Path) -> None:
    """A coarser mesh changes the tension little; the other rope of a cut one goes on as before.

    It does so but for the tolerance of the step, which the ropes of a system share.
    """
    twin = CoreTwin(scene_of(hanging("ab", model), tmp_path))
    twin.advance(500)
    coarse, cut = twin.branch(), twin.branch()
    coarse.set_level(AccuracyLevel(2 * twin.level.step_ns, 1))
    assert not cut.submit_cut(None, 60.0, "b")
    coarse.advance(1)
    for one in (twin, cut):
        one.advance(2)
    assert coarse.time_ns == twin.time_ns
    assert coarse.top_tension_n == pytest.approx(twin.top_tension_n, rel=1e-3)
    for one in (twin, cut):
        one.advance(48)
    assert len(coarse.snapshot().ropes[1].node_position_m) < 16
    snapshot, other = cut.snapshot(), twin.snapshot()
    assert [rope.name for rope in snapshot.ropes] == ["a", "b", "b/lower"]
    assert snapshot.ropes[0].node_position_m == pytest.approx(
        other.ropes[0].node_position_m, abs=1e-4
    )


@pytest.mark.parametrize("model", [MODELS[0], *WAKES])
def test_energy_balance_of_a_system_with_viv(model: str, tmp_path: Path) -> None:
    """With the drag that the vibration adds, which changes at every sampling."""
    twin = CoreTwin(scene_of(hanging("ab", model), tmp_path), Monitors(energy=True))
    twin.advance(1000)
    energy = twin.snapshot().energy
    assert energy is not None
    assert abs(energy.residual_j) < 2e-3 * energy.exchanged_j


@pytest.mark.parametrize("model", [MODELS[0], WAKES[0]])
def test_time_domain_viv_of_separate_ropes_is_independent(model: str, tmp_path: Path) -> None:
    """Motion, tension and drag of both wires, by a model outside the step and by one in it."""
    both = run_time_domain(scene_of(hanging("ab", model), tmp_path), 20.0, "stranded_wire")
    assert [one.line for one in both] == ["a", "b"]
    for own, name in zip(both, "ab", strict=True):
        text = hanging(name, model)
        (alone,) = run_time_domain(scene_of(text, tmp_path), 20.0, "stranded_wire")
        assert alone.rms[0].max() > 0.02, "it shakes"
        within = 0.05 * alone.rms[0].max()
        assert own.from_hang_off_m[-1] == pytest.approx(alone.from_hang_off_m[-1])
        assert own.rms[0] == pytest.approx(alone.rms[0], abs=within)
        assert own.tension_top_n.mean() == pytest.approx(alone.tension_top_n.mean(), rel=1e-3)
        assert own.drag_amplification == pytest.approx(alone.drag_amplification, rel=0.05)


@pytest.mark.long
def test_viv_over_a_sheave_is_reported_from_the_upper_end(tmp_path: Path) -> None:
    """The core counts from the sheave, the results do not."""
    scene = load_scene("two_line_loop")
    lines = run_time_domain(replace(scene, sea_state=SeaState()), 20.0, "stranded_wire")
    assert [one.line for one in lines] == [line.name for line in scene.ropes]
    for one in lines:
        assert (np.diff(one.from_hang_off_m) > 0.0).all()
        assert np.isfinite(one.rms[0]).all()
        if one.fatigue is not None:
            assert (np.diff(one.fatigue.from_hang_off_m) < 0.0).all()
