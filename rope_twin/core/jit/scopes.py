"""Alias scopes of rows: LLVM metadata which declares that rows of a matrix never overlap."""

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
    """Return the metadata of a row's alias scope, made once per module."""
    declared = _DECLARED.setdefault(module, {})
    if name not in declared:
        declared[name] = module.add_metadata([name, module.add_metadata(["rope_twin rows"])])
    return declared[name]


def set_alias_scope(module: Any, access: Any, kind: Any) -> None:
    """Attach alias.scope and noalias metadata of this row type to a load or store."""
    metadata = _KNOWN.setdefault(module, {})
    if kind.scope not in metadata:
        other_scopes = [_scope(module, name) for name in _SCOPES if name != kind.scope]
        scope = module.add_metadata([_scope(module, kind.scope)])
        metadata[kind.scope] = scope, module.add_metadata(other_scopes)
    alias_scope, noalias = metadata[kind.scope]
    access.set_metadata("alias.scope", alias_scope)
    access.set_metadata("noalias", noalias)
