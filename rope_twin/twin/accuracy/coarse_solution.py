"""Coarse solution parallel to a twin: half the elements and twice the time step, same solver.

It covers a single rope or a multi-line system: every rope is coarsened; connections, bars, sheaves
and bodies are the same. Hang-offs, paid-out lengths and current are bit-identical to the twin's,
except for a rope whose winch responds to its tension: there the coarse solution has its own winch.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body.state import RigidBody
from rope_twin.core.joined.joints import System
from rope_twin.core.joined.statics import solve_reeved_statics
from rope_twin.core.loads.memory import remembers
from rope_twin.core.state import ELEMENTS, Boundary, Floats, Rope
from rope_twin.core.statics import solve_statics
from rope_twin.core.step import advance, advance_joined
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import places, winches
from rope_twin.twin.accuracy.level import MIN_HALVED
from rope_twin.twin.accuracy.regrid import coarser, joined_as, upper_ends
from rope_twin.twin.internal_variables import own_copies
from rope_twin.twin.monitors.monitor import Chunk
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.twin.winch.payout import HangOffMotion, tension_feedback
from rope_twin.twin.winch.winch import Winch
from rope_twin.vortex.coupled import VivDragAmplification

RATIO = 2  # of the step and element length to the twin's; Richardson extrapolation takes 2
SAMPLING_RATIO = 4  # samplings of the twin's VIV model per sampling here, so six in a period


class CoarseSolution:
    """Coarse solution of a twin, started from the twin's present state.

    In a scene with a winch drive it has all elements and only twice the step: the error of a drive
    is of first order in the step, and longer elements may hide it in the difference.
    """

    def __init__(
        self, scene: Scene, now: Chunk, at_rest: bool, viv_drag: VivDragAmplification | None
    ) -> None:
        """Coarsen the ropes; at_rest: whether to solve for static equilibrium.

        viv_drag: the twin's loosely coupled VIV model.
        """
        self._scene, (value, rate) = scene, now.border
        self._value, self._rate = value, rate  # prescribed motion that it has reached
        self._pull_n: list[float] = now.pull[:, rows.PULL].tolist()
        self._viv_drag = None if viv_drag is None else viv_drag.coarse_copy(SAMPLING_RATIO)
        self._winches: dict[int, CoarseWinch] = {}  # by rope, winches that had tension feedback
        self._waiting = 0  # steps of the twin that it has not done yet
        driven = any(
            (winch.drive or winch.passive_compensation) is not None for _, winch in winches(scene)
        )
        ropes = now.ropes
        self._ropes: Rope | System
        if isinstance(ropes, Rope):
            (at,) = upper_ends(ropes, now.pull, rate[:, rows.LINE])
            coarse = copy.deepcopy(ropes) if driven else coarser(ropes, at)
            self._effects = SeparateEffects(ropes.effects)
            self._ropes = with_step_of(coarse, ropes)._replace(effects=self._effects.own)
            found = at_rest and solve_statics(self._ropes, float(value[0, rows.LINE])).found
        else:
            self._effects = SeparateEffects(ropes.ropes[0].effects)
            system = coarsened(ropes, now.pull, rate[:, rows.LINE], not driven)
            first, *others = system.ropes
            others = [rope._replace(effects=own_copies(rope.effects)) for rope in others]
            first = first._replace(effects=self._effects.own)
            self._ropes = system = system._replace(ropes=(first, *others))
            if self._viv_drag is not None:
                self._viv_drag.amplify(system.ropes)
            found = at_rest and solve_reeved_statics(system, value).found
        self.at_rest = bool(found)  # whether it started in static equilibrium

    def follow(self, chunk: Chunk) -> tuple[int, Floats] | None:
        """Advance by the twin's last steps; None: the next state would not be finite.

        Return the number of the twin's steps after which the first of its own steps ended, and its
        top tensions [N] after each of its steps, (ropes, steps): every `RATIO` steps of the twin.
        """
        first = RATIO - self._waiting
        steps, self._waiting = divmod(self._waiting + chunk.done, RATIO)
        pulls = np.zeros((len(self._value), steps, rows.PULL_COLUMNS))
        if steps > 0:
            now, given = (self._value, self._rate), chunk.boundary
            ahead = Boundary(
                *(
                    np.concatenate([own[:, None], table[:, first : chunk.done + 1 : RATIO]], axis=1)
                    for own, table in zip(now, given, strict=True)
                )
            )
            self._use_effects_of(chunk.ropes)
            step_s = self._first.model.step
            start_s = chunk.time_ns * 1e-9 - (self._waiting / RATIO + steps) * step_s
            if self._advance(ahead, pulls, start_s) < steps:
                return None
            self._value, self._rate = ahead.value[:, steps], ahead.rate[:, steps]
            self._pull_n = pulls[:, -1, rows.PULL].tolist()
        return first, pulls[:, :, rows.PULL]

    def sample_vortices(self, chunk: Chunk) -> None:
        """Sample the loosely coupled VIV model when it is due."""
        own = self._viv_drag
        if own is None or self._waiting or own.steps_to_sampling(chunk.steps) > 0:
            return
        now = Boundary(*(table[0, chunk.done :] for table in chunk.boundary))
        own.look(self.ropes, now, chunk.steps, chunk.currents)

    def share_winches(self, responding: Mapping[int, Winch]) -> None:
        """Copy winches that respond to the tension in the next step, by rope, if not yet there.

        It copies once it has reached the twin's time.
        """
        if not self._waiting:
            for r in responding.keys() - self._winches.keys():
                self._winches[r] = CoarseWinch(responding[r], self._scene, r)

    def command(self, r: int, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> None:
        """Pass a command that the twin's winch of rope r has accepted."""
        if (winch := self._winches.get(r)) is not None:
            winch.take(stamp_ns, command, now_ns)

    def invalidate(self) -> None:
        """Invalidate winch commands that were known in advance."""
        for winch in self._winches.values():
            winch.invalidate()

    @property
    def ropes(self) -> tuple[Rope, ...]:
        """Return the coarse ropes."""
        own = self._ropes
        return (own,) if isinstance(own, Rope) else own.ropes

    @property
    def winches(self) -> frozenset[int]:
        """Return the numbers of the ropes that have a winch of their own here."""
        return frozenset(self._winches)

    @property
    def viv_drag(self) -> VivDragAmplification | None:
        """Return the copy of the loosely coupled VIV model."""
        return self._viv_drag

    @property
    def top_tensions_n(self) -> list[float]:
        """Return the force on every upper end after the last coarse step [N]."""
        return list(self._pull_n)

    @property
    def payouts_m(self) -> Floats:
        """Return the paid-out length of each rope [m], (ropes,)."""
        lengths: Floats = self._value[:, rows.LINE].copy()
        return lengths

    @property
    def _first(self) -> Rope:
        return self.ropes[0]

    def _use_effects_of(self, twin: Rope | System) -> None:
        """Use the twin's present effects (another current), with own copies of those that move."""
        given = twin.effects if isinstance(twin, Rope) else twin.ropes[0].effects
        if self._effects.given is given:
            return
        effects, own = self._effects.take(given), self._ropes
        if isinstance(own, Rope):
            self._ropes = own._replace(effects=effects)
        else:
            ropes = (own.ropes[0]._replace(effects=effects), *own.ropes[1:])
            self._ropes = own._replace(ropes=ropes)

    def _advance(self, ahead: Boundary, pulls: Floats, start_s: float) -> int:
        """Advance through boundaries (ropes, steps + 1, MOTIONS); return the steps done."""
        steps = int(pulls.shape[1])
        if not self._winches:
            return self._step(ahead, pulls, start_s)
        step_s, pull_n = self._first.model.step, self._pull_n
        for k in range(steps):
            begin_s = start_s + k * step_s
            part = Boundary(*(np.ascontiguousarray(table[:, k : k + 2]) for table in ahead))
            for r, winch in self._winches.items():
                own = Boundary(*(table[r] for table in part))
                winch.prescribe(self.ropes[r], round(begin_s * 1e9), own, pull_n[r])
            end = np.zeros((len(pulls), 1, rows.PULL_COLUMNS))
            if self._step(part, end, begin_s) < 1:
                return k
            pulls[:, k], pull_n = end[:, 0], end[:, 0, rows.PULL].tolist()
            for table, done in zip(ahead, part, strict=True):
                table[:, k + 1] = done[:, 1]
        return steps

    def _step(self, ahead: Boundary, pulls: Floats, start_s: float) -> int:
        own = self._ropes
        if isinstance(own, Rope):
            only = Boundary(*(table[0] for table in ahead))
            done = advance(own, only, pulls[0], start_s, pulls.shape[1])
        else:
            done = advance_joined(own, ahead, pulls, start_s, pulls.shape[1])
        return int(done)


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


def with_step_of(rope: Rope, twin: Rope) -> Rope:
    """Return the rope with `RATIO` times the twin's step."""
    return rope._replace(model=rope.model._replace(step=RATIO * twin.model.step))


def coarsened(whole: System, pull: Floats, payout_m_per_s: Floats, halve: bool) -> System:
    """Return a copy of the system with twice the step and, if `halve`, every second node.

    pull: force of each rope on its hang-off or upper connection [N], (ropes, PULL_COLUMNS); payout:
    of the ropes that hang from the ship, (ropes,).
    """
    ropes = []
    for rope, at in zip(whole.ropes, upper_ends(whole, pull, payout_m_per_s), strict=True):
        enough = int(rope.state.counts[ELEMENTS]) >= MIN_HALVED
        ropes.append(with_step_of(coarser(rope, at) if halve and enough else rope, rope))
    return joined_as(whole, ropes)


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
