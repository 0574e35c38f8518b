"""Energy balance of a single rope, from the state at a step boundary.

It is computed in numpy, apart from the step, so it costs nothing unless requested. An effect
registers its stored energy and its power by functions beside its kernels, `@account(kind, Type)`;
nothing here refers to an effect by name.

The sums are those of the lumped-mass rope itself, so that only the time-stepping error remains:
with w the material velocity at the hang-off and F the force there, M·a = T_i·t_i - T_{i-1}·t_{i-1}
+ f times v, summed, gives d(energy)/dt = F·w + V·(energy per metre there) + water - damper, where
the top element may grow at V. Three terms are neglected, all small and of the order of the mesh:
mass·V·|w - v_{n-1}|²/4, the work of decaying length corrections, and the change at a split or
merge.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.axial_law import FibreLaw, held_tension, hold, sections_law
from rope_twin.core.elements import SAME_PLACE
from rope_twin.core.guards import STRETCH2_MIN, TANGENT2_MIN
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.loads.balance import set_flow
from rope_twin.core.loads.growth import grown
from rope_twin.core.state import (
    ACCELERATION,
    EA,
    ELEMENTS,
    END,
    FLOW,
    FLOW_RATE,
    MASS,
    NODE_ROWS,
    PER_METRE,
    POSITION,
    SURFACE,
    VELOCITY,
    C,
    Floats,
    Rope,
    Stage,
    new_work,
)

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


class Elements(NamedTuple):
    """Elements from the lower end up; vectors (3, n), scalars (n,)."""

    direction: Floats
    turning: Floats  # rate of the direction [1/s]
    stored: Floats  # elastic energy [J]
    damping: Floats  # force that dissipates, part of the tension [N]
    held: Floats  # energy per metre that this force has stored, in a fibre rope [J/m]
    rate: Floats  # strain rate times unstretched length [m/s]
    stretch: Floats  # length over unstretched length
    rest: Floats  # unstretched length [m]
    section: Any  # column in `sections`
    water: float = 0.0  # power of the water on the lowest element [W]


class Store(NamedTuple):
    """Energy in rope and payload [J]."""

    kinetic: float  # added mass included
    elastic: float
    potential: float  # of weight less buoyancy, zero at the mean water level

    @property
    def total(self) -> float:
        """Return the sum of all stored energy [J]."""
        return self.kinetic + self.elastic + self.potential


class Power(NamedTuple):
    """Power into the rope [W]; negative values take energy from it."""

    hang_off: float  # force times material velocity there
    passing: float  # energy carried by the rope that enters over the sheave
    water: float


class Border(NamedTuple):
    """Energy, power and elements at a step boundary."""

    store: Store
    power: Power
    elements: Elements


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
    return tuple(kind for kind, known in _ACCOUNTS.items() if effect in known)


def account_sum(kind: str, effects: tuple[Any, ...], place: Place) -> float:
    """Return the sum of one kind of account over all effects, at a place."""
    known = _ACCOUNTS[kind]
    return sum(
        float(np.sum(known[type(effect)](effect, place)))
        for effect in effects
        if type(effect) in known
    )


def wetted(effects: tuple[Any, ...], place: Place) -> Place:
    """Return a place whose properties are those of its part in the water, where an effect says so.

    Stored energy is that of all of it; such an effect takes the difference into its own accounts.
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


def account_soaked(effect: type) -> None:
    """Register the accounts of an effect that changes the water which others see (`wets`).

    It has the fields `lift` (ρ·g), `added` and `axial` (added mass coefficients across and along
    the rope, times ρ), of a rope wholly in the scene's water, or 0 where another effect of this
    kind has them. The stored energy of buoyancy and added mass is taken out, and the power of their
    forces on the part that acts is put in its place.
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

    f(effect, extension, its rate, stiffness, depth) returns its tension, the part of it that stored
    energy gives back, that of the water's pressure [N], and the stored energy [J].
    """

    def register(function: Any) -> Any:
        _LOWEST[effect] = function
        return function

    return register


def law_of_lowest(effects: tuple[Any, ...]) -> Callable[..., Any] | None:
    """Return f(extension, its rate, stiffness, depth) of `lowest_account`; None: no effect has it.

    Without it the lowest element has the law of its section.
    """
    for effect in effects:
        if type(effect) in _LOWEST and effect.here != 0.0:
            return partial(_LOWEST[type(effect)], effect)
    return None


def measure(rope: Rope, pull: Floats, time: float, V: float) -> Border:
    """Return energy and power of the state at a step boundary.

    pull: the rope's force on the hang-off, x, y, z [N]; time [s]; V: payout speed [m/s].
    """
    elements, effects = _elements(rope, V), grown(rope.effects, time)
    place = _place(rope, elements, time, V)
    end = Place(*(row[..., :1] for row in place))
    sheave = _metre_at_sheave(rope, elements, place)
    store = Store(
        kinetic=_motion(rope.effects, place) + account_sum("kinetic_end", rope.effects, end),
        elastic=float(elements.stored.sum()),
        potential=account_sum("potential", rope.effects, place)
        + account_sum("potential_end", rope.effects, end),
    )
    per_metre = elements.stored[-1] / elements.rest[-1]
    per_metre += _motion(rope.effects, sheave) + account_sum("potential", rope.effects, sheave)
    power = Power(
        hang_off=-float(pull @ place.velocity[:, -1]),
        passing=float(V * per_metre),
        water=account_sum("power", effects, wetted(effects, place))
        + account_sum("power_end", effects, end)
        + elements.water,
    )
    return Border(store, power, elements)


def damped(before: Elements, after: Elements, step: float) -> float:
    """Return the energy that the axial damper dissipates over a step [J].

    It is the damping force times the elongation: a stiff damper stops a motion within less than a
    step, and force times rate at the step boundaries would overestimate that many times. Where a
    split or merge has just changed the elements only force times rate is available.
    """
    n = min(len(before.rest), len(after.rest))
    same = n if len(before.rest) == len(after.rest) else n - 1
    moved = 0.5 * (before.rest[:same] + after.rest[:same])
    moved *= after.stretch[:same] - before.stretch[:same]
    work = 0.5 * (before.damping[:same] + after.damping[:same]) @ moved
    for some in (before, after):
        work += 0.5 * step * (some.damping[same:] @ some.rate[same:])
    rest = 0.5 * (before.rest[:same] + after.rest[:same])
    return float(work - rest @ (after.held[:same] - before.held[:same]))


def _motion(effects: tuple[Any, ...], place: Place) -> float:
    """Return the kinetic energy of the rope including the effects' contributions [J]."""
    own = 0.5 * float(place.mass @ (place.velocity**2).sum(axis=0))
    return own + account_sum("kinetic", effects, place)


def _elements(rope: Rope, V: float) -> Elements:
    """Return stored and damping energy by T = max(0, E(strain) + c·strain rate) of
    `elastic.stretch`.
    """
    n, sections = int(rope.state.counts[ELEMENTS]), rope.sections
    s, offset = rope.state.s[: n + 1], rope.state.offset[:n]
    x = rope.state.nodes[POSITION : POSITION + 3, : n + 1]
    v = rope.state.nodes[VELOCITY : VELOCITY + 3, : n + 1]
    rest, dx, dv = np.diff(s), np.diff(x), np.diff(v)
    length = np.sqrt((dx * dx).sum(axis=0) + STRETCH2_MIN * rest * rest)
    direction = dx / length
    closing = (direction * dv).sum(axis=0)
    section = np.searchsorted(sections[END], s[:-1] + SAME_PLACE, side="right")
    rate = closing.copy()  # of the length, less that of the unstretched length: l_0·strain rate
    rate[-1] -= V / rest[-1] * length[-1]
    strain = (length + offset - rest) / rest
    law, damper = sections_law(rope), sections[C, section] / rest * rate
    if isinstance(law, FibreLaw):
        elastic, stored = held_tension(law, section, strain)
        pull = np.maximum(elastic + damper, 0.0)
        spring, held = np.zeros(n), stored.copy()
    else:
        spring, stored = hold(law, sections[EA, section], section, strain)
        slack = sections[EA, section] * np.minimum(strain, 0.0)  # a table begins with EA
        pull, held = np.maximum(spring + slack + damper, 0.0), np.zeros(n)
    stored, damping, water = stored * rest, pull - spring, 0.0
    own = law_of_lowest(rope.effects)
    if own is not None:
        k, depth = sections[EA, section[0]] / rest[0], -0.5 * float(x[2, 0] + x[2, 1])
        rate_0 = float(closing[0])
        tension, back, rod, work = own(float(length[0] + offset[0] - rest[0]), rate_0, k, depth)
        damping[0], stored[0], water = tension - back - rod, work, -rod * rate_0
        held[0] = 0.0
    return Elements(
        direction=direction,
        turning=(dv - closing * direction) / length,
        stored=stored,
        damping=damping,
        held=held,
        rate=rate,
        stretch=length / rest,
        rest=rest,
        section=section,
        water=water,
    )


def _place(rope: Rope, elements: Elements, time: float, V: float) -> Place:
    """Return all nodes; the hang-off node has the material velocity v - V·(element vector/l_0)."""
    n = len(elements.rest)
    x = rope.state.nodes[POSITION : POSITION + 3, : n + 1]
    v = rope.state.nodes[VELOCITY : VELOCITY + 3, : n + 1].copy()
    v[:, -1] -= V / elements.rest[-1] * (x[:, -1] - x[:, -2])
    along, turn = _at_nodes(elements.direction), _at_nodes(elements.turning)
    size = np.sqrt((along * along).sum(axis=0) + TANGENT2_MIN)
    tangent = along / size
    half = 0.5 * elements.rest * rope.sections[PER_METRE:, elements.section]
    lumps = np.zeros((len(half), n + 1))
    lumps[:, :-1] += half
    lumps[:, 1:] += half
    water = _flow(rope, lumps, time, V)
    return Place(
        arc=rope.state.s[: n + 1],
        position=x,
        velocity=v,
        acceleration=rope.state.nodes[ACCELERATION : ACCELERATION + 3, : n + 1],
        tangent=tangent,
        turning=(turn - (turn * tangent).sum(axis=0) * tangent) / size,
        flow=water[FLOW : FLOW + 3],
        flow_rate=water[FLOW_RATE : FLOW_RATE + 3],
        surface=water[SURFACE],
        **dict(zip(("mass", "volume", "frontal", "skin", "length"), lumps, strict=True)),
        bare=np.zeros(n + 1),
        touching=lumps[2],
    )


def _at_nodes(rows: Floats) -> Floats:
    """Return the sums over the elements adjacent to each node; end nodes have one element."""
    return np.concatenate([rows[:, :1], rows[:, :-1] + rows[:, 1:], rows[:, -1:]], axis=1)


def _metre_at_sheave(rope: Rope, elements: Elements, place: Place) -> Place:
    """Return one metre of the rope that passes the hang-off, as a Place."""
    end = Place(*(row[..., -1:] for row in place))
    mass, volume, frontal, skin, length = rope.sections[PER_METRE:, elements.section[-1:]]
    return end._replace(
        mass=mass, volume=volume, frontal=frontal, skin=skin, length=length, touching=frontal
    )


def _flow(rope: Rope, lumps: Floats, time: float, V: float) -> Floats:
    """Return scratch whose rows FLOW, FLOW_RATE and SURFACE hold the water at the nodes.

    lumps: rows MASS to LENGTH of the nodes.
    """
    nodes = lumps.shape[1]
    work = new_work(nodes)
    work[:NODE_ROWS] = rope.state.nodes[:, :nodes]
    work[MASS : MASS + len(lumps), :nodes] = lumps
    _find_flow(rope.effects, work, Stage(time, 1.0, 0.0, V), 0, nodes)
    return work


@jit_entry
def _find_flow(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Compiled entry point of `set_flow`, to be called from Python."""
    set_flow(effects, work, stage, low, high)
