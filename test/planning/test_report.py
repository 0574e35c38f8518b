"""The report's content, and both layouts of it: every word of the content is in each."""

from __future__ import annotations

import html
import io
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pypdfium2
import pytest

from rope_twin import load_scene
from rope_twin.cli.selection import read_share
from rope_twin.planning.cells import RowStore
from rope_twin.planning.judgement import judge, limits_of
from rope_twin.planning.phases import legs_of
from rope_twin.planning.pictures import arrangement_figure, series_csv, tip_figure
from rope_twin.planning.plan_reader import read_plan
from rope_twin.planning.report import Figure, Heading, Report, Table, Text, html_report, pdf_report
from rope_twin.planning.report_content import _object, report_of
from rope_twin.planning.run import PlanResult, run_plan
from rope_twin.planning.tables import further_tables
from rope_twin.scene.lift import lift_figures

PLAN = """about: hanging deep & deeper
source: assumptions of a test
scene: deep_lift
vessel:
  responses: vessel_120m
  crane_tip_m: [10.0, 18.0, 12.0]
sea:
  hs_m: {from: 1.0, to: 3.0, step: 1.0}
  tp_s: [9.0, 12.0]
  headings_deg: [135.0, 180.0]
phases:
  - {name: halfway, at_depth: {depth_m: 1500.0, exposure_s: 60.0}}
  - lowering: {from_m: 2000.0, to_m: 2030.0, speed_m_per_s: 0.5}
criteria: {swl_n: 330000.0}
method: {seeds: {start: 4, most: 4}, settle_s: 20.0, elements: 10, step_s: 0.1}
uncertainties:
  - {key: criteria.swl_n, name: SWL, uniform: {from: 325000.0, to: 335000.0}, source: crane chart}
  - {key: "scene.payloads[0].mass_kg", factor: true, normal: {mean: 1.0, std: 0.02}, source: guess}
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> PlanResult:
    """Return the result of the plan."""
    path = tmp_path_factory.mktemp("plan") / "deeper.yaml"
    path.write_text(PLAN)
    return run_plan(*read_plan(path), RowStore())


@pytest.fixture(scope="module")
def report(result: PlanResult) -> Report:
    """Return its report."""
    return report_of(result)


def said(report: Report) -> list[str]:
    """Return every text of a report."""
    found = [report.title, report.lead, *(word for pair in report.facts for word in pair)]
    for block in report.blocks:
        if isinstance(block, Heading):
            found.append(block.words)
        elif isinstance(block, Text):
            found += block.lines
        elif isinstance(block, Table):
            found += [block.caption, *block.head, *(cell for row in block.rows for cell in row)]
        else:
            found.append(block.caption)
    return found


def test_tables_agree_on_the_lowest_limit(result: PlanResult) -> None:
    """A lower height at which the waves break is the end of the search, not a limit."""
    first, *rest = result.cells
    cells = [replace(cell, height_m=3.0, capped="") for cell in rest]
    broken = replace(first, height_m=1.0, capped="higher waves break")
    found = report_of(replace(result, cells=(broken, *cells)))
    tables = [block for block in found.blocks if isinstance(block, Table)]
    summary = next(table for table in tables if "lowest limiting Hs" in table.head)
    uses = next(table for table in tables if "criterion" in table.head and "Tp s" in table.head)
    for row in summary.rows:
        used = next(own for own in uses.rows if own[0] == row[0])
        assert row[2] == f"Tp {used[1]} s, heading {used[2]}°"


def test_the_command_of_the_report_is_one(result: PlanResult) -> None:
    """It runs in the folder of the plan, with the error that was aimed at, to the bit."""
    for share, option in ((0.015, "1.5%"), (0.011, "1.1%"), (0.0123456789, "1.23456789%")):
        selected = replace(result.plan.method, elements=None, step_s=None, error_within=share)
        found = report_of(replace(result, plan=replace(result.plan, method=selected)))
        rows = [row for block in found.blocks if isinstance(block, Table) for row in block.rows]
        (command,) = (row[1].strip("`") for row in rows if row[0] == "command")
        assert command == f"rope_twin plan deeper.yaml --within {option} --report"
        assert read_share("--within", command.split()[4], "the error") == share


def bare(words: str) -> str:
    """Return words without what a layout may break or add."""
    return re.sub(r"[\s`\u200b\xad\u2010-]", "", words)


def test_content_is_whole(report: Report) -> None:
    """Chapters in order, tables and figures numbered through, a row for each cell."""
    headings = [block.words for block in report.blocks if isinstance(block, Heading)]
    assert [words for words in headings if "." not in words.split()[0]] == [
        "1  Summary", "2  Basis", "3  Limiting sea states",
        "4  Resonance and the simplified method", "5  Governing runs",
        "6  Statistics and accuracy", "7  What is not covered", "A  Results of every cell",
        "B  Versions and digests",
    ]  # fmt: skip
    tables = [block for block in report.blocks if isinstance(block, Table)]
    figures = [block for block in report.blocks if isinstance(block, Figure)]
    for kind, blocks in (("Table", tables), ("Figure", figures)):
        for number, block in enumerate(blocks, 1):
            assert block.caption.startswith(f"{kind} {number}. ")
    assert len(figures) == 7, "arrangement, tip, limits, contours, resonance, two governing runs"
    limits = next(table for table in tables if "interval m" in table.head)
    assert len(limits.rows) == 8
    assert [row[0] for row in limits.rows] == ["halfway", "", "", "", "lowering", "", "", ""]
    for table in tables:
        assert all(len(row) == len(table.rows[0]) for row in table.rows)
    text = "\n".join(said(report))
    assert "Source of the plan: assumptions of a test" in text
    for words in (
        "Gumbel",
        "DNV-RP-N103",
        "vessel_120m",
        "SWL",
        "C_D·A",
        "rope_twin plan deeper",
        "uniform, 325 to 335 kN",
        "times normal, mean 1",
        "crane chart",
    ):
        assert words in text, words


def test_html_has_all_content(report: Report) -> None:
    """One file, every text in it, escaped."""
    page = html_report(report).decode()
    text = bare(html.unescape(re.sub(r"<svg.*?</svg>|<[^>]+>", "", page, flags=re.DOTALL)))
    assert [words for words in said(report) if bare(words) not in text] == []
    assert "deep &amp; deeper" in page
    assert page.count("<svg") == 7


def test_pdf_has_all_content(report: Report) -> None:
    """Every text is in it, in the order of reading within a page or two."""
    with pypdfium2.PdfDocument(io.BytesIO(pdf_report(report))) as document:
        pages = [bare(page.get_textpage().get_text_range()) for page in document]
        assert document.get_metadata_value("Title") == report.title
    text = "".join(pages)
    words = [one for one in said(report) if len(one) < 60]
    assert [one for one in words if bare(one) not in text] == []
    assert len(pages) > 5
    at = [text.rindex(bare(one.words)) for one in report.blocks
          if isinstance(one, Heading) and one.level == 1]  # fmt: skip
    assert at == sorted(at)


@pytest.mark.long
def test_reports_repeat(result: PlanResult) -> None:
    """Equal results give equal bytes, without a date."""
    first, second = report_of(result), report_of(result)
    assert html_report(first) == html_report(second)
    assert pdf_report(first) == pdf_report(second)


def test_wide_tables_leave_the_names_of_phases_their_width() -> None:
    """Heads of many words beside short numbers: no two words of a row overlap; over two pages."""
    head = ("phase", "Tp s", "heading °", "Hs m", "load at the lower end of the rope kN",
            "loss of the minimum tension kN", "re-hit speed of the deck m/s",
            "lateral offset m")  # fmt: skip
    report = Report("title", "lead", (("plan", "x"), ("scene", "x"), ("analysis", "x")))
    report.heading("Results")
    report.table("Values.", head, [("lift off", "8", *["180"] * 6)] * 60, (0,), (0,), True)
    with pypdfium2.PdfDocument(io.BytesIO(pdf_report(report))) as document:
        assert len(document) == 3
        assert "lateral offset" in document[2].get_textpage().get_text_range()
        page = document[1].get_textpage()

        def box(words: str) -> tuple[float, float, float, float]:
            start, count = page.search(words, match_case=True).get_next()
            assert page.count_rects(start, count) == 1, f"{words} is on one line"
            return page.get_rect(0)  # left, bottom, right, top

        assert box("phase")[2] < box("Tp")[0]
        assert box("lift off")[2] < box("8")[0]


def test_snap_of_a_leg_adds_to_its_own_static_load(result: PlanResult) -> None:
    """A short rope is stiff and carries less of itself than a long one."""
    work, cell = result.works[1], result.of_phase("lowering")[0]
    (leg,), (load,) = work.legs, cell.simplified
    short = replace(leg, static_hook_n=leg.static_hook_n - 1e5)
    stiff = replace(load, snap_n=load.snap_n + 5e4)
    two = replace(result, works=(replace(work, legs=(short, leg)),),
                  cells=(replace(cell, simplified=(stiff, load)),))  # fmt: skip
    (table,) = (one for one in further_tables(two) if one.title == "Snap check")
    words = dict(zip(table.rows[0], table.rows[1], strict=True))
    assert words["snap force kN"] == f"{1e-3 * load.snap_n:.0f}"
    assert words["static + snap kN"] == f"{1e-3 * (leg.static_hook_n + load.snap_n):.0f}"


def test_slack_is_a_share_of_the_time_of_all_legs(result: PlanResult) -> None:
    """A leg that is three times as long counts three times."""
    work = result.works[1]
    (leg,), row = work.legs, result.rows[-1]
    assert row["phase"] == "lowering"
    longer = replace(leg, number=1, seconds=leg.seconds + 2.0 * leg.window_s)
    rows = [{**row, "leg": k, "slack_share": share} for k, share in enumerate((0.1, 0.02))]
    judged = judge(result.plan, work.limits, rows, 1.0, (leg, longer))
    assert judged.slack_share == pytest.approx((0.1 + 3.0 * 0.02) / 4.0)


def test_criteria_name_what_is_compared(result: PlanResult) -> None:
    """A minimum tension is judged by the loss to it; another share of uplift is the plan's own."""
    own = replace(result.plan.criteria, min_tension_n=5e4, uplift_share=0.5)
    plan = replace(result.plan, criteria=own)
    works = [replace(work, limits=tuple(limits_of(plan, result.scene, work.legs)))
             for work in result.works]  # fmt: skip
    found = report_of(replace(result, works=tuple(works)))
    tables = [block for block in found.blocks if isinstance(block, Table)]
    rows = next(table.rows for table in tables if table.head == ("criterion", "limit", "source"))
    by_name = {row[0]: row[1:] for row in rows}
    allowed_n = works[0].weight_n - 5e4
    limit, source = by_name["loss to the minimum of 50 kN (`min_tension_n`)"]
    assert limit == f"{1e-3 * allowed_n:.0f} kN"
    assert source.startswith("plan; submerged weight less")
    assert by_name["slack (`uplift_share`)"] == ("0.5", "plan")


def test_spectra_state_their_height(result: PlanResult) -> None:
    """γ follows from Tp/√Hs, so that S/Hs² holds for one height."""
    _, sea = tip_figure(result).axes
    assert [text.get_text() for text in sea.get_legend().get_texts()] == ["9 s, 2 m", "12 s, 2 m"]


def test_times_of_a_series_stay_apart() -> None:
    """Steps of 6.25 ms after an hour."""
    time_s = 3600.0 + 0.00625 * np.arange(200.0)
    rows = series_csv(time_s, np.full((200, 3), 3e5)).splitlines()
    assert rows[1] == "3600,300000,300000,300000"
    assert [float(row.split(",")[0]) for row in rows[1:]] == time_s.tolist()


def test_static_hook_load_is_drawn_from_the_start_of_a_phase() -> None:
    """Through the splash zone: the object's weight in air at first."""
    plan, scene = read_plan("splash_zone")
    legs = legs_of(plan, scene, plan.phases[0])
    work = SimpleNamespace(title="splash zone", legs=legs)
    lowering: Any = SimpleNamespace(plan=plan, scene=scene, works=(work,))
    (line,) = arrangement_figure(lowering).axes[1].get_lines()
    kilonewtons, depths = line.get_data()
    assert depths[0] == pytest.approx(-4.0, abs=2e-3)
    assert 1e3 * kilonewtons[0] == pytest.approx(legs[0].static_hook_n, rel=1e-4)


def test_plan_without_a_limit_has_a_report(tmp_path: Path) -> None:
    """Where no height meets the criteria the report says so."""
    path = tmp_path / "heavy.yaml"
    path.write_text(PLAN.replace("330000.0", "200000.0"))
    plan, scene = read_plan(path)
    small = replace(plan, sea=replace(plan.sea, tp_s=(9.0,), headings_deg=(180.0,)),
                    phases=plan.phases[:1])  # fmt: skip
    report = report_of(run_plan(small, scene, RowStore()))
    text = "\n".join(said(report))
    assert "no sea state of the grid meets the criteria in phase 'halfway'" in text
    assert pdf_report(report).startswith(b"%PDF")


def test_each_section_of_the_rope_has_its_own_stiffness() -> None:
    """Chain, fibre and wire of hybrid_lift."""
    scene = load_scene("hybrid_lift")
    ropes = [value for name, value, _ in _object(scene) if name == "rope"]
    expected = [f"EA {1e-6 * bar.stiffness_n:.1f} MN" for bar in lift_figures(scene).bars]
    assert len(set(expected)) == len(scene.ropes[0].made_of)
    for words, stiffness in zip(ropes, expected, strict=True):
        assert stiffness in words
