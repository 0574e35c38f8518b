"""Ropes that a twin steps: a single rope or a multi-line system.

The twin owns its first rope with that rope's winch and hang-off. The classes `Ropes` have the same
methods for the step and for everything beyond the first rope. A method that takes the first rope
takes it with the effects in use.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.energy import Power, StoredEnergy, SystemStepEnergy, measure, of_one
from rope_twin.core.joined.joints import System, loaded_ends
from rope_twin.core.loads.balance import lower_end_force, lower_end_tension
from rope_twin.core.state import (
    ACCELERATION,
    ELEMENTS,
    LINE,
    PULL,
    PULL_COLUMNS,
    PULL_X,
    PULL_Z,
    SUBSTEPS_UNCONVERGED,
    Boundary,
    Floats,
    Rope,
    State,
)
from rope_twin.core.step import advance
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import coupled_settings, model_beside
from rope_twin.twin.contact import seabed_contact
from rope_twin.twin.level import Mesh
from rope_twin.twin.multi_line import MultiLineRopes, OtherRopes
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.regrid import element_tension, has_state, state_arrays, upper_ends
from rope_twin.twin.rope_cut import (
    SUBSTEPS,
    CutPosition,
    boundary_at,
    cut_rope,
    is_at_end,
    refresh_tension,
    rope_s,
    step_free,
    without_load,
    without_massless_section,
)
from rope_twin.twin.snapshot import (
    BedContact,
    PayloadSnapshot,
    Snapshot,
    SolverHealth,
    amended,
    first_rope,
)
from rope_twin.twin.snapshot_builder import (
    RopeShape,
    payload_depth_m,
    rope_snapshot,
    shape_from_top,
)
from rope_twin.twin.state import changing_parts
from rope_twin.twin.statics import solve_scene_statics
from rope_twin.vortex.coupled import VivDragAmplification

# Parts of a checkpoint that are not restored: they continue from the present.
_NOT_RESTORED = ("joined/winches", "joined/lines", "joined/highest", "rope/model", "lower/model")


class OneRope(OtherRopes):
    """A single rope with its payload."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, build(scene))

    def solve_statics(self) -> Floats:
        """Solve for static equilibrium; return the rope's force on the hang-off.

        Raises:
            SceneError: there is no equilibrium.
        """
        return solve_scene_statics(self._scene, self.first)

    def advance(self, first: Rope, boundary: Boundary, time: float, pulls: Floats) -> int:
        """Advance the rope in time."""
        return advance(first, boundary, pulls, time, len(pulls))

    def cut(self, first: Rope, boundary: Boundary, position: CutPosition) -> tuple[CutRope, float]:
        """Cut the rope; return both parts and the length of the lower one [m]."""
        parts = cut_rope(first, boundary, position, without_load(first.effects))
        return CutRope(self._scene, parts.upper, parts.lower), parts.lost_m

    def replace(self, ropes: Sequence[Rope]) -> None:
        """Continue with the rope on another mesh."""
        (self.first,) = ropes

    def measure(self, first: Rope, pull: Floats, speed: float, time: float) -> SystemStepEnergy:
        """Return energy and power of the rope now."""
        return of_one(measure(first, pull[PULL_X : PULL_Z + 1], time, speed))

    def complete(self, snapshot: Snapshot, now_ns: int, effects: tuple[Any, ...]) -> Snapshot:
        """Add the force on the lower end, if the scene moves that end."""
        if self._scene.ropes[0].end_motion is None:
            return snapshot
        force = lower_end_force(self.first, effects, now_ns * 1e-9)
        return amended(snapshot, lower_end_force_n=tuple(force.tolist()))

    def shapes(self, first: Rope, snapshot: Snapshot) -> tuple[RopeShape, ...]:
        """Return the shape of the rope."""
        line = self._scene.ropes[0]
        return (shape_from_top(line, first, first_rope(snapshot, line.name)),)

    def lowest(self, first: Rope) -> Rope:
        """Return the rope itself."""
        return first

    def state(self) -> dict[str, Any]:
        """Return no additional state."""
        return {}

    def restore(self, values: dict[str, Any], first: Rope) -> None:
        """Continue with the first rope; there is no additional state."""
        self.first = first


_WHOLE = (0.0, 1.0)


class CutRope(OtherRopes):
    """Both parts of a cut rope, which do not interact; the first rope is the upper part.

    The payload is at the lower end of the lower part.
    """

    def __init__(self, scene: Scene, first: Rope, lower: Rope) -> None:
        """Take both parts; lower: as `cut_rope` returns it, with the effects of the whole rope."""
        super().__init__(scene, first)
        self._lower = lower
        self._upper_backup, self._lower_backup = first.state.copy(), lower.state.copy()
        self._fresh = True  # whether no step was done since the cut
        self._unconverged = 0  # unconverged substeps of the lower part at the last snapshot

    def advance(self, first: Rope, boundary: Boundary, time: float, pulls: Floats) -> int:
        """Advance both parts step by step; both stop if one fails."""
        self.first = first
        self._share_effects(first)
        for row in range(len(pulls)):
            begin_s = time + row * first.model.step
            step_boundary = Boundary(*(table[row : row + 2] for table in boundary))
            if not self._step_both(first, step_boundary, begin_s, pulls[row]):
                return row
        return len(pulls)

    def _step_both(self, first: Rope, boundary: Boundary, time: float, pull: Floats) -> bool:
        """Advance both by a step, the first in doubling substeps; False: both are unchanged."""
        backups = ((self._upper_backup, first.state), (self._lower_backup, self._lower.state))
        for backup, state in backups:
            _copy(state, backup)
        internal = state_arrays(first.effects + self._lower.effects)
        internal_backup = [array.copy() for array in internal]
        h, lower = first.model.step, self._lower
        fractions = SUBSTEPS if self._fresh else _WHOLE
        value, rate = boundary_at(boundary, fractions, h)
        pulls = np.zeros((1, rows.PULL_COLUMNS))
        for k, (begin, end) in enumerate(pairwise(fractions)):
            begin_s, substep_s = time + begin * h, (end - begin) * h
            substep_boundary = Boundary(value[k : k + 2], rate[k : k + 2])
            upper = first._replace(model=first.model._replace(step=substep_s))
            falling = lower._replace(model=lower.model._replace(step=substep_s))
            if (
                not step_free(falling, begin_s)
                or advance(upper, substep_boundary, pulls, begin_s, 1) < 1
            ):
                for backup, state in backups:
                    _copy(backup, state)
                for array, saved in zip(internal, internal_backup, strict=True):
                    array[...] = saved
                refresh_tension(first, float(boundary.rate[0, rows.LINE]))
                refresh_tension(lower, 0.0)
                return False
        for _, state in backups:  # substeps of the first step count as one step
            state.health[rows.STEPS] -= len(fractions) - 2
        self._fresh, pull[:] = False, pulls[0]
        return True

    def complete(self, snapshot: Snapshot, now_ns: int, effects: tuple[Any, ...]) -> Snapshot:
        """Complete the first rope's snapshot with both parts and the payload of the lower one."""
        lower = without_massless_section(self._lower)
        name = f"{self._scene.ropes[0].name}/lower"
        ends_n = lower_end_tension(lower, effects, now_ns * 1e-9), 0.0
        lower_snapshot = rope_snapshot(name, lower, ends_n, (float(rope_s(lower)[-1]), 0.0))
        unconverged = int(lower.state.health[rows.SUBSTEPS_UNCONVERGED])
        not_converged = snapshot.not_converged or unconverged > self._unconverged
        self._unconverged = unconverged
        x, v = (lower.state.nodes[k : k + 3, 0].copy() for k in (rows.POSITION, rows.VELOCITY))
        if snapshot.body is not None:  # the values are those of the lower part already
            x, v = snapshot.payload_position_m, snapshot.payload_velocity_m_per_s
        return replace(
            snapshot,
            tension_payload_n=float(lower_snapshot.node_tension_n[-1]),
            payload_position_m=x,
            payload_velocity_m_per_s=v,
            ropes=(first_rope(snapshot, self._scene.ropes[0].name), lower_snapshot),
            payloads=tuple(PayloadSnapshot(payload.name, x, v) for payload in self._scene.payloads),
            seabed=self._contact(lower),
            solver=_combined_health(snapshot.solver, lower.state.health),
            not_converged=not_converged,
        )

    def shapes(self, first: Rope, snapshot: Snapshot) -> tuple[RopeShape, ...]:
        """Return the shapes of both parts."""
        line, (upper, lower) = self._scene.ropes[0], snapshot.ropes
        falling = without_massless_section(self._lower)
        return shape_from_top(line, first, upper), shape_from_top(line, falling, lower, loose=True)

    def state(self) -> dict[str, Any]:
        """Return the state of the lower part that a restart needs, by name."""
        parts = {name: getattr(self._lower, name) for name in changing_parts(self._lower)}
        values: dict[str, Any] = {f"lower/{name}": part for name, part in parts.items()}
        values["lower/model"], values["rope/model"] = self._lower.model, self.first.model
        values["lower/effects"], values["lower/fresh"] = self._lower.effects, self._fresh
        values["lower/tension"] = element_tension(self._lower)
        return values

    def restore(self, values: dict[str, Any], first: Rope) -> None:
        """Remove the entries of `state` from `values` and restore them; first: the first rope."""
        names = (*changing_parts(self._lower), "model", "effects")
        parts = {name: values.pop(f"lower/{name}") for name in names}
        self.first, self._lower = first, self._lower._replace(**parts)
        element_tension(self._lower)[:] = values.pop("lower/tension")
        self._fresh = values.pop("lower/fresh")

    def lowest(self, first: Rope) -> Rope:
        """Return the lower part, which has the payload."""
        return self._lower

    def measure(self, first: Rope, pull: Floats, speed: float, time: float) -> SystemStepEnergy:
        """Return energy and power of both parts; pull [N], speed [m/s]: of the upper one."""
        self._share_effects(first)
        with np.errstate(divide="ignore"):  # the node beyond the free end has zero diameter
            lower = measure(self._lower, np.zeros(3), time, 0.0)
        upper = measure(first, pull[rows.PULL_X : rows.PULL_Z + 1], time, speed)
        return SystemStepEnergy(
            StoredEnergy(*(a + b for a, b in zip(lower.store, upper.store, strict=True))),
            Power(*(a + b for a, b in zip(lower.power, upper.power, strict=True))),
            (lower.elements, upper.elements),
            0.0,
        )

    def _share_effects(self, first: Rope) -> None:
        """Use the first rope's effects, except those with own load or internal variables."""
        shared = tuple(
            lower if is_at_end(lower) or has_state(lower) else upper
            for lower, upper in zip(self._lower.effects, first.effects, strict=True)
        )
        if any(old is not new for old, new in zip(self._lower.effects, shared, strict=True)):
            self._lower = self._lower._replace(effects=shared)

    def _contact(self, lower: Rope) -> BedContact | None:
        """Return the seabed contact of both parts; the payload is that of the lower one."""
        ropes = self.first, lower, self._lower
        upper_bed, lower_bed, with_free_end = (seabed_contact(rope) for rope in ropes)
        if upper_bed is None or lower_bed is None or with_free_end is None:
            return None
        return replace(
            lower_bed,
            rope_on_bed_m=lower_bed.rope_on_bed_m + upper_bed.rope_on_bed_m,
            rope_reaction_n=with_free_end.rope_reaction_n + upper_bed.rope_reaction_n,
        )


def _copy(source: State, target: State) -> None:
    for target_array, source_array in zip(target, source, strict=True):
        target_array[...] = source_array


def _combined_health(upper: SolverHealth, lower: Any) -> SolverHealth:
    """Return the solver counts of both parts together; steps are the same."""
    return upper._replace(
        solves=upper.solves + int(lower[rows.SOLVES]),
        solves_max_per_stage=max(upper.solves_max_per_stage, int(lower[rows.SOLVES_MAX])),
        substeps=upper.substeps + int(lower[rows.SUBSTEPS]),
        substeps_max_per_step=max(upper.substeps_max_per_step, int(lower[rows.SUBSTEPS_MAX])),
        rejected_substeps=upper.rejected_substeps + int(lower[rows.REJECTED]),
        unconverged_substeps=upper.unconverged_substeps + int(lower[rows.SUBSTEPS_UNCONVERGED]),
    )


Ropes = OneRope | CutRope | MultiLineRopes


def ropes_of(scene: Scene, steps: int) -> OneRope | MultiLineRopes:
    """Return the scene's ropes, with boundary conditions for up to `steps` steps.

    Raises:
        SceneError: the scene cannot be built.
    """
    return MultiLineRopes(scene, steps) if is_joined(scene) else OneRope(scene)


class OpenSteps(NamedTuple):
    """Steps whose boundary conditions are set, to be done in lanes."""

    member: Rope | System
    boundary: Boundary  # (steps + 1, MOTIONS), of a system with the ropes in front
    steps: int
    begin_s: float = 0.0  # when a twin began to process them, of time.perf_counter [s]


class RopeSystem:
    """All ropes of a twin at the newest step, and the force of the first one on its hang-off."""

    def __init__(self, scene: Scene, steps: int) -> None:
        """Build the ropes in static equilibrium, for calls of up to `steps` steps.

        Raises:
            SceneError: the scene cannot be built, or there is no equilibrium.
        """
        built = ropes_of(scene, steps)
        self.ropes: Ropes = built
        self.first = built.first  # with the effects of the newest step, see `with_effects`
        self._pulls = np.zeros((steps, PULL_COLUMNS))
        self.pull = built.solve_statics()  # (PULL_COLUMNS,)

    @property
    def joined(self) -> MultiLineRopes | None:
        """The multi-line system; None for a single rope."""
        return self.ropes if isinstance(self.ropes, MultiLineRopes) else None

    @property
    def loaded(self) -> tuple[bool, ...]:
        """Whether the upper end of each rope carries loads: a connection does, no hang-off does."""
        joined = self.joined
        return (False,) if joined is None else loaded_ends(joined.system(self.first))

    @property
    def tension(self) -> Floats:
        """Tension of the first rope's elements [N], a view of the scratch array."""
        return element_tension(self.first)

    @property
    def upper_pulls(self) -> Floats:
        """Force of all ropes on their upper ends [N], (ropes, PULL_COLUMNS)."""
        return self.pull[None] if self.joined is None else self.joined.pull

    def computed(self, boundary: Boundary) -> tuple[float, ...]:
        """Return top tension [N] and line out [m] of each rope, then the payload's depth [m].

        boundary: boundary conditions of the first rope, the present in row 0.
        """
        lengths = self.ropes.present_boundary(boundary).value[:, LINE].tolist()
        pairs = zip(self.upper_pulls[:, PULL].tolist(), lengths, strict=False)
        depth_m = payload_depth_m(self.ropes.lowest(self.first))
        return (*(value for pair in pairs for value in pair), depth_m)

    @property
    def is_finite(self) -> bool:
        """Whether position, velocity and tension of the first rope are finite."""
        nodes = self.first.state.nodes[:ACCELERATION, : self.first.state.counts[ELEMENTS] + 1]
        return all(bool(np.isfinite(array).all()) for array in (nodes, self.tension, self.pull))

    @property
    def unconverged(self) -> int:
        """Number of unconverged substeps of the first rope since the start."""
        return int(self.first.state.health[SUBSTEPS_UNCONVERGED])

    def with_effects(self, effects: tuple[Any, ...]) -> Rope:
        """Return the first rope with the effects in use."""
        rope = self.first
        return rope if rope.effects is effects else rope._replace(effects=effects)

    def advance(self, rope: Rope, boundary: Boundary, time_s: float, steps: int) -> Floats:
        """Advance all ropes; return the first one's force after each step, (done, PULL_COLUMNS).

        rope: the first one with the effects in use. Fewer steps are done if the next state would
        not be finite.
        """
        pulls = self._pulls[:steps]
        done = self.ropes.advance(rope, boundary, time_s, pulls)
        if done:
            self.pull = pulls[done - 1].copy()
        return pulls[:done]

    def open(self, rope: Rope, boundary: Boundary, steps: int, begin_s: float) -> OpenSteps:
        """Return a multi-line system with the boundary conditions of steps that lanes will do."""
        joined = self.joined
        assert joined is not None
        return OpenSteps(joined.system(rope), joined.boundaries(boundary, steps), steps, begin_s)

    def close(self, opened: OpenSteps, pulls: Floats) -> Floats:
        """Record the steps that were done; return the first rope's force after each.

        pulls: (ropes, done, PULL_COLUMNS).
        """
        joined, member = self.joined, opened.member
        assert joined is not None
        assert not isinstance(member, Rope)
        joined.take(member.ropes[0], opened.boundary, pulls, pulls.shape[1])
        if pulls.shape[1]:
            self.pull = pulls[0, -1].copy()
        first: Floats = pulls[0]
        return first

    def cut(self, rope: Rope, boundary: Boundary, position: CutPosition) -> float:
        """Cut a rope; return the length of the lower part [m]. rope: with the effects in use.

        Raises:
            SolverError: the cut cannot be made.
        """
        assert not isinstance(self.ropes, CutRope), "a rope is cut once"
        self.ropes, lost_m = self.ropes.cut(rope, boundary, position)
        self.first = self.ropes.first
        return lost_m

    def regrid(
        self, first: Rope, mesh: Mesh, level: AccuracyLevel, boundary: Boundary
    ) -> tuple[Any, ...]:
        """Continue on another accuracy level; return the effects of the first rope on its mesh.

        first: with the effects in use; boundary: boundary conditions of the first rope, the
        present in row 0.
        """
        ropes = first if self.joined is None else self.joined.system(first)
        payout = self.ropes.present_boundary(boundary).rate[:, LINE]
        ends = upper_ends(ropes, self.upper_pulls, payout)
        assert not isinstance(self.ropes, CutRope), "its parts keep their elements"
        self.ropes.replace(mesh.changed(self.ropes.all_with(first), level, ends))
        self.first = self.ropes.first
        return self.first.effects

    def arrays(self) -> dict[str, Any]:
        """Return all that the steps change, by name; effects belong to the inputs."""
        arrays = {f"rope/{name}": getattr(self.first, name) for name in changing_parts(self.first)}
        arrays |= {"rope/tension": self.tension, "rope/pull": self.pull}
        return arrays | self.ropes.state()

    def restore(self, arrays: dict[str, Any], effects: tuple[Any, ...]) -> None:
        """Continue from restored arrays and effects."""
        remaining = dict(arrays)
        self.pull, tension = remaining.pop("rope/pull"), remaining.pop("rope/tension")
        parts = {name: remaining.pop(f"rope/{name}") for name in changing_parts(self.first)}
        model = remaining.pop("rope/model", self.first.model)
        self.first = self.first._replace(**parts, effects=effects, model=model)
        self.tension[:] = tension
        self.ropes.restore(remaining, self.first)

    def moving_arrays(self, effects: tuple[Any, ...]) -> dict[str, Floats]:
        """Return views of all arrays of a checkpoint, by name; effects: those in use."""
        parts = self.arrays() | {"effects": effects}
        return {
            name: array for name, part in parts.items() for name, array in moving_arrays(name, part)
        }

    def restore_checkpoint(self, saved: dict[str, Floats], effects: tuple[Any, ...]) -> bool:
        """Copy the arrays of a checkpoint into those in use; return whether they fit."""
        if self.moving_arrays(effects).keys() != saved.keys():
            return False
        for _ in range(2):  # after the first pass the views have the restored element counts
            for name, array in self.moving_arrays(effects).items():
                if array.shape == saved[name].shape:
                    array[...] = saved[name]
        return True


def new_viv_drag(scene: Scene, system: RopeSystem) -> VivDragAmplification | None:
    """Return the loosely coupled VIV model of a scene in static equilibrium; None without one.

    Raises:
        InputError: a rope is slack somewhere.
    """
    if model_beside(scene) is None:
        return None
    ropes, cycle = system.ropes.all_with(system.first), steps_in_slot(scene.time.step_s)
    return VivDragAmplification(coupled_settings(scene), ropes, system.loaded, cycle)


def moving_arrays(name: str, part: Any) -> Iterator[tuple[str, Floats]]:
    """Yield all arrays of a component that a recovery restores, by name."""
    if name in _NOT_RESTORED:
        return
    if isinstance(part, np.ndarray):
        yield name, part
    elif isinstance(part, tuple | list):
        for number, item in enumerate(part):
            yield from moving_arrays(f"{name}/{number}", item)
    elif type(part).__module__.startswith(("rope_twin.core", "rope_twin.effects")):
        for key, item in getattr(part, "__dict__", {}).items():
            yield from moving_arrays(f"{name}/{key}", item)
