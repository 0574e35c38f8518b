"""Live topics, heard by a DDS client of another vendor (Eclipse Cyclone DDS)."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from ros_process import Processes

from rope_twin.files import share_dir

pytestmark = pytest.mark.ros
LISTENER = Path(__file__).parents[1] / "support" / "cyclone_listener.py"
TOPICS = ("ropes/tension_top", "payloads/state", "ropes/length", "hang_off/odometry",
          "ropes/nodes")  # fmt: skip


def test_cyclone_dds_hears_scalars_structs_and_arrays(processes: Processes) -> None:
    profile = str(share_dir() / "config" / "ros" / "fastdds_other_vendors.xml")
    run = processes.start(
        ["-m", "rope_twin", "run", "shallow_lift", "--headless", "--no-record"],
        FASTDDS_DEFAULT_PROFILES_FILE=profile,
    )
    run.until_says("late")
    listener = processes.start([str(LISTENER), os.environ["ROS_DOMAIN_ID"], "120", "50", *TOPICS])
    assert listener.wait() == 0
    heard = json.loads(listener.text.strip().splitlines()[-1])
    assert min(of["count"] for of in heard.values()) >= 50
    names, _, efforts = heard["ropes/tension_top"]["last"]
    assert names == ["hoist"]
    assert 1e5 < efforts[0] < 3e5
    assert -10.0 < heard["hang_off/odometry"]["last"] < 30.0
    assert -215.0 < heard["payloads/state"]["last"] < -195.0
    names, positions, _ = heard["ropes/length"]["last"]
    assert names == ["hoist"]
    assert 195.0 < positions[0] < 215.0
    width, fields, size = heard["ropes/nodes"]["last"]
    assert width > 2
    assert fields == ["x", "y", "z", "tension_n", "rope"]
    assert size == 20 * width
