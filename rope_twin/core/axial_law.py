"""Axial laws of an element: the elastic tension as a function of its extension.

Three laws, selected by type at compile time:

- stiffness: T = EA·strain (a rope without a table);
- table: a monotone cubic through points of strain and tension (Fritsch and Butland 1984, SIAM J.
  Sci. Stat. Comput. 5, 300), with a continuous tangent, so that the only kink for Newton's method
  is that at zero tension;
- fibre: a static curve S and a dynamic stiffness E_d,

      T = S(ε_m) + E_d·(ε - ε_m),        dε_m/dt = (T - S(ε_m))/(E_d·τ),

  a standard linear solid (Zener 1948) with the table as equilibrium spring. Slow changes of length
  follow S; motion much faster than τ follows E_d, as in tests of polyester, nylon and HMPE ropes
  (DNVGL-RP-E305, 2015). ε_m is the relaxed strain. In a slack rope T is 0, and ε_m recovers towards
  the strain without tension. Below the maximum mean tension in the rope's history S may be a
  working curve (core/fibre).

The lowest element may have the law of an effect instead (hook `axial`, a heave compensator).

The strain ε_m of a stage is HELD·HAT + (1 - HELD)·ε, with HELD = 1/(1 + q/τ) and HAT the explicit
part of the integrator. Zeroed internal variables mean HELD = 0, the static curve, as required by
the static solution.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload

from rope_twin.core.jit.decorators import INLINED, jit_exact_within, jit_within
from rope_twin.core.jit.functions import by_width, fused
from rope_twin.core.jit.rows import field_type
from rope_twin.core.jit.wide import WideType, bits, choose, whole
from rope_twin.core.loads.hooks import axial_index, kernel_of
from rope_twin.core.state import POSITION, Floats, Table

# Internal variables of a fibre rope, of the element above each node (core/loads/memory):
# ε_m, S(ε_m) [N], ε - ε_m of the material, the running mean of its square, and the maximum ε_m and
# S(ε_m) in the history.
CARRIED = 6
MEAN, TENSION_MEAN, OVER, SQUARE, TOP, TENSION_TOP = range(CARRIED)
# Further rows: ε_m at the start and at the middle of a step; HAT and HELD of the stage, E_d [N];
# and of the working curve its upper end [strain], lower end [strain], slope there [N], curvature.
START, MIDDLE, HAT, HELD, STIFF, UPPER, LOWER, INITIAL, BEND = range(
    3 * CARRIED + 1, 3 * CARRIED + 10
)
OWN_ROWS = BEND - 3 * CARRIED


class Fibre(NamedTuple):
    """Internal variables of a rope with a dynamic stiffness; its table is `rope.law`."""

    memory: Floats  # see CARRIED and the rows after it, (rows, nodes)


class FibreLaw(NamedTuple):
    """Law of a fibre rope: the static curves of its sections, and its internal variables."""

    table: Table
    memory: Floats


class FibrePart(NamedTuple):
    """Law of a fibre rope's elements from one on; rows as their names in this module."""

    table: Table
    hat: Any
    held: Any
    stiff: Any
    upper: Any
    lower: Any
    initial: Any
    bend: Any


class LowestElementLaw(NamedTuple):
    """Law of a rope whose lowest element has one of its own."""

    law: Any  # of the other elements
    effect: Any  # effect with the kernel `axial`


class BoundLaw(NamedTuple):
    """Law of the elements from `low` on, the lowest of which may have one of its own."""

    law: Any  # of the other elements
    effect: Any  # effect with the kernel `axial`
    low: int
    depth: float  # of the middle of the lowest element below the mean water level [m]


def _kinds(rope: Any) -> list[Any]:
    """Return the types of the effects of a numba type of rope."""
    return [effect.instance_class for effect in field_type(rope, "effects")]


def _place_of_fibre(kinds: Iterable[type]) -> int | None:
    return next((i for i, kind in enumerate(kinds) if kind is Fibre), None)


def sections_law(rope: Any) -> Any:
    """Return the law of a rope's sections: None, its table, or with the effect Fibre a FibreLaw."""
    i = _place_of_fibre(map(type, rope.effects))
    return rope.law if i is None else FibreLaw(rope.law, rope.effects[i].memory)


@overload(sections_law, jit_options=INLINED, strict=False)
def _choose_sections_law(rope: Any) -> Any:
    i = _place_of_fibre(_kinds(rope))
    if i is None:
        return lambda rope: rope.law
    return lambda rope: FibreLaw(rope.law, rope.effects[i].memory)


def law_of(rope: Any) -> Any:
    """Return the law of a rope's elements: that of its sections, or of an effect for the lowest."""
    i = axial_index(map(type, rope.effects))
    return (
        sections_law(rope) if i is None else LowestElementLaw(sections_law(rope), rope.effects[i])
    )


@overload(law_of, jit_options=INLINED, strict=False)
def _choose_law(rope: Any) -> Any:
    i = axial_index(_kinds(rope))
    if i is None:
        return lambda rope: sections_law(rope)
    return lambda rope: LowestElementLaw(sections_law(rope), rope.effects[i])


def law_from(law: Any, work: Any, low: Any) -> Any:
    """Return a law for a loop over the elements from `low` on."""
    if isinstance(law, LowestElementLaw):
        return _bound(law, work, low)
    return _part(law, low) if isinstance(law, FibreLaw) else law


@overload(law_from, jit_options=INLINED, strict=False)
def _choose_part(law: Any, work: Any, low: Any) -> Any:
    kind = getattr(law, "instance_class", None)
    if kind is LowestElementLaw:
        return lambda law, work, low: _bound(law, work, low)
    if kind is FibreLaw:
        return lambda law, work, low: _part(law, low)
    return lambda law, work, low: law


@jit_within
def _bound(law: Any, work: Any, low: Any) -> Any:
    depth = -0.5 * (work[POSITION + 2, 0] + work[POSITION + 2, 1])
    return BoundLaw(law_from(law.law, work, low), law.effect, low, depth)


@jit_within
def _part(law: Any, low: Any) -> Any:
    m = law.memory
    return FibrePart(
        law.table, m[HAT, low:], m[HELD, low:], m[STIFF, low:], m[UPPER, low:], m[LOWER, low:],
        m[INITIAL, low:], m[BEND, low:],
    )  # fmt: skip


def pull_of(law: Any, rows: Any, e: Any, extension: Any, rest: Any, rate: Any, weights: Any) -> Any:
    """Return the elastic tension [N] of element e at this extension [m], and its tangent [N/m].

    rows: section and stiffness; a table stores its tangent in the latter. rate: of the length
    [m/s], which only the law of an effect depends on; weights: p and q of the stage.
    """
    if isinstance(law, BoundLaw):
        if e + law.low == 0 and law.effect.here != 0.0:
            kernel = kernel_of("axial", type(law.effect))
            return kernel(law.effect, extension, rate, weights, rows[1][e], law.depth)
        law = law.law
    if law is None:
        return _by_stiffness(law, rows[0], rows[1], e, extension, rest)
    force_of = _by_fibre if isinstance(law, FibrePart) else _by_table
    return force_of(law, rows[0], rows[1], e, extension, rest)


@overload(pull_of, jit_options=INLINED, strict=False)
def _choose_pull(
    law: Any, rows: Any, e: Any, extension: Any, rest: Any, rate: Any, weights: Any
) -> Any:
    bound = getattr(law, "instance_class", None) is BoundLaw
    base = field_type(law, "law") if bound else law
    force_of = _by_stiffness if isinstance(base, types.NoneType) else _by_table
    if getattr(base, "instance_class", None) is FibrePart:
        force_of = _by_fibre
    if not bound:
        return lambda law, rows, e, extension, rest, rate, weights: force_of(
            law, rows[0], rows[1], e, extension, rest
        )
    effect = field_type(law, "effect")
    kernel = kernel_of("axial", effect.instance_class)
    if isinstance(field_type(effect, "here"), WideType):  # in lanes the effect is always present
        return lambda law, rows, e, extension, rest, rate, weights: (
            kernel(law.effect, extension, rate, weights, rows[1][e], law.depth)
            if e + law.low == 0
            else force_of(law.law, rows[0], rows[1], e, extension, rest)
        )

    def lowest(
        law: Any, rows: Any, e: Any, extension: Any, rest: Any, rate: Any, weights: Any
    ) -> Any:
        if e + law.low == 0 and law.effect.here != 0.0:
            return kernel(law.effect, extension, rate, weights, rows[1][e], law.depth)
        return force_of(law.law, rows[0], rows[1], e, extension, rest)

    return lowest


@jit_within
def _by_stiffness(
    law: Any, section: Any, stiffness: Any, e: int, extension: float, rest: float
) -> Any:
    return stiffness[e] * extension, stiffness[e]


@jit_within
def _by_table(law: Any, section: Any, stiffness: Any, e: int, extension: float, rest: float) -> Any:
    tension, tangent = tension_at(law, whole(section[e]), extension / rest)
    k = tangent / rest
    stiffness[e] = k
    return tension, k


@jit_exact_within
def relaxed_strain(held: Any, hat: Any, strain: Any) -> Any:
    """Return ε_m of a stage."""
    return fused(1.0 - held, strain, held * hat)


@jit_exact_within
def _strain_of(extension: Any, rest: Any, law: Any, e: int) -> Any:
    strain = extension / rest
    return strain, relaxed_strain(law.held[e], law.hat[e], strain)


@jit_exact_within
def _relaxing(static: Any, law: Any, e: int, over: Any, rest: Any) -> Any:
    tension, tangent = static
    held, stiff = law.held[e], law.stiff[e]
    k = fused(stiff, held, tangent * (1.0 - held)) / rest
    return fused(stiff, over, tension), k


@jit_within
def _by_fibre(law: Any, section: Any, stiffness: Any, e: int, extension: Any, rest: Any) -> Any:
    strain, mean = _strain_of(extension, rest, law, e)
    working = (law.upper[e], law.lower[e], law.initial[e], law.bend[e])
    static = relaxed_at(law.table, whole(section[e]), working, mean)
    tension, k = _relaxing(static, law, e, strain - mean, rest)
    stiffness[e] = k
    return tension, k


@jit_within
def tension_at(law: Any, section: int, strain: Any) -> Any:
    """Return T and dT/dstrain [N] of a section; linear below the first and beyond the last knot."""
    knot, tension, slope, curve, bend = _piece_at(law, section, strain)
    u = strain - knot
    v = max(u, 0.0)
    return (
        tension + slope * u + v * v * (curve + bend * v),
        slope + v * (2.0 * curve + 3.0 * bend * v),
    )


@jit_within
def _piece(law: Any, section: int, j: int) -> Any:
    return (
        law.knot[section, j], law.tension[section, j], law.slope[section, j],
        law.curve[section, j], law.bend[section, j],
    )  # fmt: skip


@jit_within
def _piece_of_one(law: Any, section: int, strain: float) -> Any:
    j = 0
    while j + 1 < law.knot.shape[1] and strain >= law.knot[section, j + 1]:
        j += 1
    return _piece(law, section, j)


@jit_within
def _piece_of_lanes(law: Any, section: int, strain: Any) -> Any:
    knot, tension, slope, curve, bend = _piece(law, section, 0)
    for j in range(1, law.knot.shape[1]):
        beyond, piece = strain >= law.knot[section, j], _piece(law, section, j)
        knot, tension = choose(beyond, piece[0], knot), choose(beyond, piece[1], tension)
        slope, curve = choose(beyond, piece[2], slope), choose(beyond, piece[3], curve)
        bend = choose(beyond, piece[4], bend)
    return knot, tension, slope, curve, bend


# Knot, tension, slope, curve and bend of the piece of a table that contains a strain.
_piece_at = by_width(_piece_of_one, _piece_of_lanes)


@jit_within
def _relaxed_of_one(law: Any, section: int, working: Any, strain: float) -> Any:
    upper, lower, initial, bend = working
    if initial > 0.0 and strain < upper:
        u = strain - lower
        v = max(u, 0.0)
        return u * initial + v * v * bend, initial + 2.0 * v * bend
    return tension_at(law, section, strain)


@jit_within
def _relaxed_of_lanes(law: Any, section: int, working: Any, strain: Any) -> Any:
    upper, lower, initial, bend = working
    tension, slope = tension_at(law, section, strain)
    works = (initial > 0.0) & (strain < upper)
    if bits(works) == 0:
        return tension, slope
    u = strain - lower
    v = max(u, 0.0)
    return (
        choose(works, u * initial + v * v * bend, tension),
        choose(works, initial + 2.0 * v * bend, slope),
    )


# S and dS/dstrain [N]: on the working curve below its upper end, else the table. working: upper
# end, lower end, slope there, and curvature; a slope of 0 means no working curve.
relaxed_at = by_width(_relaxed_of_one, _relaxed_of_lanes)


def elastic_state(law: Table | None, stiffness: Floats, section: Any, strain: Floats) -> Any:
    """Return elastic tension [N] and stored energy per unstretched metre [J/m]; 0 when slack.

    In numpy, for the energy balance outside the step. stiffness: EA [N] of each element, used
    without a table.
    """
    strain = np.maximum(strain, 0.0)
    if law is None:
        return stiffness * strain, 0.5 * stiffness * strain**2
    tension, stored = np.zeros_like(strain), np.zeros_like(strain)
    for j in range(law.knot.shape[1]):
        low, t, slope, curve, bend = (row[section, j] for row in law)
        end = law.knot[section, j + 1] if j + 1 < law.knot.shape[1] else np.inf
        beyond = strain >= low
        u = np.where(beyond, np.minimum(strain, end) - np.where(beyond, low, 0.0), 0.0)
        inside = t + u * (slope + u * (curve + u * bend))
        tension = np.where(beyond, inside, tension)
        stored += u * (t + u * (slope / 2.0 + u * (curve / 3.0 + u * bend / 4.0)))
    return tension, stored


def instantaneous_tension(law: FibreLaw, section: Any, strain: Floats) -> Any:
    """Return the elastic tension [N] of a fibre rope at these strains, and its stored energy [J/m].

    ε_m is that of the last step: the instantaneous response, not clipped where slack.
    """
    n = len(strain)
    mean, stiff = law.memory[MEAN, :n], law.memory[STIFF, :n]
    upper, lower, initial, bend = law.memory[[UPPER, LOWER, INITIAL, BEND], :n]
    static, stored = elastic_state(law.table, np.zeros(n), section, mean)
    has_curve, u = initial > 0.0, np.maximum(mean - lower, 0.0)
    static = np.where(has_curve & (mean < upper), u * (initial + u * bend), static)
    # energy on the original curve: that which unloading along the working curve would recover
    span = upper - lower
    top = np.where(has_curve, span * (initial + bend * span), 1.0)
    loaded = np.where(mean < upper, upper, mean) * np.where(
        has_curve, span / np.where(has_curve, upper, 1.0), 0
    )
    curvature = bend * span * span / top
    recovered = np.where(
        mean < upper,
        u * u * (initial / 2.0 + u * bend / 3.0),
        static * loaded * (0.5 - curvature / 6.0),
    )
    stored = np.where(has_curve, recovered, stored)
    over = strain - mean
    elastic = np.maximum(over, -static / np.maximum(stiff, 1e-300))  # of the material, slack or not
    return static + stiff * over, stored + static * elastic + 0.5 * stiff * elastic * elastic


def instantaneous_strain(law: FibreLaw, section: Any, tension: Floats) -> Floats:
    """Return the strains at which `instantaneous_tension` is this tension [N]."""
    n = len(tension)
    static, _ = instantaneous_tension(law, section, law.memory[MEAN, :n])
    strain: Floats = law.memory[MEAN, :n] + (tension - static) / law.memory[STIFF, :n]
    return strain
