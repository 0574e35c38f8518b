"""A rope of several sections as bars under static load: first axial mode and damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import cos, inf, isinf, pi, sin, sqrt

from rope_twin.scene.schema import Damping, Environment, Rope, RopeLine
from rope_twin.scene.shapes.shapes import PayloadFigures

SCAN = 0.02  # of the half wave of the unloaded rope: step of the search for the first mode


@dataclass(frozen=True)
class Bar:
    """A section of the hanging rope, linearised about its static tension."""

    rope: Rope
    length_m: float  # paid-out unstretched length
    weight_n_per_m: float  # in water, negative: buoyant
    low_n: float  # static tension at its lower end

    @property
    def high_n(self) -> float:
        """Return the static tension at its upper end [N]."""
        return self.low_n + self.weight_n_per_m * self.length_m

    @property
    def stiffness_n(self) -> float:
        """Return the tangent EA at the middle of the section [N]."""
        return self.rope.tangent_n(0.5 * (self.low_n + self.high_n))

    @property
    def travel_s(self) -> float:
        """Return the travel time of an axial wave [s]."""
        return self.length_m * sqrt(self.rope.mass_kg_per_m / self.stiffness_n)

    @property
    def stretch_m(self) -> float:
        """Return the static elongation [m] by Simpson's rule, exact for a linear law."""
        low, high = self.low_n, self.high_n
        strains = [self.rope.strain_at(tension) for tension in (low, 0.5 * (low + high), high)]
        return self.length_m * (strains[0] + 4.0 * strains[1] + strains[2]) / 6.0


def weight_n_per_m(rope: Rope, water: Environment) -> float:
    """Return a rope's weight in water per unstretched metre [N/m]."""
    area = 0.25 * pi * rope.hydrodynamic_diameter_m**2
    submerged = rope.mass_kg_per_m - water.water_density_kg_per_m3 * area
    return submerged * water.gravity_m_per_s2


def bars_of(line: RopeLine, line_out_m: float, load_n: float, water: Environment) -> list[Bar]:
    """Return the sections of a rope that hangs straight down with a weight below it.

    Sections that are not paid out have length 0 and the tension of the hang-off.
    """
    bars: list[Bar] = []
    for section, length in zip(line.made_of, line.lengths_m(line_out_m), strict=True):
        weight = weight_n_per_m(section.rope, water)
        bars.append(Bar(section.rope, length, weight, bars[-1].high_n if bars else load_n))
    return bars


def end_mass_kg(payload: PayloadFigures | None) -> float:
    """Return the mass at the lower end [kg]: payload with added mass; infinite if fixed."""
    return payload.mass_kg + float(payload.added_mass_kg[2]) if payload else inf


def first_axial_frequency(bars: Sequence[Bar], mass_kg: float) -> float:
    """Return ω [rad/s] of the first axial mode with a mass (infinite: fixed) at the lower end.

    The displacement is propagated upward through the sections in closed form; ω is its zero at the
    hang-off. For one section that is x·tan x = m·L/M with x = ω·L/c.
    """
    step = SCAN * pi / sum(bar.travel_s for bar in bars)
    high = step
    while _displacement(bars, mass_kg, high)[0] > 0.0:
        high += step
    low = high - step
    for _ in range(100):
        middle = 0.5 * (low + high)
        taut = _displacement(bars, mass_kg, middle)[0] > 0.0
        low, high = (middle, high) if taut else (low, middle)
    return 0.5 * (low + high)


def tension_at_length(bars: Sequence[Bar], length_m: float) -> float:
    """Return the tension [N] that stretches weightless sections to a total length; 0 if slack."""
    low, high = 0.0, 1e12
    for _ in range(200):
        middle = 0.5 * (low + high)
        reached = sum(bar.length_m * (1.0 + bar.rope.strain_at(middle)) for bar in bars)
        low, high = (middle, high) if reached < length_m else (low, middle)
    return 0.5 * (low + high)


def damping_newton_seconds(
    damping: Damping, bars: Sequence[Bar], mass_kg: float, elements: int
) -> list[float]:
    """Return c of T = E(strain) + c·strain rate [N·s] of each section.

    From a damping ratio ζ of the first axial mode: c = EA·2·ζ/ω, so that each section, and with it
    the mode, is damped by ζ. From a damping ratio of one element: c = ζ·l·√(EA·m) (Hall and Goupee
    2015, Ocean Eng. 104, 590), which depends on the element's length l.
    """
    if damping.newton_seconds is not None:
        return [damping.newton_seconds for _ in bars]
    if damping.fraction_of_one_element is not None:
        length = sum(bar.length_m for bar in bars) / elements
        share = damping.fraction_of_one_element * length
        return [share * sqrt(bar.stiffness_n * bar.rope.mass_kg_per_m) for bar in bars]
    fraction = damping.fraction_of_first_axial_mode or 0.0
    time = 2.0 * fraction / first_axial_frequency(bars, mass_kg)
    return [bar.stiffness_n * time for bar in bars]


def damping_fraction(bars: Sequence[Bar], damping: Sequence[float], mass_kg: float) -> float:
    """Return the damping ratio of the first axial mode for sections with these c [N·s].

    ½·ω·∫c·u'² ds / ∫EA·u'² ds with the mode's displacement u.
    """
    omega = first_axial_frequency(bars, mass_kg)
    lost = [c / bar.stiffness_n for c, bar in zip(damping, bars, strict=True)]
    stored = _displacement(bars, mass_kg, omega)[1]
    return 0.5 * omega * sum(a * b for a, b in zip(lost, stored, strict=True)) / sum(stored)


def _displacement(bars: Sequence[Bar], mass: float, omega: float) -> tuple[float, list[float]]:
    """Return the displacement at the hang-off for 1 at the lower end, and ∫EA·u'² ds per section.

    With a fixed lower end: for a unit force there.
    """
    u, force = (0.0, 1.0) if isinf(mass) else (1.0, -mass * omega**2)
    stored = []
    for bar in bars:
        k = omega * sqrt(bar.rope.mass_kg_per_m / bar.stiffness_n)
        impedance, angle = bar.stiffness_n * k, k * bar.length_m
        c, s = cos(angle), sin(angle)
        # N = force·cos(k·x) - impedance·u·sin(k·x), squared and summed over the section
        a, b = force, -impedance * u
        integral = 0.5 * (a * a + b * b) * angle + 0.5 * (a * a - b * b) * s * c + a * b * s * s
        stored.append(integral / (k * bar.stiffness_n))
        u, force = u * c + force / impedance * s, force * c - impedance * u * s
    return u, stored


def ends_m(line: RopeLine) -> list[float]:
    """Return the upper ends of the sections, from the lower end up [m]; the last: infinite."""
    known = list(accumulate(section.length_m or 0.0 for section in line.made_of))
    return [*known[:-1], inf]
