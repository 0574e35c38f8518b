"""Snapshot -> CDR bytes of a rope's touchdown, bend and utilisation, figures by name."""

from __future__ import annotations

import math

from rope_twin.messages import forms
from rope_twin.messages.cdr import Templates
from rope_twin.twin.snapshot import Snapshot


class ShapeForms:
    """Holds the templates of these topics; one per encoder."""

    def __init__(self) -> None:
        self._sized = Templates()

    def touchdown(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return the touchdown point of each rope on the seabed; no joints if there is none."""
        figures: dict[str, float] = {}
        for one in snapshot.touchdowns:
            x, y, z = one.position_m
            figures |= {
                f"{one.name}/x_m": x,
                f"{one.name}/y_m": y,
                f"{one.name}/z_m": z,
                f"{one.name}/line_out_m": one.line_out_m,
                f"{one.name}/layback_m": one.layback_m,
                f"{one.name}/tension_n": one.tension_n,
                f"{one.name}/angle_deg": one.angle_deg,
            }
        return self._fill("seabed/touchdown", figures, stamp)

    def bend(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return the smallest bend radius of each monitored rope, and its minimum if given."""
        figures: dict[str, float] = {}
        for one in snapshot.bends:
            name, (x, y, z) = one.now.name, one.position_m
            figures |= {
                f"{name}/radius_m": one.now.radius_m,
                f"{name}/line_out_m": one.now.line_out_m,
                f"{name}/x_m": x,
                f"{name}/y_m": y,
                f"{name}/z_m": z,
                f"{name}/tightest_m": one.tightest.radius_m,
            }
            if one.now.minimum_m:
                figures[f"{name}/minimum_m"] = one.now.minimum_m
        return self._fill("rope/bend", figures, stamp)

    def utilisation(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return utilisation and tensions of each rope; NaN without a static tension."""
        figures: dict[str, float] = {}
        for one in snapshot.strength:
            static_n, amplification = one.static_n, one.dynamic_amplification
            figures |= {
                f"{one.name}/utilisation": one.utilisation,
                f"{one.name}/dynamic_amplification": math.nan
                if amplification is None
                else amplification,
                f"{one.name}/highest_n": one.highest_n,
                f"{one.name}/static_n": math.nan if static_n is None else static_n,
            }
        return self._fill("rope/utilisation", figures, stamp)

    def _fill(self, topic: str, figures: dict[str, float], stamp: dict[str, int]) -> bytes:
        names = tuple(figures)
        template = self._sized.get(topic, names, lambda: forms.joint_state(names, ("position",)))
        return template.fill({**stamp, **({"position": [*figures.values()]} if figures else {})})
