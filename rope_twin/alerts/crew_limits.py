"""Limits that a crew sets during a run: alerts heed them beside those of the scene.

A crew can only be stricter than the scene, so that no alert of the scene's limits is lost. The
limits in force are a row of the diagnostics; the commands are in every bag (`alerts/command`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.messages.reports import crew_limits_row
from rope_twin.messages.status import Status

CREW_LIMITS = {"tension_n": "N", "payload_depth_m": "m", "payload_speed_m_per_s": "m/s"}
SCENE = "scene"  # in place of a number: the scene's limit alone applies again


class CrewLimits:
    """Limits set by a crew, by the names of those of a scene."""

    def __init__(self, of_scene: Mapping[str, float | None]) -> None:
        """Set no limit; of_scene: the scene's own, None where it has none."""
        self._of_scene = of_scene
        self._set: dict[str, float] = {}

    def set(self, name: str, words: str) -> str:
        """Set or end a limit and return the answer in words.

        words: a number in SI units, or SCENE.

        Raises:
            InputError: no such limit, no positive number, or not stricter than the scene's.
        """
        where = f"limit {name}"
        if name not in CREW_LIMITS:
            raise InputError(phrase(where, "no such limit", did_you_mean(name, CREW_LIMITS)))
        unit = CREW_LIMITS[name]
        if words == SCENE:
            self._set.pop(name, None)
            return f"{where}: that of the scene"
        try:
            value = float(words)
        except ValueError:
            value = math.nan
        if not (value > 0.0 and math.isfinite(value)):
            right = f"give a positive number in {unit}, or {SCENE}"
            raise InputError(phrase(where, f"'{words}'", right))
        scene = self._of_scene.get(name)
        if scene is not None and value >= scene:
            what = f"{value:g} {unit} is not stricter than the scene's {scene:g} {unit}"
            raise InputError(phrase(where, what, f"give less, or {SCENE}"))
        self._set[name] = value
        return f"{where}: {value:g} {unit}"

    def get(self, name: str) -> float | None:
        """Return the crew's limit of a name; None: none is set."""
        return self._set.get(name)

    def stricter(self, name: str, of_scene: float | None) -> float | None:
        """Return the stricter of a limit of the scene and the crew's; None: there is neither."""
        return min(
            (one for one in (of_scene, self._set.get(name)) if one is not None), default=None
        )

    def row(self) -> Status:
        """Return the row of the diagnostics; values: the limits in SI units, by name."""
        named = [f"{name} {value:g} {CREW_LIMITS[name]}" for name, value in self._set.items()]
        return crew_limits_row(self._set, ", ".join(named) or "none beside those of the scene")
