"""Figures that a run takes over from what was learned, by a ramp.

A rope whose weight or stiffness jumps rings at its own period, so factors on the scene's figures
are led over linearly in time, in stairs of UPDATE_NS from the instant at which they were accepted:
a replay or a resumed run repeats them to the bit, however its steps are divided. The current has a
topic of its own and is not taken over.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rope_twin.core.state import Rope, Table
from rope_twin.errors import phrase
from rope_twin.twin.ensemble.figures import (
    FIGURES,
    copied_law,
    figures_of,
    scaled_fields,
    scaled_law,
    scaled_sections,
)
from rope_twin.twin.health import InputCounter

MOST_FACTOR = 5.0  # and its inverse: beyond it is another lift
MOST_RAMP_S = 3600.0
UPDATE_NS = 100_000_000
RAMP_S = 20.0  # about two periods of a rope that rings at 10 s


class LearnedFigures:
    """Factors on the scene's figures: before the ramp, after it, and its times."""

    def __init__(self) -> None:
        """Begin with the scene's own figures."""
        self.counter = InputCounter("figures")
        self.active = False
        self._before, self._target = np.ones(len(FIGURES)), np.ones(len(FIGURES))
        self.begin_ns = 0
        self.ramp_ns = 0

    def offer(
        self, rope: Rope, factors: Mapping[str, float], ramp_s: float, now_ns: int, cut: bool
    ) -> str:
        """Lead the figures over to factors from now on; return "" or the rejection.

        Figures that are not named keep what they have.
        """
        fault = _fault(rope, factors, ramp_s, cut)
        if fault:
            kind = "impossible"
            if not np.isfinite((*factors.values(), ramp_s)).all():
                kind = "non_finite"
            return self.counter.refuse(kind, phrase("figures", *fault))
        self._before = np.array(list(self.at(now_ns).values()))
        self._target = self._before.copy()
        for name, value in factors.items():
            self._target[FIGURES.index(name)] = value
        self.active = True
        self.begin_ns, self.ramp_ns = now_ns, round(ramp_s * 1e9)
        self.counter.accept(now_ns)
        changed = ", ".join(f"{name} {value:.4g}" for name, value in factors.items())
        self.counter.say(
            f"learned figures are taken over from {now_ns * 1e-9:.2f} s in {ramp_s:g} s, as "
            f"factors on the scene's: {changed}"
        )
        return ""

    def at(self, now_ns: int) -> dict[str, float]:
        """Return the factors at a time, by the names of FIGURES; 1: the scene's value."""
        stair_ns = max(now_ns - self.begin_ns, 0) // UPDATE_NS * UPDATE_NS
        share = stair_ns / self.ramp_ns if stair_ns < self.ramp_ns else 1.0
        now = self._before + share * (self._target - self._before)
        return dict(zip(FIGURES, now.tolist(), strict=True))

    def steps_before(self, now_ns: int, step_ns: int, steps: int) -> int:
        """Return the number of steps before the next update, at most `steps`."""
        since_ns = now_ns - self.begin_ns
        if not self.active or since_ns > self.ramp_ns + UPDATE_NS:
            return steps
        left_ns = UPDATE_NS - since_ns % UPDATE_NS
        return min(steps, -(-left_ns // step_ns))


def _fault(
    rope: Rope, factors: Mapping[str, float], ramp_s: float, cut: bool
) -> tuple[str, str] | None:
    """Return fault and remedy of factors that cannot be taken over, or None."""
    known = [name for name in figures_of(rope) if name != "current"]
    if cut:
        return "the rope was cut", "figures belong to the whole rope"
    if not factors:
        return "no figure is given", f"give one of {', '.join(known)}"
    if not 0.0 <= ramp_s <= MOST_RAMP_S:
        return f"a ramp of {ramp_s:g} s", f"give 0 to {MOST_RAMP_S:g} s"
    for name, value in factors.items():
        if name not in known:
            return f"the scene has no figure '{name}'", f"known: {', '.join(known)}"
        if not 1.0 / MOST_FACTOR <= value <= MOST_FACTOR:
            right = f"give {1.0 / MOST_FACTOR:g} to {MOST_FACTOR:g} times the scene's value"
            return f"{name} of {value:g} times the scene's", right
    return None


class FigureBase:
    """The scene's own figures of the first rope, and the factors that are in use."""

    def __init__(self, rope: Rope) -> None:
        """Keep what factors apply to."""
        self._sections = rope.sections.copy()
        self._law = copied_law(rope.law)
        self._effects = rope.effects
        self._used: dict[str, float] = {}
        self._seen: tuple[Any, ...] = ()  # effects that have these factors
        self._scaled, self._scaled_law = self._sections, self._law  # sections and law with them

    def apply(
        self, factors: Mapping[str, float], rope: Rope, effects: tuple[Any, ...]
    ) -> tuple[Any, ...]:
        """Set factors in the rope's sections and axial law, in place; return the effects with them.

        rope: the present one; effects: those in use, whose memory and current are kept.
        """
        used = dict(factors)
        same = np.array_equal(rope.sections, self._scaled)  # not after a return to an earlier state
        if isinstance(rope.law, Table):
            same = same and np.array_equal(rope.law.tension, self._scaled_law.tension)
        if used == self._used and effects is self._seen and same:
            return effects
        rope.sections[:] = self._scaled = scaled_sections(self._sections, factors)
        self._scaled_law = scaled_law(self._law, factors["axial_stiffness"])
        if isinstance(rope.law, Table):
            for mine, scaled in zip(rope.law, self._scaled_law, strict=True):
                mine[:] = scaled
        made = scaled_fields(self._effects, effects, factors)
        self._used, self._seen = used, made
        return made
