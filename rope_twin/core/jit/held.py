"""A struct that kernels hand on by its address.

In machine code a struct goes from kernel to kernel as one word for each number in it, and each of
its arrays is ten: a system of ropes that meet is two hundred, which every call copies.
`hold(struct)` leaves it in one place, and is handed on as one pointer; a field is read where it is
asked for. It lives as long as the kernel that holds it, and
its fields are not written to (what its arrays hold is).

Loops over nodes take arrays as ever: a compiler that cannot see who else knows an address reads it
again and again.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, lower_getattr_generic, models, register_model

_NAMED = (types.NamedTuple, types.NamedUniTuple)


class HeldType(types.Type):  # type: ignore[misc]
    """numba's type of a struct that is handed on by its address."""

    def __init__(self, inner: Any) -> None:
        super().__init__(name=f"Held({inner})")
        self.inner = inner

    def field(self, name: str) -> tuple[int, Any]:
        """Number and type of a field; structs within are held too."""
        number = self.inner.fields.index(name)
        kind = list(self.inner)[number]
        return number, HeldType(kind) if isinstance(kind, _NAMED) else kind


@register_model(HeldType)
class _HeldModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, manager.lookup(kind.inner).get_value_type().as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = HeldType

    def generic_resolve(self, held: Any, name: str) -> Any:
        return held.field(name)[1] if name in held.inner.fields else None


@lower_getattr_generic(HeldType)
def _read(context: Any, builder: Any, kind: Any, address: Any, name: str) -> Any:
    number, of = kind.field(name)
    index = [ir.Constant(ir.IntType(32), k) for k in (0, number)]
    place = builder.gep(address, index, inbounds=True)
    return place if isinstance(of, HeldType) else builder.load(place)


@intrinsic
def _hold(context: Any, struct: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return cgutils.alloca_once_value(builder, arguments[0])

    return HeldType(struct)(struct), generate


if config.DISABLE_JIT:

    def hold(struct: Any) -> Any:
        """The struct itself."""
        return struct

else:
    hold = _hold
