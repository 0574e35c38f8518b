"""Selection of the vibration and fatigue monitors of a run (rope_twin.twin.vibration.monitored)."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.twin.fatigue.curves import find_curve

MOTION = "motion"  # measured in the twin, with its scene's own VIV model
MODES, DECOMPOSED = "modes", "decomposed"  # loosely coupled models without feedback
MODELS = (MOTION, MODES, DECOMPOSED)


@dataclass(frozen=True)
class MonitorSettings:
    """Vibration and fatigue monitors that a run asks for.

    Raises:
        InputError: there is no such model or curve.
    """

    vibration: str = ""  # one of MODELS, or "" for none
    fatigue: str = ""  # name of an S-N curve, or "" for none

    def __post_init__(self) -> None:
        if self.vibration and self.vibration not in MODELS:
            what = f"no model '{self.vibration}'"
            raise InputError(phrase("vibration", what, did_you_mean(self.vibration, MODELS)))
        if self.fatigue:
            find_curve("fatigue", self.fatigue)

    def __bool__(self) -> bool:
        return bool(self.vibration or self.fatigue)
