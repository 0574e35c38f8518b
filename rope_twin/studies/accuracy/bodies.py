"""Models of a convergence study: a line or a multi-line system that can be reset to equilibrium."""

from __future__ import annotations

import copy
from typing import Any, Protocol

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import LOOSE, loaded_ends
from rope_twin.core.joined.statics import solve_reeved_statics
from rope_twin.core.state import Boundary, Floats, Ints
from rope_twin.core.step import advance, advance_joined
from rope_twin.scene.model.joined import build_joined
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import is_joined
from rope_twin.scene.validation.vortices import coupled_settings, model_beside
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.statics import check_equilibrium, solve_scene_statics
from rope_twin.vortex.coupled import VivDragAmplification


class Body(Protocol):
    """Something at rest that can be stepped."""

    memory_mb: float  # of all arrays that the steps work on

    def begin(self) -> None:
        """Reset to static equilibrium."""

    def advance(self, motion: Boundary, time: float, steps: int) -> tuple[int, Floats]:
        """Return the number of steps done, and the top tension after each [N], (steps,)."""

    def depth_m(self) -> float:
        """Return the depth of the lower end, or of the first payload [m]."""

    def is_slack(self) -> bool:
        """Return whether any element is slack."""

    @property
    def health(self) -> Ints:
        """Return the solver's counts since the start."""


def body_of(scene: Scene) -> Body:
    """Return the model of a scene.

    Raises:
        SceneError: it cannot be built, or has no equilibrium.
    """
    body = JoinedBody(scene) if is_joined(scene) else RopeBody(scene)
    return body if model_beside(scene) is None else ShakenBody(scene, body)


class RopeBody:
    """One rope; its motion is (steps + 1, MOTIONS)."""

    loaded = (False,)  # whether the upper end of a rope carries loads

    def __init__(self, scene: Scene) -> None:
        self._rope = rope = build(scene)
        solve_scene_statics(scene, rope)
        self._start = copy.deepcopy(rope)  # wakes and a rigid body are kept in the effects
        self.memory_mb = _memory_mb((rope.state, rope.work, rope.sections, rope.effects, rope.law))

    def begin(self) -> None:
        """Reset to static equilibrium."""
        self._rope = copy.deepcopy(self._start)

    def advance(self, motion: Boundary, time: float, steps: int) -> tuple[int, Floats]:
        """Return the number of steps done, and the top tension after each [N]."""
        pull = np.zeros((steps, rows.PULL_COLUMNS))
        return advance(self._rope, motion, pull, time, steps), pull[:, rows.PULL]

    def depth_m(self) -> float:
        """Return the depth of the lower end [m]."""
        return -float(self._rope.state.nodes[rows.POSITION + 2, 0])

    def is_slack(self) -> bool:
        """Return whether any element is slack."""
        return _is_slack(self._rope)

    @property
    def ropes(self) -> tuple[rows.Rope, ...]:
        """Return the rope."""
        return (self._rope,)

    @property
    def health(self) -> Ints:
        """Return the solver's counts since the start."""
        return self._rope.state.health


class JoinedBody:
    """Multi-line system; its motion is (ropes, steps + 1, MOTIONS), its top tension the first
    rope's.
    """

    def __init__(self, scene: Scene) -> None:
        built = build_joined(scene)
        self._system = system = built.system
        place = np.zeros((len(system.ropes), rows.MOTIONS))
        place[:, : rows.LINE] = np.nan_to_num(built.hang_off_m)
        place[:, rows.LINE] = [line.length_m for line in scene.ropes]
        end = solve_reeved_statics(system, place)
        check_equilibrium(scene, end, max(self._highest(r) for r in range(len(system.ropes))))
        self._lowest = built.owners[scene.payloads[0].name] if scene.payloads else 0
        stack = system.stack
        state = (stack.nodes, stack.s, stack.offset, stack.counts, stack.health)
        self._tables = _arrays((state, system.joints.nodes, system.joints.ties, system.sheaves))
        self._start = [table.copy() for table in self._tables]
        self.memory_mb = _memory_mb((stack, system.joints, system.sheaves))

    def begin(self) -> None:
        """Reset to static equilibrium."""
        for table, start in zip(self._tables, self._start, strict=True):
            table[...] = start

    def advance(self, motion: Boundary, time: float, steps: int) -> tuple[int, Floats]:
        """Return the number of steps done, and the first rope's top tension after each [N]."""
        pull = np.zeros((len(self._system.ropes), steps, rows.PULL_COLUMNS))
        return advance_joined(self._system, motion, pull, time, steps), pull[0, :, rows.PULL]

    def depth_m(self) -> float:
        """Return the depth of the first payload [m]."""
        return -float(self._system.ropes[self._lowest].state.nodes[rows.POSITION + 2, 0])

    def is_slack(self) -> bool:
        """Return whether any element of any rope is slack."""
        return any(_is_slack(rope) for rope in self._system.ropes)

    @property
    def ropes(self) -> tuple[rows.Rope, ...]:
        """Return the ropes."""
        return self._system.ropes

    @property
    def loaded(self) -> tuple[bool, ...]:
        """Return whether the upper end of each rope carries loads."""
        return loaded_ends(self._system)

    @property
    def health(self) -> Ints:
        """Return the solver's counts since the start, which the first rope stores."""
        return self._system.ropes[0].state.health

    def _highest(self, r: int) -> float:
        """Return the height of the highest node of rope r below its hang-off [m]."""
        rope, joints = self._system.ropes[r], self._system.joints
        count = int(rope.state.counts[rows.ELEMENTS]) + int(joints.upper[r] != LOOSE)
        return float(rope.state.nodes[rows.POSITION + 2, :count].max())


class ShakenBody:
    """Line or multi-line system with a VIV model outside the time step, updated as in a twin."""

    def __init__(self, scene: Scene, body: RopeBody | JoinedBody) -> None:
        self._scene, self._body = scene, body
        self.memory_mb = body.memory_mb
        self._steps = 0  # done since the beginning
        self._shake()

    def begin(self) -> None:
        """Reset to static equilibrium, without vibration."""
        self._body.begin()
        self._shake()

    def advance(self, motion: Boundary, time: float, steps: int) -> tuple[int, Floats]:
        """Return the number of steps done, and the top tension after each [N]."""
        pull, done = np.zeros(steps), 0
        while done < steps:
            count = min(steps - done, self._viv_drag.steps_to_sampling(self._steps))
            part = Boundary(
                *(np.ascontiguousarray(table[..., done : done + count + 1, :]) for table in motion)
            )
            at_s = time + done * self._body.ropes[0].model.step
            went, pull[done : done + count] = self._body.advance(part, at_s, count)
            done, self._steps = done + went, self._steps + went
            if went < count:
                break
            if self._viv_drag.steps_to_sampling(self._steps) == 0:
                first = (table if table.ndim == 2 else table[0] for table in motion)
                now = Boundary(*(table[done:] for table in first))
                self._viv_drag.look(self._body.ropes, now, self._steps, 0)
        return done, pull

    def depth_m(self) -> float:
        """Return the depth of the lower end, or of the first payload [m]."""
        return self._body.depth_m()

    def is_slack(self) -> bool:
        """Return whether any element is slack."""
        return self._body.is_slack()

    @property
    def health(self) -> Ints:
        """Return the solver's counts since the start."""
        return self._body.health

    def _shake(self) -> None:
        cycle, body = steps_in_slot(self._scene.time.step_s), self._body
        settings = coupled_settings(self._scene)
        self._viv_drag = VivDragAmplification(settings, body.ropes, body.loaded, cycle)
        self._steps = 0


def _is_slack(rope: rows.Rope) -> bool:
    count = rope.state.counts[rows.ELEMENTS]
    return bool(rope.work[rows.TENSION, :count].min() <= 0.0)


def _arrays(value: Any) -> list[Any]:
    """Return all arrays in a nested tuple."""
    if isinstance(value, np.ndarray):
        return [value]
    return [one for part in value for one in _arrays(part)] if isinstance(value, tuple) else []


def _memory_mb(value: Any) -> float:
    return 1e-6 * float(sum(table.nbytes for table in _arrays(value)))
