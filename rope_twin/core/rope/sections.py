"""Sections of the rope from the lower end up, each with its own properties.

A boundary between sections is always a node, so an element belongs to one section. Stiffness per
element and mass, volume and areas per node follow from the unstretched lengths; effects read those
rows and do not depend on sections.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit, jit_ordered_within, jit_within
from rope_twin.core.state import (
    DAMPING,
    EA,
    END,
    GROWTH,
    MASS,
    PER_METRE,
    REST,
    SECTION,
    SKIN,
    STIFFNESS,
    C,
)

SAME_PLACE = 1e-6  # m: material coordinates closer than this are one


@jit_within
def section_above(sections: Any, s: float) -> int:
    """Return the section of the rope just above material coordinate s."""
    k = 0
    while sections[END, k] <= s + SAME_PLACE:
        k += 1
    return k


@jit_within
def set_element(work: Any, sections: Any, k: int, e: int, rest: float) -> None:
    """Set unstretched length, section k and stiffness of element e; it does not grow."""
    work[REST, e] = rest
    work[GROWTH, e] = 0.0
    work[SECTION, e] = k
    work[STIFFNESS, e] = sections[EA, k] / rest
    work[DAMPING, e] = sections[C, k] / rest


@jit_ordered_within
def set_growth(work: Any, e: int, V: Any) -> None:
    """Set the growth rate of element e, whose unstretched length changes at V [m/s]."""
    work[GROWTH, e] = V / work[REST, e]


@jit
def set_lengths(work: Any, s: Any, sections: Any, n: int, L: float) -> None:
    """Set all elements and lumped nodes for paid-out length L; no element grows."""
    k = 0
    for row in range(MASS, SKIN + 1):
        work[row, 0] = 0.0
    for e in range(n):
        rest = (L if e == n - 1 else s[e + 1]) - s[e]
        while sections[END, k] <= s[e] + SAME_PLACE:
            k += 1
        set_element(work, sections, k, e, rest)
        for row in range(MASS, SKIN + 1):
            half = 0.5 * rest * sections[row - MASS + PER_METRE, k]
            work[row, e] += half
            work[row, e + 1] = half


@jit
def set_top_length(work: Any, s: Any, sections: Any, n: int, L: float, V: float) -> None:
    """Set what depends on the paid-out length L and its rate V: the top element and its nodes."""
    top, below = section_above(sections, s[n - 1]), section_above(sections, s[n - 2])
    set_top_of(work, s, sections, n, (L, V), (top, below))


@jit_within
def set_top_of(work: Any, s: Any, sections: Any, n: int, line: Any, places: Any) -> None:
    """Set the top element and its nodes.

    line: paid-out length and its rate; places: sections of the top element and of the one below.
    """
    (L, V), (top, below) = line, places
    rest = L - s[n - 1]
    set_element(work, sections, top, n - 1, rest)
    for row in range(MASS, SKIN + 1):
        per_metre = row - MASS + PER_METRE
        half = 0.5 * rest * sections[per_metre, top]
        work[row, n - 1] = 0.5 * work[REST, n - 2] * sections[per_metre, below] + half
        work[row, n] = half
    set_growth(work, n - 1, V)
