"""Grid of a rope and its sections as a series of elastic bars."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from math import cos, inf, isinf, pi, sin, sqrt

import numpy as np

from rope_twin.core.state import SAME_PLACE, Floats
from rope_twin.effects.compensator import CompensatorParams
from rope_twin.effects.rope_mass import AddedMassParams
from rope_twin.scene.schema import Damping, Environment, Grading, Payload, Rope, RopeLine, Scene
from rope_twin.scene.shapes import PayloadFigures

FEWEST_ELEMENTS = 3  # minimum per rope
ROOM = 0.9  # of the minimum paid-out length: maximum length of the lowest element


def node_coordinates(
    line: RopeLine, min_line_out_m: float | None, compensated: bool = False
) -> Floats:
    """Return the unstretched distance of each node from the lower end [m].

    A section's end is a node: the adjacent elements are stretched to meet there. Where the winch
    may haul in to less than the lowest of equal elements, that one is divided into elements that
    double in length, the lowest half of the minimum length. A heave compensator, the lowest section
    where there is one, is a single element.
    """
    length, count = line.length_m, line.elements
    grading = line.grading
    if grading is None:
        nodes: Floats = np.linspace(0.0, length, count + 1)
        if min_line_out_m is not None and ROOM * min_line_out_m < nodes[1]:
            nodes = np.concatenate([[0.0], halvings(min_line_out_m, float(nodes[1])), nodes[1:]])
    elif grading.nodes_m is not None:
        low = [0.0, *grading.nodes_m]
        above = np.linspace(low[-1], length, count - len(low) + 2)
        nodes = np.concatenate([low[:-1], above])
    else:
        nodes = _graded(grading.lowest_m or 0.0, grading.growth, length, count)
    nodes = _meeting(nodes, [end for end in ends_m(line) if end < length])
    if compensated and len(line.made_of) > 1:
        nodes = np.concatenate([nodes[:1], nodes[nodes > ends_m(line)[0] - SAME_PLACE]])
    return nodes


def is_compensated(scene: Scene) -> bool:
    """Return whether the lowest section of the scene's rope is a heave compensator."""
    return scene.listed(CompensatorParams) is not None


def elements_with(counts: Sequence[int], first: int) -> list[int]:
    """Return the elements of all ropes in proportion, given the number of the first."""
    further = (max(FEWEST_ELEMENTS, round(count * first / counts[0])) for count in counts[1:])
    return [first, *further]


def halvings(shortest: float, length: float) -> list[float]:
    """Return nodes between elements of shortest/2, shortest, 2·shortest ... up to a length."""
    nodes, size = [0.5 * shortest], 0.5 * shortest
    while nodes[-1] + 3.0 * size <= length:
        size *= 2.0
        nodes.append(nodes[-1] + size)
    return nodes


def min_line_out_m(scene: Scene) -> float | None:
    """Return the minimum paid-out length of the winch [m]; None without a winch."""
    return scene.winch.min_line_out_m if scene.winch else None


def grading_faults(line: RopeLine, grading: Grading) -> Iterator[tuple[str, str]]:
    """Yield the faults of a mesh grading, each with a remedy."""
    length, count = line.length_m, line.elements
    if (grading.lowest_m is None) == (grading.nodes_m is None):
        which = "neither" if grading.lowest_m is None else "both"
        yield f"{which} of lowest_m and nodes_m are given", "give one of them"
    elif grading.lowest_m is not None:
        lowest, growth = grading.lowest_m, grading.growth
        if lowest > length / count:
            problem = f"{lowest:g} m is longer than equal elements of {length / count:g} m"
            yield problem, "give a shorter one"
        elif largest_reach(lowest, growth, count) < length:
            reach = largest_reach(lowest, growth, count)
            problem = (
                f"{count} elements from {lowest:g} m growing by {growth:g} reach only {reach:.4g} m"
            )
            yield problem, "give more elements, a larger growth or a longer lowest one"
    else:
        nodes = [0.0, *(grading.nodes_m or ())]
        if len(nodes) > count:
            yield f"{len(nodes) - 1} nodes for {count} elements", "give more elements"
        elif not all(low < high for low, high in pairwise([*nodes, length])):
            yield "the nodes do not ascend from 0 to length_m", "order them from the lower end up"


def largest_reach(lowest: float, growth: float, count: int) -> float:
    """Return the length of `count` elements that all grow [m]."""
    return float(lowest * (growth ** min(count, 400) - 1.0) / (growth - 1.0))


def _graded(lowest: float, growth: float, length: float, count: int) -> Floats:
    """Return elements lowest, lowest·growth, ... up to the equal ones that fill the length."""
    growing = lowest * growth ** np.minimum(np.arange(count), 400.0)
    low, high = lowest, length
    for _ in range(100):
        middle = 0.5 * (low + high)
        short = np.minimum(growing, middle).sum() < length
        low, high = (middle, high) if short else (low, middle)
    nodes: Floats = np.concatenate([[0.0], np.cumsum(np.minimum(growing, high))])
    nodes *= length / nodes[-1]
    return nodes


def _meeting(nodes: Floats, ends: Sequence[float]) -> Floats:
    """Move nodes so that each of the ends is one; every section keeps at least one element."""
    if not ends:
        return nodes
    count = len(nodes) - 1
    chosen = [0]
    for number, end in enumerate(ends):
        nearest = int(np.abs(nodes - end).argmin())
        chosen.append(min(max(nearest, chosen[-1] + 1), count - len(ends) + number))
    chosen.append(count)
    places = [0.0, *ends, float(nodes[-1])]
    moved = nodes.copy()
    for (first, last), (low, high) in zip(pairwise(chosen), pairwise(places), strict=True):
        part = nodes[first : last + 1]
        moved[first : last + 1] = low + (part - part[0]) * ((high - low) / (part[-1] - part[0]))
        moved[first], moved[last] = low, high
    return moved


SCAN = 0.02  # of the half wave of the unloaded rope: step of the search for the first mode


@dataclass(frozen=True)
class Bar:
    """A section of the hanging rope, linearised about its static tension."""

    rope: Rope
    length_m: float  # paid-out unstretched length
    weight_n_per_m: float  # in water, negative: buoyant
    low_n: float  # static tension at its lower end
    moved_kg_per_m: float = 0.0  # added mass along the rope

    @property
    def high_n(self) -> float:
        """Return the static tension at its upper end [N]."""
        return self.low_n + self.weight_n_per_m * self.length_m

    @property
    def stiffness_n(self) -> float:
        """Return the stiffness for fast motion at the middle of the section [N]."""
        return self.rope.dynamic_n(0.5 * (self.low_n + self.high_n))

    @property
    def inertia_kg_per_m(self) -> float:
        """Return its mass per metre with the added mass along it [kg/m]."""
        return self.rope.mass_kg_per_m + self.moved_kg_per_m

    @property
    def travel_s(self) -> float:
        """Return the travel time of an axial wave [s]."""
        return self.length_m * sqrt(self.inertia_kg_per_m / self.stiffness_n)

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
        k = omega * sqrt(bar.inertia_kg_per_m / bar.stiffness_n)
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


TOLERANCE_SHARE, MIN_TOLERANCE_N, MAX_TOLERANCE_N = 0.003, 1.0, 500.0


def find_payload(scene: Scene, line: RopeLine) -> Payload | None:
    """Return the payload at the line's lower end, or None if that end is fixed."""
    return next((payload for payload in scene.payloads if payload.name == line.to), None)


def section_damping(scene: Scene, line: RopeLine, figures: PayloadFigures | None) -> list[float]:
    """Return c of T = E(strain) + c·strain rate [N·s] of each section, independent of the mesh."""
    bars = hanging_bars(scene, line, figures, line.length_m)
    return damping_newton_seconds(line.damping, bars, end_mass_kg(figures), line.elements)


def hanging_bars(
    scene: Scene, line: RopeLine, figures: PayloadFigures | None, line_out_m: float
) -> list[Bar]:
    """Return the sections of the rope hanging in still water at this paid-out length.

    Sections that are not paid out have length 0 and the tension of the hang-off.
    """
    water, added = scene.environment, scene.listed(AddedMassParams)
    low_n = 0.0
    if figures is not None:
        submerged = figures.mass_kg - water.water_density_kg_per_m3 * figures.volume_m3
        low_n = submerged * water.gravity_m_per_s2
    bars: list[Bar] = []
    for section, length in zip(line.made_of, line.lengths_m(line_out_m), strict=True):
        weight = weight_n_per_m(section.rope, water)
        area = 0.25 * pi * section.rope.hydrodynamic_diameter_m**2
        moved = (added.tangential if added else 0.0) * water.water_density_kg_per_m3 * area
        bars.append(Bar(section.rope, length, weight, low_n, moved))
        low_n = bars[-1].high_n
    return bars
