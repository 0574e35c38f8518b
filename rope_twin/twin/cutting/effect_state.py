"""Internal variables of effects (core/solve/remembering) for a rope in two parts.

Each part has its own arrays, so that neither changes the state of the other. Nodes keep their
values; the node inserted at the cut takes values between those of its neighbours, as where an
element splits.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rope_twin.core.acting.hooks import hooks_of
from rope_twin.core.solve.remembering import numbers_carried
from rope_twin.core.state import Floats
from rope_twin.core.vortices.drag_growth import GROWTH, DragGrowth


def has_state(effect: Any) -> bool:
    """Return whether an effect has internal variables, so that two ropes cannot share it."""
    return numbers_carried(type(effect)) > 0


def of_part(effects: tuple[Any, ...], s: Floats, lost_m: float, spare: int) -> tuple[Any, ...]:
    """Return the effects for a part of their rope.

    Args:
        effects: of the whole rope, or the same without the load at its lower end.
        s: coordinates of the part's free nodes in the whole rope [m], (nodes,).
        lost_m: start of the part above the whole rope's lower end [m].
        spare: additional capacity in nodes.
    """
    return tuple(
        own._replace(memory=_memory_of(own, s, lost_m, spare)) if has_state(own) else own
        for own in own_copies(effects)
    )


def is_viv_model(effect: Any) -> bool:
    """Return whether an effect is a VIV model at the nodes inside the step."""
    at_nodes = has_state(effect) and "load_nodes" in hooks_of(type(effect))
    return at_nodes and not isinstance(effect, DragGrowth)


def reset_drag_amplification(effects: tuple[Any, ...]) -> tuple[Any, ...]:
    """Reset the drag amplification of a falling part: slack rope has no modes."""
    for own in effects:
        if isinstance(own, DragGrowth):
            own.memory[GROWTH] = 0.0
    return effects


def own_copies(effects: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the effects; those with internal variables get copies of all their arrays."""
    return tuple(_copy(own) if has_state(own) else own for own in effects)


def state_arrays(effects: tuple[Any, ...]) -> list[Floats]:
    """Return all arrays of the effects with internal variables, not copied."""
    return [part for own in effects if has_state(own) for part in own if _is_array(part)]


def _copy(effect: Any) -> Any:
    arrays = {name: part.copy() for name, part in effect._asdict().items() if _is_array(part)}
    return effect._replace(**arrays)


def _is_array(part: Any) -> bool:
    return isinstance(part, np.ndarray)


def _memory_of(effect: Any, s: Floats, lost_m: float, spare: int) -> Floats:
    """Return memory for these nodes: values interpolated, other rows as at the nearest node."""
    memory, k = effect.memory, numbers_carried(type(effect))
    old, n = int(memory[3 * k, -1]), len(s)
    marks = memory[3 * k, :old]
    new: Floats = np.zeros((memory.shape[0], memory.shape[1] + spare))
    for r in range(k):
        new[r, :n] = np.interp(s, marks, memory[r, :old])
    nearest = np.abs(s[:, None] - marks).argmin(axis=1)
    new[3 * k + 1 :, :n] = memory[3 * k + 1 :, nearest]
    new[3 * k, :n], new[3 * k, -1] = s - lost_m, n
    return new
