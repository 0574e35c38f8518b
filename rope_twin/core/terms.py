"""Hooks: where effects join the step, composed at compile time.

An effect is a NamedTuple of its own arrays and numbers. Its file registers kernels with
`@kernel(hook, Type)`. The *types* in the scene's tuple of effects pick the code: the walk over the
tuple is unrolled while numba compiles, so an absent effect leaves no code and no branch behind.
Plain Python (NUMBA_DISABLE_JIT=1) walks the same tuple with a loop.

Every hook is called as `hook(effects, model, work, stage, low, high)` for the nodes
low <= i < high and adds to the arrays in `work`:

- `add_flow`: water velocity to the rows FLOW, at the stage's predicted positions;
- `add_load`: forces and inertia to the residual RESIDUAL, and minus their derivative to the
  acceleration (q·d/dv + p·d/dx + d/da) to the symmetric blocks BLOCK.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from rope_twin.core.jit import OPTIONS, jit

HOOKS = ("add_flow", "add_load")
_KERNELS: dict[str, dict[type, Any]] = {hook: {} for hook in HOOKS}


def kernel(hook: str, effect: type) -> Callable[[Any], Any]:
    """Register a kernel of an effect's type for a hook.

    Raises:
        ValueError: unknown hook, or a second kernel of this type for it.
    """
    if hook not in _KERNELS:
        raise ValueError(f"unknown hook '{hook}'; known: {', '.join(HOOKS)}")
    if effect in _KERNELS[hook]:
        raise ValueError(f"{effect.__name__} has a kernel for '{hook}' already")

    def register(function: Any) -> Any:
        compiled = jit(function)
        _KERNELS[hook][effect] = compiled
        return compiled

    return register


def hooks_of(effect: type) -> tuple[str, ...]:
    """The hooks that an effect's type takes part in."""
    return tuple(hook for hook in HOOKS if effect in _KERNELS[hook])


def _walker(hook: str) -> Any:
    """The function that calls every effect's kernel for a hook, in the order of the tuple."""
    kernels = _KERNELS[hook]

    def walk(effects: Any, model: Any, work: Any, stage: Any, low: Any, high: Any) -> Any:
        for effect in effects:  # the plain Python form
            found = kernels.get(type(effect))
            if found is not None:
                found(effect, model, work, stage, low, high)

    def compose(effects: Any, model: Any, work: Any, stage: Any, low: Any, high: Any) -> Any:
        return _unrolled([kernels.get(effect.instance_class) for effect in effects])

    walk.__name__ = walk.__qualname__ = hook
    overload(walk, jit_options=OPTIONS, inline="always")(compose)
    return walk


def _unrolled(calls: list[Any]) -> Any:
    """One call a line for the effects that have a kernel, and nothing for those that have none.

    Written as text because numba compiles a recursive walk as one library per effect, each
    optimised again with all below it (measured: a third more compile time for five effects).
    """
    arguments = "effects: Any, model: Any, work: Any, stage: Any, low: Any, high: Any"
    lines = [
        f"    kernel_{i}(effects[{i}], model, work, stage, low, high)"
        for i, call in enumerate(calls)
        if call is not None
    ]
    scope = {f"kernel_{i}": call for i, call in enumerate(calls) if call is not None}
    exec("\n".join([f"def unrolled({arguments}) -> Any:", *lines, "    return None"]), scope)
    return scope["unrolled"]


add_flow = _walker("add_flow")
add_load = _walker("add_load")
