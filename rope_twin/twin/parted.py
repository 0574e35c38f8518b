"""Rope in two parts after a cut; the falling part is stepped together with the first rope.

The first rope is the part that still hangs; the two do not interact. The payload at the rope's
lower end is now at that of the lower part; both are in the same water.

The release travels up and down from the cut through elements that go slack behind it, the first of
them in less than a step. The first step is therefore taken in substeps that double, from 1/256 of
it on: a single step would gain energy, up to 2 % of the elastic energy (20 m elements, 10 ms).

In a multi-line system the lower part is an additional rope. Its upper end is a connection with no
other rope, so that it moves freely; the connection or payload at the rope's lower end is now at
that of the lower part. The upper part keeps its upper end and has nothing at its lower end. All are
advanced in one step, whether the part below the cut is still held by other ropes or falls freely.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.energy import Power, Store, SystemBorder, measure
from rope_twin.core.joined.joints import LOOSE, System, new_system
from rope_twin.core.loads.balance import lower_end_tension
from rope_twin.core.state import Boundary, Floats, Rope, State
from rope_twin.core.step import advance, advance_joined
from rope_twin.errors import SolverError
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.twin.contact import seabed_contact
from rope_twin.twin.motion.hang_off import Moves
from rope_twin.twin.regrid import has_state, state_arrays
from rope_twin.twin.rope_cut import (
    INSTANT_S,
    CutPosition,
    Nodes,
    falling_part,
    inserted_nodes,
    is_at_end,
    nodes_of,
    refresh_tension,
    step_free,
    upper_part,
    without_load,
    without_massless_section,
)
from rope_twin.twin.snapshot import (
    BedContact,
    PayloadShot,
    RopeShot,
    Snapshot,
    SolverHealth,
    first_rope,
)
from rope_twin.twin.snapshot_builder import RopeShape, shape_from_top
from rope_twin.twin.state import changing_parts
from rope_twin.twin.winch.commands import WinchCommand

_A = slice(rows.ACCELERATION, rows.ACCELERATION + 3)


class SingleWinch:
    """Methods of `Ropes` about further winches and ropes, for a single rope, whole or cut."""

    def offer(self, name: str, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> str:
        """Raise RuntimeError, as there is no other winch."""
        raise RuntimeError(f"there is no winch {name}")

    def forbids(self, name: str, switch: str) -> str:
        """Raise RuntimeError, as there is no other winch."""
        raise RuntimeError(f"there is no winch {name}")

    def follow(self, name: str, stamp_ns: int, length_m: float, speed: float | None) -> None:
        """Raise RuntimeError, as there is no other winch."""
        raise RuntimeError(f"there is no winch {name}")

    def invalidate(self) -> None:
        """Do nothing, as there is no other winch."""

    def newest_ns(self) -> dict[str, int]:
        """Return no stamps, as there is no other winch."""
        return {}

    def scale(self, factors: Mapping[str, float]) -> None:
        """Do nothing, as there is no other rope; a cut one keeps its figures."""

    def needs_feedback(self, time_ns: int) -> bool:
        """Return False, as there is no other winch."""
        return False

    def prescribe(
        self, row: int, from_ns: int, step_s: float, heave: tuple[float, float], moves: Moves
    ) -> None:
        """Do nothing, as there is no other hang-off."""

    def length_m(self, r: int) -> float:
        """Raise RuntimeError, as there is no other rope."""
        raise RuntimeError(f"there is no rope {r}: this scene has one")

    def adapt_to_cut(self, r: int, lost_m: float, left_m: float) -> None:
        """Raise RuntimeError, as there is no other rope."""
        raise RuntimeError(f"there is no rope {r}: this scene has one")

    def discard_prescribed(self) -> None:
        """Do nothing, as there is no other hang-off."""

    def border(self, first: Boundary) -> Boundary:
        """Return hang-off and paid-out length of the single rope, (1, MOTIONS)."""
        return Boundary(*(table[:1].copy() for table in first))

    def forget(self, done: int, prescribed: int) -> None:
        """Do nothing, as there are no other boundary conditions."""


_WHOLE = (0.0, 1.0)
SUBSTEPS = (0.0, *(0.5**k for k in range(8, -1, -1)))  # fractions of a step


class CutRope(SingleWinch):
    """Both parts of a cut rope."""

    def __init__(self, scene: Scene, first: Rope, lower: Rope) -> None:
        """Take both parts; lower: as `sever` returns it, with the effects of the whole rope."""
        self.first = first
        self._scene, self._lower = scene, lower
        self._kept, self._kept_lower = first.state.copy(), lower.state.copy()
        self._fresh = True  # no step since the cut
        self._unconverged = 0  # unconverged substeps of the lower part at the last snapshot

    def solve_statics(self) -> Floats:
        """Raise RuntimeError, as a cut rope does not start in equilibrium."""
        raise RuntimeError("a rope is cut on the way, not at the start")

    def cut(self, first: Rope, border: Boundary, place: CutPosition) -> tuple[CutRope, float]:
        """Raise RuntimeError, as a rope can be cut once only."""
        raise RuntimeError("the rope is cut already")

    def replace(self, ropes: Sequence[Rope]) -> None:
        """Raise RuntimeError, as the parts of a cut rope keep their elements."""
        raise RuntimeError("the parts of a cut rope keep their elements")

    def advance(self, first: Rope, boundary: Boundary, time: float, pulls: Floats) -> int:
        """Advance both parts step by step; neither continues without the other."""
        self.first = first
        self._share_water(first)
        for row in range(len(pulls)):
            now = time + row * first.model.step
            own = Boundary(*(table[row : row + 2] for table in boundary))
            if not self._step_both(first, own, now, pulls[row]):
                return row
        return len(pulls)

    def _step_both(self, first: Rope, border: Boundary, time: float, pull: Floats) -> bool:
        """Advance both by a step, the first in doubling substeps; False: both are unchanged."""
        both = ((self._kept, first.state), (self._kept_lower, self._lower.state))
        for kept, state in both:
            _copy(state, kept)
        carried = state_arrays(first.effects + self._lower.effects)
        carried_then = [one.copy() for one in carried]
        h, lower = first.model.step, self._lower
        parts = SUBSTEPS if self._fresh else _WHOLE
        value, rate = boundary_at(border, parts, h)
        pulls = np.zeros((1, rows.PULL_COLUMNS))
        for k, (begin, end) in enumerate(pairwise(parts)):
            now, piece = time + begin * h, (end - begin) * h
            some = Boundary(value[k : k + 2], rate[k : k + 2])
            upper = first._replace(model=first.model._replace(step=piece))
            falling = lower._replace(model=lower.model._replace(step=piece))
            if not step_free(falling, now) or advance(upper, some, pulls, now, 1) < 1:
                for kept, state in both:
                    _copy(kept, state)
                for one, then in zip(carried, carried_then, strict=True):
                    one[...] = then
                refresh_tension(first, float(border.rate[0, rows.LINE]))
                refresh_tension(lower, 0.0)
                return False
        for _, state in both:  # substeps of the first step count as one step
            state.health[rows.STEPS] -= len(parts) - 2
        self._fresh, pull[:] = False, pulls[0]
        return True

    def complete(self, shot: Snapshot, now_ns: int, effects: tuple[Any, ...]) -> Snapshot:
        """Complete the first rope's snapshot with both parts and the payload of the lower one."""
        lower = without_massless_section(self._lower)
        part = self._shot(lower, lower_end_tension(lower, effects, now_ns * 1e-9))
        unconverged = int(lower.state.health[rows.SUBSTEPS_UNCONVERGED])
        doubtful = shot.doubtful or unconverged > self._unconverged
        self._unconverged = unconverged
        x, v = (lower.state.nodes[k : k + 3, 0].copy() for k in (rows.POSITION, rows.VELOCITY))
        if shot.body is not None:  # the values are those of the lower part already
            x, v = shot.payload_position_m, shot.payload_velocity_m_per_s
        return replace(
            shot,
            tension_payload_n=float(part.node_tension_n[-1]),
            payload_position_m=x,
            payload_velocity_m_per_s=v,
            ropes=(first_rope(shot, self._scene.ropes[0].name), part),
            payloads=tuple(PayloadShot(one.name, x, v) for one in self._scene.payloads),
            seabed=self._contact(lower),
            solver=_both(shot.solver, lower.state.health),
            doubtful=doubtful,
        )

    def shapes(self, first: Rope, shot: Snapshot) -> tuple[RopeShape, ...]:
        """Return the shapes of both parts."""
        line, (upper, lower) = self._scene.ropes[0], shot.ropes
        fallen = without_massless_section(self._lower)
        return shape_from_top(line, first, upper), shape_from_top(line, fallen, lower, loose=True)

    def changing(self) -> dict[str, Any]:
        """Return the state of the lower part that a restart needs, by name."""
        parts = {name: getattr(self._lower, name) for name in changing_parts(self._lower)}
        kept: dict[str, Any] = {f"lower/{name}": part for name, part in parts.items()}
        kept["lower/model"], kept["rope/model"] = self._lower.model, self.first.model
        kept["lower/effects"], kept["lower/fresh"] = self._lower.effects, self._fresh
        kept["lower/tension"] = self._tension
        return kept

    def take_back(self, values: dict[str, Any], first: Rope) -> None:
        """Remove from `values` what `changing` gave and restore it; first: the first rope now."""
        names = (*changing_parts(self._lower), "model", "effects")
        parts = {name: values.pop(f"lower/{name}") for name in names}
        self.first, self._lower = first, self._lower._replace(**parts)
        self._tension[:] = values.pop("lower/tension")
        self._fresh = values.pop("lower/fresh")

    def lowest(self, first: Rope) -> Rope:
        """Return the lower part, which has the payload."""
        return self._lower

    def measure(self, first: Rope, pull: Floats, speed: float, time: float) -> SystemBorder:
        """Return energy and power of both parts; pull [N], speed [m/s]: of the upper one."""
        self._share_water(first)
        with np.errstate(divide="ignore"):  # the node beyond the free end has zero diameter
            low = measure(self._lower, np.zeros(3), time, 0.0)
        high = measure(first, pull[rows.PULL_X : rows.PULL_Z + 1], time, speed)
        return SystemBorder(
            Store(*(a + b for a, b in zip(low.store, high.store, strict=True))),
            Power(*(a + b for a, b in zip(low.power, high.power, strict=True))),
            (low.elements, high.elements),
            0.0,
        )

    @property
    def _tension(self) -> Floats:
        """Tension of the lower part's elements [N], a view of the scratch array."""
        return self._lower.work[rows.TENSION, : self._lower.state.counts[rows.ELEMENTS]]

    def _share_water(self, first: Rope) -> None:
        """Take over the first rope's effects, except those with own load or internal variables."""
        shared = tuple(
            own if is_at_end(own) or has_state(own) else live
            for own, live in zip(self._lower.effects, first.effects, strict=True)
        )
        if any(own is not now for own, now in zip(self._lower.effects, shared, strict=True)):
            self._lower = self._lower._replace(effects=shared)

    def _shot(self, lower: Rope, lower_n: float) -> RopeShot:
        n = int(lower.state.counts[rows.ELEMENTS])
        tension = lower.work[rows.TENSION, :n][::-1].copy()
        between = 0.5 * (tension[1:] + tension[:-1])
        places = lower.state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1]
        return RopeShot(
            name=f"{self._scene.ropes[0].name}/lower",
            node_position_m=np.ascontiguousarray(places[:, ::-1].T),
            node_tension_n=np.concatenate([[0.0], between, [lower_n]]),
            element_tension_n=tension,
            tension_top_n=0.0,
            line_out_m=float(lower.state.s[n]),
            payout_speed_m_per_s=0.0,
        )

    def _contact(self, lower: Rope) -> BedContact | None:
        """Return the seabed contact of both parts; the payload is that of the lower one."""
        high, low, all_of_it = (seabed_contact(rope) for rope in (self.first, lower, self._lower))
        if high is None or low is None or all_of_it is None:
            return None
        return replace(
            low,
            rope_on_bed_m=low.rope_on_bed_m + high.rope_on_bed_m,
            rope_push_n=all_of_it.rope_push_n + high.rope_push_n,  # including the free end
        )


def _copy(source: State, target: State) -> None:
    for mine, other in zip(target, source, strict=True):
        mine[...] = other


def boundary_at(border: Boundary, parts: tuple[float, ...], h: float) -> tuple[Floats, Floats]:
    """Prescribed motion at these fractions of a step, by the cubic of `core.payout`."""
    if len(parts) == 2:
        return border.value, border.rate
    u = np.array(parts)[:, None]
    (y0, y1), (d0, d1) = border.value, border.rate * h
    c2, c3 = 3.0 * (y1 - y0) - 2.0 * d0 - d1, 2.0 * (y0 - y1) + d0 + d1
    value = y0 + u * (d0 + u * (c2 + u * c3))
    rate = (d0 + u * (2.0 * c2 + u * 3.0 * c3)) / h
    value[-1], rate[-1] = border.value[1], border.rate[1]
    return value, rate


def _both(upper: SolverHealth, lower: Any) -> SolverHealth:
    """Return the counts of both parts; steps are the same."""
    return upper._replace(
        solves=upper.solves + int(lower[rows.SOLVES]),
        solves_max_per_stage=max(upper.solves_max_per_stage, int(lower[rows.SOLVES_MAX])),
        substeps=upper.substeps + int(lower[rows.SUBSTEPS]),
        substeps_max_per_step=max(upper.substeps_max_per_step, int(lower[rows.SUBSTEPS_MAX])),
        rejected_substeps=upper.rejected_substeps + int(lower[rows.REJECTED]),
        unconverged_substeps=upper.unconverged_substeps + int(lower[rows.SUBSTEPS_UNCONVERGED]),
    )


class CutSystem(NamedTuple):
    """Multi-line system with one rope cut in two; the lower part is the last rope."""

    system: System
    lost_m: float  # unstretched length of the lower part


def cut_system(system: System, border: Boundary, place: CutPosition) -> CutSystem:
    """Cut a rope of a system without sheaves; the argument is unchanged.

    border: of all ropes, (ropes, 1, MOTIONS).

    Raises:
        SolverError: the forces at a new end are not finite.
    """
    r, joints = place.rope, system.joints
    whole = system.ropes[r]
    at_ship = bool(joints.upper[r] == LOOSE)
    nodes, k = nodes_of(
        whole, float(border.rate[r, 0, rows.LINE]) if at_ship else 0.0
    ).with_node_at(place.at_m)
    lost = float(nodes.s[k])
    for above in inserted_nodes(nodes.s[k:] - lost, place.least_m) if at_ship else ():
        nodes, _ = nodes.with_node_at(lost + above)
    nodes, k = _of_two_elements(nodes, k)
    nodes.motion[:, -1] = whole.state.nodes[:, int(whole.state.counts[rows.ELEMENTS])]
    upper = upper_part(whole, nodes, k, without_load(whole.effects), loaded=not at_ship)
    lower = falling_part(whole, nodes, k)
    ropes = [*system.ropes, lower]
    ropes[r] = upper
    below = [*joints.lower.tolist(), int(joints.lower[r])]
    below[r] = LOOSE
    tolerance = min(system.ropes[0].model.tolerance, upper.model.tolerance, lower.model.tolerance)
    ropes[0] = ropes[0]._replace(model=ropes[0].model._replace(tolerance=tolerance))
    above_it = [*joints.upper.tolist(), joints.nodes.shape[1]]
    parts = new_system(tuple(ropes), below, above_it, joints.ties)
    for own, before in zip(parts.ropes, ropes, strict=True):
        n = int(before.state.counts[rows.ELEMENTS])
        own.work[rows.TENSION, :n] = before.work[rows.TENSION, :n]
    _find_accelerations(parts, (r, len(ropes) - 1), _with_one_more(border), place.time)
    return CutSystem(parts, lost)


def scene_of_parts(scene: Scene, number: int, lost_m: float) -> Scene:
    """Return the scene after the cut: the rope ends nowhere, the last rope comes from nowhere."""
    line = scene.ropes[number]
    upper = replace(line, to="", fixed_at_m=None)
    lower: RopeLine = replace(line, name=f"{line.name}/lower", from_="", length_m=lost_m)
    lines = [*scene.ropes, lower]
    lines[number] = upper
    return replace(scene, ropes=tuple(lines))


def advance_in_substeps(system: System, boundary: Boundary, time: float) -> Floats | None:
    """Advance the first step after a cut in doubling substeps (see `parted`).

    boundary: (ropes, 2, MOTIONS). Returns the forces on the upper ends after it [N], (ropes, 1,
    PULL_COLUMNS), or None if it failed and all is unchanged.
    """
    pull = np.zeros((len(system.ropes), 1, rows.PULL_COLUMNS))
    kept = copy.deepcopy(([rope.state for rope in system.ropes], system.joints))
    memories = [array for rope in system.ropes for array in state_arrays(rope.effects)]
    remembered = [array.copy() for array in memories]
    h = system.ropes[0].model.step
    each = [boundary_at(Boundary(*own), SUBSTEPS, h) for own in zip(*boundary, strict=True)]
    value, rate = (np.array(tables) for tables in zip(*each, strict=True))
    for k, (begin, end) in enumerate(pairwise(SUBSTEPS)):
        some = Boundary(value[:, k : k + 2].copy(), rate[:, k : k + 2].copy())
        piece = _with_step(system, (end - begin) * h)
        if advance_joined(piece, some, pull, time + begin * h, 1) < 1:
            for rope, state in zip(system.ropes, kept[0], strict=True):
                for mine, other in zip(rope.state, state, strict=True):
                    mine[...] = other
            for mine, other in zip(system.joints[2:4], kept[1][2:4], strict=True):
                mine[...] = other
            for mine, other in zip(memories, remembered, strict=True):
                mine[...] = other
            return None
    system.ropes[0].state.health[rows.STEPS] -= len(SUBSTEPS) - 2
    return pull


def _with_step(system: System, step: float) -> System:
    return system._replace(
        ropes=tuple(rope._replace(model=rope.model._replace(step=step)) for rope in system.ropes)
    )


def _of_two_elements(nodes: Nodes, k: int) -> tuple[Nodes, int]:
    """Divide parts of one element in two, as a rope between connections needs two elements."""
    if k == 1:
        nodes, _ = nodes.with_node_at(0.5 * float(nodes.s[1]))
        k = 2
    if k == len(nodes.s) - 2:
        nodes, _ = nodes.with_node_at(0.5 * float(nodes.s[k] + nodes.s[k + 1]))
    return nodes, k


def _with_one_more(border: Boundary) -> Boundary:
    """Return a boundary with a row for the lower part, which is not used."""
    return Boundary(*(np.concatenate([table, table[-1:]]) for table in border))


def _find_accelerations(
    system: System, parts: tuple[int, int], border: Boundary, time: float
) -> None:
    """Set the accelerations of the parts' nodes from their forces; all else is unchanged."""
    value, rate = border
    both = Boundary(
        np.concatenate([value, value + INSTANT_S * rate], axis=1),
        np.concatenate([rate, rate], axis=1),
    )
    pull = np.zeros((len(system.ropes), 1, rows.PULL_COLUMNS))
    still = [
        rope._replace(model=rope.model._replace(split_above=np.inf, merge_below=0.0))
        for rope in system.ropes
    ]
    for _ in range(2):
        trial = copy.deepcopy(_with_step(system._replace(ropes=tuple(still)), INSTANT_S))
        if advance_joined(trial, both, pull, time, 1) < 1:
            what = "the forces at its new end are not finite"
            raise SolverError("the rope's cut", what, "check the scene")
        for r in parts:
            _take_accelerations(system.ropes[r], trial.ropes[r], held=r == parts[0])
        system.joints.nodes[_A, -1] = trial.joints.nodes[_A, -1]


def _take_accelerations(rope: Rope, trial: Rope, *, held: bool) -> None:
    """Copy accelerations from a trial step; held: except that of the upper end."""
    n = int(rope.state.counts[rows.ELEMENTS]) + (0 if held else 1)
    rope.state.nodes[_A, :n] = trial.state.nodes[_A, :n]
