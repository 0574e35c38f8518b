"""Published VIV cases as line models; [LCD] is Le Cunff and Durand (1999)."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.vortex.line_model import Span

DENSITY, GRAVITY = 1025.0, 9.80665


@dataclass(frozen=True)
class PublishedRope:
    """A straight upright rope, held at both ends."""

    length: float  # [m]
    diameter: float  # [m]
    mass: float  # [kg/m]
    top_tension: float  # [N]
    stiffness: float = 0.0  # EI [N·m²]
    added_mass: float = 1.0  # coefficient
    hangs: bool = True  # tension falls with depth by the weight in water

    @property
    def moved(self) -> float:
        """Return the mass with added mass [kg/m]."""
        return self.mass + self.added_mass * DENSITY * 0.25 * pi * self.diameter**2

    def span(self, speed: Floats) -> Span:
        """Return the line model for a current [m/s] at equidistant nodes, from the lower end up."""
        n = len(speed) - 1
        s = np.linspace(0.0, self.length, n + 1)
        weight = (self.mass - DENSITY * 0.25 * pi * self.diameter**2) * GRAVITY
        above = self.length - 0.5 * (s[1:] + s[:-1])
        tension = self.top_tension - (weight * above if self.hangs else 0.0 * above)
        return Span(
            s, tension, np.full(n, self.moved), np.full(n + 1, self.diameter), speed, self.stiffness
        )


LCD_RISER = PublishedRope(
    length=300.0, diameter=0.25, mass=157.8, top_tension=1.469e6,
    stiffness=2.05e11 * pi / 64.0 * (0.25**4 - 0.235**4),
)  # fmt: skip
LCD_CABLE = PublishedRope(length=300.0, diameter=0.02, mass=1.728, top_tension=100e3)


def lcd_current(nodes: int) -> Floats:
    """Return [LCD] current: 0.2 m/s at the bottom up to 1.5 m/s at 250 m, then constant."""
    s = np.linspace(0.0, 300.0, nodes)
    return np.minimum(0.2 + 1.3 * s / 250.0, 1.5)
