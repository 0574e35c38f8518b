"""Components: loads on a rigid body besides slings, weight and drag, compiled only where present.

A component is a NamedTuple among a body's `parts`; its file registers kernels by `@part(hook,
Type)`:

- `act(part, body, q, pose)`: force and moment about G in body axes and the sum of the magnitudes;
  it subtracts q times their derivatives from the matrix (core/body/change.py). pose: position, R,
  velocity, angular velocity.
- `foresee(part, body, rope, stage, pose)`: called before a stage is solved, at its predicted pose.
- `keep(part, body, record)`: called with the record that a converged substep is written to.
- `floor(part, body, place)`: the height at which the body's corners there would touch it.
- `power(part, body, pose)`, plain Python: power into the body [W]; pose: of core/body/energy.py.

The types select the code while numba compiles (like effects, core/loads/hooks.py): an absent
component leaves no code.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from rope_twin.core.body.rotation import along
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.loads.hooks import written_out

_KERNELS: dict[str, dict[type, Any]] = {
    "act": {}, "foresee": {}, "keep": {}, "floor": {}, "power": {},
}  # fmt: skip


def part(hook: str, *kinds: type) -> Callable[[Any], Any]:
    """Register a kernel of component types for a hook.

    Raises:
        ValueError: unknown hook.
    """
    if hook not in _KERNELS:
        raise ValueError(f"unknown hook '{hook}' of a body component; known: {', '.join(_KERNELS)}")

    def register(function: Any) -> Any:
        made = function if hook == "power" else jit(function)
        _KERNELS[hook].update(dict.fromkeys(kinds, made))
        return made

    return register


def power_of(body: Any, pose: Any) -> float:
    """Return the power of all components into a body [W]."""
    known = _KERNELS["power"]
    members = [(one, known[type(one)]) for one in body.parts if type(one) in known]
    return float(sum(call(one, body, pose) for one, call in members))


def part_of(body: Any, *kinds: type) -> Any:
    """Return the body's component of one of these types, or None."""
    return next((one for one in body.parts if isinstance(one, kinds)), None)


def _members(hook: str, parts: Any) -> list[tuple[Any, Any]]:
    known = _KERNELS[hook]
    return [(one, known[type(one)]) for one in parts if type(one) in known]


def _calls(hook: str, parts: Any) -> dict[int, Any]:
    known = _KERNELS[hook]
    found = {i: known.get(one.instance_class) for i, one in enumerate(parts)}
    return {i: call for i, call in found.items() if call is not None}


def act_all(parts: Any, body: Any, q: Any, pose: Any, found: Any) -> Any:
    """Return the sum of `found` (force, moment, magnitude) and the loads of all components."""
    for one, call in _members("act", parts):
        found = _sum(found, call(one, body, q, pose))
    return found


@overload(act_all, jit_options=LINKED, strict=False)
def _compose_act(parts: Any, body: Any, q: Any, pose: Any, found: Any) -> Any:
    calls = _calls("act", parts)
    lines = [f"found = add(found, kernel_{i}(parts[{i}], body, q, pose))" for i in calls]
    return written_out("parts, body, q, pose, found", [*lines, "return found"], calls, add=_sum)


def foresee_all(parts: Any, body: Any, rope: Any, stage: Any, pose: Any) -> Any:
    """Call `foresee` of all components at the beginning of a stage."""
    for one, call in _members("foresee", parts):
        call(one, body, rope, stage, pose)


@overload(foresee_all, jit_options=LINKED, strict=False)
def _compose_foresee(parts: Any, body: Any, rope: Any, stage: Any, pose: Any) -> Any:
    calls = _calls("foresee", parts)
    lines = [f"kernel_{i}(parts[{i}], body, rope, stage, pose)" for i in calls]
    return written_out("parts, body, rope, stage, pose", [*lines, "return None"], calls)


def keep_all(parts: Any, body: Any, record: Any) -> Any:
    """Call `keep` of all components at the end of a substep."""
    for one, call in _members("keep", parts):
        call(one, body, record)


@overload(keep_all, jit_options=LINKED, strict=False)
def _compose_keep(parts: Any, body: Any, record: Any) -> Any:
    calls = _calls("keep", parts)
    lines = [f"kernel_{i}(parts[{i}], body, record)" for i in calls]
    return written_out("parts, body, record", [*lines, "return None"], calls)


def highest_floor(parts: Any, body: Any, place: Any, least: Any) -> Any:
    """Return the highest floor of all components, at least `least`."""
    for one, call in _members("floor", parts):
        least = max(least, call(one, body, place))
    return least


@overload(highest_floor, jit_options=LINKED, strict=False)
def _compose_floor(parts: Any, body: Any, place: Any, least: Any) -> Any:
    calls = _calls("floor", parts)
    lines = [f"least = max(least, kernel_{i}(parts[{i}], body, place))" for i in calls]
    return written_out("parts, body, place, least", [*lines, "return least"], calls)


@jit
def _sum(a: Any, b: Any) -> Any:
    return along(a[0], 1.0, b[0]), along(a[1], 1.0, b[1]), a[2] + b[2]
