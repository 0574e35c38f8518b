"""Element tensions in numpy, and the length offsets that give prescribed tensions.

The formulas are those of `core.elastic.stretch`, for the rare moments between steps in which a
state is transferred to other elements.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.axial_law import FibreLaw, held_strain, held_tension, hold, sections_law
from rope_twin.core.elements import SAME_PLACE
from rope_twin.core.energy import law_of_lowest
from rope_twin.core.state import Floats, Ints, Rope, State, Table

HALVINGS = 60


class Elements(NamedTuple):
    """Elements from the lower end up, (elements,) each."""

    rest: Floats  # unstretched length [m]
    section: Ints  # index of the rope's section
    direction: Floats  # (3, elements), upward
    length: Floats  # [m]
    damper: Floats  # damping tension [N]
    lowest_rate: float  # of the lowest element's length [m/s]
    lowest_depth: float  # of its middle below the mean water level [m]


def elements_of(state: State, sections: Floats, payout_m_per_s: float) -> Elements:
    """Return the elements of a state; the top one grows at the pay-out speed [m/s]."""
    n = int(state.counts[rows.ELEMENTS])
    s = state.s[: n + 1]
    rest = np.diff(s)
    section = np.searchsorted(sections[rows.END], s[:-1] + SAME_PLACE, side="right")
    span = np.diff(state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1], axis=1)
    length = np.sqrt((span * span).sum(axis=0) + 1e-16 * rest * rest)
    direction = span / length
    apart = np.diff(state.nodes[rows.VELOCITY : rows.VELOCITY + 3, : n + 1], axis=1)
    rate = (direction * apart).sum(axis=0)
    rate[-1] -= payout_m_per_s / rest[-1] * length[-1]
    damper = sections[rows.C][section] / rest * rate
    depth = -float(state.nodes[rows.POSITION + 2, :2].mean())
    return Elements(rest, section, direction, length, damper, float(rate[0]), depth)


def tensions(rope: Rope, of: Elements, offset: Floats) -> Floats:
    """Tension of elements with these length offsets [N]; 0 where slack, (elements,)."""
    strain = (of.length + offset - of.rest) / of.rest
    law, stiffness = sections_law(rope), rope.sections[rows.EA][of.section]
    if isinstance(law, FibreLaw):
        elastic = held_tension(law, of.section, strain)[0]
    else:
        elastic = np.where(strain < 0.0, stiffness * strain, 0.0)
        elastic += hold(law, stiffness, of.section, strain)[0]
    pull: Floats = np.maximum(elastic + of.damper, 0.0)
    own = law_of_lowest(rope.effects)
    if own is not None:
        extension = float(of.length[0] + offset[0] - of.rest[0])
        k = float(stiffness[0] / of.rest[0])
        pull[0] = own(extension, of.lowest_rate, k, of.lowest_depth)[0]
    return pull


def offsets_for(rope: Rope, of: Elements, wanted_n: Floats) -> Floats:
    """Length offsets that give these tensions [m]; 0 where the tension is NaN, (elements,).

    The lowest element has none where an effect gives its law: it is the same on all meshes.
    """
    stiffness = rope.sections[rows.EA][of.section]
    elastic = wanted_n - of.damper
    strain, law = elastic / stiffness, sections_law(rope)
    if isinstance(law, FibreLaw):
        strain = held_strain(law, of.section, elastic)
    elif rope.law is not None:
        taut = elastic > 0.0
        strain = np.where(taut, _strains(rope.law, of.section, np.maximum(elastic, 0.0)), strain)
    offset = of.rest * (1.0 + strain) - of.length
    found: Floats = np.where(np.isnan(wanted_n), 0.0, offset)
    if law_of_lowest(rope.effects) is not None:
        found[0] = 0.0
    return found


def _strains(law: Table, section: Ints, elastic_n: Floats) -> Floats:
    """Return the strains at which a tension table holds these tensions, by bisection.

    The tabulated tension must increase everywhere.
    """
    high = np.full(len(elastic_n), 1e-3)
    unused = np.zeros(len(elastic_n))
    while np.any(short := hold(law, unused, section, high)[0] < elastic_n):
        high = np.where(short, 2.0 * high, high)
    low = np.zeros(len(elastic_n))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        less = hold(law, unused, section, middle)[0] < elastic_n
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    strain: Floats = 0.5 * (low + high)
    return strain
