"""A reading of [GE]'s eq 7: true frequencies of elements, grouped by cell of the force table.

Ge, Added mass effect on VIV for flexible risers, 2018. Each element in the band excites its nearest
mode r at a true frequency f = f_r·√((m* + 1)/(m* + C_a)) of its own (f_r that at C_a = 1, m* the
mass ratio), with the mean of two successive C_a. Taken literally no two elements agree, and hardly
anything moves. Here the elements of a mode whose f·D/U lies between the same two frequencies of the
table have the mean of theirs, so that they pull together.

The cell is that of the pre-analysis, or with `running` that of the motion at each step, in which
C_a is then read too; an element whose running frequency leaves the band is damped, not excited.
"""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.vortex.decomposed_response import DecomposedResponse, Integrator, bathe
from rope_twin.vortex.force_table import NodeExcitation
from rope_twin.vortex.line_model import Span
from rope_twin.vortex.power_in import ROUNDS, Decomposed


class CellResponse(DecomposedResponse):
    """Response of a rope, driven at the frequencies of its elements' cells.

    Raises:
        InputError: the rope is slack somewhere.
    """

    def __init__(
        self, span: Span, model: Decomposed, integrator: Integrator | None = None,
        running: bool = False,
    ) -> None:  # fmt: skip
        self._running = running
        super().__init__(span, model, integrator or bathe)
        cells = len(self._table.frequency) + 1
        self._turned = np.zeros(len(self.excitation.frequency) * cells)  # phases of modes and cells
        self._mode = self.excitation.zones[self._first : -1].argmax(axis=1)
        self._locked = self.excitation.zones[self._first : -1].max(axis=1)
        self._row = self._table.added_mass_row(model.first_amplitude)
        self._still = self._own_frequencies(None)

    def _advance(self, h: float) -> None:
        if self._running:
            reduced = self.omega / (2.0 * pi) * self._ratio
            frequency, locked = self._own_frequencies(reduced), self._inside(reduced)
        else:
            frequency, locked = self._still, self._locked
            reduced = frequency * self._ratio
        self._drives = self._groups(frequency, reduced, locked)
        self._since_s = self.time_s
        super()._advance(h)
        self._turned = np.remainder(self._turned + self._drives.omega * h, 2.0 * pi)

    @property
    def _ratio(self) -> Floats:
        """Return D/U of the free nodes [s]."""
        return np.asarray(self._nodes.diameter / self._nodes.speed)

    def _inside(self, reduced: Floats) -> Floats:
        low, high = self.model.band
        return np.asarray(self._locked * ((low <= reduced) & (reduced <= high)))

    def _own_frequencies(self, reduced: Floats | None) -> Floats:
        """Return eq 7 of each free node [Hz]; reduced: f·D/U where C_a is read, None: its own."""
        first, nodes = self.excitation.modes.frequency[self._mode], self._nodes
        ratio = nodes.dry / nodes.water
        added, frequency = np.ones(len(first)), first
        for _ in range(ROUNDS if reduced is None else 1):
            position = frequency * self._ratio if reduced is None else reduced
            read = np.interp(position, self._table.frequency, self._row)
            added = 0.5 * (added + read) if reduced is None else read
            frequency = first * np.sqrt((ratio + 1.0) / np.maximum(ratio + added, 0.1 * ratio))
        return np.asarray(frequency)

    def _groups(self, frequency: Floats, reduced: Floats, locked: Floats) -> NodeExcitation:
        """Return the drives of the groups: mode and cell, with the mean frequency of its nodes."""
        cell = np.searchsorted(self._table.frequency, reduced)
        group = self._mode * (len(self._table.frequency) + 1) + cell
        driven = np.flatnonzero(locked > 0.0)
        count = np.bincount(group[driven], minlength=len(self._turned))
        total = np.bincount(group[driven], frequency[driven], len(self._turned))
        omega = 2.0 * pi * total / np.maximum(count, 1)
        shape: Any = self.excitation.modes.shape[self._first : -1]
        part = locked * np.sign(shape[np.arange(len(group)), self._mode])
        first = np.searchsorted(driven, np.arange(len(group) + 1))
        return NodeExcitation(first, group[driven], part[driven], omega, self._turned)
