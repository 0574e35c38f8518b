"""Hooks: the points of the step where effects contribute, and the registry of their kernels.

An effect is a NamedTuple of its own arrays and numbers. Its file registers kernels with
`@kernel(hook, Type)`. The *types* in the scene's tuple of effects select the code: the loop over
the tuple is unrolled at compile time (core/loads/balance.py), so that an absent effect has no code
and no branch. Plain Python (NUMBA_DISABLE_JIT=1) loops over the same tuple.

- `flow(effect, work, stage, low, high)` adds water velocity to the rows FLOW of the nodes
  low <= i < high, at the stage's predicted positions; one of them may set FLOW_RATE.
- `submerge(effect, node)` returns the node for the `load` of other effects, with the volume and the
  areas of its submerged part.
- `load(effect, node, stage)` returns a Load: the contribution of the effect to one node. All
  effects' loads are summed in one loop over the nodes, in registers: one pass over memory for any
  number of effects.
- `load_end(effect, work, stage)` adds to the residual and block of node 0, the lower end.
- `couple(effect, work, stage, n)` adds forces between a node and the next two on either side: to
  the residuals and blocks, and the blocks c·I between nodes to the rows LINK. The step then uses
  the block-pentadiagonal solver.
- `pull(effect, work, n)` returns the contribution of such an effect to the rope's force on the
  hang-off.
- `unchanged(effect, work, stage, n, share)`, of an effect with an active set
  (`has_active_set`, e.g. contact): whether it is the same for the present motion and for that with
  share·delta, on the n free nodes.
- `share(effect, time, factor)` returns a factor on forces of the water (`scales_with_ramp`).
- `axial(effect, extension, rate, weights, stiffness, depth)` is the law of the lowest element
  instead of its section's: its force [N], which the element bounds to a pull, and the tangent of it
  with the strain rate included (core/elements.py), where the effect's field `here` is not 0.
- `prepare(effect, rope, stage, kind)`, of such an effect with internal variables: once a stage,
  before the elements of the predicted motion.
- `gather(effect, rope, stack, memory)`, of an effect with internal variables: once a step of a
  multi-line system, copies from the other ropes of `stack` what the effect depends on; memory: its
  internal variables of all ropes, (ropes, rows, nodes + 1).
- `interact(effect, system, stage)` adds forces between the ropes of a system (core/joined) to
  residuals and blocks of their nodes or connections, after the loads of every rope. Connections
  that it couples are those in the effect's field `joints`.
- `middle(effect, height, speed)` returns the height of the payload's middle [m] and its vertical
  velocity [m/s] after the last accepted step, given those of the lower end.
- `start`, `predict`, `load_nodes` and `settle` belong to effects with internal variables
  (core/loads/memory.py).

A kernel whose arithmetic also holds for SIMD vectors (core/lanes) is registered with `wide=True`; a
kernel that branches on values that differ from rope to rope has a SIMD variant, `@wide_kernel(hook,
Type)`, or is called lane by lane (core/lanes/effects). A rope with an effect without any of these
is stepped individually. A SIMD `unchanged` returns the lanes with unchanged active sets as bits.

**Ramps**: time-dependent factors on the hydrodynamic forces, where a scene lists a ramp
(effects/fluid_ramp.py). An effect declares the coefficients that its force is proportional to
(`scales_with_ramp`), and which of the three factors applies to them. With a ramp, a kernel is
called with a copy of its effect whose coefficients are multiplied by the factor at the stage's
time; inertia, added mass, weight and buoyancy in the same kernel are unchanged. The code of the
copy is generated at compile time, like the loop over the effects.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, get_type_hints

from numba import types
from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED, jit, jit_entry, jit_exact, jit_within
from rope_twin.core.state import COUPLED_ROWS, WORK_ROWS


class Load(NamedTuple):
    """Load on a node: force less inertia, and minus its derivative to the acceleration.

    The derivative is q·d/dv + p·d/dx + d/da, as a symmetric block.
    """

    x: float  # [N]
    y: float
    z: float
    xx: float  # [kg]
    xy: float
    xz: float
    yy: float
    yz: float
    zz: float


HOOKS = (
    "flow", "submerge", "load", "load_end", "couple", "pull", "unchanged", "share", "start",
    "predict", "load_nodes", "settle", "axial", "prepare", "gather", "interact", "middle",
)  # fmt: skip
INLINED_HOOKS = ("submerge", "load", "share", "axial")  # inlined into the calling loop
_KERNELS: dict[str, dict[type, Any]] = {hook: {} for hook in HOOKS}
_WITH_ACTIVE_SET: set[type] = set()
_SIMD_KERNELS: dict[str, dict[type, Any]] = {hook: {} for hook in HOOKS}
# indices of the real-number fields, by type of which the numbers may differ between ropes
FIELDS_BY_ROPE: dict[type, list[int]] = {}


def kernel(
    hook: str, effect: type, *, wide: bool = False, exact: bool = False
) -> Callable[[Any], Any]:
    """Register a kernel of an effect's type for a hook; `wide`: it also works on SIMD vectors.

    exact: without contraction of products and sums, as `jit_exact`.

    Raises:
        ValueError: unknown hook, or a second kernel of this type for it.
    """
    if hook not in _KERNELS:
        raise ValueError(f"unknown hook '{hook}'; known: {', '.join(HOOKS)}")
    if effect in _KERNELS[hook]:
        raise ValueError(f"{effect.__name__} already has a kernel for '{hook}'")

    def register(function: Any) -> Any:
        decorator = jit_exact if exact else jit
        compiled = jit_within(function) if hook in INLINED_HOOKS else decorator(function)
        _KERNELS[hook][effect] = compiled
        if wide:
            _SIMD_KERNELS[hook][effect] = compiled
        return compiled

    return register


def has_active_set(effect: type) -> None:
    """Declare that an effect has an active set: convergence requires that it is unchanged."""
    _WITH_ACTIVE_SET.add(effect)


def have_active_sets(kinds: Iterable[type]) -> bool:
    """Return whether one of these types of effects has an active set."""
    return any(kind in _WITH_ACTIVE_SET for kind in kinds)


def can_report_unchanged(kinds: Iterable[type]) -> bool:
    """Return whether all effects of these types with an active set can report it unchanged."""
    return all(kind in _KERNELS["unchanged"] for kind in kinds if kind in _WITH_ACTIVE_SET)


def differs_by_rope(*kinds: type) -> None:
    """Declare that the numbers of these types of effects may differ from rope to rope."""
    for kind in kinds:
        hints = get_type_hints(kind).values()
        FIELDS_BY_ROPE[kind] = [k for k, hint in enumerate(hints) if hint is float]


def wide_kernel(hook: str, effect: type, *, exact: bool = False) -> Callable[[Any], Any]:
    """Register the SIMD variant of an effect's kernel."""

    def register(function: Any) -> Any:
        _SIMD_KERNELS[hook][effect] = (jit_exact if exact else jit)(function)
        return _SIMD_KERNELS[hook][effect]

    return register


def register_wide(hook: str, effect: type, compiled: Any) -> None:
    """Register a compiled kernel as the SIMD variant of an effect's kernel."""
    _SIMD_KERNELS[hook][effect] = compiled


def all_wide(kinds: Iterable[type]) -> bool:
    """Return whether ropes with effects of these types can be stepped as a SIMD batch.

    Not required: `start`, since a batch does not begin at time 0, and `gather`, for single ropes.
    """
    return all(is_wide(kind, "start", "gather") for kind in kinds)


def is_wide(kind: type, *besides: str) -> bool:
    """Return whether all kernels of an effect have SIMD variants; besides: hooks that need none."""
    return all(kind in _SIMD_KERNELS[hook] for hook in set(hooks_of(kind)) - set(besides))


def hooks_of(effect: type) -> tuple[str, ...]:
    """Return the hooks for which an effect's type has a kernel."""
    return tuple(hook for hook in HOOKS if effect in _KERNELS[hook])


def couples(kinds: Iterable[type]) -> bool:
    """Return whether one of these types of effects couples a node beyond its next neighbours."""
    return any(kind in _KERNELS["couple"] for kind in kinds)


def work_rows(effects: tuple[Any, ...]) -> int:
    """Return the number of rows of scratch that the step needs for these effects."""
    return COUPLED_ROWS if couples(map(type, effects)) else WORK_ROWS


def kernel_of(hook: str, effect: type) -> Any:
    """Return the kernel of an effect's type for a hook, which must exist."""
    return _KERNELS[hook][effect]


def kernels_by_index(hook: str, effects: Any) -> dict[int, Any]:
    """Return the kernels of a hook by the effect's index (of numba types); hook "": none."""
    registered = _KERNELS.get(hook, {})
    by_index = {i: registered.get(effect.instance_class) for i, effect in enumerate(effects)}
    return {i: call for i, call in by_index.items() if call is not None}


def kernels(hook: str, effects: Any, work: Any) -> dict[int, Any]:
    """Return the kernels of a hook by the effect's index; SIMD variants for a SIMD `work`."""
    registered = (_KERNELS if isinstance(work, types.Array) else _SIMD_KERNELS)[hook]
    by_index = {i: registered.get(effect.instance_class) for i, effect in enumerate(effects)}
    return {i: call for i, call in by_index.items() if call is not None}


def kernels_at(hook: str, effects: Any, stage: Any) -> dict[int, Any]:
    """Return the kernels of a hook by the effect's index; SIMD variants for a stage of lanes."""
    in_lanes = "lanes" in stage.fields
    return kernels(hook, effects, None) if in_lanes else kernels_by_index(hook, effects)


def axial_index(kinds: Iterable[type]) -> int | None:
    """Return the index of the effect type with a law of the lowest element, or None."""
    return next((i for i, kind in enumerate(kinds) if kind in _KERNELS["axial"]), None)


def with_kernel(hook: str, effects: Iterable[Any]) -> list[tuple[Any, Any]]:
    """Return the effects that have a kernel for a hook, each with its kernel (plain Python)."""
    registered = _KERNELS[hook]
    return [(effect, registered[type(effect)]) for effect in effects if type(effect) in registered]


def selected_by(test: Callable[[Iterable[type]], bool], yes: Any, no: Any) -> Any:
    """Return a function that calls `yes(effects, ...)` or `no(effects, ...)`, by the effect types.

    Both are plain functions with the same argument names; numba compiles the selected one.
    """

    def call(effects: Any, *rest: Any) -> Any:
        return (yes if test(map(type, effects)) else no)(effects, *rest)

    @overload(call, jit_options=LINKED, strict=False)
    def choose(effects: Any, *rest: Any) -> Any:
        return yes if test(effect.instance_class for effect in effects) else no

    return call


def struct_text(
    kind: Any, path: str, scope: dict[str, Any], leaf: Callable[[Any, str], str]
) -> str:
    """Return the source text of a copy of a struct whose numbers and arrays are given by `leaf`.

    kind: numba type of the struct; path: its text; scope: receives the named types.
    """
    if not isinstance(kind, types.BaseTuple):
        return leaf(kind, path)
    if isinstance(kind, types.BaseNamedTuple):
        name = kind.instance_class.__name__
        scope[name] = kind.instance_class
        parts = zip(kind.fields, kind.types, strict=True)
        texts = [struct_text(part, f"{path}.{field}", scope, leaf) for field, part in parts]
        return f"{name}({', '.join(texts)})"
    texts = [struct_text(part, f"{path}[{k}]", scope, leaf) for k, part in enumerate(kind)]
    return f"({''.join(text + ', ' for text in texts)})"


def generated(head: str, lines: list[str], calls: dict[int, Any], **names: Any) -> Any:
    """Return the function compiled from these source lines; `calls` are kernel_0, kernel_1, ...

    The loop is generated as source text, because numba compiles a recursive loop as one library per
    effect, each optimised again with all its callees.
    """
    scope = {f"kernel_{i}": call for i, call in calls.items()} | names
    exec("\n    ".join([f"def generated({head}):", *lines]), scope)
    return scope["generated"]


WATER, VORTICES, FAIRINGS = range(3)
FACTORS = ("water", "vortices", "fairings")
_RAMPED_FIELDS: dict[type, tuple[int, tuple[str, ...]]] = {}


def scales_with_ramp(kind: type, *names: str, factor: int = WATER) -> None:
    """Declare the fields of an effect's type that its force is proportional to.

    A field is a number, a tuple of numbers, or the data of another declared type.

    Raises:
        ValueError: there is no such field, or the type has been declared.
    """
    fields = getattr(kind, "_fields", ())
    if kind in _RAMPED_FIELDS or not set(names) <= set(fields):
        raise ValueError(f"{kind.__name__}: {', '.join(names)} cannot be declared as growing")
    _RAMPED_FIELDS[kind] = factor, names


def factors_at(effects: tuple[Any, ...], time_s: float) -> tuple[float, ...]:
    """Return the three factors at a time; () where no ramp is among the effects."""
    ramps = tuple(ramp for ramp, _ in with_kernel("share", effects))
    if not ramps:
        return ()
    return tuple(float(_factor_at(ramps, time_s, factor)) for factor in range(len(FACTORS)))


def _ramp_factor(ramps: Any, time_s: float, factor: int) -> Any:
    """Return a factor of the first of these ramps."""
    ramp, call = with_kernel("share", ramps)[0]
    return call(ramp, time_s, factor)


@overload(_ramp_factor, jit_options=LINKED, strict=False)
def _compose_ramp_factor(ramps: Any, time_s: float, factor: int) -> Any:
    calls = kernels_by_index("share", ramps)
    return generated("ramps, time_s, factor", ["return kernel_0(ramps[0], time_s, factor)"], calls)


@jit_entry
def _factor_at(ramps: Any, time_s: float, factor: int) -> Any:
    """Compiled entry point of `_share_of`, to be called from Python."""
    return _ramp_factor(ramps, time_s, factor)


def ramped(effects: Any, time_s: float) -> Any:
    """Return the effects with their coefficients at a time (plain Python)."""
    factors = factors_at(effects, time_s)
    if not factors:
        return effects
    return tuple(
        _scaled(effect, factors[_RAMPED_FIELDS[type(effect)][0]])
        if type(effect) in _RAMPED_FIELDS
        else effect
        for effect in effects
    )


def _scaled(value: Any, factor: float) -> Any:
    """Return a coefficient, or the data of an effect, times a factor."""
    if type(value) in _RAMPED_FIELDS:
        names = _RAMPED_FIELDS[type(value)][1]
        return value._replace(**{name: _scaled(getattr(value, name), factor) for name in names})
    if isinstance(value, tuple):
        return tuple(_scaled(item, factor) for item in value)
    return factor * value


class RampedEffects:
    """Source text of the effects at a stage's time, for generated functions."""

    def __init__(self, effects: Any) -> None:
        """Take the numba types of the effects."""
        self._effects = effects
        self.names: dict[str, Any] = {}  # names in the text
        self.lines: list[str] = []  # lines that precede it
        ramps = kernels_by_index("share", effects)
        kinds = [effect.instance_class for effect in effects]
        for i in ramps:
            self.names["share_of"] = kernel_of("share", kinds[i])
            for factor in sorted(
                {_RAMPED_FIELDS[kind][0] for kind in kinds if kind in _RAMPED_FIELDS}
            ):
                call = f"share_of(effects[{i}], stage.time, {factor})"
                self.lines.append(f"share_{factor} = {call}")

    def of(self, i: int) -> str:
        """Return the text of effect i."""
        return self._text(self._effects[i], f"effects[{i}]") if self.lines else f"effects[{i}]"

    def _text(self, effect: Any, path: str) -> str:
        kind = effect.instance_class
        if kind not in _RAMPED_FIELDS:
            return path
        factor, names = _RAMPED_FIELDS[kind]
        self.names[kind.__name__] = kind
        texts = []
        for name, part in zip(effect.fields, effect.types, strict=True):
            field_path = f"{path}.{name}"
            if name not in names:
                texts.append(field_path)
            elif isinstance(part, types.BaseNamedTuple):
                texts.append(self._text(part, field_path))
            elif isinstance(part, types.UniTuple):
                times = ", ".join(f"share_{factor} * {field_path}[{k}]" for k in range(part.count))
                texts.append(f"({times},)")
            else:
                texts.append(f"share_{factor} * {field_path}")
        return f"{kind.__name__}({', '.join(texts)})"


def calls_of(hook: str, names: str, *, growth: bool = False) -> Any:
    """Return the function that calls the kernels of a hook of all effects, one after another.

    names: of the arguments behind the effect; SIMD variants are chosen where a `work` among them is
    SIMD, or with a `rope` for a stage of lanes; growth: the effects are those at the stage's time.
    """
    places = {name: k for k, name in enumerate(names.split(", "))}

    def call_all(effects: Any, *rest: Any) -> Any:
        present = ramped(effects, rest[places["stage"]].time) if growth else effects
        for effect, call in with_kernel(hook, present):
            call(effect, *rest)

    @overload(call_all, jit_options=LINKED, strict=False)
    def compose(effects: Any, *rest: Any) -> Any:
        if "work" in places:
            calls = kernels(hook, effects, rest[places["work"]])
        elif "rope" in places:
            calls = kernels_at(hook, effects, rest[places["stage"]])
        else:
            calls = kernels_by_index(hook, effects)
        text = RampedEffects(effects if growth and calls else ())
        effect_texts = [text.of(i) if text.lines else f"effects[{i}]" for i in calls]
        lines = [
            f"kernel_{i}({effect_text}, {names})"
            for i, effect_text in zip(calls, effect_texts, strict=True)
        ]
        return generated(
            f"effects, {names}", [*text.lines, *lines, "return None"], calls, **text.names
        )

    return call_all
