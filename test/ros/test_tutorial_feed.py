"""The feed of the tutorial "A real winch and MRU": the simulation believes it and follows it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from ros_bench import Bench
from ros_process import Processes

pytestmark = pytest.mark.ros
PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "winch_and_mru.md"


def test_the_simulation_follows_the_feed(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    (program,) = re.findall(
        r":caption: feed.py\n\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
    (tmp_path / "feed.py").write_text(program, "utf-8")
    processes.node("simulation", scene="shallow_lift")
    diagnostics, winch = bench.listen("diagnostics"), bench.listen("ropes/length")
    bench.until(lambda: winch, "a simulation that publishes")
    processes.start([str(tmp_path / "feed.py")])

    def is_believed() -> bool:
        """Return whether the newest row of heave is OK, a second of samples after the first."""
        rows = [row for message in diagnostics[-1:] for row in message.status]
        (row,) = [row for row in rows if row.name == "simulation: input heave"] or [None]
        accepted = {} if row is None else {pair.key: pair.value for pair in row.values}
        return int(accepted.get("accepted", 0)) > 20 and int(row.level) == 0

    bench.until(lambda: winch[-1].velocity[0] == pytest.approx(0.2, abs=1e-6), "its pay-out speed")
    bench.until(is_believed, "heave that is believed")
