"""Drawn heave, payout and current for property tests of ropes and scenes."""

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
    """Heave, payout and current."""

    amplitude_m: float
    period_s: float
    payout_m_per_s: float
    current_m_per_s: tuple[float, float]


def weathers(max_m: float, longest_s: float) -> st.SearchStrategy[Weather]:
    """Draw heave up to `max_m` in periods from 4 s to `longest_s`, payout and current."""
    return st.builds(
        Weather,
        st.floats(0.0, max_m),
        st.floats(4.0, longest_s),
        st.floats(-2.0, 2.0),
        st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
    )


def that_rests(make: Callable[[], Twin]) -> Twin:
    """Return a twin; drop the drawn example if it has no static equilibrium."""
    try:
        return make()
    except SceneError:
        assume(False)
        raise
