"""The cases as a page: docs/validation.md between its marks, from the results in docs/validation.

A run of some cases replaces their results and keeps the others': cases take minutes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rope_twin.studies.accuracy_study import page_table
from rope_twin.studies.picture import draw_panels
from validation import vortex_convergence
from validation.case import Finding, Row
from validation.marked_page import MarkedPage, read_json, write_json
from validation.registry import CASES, order_of_ids

RESULTS, PAGE, PICTURES = "validation", "validation.md", "images"
CONVERGENCE, CONVERGENCE_PICTURE = "convergence.json", "validation_convergence.png"
BEGIN, END = "<!-- written by python -m validation -->", "<!-- end of what is written -->"
MARKED = MarkedPage(PAGE, BEGIN, END)
HEAD = ["id", "quantity", "rope_twin", "reference", "tolerance", "result", "source"]
VERDICTS = {True: "pass", False: "FAIL", None: "-"}  # None: shown for information


def as_json(row: Row) -> dict[str, Any]:
    """Return the results of a case as plain data."""
    return {
        "id": row.case.id,
        "about": row.case.about,
        "source": row.case.source,
        "met": row.ok,
        "refusal": row.refusal,
        "seconds": round(row.seconds, 1),
        "rows": [_finding_as_json(finding) for finding in row.found.findings],
        "notes": list(row.found.notes),
        "picture": bool(row.found.panels),
    }


def _finding_as_json(finding: Finding) -> dict[str, Any]:
    met = finding.ok if finding.judged else None
    return {
        "quantity": finding.quantity,
        "ours": float(f"{finding.ours:.6g}") if finding.ours == finding.ours else None,
        "unit": finding.unit,
        "published": finding.published,
        "tolerance": finding.tolerance,
        "met": met,
    }


def flat_rows(results: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return one row per number of these cases' plain results.

    A case that could not run has one row, which does not pass, with its reason as the quantity;
    `pass` is None where a number is shown and not judged.
    """
    rows: list[dict[str, Any]] = []
    for result in results:
        ends = {"id": result["id"], "source": result["source"]}
        findings = result["rows"]
        if result["refusal"]:
            empty = {"ours": None, "unit": "", "published": "", "tolerance": "", "met": False}
            findings = [{"quantity": result["refusal"], **empty}]
        for row in findings:
            columns = {key: value for key, value in row.items() if key != "met"}
            rows.append({**ends, **columns, "pass": row["met"]})
    return rows


def table_rows(result: dict[str, Any]) -> list[list[str]]:
    """Return the cells of HEAD for a case's plain results."""
    if result["refusal"]:
        return [[result["id"], result["refusal"], "", "", "", VERDICTS[False], result["source"]]]
    return [
        [
            result["id"],
            row["quantity"],
            _number(row["ours"], row["unit"]),
            f"{row['published']} {row['unit']}".strip()
            if row["published"][-1:].isdigit()
            else row["published"],
            row["tolerance"],
            VERDICTS[row["met"]],
            result["source"],
        ]
        for row in result["rows"]
    ]


def _number(value: float | None, unit: str) -> str:
    return "not a number" if value is None else f"{value:.5g} {unit}".strip()


def markdown_table(results: Iterable[dict[str, Any]]) -> str:
    """Return all rows as one Markdown table."""
    return page_table([HEAD, *(cells for result in results for cells in table_rows(result))])


def keep_results(rows: Iterable[Row], folder: Path) -> list[dict[str, Any]]:
    """Put these results among those that the folder holds; all of them, in the cases' order.

    Raises:
        InputError: what the folder holds cannot be read.
    """
    for row in rows:
        write_json(_path(folder, row.case.id), as_json(row))
    return read_results(folder)


def read_results(folder: Path) -> list[dict[str, Any]]:
    """Return the results in a folder, in the cases' order.

    Raises:
        InputError: one of them cannot be read.
    """
    results = (read_json(_path(folder, case.id)) for case in CASES)
    return [result for result in results if result is not None]


def _path(folder: Path, case: str) -> Path:
    return folder / RESULTS / f"{case}.json"


def write_page(results: list[dict[str, Any]], folder: Path) -> Path:
    """Replace the text between the page's marks.

    Raises:
        InputError: there is no such page, or it has no marks.
    """
    refined = read_json(folder / RESULTS / CONVERGENCE) or []
    return MARKED.write(folder, "\n".join([*_body(results), *_refined(refined)]))


def _body(results: list[dict[str, Any]]) -> Iterable[str]:
    missed = [result["id"] for result in results if not result["met"]]
    yield f"{len(results) - len(missed)} of {len(results)} cases pass."
    if missed:
        yield f"Not passed: {', '.join(missed)}; the reason is given with each case."
    for result in results:
        yield f"\n### {result['id']}: {result['about']}\n"
        yield f"Source: {result['source']}. Takes {result['seconds']:.0f} s.\n"
        yield page_table([HEAD[1:-1], *(cells[1:-1] for cells in table_rows(result))])
        for note in result["notes"]:
            yield f"\n{note}"
        if result["picture"]:
            yield f"\n![{result['id']}]({PICTURES}/{picture_name(result['id'])})"


def keep_convergence(rows: Sequence[vortex_convergence.Convergence], folder: Path) -> None:
    """Put these sweeps into the folder, in place of what it holds of the same cases.

    Raises:
        InputError: what the folder holds cannot be read.
    """
    path = folder / RESULTS / CONVERGENCE
    new = {row.case for row in rows}
    stored = [row for row in read_json(path) or [] if row["case"] not in new]
    merged = sorted(
        stored + vortex_convergence.as_json(rows), key=lambda row: order_of_ids(row["case"])
    )
    write_json(path, merged)


def _refined(rows: Sequence[dict[str, Any]]) -> Iterable[str]:
    if not rows:
        return
    names = " and ".join(dict.fromkeys(row["case"] for row in rows))
    yield f"\n### Convergence of {names} over element length and step\n"
    yield "`python -m validation --convergence`; errors relative to the finest run of a sweep.\n"
    yield from (f"- {row['words']}" for row in rows)
    yield f"\n{page_table(vortex_convergence.table(rows))}"
    yield f"\n![convergence]({PICTURES}/{CONVERGENCE_PICTURE})"


def draw_case(row: Row, folder: Path) -> None:
    """Draw what a case found, where the page of a folder shows it; nothing without panels.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    if row.found.panels:
        title = f"{row.case.id}: {row.case.about}"
        draw_panels(title, row.found.panels, folder / PICTURES / picture_name(row.case.id))


def picture_name(case: str) -> str:
    """Return the file name of a case's picture."""
    return f"validation_{case.lower()}.png"
