"""RAOs shown back: their table in the conventions of this package, and a picture (matplotlib)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.sea.raos import FREEDOMS, SHIFTS, Point, Responses
from rope_twin.sea.tables import Vector
from rope_twin.studies.picture import Line, Panel, draw_panels

MOST_PERIODS = 12  # in a printed table of one heading
MOST_CURVES = 9  # headings in a picture
SHOWN = 5e-4  # printed modulus from which a phase has a meaning
LEAST_RATIO = 1e-3  # of a freedom's largest modulus: a phase below it is not drawn


def own_headings(responses: Responses, wanted_deg: Sequence[float] = ()) -> Vector:
    """Return the headings of a table within one turn, or those asked for, (h,).

    Raises:
        InputError: a heading asked for is not finite.
    """
    if wanted_deg:
        if not np.isfinite(wanted_deg).all():
            raise InputError(phrase("--heading", "it is not finite", "give degrees"))
        return np.array(wanted_deg, dtype=float)
    end = 180.0 if responses.mirrored else 359.9999
    return responses.heading_deg[(responses.heading_deg >= 0.0) & (responses.heading_deg <= end)]


def periods_s(responses: Responses) -> Vector:
    """Return the wave periods of a table, ascending, (t,); the limit of 0 Hz left out."""
    return np.asarray(1.0 / responses.frequency_hz[responses.frequency_hz > 0.0][::-1])


def table_rows(responses: Responses, heading_deg: float) -> list[list[str]]:
    """Return a table for one heading: modulus and phase (lead, degrees) of six freedoms."""
    every = periods_s(responses)
    chosen = np.unique(np.linspace(0, len(every) - 1, min(len(every), MOST_PERIODS)).round())
    shown = every[chosen.astype(int)]
    answer = responses.at(1.0 / shown, np.full(len(shown), np.radians(heading_deg)))
    head = ["T [s]"]
    head += [f"{name} [{'m/m' if name in SHIFTS else '°/m'}]" for name in FREEDOMS]
    rows = [head]
    for period, values in zip(shown, answer.T, strict=True):
        sizes = np.abs(values) * np.where(np.arange(6) < 3, 1.0, 180.0 / np.pi)
        phases = np.degrees(np.angle(values))
        cells = (
            f"{a:.3f} {p:+4.0f}°" if a >= SHOWN else f"{a:.3f}     -"
            for a, p in zip(sizes, phases, strict=True)
        )
        rows.append([f"{period:.1f}", *cells])
    return rows


def figures(responses: Responses, headings_deg: Vector) -> dict[str, Any]:
    """Return RAOs for `--json`: modulus and phase as (6, headings, periods)."""
    periods = periods_s(responses)
    answer = np.stack(
        [responses.at(1.0 / periods, np.full(len(periods), np.radians(h))) for h in headings_deg],
        axis=1,
    )
    return {
        "source": responses.source,
        "phase_origin_m": responses.origin_m,
        "mirrored": bool(responses.mirrored),
        "heading_deg": headings_deg.tolist(),
        "period_s": periods.tolist(),
        "freedoms": list(FREEDOMS),
        "modulus": np.abs(answer).tolist(),
        "modulus_unit": ["m/m"] * 3 + ["rad/m"] * 3,
        "phase_deg": np.degrees(np.angle(answer)).tolist(),
    }


def draw_raos(responses: Responses, headings_deg: Vector, at_m: Point | None, path: Path) -> None:
    """Draw modulus and phase of each freedom over period, a curve for each heading.

    at_m: the point, if it is not the file's own.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    periods = periods_s(responses)
    few = np.unique(np.linspace(0, len(headings_deg) - 1, min(len(headings_deg), MOST_CURVES)))
    panels = list[Panel]()
    found = {
        float(headings_deg[k]): responses.at(
            1.0 / periods, np.full(len(periods), np.radians(headings_deg[k]))
        )
        for k in few.round().astype(int)
    }
    for part in (slice(0, 3), slice(3, 6)):
        for number, name in list(enumerate(FREEDOMS))[part]:
            unit, scale = ("m/m", 1.0) if name in SHIFTS else ("°/m", 180.0 / np.pi)
            lines = tuple(
                Line(periods, scale * np.abs(own[number]), f"{heading:g}°")
                for heading, own in found.items()
            )
            panels.append(Panel(name, "wave period [s]", f"modulus [{unit}]", lines))
        for number, name in list(enumerate(FREEDOMS))[part]:
            most = max(float(np.abs(own[number]).max()) for own in found.values())
            lines = tuple(
                Line(periods, _phase(own[number], most), f"{heading:g}°", ".")
                for heading, own in found.items()
            )
            panels.append(Panel(f"{name}, phase", "wave period [s]", "lead of crest [°]", lines))
    where = "" if at_m is None else f", at [{at_m[0]:g}, {at_m[1]:g}, {at_m[2]:g}] m"
    draw_panels(f"RAOs of {Path(responses.source.split(', ')[0]).name}{where}", panels, path)


def _phase(values: Any, most: float) -> Vector:
    """Return phases in degrees; none where a freedom barely moves."""
    phase = np.degrees(np.angle(values))
    return np.asarray(np.where(np.abs(values) > LEAST_RATIO * max(most, 1e-30), phase, np.nan))
