"""Residuals (measured less computed) in words, and their row of the diagnostics."""

from __future__ import annotations

from collections.abc import Sequence

from rope_twin.messages.status import Level, Status
from rope_twin.twin.quality import disagrees
from rope_twin.twin.snapshot import Residual

_QUANTITIES = {  # name, scale, unit and number format of what is measured
    "top_tension_n": ("top tension", 1e-3, "kN", ".2f"),
    "line_out_m": ("line out", 1.0, "m", ".2f"),
    "payload_depth_m": ("payload depth", 1.0, "m", ".2f"),
}


def residuals_status(residuals: Sequence[Residual]) -> Status:
    """Return the row on measured less computed values: WARN if one is outside for long."""
    values: dict[str, str] = {}
    outside: list[Residual] = []
    for one in residuals:
        what, scale, unit, form = _QUANTITIES[one.quantity]
        label = f"{one.name}: {what}"
        values |= {
            f"{label}, measured [{unit}]": f"{scale * one.measured:{form}}",
            f"{label}, computed [{unit}]": f"{scale * one.computed:{form}}",
            f"{label}, mean residual of 60 s [{unit}]": f"{scale * one.mean:{form}}",
            f"{label}, RMS residual of 60 s [{unit}]": f"{scale * one.rms:{form}}",
        }
        if one.outside is not None:
            values[f"{label}, outside its interval [%]"] = f"{100.0 * one.outside:.0f}"
            if disagrees(one):
                outside.append(one)
    if outside:
        words = "; ".join(residual_words(one) for one in outside)
        return Status("simulation: residuals", Level.WARN, words, values)
    words = "; ".join(residual_words(one) for one in residuals)
    return Status("simulation: residuals", Level.OK, words, values)


def residual_words(one: Residual) -> str:
    """Return a residual in words, with its interval and statistics."""
    what, scale, unit, form = _QUANTITIES[one.quantity]
    words = (
        f"{what} of '{one.name}': measured {scale * one.measured:{form}} {unit}, computed "
        f"{scale * one.computed:{form}} {unit}, mean residual {scale * one.mean:+{form}} {unit}"
    )
    if one.half_width is None or one.outside is None:
        return f"{words}, interval unknown (give `measured` in the scene)"
    alone = "" if one.twin is not None else " (of the instrument alone)"
    share = f"{100.0 * one.outside:.0f} % outside ±{scale * one.half_width:{form}} {unit}"
    return f"{words}, {share}{alone}"
