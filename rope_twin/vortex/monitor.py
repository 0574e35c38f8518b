"""Vibration and fatigue monitors of a line of a run: a rope, or ropes that continue each other.

The monitors observe only. They sample the line at equal times, often enough to resolve the fastest
vortices. In the time domain the vibration is that of the scene's own VIV model, measured as motion
of the nodes; in the frequency domain it is that of the modal model, which follows the line. Damage
is that of each rope.

**Measured vibration**: amplitude and frequency, cross-flow and in line. The positions of the nodes
are filtered by a fourth-order Butterworth high-pass at a fifth of the frequency of the fastest
vortices, which removes ship, waves, winch and sway. The remaining motion across the rope is split
into cross-flow and in-line parts, and their mean square is averaged over the last ten periods of
those vortices. The frequency is Rice's (1944) mean frequency of zero-upcrossings, √(m₂/m₀)/2π,
computed from tan(ω·h/2) = rms(y - y before)/rms(y + y before), which is exact for a sine.

The flow is the running mean of the water's velocity relative to the rope. The drag amplification is
the mean of |s - w|·(s - w)·s over that of |s|³, with the fast velocity w of the rope and the slow
part s of the relative flow across the rope; waves, sway and ship are in both. Nodes are material
points; a new node takes values interpolated between its neighbours.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import exp, pi
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import ELEMENTS, Boundary, Floats, Rope
from rope_twin.errors import InputError
from rope_twin.vortex.coupled import CoupledModel, VivDragAmplification, modal_model
from rope_twin.vortex.line_model import (
    AVERAGING_PERIODS,
    bending_stiffness,
    curvature,
    diameters,
    flow_directions,
    needs_new_interval,
    relative_flow,
    sampling_steps,
    shedding_hz,
)
from rope_twin.vortex.results import (
    FREQUENCY_DOMAIN,
    TIME_DOMAIN,
    CoupledSettings,
    MaterialFatigue,
    MonitorSettings,
    RopeDamage,
    RopeVibration,
)
from rope_twin.vortex.shedding import Shedding

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


class MeasuredVibration:
    """Monitor of the rope's vibration, sampled at equal times; rows from the lower end up."""

    def __init__(self, rope: Rope, sample_s: float, vortices_hz: float) -> None:
        """Start with samples every `sample_s`; vortices_hz: fastest expected vortices [Hz]."""
        from scipy.signal import butter, sosfilt_zi

        self._sample_s, self._hz = sample_s, vortices_hz
        slowest, rate = CUT_OFF * vortices_hz, 1.0 / sample_s
        self._filter = butter(ORDER, slowest, "highpass", fs=rate, output="sos")
        self._slow_filter = butter(ORDER, slowest, "lowpass", fs=rate, output="sos")
        self._s, position = _marks(rope), _places(rope)
        self._flow = relative_flow(rope)
        self._memory = sosfilt_zi(self._filter)[:, :, None, None] * position
        self._slow_memory = sosfilt_zi(self._slow_filter)[:, :, None, None] * self._flow
        self._waiting: list[Floats] = []  # samples (position, flow) to be filtered
        self._sides = flow_directions(position, self._flow)  # unit vectors for the waiting samples
        self._before = np.zeros((2, position.shape[1]))
        # mean squares of motion, difference and sum; averaged twice to reduce ripple
        self._first, self._means = np.zeros((2, 3, 2, position.shape[1]))
        # means of drag times flow, with vibration and without
        self._first_drag, self._drag = np.zeros((2, 2, position.shape[1]))
        self._taken = 0

    @property
    def known(self) -> bool:
        """Whether results are available."""
        periods = self._taken * self._sample_s * self._hz
        return periods >= SETTLING_PERIODS + MIN_PERIODS

    def take(self, rope: Rope, sample_s: float, vortices_hz: float) -> None:
        """Add one sample of the rope, at the sampling interval after the previous one."""
        s = _marks(rope)
        if len(s) != len(self._s) or not np.array_equal(s[:-1], self._s[:-1]):
            self._work_off()
            self._carry_over(s)
        self._s = s
        position = _places(rope)
        weight = 1.0 - exp(-self._sample_s * self._hz / AVERAGING_PERIODS)
        flow = relative_flow(rope)
        self._flow = self._flow + weight * (flow - self._flow)
        if not self._waiting:
            self._sides = flow_directions(position, self._flow)
        self._waiting.append(np.stack([position, flow]))
        if len(self._waiting) == BLOCK:
            self._work_off()

    def snapshot(self, rope: Rope) -> RopeVibration | None:
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
        from scipy.signal import sosfilt

        if not self._waiting:
            return
        positions, flows = np.stack(self._waiting, axis=1)
        fast, self._memory = sosfilt(self._filter, positions, axis=0, zi=self._memory)
        slow, self._slow_memory = sosfilt(self._slow_filter, flows, axis=0, zi=self._slow_memory)
        self._waiting = []
        settling_samples = round(SETTLING_PERIODS / (self._hz * self._sample_s))
        forgetting = 1.0 - exp(-2.0 * self._sample_s * self._hz / AVERAGING_PERIODS)
        components = np.einsum("skn,qrkn->rqsn", self._sides, np.stack([fast, slow]))
        for moved, streaming in components:
            self._taken += 1
            if self._taken > settling_samples:
                weight = max(forgetting, 1.0 / (self._taken - settling_samples))
                difference = moved - self._before
                squares = np.stack([moved, difference, moved + self._before]) ** 2
                self._first += weight * (squares - self._first)
                self._means += weight * (self._first - self._means)
                drag = _drags(streaming, difference / self._sample_s)
                self._first_drag += weight * (drag - self._first_drag)
                self._drag += weight * (self._first_drag - self._drag)
            self._before = moved

    def _carry_over(self, s: Floats) -> None:
        """Interpolate to nodes with other material coordinates."""
        high = np.clip(np.searchsorted(self._s, s), 1, len(self._s) - 1)
        low = high - 1
        fraction = np.clip((s - self._s[low]) / (self._s[high] - self._s[low]), 0.0, 1.0)
        for name in INTERPOLATED:
            values = getattr(self, name)
            setattr(self, name, values[..., low] * (1.0 - fraction) + values[..., high] * fraction)


def _drags(flow: Floats, motion: Floats) -> Floats:
    """Return |u|·u·flow of a vibrating and a steady rope; all arrays (2, nodes)."""
    vibrating = flow - motion
    return np.stack(
        [
            np.sqrt((velocity * velocity).sum(axis=0)) * (velocity * flow).sum(axis=0)
            for velocity in (vibrating, flow)
        ]
    )


def _marks(rope: Rope) -> Floats:
    return np.array(rope.state.s[: int(rope.state.counts[rows.ELEMENTS]) + 1])


def _places(rope: Rope) -> Floats:
    return np.array(rope.state.nodes[_PLACE, : int(rope.state.counts[rows.ELEMENTS]) + 1])


SECOND_NS = 1_000_000_000  # interval of the fatigue results


class RopeSample(NamedTuple):
    """State of one of the ropes of a line at a sampling."""

    rope: Rope
    top_tension_n: float
    line_out_m: float
    lost_m: float  # length of a part that was cut off
    beyond: RopeSample | None = None  # rope that it runs into over a sheave at its upper end


class Sample(NamedTuple):
    """State of a line at a sampling."""

    line: Rope  # its ropes as one
    ropes: tuple[RopeSample, ...]  # from its lower end up
    boundary: Boundary  # of the first rope from the ship; row 0 is the present
    time_ns: int
    profiles: int  # number of current profiles accepted


def check_monitors(asked: MonitorSettings, model: str, coupled: bool) -> None:
    """Reject a vibration monitor that the scene does not allow.

    model: VIV model that the scene lists, or ""; coupled: whether it is loosely coupled.

    Raises:
        InputError: the monitor is not possible.
    """
    where = f"vibration {asked.vibration}"
    if asked.vibration == TIME_DOMAIN and not model:
        problem = "the scene lists no VIV model, so its rope does not vibrate"
        raise InputError(where, problem, f"list one of them, or ask for {FREQUENCY_DOMAIN}")
    if asked.vibration == FREQUENCY_DOMAIN and model:
        problem = f"the scene's own {model} computes the vibration already"
        raise InputError(where, problem, "leave it out" if coupled else f"ask for {TIME_DOMAIN}")


def wear_name(number: int) -> str:
    """Return the name of the damage of a line's rope in a saved state."""
    return f"wear {number}" if number else "wear"


class RopeMonitor:
    """Monitors of a line; `observe` it whenever `steps_to_sampling` have been done."""

    def __init__(
        self,
        settings: MonitorSettings,
        vortices: CoupledSettings,
        rope: Rope,
        interval: tuple[float, int],
        damages: tuple[RopeDamage, ...],
        viv_drag: VivDragAmplification | None,
        number: int = 0,
    ) -> None:
        """Start without vibration.

        rope: the line as one rope; interval: time step [s], and steps of a real-time cycle;
        damages: fatigue count of each of its ropes, if enabled; viv_drag: loosely coupled model
        of the scene, which has its own sampling interval; number: of the rope in that model.

        Raises:
            InputError: the rope is slack somewhere.
        """
        self._asked, self._vortices, self._viv_drag = settings, vortices, viv_drag
        self._number = number
        self.damages = damages
        self.fatigue: tuple[MaterialFatigue, ...] = ()  # of each rope, once it is known
        self._hz, self._profiles = 0.0, 0  # vortex frequency and profiles of the interval
        self.set_step(*interval)
        if settings.vibration == TIME_DOMAIN and viv_drag is None:
            import scipy.signal  # noqa: F401  the filters of a measurement take a second to load
        # a monitor of the nodes' motion starts with the flow
        self._tracker = self._coupled_model(rope)
        self.counting_from_ns, self._second = 0, -1
        self._observing_s = self._observed_s = 0.0  # CPU time of the monitors, and time covered

    @property
    def notice(self) -> str:
        """Description of the vibration model and its cost; "" for none."""
        return self._tracker.notice if isinstance(self._tracker, CoupledModel) else ""

    def set_step(self, step_s: float, cycle: int) -> None:
        """Set the time step [s] and the steps of a real-time cycle."""
        self._step_s, self._cycle = step_s, cycle
        self.every = sampling_steps(self._hz, step_s, cycle)

    def steps_to_sampling(self, steps: int) -> int:
        """Return the number of steps left until the next sampling, after `steps` steps."""
        if self._viv_drag is not None:
            return self._viv_drag.steps_to_sampling(steps)
        return self.every - steps % self.every

    def observe(self, sample: Sample) -> None:
        """Sample the line; once a second the interval and the fatigue results are updated too."""
        started = time.perf_counter()
        second = sample.time_ns // SECOND_NS
        is_new_second, self._second = second != self._second, second
        if is_new_second:
            self._update_interval(sample)
        if self._tracker is not None and self._viv_drag is None:
            self._tracker.take(sample.line, self.every * self._step_s, self._hz)
        if self.damages:
            self._take_damage(sample)
            if is_new_second:
                counted_s = (sample.time_ns - self.counting_from_ns) * 1e-9
                self.fatigue = tuple(
                    damage.snapshot(rope.line_out_m, counted_s)
                    for damage, rope in zip(self.damages, sample.ropes, strict=True)
                )
        self._observing_s += time.perf_counter() - started
        self._observed_s += self.every * self._step_s

    def _take_damage(self, sample: Sample) -> None:
        """Count the damage of each rope; the line's coordinate at its lower end grows upward."""
        lower_m = 0.0
        for damage, rope in zip(self.damages, sample.ropes, strict=True):
            if rope.beyond is not None:
                tensions_n = rope.top_tension_n, rope.beyond.top_tension_n
                damage.take_over_sheave(rope.rope, rope.beyond.rope, tensions_n)
                continue
            if rope.lost_m > 0.0:
                damage.cut_off(rope.lost_m)
            kappa = None
            if damage.bends:
                kappa = self.bent(sample.line, damage.middles - rope.lost_m + lower_m)
            damage.take(rope.rope, rope.top_tension_n, kappa)
            lower_m += float(rope.rope.state.s[int(rope.rope.state.counts[ELEMENTS])])

    @property
    def cost_pct(self) -> float:
        """CPU time of the monitors [% of the twin time that they covered]."""
        return 100.0 * self._observing_s / max(self._observed_s, self._step_s)

    def vibration(self, rope: Rope) -> RopeVibration | None:
        """Return the vibration at the nodes of the line; None: not monitored, or not known yet."""
        if self._viv_drag is not None or self._tracker is None:
            return None
        response: RopeVibration | None = self._tracker.snapshot(rope)
        return response

    def bent(self, rope: Rope, middles: Floats) -> Floats:
        """Curvature of line and vibration at material coordinates of the line [1/m], (2, places).

        rope: the line as one rope; middles: from its lower end [m], (places,).
        """
        kappa = np.zeros((2, len(middles)))
        if bending_stiffness(rope.effects) > 0.0:
            s, components = curvature(rope)
            kappa += [np.interp(middles, s, component) for component in components]
        vibrating = self._tracker.bent(rope, middles) if self._tracker is not None else None
        return kappa if vibrating is None else kappa + vibrating

    def cut(self) -> None:
        """Restart the vibration monitor on the remaining part of a cut line."""
        self._tracker, self._hz = None, 0.0

    def kept(self) -> dict[str, Any]:
        """Return the state from which `take_back` resumes, by name."""
        state: dict[str, Any] = {}
        if self.damages:
            state["counting_from_ns"] = self.counting_from_ns
        for number, damage in enumerate(self.damages):
            state[wear_name(number)] = damage
        if self._tracker is not None and self._viv_drag is None:
            state["model"] = self._asked.vibration
            state["tracker"] = self._tracker.kept()
            state["samples"] = [self._hz, self._profiles]
        return state

    def take_back(
        self, state: dict[str, Any], rope: Rope, time_ns: int, read: Callable[[str, Any], Any]
    ) -> None:
        """Resume from this state, for the monitors that it contains.

        read: returns a saved object by its name and a template of it.
        """
        self.counting_from_ns = state.get("counting_from_ns", time_ns)
        if wear_name(0) in state:
            self.damages = tuple(
                read(wear_name(number), damage) for number, damage in enumerate(self.damages)
            )
        self._tracker = self._coupled_model(rope)
        if self._asked.vibration and state.get("model") == self._asked.vibration:
            self._hz, self._profiles = state["samples"]
            self.set_step(self._step_s, self._cycle)
            tracker = self._tracker or self._measured_vibration(rope)
            tracker.take_back(read("tracker", tracker.kept()))
            self._tracker = tracker

    def _update_interval(self, sample: Sample) -> None:
        """Adapt the sampling interval to the vortex frequency; only a new current extends it."""
        has_vortices = self._asked.vibration or self._vortices.name
        if self._viv_drag is not None or not has_vortices:
            return
        hz = shedding_hz(sample.line, sample.boundary, self._vortices.strouhal)
        if needs_new_interval(hz, self._hz, sample.profiles != self._profiles):
            self._hz, self._profiles = hz, sample.profiles
            self.set_step(self._step_s, self._cycle)
            if self._asked.vibration == TIME_DOMAIN:
                self._tracker = self._measured_vibration(sample.line) if hz > 0.0 else None

    def _measured_vibration(self, rope: Rope) -> Any:
        return MeasuredVibration(rope, self.every * self._step_s, self._hz)

    def _coupled_model(self, rope: Rope) -> Any:
        """Return the loosely coupled model of the scene or of the run in its initial state."""
        if self._viv_drag is not None:
            return self._viv_drag.trackers[self._number]
        if self._asked.vibration != FREQUENCY_DOMAIN:
            return None
        water = Shedding(strouhal=self._vortices.strouhal, density=self._vortices.density)
        return modal_model(rope, water, FREQUENCY_DOMAIN)
