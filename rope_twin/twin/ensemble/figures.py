"""Figures of a fleet's members: factors on properties of the rope and its payload.

A figure is a number of the model that a measurement can correct: the payload's submerged weight,
its mass with the added mass, its drag, the rope's axial stiffness, damping and tangential drag, the
strength of the current. A factor scales the fields of the kernel data that the figure stands for;
nothing else of the scene follows from it, neither the tolerance of the step nor a damping that the
scene gives as a fraction of the critical one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope, Table
from rope_twin.effects.current import (
    Current,
    CurrentInTime,
    RisingCurrent,
    RisingCurrentInTime,
)
from rope_twin.effects.drag import CurrentDrag, Drag, ReynoldsDrag
from rope_twin.effects.payload import Payload, SplashZone, TwoWayPayload
from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.twin.internal_variables import has_state
from rope_twin.vortex.drag_amplification import OscillatingDrag

FIGURES = (
    "submerged_weight",
    "oscillating_mass",
    "payload_drag",
    "axial_stiffness",
    "axial_damping",
    "tangential_drag",
    "current",
)  # factors, 1.0: the scene's value

Factors = Mapping[str, float | Floats]  # a number, or one for each member, (members,)

_CURRENT: dict[str, tuple[str, ...]] = {"current": ("U", "slope")}
_PAYLOAD: dict[str, tuple[str, ...]] = {
    "submerged_weight": ("W",),
    "oscillating_mass": ("Mz",),
    "payload_drag": ("kx", "ky", "kz"),
}
# the fields of an effect's kernel data that a figure scales
_FIELDS: dict[type, dict[str, tuple[str, ...]]] = {
    Payload: _PAYLOAD,
    TwoWayPayload: {
        "submerged_weight": ("W",),
        "oscillating_mass": ("Mz", "dM"),
        "payload_drag": ("kx", "ky", "kz", "dk"),
    },
    SplashZone: {"payload_drag": ("k",)},  # of which it takes off what is in the air
    Drag: {"tangential_drag": ("kt",)},
    OscillatingDrag: {"tangential_drag": ("kt",)},
    Current: _CURRENT,
    RisingCurrent: _CURRENT,
}
# effects that contain the data of one of the above
_INSIDE = {
    ReynoldsDrag: "drag",
    CurrentDrag: "drag",
    CurrentInTime: "current",
    RisingCurrentInTime: "current",
}
_SECTION_ROWS = {"axial_stiffness": rows.EA, "axial_damping": rows.C}
_TABLE_FIELDS = ("tension", "slope", "curve", "bend")


def figures_of(rope: Rope) -> tuple[str, ...]:
    """Return the figures that a rope has; a fibre rope's stiffness is not a single number."""
    known = {"axial_damping"}
    if not rope.sections[rows.RELAXATION].any():
        known.add("axial_stiffness")
    for effect in rope.effects:
        inner = getattr(effect, _INSIDE[type(effect)]) if type(effect) in _INSIDE else effect
        known |= _FIELDS.get(type(inner), {}).keys()
    return tuple(name for name in FIGURES if name in known)


def checked_factors(given: Factors, known: tuple[str, ...], members: int) -> dict[str, Floats]:
    """Return factors as arrays, (members,) each.

    known: the figures of the rope.

    Raises:
        InputError: an unknown figure, or a factor that is not finite and positive, or as many
            factors as there are no members.
    """
    found = {}
    for name, value in given.items():
        if name not in FIGURES:
            raise InputError(phrase("figures", f"'{name}' is none", did_you_mean(name, FIGURES)))
        if name not in known:
            right = f"this scene has {', '.join(known)}"
            raise InputError(phrase(f"figures: {name}", "the scene has no such number", right))
        factor = np.asarray(value, dtype=float)
        if factor.ndim > 1 or factor.size not in (1, members):
            what = f"{factor.size} factors for {members} members"
            raise InputError(phrase(f"figures: {name}", what, "give one, or one for each"))
        wrong = factor[~(np.isfinite(factor) & (factor > 0.0))] if factor.ndim else factor
        if not (np.isfinite(factor) & (factor > 0.0)).all():
            what = f"a factor of {float(np.ravel(wrong)[0]):g}"
            right = "give positive numbers, 1.0 for the scene's own value"
            raise InputError(phrase(f"figures: {name}", what, right))
        found[name] = np.broadcast_to(factor, (members,)).copy()
    return found


def stacked_sections(sections: Floats, factors: Mapping[str, Floats]) -> Floats:
    """Return the sections of each member, (members, SECTION_ROWS, sections)."""
    (members,) = next(iter(factors.values())).shape
    found: Floats = np.tile(sections, (members, 1, 1))
    for name, row in _SECTION_ROWS.items():
        found[:, row] *= factors[name][:, None]
    return found


def stacked_effects(effects: tuple[Any, ...], factors: Mapping[str, Floats]) -> tuple[Any, ...]:
    """Return effects whose scaled fields have the members as their first axis."""
    return tuple(_scaled(effect, factors, np.multiply.outer) for effect in effects)


def scaled_law(law: Any, share: float) -> Any:
    """Return an axial law with the tensions of a stiffness table multiplied; others as they are."""
    if not isinstance(law, Table):
        return law
    return law._replace(**{name: share * getattr(law, name) for name in _TABLE_FIELDS})


def copied_law(law: Any) -> Any:
    """Return an axial law with own arrays, if it is a stiffness table; others as they are."""
    return Table(*(one.copy() for one in law)) if isinstance(law, Table) else law


def scaled_rope(rope: Rope, factors: Mapping[str, float], effects: tuple[Any, ...]) -> Rope:
    """Return the rope of one member; effects: its own so far, whose memory it keeps."""
    sections = rope.sections.copy()
    for name, row in _SECTION_ROWS.items():
        sections[row] *= factors[name]
    law = scaled_law(rope.law, factors["axial_stiffness"])
    made = []
    for base, own in zip(rope.effects, effects, strict=True):
        scaled = _scaled(base, factors, np.multiply)
        if has_state(own):
            arrays = {k: v for k, v in own._asdict().items() if isinstance(v, np.ndarray)}
            scaled = scaled._replace(**arrays)
        made.append(scaled)
    return rope._replace(sections=sections, law=law, effects=tuple(made))


def _scaled(effect: Any, factors: Mapping[str, Any], times: Any) -> Any:
    """Return kernel data with the figures' fields scaled: times(factor, field)."""
    inside = _INSIDE.get(type(effect))
    if inside is not None:
        inner = _scaled(getattr(effect, inside), factors, times)
        return effect._replace(**{inside: inner})
    changed = {}
    for figure, names in _FIELDS.get(type(effect), {}).items():
        for name in names:
            changed[name] = _times(factors[figure], getattr(effect, name), times)
    return effect._replace(**changed)


def _times(factor: Any, field: Any, times: Any) -> Any:
    if isinstance(field, tuple):
        return tuple(_times(factor, one, times) for one in field)
    value = times(factor, field)
    return value if np.ndim(value) else float(value)


def scaled_sections(sections: Floats, factors: Mapping[str, float]) -> Floats:
    """Return sections with axial stiffness and damping multiplied, (SECTION_ROWS, sections)."""
    found = sections.copy()
    for name, row in _SECTION_ROWS.items():
        found[row] *= factors[name]
    return found


def scaled_fields(
    base: tuple[Any, ...], effects: tuple[Any, ...], factors: Mapping[str, float]
) -> tuple[Any, ...]:
    """Return effects whose figures, but the current, are those of `base` times the factors.

    Everything else of the effects is kept, whatever their mesh. factors: of all FIGURES.
    """
    made = []
    for own, first in zip(effects, base, strict=True):
        inside = _INSIDE.get(type(own))
        if inside is not None:
            (inner,) = scaled_fields((getattr(first, inside),), (getattr(own, inside),), factors)
            made.append(own._replace(**{inside: inner}))
            continue
        fields = _FIELDS.get(type(own), {})
        names = [name for figure in fields if figure != "current" for name in fields[figure]]
        scaled = _scaled(first, factors, np.multiply) if names else first
        made.append(own._replace(**{name: getattr(scaled, name) for name in names}))
    return tuple(made)
