"""Load chart of an operation: the significant wave height that each phase allows.

`rope_twin plan` writes it; whatever shows a crew its limits reads it. Between the periods and
headings of the chart the lowest neighbour counts, and nothing is allowed beyond them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from rope_twin.errors import InputError, did_you_mean

Cell = TypeVar("Cell")
FORMAT = 1
REMAKE = "give a load_chart.json of `rope_twin plan`"


@dataclass(frozen=True)
class PhaseChart:
    """Limits of one phase, a row for each peak period and a column for each heading."""

    kind: str  # lowering, at_depth, landing or splash_zone
    depth_m: tuple[float, float]  # of the payload at the start and at the end
    limiting_hs_m: tuple[tuple[float, ...], ...]  # 0: no height is allowed
    governing: tuple[tuple[str, ...], ...]  # criterion that the next height breaks
    hook_load_n: tuple[tuple[float | None, ...], ...]  # characteristic one at the limit


@dataclass(frozen=True)
class LoadChart:
    """Limits of all phases of a plan."""

    plan: str
    scene: str
    scene_digest: str
    percentile: float  # of the characteristic loads
    tp_s: tuple[float, ...]  # ascending
    heading_deg: tuple[float, ...]  # that waves travel to, from the bow to port; 180: head seas
    symmetric: bool  # limits of one side hold for the other
    phases: Mapping[str, PhaseChart]

    def allowed_height_m(self, phase: str, period_s: float, heading_deg: float) -> float:
        """Return the Hs that a phase allows [m]; 0 if none, or beyond the chart.

        A heading from the other side of the bow is mirrored if the plan declares its limits
        symmetric.

        Raises:
            InputError: there is no such phase.
        """
        if phase not in self.phases:
            remedy = did_you_mean(phase, self.phases)
            raise InputError(f"phase '{phase}'", "the load chart has no such phase", remedy)
        table = self.phases[phase].limiting_hs_m
        rows = _neighbours(self.tp_s, period_s)
        sides = (heading_deg, -heading_deg) if self.symmetric else (heading_deg,)
        turns = [side % 360.0 - turn for side in sides for turn in (0.0, 360.0)]
        candidates = (_neighbours(self.heading_deg, turned_deg) for turned_deg in turns)
        columns = next((neighbours for neighbours in candidates if neighbours), [])
        return min((table[j][k] for j in rows for k in columns), default=0.0)


def _neighbours(axis: Sequence[float], value: float) -> list[int]:
    """Return the indices of the values on either side; none beyond the axis."""
    order = sorted(range(len(axis)), key=lambda k: axis[k])
    below = [k for k in order if axis[k] <= value]
    above = [k for k in order if axis[k] >= value]
    return list(dict.fromkeys([below[-1], above[0]])) if below and above else []


def read_load_chart(path: str | Path) -> LoadChart:
    """Read a load chart.

    Raises:
        InputError: the file is not one, or its tables do not fit its axes; one sentence.
    """
    where = str(path)
    try:
        chart = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(where, f"it cannot be read ({reason})", REMAKE) from error
    except ValueError as error:
        raise InputError(where, f"it is not JSON ({error})", REMAKE) from error
    if not isinstance(chart, dict) or chart.get("format") != FORMAT:
        version = chart.get("format") if isinstance(chart, dict) else None
        problem = f"a load chart of format {version}, this version reads {FORMAT}"
        raise InputError(where, problem, REMAKE)
    try:
        periods, headings = _axis(chart["tp_s"]), _axis(chart["heading_deg"])
        phases = {str(name): _phase(phase, len(periods), len(headings))
                  for name, phase in chart["phases"].items()}  # fmt: skip
        return LoadChart(
            plan=str(chart["plan"]),
            scene=str(chart["scene"]),
            scene_digest=str(chart["scene_digest"]),
            percentile=float(chart["percentile"]),
            tp_s=periods,
            heading_deg=headings,
            symmetric=chart.get("symmetric") is True,
            phases=phases,
        )
    except KeyError as error:
        raise InputError(where, f"it lacks the key {error}", REMAKE) from error
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(where, f"it is not a load chart ({error})", REMAKE) from error


def _axis(values: Any) -> tuple[float, ...]:
    axis = tuple(float(value) for value in values)
    if not axis or len(set(axis)) < len(axis) or not all(math.isfinite(value) for value in axis):
        raise ValueError(f"the axis {list(axis)} is empty, not finite, or has a value twice")
    return axis


def _phase(phase: Any, rows: int, columns: int) -> PhaseChart:
    first, last = (float(depth) for depth in phase["depth_m"])

    def table(key: str, read: Callable[[Any], Cell]) -> tuple[tuple[Cell, ...], ...]:
        if len(phase[key]) != rows or any(len(row) != columns for row in phase[key]):
            raise ValueError(f"a table has not {rows} rows of {columns}")
        return tuple(tuple(read(cell) for cell in row) for row in phase[key])

    limits = table("limiting_hs_m", lambda cell: 0.0 if cell is None else float(cell))
    if not all(math.isfinite(v) and v >= 0.0 for row in limits for v in row):
        raise ValueError("a limiting height is negative or not finite")
    hooks = table("hook_load_n", lambda cell: None if cell is None else float(cell))
    return PhaseChart(
        kind=str(phase["kind"]),
        depth_m=(first, last),
        limiting_hs_m=limits,
        governing=table("governing", str),
        hook_load_n=hooks,
    )
