"""Members whose ropes share SIMD lanes, against twins of their own: equal to the bit.

However many there are, whatever each has of its own, and whatever happens to those beside it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lone_twins import SECOND_NS, alone, differing, sea, variations
from numba import errors
from small_scene import SMALL_SCENE, small_scene

import rope_twin.core.lanes.batch as batch_module
import rope_twin.twin.ensemble.ensemble as ensemble_module
import rope_twin.twin.ensemble.ensemble as lanes_module
from rope_twin import load_scene
from rope_twin.core.jit.decorators import OPTIONS, jit, jit_entry
from rope_twin.core.jit.rows import end_to_end
from rope_twin.core.jit.wide import ALL, LANES, mask_of, tiles, wide
from rope_twin.core.lanes.group import Group, aligned, kind_of, why_alone
from rope_twin.core.pentadiagonal import (
    eliminate_coupled,
    eliminate_coupled_wide,
    reduce_coupled,
    reduce_coupled_wide,
    take_links,
    take_links_wide,
)
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    COUPLED_ROWS,
    DIRECTION,
    GEOMETRIC,
    RESIDUAL,
    VELOCITY,
    WORK_ROWS,
    Rope,
)
from rope_twin.core.tridiagonal import (
    eliminate,
    eliminate_wide,
    reduce,
    reduce_wide,
    substitute_wide,
)
from rope_twin.effects.bed_friction import CARRIED, PlaneFriction
from rope_twin.effects.hull_contact import HullContact
from rope_twin.errors import InputError
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.ensemble import Ensemble, Variation
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.winch.commands import CommandSample, WinchCommand

TWO_SECTIONS = """\
    sections:
      - {rope: steel_wire_40mm, length_m: 93.0}
      - {rope: {diameter_m: 0.05, mass_kg_per_m: 9.0, hydrodynamic_diameter_m: 0.05,
         axial_stiffness_n: 80000000.0, breaking_load_n: 1500000.0}}
"""


def calm(number: int) -> Variation:
    """Return a member that stays in its lane, with its own load, rope, water, drag and sea."""
    changes = (
        Change("payloads[0].mass_kg", 8000.0 + 300.0 * number),
        Change("ropes[0].rope.axial_stiffness_n", 1.0 + 0.05 * number, multiply=True),
        Change("ropes[0].damping.fraction_of_first_axial_mode", 0.01 * number),
        Change("effects.current.profile[*][1][*]", 0.2 * number, multiply=True),
        Change("effects.current.profile[1][0]", -150.0 - 3.0 * number),
        Change("effects.drag.normal", 1.0 + 0.1 * number),
        Change("effects.added_mass.normal", 1.0 - 0.03 * number),
    )
    heave = HeaveSeries.of(sea(0.8, 6.0 + 0.3 * number, 30.0))
    return Variation(changes, heave.starting_at(number * SECOND_NS // 3))


def paying(number: int) -> Variation:
    """Return a member whose winch pays out and hauls in: splits and merges."""
    speed = 1.5 - 0.1 * (number % 3)
    commands = tuple(
        CommandSample(k * SECOND_NS, WinchCommand(SPEED, v)) for k, v in ((0, speed), (9, -speed))
    )
    return Variation(heave=HeaveSeries.of(sea(1.0, 8.0, 40.0)), commands=commands)


def snapping(number: int) -> Variation:
    """Return a member with a light load in high waves: snaps, line searches, halved steps."""
    light = Change("payloads[0].mass_kg", 1700.0 + 100.0 * number)
    return Variation((light,), HeaveSeries.of(sea(4.0, 4.5 + 0.2 * number, 30.0)))


def unequal(scene: Scene, ensemble: Ensemble, members: list[Variation], seconds: int) -> list[str]:
    """Return the values that differ from those of single twins, with the member."""
    return [
        f"member {number}: {name}"
        for number, variation in enumerate(members)
        for name in differing(ensemble.snapshot(number), alone(scene, variation, seconds))
    ]


def one_of_three(
    k: int, changes: tuple[Change, ...], snapping_m: float, speed: float, turn_s: int
) -> Variation:
    """Return a member that is calm, pays out and hauls in from `turn_s` on, or snaps."""
    heave = HeaveSeries.of(sea((0.5, 1.0, snapping_m)[k % 3], 6.0 + 0.3 * k, 30.0))
    winch_speed = speed if k % 3 == 1 else 0.0
    orders = ((0, winch_speed), (turn_s, -winch_speed))
    commands = (CommandSample(at * SECOND_NS, WinchCommand(SPEED, v)) for at, v in orders)
    return Variation(changes, heave.starting_at(k * SECOND_NS // 3), tuple(commands))


def stepped_as_alone(scene: Scene, members: list[Variation], seconds: int) -> Ensemble:
    """Step members in lanes and assert that they equal single twins."""
    ensemble = Ensemble(scene, members, threads=1)
    assert ensemble.lanes().members == LANES
    for some in (1, seconds - 1):
        ensemble.advance(some)
    assert not unequal(scene, ensemble, members, seconds)
    snapshots = [ensemble.snapshot(number).solver for number in range(LANES)]
    assert snapshots[1].splits > 0
    assert any(snapshot.solves_max_per_stage > 4 for snapshot in snapshots[2::3])
    lanes = ensemble.lanes()
    assert lanes.given_up < 0.2 * lanes.steps
    return ensemble


@pytest.mark.parametrize("members", [1, LANES - 1, LANES, LANES + 1, 2 * LANES + 5])
def test_any_number_of_members(
    tmp_path: Path, members: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Full groups, groups with spare lanes, and too few members for a group."""
    groups: list[int] = []
    begin = Group.begin

    def counted(self: Group, ropes: list, boundaries: list) -> None:
        groups.append(len(ropes))
        begin(self, ropes, boundaries)

    monkeypatch.setattr(Group, "begin", counted)
    scene = small_scene(tmp_path)
    variants = [calm(number) for number in range(members)]
    ensemble = Ensemble(scene, variants, threads=1)
    ensemble.advance(4)
    assert not unequal(scene, ensemble, variants, 4)
    lanes = ensemble.lanes()
    assert lanes.steps + lanes.given_up == 400 * lanes.members
    assert lanes.given_up <= 0.01 * lanes.steps
    rest = members % LANES
    expected = [LANES] * (members // LANES) + [rest] * (rest >= lanes_module.MIN_GROUP)
    assert groups == (expected if members >= LANES else [])


@pytest.mark.long
def test_fixed_lower_ends_in_a_vertical_current_in_lanes(tmp_path: Path) -> None:
    """Its node stands in every lane where it is held, so that no step is given up.

    The currents well up, each by its own rows: both in one step.
    """
    path, (head, tail) = tmp_path / "held.yaml", SMALL_SCENE.split("payloads:")
    text = head.replace("to: tool", "fixed_at_m: [60.0, 20.0, -185.0]")
    tail = tail.replace("[0.1, 0.3]]", "[0.1, 0.3, 0.2]]")
    assert "0.2]]" in tail
    path.write_text(text + tail[tail.index("winch:") :].replace("  - payload: {}\n", ""))
    scene = load_scene(path)
    members = [
        Variation(
            tuple(change for change in calm(k).changes if "payload" not in change.path),
            HeaveSeries.of(sea(0.1, 6.0 + 0.3 * k, 30.0)),
        )
        for k in range(LANES)
    ]
    ensemble = Ensemble(scene, members, threads=1)
    ensemble.advance(4)
    assert not unequal(scene, ensemble, members, 4)
    lanes = ensemble.lanes()
    assert lanes.steps + lanes.given_up == 400 * LANES
    assert lanes.given_up <= 0.01 * lanes.steps


def test_members_with_equal_payout_stay_in_lanes(tmp_path: Path) -> None:
    """Their elements split at the same steps; the whole group goes on with one more."""
    scene = small_scene(tmp_path)
    members = [Variation(heave=calm(k).heave, commands=paying(0).commands) for k in range(LANES)]
    ensemble = Ensemble(scene, members, threads=1)
    ensemble.advance(14)
    assert not unequal(scene, ensemble, members, 14)
    splits = ensemble.snapshot(0).solver.splits
    assert splits
    lanes = ensemble.lanes()
    assert lanes.steps + lanes.given_up == 1400 * LANES
    assert lanes.given_up <= (splits + 1 + 14) * LANES


def test_lanes_are_compiled_before_the_first_turn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time of the first turn is that of its steps."""
    asked: list[object] = []
    compiled = batch_module.compiled
    monkeypatch.setattr(batch_module, "_COMPILED", {})
    monkeypatch.setattr(
        batch_module, "compiled", lambda *given: asked.append(given) or compiled(*given)
    )
    ensemble = Ensemble(small_scene(tmp_path), [calm(number) for number in range(LANES)])
    ensemble.make_ready()
    assert len(asked) == 1
    ensemble.advance(0.5)
    assert len(asked) == 1


def test_splits_slack_and_calm_members_in_one_group(tmp_path: Path) -> None:
    """In any call pattern."""
    scene = small_scene(tmp_path)
    kinds = (calm, paying, snapping)
    members = [kinds[number % 3](number) for number in range(2 * LANES)]
    ensemble = Ensemble(scene, members, slack_interval_s=0.07)
    for seconds in (1, 15, 8):
        ensemble.advance(seconds)
    assert not unequal(scene, ensemble, members, 24)
    snapshots = [ensemble.snapshot(number).solver for number in range(len(members))]
    assert snapshots[1].splits > 0
    assert snapshots[1].merges > 0
    assert snapshots[2].solves > 1.1 * snapshots[0].solves
    assert any(snapshot.solves_max_per_stage > 4 for snapshot in snapshots[2::3])


def test_figures_do_not_depend_on_lanes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Extremes, means and sampled values equal those of members that step alone."""
    scene = small_scene(tmp_path)
    members = [snapping(number) for number in range(LANES)] + [paying(1)]
    together = Ensemble(scene, members, slack_interval_s=0.07)
    together.advance(6)
    monkeypatch.setattr(lanes_module, "MIN_GROUP", LANES + 1)
    lone = Ensemble(scene, members, slack_interval_s=0.07)
    lone.advance(6)
    assert together.figures() == lone.figures()
    assert any(0.0 < figures.slack_share < 1.0 for figures in together.figures())


@settings(max_examples=6, deadline=None)
@given(members=st.lists(variations(), min_size=2, max_size=5), cut=st.integers(1, 9))
def test_random_members_in_lanes(
    tmp_path_factory: pytest.TempPathFactory, members: list[Variation], cut: int
) -> None:
    """Each next to one like it at least, so that all are in lanes."""
    scene = small_scene(tmp_path_factory.mktemp("scene"))
    members = [*members, *members]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ensemble_module, "MIN_MEMBERS", 1)
        patch.setattr(lanes_module, "MIN_GROUP", 1)
        ensemble = Ensemble(scene, members, slack_interval_s=0.07, threads=2)
        assert ensemble.lanes().members == len(members)
        ensemble.advance(cut)
        ensemble.advance(10 - cut)
    assert not unequal(scene, ensemble, members, 10)


def test_a_failing_member_does_not_change_its_neighbours(tmp_path: Path) -> None:
    """Its state is kept, it reports when it stopped, and the others are bit-identical."""
    scene = small_scene(tmp_path)
    members = [calm(number) for number in range(LANES)]
    ensemble = Ensemble(scene, members, threads=1)
    ensemble.advance(1)
    ensemble._members[3].rope.state.nodes[VELOCITY, 5] = np.inf
    ensemble.advance(2)
    reported = [figures.failure for figures in ensemble.figures()]
    assert reported[3].startswith("step 101 at 1.00 s: the rope's next state is not finite")
    assert ensemble.snapshot(3).step == 100
    for number in set(range(LANES)) - {3}:
        assert not reported[number]
        found, expected = ensemble.snapshot(number), alone(scene, members[number], 3)
        assert not differing(found, expected)


def test_rope_sections_in_lanes(tmp_path: Path) -> None:
    """A junction of sections passes the sheave in some members and not in others."""
    path = tmp_path / "two.yaml"
    text = SMALL_SCENE.replace("    rope: steel_wire_40mm\n", TWO_SECTIONS)
    path.write_text(text.replace("length_m: 200.0", "length_m: 95.0"))
    scene = load_scene(path)
    members = [(paying if number % 2 else calm)(number) for number in range(LANES)]
    members = [Variation((), one.heave, one.commands) for one in members]
    ensemble = Ensemble(scene, members)
    for seconds in (1, 15, 8):
        ensemble.advance(seconds)
    assert not unequal(scene, ensemble, members, 24)
    assert all(ensemble.snapshot(number).solver.splits for number in range(1, LANES, 2))
    assert ensemble.lanes().given_up > 0


@pytest.mark.long
def test_bent_ropes_in_lanes(tmp_path: Path) -> None:
    """A stiff rope that sheds vortices, with a clamp: calm, paid out and in, and snapping ones."""
    path = tmp_path / "bent.yaml"
    bent = "  - bending: {stiffness_n_m2: 2.0e+5, clamped_along: [0.1, 0.0, -1.0]}\n"
    bent += "  - strouhal_forcing: {}\n"
    path.write_text(SMALL_SCENE.replace("  - payload: {}\n", bent + "  - payload: {}\n"))
    scene = load_scene(path)
    members = [(calm, paying, snapping)[number % 3](number) for number in range(LANES)]
    ensemble = Ensemble(scene, members, threads=1)
    for seconds in (1, 13):
        ensemble.advance(seconds)
    assert not unequal(scene, ensemble, members, 14)
    snapshots = [ensemble.snapshot(number).solver for number in range(len(members))]
    assert snapshots[1].splits > 0
    assert any(snapshot.solves_max_per_stage > 4 for snapshot in snapshots[2::3])
    lanes = ensemble.lanes()
    assert lanes.steps > lanes.given_up


@pytest.mark.parametrize("by_half_waves", ["true", "false"])
@pytest.mark.long
def test_stick_slip_friction_in_lanes(tmp_path: Path, by_half_waves: str) -> None:
    """They lie below ropes that shed vortices: calm, paid out and in, and snapping ones."""
    text = load_scene("chain_on_bottom").path.read_text()
    effects = "bed_friction: {axial: 0.3, lateral: 0.6}\n"
    effects += f"  - travelling_waves: {{by_half_waves: {by_half_waves}}}"
    path = tmp_path / "lying.yaml"
    path.write_text(text.replace("bed_friction: {}", effects))
    scene, members = load_scene(path), []
    for k in range(LANES):
        changes = (
            Change("effects.bed_friction.slip_m", 1e-3 * (k + 1)),
            Change("effects.current.profile[*][1][*]", 0.5 + 0.3 * k, multiply=True),
        )
        members.append(one_of_three(k, changes, 5.0, 0.5, 10))
    ensemble = stepped_as_alone(scene, members, 13)
    slid = np.array([_share_of_slip(member.rope, PlaneFriction) for member in ensemble._members])
    assert (slid > 0.0).all()
    assert slid.max() > 0.999 > slid.min()


def _share_of_slip(rope: Rope, kind: type) -> float:
    """Return the largest displacement along the bed or hull over the slip distance."""
    (rub,) = (effect for effect in rope.effects if isinstance(effect, kind))
    dragged = rub.memory[:CARRIED]
    return float(np.sqrt((dragged * dragged).sum(axis=0)).max() / rub.slip)


@pytest.mark.long
@pytest.mark.parametrize("heading", ["", ", heading_deg: 70.0"])
def test_hull_contact_and_nets_in_lanes(tmp_path: Path, heading: str) -> None:
    """They stick to walls and slide there, nets trail or are held: calm, moving, snapping ones."""
    text = load_scene("moonpool_lift").path.read_text()
    net = f"net_curtain: {{to_m: 30.0, width_m: 2.0, twine_m: 0.003, bar_m: 0.03{heading}}}"
    path = tmp_path / "nets.yaml"
    path.write_text(text.replace("payload: {}", f"payload: {{}}\n  - {net}"))
    scene, members = load_scene(path), []
    for k in range(LANES):
        changes = (
            Change("effects.hull_contact.slip_m", 2e-3 * (k + 1)),
            Change("effects.hull_contact.payload_stiffness_n_per_m", 1e5 * (k + 1)),
            Change("effects.net_curtain.from_m", 2.0 * k),
            Change("effects.current.profile[*][1][*]", 0.7 + 0.1 * k, multiply=True),
        )
        members.append(one_of_three(k, changes, 9.0, 1.0, 5))
    ensemble = stepped_as_alone(scene, members, 9)
    slid = np.array([_share_of_slip(member.rope, HullContact) for member in ensemble._members])
    assert slid.max() > 0.999
    assert ((slid > 0.0) & (slid < 0.999)).any()


@pytest.mark.long
def test_heave_compensators_in_lanes() -> None:
    """Units between their stops and at them, driven and sticking, while rope is paid out."""
    few = Change("ropes[0].elements", 20)
    scene = change_scene(load_scene("active_over_passive_lift"), (few,))
    commands = (CommandSample(0, WinchCommand(SPEED, 1.0)),)
    members = [
        Variation(
            (Change("payloads[0].mass_kg", 1.0 + 0.02 * k, multiply=True),
             Change("effects.compensator.exponent", 1.0 + 0.05 * k)),
            HeaveSeries.of(sea(0.5 + 0.6 * k, 7.0 + 0.4 * k, 30.0)), commands,
        )
        for k in range(LANES)
    ]  # fmt: skip
    ensemble = Ensemble(scene, members, threads=1)
    for seconds in (1, 13):
        ensemble.advance(seconds)
    assert not unequal(scene, ensemble, members, 14)
    strokes = [ensemble.snapshot(k).compensator.stroke_m for k in range(LANES)]
    assert len(set(strokes)) == LANES
    lanes = ensemble.lanes()
    assert lanes.members == LANES
    assert lanes.given_up < 0.2 * lanes.steps


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("deep_lift", ""),
        ("hybrid_lift", ""),
        ("polyester_lift", ""),
        ("riser_300m", ""),
        ("curved_pipe", ""),
        ("wave_zone", ""),
        ("landing", ""),
        ("lift_off", ""),
        ("manifold_lift", ""),
        ("chain_on_bottom", ""),
        ("cable_waves", ""),
        ("moonpool_lift", ""),
        ("net_curtain", ""),
        ("vortices_modal", "drag_amplification"),
    ],
)
def test_modal_viv_is_not_stepped_in_lanes(name: str, reason: str) -> None:
    """Ropes whose drag is set after the step."""
    rope = build(load_scene(name))
    assert why_alone(rope) == reason
    assert (kind_of(rope) is None) == bool(reason)


def test_members_of_two_sizes_form_two_groups(tmp_path: Path) -> None:
    """One group is full; too few of either kind are left for another one."""
    few = lanes_module.MIN_GROUP - 1
    small = (Change("ropes[0].elements", 10),)
    members = [Variation()] * (LANES + few) + [Variation(small)] * few
    reported = Ensemble(small_scene(tmp_path), members).lanes()
    assert reported.members == LANES
    assert reported.alone == {"": 2 * few}
    with pytest.raises(InputError, match=f"{LANES + 1} ropes in one step; give .*, 1 to {LANES}"):
        Ensemble(small_scene(tmp_path), members, max_lanes=LANES + 1)


def test_a_branch_on_a_wide_number_does_not_compile() -> None:
    """An effect that branches must not be taken for one that works in lanes."""

    @numba.njit(**OPTIONS)
    def branching(array: np.ndarray) -> float:
        return 1.0 if wide(array) > 0.0 else 2.0

    with pytest.raises(errors.NumbaError, match=r"bool\(Mask\)"):
        branching(np.ones(LANES))


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("n", [7, 8])
def test_elimination_in_lanes_equals_that_of_one_rope(first: int, n: int) -> None:
    """With a free and with a fixed lower end, an odd and an even number of nodes, in every lane."""
    random = np.random.default_rng(n)
    work = aligned(n + 1, WORK_ROWS, LANES)
    work[:, DIRECTION : DIRECTION + 3] = random.normal(size=(n + 1, 3, LANES))
    work[:, AXIAL] = 900.0 * random.random((n + 1, LANES))
    work[:, GEOMETRIC] = random.random((n + 1, LANES))
    work[:, BLOCK : BLOCK + 6] = random.normal(size=(n + 1, 6, LANES))
    work[:, [BLOCK, BLOCK + 3, BLOCK + 5]] += 130.0
    work[:, RESIDUAL : RESIDUAL + 3] = random.normal(size=(n + 1, 3, LANES))
    lone = np.ascontiguousarray(work.transpose(2, 1, 0))
    other = random.normal(size=work.shape)
    corrections = slice(CORRECTION, CORRECTION + 3)
    for moved in (ALL, 0b00101101):  # factors of all lanes, then new ones of some
        eliminate_many(work, first, n, moved)
        for lane in range(LANES):
            if moved >> lane & 1:
                eliminate_one(lone[lane], first, n)
                assert np.array_equal(work[:, corrections, lane].T, lone[lane, corrections])
        work[:, RESIDUAL : RESIDUAL + 3] = other[:, :3]
        work[:, [BLOCK, BLOCK + 3, BLOCK + 5]] += abs(other[:, 3:6])
        lone[:, RESIDUAL : RESIDUAL + 3] = work[:, RESIDUAL : RESIDUAL + 3].transpose(2, 1, 0)
        lone[:, BLOCK : BLOCK + 6] = work[:, BLOCK : BLOCK + 6].transpose(2, 1, 0)
        push_many(work, first, n)
        for lane in range(LANES):
            push_one(lone[lane], first, n)
            assert np.array_equal(work[:, corrections, lane].T, lone[lane, corrections])


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("n", [2, 3, 7, 8])
def test_elimination_of_bent_ropes_in_lanes_equals_that_of_one(first: int, n: int) -> None:
    """Nodes that are coupled with the next two; their effect on the residual in some lanes only."""
    random = np.random.default_rng(n)
    work = aligned(n + 1, COUPLED_ROWS, LANES)
    work[:] = random.normal(size=work.shape)
    work[:, [AXIAL, GEOMETRIC]] = 900.0 * random.random((n + 1, 2, LANES))
    work[:, [BLOCK, BLOCK + 3, BLOCK + 5]] += 4000.0
    lone = np.ascontiguousarray(work.transpose(2, 1, 0))
    corrections, forces = slice(CORRECTION, CORRECTION + 3), slice(RESIDUAL, RESIDUAL + 3)
    for moved in (ALL, 0b00101101):  # factors of all lanes, then new ones of some
        eliminate_bent(work, first, n, moved)
        for lane in range(LANES):
            if moved >> lane & 1:
                eliminate_bent_one(lone[lane], first, n)
                assert np.array_equal(work[:, corrections, lane].T, lone[lane, corrections])
        work[:, forces] = random.normal(size=(n + 1, 3, LANES))
        lone[:, forces] = work[:, forces].transpose(2, 1, 0)
        before = work[:, forces].copy()
        push_bent(work, first, n, moved)
        for lane in range(LANES):
            push_bent_one(lone[lane], first, n)
            assert np.array_equal(work[:, corrections, lane].T, lone[lane, corrections])
            left = lone[lane, forces].T if moved >> lane & 1 else before[:, :, lane]
            assert np.array_equal(work[:n, forces, lane], left[:n])


@jit_entry
def eliminate_bent(work: Any, first: int, n: int, moved: int) -> None:
    """The solve of all lanes with coupled nodes; some get new factors."""
    eliminate_coupled_wide(tiles(work, COUPLED_ROWS), first, n, mask_of(moved))


@jit_entry
def push_bent(work: Any, first: int, n: int, tried: int) -> None:
    """For another residual, from which the effect of the couplings is subtracted in some lanes."""
    reduce_coupled_wide(tiles(work, COUPLED_ROWS), first, n)
    take_links_wide(tiles(work, COUPLED_ROWS), n, mask_of(tried))


@jit_entry
def eliminate_bent_one(work: Any, first: int, n: int) -> None:
    """Solve one rope with coupled nodes."""
    eliminate_coupled(end_to_end(work), first, n)


@jit_entry
def push_bent_one(work: Any, first: int, n: int) -> None:
    """Solve one bent rope for another residual; return the effect of its couplings."""
    reduce_coupled(end_to_end(work), first, n)
    take_links(work, n)


@jit_entry
def eliminate_many(work: Any, first: int, n: int, moved: int) -> None:
    """The solve of all lanes; some get new factors."""
    eliminate_wide(tiles(work, WORK_ROWS), first, n, mask_of(moved))
    _substitute_many(work, first, n)


@jit_entry
def push_many(work: Any, first: int, n: int) -> None:
    """For another residual, by the factors of each lane."""
    reduce_wide(tiles(work, WORK_ROWS), first, n)
    _substitute_many(work, first, n)


@jit
def _substitute_many(work: Any, first: int, n: int) -> None:
    pairs = (n - first - 1) // 2
    substitute_wide(tiles(work, WORK_ROWS), first, n, pairs // 2, pairs)
    substitute_wide(tiles(work, WORK_ROWS), first, n, 0, pairs // 2)


@jit_entry
def eliminate_one(work: Any, first: int, n: int) -> None:
    """Solve one rope."""
    eliminate(work, first, n)


@jit_entry
def push_one(work: Any, first: int, n: int) -> None:
    """Solve one rope for another residual."""
    reduce(work, first, n)
