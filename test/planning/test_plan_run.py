"""Small plans run to their end: bisection against a full grid, resumption, determinism, output."""

from __future__ import annotations

import json
import math
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet
import pytest
import xarray

from rope_twin.cli import main
from rope_twin.core.jit.wide import LANES
from rope_twin.errors import InputError
from rope_twin.files import share_dir
from rope_twin.planning import cells
from rope_twin.planning import run as planned
from rope_twin.planning.cells import Cell, CellLimit, RowStore, bisect
from rope_twin.planning.phases import Leg, legs_of
from rope_twin.planning.plan_file import AtDepth, Heights, Phase, Seeds
from rope_twin.planning.plan_reader import read_plan, tip_of
from rope_twin.planning.results import load_chart, notes, result_object
from rope_twin.planning.run import (
    CellTask,
    PlanFolder,
    cell_named,
    find_cell,
    plan,
    plan_stamp,
    prepare,
)
from rope_twin.planning.run import run_plan as run
from rope_twin.planning.runs import Row, run_seeds
from rope_twin.planning.seas import SeaState, Ship
from rope_twin.scene.load import load_scene
from rope_twin.scene.load_chart import read_load_chart

SMALL = """about: one depth, two periods
scene: deep_lift
vessel:
  responses: vessel_120m
  crane_tip_m: [10.0, 18.0, 12.0]
sea:
  hs_m: {from: 1.0, to: 5.0, step: 0.5}
  tp_s: [9.0, 12.0]
  headings_deg: [135.0]
phases:
  - at_depth: {depth_m: 2900.0, exposure_s: 120.0}
criteria: {swl_n: 345000.0}
method: {seeds: {start: 8, most: 16}, settle_s: 30.0, elements: 12, step_s: 0.1, within: 0.02}
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the path of the small plan."""
    path = tmp_path_factory.mktemp("plan") / "small.yaml"
    path.write_text(SMALL)
    return path


def plain(found: dict) -> dict:
    """Return an object of results without what differs from run to run."""
    return {key: value for key, value in found.items() if key != "elapsed_s"}


def test_limits_are_those_of_the_full_grid(small: Path) -> None:
    """Bisection ends within one step of the last height that passes, and judges fewer."""
    own, scene = read_plan(small)
    store = RowStore()
    found = run(own, scene, store, threads=1)
    works = prepare(own, scene)
    for cell, limit in zip(own.grid, found.cells, strict=True):
        full = Cell(own, works[0], cell, store)
        passed = [full.judge(k, narrow=True).passed for k in range(len(full.heights_m))]
        last = passed.index(False) - 1
        assert not any(passed[last + 1 :]), "the use grows with the height"
        assert limit.height_m is not None
        assert abs(full.heights_m.index(limit.height_m) - last) <= 1
        assert limit.heights < len(passed)
        assert limit.low_m <= limit.crossing_m <= limit.high_m
        assert limit.height_m <= limit.crossing_m <= limit.height_m + 0.5
        assert limit.governing == "swl_n"


def test_no_random_number_but_the_seed(small: Path) -> None:
    """A plan gives the same rows to the bit, whatever the threads; another seed others."""
    own, scene = read_plan(small)
    stores = [RowStore(), RowStore(), RowStore()]
    for store, threads in zip(stores[:2], (1, 2), strict=True):
        run(own, scene, store, threads=threads)
    assert stores[0].rows == stores[1].rows
    other = replace(own, method=replace(own.method, seed=2))
    run(other, scene, stores[2], threads=1)
    some = min(stores[0].rows.keys() & stores[2].rows.keys())
    assert stores[0].rows[some]["top_max_n"] != stores[2].rows[some]["top_max_n"]


def test_limiting_height_as_narrow_as_asked(small: Path) -> None:
    """Seeds are added at both sides of the limit until its interval is narrow, or there are no
    more.
    """
    own, scene = read_plan(small)
    wide = run(own, scene, RowStore(), threads=1).cells[0]
    seeds = replace(own.method.seeds, most=200)
    method = replace(own.method, height_within_m=0.2, seeds=seeds)
    found = run(replace(own, method=method), scene, RowStore(), threads=1).cells[0]
    assert 0.5 * (wide.high_m - wide.low_m) > 0.2
    assert 0.5 * (found.high_m - found.low_m) <= 0.2
    assert found.runs > wide.runs
    assert found.low_m <= found.crossing_m <= found.high_m


def test_tasks_travel(small: Path) -> None:
    """A cell that was pickled, with some of its rows, has the limit of one that was not."""
    own, scene = read_plan(small)
    store = RowStore()
    expected = run(own, scene, store, threads=1)
    works = prepare(own, scene)
    some = {run: row for run, row in store.rows.items() if row["seed"] < 8}
    task = pickle.loads(pickle.dumps(CellTask(own, works[own.grid[1][0]], 1, some)))
    number, limit, rows = find_cell(task)
    assert (number, limit) == (1, expected.cells[1])
    assert rows
    for row in rows:  # repr: numbers to the bit, where some are not a number
        assert repr(store.rows[row["run"]]) == repr(row)


def test_no_scheduler_there(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence."""
    words = ["plan", str(small), "--out", str(tmp_path), "--scheduler", "foo"]
    assert main(words) == 1
    assert "--scheduler foo: it is no address" in capsys.readouterr().err


@pytest.mark.long
def test_cluster_of_which_a_worker_dies(small: Path) -> None:
    """1,000 runs on two workers, one killed on the way: rows and limits to the bit."""
    distributed = pytest.importorskip("distributed")
    own, scene = read_plan(small)
    sea = replace(own.sea, tp_s=(8.0, 9.0, 10.0, 11.0, 12.0, 13.0), headings_deg=(135.0, 180.0))
    method = replace(own.method, within=0.005, seeds=Seeds(start=8, most=48))
    large = replace(own, sea=sea, method=method)
    alone, apart = RowStore(), RowStore()
    expected = run(large, scene, alone)
    killed = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:

        def report(done: int, total: int, runs: int) -> None:
            if done == 3 and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        found = run(large, scene, apart, report, scheduler=cluster.scheduler_address)
    assert killed
    assert found.runs >= 1000
    assert found.cells == expected.cells
    for number, row in apart.rows.items():
        assert repr(alone.rows[number]) == repr(row)


class Ending(RowStore):
    """A store that is interrupted after some rows."""

    def add(self, rows: list[Row]) -> None:  # type: ignore[override]
        """Keep rows; then stop."""
        super().add(rows)
        if len(self.rows) >= 24:
            raise KeyboardInterrupt


def test_interrupted_plans_continue(small: Path) -> None:
    """The rows that are there are not run again, and the limits are the same."""
    own, scene = read_plan(small)
    whole = RowStore()
    expected = run(own, scene, whole, threads=1)
    cut = Ending()
    with pytest.raises(KeyboardInterrupt):
        run(own, scene, cut, threads=1)
    kept = dict(cut.rows)
    assert 0 < len(kept) < len(whole.rows)
    rest = RowStore(dict(kept))
    made: list[int] = []
    found = run(own, scene, rest, lambda done, total, runs: made.append(runs), threads=1)
    assert rest.rows == whole.rows
    assert made[-1] == len(whole.rows) - len(kept)
    assert plain(result_object(found)) == plain(result_object(expected))


def test_killed_plans_continue(small: Path, tmp_path: Path) -> None:
    """A process that is killed leaves whole files; the command goes on from them."""
    words = ["plan", str(small), "--out", str(tmp_path / "killed"), "--threads", "1", "--json"]
    code = "import sys; from rope_twin.cli import main; sys.exit(main(sys.argv[1:]))"
    child = subprocess.Popen(
        [sys.executable, "-c", code, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    end = time.monotonic() + 60.0
    while time.monotonic() < end and not list(tmp_path.glob("killed/part-*.parquet")):
        time.sleep(0.01)
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    parts = list(tmp_path.glob("killed/part-*.parquet"))
    assert parts
    stamp = parts[0].stat().st_mtime_ns
    own, scene = read_plan(small)
    with PlanFolder(tmp_path / "killed", own, plan_stamp(own, scene)) as folder:
        assert folder.store.rows
        assert parts[0].stat().st_mtime_ns == stamp
        found = run(own, scene, folder.store, threads=1)
    expected = run(own, scene, RowStore(), threads=1)
    assert plain(result_object(found)) == plain(result_object(expected))


def test_nothing_is_run_twice(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither trials of settings nor runs for an error: a killed plan goes on with the next run."""
    path, out = tmp_path / "chosen.yaml", tmp_path / "out"
    text = SMALL.replace("tp_s: [9.0, 12.0]", "tp_s: [9.0]").replace("start: 8", "start: 4")
    path.write_text(text.replace("elements: 12, step_s: 0.1, ", ""))
    words = ["plan", str(path), "--out", str(out), "--threads", "1", "--json"]
    code = "import sys; from rope_twin.cli import main; sys.exit(main(sys.argv[1:]))"
    child = subprocess.Popen(
        [sys.executable, "-c", code, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    end = time.monotonic() + 60.0
    while time.monotonic() < end and len(list(out.glob("part-*.parquet"))) < 3:
        time.sleep(0.01)
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    own, scene = read_plan(path)
    stepped: list[tuple[Any, ...]] = []

    def counted(leg: Leg, ship: Ship, sea: SeaState, seeds: Sequence[int]) -> list[Row]:
        line = leg.scene.ropes[0].elements, leg.scene.time.step_s, sea.height_m, leg.seconds
        stepped.extend((*line, seed) for seed in seeds)
        return run_seeds(leg, ship, sea, seeds)

    for module in (cells, planned):
        monkeypatch.setattr(module, "run_seeds", counted)
    whole = RowStore()
    expected = run(own, scene, whole, threads=1)
    made = {"error", "setting", "statistics"}
    assert {row["purpose"] for row in whole.rows.values()} == made
    assert len(stepped) == len(whole.rows)
    stepped.clear()
    with PlanFolder(out, own, plan_stamp(own, scene)) as folder:
        kept = len(folder.store.rows)
        assert kept > 0
        found = run(own, scene, folder.store, threads=1)
        assert len(stepped) == len(whole.rows) - kept
        stepped.clear()
        again = run(own, scene, folder.store, threads=1)
        assert repr(dict(sorted(folder.store.rows.items()))) == repr(
            dict(sorted(whole.rows.items()))
        )
    assert not stepped
    for one in (found, again):
        assert plain(result_object(one)) == plain(result_object(expected))


def test_command_writes_rows_chart_and_picture(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One object on stdout; a row for each run; the chart says what is allowed."""
    out = tmp_path / "out"
    assert main(["plan", str(small), "--out", str(out), "--json", "--netcdf"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["plan"] == "small"
    rows = parquet.read_table(out / "runs.parquet").to_pylist()
    assert len(rows) >= found["runs"]
    for key in ("seed", "sea_seed", "elements", "step_s", "top_max_n", "payload_min_n", "failure"):
        assert key in rows[0]
    assert (out / "limits.png").stat().st_size > 5000
    assert json.loads((out / "plan.json").read_text())["cells"] == found["cells"]
    with xarray.open_dataset(out / "plan.nc") as data:
        assert data.limiting_hs_m.values.ravel().tolist() == [
            cell["limiting_hs_m"] for cell in found["cells"]
        ]
        assert data.sizes["run"] == found["runs"]
    chart = read_load_chart(out / "load_chart.json")
    assert (chart.plan, chart.scene, chart.tp_s) == ("small", "deep_lift", (9.0, 12.0))
    limit = found["cells"][0]["limiting_hs_m"]
    assert chart.allowed_height_m("at_depth", 9.0, 135.0) == limit
    assert chart.allowed_height_m("at_depth", 9.0, -135.0) == 0.0, "not declared symmetric"
    assert chart.allowed_height_m("at_depth", 9.0, -225.0) == limit
    both = [cell["limiting_hs_m"] for cell in found["cells"]]
    assert chart.allowed_height_m("at_depth", 10.0, 135.0) == min(both)
    assert chart.allowed_height_m("at_depth", 8.0, 135.0) == 0.0
    assert chart.phases["at_depth"].governing[0] == ("swl_n",)
    listed = json.loads((out / "load_chart.json").read_text())["limits"]
    assert [row["limit_hs_m"] for row in listed] == both
    cell = found["cells"][0]
    assert 0.0 < cell["discretisation_error"] < 0.02
    assert cell["daf"] == pytest.approx(
        cell["at_limit"]["values"]["hook_load"]["value"] / found["phases"][0]["static_hook_n"]
    )
    assert main(["plan", str(small), "--out", str(out), "--report"]) == 0
    check_report((out / "report.html").read_text(), found)
    assert (out / "report.pdf").read_bytes().startswith(b"%PDF")
    table = capsys.readouterr()
    assert "at_depth" in table.out
    assert "345" not in table.err
    assert main(["plan", str(small), "--out", str(out), "--cell", "at_depth,9,135", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    worst = max(
        row["top_max_n"] for row in rows
        if row["hs_m"] == shown["hs_m"] and row["tp_s"] == 9.0 and row["seed"] == shown["seed"]
        and row["purpose"] == "statistics"
    )  # fmt: skip
    assert shown["hook_load_max_n"] == worst
    series = np.loadtxt(shown["series"], delimiter=",", skiprows=1)
    assert series[:, 1].max() == pytest.approx(worst, rel=1e-5)
    assert Path(shown["picture"]).stat().st_size > 5000


class Page(HTMLParser):
    """Checks that elements are nested and closed, and collects addresses and names."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.names: list[str] = []
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        if tag not in ("meta", "br", "link", "img"):
            self.open.append(tag)
        for key, value in attrs:
            if key == "id" and value:
                self.names.append(value)
            if key in ("href", "src", "xlink:href") and value:
                self.addresses.append(value)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element that is empty."""
        self.handle_starttag(tag, attrs)
        if self.open and self.open[-1] == tag:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        """Close the element that is open."""
        assert self.open.pop() == tag


def check_report(text: str, found: dict) -> None:
    """Check that a report is one whole file with everything that was found."""
    page = Page()
    page.feed(text)
    assert not page.open
    assert len(page.names) == len(set(page.names))
    names = {f"#{name}" for name in page.names}
    assert page.addresses
    assert set(page.addresses) <= names, "nothing outside the file is needed"
    assert text.count("<svg") == 5
    for words in (found["plan_digest"], found["scene_digest"], "What is not covered", "SWL",
                  "Gumbel", "DNV-RP-N103", "vessel_120m", "Governing runs"):  # fmt: skip
        assert words in text, words
    for cell in found["cells"]:
        assert f">{1e-3 * max(one['hook_n'] for one in cell['simplified']):.0f}</td>" in text
    assert "/tmp/" not in text


def test_python_and_command_agree(small: Path, tmp_path: Path) -> None:
    """`from rope_twin import plan` finds what the command finds, in memory or in a folder."""
    import rope_twin

    kept = rope_twin.plan(small, tmp_path / "kept", threads=1)
    again = rope_twin.plan(small, tmp_path / "kept", threads=1)
    memory = rope_twin.plan(str(small), threads=2)
    assert (tmp_path / "kept" / "runs.parquet").is_file()
    assert again.made == 0 < kept.made == memory.made
    assert kept.cells == memory.cells == again.cells
    assert [cell.period_s for cell in kept.of_phase("at_depth")] == [9.0, 12.0]


def test_folder_of_another_plan_is_refused(small: Path, tmp_path: Path) -> None:
    """Rows of other numbers do not mix."""
    own, scene = read_plan(small)
    with PlanFolder(tmp_path / "one", own, plan_stamp(own, scene)):
        pass
    other = tmp_path / "other.yaml"
    other.write_text(SMALL.replace("345000.0", "350000.0"))
    with pytest.raises(InputError, match="its rows are of another plan, scene or solver"):
        plan(other, tmp_path / "one")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("at_depth,9", "it is no cell; write PHASE,TP,HEADING"),
        ("lowering,9,135", "there is no phase 'lowering'; known: at_depth"),
        ("at_depth,8,135", "there is no Tp '8'; known: 9, 12"),
        ("at_depth,9,x", "there is no heading 'x'; known: 135"),
    ],
)
def test_cells_that_are_not_there(words: str, said: str, small: Path) -> None:
    """One sentence each."""
    with pytest.raises(InputError, match=said):
        cell_named(read_plan(small)[0], words)


def test_command_without_a_plan(capsys: pytest.CaptureFixture[str]) -> None:
    """It says how to begin; --example prints a plan that is read."""
    assert main(["plan"]) == 1
    assert "no plan is named; give a file, or begin with --example" in capsys.readouterr().err
    assert main(["plan", "--example"]) == 0
    assert capsys.readouterr().out.startswith("# rope_twin plan deep_installation")


@pytest.mark.parametrize("border", range(-1, 9))
@pytest.mark.parametrize("guess", [None, 0, 4, 7])
def test_bisection_finds_every_border(border: int, guess: int | None) -> None:
    """Last index that passes, with fewer calls than indices and none twice."""
    asked: list[int] = []

    def passes(k: int) -> bool:
        asked.append(k)
        return k <= border

    assert bisect(8, passes, guess) == min(border, 7)
    assert len(asked) == len(set(asked)) <= 6


def test_limits_that_nothing_meets(small: Path, tmp_path: Path) -> None:
    """A crane that holds the static load alone: no height, not even the lowest, is allowed."""
    own, scene = read_plan(small)
    weak = replace(own, criteria=replace(own.criteria, swl_n=300e3))
    found = run(weak, scene, RowStore(), threads=1)
    assert (
        "at_depth: the static hook load of 313 kN alone is above its limit of 300 kN"
        in "\n".join(notes(found))
    )
    limit: CellLimit = found.cells[0]
    assert limit.height_m is None
    assert limit.judged is None
    assert limit.beyond is not None
    assert (limit.crossing_m, limit.low_m, limit.high_m) == (0.0, 0.0, 0.0)
    path = tmp_path / "chart.json"
    path.write_text(json.dumps(load_chart(found)))
    assert read_load_chart(path).allowed_height_m("at_depth", 9.0, 135.0) == 0.0
    assert result_object(found)["cells"][0]["limiting_hs_m"] is None


def test_a_limit_out_of_reach_at_rest_is_met_by_neither_method(small: Path, tmp_path: Path) -> None:
    """A minimum tension above the weight of the payload."""
    path = tmp_path / "taut.yaml"
    path.write_text(small.read_text().replace("345000.0", "345000.0, min_tension_n: 500000.0"))
    for cell in plan(path).cells:
        assert (cell.height_m, cell.simplified_height_m) == (None, None)
        assert cell.governing == "min_tension_n is out of reach at rest"


def test_landing_speed_is_that_of_the_winch_in_flat_water() -> None:
    """In a sea of 5 cm the payload lands at the speed of the winch, and did not slacken before."""
    own, scene = read_plan("landing")
    works = prepare(own, scene)
    number = next(k for k, phase in enumerate(own.phases) if phase.kind == "landing")
    cell = Cell(own, works[number], (number, 0, 0), RowStore())
    cell.heights_m = [0.05]
    rows = cell.rows(0, 4)
    for row in rows:
        assert row["landing_speed_m_per_s"] == pytest.approx(0.2, abs=0.03)
        assert row["payload_min_n"] > 0.9 * works[number].weight_n
        assert not row["failure"]


@pytest.mark.long
def test_seeds_of_a_rigid_body_together_are_those_alone() -> None:
    """A manifold comes into waves: the same rows to the bit in lanes and one by one."""
    plan, _ = read_plan("splash_zone")
    scene = load_scene("manifold_lift")
    (leg,) = legs_of(plan, scene, plan.phases[0])
    leg = replace(leg, first_s=3.0, seconds=8.0)
    ship, sea = Ship(tip_of(plan, scene), 0.0), plan.sea_state(1.5, 0, 0)
    together = run_seeds(leg, ship, sea, range(LANES))
    for seed in (0, LANES - 1):
        np.testing.assert_equal(together[seed], *run_seeds(leg, ship, sea, [seed]))
    assert len({row["depth_at_max_m"] for row in together}) == LANES


def test_compensation_stroke_is_that_of_the_heave() -> None:
    """With active compensation the line out follows the tip: stroke near the heave's largest."""
    own, _ = read_plan("deep_installation")
    ahc = load_scene("ahc_lift")
    assert ahc.winch is not None
    hanging = AtDepth(depth_m=ahc.ropes[0].length_m, exposure_s=120.0)
    method = replace(own.method, elements=12, step_s=0.1, settle_s=30.0)
    made = replace(own, phases=(Phase(at_depth=hanging),), method=method)
    works = prepare(made, ahc)
    cell = Cell(made, works[0], (0, 1, 0), RowStore())
    rows = cell.rows(2, 4)
    assert all(0.05 < row["stroke_m"] < 2.0 for row in rows)
    bare_winch = replace(ahc.winch, heave_compensation=None, schedule=(),
                        schedule_repeats_every_s=None)  # fmt: skip
    still = prepare(made, replace(ahc, winch=bare_winch))
    bare = Cell(made, still[0], (0, 1, 0), RowStore()).rows(2, 4)
    assert all(row["stroke_m"] == 0.0 for row in bare)
    for row, other in zip(rows, bare, strict=True):
        assert row["top_max_n"] < other["top_max_n"]


def test_remarks_are_in_numbers(small: Path, tmp_path: Path) -> None:
    """Wide intervals, shallow payloads, steep seas and short tables of RAOs are remarked on."""
    own, _ = read_plan(small)
    scene = load_scene("shallow_lift")
    hanging = AtDepth(depth_m=150.0, exposure_s=60.0)
    sea = replace(own.sea, tp_s=(5.0,), hs_m=Heights(from_=3.0, to=3.0, step=0.2))
    method = replace(own.method, seeds=Seeds(start=3, most=3), within=1e-3, settle_s=1.0)
    table = share_dir() / "config" / "responses" / "vessel_120m.csv"
    rows = [row for row in table.read_text().splitlines() if not re.match(r"\d+,0\.[1-9]", row)]
    (tmp_path / "short.csv").write_text("\n".join(rows))
    assert own.vessel is not None
    vessel = replace(own.vessel, responses=str(tmp_path / "short.csv"))
    steep = replace(own, phases=(Phase(at_depth=hanging),), sea=sea, method=method, vessel=vessel)
    said = "\n".join(notes(run(steep, scene, RowStore(), threads=1)))
    assert "At Tp 5 s limits lie above the steepest usual seas of DNV-RP-C205" in said
    assert "% of the variance of the tip's motion lies above the highest frequency" in said
    assert "The limits hold at Tp 5 s alone" in said
    assert "has no waves" not in said
    long = replace(steep, sea=replace(sea, tp_s=(16.0,)), vessel=own.vessel)
    said = "\n".join(notes(run(long, scene, RowStore(), threads=1)))
    assert "3 seeds leave an interval wider than ±0.1 %" in said
    assert "the payload is at 150 m, less than half of the longest waves' 400 m" in said
    assert "highest frequency" not in said


def test_a_plan_of_one_period_warns_before_its_runs(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Operability and console interpolate between periods: the warning comes before any run."""
    one = tmp_path / "one.yaml"
    one.write_text(small.read_text().replace("[9.0, 12.0]", "[9.0]"))
    for path, warnings in ((small, 0), (one, 1)):
        words = ["plan", str(path), "--out", str(tmp_path), "--scheduler", "foo"]
        assert main(words) == 1  # there is no such scheduler
        said = capsys.readouterr().err
        assert said.count("warning: The limits hold at Tp 9 s alone") == warnings


def test_rows_hold_finite_numbers(small: Path) -> None:
    """Judged columns are finite throughout."""
    own, scene = read_plan(small)
    store = RowStore()
    run(own, scene, store, threads=1)
    for row in store.rows.values():
        assert all(
            math.isfinite(row[key])
            for key in ("top_max_n", "top_min_n", "payload_min_n", "min_n", "at_s", "stroke_m")
        )
