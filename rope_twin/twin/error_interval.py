"""Discretisation-error interval of the top tension, from a coarse solution parallel to the twin.

The coarse solution has half the elements and twice the step, with bit-identical
hang-off, paid-out length and current, except for a rope whose winch responds to its tension: there
it has its own winch. Every rope of a multi-line system is coarsened; connections, bars, sheaves and
bodies are the same. Where elements and step are of second order, its tension
differs from the rope's by three times the rope's error (Richardson 1911); where they are of first
order (slack, landing, a winch with tension feedback, waves that decay within an element), by the
error itself. The bound is therefore the whole difference, with a margin. The difference passes
through zero while the error does not, and after an impact it may vanish while both still ring: so
the largest difference of the last seconds counts.

Where the coarse solution cannot follow the rope, the interval is unknown, with the reason.
"""

from __future__ import annotations

import copy
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid, Plane
from rope_twin.core.bed_shape import clearance
from rope_twin.core.body.state import RigidBody
from rope_twin.core.joined.joints import LOOSE, System
from rope_twin.core.joined.statics import solve_reeved_statics
from rope_twin.core.loads.memory import remembers
from rope_twin.core.state import ELEMENTS, Boundary, Floats, Rope
from rope_twin.core.statics import solve_statics
from rope_twin.core.step import advance, advance_joined
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.rigging import places, winches
from rope_twin.scene.schema import Scene
from rope_twin.twin.level import MIN_HALVED
from rope_twin.twin.monitors import Chunk, Monitor, TwinView
from rope_twin.twin.regrid import coarser, joined_as, own_copies, upper_ends
from rope_twin.twin.snapshot import Snapshot, TensionInterval, amended
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.twin.winch.winch import Winch
from rope_twin.vortex.coupled import VivDragAmplification

MARGIN = 1.25  # bound over the largest difference: safety factor of the grid convergence index
WINDOW_S = 10.0  # largest difference so long: more than a wave period or first axial period
SETTLING_S = 20.0  # settling time of a coarse solution that was started during a run
_PLACE = slice(rows.POSITION, rows.POSITION + 3)
RATIO = 2  # of the step and element length to the twin's; Richardson extrapolation takes 2
SAMPLING_RATIO = 4  # samplings of the twin's VIV model per sampling here, so six in a period


class WindowMaximum:
    """Maximum of a series over a sliding window."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._kept: deque[tuple[float, float]] = deque()  # (time, value), values falling

    def take(self, time_s: float, value: float) -> None:
        """Add a value."""
        while self._kept and self._kept[-1][1] <= value:
            self._kept.pop()
        self._kept.append((time_s, value))

    def at(self, time_s: float) -> float:
        """Return the maximum over the window that ends at this time; 0 if it is empty."""
        while self._kept and self._kept[0][0] <= time_s - self._window_s:
            self._kept.popleft()
        return self._kept[0][1] if self._kept else 0.0


class ErrorInterval(Monitor):
    """Monitor of the error interval of the top tension of every rope that hangs from the ship.

    A saved state does not hold the coarse solution; a restored twin makes a new one.
    """

    def __init__(self, scene: Scene) -> None:
        """Make a monitor that has not started."""
        self._scene = scene
        self.coarse: CoarseSolution | None = None  # None: the interval is unknown from here on
        self._largest: dict[int, WindowMaximum] = {}  # by rope, of the difference [N]
        self._reason, self._known_from_ns = "", 0  # why it is unknown before this time
        self.took_s = 0.0  # CPU time since the start

    @property
    def ropes(self) -> tuple[int, ...]:
        """Return the numbers of the ropes that have an interval."""
        return tuple(self._largest)

    def start(self, now: TwinView, present: Chunk) -> None:
        """Start a coarse solution in static equilibrium."""
        self._begin(now, present, at_rest=True)

    def restart(self, now: TwinView, present: Chunk) -> None:
        """Start a coarse solution from the present state, unless a rope was cut."""
        if now.cut is None:
            self._begin(now, present, at_rest=False)
        else:
            self.cut(now)

    def cut(self, now: TwinView) -> None:
        """End the coarse solution."""
        assert now.cut is not None
        at = f"{now.cut.at_s:.2f} s"
        self._end(f"unknown since the cut at {at}: the coarse solution has no cut")

    def command(self, now_ns: int, rope: int, stamp_ns: int | None, command: WinchCommand) -> None:
        """Command the winch of the coarse solution, if it has one of its own."""
        if self.coarse is not None:
            self.coarse.command(rope, stamp_ns, command, now_ns)

    def invalidate(self) -> None:
        """Invalidate commands known in advance in the winches of the coarse solution."""
        if self.coarse is not None:
            self.coarse.invalidate()

    def amend(self, now: TwinView, shot: Snapshot) -> Snapshot:
        """Return the snapshot with the interval of each rope, or why it is unknown."""
        if self._reason and (self.coarse is None or now.time_ns < self._known_from_ns):
            return amended(shot, no_error_interval=self._reason)
        rest_s = now.clock.computing_s - self.took_s
        cost_pct = 100.0 * self.took_s / rest_s if rest_s > 0.0 else 0.0
        ropes = list(shot.ropes)
        for r in self.ropes if ropes else ():
            found = self.interval(r, ropes[r].tension_top_n, shot.time_s, cost_pct)
            ropes[r] = replace(ropes[r], error_interval=found)
        first = self.interval(0, shot.tension_top_n, shot.time_s, cost_pct)
        return amended(shot, error_interval=first, ropes=tuple(ropes))

    def _begin(self, seen: TwinView, now: Chunk, at_rest: bool) -> None:
        if self._scene.listed(WakeOscillatorParams) is not None:
            self._end("unknown with `wake_oscillator`: the phase of its vortices drifts")
            return
        self.coarse = CoarseSolution(self._scene, now, at_rest, seen.viv_drag)
        self._largest = {r: WindowMaximum(WINDOW_S) for r in ropes_from_ship(now.ropes)}
        self._reason, self._known_from_ns = "", 0
        if not self.coarse.at_rest:
            self._settle(now.time_ns, "its coarse solution has to settle")

    def _end(self, reason: str) -> None:
        """End the coarse solution; the interval is unknown from now on."""
        self.coarse, self._largest, self._reason = None, {}, reason

    def observe(self, now: TwinView, chunk: Chunk) -> None:
        """Advance the coarse solution by the steps just done, and compare the top tensions.

        A coarse solution whose next state would not be finite starts again from the twin's state.
        """
        if self.coarse is not None and chunk.done:
            began = time.perf_counter()
            if stands_on_bed(chunk.ropes):
                self._settle(chunk.time_ns, "the payload stood on the seabed")
            followed = self.coarse.follow(chunk)
            if followed is None:
                self._begin(now, chunk, at_rest=False)
            else:
                self.coarse.sample_vortices(chunk)
                self._compare(chunk, *followed)
            self.took_s += time.perf_counter() - began
        if self.coarse is not None and (responding := responding_winches(now)):
            with now.inputs.lock:
                self.coarse.share_winches(responding)

    def interval(self, r: int, tension_n: float, time_s: float, cost_pct: float) -> TensionInterval:
        """Return the interval of rope r around its top tension.

        cost_pct: CPU time of the interval relative to all other work.
        """
        bound = MARGIN * self._largest[r].at(time_s)
        low = max(tension_n - bound, 0.0)
        return TensionInterval(low, tension_n + bound, bound, cost_pct)

    def _settle(self, time_ns: int, why: str) -> None:
        """Make the interval unknown for the settling time from now on."""
        self._known_from_ns = time_ns + round(SETTLING_S * 1e9)
        self._reason = f"unknown until {self._known_from_ns * 1e-9:.1f} s: {why}"

    def _compare(self, chunk: Chunk, first: int, coarse_n: Floats) -> None:
        """Take the differences after every coarse step; first: step of the chunk that ends it."""
        ends = range(first, chunk.done + 1, RATIO)
        for r, largest in self._largest.items():
            own_n = chunk.pulls[r, first - 1 : chunk.done : RATIO, rows.PULL]
            for end, difference in zip(ends, np.abs(coarse_n[r] - own_n).tolist(), strict=True):
                time_s = chunk.time_ns * 1e-9 - (chunk.done - end) * chunk.step_s
                largest.take(time_s, difference)


def ropes_from_ship(ropes: Rope | System) -> tuple[int, ...]:
    """Return the numbers of the ropes whose upper end is on the ship."""
    if isinstance(ropes, Rope):
        return (0,)
    return tuple(r for r, upper in enumerate(ropes.joints.upper) if upper == LOOSE)


def stands_on_bed(ropes: Rope | System) -> bool:
    """Return whether the free lower end of a rope, or one that carries a load, is on the seabed.

    The rope above it then lies in loops that neither solution resolves, so that their difference
    does not contain the error.
    """
    ends = [ropes] if isinstance(ropes, Rope) else list(ropes.ropes)
    joined = [LOOSE] if isinstance(ropes, Rope) else ropes.joints.lower.tolist()
    bed = next((one for one in ends[0].effects if isinstance(one, Plane | Grid)), None)
    return bed is not None and any(
        bool(clearance(bed, rope.state.nodes[_PLACE, :1])[0] <= 0.0)
        for rope, lower in zip(ends, joined, strict=True)
        if lower != LOOSE or rope.model.first_free == 0
    )


def responding_winches(now: TwinView) -> dict[int, Winch]:
    """Return the winches that need tension feedback for the next step, by rope number."""
    winch = now.inputs.winch
    first = {0: winch} if winch.needs_feedback(now.time_ns) else {}
    return first | now.ropes.needing_feedback(now.time_ns)


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
        self.top_tensions_n: list[float] = now.pull[:, rows.PULL].tolist()  # after its last step
        self.viv_drag = None if viv_drag is None else viv_drag.coarse_copy(SAMPLING_RATIO)
        self.winches: dict[int, CoarseWinch] = {}  # by rope, winches that had tension feedback
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
            if self.viv_drag is not None:
                self.viv_drag.amplify(system.ropes)
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
            self.top_tensions_n = pulls[:, -1, rows.PULL].tolist()
        return first, pulls[:, :, rows.PULL]

    def sample_vortices(self, chunk: Chunk) -> None:
        """Sample the loosely coupled VIV model when it is due."""
        own = self.viv_drag
        if own is None or self._waiting or own.steps_to_sampling(chunk.steps) > 0:
            return
        now = Boundary(*(table[0, chunk.done :] for table in chunk.boundary))
        own.look(self.ropes, now, chunk.steps, chunk.currents)

    def share_winches(self, responding: Mapping[int, Winch]) -> None:
        """Copy winches that respond to the tension in the next step, by rope, if not yet there.

        It copies once it has reached the twin's time.
        """
        if not self._waiting:
            for r in responding.keys() - self.winches.keys():
                self.winches[r] = CoarseWinch(responding[r], self._scene, r)

    def command(self, r: int, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> None:
        """Pass a command that the twin's winch of rope r has accepted."""
        if (winch := self.winches.get(r)) is not None:
            winch.take(stamp_ns, command, now_ns)

    def invalidate(self) -> None:
        """Invalidate winch commands that were known in advance."""
        for winch in self.winches.values():
            winch.invalidate()

    @property
    def ropes(self) -> tuple[Rope, ...]:
        """Return the coarse ropes."""
        own = self._ropes
        return (own,) if isinstance(own, Rope) else own.ropes

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
        if not self.winches:
            return self._step(ahead, pulls, start_s)
        step_s, pull_n = self._first.model.step, self.top_tensions_n
        for k in range(steps):
            begin_s = start_s + k * step_s
            part = Boundary(*(np.ascontiguousarray(table[:, k : k + 2]) for table in ahead))
            for r, winch in self.winches.items():
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
            feedback = self._winch.feedback(rope, self._line, pull_n, value, self._rest_z)
        heaving = float(rate[1, rows.Z])
        value[1, rows.LINE], rate[1, rows.LINE] = self._winch.step(
            begin_ns, rope.model.step, heaving, feedback
        )
