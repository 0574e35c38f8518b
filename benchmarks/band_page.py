"""Results of `python -m benchmarks band` as tables, and between the marks of docs/error_band.md.

The rows are stored in a file next to the page: a run of some scenes keeps the others' rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.band import (
    ANSWERING,
    BESIDE,
    BLOWS,
    FITTED,
    FULL,
    HELD_PCT,
    LATER,
    MEETING,
    RATIO,
    VORTICES,
    BandCase,
    BandRow,
)
from rope_twin.studies.page import page_table
from validation.marked_page import MarkedPage, read_stored, store

PAGE, STORED = "error_band.md", "error_band.json"
BEGIN, END = "<!-- written by python -m benchmarks band -->", "<!-- end of what is written -->"
MARKED = MarkedPage(PAGE, BEGIN, END)
HEAD = (
    "scene", "s", "standard deviation kN", "error N", "doubt N", "bound N", "bound / error",
    "held %", "or doubtful %", "cost %", "reference",
)  # fmt: skip


def band_table(rows: Sequence[BandRow]) -> list[tuple[str, ...]]:
    """Return the rows as text, below a head."""
    return [HEAD, *(_words(row) for row in rows)]


def _words(row: BandRow) -> tuple[str, ...]:
    return (
        row.scene,
        f"{row.seconds:g}",
        _rounded(row.deviation_n / 1e3),
        _rounded(row.error_n),
        _rounded(row.doubt_n),
        _rounded(row.bound_n),
        f"{row.ratio:.1f}",
        f"{row.held_pct:.1f}",
        f"{row.held_or_doubtful_pct:.1f}",
        f"{row.cost_pct:.0f}",
        f"x {row.times}",
    )


def _rounded(value: float) -> str:
    """Return a value with two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):.10g}"


def read_rows(folder: Path) -> list[BandRow]:
    """Return the rows in a folder; none if it has no file of them.

    Raises:
        InputError: the file cannot be read.
    """
    return read_stored(folder / STORED, lambda row: BandRow(**row), "python -m benchmarks band")


def check_page(folder: Path) -> None:
    """Check that there is a page to write to.

    Raises:
        InputError: there is none, or it has no marks.
    """
    MARKED.around(folder)


def keep_rows(rows: Sequence[BandRow], folder: Path) -> Path:
    """Put these rows among those that the folder holds, and all of them on its page.

    Raises:
        InputError: what the folder holds cannot be read.
    """
    found = {row.scene: row for row in (*read_rows(folder), *rows)}
    kept = [found[case.scene] for case in FULL if case.scene in found]
    page = MARKED.write(folder, as_section(kept))
    store(folder / STORED, [asdict(row) for row in kept])
    return page


def as_section(rows: Sequence[BandRow]) -> str:
    """Return the text between the marks."""
    good = sum(row.ok for row in rows)
    lines = [
        f"{good} of {len(rows)} scenes are held for {HELD_PCT:g} % of the time at least, by a bound"
        f" of {RATIO:g} times the error at most.",
        *(f"Not so: {row.scene}." for row in rows if not row.ok),
        *_part("Scenes on which the numbers were found:", FITTED, rows),
        *_part("Scenes that came later:", LATER, rows),
        *_part("Ropes that meet, and payloads that are rigid bodies:", MEETING, rows),
        *_part("Winches that answer to the tension:", ANSWERING, rows),
        *_part("Vortices in the step:", VORTICES, rows),
        *_part("Vortices beside the step:", BESIDE, rows),
        *_part("Where blows decide:", BLOWS, rows),
    ]
    return "\n".join(lines)


def _part(title: str, cases: Sequence[BandCase], rows: Sequence[BandRow]) -> list[str]:
    names = {case.scene for case in cases}
    table = band_table([row for row in rows if row.scene in names])
    return [f"\n{title}\n", page_table(table)]
