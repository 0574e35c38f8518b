"""Results of the hard cases as text, as a Markdown table and as JSON."""

from __future__ import annotations

import argparse
import json
import math
from typing import Any

from validation.case import run_each
from validation.hard_cases.cases import CASES, Row, choose_cases, run_case
from validation.hard_cases.check import Check

MARKDOWN_HEAD = "| id | hard | held against | nearest to its limit | figure | limit | holds |"


def run(args: argparse.Namespace) -> int:
    """Run the cases and print a row as each ends; 1 if one does not hold."""
    cases = choose_cases(args.ids)
    if args.markdown:
        print(f"{MARKDOWN_HEAD}\n|{' --- |' * 7}", flush=True)
    elif not args.json:
        print(f"{'case':<{_width()}}  holds  {'figure':>12}  {'limit':>12}  what", flush=True)
    rows = []
    for row in run_each(cases, run_case):
        rows.append(row)
        if args.markdown:
            print(_as_markdown(row), flush=True)
        elif not args.json:
            _print_row(row)
    if args.json:
        print(json.dumps([_as_json(row) for row in rows], indent=1, ensure_ascii=False))
    elif not args.markdown:
        held = sum(row.ok for row in rows)
        print(f"{held} of {len(rows)} hold, {sum(row.seconds for row in rows):.0f} s")
    return 0 if all(row.ok for row in rows) else 1


def _width() -> int:
    return max(len(case.id) for case in CASES)


def _print_row(row: Row) -> None:
    worst = row.worst
    print(
        f"{row.case.id:<{_width()}}  {'yes' if row.ok else 'NO':<5}  {_figure(worst):>12}  "
        f"{_limit(worst):>12}  {worst.what}",
        flush=True,
    )
    for check in row.checks:
        if not check.ok and check is not worst:
            print(
                f"{'':<{_width()}}         {_figure(check):>12}  {_limit(check):>12}  {check.what}"
            )


def _figure(check: Check) -> str:
    return "-" if math.isnan(check.figure) else f"{check.figure:.3g} {check.unit}".strip()


def _limit(check: Check) -> str:
    return f"{check.limit:.3g} {check.unit}".strip()


def _as_markdown(row: Row) -> str:
    case, worst = row.case, row.worst
    cells = (f"`{case.id}`", case.about, case.reference, worst.what, _figure(worst), _limit(worst))
    return f"| {' | '.join(cells)} | {'yes' if row.ok else 'NO'} |"


def _as_json(row: Row) -> dict[str, Any]:
    checks = [_check_as_json(check) for check in row.checks]
    return {
        "id": row.case.id, **_check_as_json(row.worst), "ok": row.ok, "about": row.case.about,
        "reference": row.case.reference, "seconds": round(row.seconds, 2), "checks": checks,
    }  # fmt: skip


def _check_as_json(check: Check) -> dict[str, Any]:
    figure = float(check.figure) if math.isfinite(check.figure) else None
    return {
        "ok": check.ok, "figure": figure, "limit": float(check.limit), "unit": check.unit,
        "what": check.what,
    }  # fmt: skip
