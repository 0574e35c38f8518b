"""Motion of the middle of the payload: that of the lower end, unless an effect says otherwise."""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED, compiled, jit_entry
from rope_twin.core.jit.functions import flush, restore
from rope_twin.core.jit.wide import WideType
from rope_twin.core.loads.hooks import kernels, kernels_by_place, members, written_out


def payload_middle(effects: Any, height: Any, speed: Any) -> Any:
    """Return height [m] and vertical velocity [m/s] of the payload's middle, in lanes or of one.

    height, speed: of the lower end.
    """
    for effect, call in members("middle", effects):
        height, speed = call(effect, height, speed)
    return height, speed


@overload(payload_middle, jit_options=LINKED, strict=False)
def _compose_middle(effects: Any, height: Any, speed: Any) -> Any:
    if isinstance(height, WideType):
        calls = kernels("middle", effects, None)
    else:
        calls = kernels_by_place("middle", effects)
    lines = [f"height, speed = kernel_{i}(effects[{i}], height, speed)" for i in calls]
    return written_out("effects, height, speed", [*lines, "return height, speed"], calls)


@jit_entry
def _middle_of_one(effects: Any, height: float, speed: float) -> Any:
    was = flush()
    found = payload_middle(effects, height, speed)
    restore(was)
    return found


_COMPILED: dict[tuple[type, ...], Any] = {}


def lone_middle(effects: tuple[Any, ...], height: float, speed: float) -> tuple[float, float]:
    """Return `payload_middle` of one rope by compiled code, so with the bits of a lane."""
    own = tuple(effect for effect, _ in members("middle", effects))
    if not own:
        return height, speed
    kinds = tuple(map(type, own))
    found = _COMPILED.get(kinds)
    if found is None:
        found = _COMPILED[kinds] = compiled(_middle_of_one, (own, height, speed))
    there, rate = found(own, height, speed)
    return float(there), float(rate)
