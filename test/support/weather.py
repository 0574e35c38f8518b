"""Drawn weather, for tests that send drawn ropes and scenes through it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hypothesis import HealthCheck, assume
from hypothesis import strategies as st

from rope_twin import Twin
from rope_twin.errors import SceneError

UNHURRIED = {
    "deadline": None,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.filter_too_much],
}


@dataclass(frozen=True)
class Weather:
    """What happens to a rope."""

    amplitude_m: float
    period_s: float
    payout_m_per_s: float
    current_m_per_s: tuple[float, float]


def weathers(most_m: float, longest_s: float) -> st.SearchStrategy[Weather]:
    """Heave up to so much, in periods of 4 s up to so long."""
    return st.builds(
        Weather,
        st.floats(0.0, most_m),
        st.floats(4.0, longest_s),
        st.floats(-2.0, 2.0),
        st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
    )


def that_rests(make: Callable[[], Twin]) -> Twin:
    """A twin; what was drawn is dropped if it has no equilibrium to start from."""
    try:
        return make()
    except SceneError:
        assume(False)
        raise
