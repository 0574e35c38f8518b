"""Hooks: where effects join the step, and who has a kernel for which.

An effect is a NamedTuple of its own arrays and numbers. Its file registers kernels with
`@kernel(hook, Type)`. The *types* in the scene's tuple of effects pick the code: the walk over the
tuple is written out while numba compiles (core/acting/terms.py, core/acting/loads.py), so an absent
effect leaves no code and no branch behind. Plain Python (NUMBA_DISABLE_JIT=1) walks the same tuple
with a loop.

- `flow(effect, work, stage, low, high)` adds water velocity to the rows FLOW of the nodes
  low <= i < high, at the stage's predicted positions; one of them may set FLOW_RATE.
- `load(effect, node, stage)` returns a Load: what the effect adds to one node. All effects' loads
  are summed in one loop over the nodes, in registers: one pass over memory however many there are.
- `load_end(effect, work, stage)` adds to the residual and block of node 0, the lower end.
- `couple(effect, work, stage, n)` adds forces between a node and the next two on either side: to
  the residuals and blocks, and to the rows LINK what the blocks c·I between the nodes have. The
  step then takes an elimination that knows of them.
- `pull(effect, work, n)` returns what such an effect adds to the rope's pull on the hang-off.
- `calm(effect, work, stage, n, share)`, of an effect whose loads come and go (`switching`): whether
  they do neither between the motion that there is and that with share·delta, on the n free nodes.
- `start`, `predict`, `load_nodes` and `settle` are those of effects that remember
  (core/solve/remembering.py).

A kernel whose arithmetic holds for wide numbers too (core/lanes) says so with `wide=True`; a kernel
that branches on what differs from rope to rope has a wide twin, `@wide_kernel(hook, Type)`. Where
one of its effects has neither, a scene's rope is stepped by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from numba import types

from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.state import COUPLED_ROWS, WORK_ROWS

HOOKS = (
    "flow", "load", "load_end", "couple", "pull", "calm", "start", "predict", "load_nodes",
    "settle",
)  # fmt: skip
_KERNELS: dict[str, dict[type, Any]] = {hook: {} for hook in HOOKS}
_SWITCHING: set[type] = set()
_WIDE: dict[str, dict[type, Any]] = {hook: {} for hook in HOOKS}


def kernel(hook: str, effect: type, *, wide: bool = False) -> Callable[[Any], Any]:
    """Register a kernel of an effect's type for a hook; `wide`: it works on wide numbers too.

    Raises:
        ValueError: unknown hook, or a second kernel of this type for it.
    """
    if hook not in _KERNELS:
        raise ValueError(f"unknown hook '{hook}'; known: {', '.join(HOOKS)}")
    if effect in _KERNELS[hook]:
        raise ValueError(f"{effect.__name__} has a kernel for '{hook}' already")

    def register(function: Any) -> Any:
        compiled = jit_within(function) if hook == "load" else jit(function)
        _KERNELS[hook][effect] = compiled
        if wide:
            _WIDE[hook][effect] = compiled
        return compiled

    return register


def switching(effect: type) -> None:
    """Say that an effect's loads come and go: tensions alone tell convergence when it is calm."""
    _SWITCHING.add(effect)


def switches(kinds: Iterable[type]) -> bool:
    """Whether one of these types of effects has loads that come and go."""
    return any(kind in _SWITCHING for kind in kinds)


def may_be_calm(kinds: Iterable[type]) -> bool:
    """Whether all that switches among these types can tell when it does not."""
    return all(kind in _KERNELS["calm"] for kind in kinds if kind in _SWITCHING)


def wide_kernel(hook: str, effect: type) -> Callable[[Any], Any]:
    """Register what takes the place of an effect's kernel where numbers are wide."""

    def register(function: Any) -> Any:
        _WIDE[hook][effect] = jit(function)
        return _WIDE[hook][effect]

    return register


def all_wide(kinds: Iterable[type]) -> bool:
    """Whether ropes with effects of these types can be stepped in lanes."""
    kinds = tuple(kinds)
    wide = all(kind in _WIDE[hook] for kind in kinds for hook in hooks_of(kind))
    return wide and not switches(kinds)


def hooks_of(effect: type) -> tuple[str, ...]:
    """The hooks that an effect's type takes part in."""
    return tuple(hook for hook in HOOKS if effect in _KERNELS[hook])


def couples(kinds: Iterable[type]) -> bool:
    """Whether one of these types of effects couples nodes beyond their neighbours."""
    return any(kind in _KERNELS["couple"] for kind in kinds)


def work_rows(effects: tuple[Any, ...]) -> int:
    """How many rows of scratch the step needs for these effects."""
    return COUPLED_ROWS if couples(map(type, effects)) else WORK_ROWS


def kernel_of(hook: str, effect: type) -> Any:
    """The kernel of an effect's type for a hook, which it has."""
    return _KERNELS[hook][effect]


def kernels_by_place(hook: str, effects: Any) -> dict[int, Any]:
    """The kernels of a hook by the effect's place in the tuple (of numba's types); "": none."""
    known = _KERNELS.get(hook, {})
    found = {i: known.get(effect.instance_class) for i, effect in enumerate(effects)}
    return {i: call for i, call in found.items() if call is not None}


def kernels(hook: str, effects: Any, work: Any) -> dict[int, Any]:
    """The same where `work` is of wide numbers: those for wide numbers."""
    known = (_KERNELS if isinstance(work, types.Array) else _WIDE)[hook]
    found = {i: known.get(effect.instance_class) for i, effect in enumerate(effects)}
    return {i: call for i, call in found.items() if call is not None}


def members(hook: str, effects: Iterable[Any]) -> list[tuple[Any, Any]]:
    """The effects that have a kernel for a hook, each with it (plain Python)."""
    known = _KERNELS[hook]
    return [(effect, known[type(effect)]) for effect in effects if type(effect) in known]


def written_out(head: str, lines: list[str], calls: dict[int, Any], **names: Any) -> Any:
    """The function of these lines, in which kernel_0, kernel_1 ... are the calls.

    Written as text because numba compiles a recursive walk as one library per effect, each
    optimised again with all below it.
    """
    scope = {f"kernel_{i}": call for i, call in calls.items()} | names
    exec("\n    ".join([f"def written_out({head}):", *lines]), scope)
    return scope["written_out"]
