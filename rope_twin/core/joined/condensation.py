"""Choice of the condensation of a chain by its effects, and the effects' couplings between nodes.

Chosen by the effects' types while numba compiles: where none couples a node beyond its neighbours
the code contains `chains` only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.jit.rows import column
from rope_twin.core.joined import chains, coupled_chains
from rope_twin.core.loads import balance
from rope_twin.core.loads.hooks import couples
from rope_twin.core.state import BLOCK, RESIDUAL

_WITHIN = {**LINKED, "forceinline": True}  # inlined in the caller, without effects as arguments


def _chosen(plain: Any, coupled: Any) -> Callable[..., Any]:
    """Return f(effects, ...) that calls `coupled` if an effect couples nodes, else `plain`."""

    def call(effects: Any, *arguments: Any) -> Any:
        solve = coupled if couples(map(type, effects)) else plain
        return solve(*arguments)

    @overload(call, jit_options=_WITHIN, strict=False)
    def _choose(effects: Any, *arguments: Any) -> Any:
        solve = coupled if couples(effect.instance_class for effect in effects) else plain

        def run(effects: Any, *arguments: Any) -> Any:
            return solve(*arguments)

        return run

    return call


def chain_rows(effects: tuple[Any, ...]) -> int:
    """Return the rows of scratch of a chain between connections with these effects."""
    coupled = couples(map(type, effects))
    return coupled_chains.COUPLED_CHAIN_ROWS if coupled else chains.CHAIN_ROWS


eliminate_upward = _chosen(chains.eliminate_upward, coupled_chains.eliminate_coupled_upward)
eliminate_downward = _chosen(chains.eliminate_downward, coupled_chains.eliminate_coupled_downward)
eliminate_between = _chosen(chains.eliminate_between, coupled_chains.eliminate_coupled_between)
substitute_upward = _chosen(chains.substitute_upward, coupled_chains.substitute_coupled_upward)
substitute_downward = _chosen(
    chains.substitute_downward, coupled_chains.substitute_coupled_downward
)
substitute_between = _chosen(chains.substitute_between, coupled_chains.substitute_coupled_between)


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
