"""Types of rigid bodies, one for each set of components, which select the compiled code.

The step of a body without a deck thus contains no code for a deck (core/body/parts.py). All types
are made on import, so that numba's cache finds them by name.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from rope_twin.core.body import energy as body_energy
from rope_twin.core.body import step as body_step
from rope_twin.core.body.shedding import OWN_COLUMNS, OWN_ENTRIES, Shedding
from rope_twin.core.body.state import (
    STIFFNESS,
    Afloat,
    Deck,
    GridBed,
    Immersed,
    PlaneBed,
    RigidBody,
)
from rope_twin.core.energy import account
from rope_twin.core.loads.hooks import kernel, switching
from rope_twin.core.loads.memory import remembering


def _where_here(told: Any) -> Any:
    """Return an account that is zero where the rope does not carry the body."""

    def account_of(body: Any, place: Any) -> Any:
        return told(body, place) if body.here else np.zeros(place.velocity.shape[1])

    return account_of


def _make(parts: tuple[type, ...]) -> type[RigidBody]:
    """Return a type of body with its kernels and accounts registered."""
    name = "RigidBody" + "".join(part.__name__ for part in parts)
    kind = type(name, (RigidBody,), {"__slots__": (), "__module__": __name__})
    for hook in ("start", "predict", "load_end", "calm", "settle"):
        kernel(hook, kind)(getattr(body_step, hook))
    for told in ("kinetic", "potential", "power"):
        account(f"{told}_end", kind)(_where_here(getattr(body_energy, told)))
    remembering(kind, 1)
    switching(kind)
    globals()[name] = kind
    return kind


_WATERS = ((Immersed,), (Afloat,))
_DECKS: tuple[tuple[type, ...], ...] = ((), (Deck,))
_BEDS: tuple[tuple[type, ...], ...] = ((), (PlaneBed,), (GridBed,))
_WAKES: tuple[tuple[type, ...], ...] = ((), (Shedding,))
_KINDS = {sum(some, ()): _make(sum(some, ())) for some in product(_WATERS, _DECKS, _BEDS, _WAKES)}


def with_parts(body: RigidBody, parts: tuple[Any, ...]) -> RigidBody:
    """Return a body with these components: water model, then deck, seabed, vortices."""
    held = float(body.legs[:, STIFFNESS].sum())
    stiffness = held + len(body.corners) * sum(getattr(one, "k", 0.0) for one in parts)
    figures = {**body._asdict(), "parts": parts, "stiffness": stiffness}
    if any(isinstance(one, Shedding) for one in parts):
        figures["records"] = np.pad(body.records, ((0, 0), (0, OWN_COLUMNS)))
        figures["stage"] = np.pad(body.stage, (0, OWN_ENTRIES))
    return _KINDS[tuple(map(type, parts))](**figures)
