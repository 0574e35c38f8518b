"""`rope_twin validate [ID...]`: published and closed-form cases, ours beside theirs.

Exit code 0 if every case is met, 1 if one is not.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from rope_twin.commands.console import CaseProgress, print_table, run_each
from rope_twin.studies.picture import check_picture
from rope_twin.studies.validation import vortex_convergence
from rope_twin.studies.validation.case import Row
from rope_twin.studies.validation.page import (
    CONVERGENCE_PICTURE,
    PAGE,
    PICTURES,
    as_json,
    check_page,
    flat_rows,
    keep_convergence,
    keep_results,
    markdown_table,
    picture_name,
    read_results,
    table_rows,
    write_page,
)
from rope_twin.studies.validation.picture import draw_case, draw_panels
from rope_twin.studies.validation.registry import CASES, choose_cases, run_case

HEAD = ("quantity", "ours", "published", "tolerance", "met")


def add_parser(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add `validate`."""
    ids = ", ".join(f"{case.id} ({case.seconds:.0f} s)" for case in CASES)
    parser = subparsers.add_parser(
        "validate",
        help="published and closed-form cases: our number beside theirs",
        epilog=f"cases: {ids}",
    )
    parser.add_argument("ids", metavar="ID", nargs="*", help="cases to run (default: all)")
    form = parser.add_mutually_exclusive_group()
    form.add_argument(
        "--json", action="store_true", help="one JSON object: a row a number, and the cases"
    )
    form.add_argument("--markdown", action="store_true", help="a table as in docs/validation.md")
    parser.add_argument(
        "--into", type=Path, metavar="DIR",
        help=f"put the results, with a picture per case, into DIR/{PAGE} (other cases' are kept)",
    )  # fmt: skip
    parser.add_argument(
        "--convergence", action="store_true",
        help="in place of the cases: where Q1 and L2 are converged in element and step (a minute)",
    )  # fmt: skip
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the cases and print a table as each ends; 1 if one is not met."""
    if args.convergence:
        return _converge(args)
    cases = choose_cases(args.ids)
    if args.into is not None:
        check_picture(args.into / PICTURES / "case.png")
        check_page(args.into)
    rows = []
    for row in run_each(cases, run_case):
        rows.append(row)
        if not (args.json or args.markdown):
            _print_case(row)
        if args.into is not None and row.found.panels:
            draw_case(row, args.into / PICTURES / picture_name(row.case.id))
    if args.json:
        results = [as_json(row) for row in rows]
        told = {"rows": flat_rows(results), "cases": results}
        print(json.dumps(told, indent=1, ensure_ascii=False, allow_nan=False))
    elif args.markdown:
        print(markdown_table(as_json(row) for row in rows))
    else:
        met, seconds = sum(row.ok for row in rows), sum(row.seconds for row in rows)
        print(f"{met} of {len(rows)} cases are met, {seconds:.0f} s")
    if args.into is not None:
        page = write_page(keep_results(rows, args.into), args.into)
        print(page, file=sys.stderr)
    return 0 if all(row.ok for row in rows) else 1


def _converge(args: argparse.Namespace) -> int:
    """Exit code 1 if a sweep is converged nowhere."""
    sweeps = vortex_convergence.choose_sweeps(args.ids)
    if args.into is not None:
        check_picture(args.into / PICTURES / CONVERGENCE_PICTURE)
        check_page(args.into)
    rows = list(vortex_convergence.measure(sweeps, CaseProgress().show))
    stored = vortex_convergence.as_json(rows)
    if args.json:
        print(json.dumps(stored, ensure_ascii=False, allow_nan=False))
    else:
        print_table(vortex_convergence.table(stored))
        print("\n".join(["", *(row.words for row in rows)]))
    if args.into is not None:
        keep_convergence(rows, args.into)
        title = "Off the finest run, over element length and step"
        picture = args.into / PICTURES / CONVERGENCE_PICTURE
        draw_panels(title, vortex_convergence.panels(rows), picture)
        print(write_page(read_results(args.into), args.into), file=sys.stderr)
    return 0 if all(row.converged for row in rows) else 1


def _print_case(row: Row) -> None:
    result = as_json(row)
    print(f"{result['id']}: {result['about']} ({result['source']})")
    print_table([HEAD, *(cells[1:-1] for cells in table_rows(result))])
    for note in result["notes"]:
        print(f"* {note}")
    print(flush=True)
