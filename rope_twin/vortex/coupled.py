"""Loosely coupled VIV models: vibration computed from a running twin's rope by its modes.

The twin steps the rope at the time scale of ship and winch. Once a second its tension, length and
the flow across it are sampled; the modes and their excitation are then searched in parts, some at
each sampling, and used a second later. No sampling therefore takes long, and an offline run is
bit-identical to a real-time one: the work done at each sampling does not depend on the machine.

Where a scene lists the model (`modal_vibration`, `decomposed_force`), `VivDragAmplification`
advances it at each sampling by the time since the previous one, and amplifies the drag coefficient
at the rope's nodes by the rms of the vibration around them (`drag_amplification.py`). The rope's
inclination and tension then change the modes that the model finds in its next search. Otherwise the
twin's own motion is unchanged.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil, sqrt
from typing import Any, NamedTuple, Self

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import ELEMENTS, Boundary, Floats, Rope
from rope_twin.effects.coupled_vibration import DecomposedForceParams, ModalVibrationParams
from rope_twin.errors import InputError
from rope_twin.vortex.decomposed_response import DecomposedResponse
from rope_twin.vortex.drag_amplification import DragGrowth, amplified_drag, set_growth
from rope_twin.vortex.line_model import (
    AVERAGING_PERIODS,
    Span,
    along,
    flow_directions,
    line_model,
    mean_around,
    mix_flow,
    needs_new_interval,
    sampling_steps,
    shedding_hz,
    tangents,
    turned,
)
from rope_twin.vortex.modal_response import ModalResponse
from rope_twin.vortex.modes import ModeSearch
from rope_twin.vortex.power_in import Decomposed, ExcitationSearch, decomposed, fine_enough
from rope_twin.vortex.results import CoupledSettings, RopeVibration
from rope_twin.vortex.shedding import LOCK_IN, Lift, Shedding

EVERY_S = 1.0
COMPILE_STEP_S = 1e-3
FRACTIONS = np.linspace(0.0, 1.0, 65)  # fractions of the length, upward, at which flow is kept
_PLACE = slice(rows.POSITION, rows.POSITION + 3)


class CoupledModelState(NamedTuple):
    """State from which a loosely coupled model resumes."""

    response: Any
    searched: Span  # line model of the search in progress
    searching: bool
    flow: Floats
    since_s: float
    solves: int
    note: str


class CoupledModel:
    """Response of a VIV model from a start without vibration, following a running twin."""

    def __init__(
        self,
        model: str,
        rope: Rope,
        span_of: Callable[[Rope, Any], Span],
        response: Any,
        every_s: float = EVERY_S,
    ) -> None:
        """Start the model `model` without vibration, with a mode search every `every_s`.

        span_of: returns the rope as the response's line model; its second argument is the response.
        """
        self.model, self._span_of, self._response = model, span_of, response
        self._every_s = every_s
        self._searched: Span | None = None
        self._search: ModeSearch | ExcitationSearch | None = None
        self._flow = np.zeros((3, len(FRACTIONS)))
        mix_flow(self._flow, rope, 1.0)
        self._since_s, self.solves, self.note = every_s, 1, ""
        span = span_of(rope, response)
        response.follow(span, response.search(span))  # in parts, as later: bit-identical
        initial = response.kept()
        response.advance(COMPILE_STEP_S)  # compile now, not at the first sampling
        response.take_back(initial)
        self.notice = self.words(span)

    @property
    def size(self) -> tuple[int, int]:
        """Number of nodes of the line model, and number of modes."""
        return len(self._response.span.s), len(self._response.frequency)

    def words(self, span: Span) -> str:
        """Return a description with the cost of a mode search, measured here."""
        started = time.perf_counter()
        search = self._response.search(span)
        part_count = search.left
        modes = search.found()
        search_ms = 1e3 * (time.perf_counter() - started)
        node_count = len(self._response.span.s)
        every = f"every {self._every_s:g} s"
        search_text = f"computed {every} in {search_ms:.0f} ms, {part_count} parts"
        if not len(modes.frequency):
            idle = f"the current excites no mode on {node_count} nodes"
            return f"vibration {self.model}: {idle}; modes are {search_text}."
        return (
            f"vibration {self.model}: {len(modes.frequency)} modes up to "
            f"{modes.frequency.max():.3g} Hz on {node_count} nodes, {search_text}, steps of "
            f"{1e3 * self._response.step_s:.3g} ms."
        )

    def take(self, rope: Rope, sample_s: float, vortices_hz: float) -> None:
        """Advance the response by the time since the last sampling.

        sample_s: that time [s]; vortices_hz: frequency of the fastest vortex shedding [Hz].
        """
        weight = 1.0 - float(np.exp(-sample_s * vortices_hz / AVERAGING_PERIODS))
        mix_flow(self._flow, rope, weight)
        self._since_s += sample_s
        if self._since_s >= self._every_s - 1e-9:
            # the delay of this sampling counts towards the next search: instants do not drift
            self._since_s = 0.0 if self._search is None else self._since_s - self._every_s
            self._follow(rope)
        elif self._search is not None:
            samplings = max(1, round((self._every_s - self._since_s) / sample_s))
            for _ in range(ceil(self._search.left / samplings)):
                self._search.go_on()
        self._response.advance(sample_s)

    def restrict_searches(self) -> None:
        """Restrict later mode searches to modes near the excited ones, if the model can."""
        if isinstance(self._response, DecomposedResponse):
            self._response.thrifty = True

    def cut(self, remaining: float) -> None:
        """Adapt to a cut rope of which the fraction `remaining` of the elements is left.

        It continues in the old modes until the new ones are found; their search starts immediately.
        """
        fractions = 1.0 - remaining * (1.0 - FRACTIONS)
        self._flow = _at_fractions(self._flow, fractions)
        self._searched = self._search = None
        self._since_s = self._every_s

    def snapshot(self, rope: Rope) -> RopeVibration:
        """Return the VIV response at the nodes of the rope."""
        return RopeVibration(
            model=self.model,
            cross_flow=self._at_nodes(rope, self.at_model_nodes()[1])[::-1].copy(),
            cross_flow_hz=self._at_nodes(rope, self._response.dominant_hz)[::-1].copy(),
            in_line=None,
            in_line_hz=None,
            drag_amplification=np.ones(len(along(rope))),  # no feedback to the twin
            every_s=self._every_s,
            solves=self.solves,
            note=self.note,
        )

    def at_model_nodes(self) -> tuple[Floats, Floats, Floats]:
        """Return the response at the nodes of its own line model.

        Position along the rope, as of `along` [m]; amplitude [d]; half a wave length at the local
        shedding frequency [m]; (nodes,) each.
        """
        response = self._response
        s = response.span.s
        return s - s[-1], getattr(response, "amplitudes", response.amplitude), response.half_wave

    def _at_nodes(self, rope: Rope, values: Floats) -> Floats:
        """Interpolate values of the line model to the nodes of the rope."""
        s = self._response.span.s
        return np.interp(along(rope), s - s[-1], values)

    def moved(self, rope: Rope, marks: Floats) -> Floats:
        """Displacement across the flow at material coordinates [m]."""
        span = self._response.span
        displacement = np.interp(self._places(rope, marks), span.s, self._response.motion, 0.0, 0.0)
        return np.asarray(displacement)

    def _places(self, rope: Rope, marks: Floats) -> Floats:
        """Position of material coordinates on the response's line model [m]."""
        s = rope.state.s[: int(rope.state.counts[rows.ELEMENTS]) + 1]
        return np.asarray(self._response.span.s[-1] + np.interp(marks, s, along(rope)))

    def bent(self, rope: Rope, middles: Floats) -> Floats:
        """Curvature of the vibration at material coordinates, in components of `turned` [1/m]."""
        span = self._response.span
        n = int(rope.state.counts[rows.ELEMENTS])
        s, y, h = rope.state.s[: n + 1], self._response.motion, span.s[1] - span.s[0]
        curve = np.zeros(len(y))
        curve[1:-1] = (y[2:] - 2.0 * y[1:-1] + y[:-2]) / (h * h)
        on_model = self._places(rope, middles)
        nodes = rope.state.nodes[_PLACE, : n + 1]
        flow = _at_fractions(self._flow, np.linspace(0.0, 1.0, n + 1))
        across = turned(flow_directions(nodes, flow)[0], tangents(nodes))
        direction = np.stack([np.interp(middles, s, component) for component in across])
        return np.asarray(direction * np.interp(on_model, span.s, curve, 0.0, 0.0))

    def kept(self) -> CoupledModelState:
        """Return the state from which `take_back` resumes."""
        searched = self._searched or self._response.kept()[0]
        return CoupledModelState(
            self._response.kept(), searched, self._search is not None, self._flow.copy(),
            self._since_s, self.solves, self.note,
        )  # fmt: skip

    def take_back(self, saved: CoupledModelState) -> None:
        """Resume from this state."""
        self._response.take_back(saved.response)
        if saved.searching:
            self._searched, self._search = saved.searched, self._response.search(saved.searched)
            self._search.found()  # at once: parts would be spread otherwise than in the saved run
        self._flow, self._since_s, self.solves = saved.flow.copy(), saved.since_s, saved.solves
        self.note = saved.note

    def _follow(self, rope: Rope) -> None:
        """Use the modes found in the last second, and start the next mode search."""
        if self._search is not None and self._searched is not None:
            self._response.follow(self._searched, self._search)
            self.solves += 1
        self._searched = self._search = None
        try:
            span = self._span_of(rope, self._response)
            self._searched, self._search, self.note = span, self._response.search(span), ""
        except InputError as error:
            self.note = f"the modes are those from before: {error}"


def _at_fractions(flow: Floats, fractions: Floats) -> Floats:
    """Return the flow, (3, FRACTIONS), at other fractions of the length, (3, n)."""
    return np.stack([np.interp(fractions, FRACTIONS, component) for component in flow])


def modal_model(
    rope: Rope, shedding: Shedding, name: str = "modes", every_s: float = EVERY_S
) -> CoupledModel:
    """Return the modal VIV model (Le Cunff and Durand 1999) for a rope.

    Raises:
        InputError: the rope is slack somewhere.
    """
    response = ModalResponse(line_model(rope), shedding)
    return CoupledModel(name, rope, lambda rope, _: line_model(rope), response, every_s)


def force_decomposition_model(
    rope: Rope, model: Decomposed, name: str = "decomposed", every_s: float = EVERY_S
) -> CoupledModel:
    """Return the force-decomposition model (Ge 2018) for a rope.

    Raises:
        InputError: the rope is slack somewhere.
    """

    def span_of(rope: Rope, response: DecomposedResponse) -> Span:
        span, elements = line_model(rope, moved_water=False), len(response.span.tension)
        return fine_enough(span, model, elements, response.recent)

    initial = fine_enough(line_model(rope, moved_water=False), model)
    return CoupledModel(name, rope, span_of, DecomposedResponse(initial, model), every_s)


class VivDragState(NamedTuple):
    """State from which the model resumes."""

    trackers: tuple[CoupledModelState, ...]  # of each rope
    hz: float
    currents: int
    sampled: int
    second: int
    step_since: tuple[int, float]


class VivDragAmplification:
    """Loosely coupled VIV model of a scene, from a start without vibration.

    In a multi-line system every rope has its own response, in the modes with its ends at
    connections fixed. All ropes are sampled at the same time.

    Raises:
        InputError: a rope is slack somewhere.
    """

    def __init__(
        self, settings: CoupledSettings, ropes: Sequence[Rope], loaded: Sequence[bool], cycle: int
    ) -> None:
        """Start the model for ropes in static equilibrium.

        loaded: whether the upper end of a rope carries loads, as at a connection; cycle: steps of a
        real-time cycle.
        """
        self.hz, self._currents = 0.0, 0  # vortex frequency of the interval, current profiles
        self._sampled, self._second = 0, -1  # step of the last sampling, second of its time
        self._strouhal, self._step_s = settings.strouhal, settings.step_s
        self._step_since = (0, 0.0)  # steps and time [s] at which the step became this long
        self._cycle, self._rarer = cycle, 1
        self.every = cycle  # steps between two samplings
        self._growth: tuple[float, float] = settings.params.drag_growth
        self._loaded = tuple(loaded)
        self.trackers: tuple[CoupledModel, ...] = tuple(_tracker(settings, rope) for rope in ropes)
        self.amplify(ropes)  # compile now, not at the first sampling
        self._took_s = self._sampled_s = 0.0  # CPU time of the model, and twin time covered

    @property
    def notice(self) -> str:
        """Description of the models with the cost of a mode search, a line for each rope."""
        return "\n".join(tracker.notice for tracker in self.trackers)

    def steps_to_sampling(self, steps: int) -> int:
        """Return the number of steps left until the next sampling, after `steps` steps."""
        return self._sampled + self.every - steps

    def observe(self, ropes: Sequence[Rope], boundary: Boundary, steps: int, currents: int) -> None:
        """Advance by the time since the last sampling, and set the drag amplification.

        boundary: of the first rope, row 0 is the present; steps: done by the twin; currents: number
        of profiles accepted. Ropes beyond those of the start, parts below a cut, have no vibration.
        """
        started = time.perf_counter()
        since_s = (steps - self._sampled) * self._step_s
        self._sampled = steps
        followed = ropes[: len(self.trackers)]
        self._update_interval(followed, boundary, currents)
        for tracker, rope in zip(self.trackers, followed, strict=True):
            tracker.take(rope, since_s, self.hz)
        self.amplify(followed)
        self._sampled_s += since_s
        self._took_s += time.perf_counter() - started

    def amplify(self, ropes: Sequence[Rope]) -> None:
        """Set the drag amplification at the nodes that carry loads."""
        for tracker, loaded, rope in zip(self.trackers, self._loaded, ropes, strict=False):
            amplification = self._amplification_less_1(tracker, rope)
            for effect in rope.effects:
                if isinstance(effect, DragGrowth):
                    set_growth(effect, rope.state, amplification if loaded else amplification[:-1])

    def sample_now(
        self, ropes: Sequence[Rope], boundary: Boundary, steps: int, currents: int
    ) -> None:
        """Sample at once, unless the present is sampled already; arguments as of `look`."""
        if steps > self._sampled:
            self.observe(ropes, boundary, steps, currents)

    def set_step(self, step_s: float, cycle: int) -> None:
        """Continue with another step from the newest sampling on; cycle: steps of a cycle."""
        self._step_since = self._sampled, self._time_s
        self._step_s, self._cycle = step_s, cycle
        self.every = self._rarer * sampling_steps(self.hz, step_s, cycle)

    @property
    def _time_s(self) -> float:
        """Time of the newest sampling [s]."""
        step, time_s = self._step_since
        return time_s + (self._sampled - step) * self._step_s

    def coarse_copy(self, rarer: int) -> Self:
        """Return an independent copy that samples `rarer` times less often.

        Its first sampling is at the same time as this one's.
        """
        coarse = copy.deepcopy(self)
        for tracker in coarse.trackers:
            tracker.restrict_searches()
        coarse._rarer = rarer
        if coarse.hz > 0.0:
            coarse.every = rarer * sampling_steps(coarse.hz, coarse._step_s, coarse._cycle)
        return coarse

    def cut(self, number: int, whole: Rope, upper: Rope) -> None:
        """Adapt to a cut of a rope: the remaining part has its own modes."""
        n, remaining = (int(rope.state.counts[ELEMENTS]) for rope in (whole, upper))
        self.trackers[number].cut(min(remaining / n, 1.0))

    def snapshots(self, ropes: Sequence[Rope]) -> tuple[RopeVibration, ...]:
        """Return the VIV response at the nodes of each rope, from its last node down."""
        cost_pct = 100.0 * self._took_s / max(self._sampled_s, self._step_s)
        return tuple(
            replace(
                tracker.snapshot(rope),
                drag_amplification=1.0 + self._amplification_less_1(tracker, rope)[::-1],
                cost_pct=cost_pct,
            )
            for tracker, rope in zip(self.trackers, ropes, strict=False)
        )

    def drag_amplification(self, rope: Rope, number: int) -> Floats:
        """Return the drag amplification at the nodes of rope `number`, from the core's first on."""
        return 1.0 + self._amplification_less_1(self.trackers[number], rope)

    def _amplification_less_1(self, tracker: CoupledModel, rope: Rope) -> Floats:
        """Return the drag amplification less 1 at the nodes of a rope.

        The value at a node is the mean up to its neighbours, over at least half a wave length to
        either side, so that the drag in standing waves does not depend on whether the nodes resolve
        them.
        """
        s, amplitude, half_wave = tracker.at_model_nodes()
        amplification = amplified_drag(amplitude / sqrt(2.0), self._growth) - 1.0
        position = along(rope)
        return mean_around(position, s, amplification, np.interp(position, s, half_wave))

    def kept(self) -> VivDragState:
        """Return the state from which `take_back` resumes."""
        trackers = tuple(tracker.kept() for tracker in self.trackers)
        return VivDragState(
            trackers, self.hz, self._currents, self._sampled, self._second, self._step_since
        )

    def take_back(self, saved: VivDragState) -> None:
        """Resume from this state."""
        for tracker, state in zip(self.trackers, saved.trackers, strict=True):
            tracker.take_back(state)
        self.hz, self._currents = saved.hz, saved.currents
        self._sampled, self._second = saved.sampled, saved.second
        self._step_since = saved.step_since
        self.every = self._rarer * sampling_steps(self.hz, self._step_s, self._cycle)

    def _update_interval(self, ropes: Sequence[Rope], boundary: Boundary, currents: int) -> None:
        """Adapt the sampling interval to the fastest vortices of all ropes, once a second."""
        second = int(self._time_s + 1e-9)
        if second == self._second:
            return
        self._second = second
        hz = max(shedding_hz(rope, boundary, self._strouhal) for rope in ropes)
        if needs_new_interval(hz, self.hz, currents != self._currents):
            self.hz, self._currents = hz, currents
            self.every = self._rarer * sampling_steps(hz, self._step_s, self._cycle)


def _tracker(settings: CoupledSettings, rope: Rope) -> CoupledModel:
    """Return the model of a scene for a rope in static equilibrium."""
    name, params, density = settings.name, settings.params, settings.density
    if isinstance(params, ModalVibrationParams):
        return modal_model(rope, shedding_of(params, density), name, params.modes_every_s)
    if not isinstance(params, DecomposedForceParams):
        raise TypeError(f"{name} is not a loosely coupled model")
    return force_decomposition_model(
        rope, decomposed_of(params, density), name, params.modes_every_s
    )


def decomposed_of(params: DecomposedForceParams, density: float) -> Decomposed:
    """Return the force-decomposition model of a scene, with its own table if it names one."""
    fixed = params.added_mass
    model = replace(
        decomposed(fixed is None, params.damping_fraction),
        fixed_added_mass=1.0 if fixed is None else fixed,
        band=params.band,
        density=density,
        lock_in=params.lock_in,
    )
    if params.table is None:
        return model
    table = params.table.figures()
    return replace(
        model, table=table.forces, band=table.band, centre=table.centre,
        first_amplitude=table.amplitude,
    )  # fmt: skip


def shedding_of(params: ModalVibrationParams, density: float) -> Shedding:
    """Return the hydrodynamic properties of the modal model of a scene."""
    return Shedding(
        strouhal=params.strouhal,
        band=params.band,
        density=density,
        viscosity=params.viscosity_m2_per_s,
        structural=params.damping_fraction,
        lift=Lift(*params.lift, *params.lift_at),
        factor=params.lift_factor,
        zones=LOCK_IN[params.lock_in],
    )
