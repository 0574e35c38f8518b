"""Discretisation-error interval of the top tension, from a coarse solution parallel to the twin.

The coarse solution has half the elements and twice the step, with bit-identical
hang-off, paid-out length and current, except for a rope whose winch responds to its tension: there
it has its own winch. Every rope of a multi-line system is coarsened; connections, bars, sheaves and
bodies are the same. Where elements and step are of second order, its tension
differs from the rope's by three times the rope's error (Richardson 1911); where they are of first
order (slack, landing, a winch with tension feedback, waves that decay within an element), by the
error itself. The bound is therefore the whole difference, with a margin. The difference passes
through zero while the error does not, and after an impact it may vanish while both still oscillate:
the largest difference of the last seconds is used.

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
from rope_twin.core.loads.memory import have_internal_variables
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
WINDOW_S = 10.0  # window of the largest difference: more than a wave or first axial period
SETTLING_S = 20.0  # settling time of a coarse solution that was started during a run
_POSITION = slice(rows.POSITION, rows.POSITION + 3)
RATIO = 2  # of the step and element length to the twin's; Richardson extrapolation takes 2
SAMPLING_RATIO = 4  # samplings of the twin's VIV model per sampling here, so six in a period


class WindowMaximum:
    """Maximum of a series over a sliding window."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._decreasing: deque[tuple[float, float]] = deque()  # (time, value), values falling

    def take(self, time_s: float, value: float) -> None:
        """Add a value."""
        while self._decreasing and self._decreasing[-1][1] <= value:
            self._decreasing.pop()
        self._decreasing.append((time_s, value))

    def at(self, time_s: float) -> float:
        """Return the maximum over the window that ends at this time; 0 if it is empty."""
        while self._decreasing and self._decreasing[0][0] <= time_s - self._window_s:
            self._decreasing.popleft()
        return self._decreasing[0][1] if self._decreasing else 0.0


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
        self.computing_s = 0.0  # spent on the interval since the start

    @property
    def ropes(self) -> tuple[int, ...]:
        """Return the numbers of the ropes that have an interval."""
        return tuple(self._largest)

    def start(self, view: TwinView, present: Chunk) -> None:
        """Start a coarse solution in static equilibrium."""
        self._begin(view, present, at_rest=True)

    def restart(self, view: TwinView, present: Chunk) -> None:
        """Start a coarse solution from the present state, unless a rope was cut."""
        if view.cut is None:
            self._begin(view, present, at_rest=False)
        else:
            self.cut(view)

    def cut(self, view: TwinView) -> None:
        """End the coarse solution."""
        assert view.cut is not None
        at = f"{view.cut.at_s:.2f} s"
        self._end(f"unknown since the cut at {at}: the coarse solution has no cut")

    def command(self, now_ns: int, rope: int, stamp_ns: int | None, command: WinchCommand) -> None:
        """Command the winch of the coarse solution, if it has one of its own."""
        if self.coarse is not None:
            self.coarse.command(rope, stamp_ns, command, now_ns)

    def invalidate(self) -> None:
        """Invalidate commands known in advance in the winches of the coarse solution."""
        if self.coarse is not None:
            self.coarse.invalidate()

    def amend(self, view: TwinView, snapshot: Snapshot) -> Snapshot:
        """Return the snapshot with the interval of each rope, or why it is unknown."""
        if self._reason and (self.coarse is None or view.time_ns < self._known_from_ns):
            return amended(snapshot, no_error_interval=self._reason)
        other_s = view.clock.computing_s - self.computing_s
        cost_pct = 100.0 * self.computing_s / other_s if other_s > 0.0 else 0.0
        ropes = list(snapshot.ropes)
        for r in self.ropes if ropes else ():
            interval = self.interval(r, ropes[r].tension_top_n, snapshot.time_s, cost_pct)
            ropes[r] = replace(ropes[r], error_interval=interval)
        first = self.interval(0, snapshot.tension_top_n, snapshot.time_s, cost_pct)
        return amended(snapshot, error_interval=first, ropes=tuple(ropes))

    def _begin(self, view: TwinView, present: Chunk, at_rest: bool) -> None:
        if self._scene.listed(WakeOscillatorParams) is not None:
            self._end("unknown with `wake_oscillator`: the phase of its vortices drifts")
            return
        self.coarse = CoarseSolution(self._scene, present, at_rest, view.viv_drag)
        self._largest = {r: WindowMaximum(WINDOW_S) for r in ropes_from_ship(present.ropes)}
        self._reason, self._known_from_ns = "", 0
        if not self.coarse.at_rest:
            self._settle(present.time_ns, "its coarse solution has to settle")

    def _end(self, reason: str) -> None:
        """End the coarse solution; the interval is unknown from now on."""
        self.coarse, self._largest, self._reason = None, {}, reason

    def observe(self, view: TwinView, chunk: Chunk) -> None:
        """Advance the coarse solution by the steps just done, and compare the top tensions.

        A coarse solution whose next state would not be finite starts again from the twin's state.
        """
        if self.coarse is not None and chunk.done:
            begin_s = time.perf_counter()
            if stands_on_bed(chunk.ropes):
                self._settle(chunk.time_ns, "the payload stood on the seabed")
            coarse = self.coarse.follow(chunk)
            if coarse is None:
                self._begin(view, chunk, at_rest=False)
            else:
                self.coarse.sample_vortices(chunk)
                self._compare(chunk, *coarse)
            self.computing_s += time.perf_counter() - begin_s
        if self.coarse is not None and (responding := responding_winches(view)):
            with view.inputs.lock:
                self.coarse.share_winches(responding)

    def interval(self, r: int, tension_n: float, time_s: float, cost_pct: float) -> TensionInterval:
        """Return the interval of rope r around its top tension.

        cost_pct: CPU time of the interval relative to all other work.
        """
        bound = MARGIN * self._largest[r].at(time_s)
        low = max(tension_n - bound, 0.0)
        return TensionInterval(low, tension_n + bound, bound, cost_pct)

    def _settle(self, time_ns: int, reason: str) -> None:
        """Make the interval unknown for the settling time from now on."""
        self._known_from_ns = time_ns + round(SETTLING_S * 1e9)
        self._reason = f"unknown until {self._known_from_ns * 1e-9:.1f} s: {reason}"

    def _compare(self, chunk: Chunk, first: int, coarse_n: Floats) -> None:
        """Record the differences after every coarse step; first: step of the chunk that ends it."""
        coarse_ends = range(first, chunk.done + 1, RATIO)
        for r, largest in self._largest.items():
            twin_n = chunk.pulls[r, first - 1 : chunk.done : RATIO, rows.PULL]
            for end, difference in zip(
                coarse_ends, np.abs(coarse_n[r] - twin_n).tolist(), strict=True
            ):
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
    every_rope = [ropes] if isinstance(ropes, Rope) else list(ropes.ropes)
    lower_ends = [LOOSE] if isinstance(ropes, Rope) else ropes.joints.lower.tolist()
    bed = next(
        (effect for effect in every_rope[0].effects if isinstance(effect, Plane | Grid)), None
    )
    return bed is not None and any(
        bool(clearance(bed, rope.state.nodes[_POSITION, :1])[0] <= 0.0)
        for rope, lower in zip(every_rope, lower_ends, strict=True)
        if lower != LOOSE or rope.model.first_free == 0
    )


def responding_winches(view: TwinView) -> dict[int, Winch]:
    """Return the winches that need tension feedback for the next step, by rope number."""
    winch = view.inputs.winch
    first = {0: winch} if winch.needs_feedback(view.time_ns) else {}
    return first | view.ropes.needing_feedback(view.time_ns)


class CoarseSolution:
    """Coarse solution of a twin, started from the twin's present state.

    In a scene with a winch drive it has all elements and only twice the step: the error of a drive
    is of first order in the step, and longer elements may hide it in the difference.
    """

    def __init__(
        self, scene: Scene, chunk: Chunk, at_rest: bool, viv_drag: VivDragAmplification | None
    ) -> None:
        """Coarsen the ropes; at_rest: whether to solve for static equilibrium.

        viv_drag: the twin's loosely coupled VIV model.
        """
        self._scene, (value, rate) = scene, chunk.present_motion
        self._value, self._rate = value, rate  # prescribed motion that it has reached
        self.top_tensions_n: list[float] = chunk.pull[:, rows.PULL].tolist()  # after its last step
        self.viv_drag = None if viv_drag is None else viv_drag.coarse_copy(SAMPLING_RATIO)
        self.winches: dict[int, CoarseWinch] = {}  # by rope, winches that had tension feedback
        self._waiting = 0  # steps of the twin that it has not done yet
        driven = any(
            (winch.drive or winch.passive_compensation) is not None for _, winch in winches(scene)
        )
        ropes = chunk.ropes
        self._ropes: Rope | System
        if isinstance(ropes, Rope):
            (end,) = upper_ends(ropes, chunk.pull, rate[:, rows.LINE])
            coarse = copy.deepcopy(ropes) if driven else coarser(ropes, end)
            self._effects = SeparateEffects(ropes.effects)
            self._ropes = with_step_of(coarse, ropes)._replace(effects=self._effects.own)
            solved = at_rest and solve_statics(self._ropes, float(value[0, rows.LINE])).found
        else:
            self._effects = SeparateEffects(ropes.ropes[0].effects)
            system = coarsened(ropes, chunk.pull, rate[:, rows.LINE], not driven)
            first, *others = system.ropes
            others = [rope._replace(effects=own_copies(rope.effects)) for rope in others]
            first = first._replace(effects=self._effects.own)
            self._ropes = system = system._replace(ropes=(first, *others))
            if self.viv_drag is not None:
                self.viv_drag.amplify(system.ropes)
            solved = at_rest and solve_reeved_statics(system, value).found
        self.at_rest = bool(solved)  # whether it started in static equilibrium

    def follow(self, chunk: Chunk) -> tuple[int, Floats] | None:
        """Advance by the twin's last steps; None: the next state would not be finite.

        Return the number of the twin's steps up to the end of the first coarse step, and the coarse
        top tensions [N] after each coarse step, (ropes, steps): every `RATIO` steps of the twin.
        """
        first = RATIO - self._waiting
        steps, self._waiting = divmod(self._waiting + chunk.done, RATIO)
        pulls = np.zeros((len(self._value), steps, rows.PULL_COLUMNS))
        if steps > 0:
            reached, boundary = (self._value, self._rate), chunk.boundary
            boundaries = Boundary(
                *(
                    np.concatenate(
                        [start[:, None], table[:, first : chunk.done + 1 : RATIO]], axis=1
                    )
                    for start, table in zip(reached, boundary, strict=True)
                )
            )
            self._use_effects_of(chunk.ropes)
            step_s = self._first.model.step
            start_s = chunk.time_ns * 1e-9 - (self._waiting / RATIO + steps) * step_s
            if self._advance(boundaries, pulls, start_s) < steps:
                return None
            self._value, self._rate = boundaries.value[:, steps], boundaries.rate[:, steps]
            self.top_tensions_n = pulls[:, -1, rows.PULL].tolist()
        return first, pulls[:, :, rows.PULL]

    def sample_vortices(self, chunk: Chunk) -> None:
        """Sample the loosely coupled VIV model when it is due."""
        viv_drag = self.viv_drag
        if viv_drag is None or self._waiting or viv_drag.steps_to_sampling(chunk.steps) > 0:
            return
        boundary = Boundary(*(table[0, chunk.done :] for table in chunk.boundary))
        viv_drag.observe(self.ropes, boundary, chunk.steps, chunk.currents)

    def share_winches(self, responding: Mapping[int, Winch]) -> None:
        """Copy winches that respond to the tension in the next step, by rope, if not yet there.

        Winches are copied once the coarse solution has reached the twin's time.
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
        coarse = self._ropes
        return (coarse,) if isinstance(coarse, Rope) else coarse.ropes

    @property
    def payouts_m(self) -> Floats:
        """Return the paid-out length of each rope [m], (ropes,)."""
        lengths: Floats = self._value[:, rows.LINE].copy()
        return lengths

    @property
    def _first(self) -> Rope:
        return self.ropes[0]

    def _use_effects_of(self, twin: Rope | System) -> None:
        """Use the twin's present effects (a new current), copies of those that hold a state."""
        twin_effects = twin.effects if isinstance(twin, Rope) else twin.ropes[0].effects
        if self._effects.given is twin_effects:
            return
        effects, coarse = self._effects.take(twin_effects), self._ropes
        if isinstance(coarse, Rope):
            self._ropes = coarse._replace(effects=effects)
        else:
            ropes = (coarse.ropes[0]._replace(effects=effects), *coarse.ropes[1:])
            self._ropes = coarse._replace(ropes=ropes)

    def _advance(self, boundaries: Boundary, pulls: Floats, start_s: float) -> int:
        """Advance through boundaries (ropes, steps + 1, MOTIONS); return the steps done."""
        steps = int(pulls.shape[1])
        if not self.winches:
            return self._step(boundaries, pulls, start_s)
        step_s, pull_n = self._first.model.step, self.top_tensions_n
        for k in range(steps):
            begin_s = start_s + k * step_s
            step_boundary = Boundary(
                *(np.ascontiguousarray(table[:, k : k + 2]) for table in boundaries)
            )
            for r, winch in self.winches.items():
                rope_boundary = Boundary(*(table[r] for table in step_boundary))
                winch.prescribe(self.ropes[r], round(begin_s * 1e9), rope_boundary, pull_n[r])
            step_pull = np.zeros((len(pulls), 1, rows.PULL_COLUMNS))
            if self._step(step_boundary, step_pull, begin_s) < 1:
                return k
            pulls[:, k], pull_n = step_pull[:, 0], step_pull[:, 0, rows.PULL].tolist()
            for table, reached in zip(boundaries, step_boundary, strict=True):
                table[:, k + 1] = reached[:, 1]
        return steps

    def _step(self, boundaries: Boundary, pulls: Floats, start_s: float) -> int:
        coarse = self._ropes
        if isinstance(coarse, Rope):
            boundary = Boundary(*(table[0] for table in boundaries))
            done = advance(coarse, boundary, pulls[0], start_s, pulls.shape[1])
        else:
            done = advance_joined(coarse, boundaries, pulls, start_s, pulls.shape[1])
        return int(done)


class SeparateEffects:
    """Effects of the twin, with separate copies of those that hold a state.

    A rigid body holds its position; vortex models hold a phase or a wake at each node, which the
    core transfers to the coarse nodes by their material coordinates.
    """

    def __init__(self, effects: tuple[Any, ...]) -> None:
        self._copies = {
            number: copy.deepcopy(effect)
            for number, effect in enumerate(effects)
            if isinstance(effect, RigidBody) or have_internal_variables([type(effect)])
        }
        self.own = self.take(effects)

    def take(self, effects: tuple[Any, ...]) -> tuple[Any, ...]:
        """Use the twin's present effects (a new current); return them with the copies."""
        self.given = effects
        if self._copies:
            effects = tuple(
                self._copies.get(number, effect) for number, effect in enumerate(effects)
            )
        self.own = effects
        return effects


def with_step_of(rope: Rope, twin: Rope) -> Rope:
    """Return the rope with `RATIO` times the twin's step."""
    return rope._replace(model=rope.model._replace(step=RATIO * twin.model.step))


def coarsened(system: System, pull: Floats, payout_m_per_s: Floats, halve: bool) -> System:
    """Return a copy of the system with twice the step and, if `halve`, every second node.

    pull: force of each rope on its hang-off or upper connection [N], (ropes, PULL_COLUMNS); payout:
    of the ropes that hang from the ship, (ropes,).
    """
    ropes = []
    for rope, end in zip(system.ropes, upper_ends(system, pull, payout_m_per_s), strict=True):
        enough = int(rope.state.counts[ELEMENTS]) >= MIN_HALVED
        ropes.append(with_step_of(coarser(rope, end) if halve and enough else rope, rope))
    return joined_as(system, ropes)


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
        """Submit a command that the twin's winch has accepted; rejections were counted there."""
        self._winch.take(stamp_ns, command, now_ns)

    def invalidate(self) -> None:
        """Invalidate commands that were known in advance."""
        self._winch.invalidate()

    def prescribe(self, rope: Rope, begin_ns: int, boundary: Boundary, pull_n: float) -> None:
        """Set the paid-out length at the end of the step that begins now.

        boundary: at the step's beginning and end, (2, rows.MOTIONS) each, with the hang-off's
        motion. pull_n: tension at the hang-off now [N].
        """
        value, rate = boundary
        feedback = None
        if self._winch.needs_feedback(begin_ns):
            feedback = self._winch.feedback(rope, self._line, pull_n, value, self._rest_z)
        heave_rate = float(rate[1, rows.Z])
        value[1, rows.LINE], rate[1, rows.LINE] = self._winch.step(
            begin_ns, rope.model.step, heave_rate, feedback
        )
