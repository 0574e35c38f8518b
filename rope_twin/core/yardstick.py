"""How fast this processor is by itself: a chain of multiply-adds, each waiting for the last.

No part of the solver. A speed of the solver over this figure can be compared between machines.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit_entry


@jit_entry
def chain(x: float, a: float, b: float, links: int) -> Any:
    """x ← a·x + b, `links` times."""
    for _ in range(links):
        x = a * x + b
    return x
