"""The race against the peers as a table, a picture and a section of docs/performance.md."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from benchmarks.peers.race import LIMIT_PCT, SEARCHED, PeerRace, PeerRow
from rope_twin.errors import InputError
from rope_twin.studies.accuracy_study import Machine, page_table
from rope_twin.studies.picture import check_picture, write_picture

PICTURE = Path("images") / "peers.png"
STORED = "peers.json"  # beside the page
Table = list[list[str]]
_COLOURS = {"moordyn": "#d55e00", "cabledyn": "#cc79a7", "rope_twin": "#0072b2"}
_NAMES = {"moordyn": "MoorDyn", "cabledyn": "CableDyn"}

TEMPLATE = Path(__file__).with_name("peers.md")


def as_section(race: PeerRace) -> str:
    """Return the section of the page."""
    return (
        TEMPLATE.read_text("utf-8")
        .rstrip("\n")
        .format(
            picture=PICTURE.as_posix(),
            versions=" and ".join(f"{_NAMES[name]} {v}" for name, v in race.peers.items()),
            machine=race.machine.as_text() + ".",
            limit=race.limit_pct,
            doubt=max(row.doubt_pct for row in race.rows),
            best=page_table(best_table(race.rows)),
            table=page_table(peer_table(race.rows)),
            searched=SEARCHED,
            refused="".join(
                f"- CableDyn does not run {n}: `{why}`.\n" for n, why in race.refused.items()
            ),
        )
    )


def peer_table(rows: Sequence[PeerRow]) -> Table:
    """Return a line per peer, scheme and case."""
    head = [
        "case", "segments", "peer", "scheme", "× real time", "error %", "rope_twin", "× real time",
        "error %", "ratio",
    ]  # fmt: skip
    return [head] + [
        [
            row.case,
            str(row.segments),
            _NAMES[row.peer],
            row.scheme,
            _factor(row.peer_real_time_factor),
            "lost" if row.peer_error_pct is None else f"{row.peer_error_pct:.2g}",
            _setting(row.elements, row.step_s),
            _factor(row.real_time_factor),
            "" if row.error_pct is None else f"{row.error_pct:.2g}",
            "loss" if row.ratio is None else _factor(row.ratio),
        ]
        for row in rows
    ]


def best_table(rows: Sequence[PeerRow]) -> Table:
    """Return the fastest setting of each peer per case, and of rope_twin with any elements."""
    head = [
        "case", "segments", "peer at its best", "× real time", "error %", "rope_twin",
        "× real time", "error %", "times faster", "any elements", "× real time",
        "times faster",
    ]  # fmt: skip
    return [head] + [
        [
            row.case,
            str(row.segments),
            f"{_NAMES[row.peer]} {row.scheme.partition(',')[0]}",
            _factor(row.peer_real_time_factor),
            "lost" if row.peer_error_pct is None else f"{row.peer_error_pct:.2g}",
            _setting(row.elements, row.step_s),
            _factor(row.real_time_factor),
            "" if row.error_pct is None else f"{row.error_pct:.2g}",
            "loss" if row.ratio is None else f"**{_factor(row.ratio)}**",
            _setting(row.any_elements, row.any_step_s),
            _factor(row.any_real_time_factor),
            _factor(_over(row.any_real_time_factor, row.peer_real_time_factor)),
        ]
        for row in best(rows)
    ]


def best(rows: Sequence[PeerRow]) -> list[PeerRow]:
    """Return the fastest setting within the limit per peer and case, or the most accurate one."""
    chosen: dict[tuple[str, int, str], PeerRow] = {}
    for row in rows:
        key = row.case, row.segments, row.peer
        chosen[key] = min(row, chosen.get(key, row), key=lambda one: _rank(one))
    return list(chosen.values())


def _rank(row: PeerRow) -> tuple[bool, float]:
    error = float("inf") if row.peer_error_pct is None else row.peer_error_pct
    within = error <= LIMIT_PCT
    return not within, -row.peer_real_time_factor if within else error


def _over(ours: float | None, theirs: float) -> float | None:
    return None if ours is None else ours / theirs


def _setting(elements: int | None, step_s: float | None) -> str:
    return "none" if elements is None or step_s is None else f"{elements} at {1e3 * step_s:g} ms"


def _factor(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:,.0f}" if value >= 9.95 else f"{value:.2g}"


def draw_race(race: PeerRace, path: Path) -> None:
    """Write the picture.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 5.5), layout="constrained")
    panels = list(dict.fromkeys(row.case for row in race.rows))
    shown = best(race.rows)
    for axes, case in zip(
        figure.subplots(1, len(panels), sharey=True, squeeze=False)[0], panels, strict=True
    ):
        _draw_case(axes, [row for row in shown if row.case == case])
        axes.set_title(case)
    figure.suptitle("At equal error: the fastest of each peer, and rope_twin with as many elements")
    write_picture(figure, path, 110)


def _draw_case(axes: Any, rows: list[PeerRow]) -> None:
    for peer, name in _NAMES.items():
        own = [row for row in rows if row.peer == peer]
        if not own:
            continue
        counts = [row.segments for row in own]
        axes.loglog(
            counts, [row.peer_real_time_factor for row in own], "s-", color=_COLOURS[peer],
            label=name,
        )  # fmt: skip
        ours = [(row.segments, row.real_time_factor) for row in own if row.real_time_factor]
        axes.loglog(
            *zip(*ours, strict=True), "o-" if peer == "moordyn" else "o:", markerfacecolor="none",
            color=_COLOURS["rope_twin"], label=f"rope_twin at {name}'s error",
        )  # fmt: skip
        for row in own:
            error = "lost" if row.peer_error_pct is None else f"{row.peer_error_pct:.2g} %"
            axes.annotate(
                error, (row.segments, row.peer_real_time_factor), fontsize=7,
                xytext=(4, 6 if peer == "moordyn" else -11), textcoords="offset points",
            )  # fmt: skip
    axes.set_xlabel("segments")
    axes.set_ylabel("times real time")
    axes.label_outer()
    axes.grid(True, which="both", linewidth=0.3)
    axes.margins(x=0.3, y=0.2)  # room for the words at the points, and for the legend
    axes.legend(fontsize=7)


def read_race(path: Path) -> PeerRace:
    """Return the results printed by `python -m benchmarks peers --json`.

    Raises:
        InputError: the file has no such results.
    """
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        names = {field.name for field in fields(PeerRow)}
        rows = tuple(PeerRow(**{name: row[name] for name in names}) for row in stored["rows"])
        return PeerRace(
            Machine(**stored["machine"]),
            stored["peers"],
            stored["limit_pct"],
            rows,
            stored["refused"],
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        what = f"it is no race of the peers ({error})"
        raise InputError(
            str(path), what, "write one with `python -m benchmarks peers --json`"
        ) from error
