"""Figures: factors on properties of a rope and its payload, of fleets and of a running twin.

A figure is a number of the model that a measurement can correct: the payload's submerged weight,
its mass with the added mass, its drag, the rope's axial stiffness, damping and tangential drag, the
strength of the current. A factor scales the fields of the kernel data that the figure stands for;
nothing else of the scene follows from it, neither the tolerance of the step nor a damping that the
scene gives as a fraction of the critical one.

A run takes over learned figures by a ramp. A rope whose weight or stiffness jumps rings at its own
period, so factors on the scene's figures are led over linearly in time, in stairs of UPDATE_NS from
the instant at which they were accepted: a replay or a resumed run repeats them to the bit, however
its steps are divided. The current has a topic of its own and is not taken over.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body.state import RigidBody
from rope_twin.core.state import Floats, Rope, Table
from rope_twin.effects.current import Current, CurrentInTime, RisingCurrent, RisingCurrentInTime
from rope_twin.effects.drag import CurrentDrag, Drag, ReynoldsDrag
from rope_twin.effects.payload import Payload, SplashZone, TwoWayPayload
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
    SplashZone: {"payload_drag": ("k",)},  # of which it takes off what is in the air
    Drag: {"tangential_drag": ("kt",)},
    OscillatingDrag: {"tangential_drag": ("kt",)},
    Current: _CURRENT,
    RisingCurrent: _CURRENT,
}
# Weight and buoyancy of a body are scaled alike; its mass follows by the added mass along z.
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
MOST_FACTOR = 5.0  # and its inverse: beyond it is another lift
MOST_RAMP_S = 3600.0
UPDATE_NS = 100_000_000
RAMP_S = 20.0  # about two periods of a rope that rings at 10 s


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
            raise InputError("figures", f"'{name}' is none", did_you_mean(name, FIGURES))
        if name not in known:
            right = f"this scene has {', '.join(known)}"
            raise InputError(f"figures: {name}", "the scene has no such number", right)
        factor = np.asarray(value, dtype=float)
        if factor.ndim > 1 or factor.size not in (1, members):
            what = f"{factor.size} factors for {members} members"
            raise InputError(f"figures: {name}", what, "give one, or one for each")
        wrong = factor[~(np.isfinite(factor) & (factor > 0.0))] if factor.ndim else factor
        if not (np.isfinite(factor) & (factor > 0.0)).all():
            what = f"a factor of {float(np.ravel(wrong)[0]):g}"
            right = "give positive numbers, 1.0 for the scene's own value"
            raise InputError(f"figures: {name}", what, right)
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
    sections = scaled_sections(rope.sections, factors)
    law = scaled_law(rope.law, factors["axial_stiffness"])
    pairs = zip(rope.effects, effects, strict=True)
    made = [with_arrays_of(own, _scaled(base, factors, np.multiply)) for base, own in pairs]
    return rope._replace(sections=sections, law=law, effects=tuple(made))


def _scaled(effect: Any, factors: Mapping[str, Any], times: Any) -> Any:
    """Return kernel data with the figures' fields scaled: times(factor, field)."""
    inside = _INSIDE.get(type(effect))
    if inside is not None:
        inner = _scaled(getattr(effect, inside), factors, times)
        return effect._replace(**{inside: inner})
    changed = {}
    for figure, names in _fields_of(effect).items():
        for name in names:
            changed[name] = _times(factors[figure], getattr(effect, name), times)
    if isinstance(effect, RigidBody):
        changed["added"] = effect.added.copy()
        moved_kg = effect.hook + effect.m + effect.added[2]
        changed["added"][2] += (factors["oscillating_mass"] - 1.0) * moved_kg
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
        fields = _fields_of(own)
        names = [name for figure in fields if figure != "current" for name in fields[figure]]
        scaled = _scaled(first, factors, np.multiply) if names else first
        made.append(own._replace(**{name: getattr(scaled, name) for name in names}))
    return tuple(made)


class LearnedFigures:
    """Factors on the scene's figures: before the ramp, after it, and its times."""

    def __init__(self) -> None:
        """Begin with the scene's own figures."""
        self.counter = InputCounter("figures")
        self.active = False
        self._before, self._target = np.ones(len(FIGURES)), np.ones(len(FIGURES))
        self.begin_ns = 0
        self.ramp_ns = 0

    def offer(
        self, rope: Rope, factors: Mapping[str, float], ramp_s: float, now_ns: int, cut: bool
    ) -> str:
        """Lead the figures over to factors from now on; return "" or the rejection.

        Figures that are not named keep what they have.
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
        self.counter.say(
            f"learned figures are taken over from {now_ns * 1e-9:.2f} s in {ramp_s:g} s, as "
            f"factors on the scene's: {changed}"
        )
        return ""

    def at(self, now_ns: int) -> dict[str, float]:
        """Return the factors at a time, by the names of FIGURES; 1: the scene's value."""
        stair_ns = max(now_ns - self.begin_ns, 0) // UPDATE_NS * UPDATE_NS
        share = stair_ns / self.ramp_ns if stair_ns < self.ramp_ns else 1.0
        now = self._before + share * (self._target - self._before)
        return dict(zip(FIGURES, now.tolist(), strict=True))

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
    """Return fault and remedy of factors that cannot be taken over, or None."""
    known = [name for name in figures_of(rope) if name != "current"]
    if cut:
        return "the rope was cut", "figures belong to the whole rope"
    if not factors:
        return "no figure is given", f"give one of {', '.join(known)}"
    if not 0.0 <= ramp_s <= MOST_RAMP_S:
        return f"a ramp of {ramp_s:g} s", f"give 0 to {MOST_RAMP_S:g} s"
    for name, value in factors.items():
        if name not in known:
            return f"the scene has no figure '{name}'", f"known: {', '.join(known)}"
        if not 1.0 / MOST_FACTOR <= value <= MOST_FACTOR:
            right = f"give {1.0 / MOST_FACTOR:g} to {MOST_FACTOR:g} times the scene's value"
            return f"{name} of {value:g} times the scene's", right
    return None


class FigureBase:
    """The scene's own figures of a rope, and the factors that are in use."""

    def __init__(self, rope: Rope) -> None:
        """Keep what factors apply to."""
        self._sections = rope.sections.copy()
        self._law = copied_law(rope.law)
        self._effects = rope.effects
        self._used: dict[str, float] = {}
        self._seen: tuple[Any, ...] = ()  # effects that have these factors
        self._scaled, self._scaled_law = self._sections, self._law  # sections and law with them

    def apply(
        self, factors: Mapping[str, float], rope: Rope, effects: tuple[Any, ...]
    ) -> tuple[Any, ...]:
        """Set factors in the rope's sections and axial law, in place; return the effects with them.

        rope: the present one; effects: those in use, whose memory and current are kept.
        """
        used = dict(factors)
        same = np.array_equal(rope.sections, self._scaled)  # not after a return to an earlier state
        if isinstance(rope.law, Table):
            same = same and np.array_equal(rope.law.tension, self._scaled_law.tension)
        if used == self._used and effects is self._seen and same:
            return effects
        rope.sections[:] = self._scaled = scaled_sections(self._sections, factors)
        self._scaled_law = scaled_law(self._law, factors["axial_stiffness"])
        if isinstance(rope.law, Table):
            for mine, scaled in zip(rope.law, self._scaled_law, strict=True):
                mine[:] = scaled
        made = scaled_fields(self._effects, effects, factors)
        self._used, self._seen = used, made
        return made
