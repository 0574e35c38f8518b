"""Scopes of rows: metadata by which LLVM knows that a row of a matrix never overlaps another."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

from rope_twin.core.state import NODE_ROWS, WORK_ROWS

_SCOPES = [
    *(f"work {k}" for k in range(WORK_ROWS)),
    *(f"nodes {k}" for k in range(NODE_ROWS)),
    "offset",
    "sea",  # core/waves
    *(f"scratch {k}" for k in range(5)),
]
_KNOWN: WeakKeyDictionary[Any, dict[str, tuple[Any, Any]]] = WeakKeyDictionary()
_DECLARED: WeakKeyDictionary[Any, dict[str, Any]] = WeakKeyDictionary()


def _scope(module: Any, name: str) -> Any:
    """Metadata of a row's scope, made once per module."""
    declared = _DECLARED.setdefault(module, {})
    if name not in declared:
        declared[name] = module.add_metadata([name, module.add_metadata(["rope_twin rows"])])
    return declared[name]


def tell_apart(module: Any, access: Any, kind: Any) -> None:
    """Mark a load or store as one of this type of row and of no other."""
    known = _KNOWN.setdefault(module, {})
    if kind.scope not in known:
        others = [_scope(module, name) for name in _SCOPES if name != kind.scope]
        own = module.add_metadata([_scope(module, kind.scope)])
        known[kind.scope] = own, module.add_metadata(others)
    mine, not_mine = known[kind.scope]
    access.set_metadata("alias.scope", mine)
    access.set_metadata("noalias", not_mine)
