"""Internal variables of effects (core/loads/memory) when a rope is copied or gets other nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from rope_twin.core.loads.memory import numbers_carried
from rope_twin.core.state import Floats


def has_state(effect: Any) -> bool:
    """Return whether an effect has internal variables, so that two ropes cannot share it."""
    return numbers_carried(type(effect)) > 0


def own_copies(effects: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the effects; those with internal variables get copies of all their arrays."""
    return tuple(_copy(own) if has_state(own) else own for own in effects)


def state_arrays(effects: tuple[Any, ...]) -> list[Floats]:
    """Return all arrays of the effects with internal variables, not copied."""
    return [part for own in effects if has_state(own) for part in own if _is_array(part)]


def on_nodes(
    effects: tuple[Any, ...], s: Floats, capacity: int, start_m: float = 0.0
) -> tuple[Any, ...]:
    """Return the effects for other nodes of their rope, or of a part of it.

    Current values are interpolated over the rope's material; further rows are those of the nearest
    node.

    Args:
        effects: of the rope with its old nodes.
        s: coordinates of the new nodes that carry loads in the old rope [m], (nodes,).
        capacity: of the new rope's arrays, in nodes.
        start_m: coordinate of the new rope's lower end in the old rope [m].
    """
    return tuple(
        own._replace(memory=_memory_of(own, s, capacity, start_m)) if has_state(own) else own
        for own in own_copies(effects)
    )


def _copy(effect: Any) -> Any:
    arrays = {name: part.copy() for name, part in effect._asdict().items() if _is_array(part)}
    return effect._replace(**arrays)


def _is_array(part: Any) -> bool:
    return isinstance(part, np.ndarray)


def _memory_of(effect: Any, s: Floats, capacity: int, start_m: float) -> Floats:
    memory, k = effect.memory, numbers_carried(type(effect))
    old, n = int(memory[3 * k, -1]), len(s)
    marks = memory[3 * k, :old]
    new: Floats = np.zeros((memory.shape[0], capacity + 1))
    if old == 0:  # the first step will give the values
        return new
    for r in range(k):
        new[r, :n] = np.interp(s, marks, memory[r, :old])
        new[r, n:] = new[r, n - 1]  # of ghost nodes, and of a node where an element splits
    nearest = np.abs(s[:, None] - marks).argmin(axis=1)
    new[3 * k + 1 :, :n] = memory[3 * k + 1 :, nearest]
    new[3 * k + 1 :, -1] = memory[3 * k + 1 :, -1]  # what an effect has once for the rope
    new[3 * k, :n], new[3 * k, -1] = s - start_m, n
    return new
