"""Effects' couplings between nodes of a rope that is connected, and the scratch they need."""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.jit.rows import column
from rope_twin.core.joined.between import CHAIN_ROWS
from rope_twin.core.joined.coupled_chains import COUPLED_CHAIN_ROWS
from rope_twin.core.loads import balance
from rope_twin.core.loads.hooks import couples
from rope_twin.core.state import BLOCK, RESIDUAL


def chain_rows(effects: tuple[Any, ...]) -> int:
    """Return the rows of scratch of a chain between connections with these effects."""
    return COUPLED_CHAIN_ROWS if couples(map(type, effects)) else CHAIN_ROWS


@jit
def _couple(effects: Any, work: Any, stage: Any, n: int, upto: int) -> None:
    """Add the couplings and keep the loads of node n (present where upto > n), which they clear."""
    R, S = column(work, RESIDUAL, n), (column(work, BLOCK, n), column(work, BLOCK + 3, n))
    balance.add_couplings(effects, work, stage, n)
    if upto > n:
        for k in range(3):
            work[RESIDUAL + k, n] += R[k]
            work[BLOCK + k, n] += S[0][k]
            work[BLOCK + 3 + k, n] += S[1][k]


def add_couplings(effects: Any, work: Any, stage: Any, n: Any, upto: Any) -> Any:
    """Add every effect's forces between nodes that are not next neighbours, once loads are known.

    upto: number of nodes that carry loads, n or (the upper end is at a connection) n + 1.
    """
    if couples(map(type, effects)):
        _couple(effects, work, stage, n, upto)


@overload(add_couplings, jit_options=LINKED, strict=False)
def _compose_couplings(effects: Any, work: Any, stage: Any, n: Any, upto: Any) -> Any:
    if couples(effect.instance_class for effect in effects):
        return lambda effects, work, stage, n, upto: _couple(effects, work, stage, n, upto)
    return lambda effects, work, stage, n, upto: None
