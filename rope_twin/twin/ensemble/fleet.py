"""Fleet: ropes of one scene that begin from any state and take figures and inputs as arrays.

A forecast or an estimator runs many short simulations of the rope that hangs now, each with its own
heave, line out or payload. The members of a fleet have a mesh and a step of their own, coarser than
those of the live twin; they are stepped in SIMD lanes like an ensemble's (`core/lanes`), but their
boundary conditions are arrays, their figures array writes without another scene or statics, and
the top tension of every step is returned. Least tension and the payload's motion are folded in the
lanes over each look.

A member is bit-identical to a `Twin` of the same mesh, step, state and inputs. Members of a scene
whose effects do not step in lanes step alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.group import Group, Kind, kind_of
from rope_twin.core.lanes.step import DEPTH, FOLDS, LEAST, LOWEST, SINKING, Run
from rope_twin.core.state import Boundary, Floats, Ints, Rope, State, columns_for, new_work
from rope_twin.core.step import advance
from rope_twin.errors import InputError, phrase
from rope_twin.scene.change import at_setting
from rope_twin.scene.load import load_scene
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import is_joined
from rope_twin.scene.validation.vortices import model_beside
from rope_twin.twin.ensemble.figures import (
    FIGURES,
    Factors,
    checked_factors,
    figures_of,
    scaled_rope,
    stacked_effects,
    stacked_sections,
)
from rope_twin.twin.ensemble.live_state import LiveState, live_state, on_mesh
from rope_twin.twin.internal_variables import has_state, own_copies, state_arrays
from rope_twin.twin.recovery import step_failure
from rope_twin.twin.snapshot_builder import payload_depth_m
from rope_twin.twin.statics import solve_scene_statics

__all__ = [
    "FIGURES", "Fleet", "FleetInputs", "FleetRecord", "FleetState", "LiveState", "live_state",
]  # fmt: skip

BATCH_STEPS = 200  # of a call of the lanes at most: 1 to 2 ms with 20 elements
OFTEN, OFTEN_LEAST = 0.2, 10  # fraction and minimum number of steps done alone to leave a group


@dataclass(frozen=True)
class FleetState:
    """State of one member, for `Fleet.restore`."""

    time_ns: int
    rope: State
    memories: tuple[Floats, ...] = ()  # internal variables of the effects


@dataclass(frozen=True)
class FleetInputs:
    """Motion at the step borders, the first being the present.

    Each is (steps + 1,) for all members, or (steps + 1, members).
    """

    heave_m: Floats  # height of the hang-off relative to its rest
    heave_rate_m_per_s: Floats
    line_out_m: Floats
    line_speed_m_per_s: Floats


@dataclass(frozen=True)
class FleetRecord:
    """Results of `Fleet.advance`. A last look may be shorter than the others."""

    top_tension_n: Floats  # at the end of each step, (steps, members)
    least_tension_n: Floats  # of any element over each look, (looks, members)
    payload_depth_m: Floats  # at the end of each look, (looks, members), positive down
    payload_speed_m_per_s: Floats  # vertical, likewise, positive down
    payload_tension_n: Floats  # of the lowest element, likewise
    failures: Mapping[int, str]  # members that failed and why; their values are then NaN


class Fleet:
    """Members of one rope that begin from a given state and take inputs as arrays."""

    def __init__(
        self,
        scene: Scene | str | Path,
        members: int,
        *,
        elements: int = 20,
        step_s: float = 0.05,
        threads: int = 1,
    ) -> None:
        """Build members in the scene's static equilibrium, at time 0.

        Args:
            scene: a scene of one rope, its name, or the path of its file.
            members: number of members.
            elements: number of elements of each member at the scene's paid-out length.
            step_s: time step [s].
            threads: number of parallel threads.

        Raises:
            InputError: a number given here is not possible, or a scene that fleets do not step.
            SceneError: the scene cannot be built, or has no static equilibrium.
        """
        scene = scene if isinstance(scene, Scene) else load_scene(scene)
        if members < 1 or threads < 1:
            what = f"{members} members, {threads} threads"
            raise InputError(phrase("fleet", what, "give at least one of each"))
        if is_joined(scene):
            what = f"the ropes of '{scene.name}' meet, a fleet has members of one rope"
            raise InputError(phrase("fleet", what, "step them with `rope_twin run`"))
        if model_beside(scene) is not None:
            what = f"the VIV model of '{scene.name}' runs beside the step"
            right = "remove it from the scene; its drag amplification then has no effect"
            raise InputError(phrase("fleet", what, right))
        self.scene = at_setting(scene, elements, step_s)
        self.threads = threads
        self._rope = build(self.scene)
        solve_scene_statics(self.scene, self._rope)
        self._marks = self._rope.state.s[: self._rope.state.counts[rows.ELEMENTS] + 1].copy()
        self._step_ns = round(self.scene.time.step_s * 1e9)
        self._time_ns = 0
        self._failures: dict[int, str] = {}
        self._factors = {name: np.ones(members) for name in FIGURES}
        parts: Any = (np.repeat(part[None], members, 0) for part in self._rope.state)
        self._states = State(*parts)  # with the members as the first axis
        self._effects = [own_copies(self._rope.effects) for _ in range(members)]
        self._scratches: list[_Scratch] = [_Scratch(self._rope) for _ in range(threads)]
        self._scale()

    def __len__(self) -> int:
        """Return the number of members, including failed ones."""
        return len(self._effects)

    @property
    def time_s(self) -> float:
        """Time of all members [s]."""
        return self._time_ns * 1e-9

    @property
    def figures(self) -> tuple[str, ...]:
        """Figures that the scene has, in the order of FIGURES."""
        return figures_of(self._rope)

    # Figures

    def set_figures(self, factors: Factors) -> None:
        """Set figures of all members as factors on the scene's values; others are kept.

        factors: by name of FIGURES, a number or one for each member. The members' motion and state
        stay as they are: a rope whose weight or stiffness jumps rings.

        Raises:
            InputError: an unknown figure or one that the scene does not have, a factor that is not
                finite and positive, or a wrong number of factors.
        """
        self._factors |= checked_factors(factors, self.figures, len(self))
        self._scale()

    def _scale(self) -> None:
        """Apply the factors to the kernel data of the members."""
        self._kind = kind_of(self._rope)
        self._scaled: dict[int, Rope] = {}  # members that have stepped alone, by number
        self._sections = stacked_sections(self._rope.sections, self._factors)
        self._stacked = stacked_effects(self._rope.effects, self._factors) if self._kind else ()

    def _lone(self, member: int) -> Rope:
        """Return the rope of a member, which shares its state with the fleet."""
        if member not in self._scaled:
            factors = {name: float(value[member]) for name, value in self._factors.items()}
            rope = scaled_rope(self._rope, factors, self._effects[member])
            self._scaled[member] = rope._replace(state=self._state_of(member))
            self._effects[member] = rope.effects
        return self._scaled[member]

    def _state_of(self, member: int) -> State:
        """Return views of a member's state."""
        return State(*(part[member] for part in self._states))

    # States

    def state(self, member: int) -> FleetState:
        """Return a copy of a member's state."""
        memories = tuple(array.copy() for array in state_arrays(self._effects[member]))
        return FleetState(self._time_ns, self._state_of(member).copy(), memories)

    def restore(self, states: FleetState | Sequence[FleetState]) -> None:
        """Continue all members from one state, or each from its own; failed ones start again.

        Raises:
            InputError: as many states as there are no members, states of different times, or one
                of another mesh.
        """
        given = [states] if isinstance(states, FleetState) else list(states)
        if not isinstance(states, FleetState) and len(given) != len(self):
            what = f"{len(given)} states for {len(self)} members"
            raise InputError(phrase("fleet", what, "give one, or one for each"))
        if len({one.time_ns for one in given}) > 1:
            raise InputError(phrase("fleet", "states of different times", "give states of one"))
        for one in given:
            if one.rope.nodes.shape != self._states.nodes.shape[1:]:
                what = f"a state with space for {one.rope.s.size} nodes"
                right = f"give states of a fleet of this scene and mesh, {self._states.s.shape[1]}"
                raise InputError(phrase("fleet", what, right))
        if len(given) == 1:
            for mine, part in zip(self._states, given[0].rope, strict=True):
                mine[:] = part
        else:
            for k, one in enumerate(given):
                for mine, part in zip(self._states, one.rope, strict=True):
                    mine[k] = part
        if any(has_state(effect) for effect in self._rope.effects):
            for k, effects in enumerate(self._effects):
                memories = given[k if len(given) > 1 else 0].memories
                for array, then in zip(state_arrays(effects), memories, strict=True):
                    array[...] = then
        self._time_ns = given[0].time_ns
        self._failures = {}

    def begin_from(self, live: LiveState) -> None:
        """Continue all members from the state of a live twin, on the fleet's own mesh.

        The current in force in the twin applies to the members, times their own factor.

        Raises:
            InputError: the state is that of another scene.
        """
        state, effects = on_mesh(live, self._rope, self._marks)
        self._rope = self._rope._replace(effects=effects)
        self._effects = [own_copies(effects) for _ in range(len(self))]
        self._scale()
        for mine, part in zip(self._states, state, strict=True):
            mine[:] = part
        self._time_ns = live.time_ns
        self._failures = {}

    # Steps

    def advance(self, inputs: FleetInputs, look_steps: int = 10) -> FleetRecord:
        """Advance all members that have not failed over the steps of the inputs.

        look_steps: number of steps of a look.

        Raises:
            InputError: inputs of different or wrong shapes or not finite, a line out that is not
                possible, or a look of no step.
        """
        steps = self._check(inputs, look_steps)
        looks = -(-steps // look_steps)
        made = _Record(
            np.full((steps, len(self)), np.nan), np.full((looks, FOLDS, len(self)), np.nan)
        )
        made.folds[:, LEAST] = np.inf
        whole = _Course(inputs, steps, look_steps, self.scene.ship.hang_off_m[2])
        for first in range(0, steps, BATCH_STEPS):
            some = min(BATCH_STEPS, steps - first)
            parts = list(self._sorted(whole, first + some))
            if self.threads == 1 or len(parts) == 1:
                for part in parts:
                    self._run(part, whole, (first, some), made, self._scratches[0])
            else:
                with ThreadPoolExecutor(self.threads) as pool:
                    share = [parts[k :: self.threads] for k in range(self.threads)]
                    jobs = [
                        pool.submit(self._run_all, own, whole, (first, some), made, scratch)
                        for own, scratch in zip(share, self._scratches, strict=True)
                    ]
                    for job in jobs:
                        job.result()
            self._time_ns += some * self._step_ns
        made.close()
        return FleetRecord(
            top_tension_n=made.top,
            least_tension_n=made.folds[:, LEAST],
            payload_depth_m=made.folds[:, DEPTH],
            payload_speed_m_per_s=made.folds[:, SINKING],
            payload_tension_n=made.folds[:, LOWEST],
            failures=dict(self._failures),
        )

    def _check(self, inputs: FleetInputs, look_steps: int) -> int:
        """Return the number of steps of valid inputs.

        Raises:
            InputError: see `advance`.
        """
        if look_steps < 1:
            raise InputError(phrase("fleet", f"a look of {look_steps} steps", "give at least 1"))
        first = np.shape(inputs.heave_m)[:1]
        for field in fields(inputs):
            value = np.asarray(getattr(inputs, field.name))
            if value.shape[:1] != first or value.shape[1:] not in ((), (len(self),)):
                what = f"shape {value.shape}"
                right = f"give (steps + 1,) or (steps + 1, {len(self)}), the same steps in all"
                raise InputError(phrase(f"fleet: {field.name}", what, right))
            if not np.isfinite(value).all():
                what = "a value is not finite"
                raise InputError(phrase(f"fleet: {field.name}", what, "fill gaps before"))
        steps = first[0] - 1 if first else 0
        if steps < 1:
            raise InputError(phrase("fleet", "inputs of no step", "give at least two borders"))
        line, model = np.asarray(inputs.line_out_m), self._rope.model
        going = [k for k in range(len(self)) if k not in self._failures]
        least = float(self._marks[1])
        winch = self.scene.winch
        most = winch.most_line_out_m + model.element_length if winch else np.inf
        if going and not (least < line.min() and line.max() <= most):
            what = f"{float(line.min()):g} to {float(line.max()):g} m"
            right = f"this mesh takes more than {least:g} m, and at most {most:g} m"
            raise InputError(phrase("fleet: line_out_m", what, right))
        counts, s = self._states.counts[:, rows.ELEMENTS], self._states.s
        below = s[np.arange(len(self)), counts - 1]
        short = np.broadcast_to(line[0], (len(self),)) <= below
        if short[going].any():
            k = going[int(np.argmax(short[going]))]
            what = f"member {k} has its node below the hang-off at {float(below[k]):g} m"
            right = "begin with the paid-out length of its state"
            raise InputError(phrase("fleet: line_out_m", what, right))
        return int(steps)

    def _sorted(self, course: _Course, end: int) -> Iterator[Ints]:
        """Yield members of one kind each, as many as there are lanes, or one that steps alone.

        Members with the same line out at step border `end` are neighbours: they pay out and haul in
        alike, so that elements are added and removed in all lanes of a group at once.
        """
        going = np.array([k for k in range(len(self)) if k not in self._failures], dtype=np.int64)
        line = course.line_out_m[end]
        if line.ndim:
            going = going[np.argsort(line[going], kind="stable")]
        yield from self._alike(going)

    def _alike(self, members: Ints) -> Iterator[Ints]:
        """Yield groups of members of one kind."""
        kinds: dict[Kind | int, list[int]] = {}
        for k in members.tolist():
            kinds.setdefault(self._kind_of(k) or k, []).append(k)
        for some in kinds.values():
            for first in range(0, len(some), LANES):
                yield np.array(some[first : first + LANES], dtype=np.int64)

    def _kind_of(self, member: int) -> Kind | None:
        """Return what members in lanes must share; None: the member steps alone."""
        if self._kind is None:
            return None
        elements = int(self._states.counts[member, rows.ELEMENTS])
        if not self._kind.place and elements > 1:
            return self._kind._replace(elements=elements)
        return kind_of(self._rope._replace(state=self._state_of(member)))

    def _run_all(self, parts: list[Ints], *more: object) -> None:
        for part in parts:
            self._run(part, *more)  # type: ignore[arg-type]

    def _run(
        self, members: Ints, course: _Course, batch: tuple[int, int], made: _Record, own: _Scratch
    ) -> None:
        """Do a batch of steps of members of one kind; batch: first step and number of steps."""
        waiting = [(members, 0)]
        while waiting:
            some, done = waiting.pop()
            kind = self._kind_of(int(some[0]))
            turn = _Turn(self, some, course, batch, made, own)
            if kind is None:
                turn.alone(int(some[0]), done)
            else:
                for left, at in turn.in_lanes(kind, done):
                    waiting += [(part, at) for part in self._alike(left)]


class _Course:
    """Inputs of a call, and what their boundary conditions need besides."""

    def __init__(self, inputs: FleetInputs, steps: int, look_steps: int, rest_z_m: float) -> None:
        self.steps, self.look_steps = steps, look_steps
        self.z_m = rest_z_m + np.asarray(inputs.heave_m, dtype=float)
        self.z_rate = np.asarray(inputs.heave_rate_m_per_s, dtype=float)
        self.line_out_m = np.asarray(inputs.line_out_m, dtype=float)
        self.line_speed = np.asarray(inputs.line_speed_m_per_s, dtype=float)

    def fill(self, borders: Boundary, members: Ints, first: int, place: Floats) -> None:
        """Set the borders of lanes, (rows, MOTIONS, lanes), from border `first` on.

        place: x and y of the hang-off of each member, (2, members).
        """
        rows_, lanes = len(borders.value), len(members)
        part, (value, rate) = slice(first, first + rows_), borders
        value[:, : rows.Z, :lanes], rate[:, : rows.Z] = place, 0.0
        for table, column, given in (
            (value, rows.Z, self.z_m),
            (rate, rows.Z, self.z_rate),
            (value, rows.LINE, self.line_out_m),
            (rate, rows.LINE, self.line_speed),
        ):
            own = given[part]
            table[:, column, :lanes] = own[:, members] if own.ndim > 1 else own[:, None]
        if lanes < value.shape[2]:
            value[:, :, lanes:], rate[:, :, lanes:] = value[:, :, :1], rate[:, :, :1]


class _Record:
    """Results of a call: top tension of each step, and what each look folds."""

    def __init__(self, top: Floats, folds: Floats) -> None:
        self.top, self.folds = top, folds  # (steps, members), (looks, FOLDS, members)
        self._failed: list[tuple[int, int, int]] = []

    def fold(self, look: int, member: int, now: Floats) -> None:
        """Take the values of one step of one member."""
        least = min(float(self.folds[look, LEAST, member]), float(now[LEAST]))
        self.folds[look, :, member] = now
        self.folds[look, LEAST, member] = least

    def fail(self, step: int, look: int, member: int) -> None:
        """Note the step and the look that a member failed to do."""
        self._failed.append((step, look, member))

    def close(self) -> None:
        """Withdraw values from which there is no step."""
        for step, look, member in self._failed:
            self.top[step:, member] = np.nan
            self.folds[look:, :, member] = np.nan
        least = self.folds[:, LEAST]
        least[np.isinf(least)] = np.nan


class _Scratch:
    """Scratch arrays of a thread."""

    def __init__(self, rope: Rope) -> None:
        self.work = new_work(columns_for(rope.state.s.shape[0]), rope.work.shape[0])
        self.borders = Boundary(np.zeros((2, rows.MOTIONS, 1)), np.zeros((2, rows.MOTIONS, 1)))
        self.pull: Floats = np.zeros((1, rows.PULL_COLUMNS))
        self._groups: dict[Kind, Group] = {}

    def group(self, kind: Kind, looks: int) -> Group:
        """Return arrays for members of this kind in lanes."""
        found = self._groups.get(kind)
        if found is None or len(found.folds) < looks:
            if len(self._groups) > 8:
                self._groups.clear()
            found = self._groups[kind] = Group(kind, BATCH_STEPS, looks)
        return found


class _Turn:
    """A batch of steps of members of one kind."""

    def __init__(
        self,
        fleet: Fleet,
        members: Ints,
        course: _Course,
        batch: tuple[int, int],
        made: _Record,
        own: _Scratch,
    ) -> None:
        self._fleet, self._members, self._course, self._made = fleet, members, course, made
        self._first, self._steps = batch
        self._own = own
        self._time_s = fleet._time_ns * 1e-9

    def in_lanes(self, kind: Kind, done: int) -> list[tuple[Ints, int]]:
        """Step the members in lanes after `done` steps.

        Returns members whose elements changed, and after how many steps; others take them on.
        """
        fleet, members, look = self._fleet, self._members, self._course.look_steps
        before, began = self._first // look, done
        rope, states = fleet._rope, fleet._states
        group = self._own.group(kind, (self._first % look + self._steps - 1) // look + 1)
        stack = rope._replace(state=states, sections=fleet._sections, effects=fleet._stacked)
        group.begin_stacked(stack, members)
        place = states.nodes[members, rows.POSITION : rows.POSITION + 2, kind.elements].T
        ahead = Boundary(*(table[done : self._steps + 1] for table in group.boundary))
        self._course.fill(ahead, members, self._first + done, place)
        going = dict(enumerate(members.tolist()))
        alone: dict[int, int] = dict.fromkeys(going, 0)
        changed: dict[int, list[int]] = {}
        often: list[tuple[int, int]] = []
        while going and done < self._steps:
            wanted = sum(1 << lane for lane in going)
            run = Run(self._time_s, done, self._steps, wanted, self._first, look)
            done, left = group.advance(run)
            for lane in left:
                member = going[lane]
                state = fleet._state_of(member)
                group.take(lane, state)
                if not self._step(member, done - 1, group.pulls[done - 1, :, lane]):
                    group.account(lane, state.health)
                    del going[lane]
                    continue
                alone[lane] += 1
                at = (self._first + done - 1) // look - before
                now = self._made.folds[before + at, :, member]
                least = min(group.folds[at, LEAST, lane], now[LEAST])
                group.folds[at, :, lane] = now
                group.folds[at, LEAST, lane] = least
                if state.counts[rows.ELEMENTS] != kind.elements:
                    changed.setdefault(done, []).append(member)
                elif alone[lane] > OFTEN_LEAST + OFTEN * (done - began):
                    often.append((member, done))
                else:
                    group.put(lane, state)
                    continue
                group.account(lane, state.health)
                del going[lane]
        self._harvest(group, began)
        if going:
            lanes = np.array(list(going), dtype=np.int64)
            group.take_stacked(states, members[lanes], lanes)
        for member, at in often:
            self.alone(member, at)
        return [(np.array(some, dtype=np.int64), at) for at, some in changed.items()]

    def _harvest(self, group: Group, began: int) -> None:
        """Record the results of the lanes, after `began` steps of the batch.

        Those of lanes that left are overwritten later.
        """
        made, look, count = self._made, self._course.look_steps, len(self._members)
        first, end, members = self._first + began, self._first + self._steps, self._members
        low, high = first // look, (end - 1) // look + 1
        own = group.folds[low - self._first // look : high - self._first // look, :, :count]
        made.top[first:end, members] = group.pulls[began : self._steps, rows.PULL, :count]
        least = np.minimum(made.folds[low:high, LEAST, members], own[:, LEAST])
        made.folds[low:high, :, members] = own
        made.folds[low:high, LEAST, members] = least

    def alone(self, member: int, done: int) -> None:
        """Step a member by itself to the end of the batch."""
        for step in range(done, self._steps):
            pull = self._made.top[self._first + step : self._first + step + 1, member]
            if not self._step(member, step, pull):
                return

    def _step(self, member: int, step: int, pull: Floats) -> bool:
        """Do a step of the batch for one member by itself, and fold it; return whether it went.

        pull: result, (PULL_COLUMNS,) or the tension alone.
        """
        fleet, own, course = self._fleet, self._own, self._course
        rope = fleet._lone(member)._replace(work=own.work)
        state, at = rope.state, self._first + step
        n = int(state.counts[rows.ELEMENTS])
        place = state.nodes[rows.POSITION : rows.POSITION + 2, n, None]
        course.fill(own.borders, np.array([member]), at, place)
        borders = Boundary(*(table[:, :, 0] for table in own.borders))
        time_s = self._time_s + step * fleet._rope.model.step
        if advance(rope, borders, own.pull, time_s, 1) < 1:
            number = fleet._time_ns // fleet._step_ns + step + 1
            fleet._failures[member] = step_failure(number, time_s)
            self._made.fail(at, at // course.look_steps, member)
            return False
        pull[:] = own.pull[0, : len(pull)]
        n = int(state.counts[rows.ELEMENTS])
        tension = own.work[rows.TENSION, :n]
        now = np.empty(FOLDS)
        now[LEAST], now[LOWEST] = tension.min(), tension[0]
        now[DEPTH] = payload_depth_m(rope)
        now[SINKING] = -state.nodes[rows.VELOCITY + 2, 0]
        self._made.fold(at // course.look_steps, member, now)
        return True
