"""Terms: contributions of effects to the step besides their loads, composed at compile time.

Each loop over the effects (core/acting/hooks.py) is unrolled while numba compiles: an absent effect
leaves no code.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from numba.extending import overload

from rope_twin.core.acting.hooks import (
    couples,
    kernels,
    may_be_calm,
    members,
    switches,
    written_out,
)
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.state import BLOCK, LINK, PULL, PULL_X, RESIDUAL


def add_flow(effects: Any, work: Any, stage: Any, low: Any, high: Any) -> Any:
    """Add every effect's water velocity for the nodes low <= i < high."""
    for effect, call in members("flow", effects):
        call(effect, work, stage, low, high)


@overload(add_flow, jit_options=LINKED, strict=False)
def _compose_flow(effects: Any, work: Any, stage: Any, low: Any, high: Any) -> Any:
    calls = kernels("flow", effects, work)
    lines = [f"kernel_{i}(effects[{i}], work, stage, low, high)" for i in calls]
    return written_out("effects, work, stage, low, high", [*lines, "return None"], calls)


def add_end(effects: Any, work: Any, stage: Any) -> Any:
    """Add every effect's load at the lower end."""
    for effect, call in members("load_end", effects):
        call(effect, work, stage)


@overload(add_end, jit_options=LINKED, strict=False)
def _compose_end(effects: Any, work: Any, stage: Any) -> Any:
    calls = kernels("load_end", effects, work)
    lines = [f"kernel_{i}(effects[{i}], work, stage)" for i in calls]
    return written_out("effects, work, stage", [*lines, "return None"], calls)


@jit
def _clear_links(work: Any, n: int) -> None:
    """Clear the couplings, and residual and block of the hang-off's node, which loads leave out."""
    for i in range(n + 1):
        work[LINK, i] = work[LINK + 1, i] = 0.0
    for k in range(3):
        work[RESIDUAL + k, n] = 0.0
    for k in range(6):
        work[BLOCK + k, n] = 0.0


def add_couplings(effects: Any, work: Any, stage: Any, n: Any) -> Any:
    """Add every effect's forces between nodes that are not next neighbours."""
    if couples(map(type, effects)):
        _clear_links(work, n)
    for effect, call in members("couple", effects):
        call(effect, work, stage, n)


@overload(add_couplings, jit_options=LINKED, strict=False)
def _compose_couplings(effects: Any, work: Any, stage: Any, n: Any) -> Any:
    calls = kernels("couple", effects, work)
    lines = [f"kernel_{i}(effects[{i}], work, stage, n)" for i in calls]
    lines = ["clear(work, n)", *lines] if calls else []
    return written_out(
        "effects, work, stage, n", [*lines, "return None"], calls, clear=_clear_links
    )


@jit
def _add_to_pull(force: Any, pull: Any, row: int) -> None:
    """Add a force on the hang-off to the tension of step `row`."""
    square = 0.0
    for k in range(3):
        pull[row, PULL_X + k] += force[k]
        square += pull[row, PULL_X + k] ** 2
    pull[row, PULL] = sqrt(square)


def add_pull(effects: Any, work: Any, n: Any, pull: Any, row: Any) -> Any:
    """Add the contribution of coupling effects to the rope's force on the hang-off."""
    for effect, call in members("pull", effects):
        _add_to_pull(call(effect, work, n), pull, row)


@overload(add_pull, jit_options=LINKED, strict=False)
def _compose_pull(effects: Any, work: Any, n: Any, pull: Any, row: Any) -> Any:
    calls = kernels("pull", effects, work)
    lines = [f"add(kernel_{i}(effects[{i}], work, n), pull, row)" for i in calls]
    lines.append("return None")
    return written_out("effects, work, n, pull, row", lines, calls, add=_add_to_pull)


def is_calm(effects: Any, work: Any, stage: Any, n: Any, share: Any) -> Any:
    """Return whether no active set differs between the present motion and that with share·delta."""
    if not may_be_calm(map(type, effects)):
        return False
    return all(call(own, work, stage, n, share) for own, call in members("calm", effects))


@overload(is_calm, jit_options=LINKED, strict=False)
def _compose_calm(effects: Any, work: Any, stage: Any, n: Any, share: Any) -> Any:
    kinds = [effect.instance_class for effect in effects]
    if not switches(kinds):
        return lambda effects, work, stage, n, share: True
    if not may_be_calm(kinds):
        return lambda effects, work, stage, n, share: False
    calls = kernels("calm", effects, work)
    lines = [f"if not kernel_{i}(effects[{i}], work, stage, n, share): return False" for i in calls]
    return written_out("effects, work, stage, n, share", [*lines, "return True"], calls)
