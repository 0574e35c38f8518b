"""Time-domain response of the force-decomposition model ([GE], [SJTU] ch. 5).

**Integration** of M·ÿ + C·ẏ + K·y = F with diagonal M and C, by the method of Bathe and Baig
(2005): half a step by the trapezoidal rule, which is that of Newmark (1959) with α 0.25 and δ 0.5,
the other half by a three-point backward formula. K has three or five diagonals; (K + D)·x = r with
a diagonal D is solved by an LDLᵀ factorisation without pivoting: the matrix is positive definite.

**Forces.** Nodes that excite a mode are loaded by ½·C_Lv·ρ·D·U²·cos(2π·f·t)·sign φ at its natural
frequency where C_Lv > 0; where it is negative they are damped by c = -½·C_Lv·ρ·D·U²/(A·ω). C_Lv and
C_a follow from each node's amplitude and frequency, which are measured from its motion over the
last periods: ω = rms(ÿ)/rms(ẏ), A = √2·rms(ẏ)/ω, independent of a slow drift of y. Structural
damping is 2·m·ω·ζ. The default integrator is Bathe's: Newmark's (0.30, 0.55) has a numerical
damping of 0.65 % of critical at PER_PERIOD, more than the structural damping of a rope.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import Floats
from rope_twin.vortex.force_table import NodeExcitation, Nodes, node_forces, update_means
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


class Motion(NamedTuple):
    """Motion of the free nodes, (n,) each."""

    place: Floats
    speed: Floats
    acceleration: Floats


class Matrices(NamedTuple):
    """M and C diagonal (n,), K in LAPACK's upper banded form, (diagonals, n)."""

    mass: Floats
    damping: Floats
    stiffness: Floats


Integrator = Callable[[Motion, Matrices, Floats, Floats, float], Motion]


def upper_bands(matrix: Any, diagonals: int) -> Floats:
    """Return the upper diagonals of a symmetric sparse matrix in LAPACK's form."""
    n = matrix.shape[0]
    bands = np.zeros((diagonals, n))
    for k in range(diagonals):
        bands[diagonals - 1 - k, k:] = matrix.diagonal(k)
    return bands


def bathe(motion: Motion, matrices: Matrices, middle: Floats, end: Floats, h: float) -> Motion:
    """Advance ½ h by the trapezoidal rule, then by v' = (y - 4·y½ + 3·y')/h, likewise a'."""
    after, work = np.empty((3, len(end))), np.empty((5, len(end)))
    bathe_step(motion, matrices, middle, end, h, after, work)
    return Motion(after[0], after[1], after[2])


@jit
def newmark_step(
    motion: Any,
    matrices: Any,
    force: Any,
    h: float,
    alpha: float,
    delta: float,
    after: Any,
    work: Any,
) -> None:
    """Write displacement, velocity and acceleration after h seconds to the rows of `after`, (3, n).

    y += h·v + h²·((½ - α)·a + α·a'), v += h·((1 - δ)·a + δ·a') with the force at the end; motion:
    before the step; matrices: mass, damping, stiffness (LAPACK upper form); work: scratch, (5, n).
    """
    y, v, a = motion.place, motion.speed, motion.acceleration
    weight = alpha * h * h
    for i in range(y.shape[0]):
        after[0, i] = y[i] + h * v[i] + (0.5 - alpha) * h * h * a[i]
        after[1, i] = v[i] + (1.0 - delta) * h * a[i]
        work[0, i] = (matrices.mass[i] + delta * h * matrices.damping[i]) / weight
    _multiply(matrices.stiffness, after, work)
    for i in range(y.shape[0]):
        work[1, i] = force[i] - matrices.damping[i] * after[1, i] - work[1, i]
    _solve(matrices.stiffness, work)
    for i in range(y.shape[0]):
        after[2, i] = work[1, i] / weight
        after[0, i] += work[1, i]
        after[1, i] += delta * h * after[2, i]


@jit_entry
def bathe_step(
    motion: Any, matrices: Any, middle: Any, end: Any, h: float, after: Any, work: Any
) -> None:
    """Write the state after h seconds by Bathe's method; middle, end: forces of its substeps."""
    newmark_step(motion, matrices, middle, 0.5 * h, 0.25, 0.5, after, work)
    y, v, mass, damping = motion.place, motion.speed, matrices.mass, matrices.damping
    for i in range(y.shape[0]):
        v_hat = (y[i] - 4.0 * after[0, i]) / h
        a_hat = (v[i] - 4.0 * after[1, i] + 3.0 * v_hat) / h
        work[0, i] = 9.0 / (h * h) * mass[i] + 3.0 / h * damping[i]
        work[1, i] = end[i] - mass[i] * a_hat - damping[i] * v_hat
        after[0, i] = v_hat
    _solve(matrices.stiffness, work)
    for i in range(y.shape[0]):
        speed = after[0, i] + 3.0 / h * work[1, i]
        after[2, i] = (3.0 * speed - 4.0 * after[1, i] + v[i]) / h
        after[0, i], after[1, i] = work[1, i], speed


@jit
def _multiply(K: Any, after: Any, work: Any) -> None:
    """Multiply K by the displacements, into row 1 of the scratch."""
    n, last = after.shape[1], K.shape[0] - 1
    for i in range(n):
        work[1, i] = K[last, i] * after[0, i]
    for k in range(1, last + 1):
        for i in range(k, n):
            work[1, i - k] += K[last - k, i] * after[0, i]
            work[1, i] += K[last - k, i] * after[0, i - k]


@jit
def _solve(K: Any, work: Any) -> None:
    """Solve (K + D)·x = r: D in row 0 of the scratch, r and then x in row 1."""
    n, last = work.shape[1], K.shape[0] - 1
    d, r, first, second = work[2], work[1], work[3], work[4]  # subdiagonals of L
    for i in range(n):
        d[i], first[i], second[i] = K[last, i] + work[0, i], 0.0, 0.0
        second_off = 0.0
        if last == 2 and i > 1:
            second_off = K[0, i]
            second[i] = second_off / d[i - 2]
            d[i] -= second[i] * second_off
            r[i] -= second[i] * r[i - 2]
        if i > 0:
            first_off = K[last - 1, i] - first[i - 1] * second_off
            first[i] = first_off / d[i - 1]
            d[i] -= first[i] * first_off
            r[i] -= first[i] * r[i - 1]
    for i in range(n - 1, -1, -1):
        r[i] /= d[i]
        if i + 1 < n:
            r[i] -= first[i + 1] * r[i + 1]
        if i + 2 < n:
            r[i] -= second[i + 2] * r[i + 2]


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
            constant = np.full_like(model.table.added_mass, model.fixed_added_mass)
            self._table = model.table._replace(added_mass=constant)
        self._take(span, None)
        self._angles = np.zeros(len(self.excitation.frequency))  # phases of the modes at `_since_s`
        self._since_s = 0.0
        self._nodes, self._drives = self._at_nodes(), self._driven()
        zeros = np.zeros((6, len(self._nodes.dry)))
        self._motion = Motion(zeros[0], zeros[1], zeros[2])
        self._squares = zeros[3:5]  # running mean of ẏ², ÿ²
        self.amplitude, self.omega = zeros[5], self._nodes.omega.copy()

    def search(self, span: Span) -> ExcitationSearch:
        """Return an incremental analysis for a changed rope, to be passed to `follow` when
        complete.

        `thrifty`: only among modes with frequencies close to those excited now.

        Raises:
            InputError: it is slack somewhere.
        """
        range_hz = near_driven(self.excitation) if self.thrifty else None
        return ExcitationSearch(span, self.model, PART, range_hz)

    def follow(self, span: Span, search: ExcitationSearch | None = None) -> None:
        """Update to a changed rope (tension, length or current); the motion continues.

        Modes, powers and natural frequencies are recomputed; a mode keeps its phase by its number.
        `search`: result of an incremental analysis.

        Raises:
            InputError: it is slack somewhere; the old modes are kept.
        """
        advanced = 2.0 * pi * self.excitation.frequency * (self.time_s - self._since_s)
        angles, height_before = self._angles + advanced, self._below_top()
        self._take(span, search)
        self._angles = np.zeros(len(self.excitation.frequency))
        shared = min(len(angles), len(self._angles))
        self._angles[:shared] = np.remainder(angles[:shared], 2.0 * pi)
        self._since_s = self.time_s
        self._nodes, self._drives = self._at_nodes(), self._driven()
        height = self._below_top()
        self._motion = Motion(
            *(np.interp(height, height_before, values) for values in self._motion)
        )
        self._squares = np.stack(
            [np.interp(height, height_before, values) for values in self._squares]
        )
        self.amplitude = np.interp(height, height_before, self.amplitude)
        self.omega = np.interp(height, height_before, self.omega)

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

    def take_back(self, saved: KeptResponse) -> None:
        """Restore a response from its restart data; its modes were those of a search."""
        self._take(saved.span, self.search(saved.span))
        self.recent.take_back(saved.recent)
        self._motion = Motion(*saved.nodes[:3])
        self._squares = saved.nodes[3:5].copy()
        self.amplitude, self.omega = saved.nodes[5], saved.nodes[6]
        self._angles, self._since_s, self.time_s = saved.angles, saved.since_s, saved.time_s
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
        """Return the load coefficients of the free nodes.

        A node's initial frequency is that of its excitation, else the strongest mode's.
        """
        span, density = self.span, self.model.density
        driven, found = self.excitation.driven, self.excitation
        whole = np.ones((1, len(found.power)))
        main = float(share_out(found.power, whole, TIE)[0] @ found.frequency)
        all_nodes = Nodes(
            push=0.5 * density * span.diameter * span.speed**2 * span.node_length,
            water=displaced(span, density),
            dry=span.node_mass,
            diameter=span.diameter,
            speed=np.maximum(span.speed, 1e-6),
            omega=2.0 * pi * np.where(driven > 0.0, driven, main or 1.0),
        )
        return Nodes(*(np.ascontiguousarray(values[self._first : -1]) for values in all_nodes))

    def _driven(self) -> NodeExcitation:
        """Return the modes excited by the free nodes, and set the longest step."""
        frequency = float(self.excitation.driven.max())
        self.step_s = 1.0 / (PER_PERIOD * frequency) if frequency > 0.0 else np.inf
        free = slice(self._first, -1)
        zones = self.excitation.zones[free]
        signed = zones * np.sign(self.excitation.modes.shape[free])
        node, mode = np.nonzero(zones)
        first = np.searchsorted(node, np.arange(len(zones) + 1))
        omega = 2.0 * pi * self.excitation.frequency
        return NodeExcitation(first, mode, signed[node, mode], omega, self._angles)

    def _below_top(self) -> Floats:
        """Return the coordinate of the free nodes below the hang-off, negative [m]."""
        return np.asarray(self.span.s[self._first : -1] - self.span.s[-1])

    def _all(self, free: Floats) -> Floats:
        """Return the value of every node, 0 where it is fixed."""
        whole = np.zeros(len(self.span.s))
        whole[self._first : -1] = free
        return whole

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
