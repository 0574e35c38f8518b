"""Last lines of a run: where it ended."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from sample_snapshot import lifted

from rope_twin.cli import CaseProgress
from rope_twin.run.options import RunOptions
from rope_twin.run.progress import FigureProgress
from rope_twin.run.summary import RunSummary, summarise
from validation.rigs import Rig


def test_of_one_rope_it_is_its_lower_end() -> None:
    """A payload only where there is one."""
    twin = Rig(length=100.0, elements=10).twin()
    snapshot = twin.snapshot()
    lines = summarise(twin, snapshot, None).as_text().splitlines()
    assert lines[2].startswith("maximum tension ")
    assert lines[4] == "line out 100.0 m, payload at 100.3 m depth"
    twin.scene = replace(twin.scene, payloads=())
    assert "m, lower end at 100.3 m depth" in summarise(twin, snapshot, None).as_text()


def test_a_view_that_was_not_written_is_not_named(tmp_path: Path) -> None:
    """A run without rerun, for example; the file exists as soon as the viewer has opened it."""
    options = RunOptions(headless=True, record=tmp_path / "lift")
    assert options.view_file is not None
    assert options.shown is None
    options.view_file.touch()
    assert options.shown == str(tmp_path / "lift.rrd")


def test_where_ropes_meet_it_is_every_rope_and_payload() -> None:
    """Elements are those of all ropes, and whose tension it is that was watched is said."""
    twin, snapshot = Rig(length=100.0, elements=10).twin(), lifted()
    summary = summarise(twin, snapshot, None)
    head, tension, _, *ends = summary.as_text().splitlines()
    assert ", 9 elements;" in head
    assert tension.startswith("top tension of hoist:")
    assert [line.rpartition(",")[0] for line in ends[:3]] == [
        "rope hoist: 100.0 m, 4 elements", "rope port: 8.0 m, 2 elements",
        "rope starboard: 8.0 m, 3 elements",
    ]  # fmt: skip
    assert ends[1].endswith("6.0 kN")
    assert ends[3] == "port at 107.6 m depth, starboard at 107.6 m depth"
    assert RunSummary.from_values(summary.row().values) == summary
    one = replace(summary, ropes=[summary.ropes[0] | {"elements": 1}])
    head, _, _, end, *_ = one.as_text().splitlines()
    assert ", 1 element;" in head
    assert ", 1 element, " in end


def test_refused_heave_is_reported_with_the_newest_reason() -> None:
    twin = Rig(length=100.0, elements=10).twin()
    twin.submit_heave(10_000_000, 0.1, 0.0)
    assert "rejected" not in summarise(twin, twin.snapshot(), None).as_text()
    twin.submit_heave(20_000_000, 90.0, 0.0)
    said = summarise(twin, twin.snapshot(), None).as_text()
    assert "1 of 2 heave samples rejected; last: heave: position 90 m" in said


class Terminal(io.StringIO):
    """One of 80 columns."""

    def isatty(self) -> bool:
        return True


def test_progress_stays_on_its_line_of_a_terminal() -> None:
    """A line that wraps cannot be written over: each one pushed the last up."""
    twin = Rig(length=100.0, elements=10).twin()
    summary = replace(summarise(twin, twin.snapshot(), None), late_steps=7)
    assert len(summary.as_progress()) > 80
    screen = Terminal()
    progress = FigureProgress(screen)
    progress.show(summary.as_progress())
    progress.show(replace(summary, time_s=1.0).as_progress())
    CaseProgress(screen).show(1, 2, "words " * 30)
    assert "\n" not in screen.getvalue()
    assert max(map(len, screen.getvalue().split("\r"))) < 80
    assert "7 late" in screen.getvalue()


@cache
def good() -> dict[str, str]:
    """Values of a run; when asked for, as every worker reads this file and a twin is compiled."""
    return summarise(Rig(length=100.0, elements=10).twin(), lifted(), None).row().values


NAMES = st.deferred(lambda: st.sampled_from([*good(), "other"]))
NONSENSE = st.one_of(
    st.text(), st.sampled_from(["null", "[]", "{}", '"x"', "1e999", "NaN", "-1", "true", "[1]"])
)


@settings(max_examples=300, deadline=None)
@given(st.dictionaries(NAMES, NONSENSE, max_size=4), st.booleans())
def test_values_of_anybody_are_figures_that_can_be_printed_or_none(
    wrong: dict[str, str], whole: bool
) -> None:
    """They come from the network: nothing in them may end the process that reads them."""
    summary = RunSummary.from_values(good() | wrong if whole else wrong)
    if summary is not None:
        assert summary.as_text()
        assert summary.as_progress()
        assert summary.as_json()


def test_values_of_a_wrong_type_are_no_figures() -> None:
    for key, value in (("steps", "1.5"), ("scene", "3"), ("ropes", '["hoist"]'), ("error", "0")):
        assert RunSummary.from_values(good() | {key: value}) is None, key
    assert RunSummary.from_values(good()) is not None
