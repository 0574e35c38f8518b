"""CPU reference benchmark: a chain of multiply-adds, each of which depends on the one before.

It is no part of the solver. The solver's speed divided by this figure is comparable between
machines.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit_entry


@jit_entry
def chain(x: float, a: float, b: float, links: int) -> Any:
    """Return x after `links` repetitions of x ← a·x + b."""
    for _ in range(links):
        x = a * x + b
    return x
