"""Time-domain response of the force-decomposition model ([GE], [SJTU] ch. 5).

Nodes that excite a mode are loaded by ½·C_Lv·ρ·D·U²·cos(2π·f·t)·sign φ at its natural frequency
where C_Lv > 0; where it is negative they are damped by c = -½·C_Lv·ρ·D·U²/(A·ω). C_Lv and C_a
follow from each node's amplitude and frequency, which are measured from its motion over the last
periods: ω = rms(ÿ)/rms(ẏ), A = √2·rms(ẏ)/ω, independent of a slow drift of y. Structural damping is
2·m·ω·ζ. The default integrator is Bathe's: Newmark's (0.30, 0.55) has a numerical damping of 0.65 %
of critical at PER_PERIOD, more than the structural damping of a rope.
"""

from __future__ import annotations

from math import exp, pi, sqrt
from typing import NamedTuple

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.vortex.force_table import Drives, Nodes, node_forces, update_means
from rope_twin.vortex.integrators import Integrator, Matrices, Motion, bathe, upper_bands
from rope_twin.vortex.line_model import RecentSpeeds, Span, half_waves
from rope_twin.vortex.modes import stiffness
from rope_twin.vortex.power_in import (
    TIE,
    Decomposed,
    Excitation,
    ExcitationSearch,
    displaced,
    near_driven,
)
from rope_twin.vortex.shedding import share_out

PER_PERIOD = 24  # steps per period of the fastest excited mode
REMEMBERED = 3.0  # periods over which motion is averaged
PART = 12  # modes computed per call alongside a running twin


class KeptResponse(NamedTuple):
    """Restart data of a response; a restart is bit-identical."""

    span: Span
    nodes: Floats  # motion (three rows), both mean squares, amplitude, ω; (7, free nodes)
    angles: Floats  # of the modes
    since_s: float
    time_s: float
    recent: Floats  # as of RecentSpeeds


class DecomposedResponse:
    """Response of a rope, starting without motion; span.mass is without added mass.

    Raises:
        InputError: the rope is slack somewhere.
    """

    def __init__(self, span: Span, model: Decomposed, integrator: Integrator | None = None) -> None:
        self.model = model
        self.time_s = 0.0
        self.recent = RecentSpeeds()
        self._integrate = integrator or bathe
        self.remembered, self.thrifty = REMEMBERED, False
        self._first = 1 if span.end_mass is None else 0
        self._table = model.table
        if not model.varying:
            same = np.full_like(model.table.added_mass, model.fixed_added_mass)
            self._table = model.table._replace(added_mass=same)
        self._take(span, None)
        self._angles = np.zeros(len(self.excitation.frequency))  # phases of the modes at `_since_s`
        self._since_s = 0.0
        self._nodes, self._drives = self._at_nodes(), self._driven()
        still = np.zeros((6, len(self._nodes.dry)))
        self._motion = Motion(still[0], still[1], still[2])
        self._squares = still[3:5]  # running mean of ẏ², ÿ²
        self.amplitude, self.omega = still[5], self._nodes.omega.copy()

    def search(self, span: Span) -> ExcitationSearch:
        """Return an incremental analysis for a changed rope, to be passed to `follow` when
        complete.

        `thrifty`: only among modes with frequencies close to those excited now.

        Raises:
            InputError: it is slack somewhere.
        """
        near = near_driven(self.excitation) if self.thrifty else None
        return ExcitationSearch(span, self.model, PART, near)

    def follow(self, span: Span, search: ExcitationSearch | None = None) -> None:
        """Update to a changed rope (tension, length or current); the motion continues.

        Modes, powers and natural frequencies are recomputed; a mode keeps its phase by its number.
        `search`: result of an incremental analysis.

        Raises:
            InputError: it is slack somewhere; the old modes are kept.
        """
        turned = 2.0 * pi * self.excitation.frequency * (self.time_s - self._since_s)
        angles, before = self._angles + turned, self._below_top()
        self._take(span, search)
        self._angles = np.zeros(len(self.excitation.frequency))
        known = min(len(angles), len(self._angles))
        self._angles[:known] = np.remainder(angles[:known], 2.0 * pi)
        self._since_s = self.time_s
        self._nodes, self._drives = self._at_nodes(), self._driven()
        now = self._below_top()
        self._motion = Motion(*(np.interp(now, before, part) for part in self._motion))
        self._squares = np.stack([np.interp(now, before, part) for part in self._squares])
        self.amplitude = np.interp(now, before, self.amplitude)
        self.omega = np.interp(now, before, self.omega)

    @property
    def frequency(self) -> Floats:
        """Return the natural frequencies of the candidate modes [Hz]."""
        return self.excitation.frequency

    @property
    def dominant_hz(self) -> Floats:
        """Return the frequency of the nodes by their motion; 0 where nothing moves, (nodes,)."""
        return self._all(np.where(self.amplitude > 0.0, self.omega / (2.0 * pi), 0.0))

    @property
    def amplitudes(self) -> Floats:
        """Return the amplitude of all nodes [D]."""
        return self._all(self.amplitude)

    def kept(self) -> KeptResponse:
        """Return the restart data for `take_back`."""
        return KeptResponse(
            self.span, np.stack([*self._motion, *self._squares, self.amplitude, self.omega]),
            self._angles.copy(), self._since_s, self.time_s, self.recent.kept(),
        )  # fmt: skip

    def take_back(self, kept: KeptResponse) -> None:
        """Restore a response from its restart data; its modes were those of a search."""
        self._take(kept.span, self.search(kept.span))
        self.recent.take_back(kept.recent)
        self._motion = Motion(*kept.nodes[:3])
        self._squares = kept.nodes[3:5].copy()
        self.amplitude, self.omega = kept.nodes[5], kept.nodes[6]
        self._angles, self._since_s, self.time_s = kept.angles, kept.since_s, kept.time_s
        self._nodes, self._drives = self._at_nodes(), self._driven()

    def _take(self, span: Span, search: ExcitationSearch | None) -> None:
        """Set the excitation of this rope, and its stiffness."""
        self.span = span
        self.recent.add(self.time_s, span)
        moved = self.model.density * 0.25 * pi * span.diameter[1:] ** 2
        self.half_wave = half_waves(span, sqrt(self.model.band[0] * self.model.band[1]), moved)
        self.excitation: Excitation = (search or ExcitationSearch(span, self.model)).found()
        self._bands = np.ascontiguousarray(_bands(span)[:, self._first : -1])

    def _at_nodes(self) -> Nodes:
        """Return the load coefficients of the free nodes."""
        span, density = self.span, self.model.density
        whole = Nodes(
            push=0.5 * density * span.diameter * span.speed**2 * span.node_length,
            water=displaced(span, density),
            dry=span.node_mass,
            diameter=span.diameter,
            speed=np.maximum(span.speed, 1e-6),
            omega=2.0 * pi * self._first_guess(),
        )
        return Nodes(*(np.ascontiguousarray(part[self._first : -1]) for part in whole))

    def _driven(self) -> Drives:
        """Return the modes excited by the free nodes, and set the longest step."""
        frequency = float(self.excitation.driven.max())
        self.step_s = 1.0 / (PER_PERIOD * frequency) if frequency > 0.0 else np.inf
        free = slice(self._first, -1)
        zones = self.excitation.zones[free]
        part = zones * np.sign(self.excitation.modes.shape[free])
        node, mode = np.nonzero(zones)
        first = np.searchsorted(node, np.arange(len(zones) + 1))
        omega = 2.0 * pi * self.excitation.frequency
        return Drives(first, mode, part[node, mode], omega, self._angles)

    def _below_top(self) -> Floats:
        """Return the coordinate of the free nodes below the hang-off, negative [m]."""
        return np.asarray(self.span.s[self._first : -1] - self.span.s[-1])

    def _all(self, free: Floats) -> Floats:
        """Return the value of every node, 0 where it is fixed."""
        whole = np.zeros(len(self.span.s))
        whole[self._first : -1] = free
        return whole

    def _first_guess(self) -> Floats:
        """Return the initial frequency of each node: its excitation, else the strongest mode's."""
        driven, found = self.excitation.driven, self.excitation
        whole = np.ones((1, len(found.power)))
        main = float(share_out(found.power, whole, TIE)[0] @ found.frequency)
        return np.where(driven > 0.0, driven, main or 1.0)

    @property
    def motion(self) -> Floats:
        """Return the cross-flow displacement of all nodes [m]."""
        return self._all(self._motion.place)

    def advance(self, duration_s: float) -> None:
        """Advance by a duration, in steps of at most `step_s`."""
        steps = max(1, int(np.ceil(duration_s / self.step_s - 1e-9)))
        for _ in range(steps):
            self._advance(duration_s / steps)

    def _advance(self, h: float) -> None:
        mass, damping, middle, end = np.empty((4, len(self.amplitude)))
        node_forces(
            self._table, self._nodes, self._drives, self.amplitude, self.omega,
            self.time_s - self._since_s, h, self.model.structural, mass, damping, middle, end,
            np.empty((2, len(self._drives.omega))),
        )  # fmt: skip
        parts = Matrices(mass, damping, self._bands)
        self._motion = self._integrate(self._motion, parts, middle, end, h)
        self.time_s += h
        # means over the time since the start, at most over the averaging time
        own = 2.0 * pi / float(self._nodes.omega.max())
        share = max(1.0 - exp(-h / (self.remembered * own)), h / self.time_s)
        self.amplitude, self.omega = np.empty((2, len(mass)))
        update_means(self._nodes, self._motion, share, self._squares, self.amplitude, self.omega)


def _bands(span: Span) -> Floats:
    """Return the stiffness between all nodes in LAPACK's upper form, of minimum bandwidth."""
    if span.stiffness > 0.0:
        return upper_bands(stiffness(span).tocsr(), 3)
    k = span.tension / np.diff(span.s)
    bands = np.zeros((2, len(span.s)))
    bands[0, 1:], bands[1, :-1] = -k, k
    bands[1, 1:] += k
    return bands
