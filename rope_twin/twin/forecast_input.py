"""Score of a forecast beside the twin: it drives nothing and is only judged, by the quality index.

The forecaster runs elsewhere and reports how its last forecasts turned out; the score comes through
the twin's inputs, so that a replay has the same index. Some time after the last one no forecast
runs, and there is nothing to judge.
"""

from __future__ import annotations

import math

from rope_twin.errors import phrase
from rope_twin.twin.snapshot import ForecastScore

GONE_S = 60.0  # after the last score: none runs
MOST_JUDGED = 1_000_000


class ForecastInput:
    """The newest score."""

    def __init__(self) -> None:
        """Begin without one."""
        self._newest: ForecastScore | None = None

    def offer(
        self, now_s: float, coverage: float, judged: float, factor: float, age_s: float
    ) -> str:
        """Take a score (fields of ForecastScore); return "" or the reason for its rejection."""
        fault = ""
        if not (math.isnan(coverage) or 0.0 <= coverage <= 1.0):
            fault = phrase("forecast", f"a coverage of {coverage:g}", "give 0 to 1, NaN: unknown")
        elif not 0.0 <= judged <= MOST_JUDGED:
            fault = phrase("forecast", f"{judged:g} forecasts judged", "give their number")
        elif not (0.0 < factor < math.inf and math.isfinite(age_s)):
            what = f"a factor of {factor:g} and inputs {age_s:g} s old"
            fault = phrase("forecast", what, "give a positive factor and a finite age")
        if not fault:
            self._newest = ForecastScore(now_s, age_s, coverage, int(judged), factor)
        return fault

    def at(self, now_s: float) -> ForecastScore | None:
        """Return the newest score; None: no forecast runs."""
        newest = self._newest
        return newest if newest is not None and now_s - newest.at_s <= GONE_S else None
