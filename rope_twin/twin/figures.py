"""Figures: factors on properties of a rope and its payload, of fleets and of a running twin.

A figure is a number of the model that a measurement can correct: the payload's submerged weight,
its mass with the added mass, its drag, the rope's axial stiffness, damping and tangential drag, the
strength of the current. A factor scales the fields of the kernel data that the figure stands for;
nothing else of the scene follows from it, neither the tolerance of the step nor a damping that the
scene gives as a fraction of the critical one.

A run applies learned figures by a ramp. A rope whose weight or stiffness jumps oscillates at its
natural period, so factors on the scene's figures change linearly in time, in increments of
UPDATE_NS from the instant at which they were accepted: a replay or a resumed run is bit-identical,
however its steps are divided. The current has a topic of its own and is not applied here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body.state import RigidBody
from rope_twin.core.state import Floats, Rope, Table
from rope_twin.effects.current import Current, CurrentInTime, RisingCurrent, RisingCurrentInTime
from rope_twin.effects.depth_profiles import DepthProfiles
from rope_twin.effects.drag import CurrentDrag, Drag, ReynoldsDrag
from rope_twin.effects.payload import Payload, SplashZone, TwoWayPayload
from rope_twin.effects.payload_oscillation import PayloadOscillation
from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.twin.health import InputCounter
from rope_twin.twin.regrid import with_arrays_of
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
    SplashZone: {"payload_drag": ("k",)},  # it reduces the drag of the part in the air
    DepthProfiles: {"payload_drag": ("kx", "ky", "kz", "dk")},  # in water of another density
    PayloadOscillation: {"payload_drag": ("kx", "ky", "kz")},  # by its factors of drag
    Drag: {"tangential_drag": ("kt",)},
    OscillatingDrag: {"tangential_drag": ("kt",)},
    Current: _CURRENT,
    RisingCurrent: _CURRENT,
}
# Weight and buoyancy of a body get one factor; its mass is scaled by way of the added mass along z.
_BODY: dict[str, tuple[str, ...]] = {
    "submerged_weight": ("W", "g", "hook_weight"),
    "oscillating_mass": ("added", "rising"),
    "payload_drag": ("k", "rising_k"),
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
MAX_FACTOR = 5.0  # and 1/MAX_FACTOR the minimum: beyond them it is another lift
MAX_RAMP_S = 3600.0
UPDATE_NS = 100_000_000
RAMP_S = 20.0  # about two natural periods of a rope of 10 s


def figures_of(rope: Rope) -> tuple[str, ...]:
    """Return the figures that a rope has; a fibre rope's stiffness is not a single number."""
    known = {"axial_damping"}
    if not rope.sections[rows.RELAXATION].any():
        known.add("axial_stiffness")
    for effect in rope.effects:
        inner = getattr(effect, _INSIDE[type(effect)]) if type(effect) in _INSIDE else effect
        known |= _fields_of(inner).keys()
    return tuple(name for name in FIGURES if name in known)


def _fields_of(effect: Any) -> Mapping[str, tuple[str, ...]]:
    """Return the fields of an effect's kernel data that figures scale, by figure."""
    return _BODY if isinstance(effect, RigidBody) else _FIELDS.get(type(effect), {})


def checked_factors(factors: Factors, known: tuple[str, ...], members: int) -> dict[str, Floats]:
    """Return factors as arrays, (members,) each.

    known: the figures of the rope.

    Raises:
        InputError: an unknown figure, a factor that is not finite and positive, or neither one
            factor nor one for each member.
    """
    checked = {}
    for name, value in factors.items():
        if name not in FIGURES:
            raise InputError("figures", f"'{name}' is none", did_you_mean(name, FIGURES))
        if name not in known:
            remedy = f"this scene has {', '.join(known)}"
            raise InputError(f"figures: {name}", "the scene has no such number", remedy)
        factor = np.asarray(value, dtype=float)
        if factor.ndim > 1 or factor.size not in (1, members):
            problem = f"{factor.size} factors for {members} members"
            raise InputError(f"figures: {name}", problem, "give one, or one for each")
        values = np.ravel(factor)
        invalid = values[~(np.isfinite(values) & (values > 0.0))]
        if invalid.size:
            problem = f"a factor of {float(invalid[0]):g}"
            remedy = "give positive numbers, 1.0 for the scene's own value"
            raise InputError(f"figures: {name}", problem, remedy)
        checked[name] = np.broadcast_to(factor, (members,)).copy()
    return checked


def stacked_sections(sections: Floats, factors: Mapping[str, Floats]) -> Floats:
    """Return the sections of each member, (members, SECTION_ROWS, sections)."""
    (members,) = next(iter(factors.values())).shape
    stacked: Floats = np.tile(sections, (members, 1, 1))
    for name, row in _SECTION_ROWS.items():
        stacked[:, row] *= factors[name][:, None]
    return stacked


def stacked_effects(effects: tuple[Any, ...], factors: Mapping[str, Floats]) -> tuple[Any, ...]:
    """Return effects whose scaled fields have the members as their first axis."""
    return tuple(_scaled(effect, factors, np.multiply.outer) for effect in effects)


def scaled_law(law: Any, factor: float) -> Any:
    """Return an axial law with the tensions of a stiffness table multiplied; others as they are."""
    if not isinstance(law, Table):
        return law
    return law._replace(**{name: factor * getattr(law, name) for name in _TABLE_FIELDS})


def copied_law(law: Any) -> Any:
    """Return an axial law with own arrays, if it is a stiffness table; others as they are."""
    return Table(*(table.copy() for table in law)) if isinstance(law, Table) else law


def scaled_rope(rope: Rope, factors: Mapping[str, float], effects: tuple[Any, ...]) -> Rope:
    """Return the rope of one member; effects: its present ones, with its internal variables."""
    sections = scaled_sections(rope.sections, factors)
    law = scaled_law(rope.law, factors["axial_stiffness"])
    pairs = zip(rope.effects, effects, strict=True)
    scaled = [with_arrays_of(effect, _scaled(base, factors, np.multiply)) for base, effect in pairs]
    return rope._replace(sections=sections, law=law, effects=tuple(scaled))


def _scaled(effect: Any, factors: Mapping[str, Any], times: Any) -> Any:
    """Return kernel data with the figures' fields scaled: times(factor, field)."""
    inner_name = _INSIDE.get(type(effect))
    if inner_name is not None:
        inner = _scaled(getattr(effect, inner_name), factors, times)
        return effect._replace(**{inner_name: inner})
    changed = {}
    for figure, names in _fields_of(effect).items():
        for name in names:
            changed[name] = _scaled_field(factors[figure], getattr(effect, name), times)
    if isinstance(effect, RigidBody):
        changed["added"] = effect.added.copy()
        moved_kg = effect.hook + effect.m + effect.added[2]
        changed["added"][2] += (factors["oscillating_mass"] - 1.0) * moved_kg
    return effect._replace(**changed)


def _scaled_field(factor: Any, field: Any, times: Any) -> Any:
    if isinstance(field, tuple):
        return tuple(_scaled_field(factor, part, times) for part in field)
    value = times(factor, field)
    return value if np.ndim(value) else float(value)


def scaled_sections(sections: Floats, factors: Mapping[str, float]) -> Floats:
    """Return sections with axial stiffness and damping multiplied, (SECTION_ROWS, sections)."""
    scaled = sections.copy()
    for name, row in _SECTION_ROWS.items():
        scaled[row] *= factors[name]
    return scaled


def scaled_fields(
    base: tuple[Any, ...], effects: tuple[Any, ...], factors: Mapping[str, float]
) -> tuple[Any, ...]:
    """Return effects whose figures, but the current, are those of `base` times the factors.

    Everything else of the effects is kept, whatever their mesh. factors: of all FIGURES.
    """
    result = []
    for effect, base_effect in zip(effects, base, strict=True):
        inner_name = _INSIDE.get(type(effect))
        if inner_name is not None:
            base_inner, inner = (getattr(whole, inner_name) for whole in (base_effect, effect))
            (inner,) = scaled_fields((base_inner,), (inner,), factors)
            result.append(effect._replace(**{inner_name: inner}))
            continue
        fields = _fields_of(effect)
        names = [name for figure in fields if figure != "current" for name in fields[figure]]
        scaled = _scaled(base_effect, factors, np.multiply) if names else base_effect
        result.append(effect._replace(**{name: getattr(scaled, name) for name in names}))
    return tuple(result)


class LearnedFigures:
    """Factors on the scene's figures: before the ramp, after it, and its times."""

    def __init__(self) -> None:
        """Begin with the scene's own figures."""
        self.counter = InputCounter("figures")
        self.active = False
        self._before, self._target = np.ones(len(FIGURES)), np.ones(len(FIGURES))
        self.begin_ns = 0
        self.ramp_ns = 0

    def submit(
        self, rope: Rope, factors: Mapping[str, float], ramp_s: float, now_ns: int, cut: bool
    ) -> str:
        """Start a ramp of the figures to these factors; return "" or the rejection.

        Figures that are not named keep their factors.
        """
        fault = _fault(rope, factors, ramp_s, cut)
        if fault:
            kind = "impossible"
            if not np.isfinite((*factors.values(), ramp_s)).all():
                kind = "non_finite"
            return self.counter.refuse(kind, phrase("figures", *fault))
        self._before = np.array(list(self.at(now_ns).values()))
        self._target = self._before.copy()
        for name, value in factors.items():
            self._target[FIGURES.index(name)] = value
        self.active = True
        self.begin_ns, self.ramp_ns = now_ns, round(ramp_s * 1e9)
        self.counter.accept(now_ns)
        changed = ", ".join(f"{name} {value:.4g}" for name, value in factors.items())
        self.counter.set_note(
            f"learned figures are taken over from {now_ns * 1e-9:.2f} s in {ramp_s:g} s, as "
            f"factors on the scene's: {changed}"
        )
        return ""

    def at(self, now_ns: int) -> dict[str, float]:
        """Return the factors at a time, by the names of FIGURES; 1: the scene's value."""
        elapsed_ns = max(now_ns - self.begin_ns, 0) // UPDATE_NS * UPDATE_NS
        fraction = elapsed_ns / self.ramp_ns if elapsed_ns < self.ramp_ns else 1.0
        factors = self._before + fraction * (self._target - self._before)
        return dict(zip(FIGURES, factors.tolist(), strict=True))

    def steps_before(self, now_ns: int, step_ns: int, steps: int) -> int:
        """Return the number of steps before the next update, at most `steps`."""
        since_ns = now_ns - self.begin_ns
        if not self.active or since_ns > self.ramp_ns + UPDATE_NS:
            return steps
        left_ns = UPDATE_NS - since_ns % UPDATE_NS
        return min(steps, -(-left_ns // step_ns))


def _fault(
    rope: Rope, factors: Mapping[str, float], ramp_s: float, cut: bool
) -> tuple[str, str] | None:
    """Return problem and remedy of factors that are rejected, or None."""
    known = [name for name in figures_of(rope) if name != "current"]
    if cut:
        return "the rope was cut", "figures belong to the whole rope"
    if not factors:
        return "no figure is given", f"give one of {', '.join(known)}"
    if not 0.0 <= ramp_s <= MAX_RAMP_S:
        return f"a ramp of {ramp_s:g} s", f"give 0 to {MAX_RAMP_S:g} s"
    for name, value in factors.items():
        if name not in known:
            return f"the scene has no figure '{name}'", f"known: {', '.join(known)}"
        if not 1.0 / MAX_FACTOR <= value <= MAX_FACTOR:
            remedy = f"give {1.0 / MAX_FACTOR:g} to {MAX_FACTOR:g} times the scene's value"
            return f"{name} of {value:g} times the scene's", remedy
    return None


class FigureBase:
    """Scene's own figures of a rope, and the factors in use."""

    def __init__(self, rope: Rope) -> None:
        """Store the properties that factors apply to."""
        self._sections = rope.sections.copy()
        self._law = copied_law(rope.law)
        self._effects = rope.effects
        self._used: dict[str, float] = {}
        self._seen: tuple[Any, ...] = ()  # effects with these factors
        self._scaled, self._scaled_law = self._sections, self._law  # sections and law with them

    def apply(
        self, factors: Mapping[str, float], rope: Rope, effects: tuple[Any, ...]
    ) -> tuple[Any, ...]:
        """Set factors in the rope's sections and axial law, in place; return the effects with them.

        rope: the present one; effects: those in use, whose internal variables and current are kept.
        """
        used = dict(factors)
        # not after a return to an earlier state
        unchanged = np.array_equal(rope.sections, self._scaled)
        if isinstance(rope.law, Table):
            unchanged = unchanged and np.array_equal(rope.law.tension, self._scaled_law.tension)
        if used == self._used and effects is self._seen and unchanged:
            return effects
        rope.sections[:] = self._scaled = scaled_sections(self._sections, factors)
        self._scaled_law = scaled_law(self._law, factors["axial_stiffness"])
        if isinstance(rope.law, Table):
            for array, scaled in zip(rope.law, self._scaled_law, strict=True):
                array[:] = scaled
        updated = scaled_fields(self._effects, effects, factors)
        self._used, self._seen = used, updated
        return updated
