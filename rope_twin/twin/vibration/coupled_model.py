"""Loosely coupled VIV models: vibration computed from a running twin's rope by its modes.

The twin steps the rope at the time scale of ship and winch. Once a second its tension, length and
the flow across it are sampled; the modes and their excitation are then searched in parts, some at
each sampling, and used a second later. No sampling therefore takes long, and an offline run is
bit-identical to a real-time one: the work done at each sampling does not depend on the machine.
Unless the scene lists the model (`drag_amplification.py`), the twin's own motion is unchanged.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.modes.nodes import along, mix_flow
from rope_twin.core.state import Floats, Rope
from rope_twin.errors import InputError
from rope_twin.twin.fatigue.damage import turned
from rope_twin.twin.results import RopeVibration
from rope_twin.twin.vibration.line_model import line_model
from rope_twin.twin.vibration.measured import AVERAGING_PERIODS, flow_directions, tangents
from rope_twin.viv.decomposed import Decomposed, ExcitationSearch, fine_enough
from rope_twin.viv.decomposed_response import DecomposedResponse
from rope_twin.viv.lateral_modes import ModeSearch
from rope_twin.viv.modal_response import ModalResponse
from rope_twin.viv.shedding import Shedding
from rope_twin.viv.span import Span

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
        span_of: Callable[[Rope, int], Span],
        response: Any,
        every_s: float = EVERY_S,
    ) -> None:
        """Start the model `model` without vibration, with a mode search every `every_s`.

        span_of: returns the rope as the response's line model; its argument is the present number
        of elements.
        """
        self.model, self._span_of, self._response = model, span_of, response
        self._every_s = every_s
        self._searched: Span | None = None
        self._search: ModeSearch | ExcitationSearch | None = None
        self._flow = np.zeros((3, len(FRACTIONS)))
        mix_flow(self._flow, rope, 1.0)
        self._since_s, self.solves, self.note = every_s, 1, ""
        span = span_of(rope, len(response.span.tension))
        response.follow(span, response.search(span))  # in parts, as later: bit-identical
        still = response.kept()
        response.advance(COMPILE_STEP_S)  # compile now, not at the first sampling
        response.take_back(still)
        self.told = self.words(span)

    @property
    def size(self) -> tuple[int, int]:
        """Number of nodes of the line model, and number of modes."""
        return len(self._response.span.s), len(self._response.frequency)

    def words(self, span: Span) -> str:
        """Return a description with the cost of a mode search, measured here."""
        began = time.perf_counter()
        search = self._response.search(span)
        parts = search.left
        found = search.found()
        took_ms = 1e3 * (time.perf_counter() - began)
        highest = f" up to {found.frequency.max():.3g} Hz" if len(found.frequency) else ""
        return (
            f"vibration {self.model}: {len(found.frequency)} modes{highest} on "
            f"{len(self._response.span.s)} places, found again every {self._every_s:g} s in "
            f"{took_ms:.0f} ms, {parts} parts, steps of {1e3 * self._response.step_s:.3g} ms."
        )

    def take(self, rope: Rope, sample_s: float, vortices_hz: float) -> None:
        """Advance the response by the time since the last sampling.

        sample_s: that time [s]; vortices_hz: frequency of the fastest vortex shedding [Hz].
        """
        share = 1.0 - float(np.exp(-sample_s * vortices_hz / AVERAGING_PERIODS))
        mix_flow(self._flow, rope, share)
        self._since_s += sample_s
        if self._since_s >= self._every_s - 1e-9:
            # the delay of this sampling counts towards the next search: instants do not drift
            self._since_s = 0.0 if self._search is None else self._since_s - self._every_s
            self._follow(rope)
        elif self._search is not None:
            looks = max(1, round((self._every_s - self._since_s) / sample_s))
            for _ in range(ceil(self._search.left / looks)):
                self._search.go_on()
        self._response.advance(sample_s)

    def restrict_searches(self) -> None:
        """Restrict later mode searches to modes near the excited ones, if the model can."""
        if isinstance(self._response, DecomposedResponse):
            self._response.thrifty = True

    def cut(self, hangs_on: float) -> None:
        """Adapt to a cut rope of which this fraction of the elements is left.

        It keeps vibrating as before until its own modes are found, which are searched at once.
        """
        shares = 1.0 - hangs_on * (1.0 - FRACTIONS)
        self._flow = np.stack([np.interp(shares, FRACTIONS, part) for part in self._flow])
        self._searched = self._search = None
        self._since_s = self._every_s

    def shot(self, rope: Rope) -> RopeVibration:
        """Return the VIV response at the nodes of the rope."""
        return RopeVibration(
            model=self.model,
            cross_flow=self.amplitudes(rope)[::-1].copy(),
            cross_flow_hz=self._at_nodes(rope, self._response.dominant_hz)[::-1].copy(),
            in_line=None,
            in_line_hz=None,
            drag_amplification=np.ones(len(along(rope))),  # no feedback to the twin
            every_s=self._every_s,
            solves=self.solves,
            note=self.note,
        )

    def amplitudes(self, rope: Rope) -> Floats:
        """Return the amplitude at the nodes of the rope, from the lower end up [d]."""
        return self._at_nodes(rope, self.at_model_nodes()[1])

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
        found = np.interp(self._places(rope, marks), span.s, self._response.motion, 0.0, 0.0)
        return np.asarray(found)

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
        at = self._places(rope, middles)
        place = rope.state.nodes[_PLACE, : n + 1]
        shares = np.linspace(0.0, 1.0, n + 1)
        flow = np.stack([np.interp(shares, FRACTIONS, part) for part in self._flow])
        across = turned(flow_directions(place, flow)[0], tangents(place))
        there = np.stack([np.interp(middles, s, part) for part in across])
        return np.asarray(there * np.interp(at, span.s, curve, 0.0, 0.0))

    def kept(self) -> CoupledModelState:
        """Return the state from which `take_back` resumes."""
        searched = self._searched or self._response.kept()[0]
        return CoupledModelState(
            self._response.kept(), searched, self._search is not None, self._flow.copy(),
            self._since_s, self.solves, self.note,
        )  # fmt: skip

    def take_back(self, kept: CoupledModelState) -> None:
        """Resume from this state."""
        self._response.take_back(kept.response)
        if kept.searching:
            self._searched, self._search = kept.searched, self._response.search(kept.searched)
            self._search.found()  # at once: the remainder would not be spread as before
        self._flow, self._since_s, self.solves = kept.flow.copy(), kept.since_s, kept.solves
        self.note = kept.note

    def _follow(self, rope: Rope) -> None:
        """Take over the modes found in the last second, and start searching the present ones."""
        if self._search is not None and self._searched is not None:
            self._response.follow(self._searched, self._search)
            self.solves += 1
        self._searched = self._search = None
        try:
            span = self._span_of(rope, len(self._response.span.tension))
            self._searched, self._search, self.note = span, self._response.search(span), ""
        except InputError as error:
            self.note = f"the modes are those from before: {error}"


def modal_model(
    rope: Rope, shedding: Shedding, name: str = "modes", every_s: float = EVERY_S
) -> CoupledModel:
    """Return the modal VIV model (Le Cunff and Durand 1999) for a rope.

    Raises:
        InputError: the rope is slack somewhere.
    """

    def span_of(rope: Rope, elements: int) -> Span:
        return line_model(rope)

    return CoupledModel(name, rope, span_of, ModalResponse(line_model(rope), shedding), every_s)


def force_decomposition_model(
    rope: Rope, model: Decomposed, name: str = "decomposed", every_s: float = EVERY_S
) -> CoupledModel:
    """Return the force-decomposition model (Ge 2018) for a rope.

    Raises:
        InputError: the rope is slack somewhere.
    """

    def span_of(rope: Rope, elements: int) -> Span:
        return fine_enough(line_model(rope, moved_water=False), model, elements)

    return CoupledModel(name, rope, span_of, DecomposedResponse(span_of(rope, 0), model), every_s)
