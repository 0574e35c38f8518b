"""VIV response and fatigue damage of a rope, received by a second process."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pytest
from ros_bench import Bench
from ros_process import Processes

from rope_twin.messages import read_cloud
from rope_twin.recording.bag import BagReader

pytestmark = pytest.mark.ros


def test_a_process_that_listens_hears_them_and_the_recorder_keeps_them(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    shaking, used = bench.listen("ropes/vibration"), bench.listen("ropes/fatigue")
    recorder = processes.node("recorder", out=str(tmp_path / "bag"))
    recorder.until_says("recording to")
    simulation = processes.node(
        "simulation", scene="shallow_lift", vibration="frequency-domain", fatigue="stranded_wire",
        wait_for="ropes/markers", wait_for_s=60.0,
    )  # fmt: skip
    bench.until(lambda: len(used) >= 3 and len(shaking) >= 12, "three seconds of the run")
    simulation.send(signal.SIGINT)
    assert simulation.wait() == 0
    recorder.send(signal.SIGINT)
    assert recorder.wait() == 0
    cloud = shaking[-1]
    names = ["x", "y", "z", "cross_flow", "cross_flow_hz", "drag_amplification", "rope"]
    assert [field.name for field in cloud.fields] == names
    points = np.frombuffer(bytes(cloud.data), "<f4").reshape(-1, 7)
    assert len(points) == cloud.width
    assert points[0, 2] > points[-1, 2]
    assert (points[:, 3] >= 0.0).all()
    assert (points[:, 5] == 1.0).all()  # the twin does not feel what is beside it
    table = read_cloud(used[-1])
    assert (np.diff(table["from_lower_end_m"]) > 0.0).all()
    assert (table["damage"] >= 0.0).all()
    with BagReader(tmp_path / "bag") as reader:
        counts = {name: content.messages for name, content in reader.topics.items()}
    assert counts["/ropes/fatigue"] >= 3
    assert counts["/ropes/vibration"] >= 12
