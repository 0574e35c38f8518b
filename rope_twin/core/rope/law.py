"""Elastic tension of an element: proportional to its strain, or from a table of its section.

The type of `rope.law` selects the code while numba compiles, so a rope without a table contains no
code for one. A table is a monotone cubic between its points (Fritsch and Butland 1984, SIAM J. Sci.
Stat. Comput. 5, 300): tangents are continuous, so the only kink for Newton's method is that at zero
tension.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED, jit_within
from rope_twin.core.state import Floats, Table


def pull_of(law: Any, section: Any, stiffness: Any, e: int, extension: float, rest: float) -> Any:
    """Return the elastic tension [N] of element e at this extension [m], and its tangent [N/m].

    section, stiffness: rows; a table stores its tangent in `stiffness`.
    """
    chosen = _by_stiffness if law is None else _by_table
    return chosen(law, section, stiffness, e, extension, rest)


@jit_within
def tension_at(law: Any, section: int, strain: float) -> Any:
    """Return T and dT/dstrain [N] of a section; linear below the first and beyond the last knot."""
    j = 0
    while j + 1 < law.knot.shape[1] and strain >= law.knot[section, j + 1]:
        j += 1
    u = strain - law.knot[section, j]
    v = max(u, 0.0)
    slope, curve, bend = law.slope[section, j], law.curve[section, j], law.bend[section, j]
    return (
        law.tension[section, j] + slope * u + v * v * (curve + bend * v),
        slope + v * (2.0 * curve + 3.0 * bend * v),
    )


def hold(law: Table | None, stiffness: Floats, section: Any, strain: Floats) -> Any:
    """Return elastic tension [N] and stored energy per unstretched metre [J/m]; 0 when slack.

    In numpy, for the energy balance outside the step. stiffness: EA [N] of each element, where
    there is no table.
    """
    strain = np.maximum(strain, 0.0)
    if law is None:
        return stiffness * strain, 0.5 * stiffness * strain**2
    tension, stored = np.zeros_like(strain), np.zeros_like(strain)
    for j in range(law.knot.shape[1]):
        low, t, slope, curve, bend = (row[section, j] for row in law)
        end = law.knot[section, j + 1] if j + 1 < law.knot.shape[1] else np.inf
        here = strain >= low
        u = np.where(here, np.minimum(strain, end) - np.where(here, low, 0.0), 0.0)
        inside = t + u * (slope + u * (curve + u * bend))
        tension = np.where(here, inside, tension)
        stored += u * (t + u * (slope / 2.0 + u * (curve / 3.0 + u * bend / 4.0)))
    return tension, stored


@jit_within
def _by_stiffness(
    law: Any, section: Any, stiffness: Any, e: int, extension: float, rest: float
) -> Any:
    return stiffness[e] * extension, stiffness[e]


@jit_within
def _by_table(law: Any, section: Any, stiffness: Any, e: int, extension: float, rest: float) -> Any:
    tension, tangent = tension_at(law, int(section[e]), extension / rest)
    k = tangent / rest
    stiffness[e] = k
    return tension, k


@overload(pull_of, jit_options={**LINKED, "forceinline": True}, strict=False)
def _choose(law: Any, section: Any, stiffness: Any, e: Any, extension: Any, rest: Any) -> Any:
    chosen = _by_stiffness if isinstance(law, types.NoneType) else _by_table

    def choice(law: Any, section: Any, stiffness: Any, e: Any, extension: Any, rest: Any) -> Any:
        return chosen(law, section, stiffness, e, extension, rest)

    return choice
