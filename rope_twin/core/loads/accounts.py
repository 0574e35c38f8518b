"""Energy accounts: contributions of effects to the energy balance of core/energy.

An effect registers its stored energy and its power by functions of its type, `@account(kind,
Type)`, that are called in plain Python with the kinematics of the nodes, a Place.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.state import Floats

# Kinds of account: per node along the rope (a Place, one value each), or at the lower end.
ALONG = ("kinetic", "potential", "power")  # [J], [J], [W] into the rope
AT_END = ("kinetic_end", "potential_end", "power_end")
_ACCOUNTS: dict[str, dict[type, Any]] = {kind: {} for kind in (*ALONG, *AT_END)}
_WETTED: dict[type, Any] = {}
_LOWEST: dict[type, Any] = {}


class Place(NamedTuple):
    """Kinematics and lumped properties of nodes; vectors (3, nodes), scalars (nodes,)."""

    arc: Floats  # unstretched, from the lower end [m]
    position: Floats  # [m]
    velocity: Floats  # of the material [m/s]
    acceleration: Floats  # of the nodes [m/s²]
    tangent: Floats  # unit vector, upward
    turning: Floats  # rate of the tangent [1/s]
    flow: Floats  # water velocity [m/s]
    flow_rate: Floats  # water acceleration [m/s²]
    surface: Floats  # elevation z of the water surface above the node [m]
    mass: Floats  # of the rope [kg]
    volume: Floats  # of displaced water [m³]
    frontal: Floats  # reference area of normal drag [m²]
    skin: Floats  # reference area of tangential drag [m²]
    length: Floats  # unstretched [m]
    bare: Floats  # projected area out of the water [m²]
    touching: Floats  # reference area of the seabed's contact [m²]


def account(kind: str, effect: type) -> Callable[[Any], Any]:
    """Register an effect type's contribution to the energy balance: f(effect, place) -> (nodes,).

    `place` holds all nodes, or only the lower end for a kind of AT_END.

    Raises:
        ValueError: unknown kind, or a second account of this kind.
    """
    if kind not in _ACCOUNTS:
        raise ValueError(f"unknown account '{kind}'; known: {', '.join(_ACCOUNTS)}")
    if effect in _ACCOUNTS[kind]:
        raise ValueError(f"{effect.__name__} has registered its '{kind}' already")

    def register(function: Any) -> Any:
        _ACCOUNTS[kind][effect] = function
        return function

    return register


def accounts_of(effect: type) -> tuple[str, ...]:
    """Return the kinds of account that an effect type has registered."""
    return tuple(kind for kind, registered in _ACCOUNTS.items() if effect in registered)


def account_sum(kind: str, effects: tuple[Any, ...], place: Place) -> float:
    """Return the sum of one kind of account over all effects, at a place."""
    registered = _ACCOUNTS[kind]
    return sum(
        float(np.sum(registered[type(effect)](effect, place)))
        for effect in effects
        if type(effect) in registered
    )


def wetted(effects: tuple[Any, ...], place: Place) -> Place:
    """Return a place with the properties of its submerged part, according to its effects.

    Stored energy is that of the whole place; such an effect accounts for the difference.
    """
    for effect in effects:
        if type(effect) in _WETTED:
            place = _WETTED[type(effect)](effect, place)
    return place


def wets(effect: type) -> Callable[[Any], Any]:
    """Register an effect's f(effect, place) -> place for `wetted`."""

    def register(function: Any) -> Any:
        _WETTED[effect] = function
        return function

    return register


def account_submerged(effect: type) -> None:
    """Register the accounts of an effect that changes the water which others see (`wets`).

    It has the fields `lift` (ρ·g), `added` and `axial` (added mass coefficients across and along
    the rope, times ρ), of a rope fully submerged in the scene's water, or 0 where another effect of
    this kind has them. The stored energy of buoyancy and added mass is subtracted, and the power of
    their forces on the submerged part added instead.
    """

    def potential(own: Any, place: Place) -> Floats:
        """Return the buoyancy's part, ρ·g·volume·z, to be taken out of the weight's [J]."""
        return np.asarray(own.lift * place.volume * place.position[2])

    def kinetic(own: Any, place: Place) -> Floats:
        """Return minus the energy of the added mass of a wholly wetted rope [J]."""
        v, along = place.velocity, (place.velocity * place.tangent).sum(axis=0)
        across = (v * v).sum(axis=0) - along * along
        return np.asarray(-0.5 * place.volume * (own.added * across + own.axial * along * along))

    def power(own: Any, place: Place) -> Floats:
        """Return the power of buoyancy and added mass on the part that acts [W]; place: of it.

        The added mass's own account, of the part of its force beyond its stored energy, is taken
        out.
        """
        v, a, t = place.velocity, place.acceleration, place.tangent
        along = (v * t).sum(axis=0)
        forward = (a * t).sum(axis=0) * along
        turned = (v * place.turning).sum(axis=0) * along
        across = own.added * ((a * v).sum(axis=0) - forward - turned)
        inertia = across + own.axial * (forward + turned)
        return np.asarray(place.volume * (own.lift * v[2] - inertia))

    for kind, function in (("potential", potential), ("kinetic", kinetic), ("power", power)):
        account(kind, effect)(function)


def lowest_account(effect: type) -> Callable[[Any], Any]:
    """Register the account of an effect with a law of the lowest element (hook `axial`).

    f(effect, extension, its rate, stiffness, depth) returns its tension, the conservative part of
    it, that of the water's pressure [N], and the stored energy [J].
    """

    def register(function: Any) -> Any:
        _LOWEST[effect] = function
        return function

    return register


def law_of_lowest(effects: tuple[Any, ...]) -> Callable[..., Any] | None:
    """Return f(extension, its rate, stiffness, depth) of `lowest_account`, or None without one.

    The lowest element then has the law of its section.
    """
    for effect in effects:
        if type(effect) in _LOWEST and effect.here != 0.0:
            return partial(_LOWEST[type(effect)], effect)
    return None
