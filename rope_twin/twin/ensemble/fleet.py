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

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.lanes.step import DEPTH, LEAST, LOWEST, SINKING
from rope_twin.core.state import Floats, State
from rope_twin.errors import InputError, phrase
from rope_twin.scene.load import at_setting, load_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import model_beside
from rope_twin.twin.ensemble.fleet_stretch import (
    STRETCH_STEPS,
    Course,
    FleetMembers,
    Record,
    Scratch,
    Stretch,
)
from rope_twin.twin.ensemble.live_state import LiveState, live_state, on_mesh
from rope_twin.twin.figures import FIGURES, Factors, checked_factors, figures_of
from rope_twin.twin.regrid import state_arrays
from rope_twin.twin.statics import solve_scene_statics

__all__ = [
    "FIGURES", "Fleet", "FleetInputs", "FleetRecord", "FleetState", "LiveState", "live_state",
]  # fmt: skip

LEAP_M = 1.0  # of the line out at the beginning: more stretches the top element beyond any rope


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
        rope = build(self.scene)
        solve_scene_statics(self.scene, rope)
        self._marks = rope.state.s[: rope.state.counts[rows.ELEMENTS] + 1].copy()
        self._members = FleetMembers(rope, members)
        self._step_ns = round(self.scene.time.step_s * 1e9)
        self._time_ns = 0
        self._scratches = [Scratch(rope) for _ in range(threads)]

    def __len__(self) -> int:
        """Return the number of members, including failed ones."""
        return self._members.count

    @property
    def time_s(self) -> float:
        """Time of all members [s]."""
        return self._time_ns * 1e-9

    @property
    def figures(self) -> tuple[str, ...]:
        """Figures that the scene has, in the order of FIGURES."""
        return figures_of(self._members.rope)

    # Figures

    def set_figures(self, factors: Factors) -> None:
        """Set figures of all members as factors on the scene's values; others are kept.

        factors: by name of FIGURES, a number or one for each member. The members' motion and state
        stay as they are: a rope whose weight or stiffness jumps rings.

        Raises:
            InputError: an unknown figure or one that the scene does not have, a factor that is not
                finite and positive, or a wrong number of factors.
        """
        self._members.factors |= checked_factors(factors, self.figures, len(self))
        self._members.scale()

    # States

    def state(self, member: int) -> FleetState:
        """Return a copy of a member's state."""
        members = self._members
        memories = tuple(array.copy() for array in state_arrays(members.effects_of(member)))
        return FleetState(self._time_ns, members.state_of(member).copy(), memories)

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
        members = self._members
        room = members.states.nodes.shape[1:]
        for one in given:
            if one.rope.nodes.shape != room:
                what = f"a state with space for {one.rope.s.size} nodes, not {room[1]}"
                right = "give states of a fleet of this scene and mesh"
                raise InputError(phrase("fleet", what, right))
        if members.remember:
            count = sum(1 for _ in state_arrays(members.effects[0]))
            for one in given:
                if len(one.memories) != count:
                    what = f"a state with {len(one.memories)} internal variables, not {count}"
                    right = "give states that `Fleet.state` returned for this scene"
                    raise InputError(phrase("fleet", what, right))
        if isinstance(states, FleetState):
            members.set_all(states.rope)
        else:
            for k, one in enumerate(given):
                for mine, part in zip(members.states, one.rope, strict=True):
                    mine[k] = part
        if members.remember:
            for k, effects in enumerate(members.effects):
                memories = given[min(k, len(given) - 1)].memories
                for array, then in zip(state_arrays(effects), memories, strict=True):
                    array[...] = then
        self._time_ns = given[0].time_ns
        members.failures = {}

    def begin_from(self, live: LiveState) -> None:
        """Continue all members from the state of a live twin, on the fleet's own mesh.

        The current in force in the twin applies to the members, times their own factor.

        Raises:
            InputError: the state is that of another scene.
        """
        members = self._members
        state, effects = on_mesh(live, members.rope, self._marks)
        members.adopt(effects)
        members.set_all(state)
        self._time_ns = live.time_ns
        members.failures = {}

    # Steps

    def advance(self, inputs: FleetInputs, look_steps: int = 10) -> FleetRecord:
        """Advance all members that have not failed over the steps of the inputs.

        look_steps: number of steps of a look.

        Raises:
            InputError: inputs of different or wrong shapes or not finite, a line out that is not
                possible, or a look of no step.
        """
        steps = self._check(inputs, look_steps)
        made = Record(steps, -(-steps // look_steps), len(self))
        course = Course(
            self.scene.ship.hang_off_m[2] + np.asarray(inputs.heave_m, dtype=float),
            np.asarray(inputs.heave_rate_m_per_s, dtype=float),
            np.asarray(inputs.line_out_m, dtype=float),
            np.asarray(inputs.line_speed_m_per_s, dtype=float),
            look_steps,
        )
        for first in range(0, steps, STRETCH_STEPS):
            some = min(STRETCH_STEPS, steps - first)
            self._run(Stretch(self._members, course, made, first, some, self._time_ns))
            self._time_ns += some * self._step_ns
        made.close()
        return FleetRecord(
            top_tension_n=made.top,
            least_tension_n=made.folds[:, LEAST],
            payload_depth_m=made.folds[:, DEPTH],
            payload_speed_m_per_s=made.folds[:, SINKING],
            payload_tension_n=made.folds[:, LOWEST],
            failures=dict(self._members.failures),
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
        self._check_line(np.asarray(inputs.line_out_m))
        return int(steps)

    def _check_line(self, line_m: Floats) -> None:
        """Check that members can have this line out, (steps + 1,) or (steps + 1, members).

        Raises:
            InputError: they cannot.
        """
        members, winch = self._members, self.scene.winch
        least = float(self._marks[1])
        most = winch.most_line_out_m + members.rope.model.element_length if winch else np.inf
        if not (least < line_m.min() and line_m.max() <= most):
            what = f"{float(line_m.min()):g} to {float(line_m.max()):g} m"
            right = f"this mesh takes more than {least:g} m, and at most {most:g} m"
            raise InputError(phrase("fleet: line_out_m", what, right))
        all_ = np.arange(len(self))
        top = members.states.counts[:, rows.ELEMENTS]
        length, below = members.states.s[all_, top], members.states.s[all_, top - 1]
        wrong = (abs(line_m[0] - length) > LEAP_M) | (line_m[0] <= below)
        for k in np.flatnonzero(wrong).tolist():
            if k not in members.failures:
                first = float(np.broadcast_to(line_m[0], (len(self),))[k])
                what = f"it begins at {first:g} m, member {k} has {length[k]:g} m of rope out"
                right = f"begin within {LEAP_M:g} m of the member's state"
                raise InputError(phrase("fleet: line_out_m", what, right))

    def _run(self, stretch: Stretch) -> None:
        """Do the steps of a stretch."""
        groups = stretch.groups()
        if self.threads == 1 or len(groups) == 1:
            for group in groups:
                stretch.run(group, self._scratches[0])
            return

        def turn(number: int) -> None:
            for group in groups[number :: self.threads]:
                stretch.run(group, self._scratches[number])

        with ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(turn, range(self.threads)))
