"""Scratch arrays of a thread that steps members of an ensemble or of a fleet."""

from __future__ import annotations

from typing import Any

import numpy as np

from rope_twin.core.joined.joints import System
from rope_twin.core.lanes.batch import Lanes
from rope_twin.core.lanes.joined_group import new_group
from rope_twin.core.state import Floats, Rope

MAX_KINDS = 8  # kinds of members for which a thread stores arrays


class Scratch:
    """Scratch arrays of a thread; their content is valid within one call of the step."""

    def __init__(self) -> None:
        self._work: dict[tuple[int, ...], Floats] = {}
        self._groups: dict[Any, Lanes] = {}

    def work(self, shape: tuple[int, ...]) -> Floats:
        """Return the scratch array of this shape for the step."""
        if shape not in self._work:
            self._work[shape] = np.zeros(shape)
        return self._work[shape]

    def group(self, kind: Any, member: Rope | System, steps: int, intervals: int = 0) -> Lanes:
        """Return arrays for members of this kind, as this one; None: they are not batched.

        steps: at most; intervals: rows of samples, 0: none but those of slack.
        """
        layout = kind.layout if kind else None
        group = self._groups.get(layout)
        if group is None or group.steps < steps or group.samples.shape[-3] < intervals:
            if len(self._groups) >= MAX_KINDS:
                self._groups.clear()
            group = self._groups[layout] = new_group(kind, member, steps, intervals)
        group.fit(kind)
        return group
