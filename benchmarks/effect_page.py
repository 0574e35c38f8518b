"""Results of `python -m benchmarks effects` as tables, and between the marks of docs/effects.md.

The rows are stored in a file next to the page: a run of some effects keeps the others' rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.effect_speed import TOGETHER_NAME, EffectSpeed, all_names
from benchmarks.paired import Ratio
from rope_twin.studies.accuracy_study import page_table, this_machine
from validation.marked_page import MarkedPage, read_stored, write_json

PAGE, STORED = "effects.md", "effects.json"
MARKED = MarkedPage(
    PAGE, "<!-- written by python -m benchmarks effects -->", "<!-- end of what is written -->"
)
HEAD = (
    "effect", "µs a step without", "again", "with", "again / without", "with / without",
    "in the code without", "× real time",
)  # fmt: skip


def effect_table(rows: Sequence[EffectSpeed]) -> list[tuple[str, ...]]:
    """Return the rows as text, below a head."""
    return [HEAD, *(_words(row) for row in rows)]


def _words(row: EffectSpeed) -> tuple[str, ...]:
    code = {None: "-", 0: "no"}.get(row.symbols_off, f"{row.symbols_off} symbols")
    return (
        row.effect,
        f"{row.us_per_step_base:.1f}",
        f"{row.us_per_step_off:.1f}",
        f"{row.us_per_step_on:.1f}",
        str(row.off_over_base),
        str(row.on_over_base),
        code,
        f"{row.real_time_factor_on:.0f}",
    )


def as_json(row: EffectSpeed) -> dict[str, Any]:
    """Return a row with the derived values."""
    return {**asdict(row), "off_is_base": row.off_over_base.holds_one}


def read_rows(folder: Path) -> list[EffectSpeed]:
    """Return the rows in a folder; none if it has no file of them.

    Raises:
        InputError: the file cannot be read.
    """
    return read_stored(folder / STORED, _row, "python -m benchmarks effects")


def _row(stored: dict[str, Any]) -> EffectSpeed:
    del stored["off_is_base"]
    for name in ("off_over_base", "on_over_base"):
        stored[name] = Ratio(**stored[name])
    return EffectSpeed(**stored)


def keep_rows(rows: Sequence[EffectSpeed], folder: Path) -> Path:
    """Put these rows among those that the folder holds, and all of them on its page.

    Raises:
        InputError: what the folder holds cannot be read.
    """
    by_effect = {row.effect: row for row in (*read_rows(folder), *rows)}
    ordered = [by_effect[name] for name in (*all_names(), TOGETHER_NAME) if name in by_effect]
    page = MARKED.write(folder, as_section(ordered, this_machine().as_text()))
    write_json(folder / STORED, {"rows": [as_json(row) for row in ordered]})
    return page


def as_section(rows: Sequence[EffectSpeed], machine: str) -> str:
    """Return the text between the marks."""
    equal = sum(row.off_over_base.holds_one for row in rows)
    lines = [
        f"In {equal} of {len(rows)} rows 1 lies in the interval of the same scene again over itself"
        f" (99 % each). The last row was measured on",
        "",
        f"{machine}.",
        "",
        page_table(effect_table(rows)),
    ]
    return "\n".join(lines)
