"""A paced run over ROS and one as fast as possible without it: equal to the bit."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from ros_process import Processes

from rope_twin.messages import decode
from rope_twin.recording.bag import BagReader
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import run_unpaced

pytestmark = pytest.mark.ros
SECONDS = 5.0
COMPARED = (
    "ropes/tension_top", "ropes/tension_top_error", "ropes/tension_bottom", "ropes/length",
    "ropes/element_tension", "ropes/nodes", "ropes/utilisation", "ropes/markers", "payloads/state",
    "hang_off/wrench", "hang_off/odometry",
)  # fmt: skip


def messages(
    bag: Path, topics: tuple[str, ...] = (*COMPARED, "ship/heave", "twin/epoch")
) -> dict[str, list[bytes]]:
    with BagReader(bag) as reader:
        return {topic: [data for _, data in reader.messages(f"/{topic}")] for topic in topics}


def epoch_ns(reported: dict[str, list[bytes]]) -> int:
    epoch = decode("twin/epoch", reported["twin/epoch"][0])
    return int(epoch.sec) * 1_000_000_000 + int(epoch.nanosec)


def test_paced_and_unpaced_bags_hold_the_same_bytes(processes: Processes, tmp_path: Path) -> None:
    process = processes.early(
        "run", "deep_lift", "--duration", str(SECONDS), "--headless", "--json",
        "--out", str(tmp_path / "paced"),
    )  # fmt: skip
    assert process.wait() == 0
    paced = json.loads(process.text.strip().splitlines()[-1])
    # Equality is promised for equal inputs: all must have come, and in time.
    assert paced["heave_refused"] == paced["commands_refused"] == 0
    assert paced["heave_accepted"] >= 20 * SECONDS + 2
    assert paced["commands_accepted"] >= 10 * SECONDS
    options = RunOptions(scene="deep_lift", end_s=SECONDS, speed=0.0, record=tmp_path / "unpaced")
    heard = messages(tmp_path / "paced")
    unpaced = run_unpaced(options, lambda run: None, epoch_ns(heard))
    assert unpaced.steps == paced["steps"] == 500
    reported = messages(tmp_path / "unpaced")
    for topic in COMPARED:
        assert reported[topic] == heard[topic], topic
    for key in ("tension_top_max_n", "tension_top_mean_n", "tension_top_min_n", "line_out_m",
                "payload_depth_m"):  # fmt: skip
        assert getattr(unpaced, key) == paced[key], key
    assert paced["tension_top_error_pct"] == unpaced.tension_top_error_pct > 0.0
    inputs = reported["ship/heave"]
    assert heard["ship/heave"][: len(inputs)] == inputs


@pytest.mark.long
def test_so_do_they_where_the_rope_is_cut_above_a_body(
    processes: Processes, tmp_path: Path
) -> None:
    """Both parts and the slings, from before the cut until the body is in the water."""
    process = processes.early(
        "run", "manifold_lift", "--duration", "3", "--cut", "end@1.003", "--headless", "--json",
        "--out", str(tmp_path / "paced"),
    )  # fmt: skip
    assert process.wait() == 0
    paced = json.loads(process.text.strip().splitlines()[-1])
    assert paced["cut"]["left_m"] == pytest.approx(21.0, abs=0.01)
    names = (
        "ropes/tension_top",
        "ropes/nodes",
        "payloads/state",
        "slings/state",
        "payloads/body",
        "twin/epoch",
    )
    heard = messages(tmp_path / "paced", names)
    options = RunOptions(
        scene="manifold_lift", end_s=3.0, speed=0.0, record=tmp_path / "unpaced", cut="end@1.003"
    )
    unpaced = run_unpaced(options, lambda run: None, epoch_ns(heard))
    assert unpaced.payload_depth_m == paced["payload_depth_m"] > 2.0
    reported = messages(tmp_path / "unpaced", names)
    for topic in names[:-1]:
        assert len(reported[topic]) > 40
        assert reported[topic] == heard[topic], topic


def test_the_comparison_can_fail(tmp_path: Path) -> None:
    """Another second of the sea gives other bytes: the equality above is not trivial."""
    for name, start_s in (("one", 0.0), ("other", 1.0)):
        options = RunOptions(
            scene="shallow_lift", end_s=2.0, speed=0.0, record=tmp_path / name, sea_offset_s=start_s
        )
        run_unpaced(options, lambda run: None, 10**18)
    one, other = messages(tmp_path / "one"), messages(tmp_path / "other")
    for topic in ("ropes/tension_top", "payloads/state"):
        assert one[topic] != other[topic]
