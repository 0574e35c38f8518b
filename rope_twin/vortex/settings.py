"""Selection of the VIV models and of the vibration and fatigue monitors of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.vortex.fatigue import OWN, find_curve

TIME_DOMAIN = "time-domain"  # the scene's own VIV model
FREQUENCY_DOMAIN = "frequency-domain"  # natural modes of the line, without feedback on it
MODELS = (TIME_DOMAIN, FREQUENCY_DOMAIN)


@dataclass(frozen=True)
class MonitorSettings:
    """Vibration and fatigue monitors that a run asks for.

    Raises:
        InputError: there is no such model or curve.
    """

    vibration: str = ""  # one of MODELS, or "" for none
    fatigue: str = ""  # name of an S-N curve, OWN for those of the ropes, or "" for none

    def __post_init__(self) -> None:
        if self.vibration and self.vibration not in MODELS:
            what = f"no model '{self.vibration}'"
            raise InputError(phrase("vibration", what, did_you_mean(self.vibration, MODELS)))
        if self.fatigue and self.fatigue != OWN:
            find_curve("fatigue", self.fatigue)

    def __bool__(self) -> bool:
        return bool(self.vibration or self.fatigue)


class CoupledSettings(NamedTuple):
    """VIV model that a scene lists, and its water."""

    name: str  # of the effect; "": none
    params: Any  # of the effect if it is loosely coupled, else None
    strouhal: float
    density: float  # of the water [kg/m³]
    step_s: float  # of the run
