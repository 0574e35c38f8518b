"""The layouts for other viewers name topics and fields that exist."""

from __future__ import annotations

import json
import re
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from rosbags.typesys import Stores, get_typestore

from rope_twin.files import share_dir
from rope_twin.topics import BY_NAME, Qos

LAYOUTS = share_dir() / "config" / "layouts"
STORE = get_typestore(Stores.ROS2_KILTED)


def field_exists(topic: str, path: list[str]) -> bool:
    """Return whether a topic's type has a field; indices as in `effort[0]`."""
    kind: Any = BY_NAME[topic].type_name
    for name in path:
        fields = dict(STORE.fielddefs[kind][1])
        bare = re.sub(r"\[\d+\]$", "", name)
        if bare not in fields:
            return False
        detail = fields[bare][1]
        kind = detail[0][1] if bare != name else detail
    return True


def longest_topic(path: str) -> str:
    known = [name for name in BY_NAME if path.startswith((f"/{name}/", f"/{name}."))]
    assert known, f"{path} begins with no topic"
    return max(known, key=len)


def test_foxglove() -> None:
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    panels = layout["configById"]
    drawn = [topic for panel in panels.values() for topic in panel.get("topics", {})]
    assert {topic.removeprefix("/") for topic in drawn} <= set(BY_NAME)
    assert panels["DiagnosticSummary!all"]["topicToRender"] == "/diagnostics"
    values = [path for panel in panels.values() for path in panel.get("paths", [])]
    assert len(values) >= 6
    for path in values:
        topic = longest_topic(path["value"])
        fields = path["value"][len(topic) + 2 :].split(".")
        assert field_exists(topic, fields), path["value"]
        stamped = field_exists(topic, ["header"])
        assert path["timestampMethod"] == ("headerStamp" if stamped else "receiveTime")
    used = re.findall(r'"((?:3D|Plot|DiagnosticSummary)!\w+)"', json.dumps(layout["layout"]))
    assert sorted(used) == sorted(panels)


def test_plotjuggler() -> None:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    names = [curve.attrib["name"] for curve in root.iter("curve")]
    assert len(names) >= 6
    for name in names:
        topic = longest_topic(name)
        fields = name[len(topic) + 2 :].split("/")
        if BY_NAME[topic].type_name == "sensor_msgs/msg/JointState":
            assert fields[0] == "hoist"  # curves are named by joint: the rope of most scenes
            fields = fields[1:]
        if topic == "diagnostics":  # hardware, status, key
            assert fields == ["rope_twin", "simulation: pacing", "real-time factor"]
            continue
        assert field_exists(topic, fields), name
    for splitter in root.iter("DockSplitter"):
        count = int(splitter.attrib["count"])
        assert len(splitter) == count == len(splitter.attrib["sizes"].split(";"))


def test_rviz() -> None:
    layout = yaml.safe_load((LAYOUTS / "rope_twin.rviz").read_text())
    manager = layout["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "map"
    displays = [display for display in manager["Displays"] if "Topic" in display]
    assert displays
    for display in displays:
        topic = BY_NAME[display["Topic"]["Value"].removeprefix("/")]
        assert topic.type_name.rsplit("/", 1)[1] == display["Class"].rsplit("/", 1)[1]
        if topic.qos in (Qos.STREAM, Qos.SENSOR):  # a reliable reader would get nothing
            assert display["Topic"]["Reliability Policy"] == "Best Effort"


@pytest.mark.parametrize("name", ["foxglove.json", "plotjuggler.xml", "rope_twin.rviz"])
def test_each_is_explained(name: str) -> None:
    assert f"`{name}`" in (LAYOUTS / "README.md").read_text()
