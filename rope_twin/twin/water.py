"""A current profile that comes while the twin runs: checked, then swapped in at a step's border."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.effects.current import Current, CurrentInTime, from_rows
from rope_twin.errors import phrase
from rope_twin.twin.health import InputCounter

LIMIT_M_PER_S = 10.0


class CurrentInput:
    """Takes profiles as rows of z, east, north from the surface down, shape (rows, 3)."""

    def __init__(self, effects: tuple[Any, ...]) -> None:
        self.counter = InputCounter("current")
        self.effects = effects

    def offer(self, profile: NDArray[np.float64], now_ns: int) -> str:
        """Take a profile; returns "" or the sentence of its refusal."""
        fault = self._fault(profile)
        if fault:
            return fault
        new = from_rows(np.array(profile, dtype=float))
        self.effects = tuple(_with_profile(effect, new) for effect in self.effects)
        self.counter.accept(now_ns)
        return ""

    def _fault(self, profile: NDArray[np.float64]) -> str:
        """Why a profile is refused, counted; or ""."""
        impossible = ""
        if not any(isinstance(effect, Current | CurrentInTime) for effect in self.effects):
            impossible = phrase(
                "current", "the scene lists no current", "add the effect 'current' to the scene"
            )
        elif profile.ndim != 2 or profile.shape[1] != 3 or len(profile) == 0:
            impossible = phrase(
                "current", f"its shape is {profile.shape}", "give rows of z, east, north"
            )
        elif not np.isfinite(profile).all():
            return self.counter.refuse(
                "non_finite",
                phrase("current", "a value is not finite", "every value must be a finite number"),
            )
        elif np.any(np.diff(profile[:, 0]) >= 0.0) or profile[0, 0] > 0.0:
            impossible = phrase(
                "current", "its heights are out of order", "order rows from z = 0 or below down"
            )
        elif np.abs(profile[:, 1:]).max() > LIMIT_M_PER_S:
            impossible = phrase(
                "current",
                f"{np.abs(profile[:, 1:]).max():g} m/s is no sea current",
                f"give at most {LIMIT_M_PER_S:g} m/s",
            )
        return self.counter.refuse("impossible", impossible) if impossible else ""


def _with_profile(effect: Any, new: Current) -> Any:
    """The effect with another profile, if it is a current."""
    if isinstance(effect, CurrentInTime):
        return effect._replace(current=new)
    return new if isinstance(effect, Current) else effect
