"""Charts of VIV response and fatigue damage along the rope, if they are published."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.view.depth_chart import Curve, DepthChart

VIBRATION, FATIGUE = "vibration", "fatigue"
CROSS_FLOW_RGB, IN_LINE_RGB = (253, 231, 37), (53, 183, 160)
DRAG_RGB, USED_RGB = (111, 168, 255), (242, 106, 90)


class WatchedCharts:
    """Draws both charts; `shown` are those that have data."""

    def __init__(self, stream: Any) -> None:
        self.shown: tuple[str, ...] = ()
        self._amplitude = DepthChart(stream, f"{VIBRATION}/amplitude", "A/D [-]", 0)
        self._frequency = DepthChart(stream, f"{VIBRATION}/frequency", "frequency [Hz]", 1)
        self._drag = DepthChart(stream, f"{VIBRATION}/drag", "drag [-]", 2)
        self._used = DepthChart(stream, FATIGUE, "damage [-]", 0)

    def show_vibration(self, columns: dict[str, NDArray[np.float64]]) -> bool:
        """Draw the columns of `ropes/vibration`; return whether they are the first."""
        place = np.stack([columns[axis] for axis in "xyz"])
        steps = np.sqrt((np.diff(place, axis=1) ** 2).sum(axis=0))
        depth = np.concatenate([[0.0], np.cumsum(steps)])
        amplitude = [Curve("cross-flow", columns["cross_flow"], CROSS_FLOW_RGB)]
        frequency = [Curve("cross-flow", _moving(columns["cross_flow_hz"]), CROSS_FLOW_RGB)]
        if "in_line" in columns:
            amplitude.append(Curve("in-line", columns["in_line"], IN_LINE_RGB))
            frequency.append(Curve("in-line", _moving(columns["in_line_hz"]), IN_LINE_RGB))
        self._amplitude.show(depth, amplitude)
        self._frequency.show(depth, frequency)
        self._drag.show(depth, [Curve("amplification", columns["drag_amplification"], DRAG_RGB)])
        return self._is_first(VIBRATION)

    def show_fatigue(
        self, from_hang_off_m: NDArray[np.float64], damage: NDArray[np.float64]
    ) -> bool:
        """Draw the damage of each metre of rope; return whether it is the first."""
        self._used.show(from_hang_off_m, [Curve("per metre of rope", damage, USED_RGB)])
        return self._is_first(FATIGUE)

    def _is_first(self, name: str) -> bool:
        first = name not in self.shown
        if first:
            self.shown = (*self.shown, name)
        return first


def _moving(hz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the frequencies, NaN where there is no vibration."""
    return np.where(hz > 0.0, hz, np.nan)
