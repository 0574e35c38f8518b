"""Measured vibration of the twin's own rope: amplitude and frequency, cross-flow and in line.

The positions of the nodes are filtered by a fourth-order Butterworth high-pass at a fifth of the
frequency of the fastest vortices, which removes ship, waves, winch and sway. The remaining motion
across the rope is split into cross-flow and in-line parts, and their mean square is averaged over
the last ten periods of those vortices. The frequency is Rice's (1944) mean frequency of
zero-upcrossings, √(m₂/m₀)/2π, computed from tan(ω·h/2) = rms(y - y before)/rms(y + y before), which
is exact for a sine.

The flow is the running mean of the water's velocity relative to the rope. The drag amplification is
the mean of |s - w|·(s - w)·s over that of |s|³, with the fast velocity w of the rope and the slow
part s of the relative flow across the rope; waves, sway and ship are in both. Nodes are material
points; a new node takes values interpolated between its neighbours.
"""

from __future__ import annotations

from math import exp, pi

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.vortex.results import RopeVibration
from rope_twin.vortex.sampling import AVERAGING_PERIODS, diameters, flow_directions, relative_flow
from rope_twin.vortex.settings import TIME_DOMAIN

CUT_OFF = 0.2  # cut-off over the frequency of the fastest vortices: slower motion is no VIV
ORDER = 4
BLOCK = 8  # number of samples filtered together
SETTLING_PERIODS = 10.0  # until the filter has settled
MIN_PERIODS = 2.0  # of averaging before a result
MIN_MOTION_M = 1e-7  # smaller motion has no frequency
MIN_FLOW_M_PER_S = 1e-3  # slower flow has no drag amplification
INTERPOLATED = (
    "_memory", "_slow_memory", "_flow", "_sides", "_before", "_first", "_means", "_first_drag",
    "_drag",
)  # fmt: skip
_PLACE = slice(rows.POSITION, rows.POSITION + 3)
_VELOCITY = slice(rows.VELOCITY, rows.VELOCITY + 3)
_FLOW = slice(rows.FLOW, rows.FLOW + 3)


class MeasuredVibration:
    """Monitor of the rope's vibration, sampled at equal times; rows from the lower end up."""

    def __init__(self, rope: Rope, sample_s: float, vortices_hz: float) -> None:
        """Start with samples every `sample_s`; vortices_hz: fastest expected vortices [Hz]."""
        self._sample_s, self._hz = sample_s, vortices_hz
        slowest, rate = CUT_OFF * vortices_hz, 1.0 / sample_s
        self._filter = butter(ORDER, slowest, "highpass", fs=rate, output="sos")
        self._slow_filter = butter(ORDER, slowest, "lowpass", fs=rate, output="sos")
        self._s, place = _marks(rope), _places(rope)
        self._flow = relative_flow(rope)
        self._memory = sosfilt_zi(self._filter)[:, :, None, None] * place
        self._slow_memory = sosfilt_zi(self._slow_filter)[:, :, None, None] * self._flow
        self._waiting: list[Floats] = []  # positions and flows that are not filtered yet
        self._sides = flow_directions(place, self._flow)  # unit vectors for the waiting samples
        self._before = np.zeros((2, place.shape[1]))
        # mean squares of motion, difference and sum; averaged once, and once more against ripple
        self._first, self._means = np.zeros((2, 3, 2, place.shape[1]))
        # means of drag times flow, with vibration and without
        self._first_drag, self._drag = np.zeros((2, 2, place.shape[1]))
        self._taken = 0

    @property
    def known(self) -> bool:
        """Whether results are available."""
        periods = self._taken * self._sample_s * self._hz
        return periods >= SETTLING_PERIODS + MIN_PERIODS

    def take(self, rope: Rope, sample_s: float, vortices_hz: float) -> None:
        """Take one sample of the rope, at the sampling interval after the previous one."""
        s = _marks(rope)
        if len(s) != len(self._s) or not np.array_equal(s[:-1], self._s[:-1]):
            self._work_off()
            self._carry_over(s)
        self._s = s
        place = _places(rope)
        share = 1.0 - exp(-self._sample_s * self._hz / AVERAGING_PERIODS)
        flow = relative_flow(rope)
        self._flow = self._flow + share * (flow - self._flow)
        if not self._waiting:
            self._sides = flow_directions(place, self._flow)
        self._waiting.append(np.stack([place, flow]))
        if len(self._waiting) == BLOCK:
            self._work_off()

    def shot(self, rope: Rope) -> RopeVibration | None:
        """Return the vibration at the nodes; None: not known yet."""
        if not self.known:
            return None
        s, diameter = _marks(rope), diameters(rope)  # elements may have split since the sample

        def now(values: Floats) -> Floats:
            return np.interp(s, self._s, values)

        (across, along), (across_hz, along_hz) = self.amplitudes_m(), self.frequencies_hz()
        return RopeVibration(
            model=TIME_DOMAIN,
            cross_flow=(now(across) / diameter)[::-1],
            cross_flow_hz=now(across_hz)[::-1],
            in_line=(now(along) / diameter)[::-1],
            in_line_hz=now(along_hz)[::-1],
            drag_amplification=now(self.drag_amplification())[::-1],
            every_s=0.0,
            solves=0,
            note="",
        )

    def bent(self, rope: Rope, middles: Floats) -> Floats | None:
        """Return None: its curvature is already in the rope's own."""
        return None

    def kept(self) -> MeasuredVibration:
        """Return the state from which `take_back` resumes."""
        return self

    def take_back(self, kept: MeasuredVibration) -> None:
        """Resume from this state."""
        vars(self).update(vars(kept))

    def amplitudes_m(self) -> Floats:
        """√2 times the rms, cross-flow and in line, at the last sample [m], (2, nodes)."""
        return np.asarray(np.sqrt(2.0 * self._means[0]))

    def frequencies_hz(self) -> Floats:
        """Frequency of both motions [Hz], 0 where nothing moves, (2, nodes)."""
        _, rise, total = self._means
        moves = (self.amplitudes_m() > MIN_MOTION_M) & (total > 0.0)
        ratio = np.sqrt(rise / np.where(moves, total, 1.0))
        return np.where(moves, np.arctan(ratio) / (pi * self._sample_s), 0.0)

    def drag_amplification(self) -> Floats:
        """Factor of the vibration on the mean drag; 1 where the water is still, (nodes,)."""
        shaken, steady = self._drag
        flows = steady > MIN_FLOW_M_PER_S**3
        return np.where(flows, shaken / np.where(flows, steady, 1.0), 1.0)

    def _work_off(self) -> None:
        """Filter the waiting samples and add them to the means."""
        if not self._waiting:
            return
        places, flows = np.stack(self._waiting, axis=1)
        fast, self._memory = sosfilt(self._filter, places, axis=0, zi=self._memory)
        slow, self._slow_memory = sosfilt(self._slow_filter, flows, axis=0, zi=self._slow_memory)
        self._waiting = []
        settled = round(SETTLING_PERIODS / (self._hz * self._sample_s))
        forgotten = 1.0 - exp(-2.0 * self._sample_s * self._hz / AVERAGING_PERIODS)
        both = np.einsum("skn,qrkn->rqsn", self._sides, np.stack([fast, slow]))
        for moved, streaming in both:
            self._taken += 1
            if self._taken > settled:
                share = max(forgotten, 1.0 / (self._taken - settled))
                rise = moved - self._before
                now = np.stack([moved, rise, moved + self._before]) ** 2
                self._first += share * (now - self._first)
                self._means += share * (self._first - self._means)
                drag = _drags(streaming, rise / self._sample_s)
                self._first_drag += share * (drag - self._first_drag)
                self._drag += share * (self._first_drag - self._drag)
            self._before = moved

    def _carry_over(self, s: Floats) -> None:
        """Interpolate to nodes with other material coordinates."""
        high = np.clip(np.searchsorted(self._s, s), 1, len(self._s) - 1)
        low = high - 1
        share = np.clip((s - self._s[low]) / (self._s[high] - self._s[low]), 0.0, 1.0)
        for name in INTERPOLATED:
            kept = getattr(self, name)
            setattr(self, name, kept[..., low] * (1.0 - share) + kept[..., high] * share)


def _drags(flow: Floats, fast: Floats) -> Floats:
    """Return |u|·u·flow of a vibrating and a steady rope; all arrays (2, nodes)."""
    shaken = flow - fast
    return np.stack(
        [np.sqrt((own * own).sum(axis=0)) * (own * flow).sum(axis=0) for own in (shaken, flow)]
    )


def _marks(rope: Rope) -> Floats:
    return np.array(rope.state.s[: int(rope.state.counts[rows.ELEMENTS]) + 1])


def _places(rope: Rope) -> Floats:
    return np.array(rope.state.nodes[_PLACE, : int(rope.state.counts[rows.ELEMENTS]) + 1])
