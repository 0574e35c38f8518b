"""`python -m validation [ID...]`: published and closed-form cases, rope_twin against reference.

`--hard-cases` runs the robustness tests of the solver instead, `--learning` the estimator on hidden
truths, `--faults` its fault tests. Exit code 0 if every case passes, 1 if one fails.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from functools import partial
from math import isfinite, isnan
from pathlib import Path
from typing import Any

from rope_twin.cli import CaseProgress, CommandLine, exit_code, print_table
from rope_twin.studies.picture import check_picture, draw_panels
from validation import registry, vortex_convergence
from validation.case import Finding, Row, choose, run_each
from validation.learning import command as learning_command
from validation.learning import fault_command
from validation.page import (
    CONVERGENCE_PICTURE,
    HEAD,
    MARKED,
    PAGE,
    PICTURES,
    VERDICTS,
    as_json,
    draw_case,
    flat_rows,
    keep_convergence,
    keep_results,
    markdown_table,
    read_results,
    table_rows,
    write_page,
)

PROGRAM = "python -m validation"
HARD_HEAD = "| id | case | reference | quantity nearest to its limit | value | limit | result |"


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run what it asks for, return the exit code."""
    return exit_code(partial(_command, argv))


def _command(argv: Sequence[str] | None) -> int:
    parser = _parser()
    args = parser.parse_args(argv)
    if args.learning:
        if args.into is not None or args.convergence or args.hard_cases or args.markdown:
            parser.error("--learning: of the other options it takes --json")
        return learning_command.run(args)
    if args.faults:
        if args.into is not None or args.convergence or args.hard_cases or args.markdown:
            parser.error("--faults: of the other options it takes --json")
        return fault_command.run(args)
    if args.hard_cases:
        if args.into is not None or args.convergence:
            parser.error("--hard-cases: it takes no --into and no --convergence")
        return _hard_cases(args)
    return _converge(args) if args.convergence else _validate(args)


def _parser() -> argparse.ArgumentParser:
    ids = ", ".join(f"{case.id} ({case.seconds:.0f} s)" for case in registry.CASES)
    hard = ", ".join(case.id for case in registry.HARD_CASES)
    parser = CommandLine(
        prog=PROGRAM,
        description="Published and closed-form cases: our number beside theirs.",
        epilog=f"cases: {ids}; hard cases: {hard}",
    )
    parser.add_argument("ids", metavar="ID", nargs="*", help="cases to run (default: all)")
    form = parser.add_mutually_exclusive_group()
    form.add_argument(
        "--json", action="store_true",
        help="JSON: the cases with a row for each number; of hard cases a list of rows",
    )  # fmt: skip
    form.add_argument("--markdown", action="store_true", help="a table as in docs")
    parser.add_argument(
        "--into", type=Path, metavar="DIR",
        help=f"put the results, with a picture per case, into DIR/{PAGE} (other cases' are kept)",
    )  # fmt: skip
    parser.add_argument(
        "--convergence", action="store_true",
        help="in place of the cases: where Q1 and L2 are converged in element and step (a minute)",
    )  # fmt: skip
    parser.add_argument(
        "--hard-cases", action="store_true",
        help="in place of the cases: robustness tests of the solver, each against a reference",
    )  # fmt: skip
    learning_command.add_arguments(parser)
    fault_command.add_arguments(parser)
    return parser


def _validate(args: argparse.Namespace) -> int:
    """Run the cases and print a table as each ends; 1 if one is not met."""
    chosen = choose(PROGRAM, registry.CASES, args.ids)
    if args.into is not None:
        check_picture(args.into / PICTURES / "case.png")
        MARKED.around(args.into)
    rows = []
    for row in run_each(chosen):
        rows.append(row)
        if not (args.json or args.markdown):
            _print_case(row)
        if args.into is not None:
            draw_case(row, args.into)
    if args.json:
        results = [as_json(row) for row in rows]
        figures = {"rows": flat_rows(results), "cases": results}
        print(json.dumps(figures, indent=1, ensure_ascii=False, allow_nan=False))
    elif args.markdown:
        print(markdown_table(as_json(row) for row in rows))
    else:
        met, seconds = sum(row.ok for row in rows), sum(row.seconds for row in rows)
        print(f"{met} of {len(rows)} cases pass, {seconds:.0f} s")
    if args.into is not None:
        page = write_page(keep_results(rows, args.into), args.into)
        print(page, file=sys.stderr)
    return 0 if all(row.ok for row in rows) else 1


def _converge(args: argparse.Namespace) -> int:
    """Run the convergence sweeps; exit code 1 if one does not converge."""
    sweeps = choose(f"{PROGRAM} --convergence", vortex_convergence.SWEEPS, args.ids)
    if args.into is not None:
        check_picture(args.into / PICTURES / CONVERGENCE_PICTURE)
        MARKED.around(args.into)
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
    print_table([HEAD[1:-1], *(cells[1:-1] for cells in table_rows(result))])
    for note in result["notes"]:
        print(f"* {note}")
    print(flush=True)


def _hard_cases(args: argparse.Namespace) -> int:
    """Run the robustness tests and print a row as each ends; 1 if one does not pass."""
    chosen = choose(f"{PROGRAM} --hard-cases", registry.HARD_CASES, args.ids)
    width = max(len(case.id) for case in registry.HARD_CASES)
    if args.markdown:
        print(f"{HARD_HEAD}\n|{' --- |' * 7}", flush=True)
    elif not args.json:
        print(f"{'case':<{width}}  result  {'value':>12}  {'limit':>12}  quantity", flush=True)
    rows = []
    for row in run_each(chosen):
        rows.append(row)
        if not args.json:
            print(_hard_markdown(row) if args.markdown else _hard_text(row, width), flush=True)
    if args.json:
        print(json.dumps([_hard_json(row) for row in rows], indent=1, ensure_ascii=False))
    elif not args.markdown:
        passed = sum(row.ok for row in rows)
        print(f"{passed} of {len(rows)} pass, {sum(row.seconds for row in rows):.0f} s")
    return 0 if all(row.ok for row in rows) else 1


def _hard_text(row: Row, width: int) -> str:
    """Return a line of the value closest to its limit, and one of each other that is beyond."""
    worst = row.worst
    figure, limit = _cells(worst)
    lines = [
        f"{row.case.id:<{width}}  {VERDICTS[row.ok]:<6}  {figure:>12}  {limit:>12}  "
        f"{worst.quantity}"
    ]
    for finding in row.found.findings:
        if not finding.ok and finding is not worst:
            figure, limit = _cells(finding)
            lines.append(f"{'':<{width}}          {figure:>12}  {limit:>12}  {finding.quantity}")
    return "\n".join(lines)


def _cells(finding: Finding) -> tuple[str, str]:
    """Return a value and its limit in words."""
    figure = "-" if isnan(finding.ours) else f"{finding.ours:.3g} {finding.unit}".strip()
    return figure, f"{finding.high:.3g} {finding.unit}".strip()


def _hard_markdown(row: Row) -> str:
    case, worst = row.case, row.worst
    cells = (f"`{case.id}`", case.about, case.source, worst.quantity, *_cells(worst))
    return f"| {' | '.join(cells)} | {VERDICTS[row.ok]} |"


def _hard_json(row: Row) -> dict[str, Any]:
    return {
        "id": row.case.id, **_limit_json(row.worst), "ok": row.ok, "about": row.case.about,
        "reference": row.case.source, "seconds": round(row.seconds, 2),
        "checks": [_limit_json(finding) for finding in row.found.findings],
    }  # fmt: skip


def _limit_json(finding: Finding) -> dict[str, Any]:
    figure = finding.ours if isfinite(finding.ours) else None
    limit = finding.high if finding.judged else None
    return {
        "ok": finding.ok, "figure": figure, "limit": limit, "unit": finding.unit,
        "what": finding.quantity,
    }  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
