"""Effects of a rope with nothing at its lower end, of the same types, so nothing is recompiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from rope_twin.core.acting.hooks import hooks_of
from rope_twin.core.bed import Grid, Plane
from rope_twin.core.body import state as at
from rope_twin.core.body.state import LEG, Afloat, RigidBody
from rope_twin.effects.fairing import Fairing, TowedFairing
from rope_twin.effects.net import Net
from rope_twin.effects.payload import Payload, TwoWayPayload
from rope_twin.effects.splash_zone import SplashZone
from rope_twin.effects.waves import Waves

_NOTHING = (0.0, 0.0, 0.0)
_WITHOUT: dict[type, dict[str, Any]] = {  # values that remove the load of an effect at the end
    Payload: dict.fromkeys(Payload._fields, 0.0),
    TwoWayPayload: dict.fromkeys(TwoWayPayload._fields, 0.0),
    SplashZone: {"lift": 0.0, "slam": 0.0, "wet": _NOTHING, "added": _NOTHING, "k": _NOTHING},
    Net: {"along": 0.0, "facing": 0.0, "lift": 0.0},
    Fairing: {"k": 0.0},
    TowedFairing: {"force": 0.0},
    Waves: {"Mx": 0.0, "My": 0.0, "Mz": 0.0},
}


def is_at_end(effect: Any) -> bool:
    """Return whether the effect loads the lower end of the rope."""
    return "load_end" in hooks_of(type(effect))


def without_load(effects: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the effects of the rope alone.

    Raises:
        TypeError: an effect at the lower end is unknown here.
    """
    return tuple(_bare(effect) if is_at_end(effect) else effect for effect in effects)


def _bare(effect: Any) -> Any:
    if isinstance(effect, Plane | Grid):  # the bed stays, the payload on it does not
        return effect._replace(soil=effect.soil._replace(k_payload=0.0))
    if isinstance(effect, RigidBody):
        return _parked(effect)
    if type(effect) not in _WITHOUT:
        raise TypeError(f"{type(effect).__name__} loads the lower end: say here what is none of it")
    return effect._replace(**_WITHOUT[type(effect)])


def _parked(body: RigidBody) -> RigidBody:
    """Return a body of this type without slings, forces or contacts.

    It stays where this one is, and its equations are 0 = 0: its contribution to the rope is 0.
    """
    records, now = np.zeros_like(body.records), body.records[int(body.memory[0, 0])]
    for first, count in ((at.X, 3), (at.Q, 4), (at.WATER, 3)):
        records[0, first : first + count] = now[first : first + count]
    memory = body.memory.copy()
    memory[0] = 0.0  # index of the valid record
    return body._replace(
        memory=memory,
        records=records,
        parts=tuple(_untouched(part) for part in body.parts),
        legs=np.zeros((0, LEG)),
        corners=np.zeros((0, 3)),
        added=np.zeros(6),
        k=np.zeros(6),
        W=0.0,
        hook=0.0,
        hook_weight=0.0,
        g=0.0,
        displaced=0.0,
        rising=0.0,
        rising_k=0.0,
    )


def _untouched(part: Any) -> Any:
    """Return a component of a body without weight and corners."""
    if isinstance(part, Afloat):
        return part._replace(columns=np.zeros((0, part.columns.shape[1])), slam=0.0)
    return part
