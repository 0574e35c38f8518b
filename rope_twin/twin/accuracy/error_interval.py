"""Discretisation-error interval of the top tension, from a coarse solution parallel to the twin.

The coarse solution (`coarse_solution`) has half the elements and twice the step, with bit-identical
hang-off, paid-out length and current. Where elements and step are of second order, its tension
differs from the rope's by three times the rope's error (Richardson 1911); where they are of first
order (slack, landing, a winch with tension feedback, waves that decay within an element), by the
error itself. The bound is therefore the whole difference, with a margin. The difference passes
through zero while the error does not, and after an impact it may vanish while both still ring: so
the largest difference of the last seconds counts.

Where the coarse solution cannot follow the rope, the interval is unknown, with the reason.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid, Plane, clearance
from rope_twin.core.joined.joints import LOOSE, System
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.twin.accuracy.coarse_solution import RATIO, Chunk, CoarseSolution
from rope_twin.twin.accuracy.level import AccuracyLevel
from rope_twin.twin.recovery import Checkpoint
from rope_twin.twin.results import TensionInterval
from rope_twin.twin.saving.saved_state import SavedState
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.twin.winch.winch import Winch
from rope_twin.vortex.coupled import VivDragAmplification

MARGIN = 1.25  # bound over the largest difference: safety factor of the grid convergence index
WINDOW_S = 10.0  # largest difference so long: more than a wave period or first axial period
SETTLING_S = 20.0  # settling time of a coarse solution that was started during a run
_PLACE = slice(rows.POSITION, rows.POSITION + 3)


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


class ErrorInterval:
    """Error interval of the top tension of every rope that hangs from the ship.

    Call `start` with the present state, `observe` after each call of `advance`, and `interval` at
    any time. It never changes the twin.
    """

    def __init__(self, scene: Scene, viv_drag: VivDragAmplification | None) -> None:
        """Make a monitor that has not started; viv_drag: the twin's loosely coupled VIV model."""
        self._scene, self._viv_drag = scene, viv_drag
        self.coarse: CoarseSolution | None = None  # None: the interval is unknown from here on
        self._largest: dict[int, WindowMaximum] = {}  # by rope, of the difference [N]
        self._reason, self._known_from_ns = "", 0  # why it is unknown before this time
        self.took_s = 0.0  # CPU time since the start

    @property
    def ropes(self) -> tuple[int, ...]:
        """Return the numbers of the ropes that have an interval."""
        return tuple(self._largest)

    def start(self, now: Chunk, at_rest: bool) -> None:
        """Start a coarse solution from the present state; at_rest: of static equilibrium."""
        if self._scene.listed(WakeOscillatorParams) is not None:
            self.end("unknown with `wake_oscillator`: the phase of its vortices drifts")
            return
        self.coarse = CoarseSolution(self._scene, now, at_rest, self._viv_drag)
        self._largest = {r: WindowMaximum(WINDOW_S) for r in ropes_from_ship(now.ropes)}
        self._reason, self._known_from_ns = "", 0
        if not self.coarse.at_rest:
            self._settle(now.time_ns, "its coarse solution has to settle")

    def end(self, reason: str) -> None:
        """End the coarse solution; the interval is unknown from now on."""
        self.coarse, self._largest, self._reason = None, {}, reason

    def observe(self, chunk: Chunk) -> None:
        """Advance the coarse solution by the steps just done, and compare the top tensions.

        A coarse solution whose next state would not be finite starts again from the twin's state.
        """
        if self.coarse is None or chunk.done == 0:
            return
        began = time.perf_counter()
        if stands_on_bed(chunk.ropes):
            self._settle(chunk.time_ns, "the payload stood on the seabed")
        followed = self.coarse.follow(chunk)
        if followed is None:
            self.start(chunk, at_rest=False)
        else:
            self.coarse.sample_vortices(chunk)
            self._compare(chunk, *followed)
        self.took_s += time.perf_counter() - began

    def why_unknown(self, time_ns: int) -> str:
        """Return why there is no interval at this time; "" if there is one."""
        known = self.coarse is not None and time_ns >= self._known_from_ns
        return "" if known else self._reason

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


class ErrorIntervalTwin(Twin):
    """A twin with an error interval of its top tension; the run itself is bit-identical.

    A saved state does not hold the coarse solution; a restored twin makes a new one.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._interval = ErrorInterval(scene, self._viv_drag)
        self._interval.start(self._chunk(0), at_rest=True)

    @classmethod
    def restore(cls, saved: str | Path | SavedState, scene: Scene) -> Self:
        """Return a twin that resumes from a saved state, with a new coarse solution."""
        twin = super().restore(saved, scene)
        twin._restart_interval()
        return twin

    @property
    def error_interval(self) -> ErrorInterval:
        """The monitor of the error interval; use it in the stepping thread only."""
        return self._interval

    def offer_command(self, stamp_ns: int | None, command: WinchCommand, winch: str = WINCH) -> str:
        """Command a winch and its copy in the coarse solution; return "" or the rejection."""
        fault = super().offer_command(stamp_ns, command, winch)
        coarse = self._interval.coarse
        if not fault and coarse is not None:
            names = [WINCH, *(line.from_ for line in self.scene.ropes[1:])]
            with self._lock:
                r = names.index(self.winch_called(winch))
                coarse.command(r, stamp_ns, command, self.time_ns)
        return fault

    def invalidate_inputs(self) -> None:
        """Invalidate inputs known in advance, also in the winches of the coarse solution."""
        super().invalidate_inputs()
        if (coarse := self._interval.coarse) is not None:
            with self._lock:
                coarse.invalidate()

    def set_level(self, level: AccuracyLevel) -> None:
        """Continue on another accuracy level with a new coarse solution."""
        super().set_level(level)
        self._restart_interval()

    def return_to(self, then: Checkpoint) -> bool:
        """Return to an earlier state with a new coarse solution."""
        went = super().return_to(then)
        self._restart_interval()
        return went

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present with the interval, or why it is unknown."""
        taken, own = super().snapshot(), self._interval
        if reason := own.why_unknown(self.time_ns):
            return replace(taken, no_error_interval=reason)
        rest_s = self._computing_s - own.took_s
        cost_pct = 100.0 * own.took_s / rest_s if rest_s > 0.0 else 0.0
        ropes = list(taken.ropes)
        for r in own.ropes if ropes else ():
            found = own.interval(r, ropes[r].tension_top_n, taken.time_s, cost_pct)
            ropes[r] = replace(ropes[r], error_interval=found)
        first = own.interval(0, taken.tension_top_n, taken.time_s, cost_pct)
        return replace(taken, error_interval=first, ropes=tuple(ropes))

    def _restart_interval(self) -> None:
        if self.cut is None:
            self._interval.start(self._chunk(0), at_rest=False)
        else:
            self._end_interval()

    def _end_interval(self) -> None:
        assert self.cut is not None
        at = f"{self.cut.at_s:.2f} s"
        self._interval.end(f"unknown since the cut at {at}: the coarse solution has no cut")

    def _cut_here(self, lost_m: float, rope: int) -> None:
        """Cut a rope and end the coarse solution."""
        super()._cut_here(lost_m, rope)
        self._end_interval()

    def _drop_boundaries(self, done: int) -> None:
        """Advance the coarse solution, then make the boundary after `done` steps the first one."""
        own = self._interval
        if own.coarse is not None:
            own.observe(self._chunk(done))
            if responding := self._responding():
                with self._lock:
                    own.coarse.share_winches(responding)
        super()._drop_boundaries(done)

    def _responding(self) -> dict[int, Winch]:
        """Return the winches that need tension feedback for the next step, by rope number."""
        first = {0: self._winch} if self._winch.needs_feedback(self.time_ns) else {}
        joined = self.joined
        return first if joined is None else first | joined.needing_feedback(self.time_ns)

    def _chunk(self, done: int) -> Chunk:
        """Return the ropes at present and the last `done` steps."""
        joined = self.joined
        ropes: Rope | System
        if joined is None:
            ropes, boundary = self.rope, Boundary(*(table[None] for table in self._boundary))
            pulls = self._pulls[None] if done else self._pull[None, None]
        else:
            ropes = joined.system(self.rope)
            boundary = joined.moved if done else joined.borders(self._boundary, 0)
            pulls = joined.pulls if done else joined.pull[:, None]
        counts = self._steps, self._current.changes
        return Chunk(ropes, boundary, pulls, done, self.time_ns, self.step_s, *counts)
