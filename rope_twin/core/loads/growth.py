"""Factors of time on the forces of the water, where a scene lists a ramp (effects/fluid_ramp.py).

An effect declares the coefficients that its force is proportional to (`grows`), and which of the
three factors applies to them. Where a ramp is among the effects, a kernel is called with a copy of
its effect whose coefficients are multiplied by the factor at the stage's time: inertia, added mass,
weight and buoyancy in the same kernel are not. The copy is written out while numba compiles, like
the loop over the effects; without a ramp the code is that of the effects as they are.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED, jit_entry
from rope_twin.core.loads.hooks import kernel_of, kernels_by_place, members, written_out

WATER, VORTICES, FAIRINGS = range(3)
FACTORS = ("water", "vortices", "fairings")
_GROWING: dict[type, tuple[int, tuple[str, ...]]] = {}


def grows(kind: type, *names: str, factor: int = WATER) -> None:
    """Declare the fields of an effect's type that its force is proportional to.

    A field is a number, a tuple of numbers, or the data of another declared type.

    Raises:
        ValueError: there is no such field, or the type has been declared.
    """
    fields = getattr(kind, "_fields", ())
    if kind in _GROWING or not set(names) <= set(fields):
        raise ValueError(f"{kind.__name__}: {', '.join(names)} cannot be declared as growing")
    _GROWING[kind] = factor, names


def factors_at(effects: tuple[Any, ...], time_s: float) -> tuple[float, ...]:
    """Return the three factors at a time; () where no ramp is among the effects."""
    ramps = tuple(ramp for ramp, _ in members("share", effects))
    if not ramps:
        return ()
    return tuple(float(_factor_at(ramps, time_s, factor)) for factor in range(len(FACTORS)))


def _share_of(ramps: Any, time_s: float, factor: int) -> Any:
    """Return a factor of the first of these ramps."""
    ramp, call = members("share", ramps)[0]
    return call(ramp, time_s, factor)


@overload(_share_of, jit_options=LINKED, strict=False)
def _compose_share(ramps: Any, time_s: float, factor: int) -> Any:
    calls = kernels_by_place("share", ramps)
    return written_out(
        "ramps, time_s, factor", ["return kernel_0(ramps[0], time_s, factor)"], calls
    )


@jit_entry
def _factor_at(ramps: Any, time_s: float, factor: int) -> Any:
    """Compiled entry point of `_share_of`, to be called from Python."""
    return _share_of(ramps, time_s, factor)


def grown(effects: Any, time_s: float) -> Any:
    """Return the effects with their coefficients at a time (plain Python)."""
    factors = factors_at(effects, time_s)
    if not factors:
        return effects
    return tuple(
        _times(effect, factors[_GROWING[type(effect)][0]]) if type(effect) in _GROWING else effect
        for effect in effects
    )


def _times(value: Any, share: float) -> Any:
    """Return a coefficient, or the data of an effect, times a factor."""
    if type(value) in _GROWING:
        names = _GROWING[type(value)][1]
        return value._replace(**{name: _times(getattr(value, name), share) for name in names})
    if isinstance(value, tuple):
        return tuple(_times(one, share) for one in value)
    return share * value


class Growth:
    """Source text of the effects at a stage's time, for functions that are written out."""

    def __init__(self, effects: Any) -> None:
        """Take the numba types of the effects."""
        self._effects = effects
        self.names: dict[str, Any] = {}  # what the text refers to
        self.lines: list[str] = []  # they come first
        ramps = kernels_by_place("share", effects)
        kinds = [effect.instance_class for effect in effects]
        for i in ramps:
            self.names["share_of"] = kernel_of("share", kinds[i])
            for factor in sorted({_GROWING[kind][0] for kind in kinds if kind in _GROWING}):
                call = f"share_of(effects[{i}], stage.time, {factor})"
                self.lines.append(f"share_{factor} = {call}")

    def of(self, i: int) -> str:
        """Return the text of effect i."""
        return self._text(self._effects[i], f"effects[{i}]") if self.lines else f"effects[{i}]"

    def _text(self, effect: Any, path: str) -> str:
        kind = effect.instance_class
        if kind not in _GROWING:
            return path
        factor, names = _GROWING[kind]
        self.names[kind.__name__] = kind
        parts = []
        for name, own in zip(effect.fields, effect.types, strict=True):
            at = f"{path}.{name}"
            if name not in names:
                parts.append(at)
            elif isinstance(own, types.BaseNamedTuple):
                parts.append(self._text(own, at))
            elif isinstance(own, types.UniTuple):
                times = ", ".join(f"share_{factor} * {at}[{k}]" for k in range(own.count))
                parts.append(f"({times},)")
            else:
                parts.append(f"share_{factor} * {at}")
        return f"{kind.__name__}({', '.join(parts)})"
