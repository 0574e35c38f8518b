"""Multi-line system of a twin, except its first rope with that rope's winch and hang-off.

The twin owns the first rope as in a single-line scene; this module has the other ropes,
connections, winches and hang-offs, and the step of all of them together.
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.energy import SystemStepEnergy, measure_system
from rope_twin.core.joined.joints import LOOSE, PULL, System
from rope_twin.core.joined.statics import solve_reeved_statics
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.core.step import advance_joined
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.rigging import runs_over_sheave, winch_of
from rope_twin.scene.schema import Scene
from rope_twin.twin.contact import system_contacts
from rope_twin.twin.figures import FigureBase, copied_law, scaled_law
from rope_twin.twin.motion.hang_off import Moves
from rope_twin.twin.multi_line_snapshot import (
    SystemState,
    contact,
    payload_snapshots,
    report_on,
    rope_snapshots,
    sheave_snapshots,
    strut_snapshots,
)
from rope_twin.twin.regrid import element_tension, joined_as, state_arrays
from rope_twin.twin.rope_cut import CutPosition, advance_in_substeps, cut_system, scene_of_parts
from rope_twin.twin.snapshot import InputHealth, Snapshot, amended
from rope_twin.twin.snapshot_builder import (
    RopeShape,
    body_of,
    shape_from_sheave,
    shape_from_top,
    strength_of,
)
from rope_twin.twin.state import changing_parts
from rope_twin.twin.statics import check_equilibrium, judge_body, no_garbage_collection, weak_ropes
from rope_twin.twin.winch.commands import Payout, WinchCommand
from rope_twin.twin.winch.winch import Winch, winch_of_rope


class OtherRopes:
    """Ropes of a twin other than the first, with their winches and boundary conditions; a base.

    The twin owns the first rope with that rope's winch and hang-off; a single-line scene has no
    others.
    """

    pull: Floats  # force on all upper ends now [N], (ropes, PULL_COLUMNS), of a multi-line system

    def __init__(self, scene: Scene, first: Rope) -> None:
        """Start with the first rope alone."""
        self.first = first
        self._scene = scene
        self._ropes: tuple[Rope, ...] = ()
        self._winches: tuple[Winch, ...] = ()  # of all ropes of a multi-line system
        self._from_ship: tuple[int, ...] = ()  # ropes but the first whose upper end is a hang-off
        self._hang_offs = np.zeros((0, 3))
        self._boundary = Boundary(np.zeros((1, 1, rows.MOTIONS)), np.zeros((1, 1, rows.MOTIONS)))

    # Winches

    def _winch_named(self, name: str) -> Winch:
        return self._winches[[line.from_ for line in self._scene.ropes].index(name)]

    def submit(self, name: str, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> str:
        """Submit a command to the winch of this name; return "" or the rejection."""
        return self._winch_named(name).take(stamp_ns, command, now_ns)

    def may_execute(
        self, name: str, stamp_ns: int | None, command: WinchCommand, now_ns: int
    ) -> bool:
        """Return whether the winch of this name would not reject a command, as far as is known."""
        return self._winch_named(name).may_execute(stamp_ns, command, now_ns)

    def forbids(self, name: str, switch: str) -> str:
        """Return why the winch of this name would not execute a switch now; "": it would."""
        return self._winch_named(name).forbids(switch)

    def follow(self, name: str, stamp_ns: int, length_m: float, speed: float | None) -> None:
        """Pass a measured line out [m] and line speed [m/s] to the winch of this name."""
        self._winch_named(name).follow(stamp_ns, length_m, speed)

    def invalidate(self) -> None:
        """Invalidate commands that were known in advance."""
        for winch in self._winches[1:]:
            winch.invalidate()

    def newest_ns(self) -> dict[str, int]:
        """Return the stamp of the newest accepted command of each winch but the first [ns]."""
        newest: dict[str, int] = {}
        for winch in self._winches[1:]:
            newest |= winch.newest_ns()
        return newest

    def needing_feedback(self, time_ns: int) -> dict[int, Winch]:
        """Return the winches that need tension feedback for the step from then on, by rope."""
        winches = {r: self._winches[r] for r in self._from_ship}
        return {r: winch for r, winch in winches.items() if winch.needs_feedback(time_ns)}

    def adapt_to_cut(self, r: int, lost_m: float, left_m: float) -> None:
        """Report to the winch of another rope the length cut off and the length left [m]."""
        self._winches[r].adapt_to_cut(lost_m, left_m)

    def scale(self, factors: Mapping[str, float]) -> None:
        """Set the figures of the other ropes as factors on the scene's; the first has them."""

    # Boundary conditions

    def prescribe(
        self, row: int, from_ns: int, step_s: float, heave: tuple[float, float], moves: Moves
    ) -> None:
        """Set hang-offs and payouts at step boundary `row`.

        heave: ship heave [m] and its rate [m/s]; moves: motion of the hang-offs moved by poses.
        """
        value, rate = self._boundary
        for r in self._from_ship:
            winch, zero = self._winches[r], (0.0, 0.0)
            displacement, velocity = moves.get(r, ((*zero, heave[0]), (*zero, heave[1])))
            value[r, row, : rows.LINE] = self._hang_offs[r] + np.array(displacement)
            rate[r, row, : rows.LINE] = velocity
            feedback = None
            if winch.needs_feedback(from_ns):
                step_boundary, pull_n = value[r, row - 1 : row + 1], float(self.pull[r, rows.PULL])
                rest_z_m = float(self._hang_offs[r, 2])
                rope_and_line = self._rope(r), self._scene.ropes[r]
                feedback = winch.feedback(*rope_and_line, pull_n, step_boundary, rest_z_m)
            line = winch.step(from_ns, step_s, velocity[2], feedback)
            value[r, row, rows.LINE], rate[r, row, rows.LINE] = line

    def forget(self, done: int, prescribed: int) -> None:
        """Make the boundary after `done` steps the first; `prescribed` ones follow it."""
        for table in self._boundary if self._from_ship else ():
            table[:, : prescribed + 1] = table[:, done : done + prescribed + 1]

    def discard_prescribed(self) -> None:
        """Make the winches of other ropes continue from the payout of the last step."""
        value, rate = self._boundary
        for r in self._from_ship:
            length, speed = float(value[r, 0, rows.LINE]), float(rate[r, 0, rows.LINE])
            self._winches[r].continue_from(Payout(length, speed))

    def present_boundary(self, first: Boundary) -> Boundary:
        """Return hang-offs and payouts now, (ropes, MOTIONS); first: those of the first rope."""
        present = Boundary(*(table[:, 0].copy() for table in self._boundary))
        for table, first_table in zip(present, first, strict=True):
            table[0] = first_table[0]
        return present

    # Ropes

    def all_with(self, first: Rope) -> tuple[Rope, ...]:
        """Return all ropes; first: the first one with the effects in use."""
        return first, *self._ropes

    def length_m(self, r: int) -> float:
        """Return the unstretched length of a rope other than the first [m]."""
        state = self._rope(r).state
        return float(state.s[state.counts[rows.ELEMENTS]])

    def _rope(self, r: int) -> Rope:
        return self.first if r == 0 else self._ropes[r - 1]


_log = logging.getLogger(__name__)


class MultiLineRopes(OtherRopes):
    """All ropes of a multi-line scene except the first one's boundary conditions.

    Raises:
        SceneError: the scene cannot be built.
    """

    def __init__(self, scene: Scene, steps: int) -> None:
        """Build the system, with boundary conditions for up to `steps` steps."""
        built = build_joined(scene)
        super().__init__(scene, built.system.ropes[0])
        self._ropes, self._joints = built.system.ropes[1:], built.system.joints
        self._stack, self._sheaves = built.system.stack, built.system.sheaves
        self._owners, self._hang_offs = built.owners, built.hang_off_m
        self._lines = report_on(scene)
        self._bases = [FigureBase(rope) for rope in self._ropes]
        self._law = copied_law(self._stack.law)
        self._winches = tuple(winch_of_rope(scene, line) for line in scene.ropes)
        self._from_ship = self._find_ropes_from_ship()
        size = (len(scene.ropes), steps + 1, rows.MOTIONS)
        self._boundary = Boundary(np.zeros(size), np.zeros(size))
        self._boundary.value[:, :, : rows.LINE] = np.nan_to_num(self._hang_offs)[:, None]
        self._boundary.value[:, :, rows.LINE] = [[line.length_m] for line in scene.ropes]
        self.pull = np.zeros((len(scene.ropes), rows.PULL_COLUMNS))  # force on upper ends now
        self.pulls = self.pull[:, None]  # after each step of the last call
        self.moved = self._boundary  # boundary conditions of the last call
        self._max_n = np.zeros(len(scene.ropes))  # maximum tension at each upper end
        self._is_cut = self._fresh = False  # whether a rope was cut; whether no step followed

    def solve_statics(self) -> Floats:
        """Solve for static equilibrium, compiling all kernels; return the first rope's top force.

        Raises:
            SceneError: there is no equilibrium, or the ropes float.
        """
        with no_garbage_collection():
            equilibrium = solve_reeved_statics(self.system(self.first), self._boundary.value[:, 0])
        judge_body(self._scene, self.lowest(self.first))
        ropes = self.all_with(self.first)
        heights = [rope.state.nodes[rows.POSITION + 2] for rope in ropes]
        counts = [int(rope.state.counts[rows.ELEMENTS]) for rope in ropes]
        highest = max(float(z[:n].max()) for z, n in zip(heights, counts, strict=True))
        check_equilibrium(self._scene, equilibrium, highest)
        for warning in weak_ropes(self._scene, ropes):
            _log.warning(warning)
        system = copy.deepcopy(self.system(self.first))
        boundary = Boundary(*(np.ascontiguousarray(table[:, :2]) for table in self._boundary))
        pull = np.zeros((len(system.ropes), 1, rows.PULL_COLUMNS))
        advance_joined(system, boundary, pull, 0.0, 1)
        self.pull, self.pulls = pull[:, 0].copy(), pull
        first: Floats = self.pull[0]
        return first

    def scale(self, factors: Mapping[str, float]) -> None:
        """Set the figures of the other ropes as factors on the scene's; the first has them."""
        self._ropes = tuple(
            rope._replace(effects=base.apply(factors, rope, rope.effects))
            for rope, base in zip(self._ropes, self._bases, strict=True)
        )
        self._stack = self._stack._replace(law=scaled_law(self._law, factors["axial_stiffness"]))
        self._stack_sections()

    def _stack_sections(self) -> None:
        """Copy the ropes' sections into the stacked arrays that the steps read."""
        for r, rope in enumerate(self.all_with(self.first)):
            sections = rope.sections
            self._stack.sections[r, :, : sections.shape[1]] = sections

    def take_motion(self, motions: Mapping[int, Boundary]) -> None:
        """Set the motion of the hang-offs at the boundaries of the next steps, by rope."""
        for r, motion in motions.items():
            for table, values in zip(self._boundary, motion, strict=True):
                table[r, : len(values)] = values

    def share_winches(self, winches: Mapping[int, Winch]) -> None:
        """Use these winches, by rope, which are advanced elsewhere."""
        self._winches = tuple(winches.get(r, winch) for r, winch in enumerate(self._winches))

    def advance(self, first: Rope, boundary: Boundary, time: float, pulls: Floats) -> int:
        """Advance all ropes like core's `advance`; boundary, pulls: of the first one."""
        steps = len(pulls)
        boundaries = self.boundaries(boundary, steps)
        pull = np.zeros((1 + len(self._ropes), steps, rows.PULL_COLUMNS))
        done = self._advance(self.system(first), boundaries, time, pull)
        pulls[:] = pull[0]
        self.take(first, boundaries, pull, done)
        return done

    def take(self, first: Rope, boundaries: Boundary, pull: Floats, done: int) -> None:
        """Record steps that were done; boundaries, pull: of all ropes, (ropes, steps, ...)."""
        self.pulls, self.moved = pull, boundaries
        if done:
            self.pull = pull[:, done - 1].copy()
            max_n = pull[:, :done, rows.PULL].max(axis=1)
            self._max_n = np.maximum(self._max_n, max_n)
        self.first = first

    def system(self, first: Rope) -> System:
        """Return all ropes with the first one's environment (see core/joined/stack.py)."""
        return System(self.all_with(first), self._joints, self._stack, self._sheaves)

    def boundaries(self, boundary: Boundary, steps: int) -> Boundary:
        """Return boundary conditions of all ropes in coming steps, (ropes, steps + 1, MOTIONS)."""
        boundaries = Boundary(*(table[:, : steps + 1].copy() for table in self._boundary))
        for table, first_table in zip(boundaries, boundary, strict=True):
            table[0] = first_table[: steps + 1]
        return boundaries

    def _advance(self, system: System, boundaries: Boundary, time: float, pull: Floats) -> int:
        """Advance all ropes; the first step after a cut in substeps."""
        if not self._fresh:
            return advance_joined(system, boundaries, pull, time, pull.shape[1])
        first_pull = advance_in_substeps(
            system, Boundary(*(table[:, :2] for table in boundaries)), time
        )
        if first_pull is None:
            return 0
        pull[:, :1] = first_pull
        self._fresh, steps = False, pull.shape[1] - 1
        if steps == 0:
            return 1
        remaining_boundaries, remaining_pull = (
            Boundary(*(table[:, 1:].copy() for table in boundaries)),
            pull[:, 1:].copy(),
        )
        done = advance_joined(
            system, remaining_boundaries, remaining_pull, time + system.ropes[0].model.step, steps
        )
        pull[:, 1:] = remaining_pull
        return 1 + done

    def cut(
        self, first: Rope, boundary: Boundary, position: CutPosition
    ) -> tuple[MultiLineRopes, float]:
        """Cut a rope; return the system with the lower part as last rope, and its length [m]."""
        r = position.rope
        present = Boundary(*(table[:, :1].copy() for table in self._boundary))
        for table, first_table in zip(present, boundary, strict=True):
            table[0, 0] = first_table[0]
        system, lost_m = cut_system(self.system(first), present, position)
        self.first, self._ropes = system.ropes[0], system.ropes[1:]
        self._is_cut = self._fresh = True
        self._joints, self._stack = system.joints, system.stack
        self._scene = scene_of_parts(self._scene, r, lost_m)
        self._owners |= {
            name: len(self._ropes) for name, owner in self._owners.items() if owner == r
        }
        self._hang_offs = np.vstack([self._hang_offs, np.full(3, np.nan)])
        self._winches += (winch_of_rope(self._scene, self._scene.ropes[-1]),)
        self._from_ship = self._find_ropes_from_ship()
        self._boundary = Boundary(*(np.vstack([table, table[-1:]]) for table in self._boundary))
        self._boundary.value[-1], self._boundary.rate[-1] = 0.0, 0.0
        self._boundary.value[-1, :, rows.LINE] = lost_m
        self._boundary.value[r, :, rows.LINE] -= lost_m
        self.pull = np.vstack([self.pull, np.zeros(rows.PULL_COLUMNS)])
        self._max_n = np.append(self._max_n, 0.0)
        return self, lost_m

    def replace(self, ropes: Sequence[Rope]) -> None:
        """Continue with ropes on other meshes; connections keep their motion."""
        system = joined_as(self.system(self.first), ropes)
        self.first, self._ropes = system.ropes[0], system.ropes[1:]
        self._joints, self._stack, self._sheaves = system.joints, system.stack, system.sheaves

    def measure(self, first: Rope, pull: Floats, speed: float, time: float) -> SystemStepEnergy:
        """Return energy and power of all ropes now; pull [N], speed [m/s]: of the first one."""
        pulls, speeds = self.pull.copy(), self._boundary.rate[:, 0, rows.LINE].copy()
        pulls[0], speeds[0] = pull, speed
        return measure_system(self.system(first), pulls, speeds, time)

    def complete(self, snapshot: Snapshot, now_ns: int, effects: tuple[Any, ...]) -> Snapshot:
        """Complete the first rope's snapshot with all ropes, payloads and winches."""
        payout = Boundary(*(table[:, 0, rows.LINE] for table in self._boundary))
        state = SystemState(
            self._scene, self.system(self.first), self._owners, self.pull, payout,
            now_ns * 1e-9, effects,
        )  # fmt: skip
        limits = [snapshot.winch_at_limit]
        inputs: dict[str, InputHealth] = dict(snapshot.inputs)
        for line, winch in zip(self._scene.ropes[1:], self._winches[1:], strict=True):
            if winch_of(self._scene, line):
                inputs |= winch.health(now_ns)
                limits += [f"{line.from_}: {winch.at_limit}"] if winch.at_limit else []
        health = np.sum([rope.state.health for rope in self._ropes], axis=0)
        solver = snapshot.solver._replace(
            splits=snapshot.solver.splits + int(health[rows.SPLITS]),
            merges=snapshot.solver.merges + int(health[rows.MERGES]),
        )
        ropes = rope_snapshots(state, snapshot)
        strength = [
            strength_of(line, max(max_n, shown.tension_top_n), rope)
            for line, max_n, shown, rope in zip(
                self._scene.ropes, self._max_n, ropes, state.system.ropes, strict=True
            )
        ]
        completed = amended(
            snapshot,
            ropes=ropes,
            payloads=payload_snapshots(state),
            struts=strut_snapshots(state),
            sheaves=sheave_snapshots(state),
            winches=(*snapshot.winches, *filter(None, (w.snapshot() for w in self._winches[1:]))),
            winch_at_limit="; ".join(limit for limit in limits if limit),
            inputs=inputs,
            solver=solver,
            seabed=contact(state),
            contacts=system_contacts(state.system),
            strength=tuple(strength),
        )
        return completed if self._lines is None else self._lines.complete(completed)

    def shapes(self, first: Rope, snapshot: Snapshot) -> tuple[RopeShape, ...]:
        """Return the shapes of all ropes."""
        ropes = zip(self._scene.ropes, self.all_with(first), snapshot.ropes, strict=True)
        return tuple(
            shape_from_sheave(line, rope, rope_snapshot)
            if runs_over_sheave(self._scene, line)
            else shape_from_top(line, rope, rope_snapshot, loose=not line.from_)
            for line, rope, rope_snapshot in ropes
        )

    def lowest(self, first: Rope) -> Rope:
        """Return the rope that carries the rigid body; the first one if there is none."""
        return next((rope for rope in self.all_with(first) if body_of(rope)), first)

    def state(self) -> dict[str, Any]:
        """Return the additional state that a restart needs, by name."""
        values: dict[str, Any] = {
            "joined/nodes": self._joints.nodes,
            "joined/pulls of struts": self._joints.ties[PULL],
            "joined/boundary": self._boundary,
            "joined/pull": self.pull,
            "joined/winches": self._winches,
            "joined/highest": self._max_n,
        }
        if self._is_cut:
            values["joined/fresh"], values["rope/model"] = self._fresh, self.first.model
        if self._lines is not None:
            values["joined/lines"] = self._lines.state()
        for r, rope in enumerate(self._ropes, start=1):
            parts = {name: getattr(rope, name) for name in changing_parts(rope)}
            values |= {f"joined/{r}/{name}": part for name, part in parts.items()}
            values[f"joined/{r}/memories"] = state_arrays(rope.effects)
            if self._is_cut:  # parts keep the figures of their rope
                values[f"joined/{r}/effects"] = rope.effects
                values[f"joined/{r}/model"] = rope.model
            values[f"joined/{r}/tension"] = element_tension(rope)
        return values

    def restore(self, values: dict[str, Any], first: Rope) -> None:
        """Remove the entries of `state` from `values` and restore them; first: the first rope."""
        self.first = first
        self._joints = self._joints._replace(nodes=values.pop("joined/nodes"))
        self._joints.ties[PULL] = values.pop("joined/pulls of struts")
        self._boundary = values.pop("joined/boundary")
        self.pull, self._winches = values.pop("joined/pull"), values.pop("joined/winches")
        self._max_n = values.pop("joined/highest")
        self._fresh = bool(values.pop("joined/fresh", False))
        if self._lines is not None:
            self._lines.restore(values.pop("joined/lines"))
        ropes = []
        for r, rope in enumerate(self._ropes, start=1):
            parts = {name: values.pop(f"joined/{r}/{name}") for name in changing_parts(rope)}
            for part in ("effects", "model"):
                parts[part] = values.pop(f"joined/{r}/{part}", getattr(rope, part))
            ropes.append(rope._replace(**parts))
            memories = values.pop(f"joined/{r}/memories")
            for array, saved in zip(state_arrays(rope.effects), memories, strict=True):
                array[...] = saved
            element_tension(ropes[-1])[:] = values.pop(f"joined/{r}/tension")
        self._ropes = tuple(ropes)
        self._stack_sections()  # a cut moves their ends

    def _find_ropes_from_ship(self) -> tuple[int, ...]:
        """Return the ropes but the first whose upper end is a hang-off."""
        upper = self._joints.upper
        return tuple(r for r in range(1, 1 + len(self._ropes)) if upper[r] == LOOSE)
