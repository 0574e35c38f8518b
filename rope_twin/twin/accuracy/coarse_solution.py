"""Coarse solution parallel to a twin: half the elements and twice the time step, same solver.

It covers a single rope or a multi-line system: every rope is coarsened; connections, bars, sheaves
and bodies are the same. Hang-offs, paid-out lengths and current are bit-identical to the twin's,
except for a rope whose winch responds to its tension: there the coarse solution has its own winch.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body.state import RigidBody
from rope_twin.core.joined.joints import LOOSE, System, new_system, with_flows
from rope_twin.core.joined.reeving import solve_reeved_statics
from rope_twin.core.joined.sheaves import FLOW_COLUMN
from rope_twin.core.joined.step import advance_joined
from rope_twin.core.solve.remembering import remembers
from rope_twin.core.state import ELEMENTS, Boundary, Floats, Rope
from rope_twin.core.statics.equilibrium import solve_statics
from rope_twin.core.step import advance
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import places
from rope_twin.twin.accuracy.error_bound import EVERY
from rope_twin.twin.accuracy.regrid import HangOff, coarser
from rope_twin.twin.motion.boundary_conditions import STEPS_PER_CALL
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.twin.winch.payout import HangOffMotion, tension_feedback
from rope_twin.twin.winch.winch import Winch
from rope_twin.vortex.coupled import VivDragAmplification

SAMPLING_RATIO = 4  # samplings of the twin's VIV model per sampling here, so six in a period
MIN_ELEMENTS = 4  # elements: a rope with fewer is not coarsened, as joined ropes need at least two


class CoarseSolution(Protocol):
    """Interface of a coarse solution."""

    rests: bool  # it started in static equilibrium
    waiting: int  # steps of the twin that it has not done yet
    winches: dict[int, CoarseWinch]  # by rope, winches that have used tension feedback

    def follow(
        self, boundary: Boundary, done: int, effects: Any, time_s: float
    ) -> list[float] | None:
        """Advance by the twin's last `done` steps up to `time_s`; return the top tensions [N].

        boundary: of the twin's first rope, row 0 before those steps. None: the next state would not
        be finite.
        """

    def look(self, boundary: Boundary, steps: int, currents: int) -> None:
        """Sample the loosely coupled VIV model, when it is due; steps: done by the twin."""

    def drag_amplification(self) -> Floats:
        """Return the drag amplification at the nodes, from the lower end up."""

    def further(self, r: int) -> list[float]:
        """Return the top tensions of another rope from the ship in the last `follow` [N]."""


class CoarseRope:
    """Coarse solution of a single rope; with a winch drive it keeps the elements."""

    def __init__(
        self,
        rope: Rope,
        at: HangOff,
        border: tuple[Floats, Floats],
        resting: bool,
        elements: bool = True,
        viv_drag: VivDragAmplification | None = None,
    ) -> None:
        """Coarsen the rope at `border`, value and rate of the prescribed motion now.

        resting: whether to solve for static equilibrium; elements: whether to halve their number,
        or only to double the step; shaking: the twin's loosely coupled VIV model.
        """
        self._viv_drag = None if viv_drag is None else viv_drag.coarse_copy(SAMPLING_RATIO)
        half = coarser(rope, at) if elements else copy.deepcopy(rope)
        self._effects = SeparateEffects(rope.effects)
        self._rope = half._replace(
            model=half.model._replace(step=EVERY * rope.model.step), effects=self._effects.own
        )
        self.rests = resting and solve_statics(self._rope, float(border[0][rows.LINE])).found
        room = (STEPS_PER_CALL // EVERY + 2, rows.MOTIONS)
        self._ahead = Boundary(np.zeros(room), np.zeros(room))
        self._ahead.value[0], self._ahead.rate[0] = border
        self.waiting = 0
        self.winches: dict[int, CoarseWinch] = {}
        self._pulls = np.zeros((STEPS_PER_CALL, rows.PULL_COLUMNS))
        self._pull_n = float(np.linalg.norm(at.pull_n))

    def follow(
        self, boundary: Boundary, done: int, effects: Any, time_s: float
    ) -> list[float] | None:
        """Advance by the twin's last steps; return the top tensions [N], or None if it failed."""
        first = EVERY - self.waiting  # row of the boundary at which its next step ends
        steps, self.waiting = divmod(self.waiting + done, EVERY)
        if steps == 0:
            return []
        value, rate = self._ahead
        value[1 : steps + 1] = boundary.value[first : done + 1 : EVERY]
        rate[1 : steps + 1] = boundary.rate[first : done + 1 : EVERY]
        if self._effects.given is not effects:
            self._rope = self._rope._replace(effects=self._effects.take(effects))
        step = self._rope.model.step
        start_s = time_s - (self.waiting / EVERY + steps) * step
        if self._advance(start_s, steps) < steps:
            return None
        value[0], rate[0] = value[steps], rate[steps]
        tensions: list[float] = self._pulls[:steps, rows.PULL].tolist()
        self._pull_n = tensions[-1]
        return tensions

    def drag_amplification(self) -> Floats:
        """Return the drag amplification by its loosely coupled VIV model at the nodes."""
        assert self._viv_drag is not None
        return self._viv_drag.drag_amplification(self._rope)

    def look(self, boundary: Boundary, steps: int, currents: int) -> None:
        """Sample its loosely coupled VIV model when due."""
        own = self._viv_drag
        if own is not None and self.waiting == 0 and own.steps_to_sampling(steps) <= 0:
            own.look(self._rope, boundary, steps, currents)

    def _advance(self, start_s: float, steps: int) -> int:
        """Advance through the step boundaries ahead; return the number of steps done."""
        if not self.winches:
            return advance(self._rope, self._ahead, self._pulls, start_s, steps)
        pull_n, step = self._pull_n, self._rope.model.step
        for k in range(steps):
            borders = Boundary(*(table[k : k + 2] for table in self._ahead))
            begin_s = start_s + k * step
            self.winches[0].prescribe(self._rope, round(begin_s * 1e9), borders, pull_n)
            if advance(self._rope, borders, self._pulls[k:], begin_s, 1) < 1:
                return k
            pull_n = float(self._pulls[k, rows.PULL])
        return steps

    def further(self, r: int) -> list[float]:
        """Raise KeyError, as there is no other rope."""
        raise KeyError(r)


class MultiLineSystem(Protocol):
    """Multi-line system of a twin after a call of `advance`."""

    pull: Floats  # force on each upper end now [N], (ropes, PULL_COLUMNS)
    moved: Boundary  # hang-offs and payouts in the last call, (ropes, steps + 1, MOTIONS)

    def system(self, first: Rope) -> System:
        """Return the system of all ropes."""

    def borders(self, boundary: Boundary, steps: int) -> Boundary:
        """Return hang-offs and paid-out lengths of coming steps, (ropes, steps + 1, MOTIONS)."""


class CoarseSystem:
    """Coarse solution of a multi-line system; with a winch drive it keeps the elements."""

    def __init__(
        self,
        ropes: MultiLineSystem,
        first: Rope,
        boundary: Boundary,
        border: int,
        resting: bool,
        elements: bool = True,
    ) -> None:
        """Coarsen the ropes; boundary: of the first rope, row `border` is the present.

        resting: whether to solve for static equilibrium; elements: whether to halve their number,
        or only to double the step.
        """
        self._ropes, whole = ropes, ropes.system(first)
        value, rate = (table[:, border] for table in ropes.borders(boundary, border))
        joints = whole.joints
        # prescribed motion now of the ropes that hang from the ship
        self.hang_offs = {
            r: (value[r].copy(), rate[r].copy())
            for r, upper in enumerate(joints.upper)
            if upper == LOOSE
        }
        self.made_fast = [
            bool(lower == LOOSE and rope.model.first_free == 1)
            for lower, rope in zip(joints.lower, whole.ropes, strict=True)
        ]
        self._system = (
            coarsened(whole, ropes.pull, rate[:, rows.LINE])
            if elements
            else _joined_as(whole, [_with_step_doubled(rope, rope) for rope in whole.ropes])
        )
        self.rests = resting and solve_reeved_statics(self._system, value).found
        self._now = value.copy(), rate.copy()
        self.waiting = 0
        self.winches: dict[int, CoarseWinch] = {}
        self._pulls = np.zeros((len(whole.ropes), 0, rows.PULL_COLUMNS))
        self._pull_n: list[float] = ropes.pull[:, rows.PULL].tolist()

    def follow(
        self, boundary: Boundary, done: int, effects: Any, time_s: float
    ) -> list[float] | None:
        """Advance by the twin's last steps; return the top tensions [N], or None if it failed."""
        first = EVERY - self.waiting
        steps, self.waiting = divmod(self.waiting + done, EVERY)
        if steps == 0:
            return []
        moved, room = self._ropes.moved, (len(self._now[0]), steps + 1, rows.MOTIONS)
        ahead = Boundary(np.empty(room), np.empty(room))
        for table, now, given in zip(ahead, self._now, moved, strict=True):
            table[:, 0], table[:, 1:] = now, given[:, first : done + 1 : EVERY]
        system = self._system
        if system.ropes[0].effects is not effects:
            ropes = (system.ropes[0]._replace(effects=effects), *system.ropes[1:])
            self._system = system = system._replace(ropes=ropes)
        step = system.ropes[0].model.step
        start_s = time_s - (self.waiting / EVERY + steps) * step
        self._pulls = np.zeros((len(system.ropes), steps, rows.PULL_COLUMNS))
        if self._advance(ahead, start_s, steps) < steps:
            return None
        self._now = ahead.value[:, steps], ahead.rate[:, steps]
        self._pull_n = self._pulls[:, -1, rows.PULL].tolist()
        return self.further(0)

    def _advance(self, ahead: Boundary, start_s: float, steps: int) -> int:
        """Advance through boundaries (ropes, steps + 1, MOTIONS); return the steps done."""
        system = self._system
        if not self.winches:
            return advance_joined(system, ahead, self._pulls, start_s, steps)
        step, pull_n = system.ropes[0].model.step, self._pull_n
        for k in range(steps):
            borders, begin_s = [table[:, k : k + 2] for table in ahead], start_s + k * step
            for r, winch in self.winches.items():
                own = Boundary(*(table[r] for table in borders))
                winch.prescribe(system.ropes[r], round(begin_s * 1e9), own, pull_n[r])
            pulls = self._pulls[:, k : k + 1].copy()
            given = Boundary(*map(np.ascontiguousarray, borders))
            if advance_joined(system, given, pulls, begin_s, 1) < 1:
                return k
            self._pulls[:, k : k + 1], pull_n = pulls, pulls[:, 0, rows.PULL].tolist()
        return steps

    def drag_amplification(self) -> Floats:
        """Raise TypeError, as multi-line systems have no loosely coupled VIV model."""
        raise TypeError

    def look(self, boundary: Boundary, steps: int, currents: int) -> None:
        """Do nothing, as multi-line systems have no loosely coupled VIV model."""

    def further(self, r: int) -> list[float]:
        """Return the top tensions of rope r in the last `follow` [N]."""
        tensions: list[float] = self._pulls[r, :, rows.PULL].tolist()
        return tensions


class SeparateEffects:
    """Effects of the twin, with separate copies of those that hold a state.

    A rigid body holds its position; vortex models hold a phase or a wake at each node, which the
    core transfers to the coarse nodes by their material coordinates.
    """

    def __init__(self, effects: tuple[Any, ...]) -> None:
        self._apart = {
            place: copy.deepcopy(one)
            for place, one in enumerate(effects)
            if isinstance(one, RigidBody) or remembers([type(one)])
        }
        self.own = self.take(effects)

    def take(self, effects: tuple[Any, ...]) -> tuple[Any, ...]:
        """Take the twin's present effects (another current); return them with the copies."""
        self.given = effects
        if self._apart:
            effects = tuple(self._apart.get(place, one) for place, one in enumerate(effects))
        self.own = effects
        return effects


def coarsened(whole: System, pull: Floats, payout_m_per_s: Floats) -> System:
    """Return the system with every rope on every second node and twice the step.

    Connections stay. pull: force of each rope on its hang-off or upper connection [N], (ropes,
    PULL_COLUMNS); payout: of the ropes that hang from the ship, (ropes,).
    """
    passing = _passing_m_per_s(whole)
    ropes = []
    for r, rope in enumerate(whole.ropes):
        loose = whole.joints.upper[r] == LOOSE
        speed = float(payout_m_per_s[r]) if loose else passing[r]
        at = HangOff(pull[r, rows.PULL_X : rows.PULL_Z + 1].copy(), speed)
        half = rope if int(rope.state.counts[ELEMENTS]) < MIN_ELEMENTS else coarser(rope, at)
        ropes.append(_with_step_doubled(half, rope))
    return _joined_as(whole, ropes)


def _with_step_doubled(rope: Rope, twin: Rope) -> Rope:
    """Return the rope with twice the twin's step."""
    return rope._replace(model=rope.model._replace(step=EVERY * twin.model.step))


def _passing_m_per_s(whole: System) -> list[float]:
    """Return the rate at which each rope grows at a sheave [m/s]; 0 where there is none."""
    sheaves = whole.sheaves
    if sheaves is None:
        return [0.0] * len(whole.ropes)
    speeds = []
    for of, side in zip(sheaves.of, sheaves.side, strict=True):
        flow = int(sheaves.figures[FLOW_COLUMN, of]) if of >= 0 else -1
        passes = float(side) * float(whole.joints.nodes[rows.VELOCITY, flow]) if of >= 0 else 0.0
        speeds.append(passes)
    return speeds


def _joined_as(whole: System, ropes: Sequence[Rope]) -> System:
    """Return these ropes in a system with copies of the connections and sheaves of `whole`."""
    joints, sheaves = whole.joints, whole.sheaves
    found = new_system(tuple(ropes), list(joints.lower), list(joints.upper), joints.ties.copy())
    if sheaves is not None:
        flows = with_flows(found.joints, sheaves.figures.shape[1])
        found = found._replace(joints=flows, sheaves=copy.deepcopy(sheaves))
    found.joints.nodes[:] = joints.nodes
    return found


class CoarseWinch:
    """Winch of one rope of the coarse solution, where its winch responds to the tension.

    A drive that renders, a brake that slips, a command by depth or tension pay out by the rope's
    response, so part of the rope's error is in the paid-out length. The coarse winch is a copy of
    the twin's at the moment of its first tension feedback; it gets the same commands and the coarse
    tension.
    """

    def __init__(self, winch: Winch, scene: Scene, r: int) -> None:
        """Copy the twin's winch of rope r at the time that the coarse solution has reached."""
        self._winch = copy.deepcopy(winch)
        self._line = scene.ropes[r]
        self._rest_z = places(scene)[self._line.from_][2]

    def take(self, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> None:
        """Take a command that the twin's winch has accepted; rejections were counted there."""
        self._winch.take(stamp_ns, command, now_ns)

    def invalidate(self) -> None:
        """Invalidate commands that were known in advance."""
        self._winch.invalidate()

    def prescribe(self, rope: Rope, begin_ns: int, borders: Boundary, pull_n: float) -> None:
        """Set the paid-out length at the end of the step that begins now.

        borders: at the step's beginning and end, (2, rows.MOTIONS) each; the hang-off's motion is
        already there. pull_n: tension at the hang-off now [N].
        """
        value, rate = borders
        feedback = None
        if self._winch.needs_feedback(begin_ns):
            heave = float(value[0, rows.Z]) - self._rest_z
            course = HangOffMotion(heave, self._winch.payout_m_per_s2)
            feedback = tension_feedback(rope, self._line, pull_n, value, course)
        heaving = float(rate[1, rows.Z])
        value[1, rows.LINE], rate[1, rows.LINE] = self._winch.step(
            begin_ns, rope.model.step, heaving, feedback
        )
