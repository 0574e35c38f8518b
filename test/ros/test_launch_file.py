"""The launch file and the parameter file: checked against the code, since few machines run them."""

from __future__ import annotations

import ast
import dataclasses
import importlib.util
import os
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from rope_twin.files import share_dir
from rope_twin.ros import params

pytestmark = pytest.mark.ros  # parameters are rclpy's
LAUNCH = share_dir() / "launch" / "rope_twin.launch.py"
SUITE = share_dir() / "config" / "ros" / "suite.yaml"
CLASSES = {
    "simulation": params.SimulationParams,
    "sea_state": params.SeaStateParams,
    "winch_schedule": params.WinchScheduleParams,
    "feed": params.FeedParams,
    "recorder": params.RecorderParams,
    "viewer": params.ViewerParams,
    "console": params.ConsoleParams,
    "forecast": params.ForecastParams,
}


def field_names(node: str) -> set[str]:
    return {field.name for field in dataclasses.fields(CLASSES[node])}


def calls(tree: ast.AST, name: str) -> list[ast.Call]:
    return [
        part
        for part in ast.walk(tree)
        if isinstance(part, ast.Call) and getattr(part.func, "id", "") == name
    ]


@pytest.fixture(scope="module")
def tree() -> ast.Module:
    return ast.parse(LAUNCH.read_text(encoding="utf-8"))


def declared(tree: ast.Module) -> dict[str, ast.expr]:
    table = next(
        part.value
        for part in tree.body
        if isinstance(part, ast.Assign) and getattr(part.targets[0], "id", "") == "ARGUMENTS"
    )
    assert isinstance(table, ast.Tuple)
    return {ast.literal_eval(row.elts[0]): row for row in table.elts if isinstance(row, ast.Tuple)}


def test_every_node_is_a_console_entry_and_none_is_left_out(tree: ast.Module) -> None:
    setup = (Path(__file__).resolve().parents[2] / "setup.py").read_text(encoding="utf-8")
    entries = dict(re.findall(r'"(\w+) = (rope_twin\.ros\.\w+):main"', setup))
    launched = {}
    for call in calls(tree, "Node"):
        words = {key.arg: key.value for key in call.keywords}
        launched[ast.literal_eval(words["executable"])] = ast.literal_eval(words["name"])
    assert set(launched) == set(entries)
    for executable, module in entries.items():
        assert importlib.util.find_spec(module) is not None
        assert executable == f"{launched[executable]}_node"
    assert set(launched.values()) == set(CLASSES)


def test_every_argument_is_described_and_used(tree: ast.Module) -> None:
    names = declared(tree)
    used = {ast.literal_eval(call.args[0]) for call in calls(tree, "value")}
    assert used == set(names)
    for name, row in names.items():
        assert isinstance(row, ast.Tuple)
        assert len(ast.literal_eval(row.elts[2])) > 10, name


def test_every_parameter_that_it_sets_exists(tree: ast.Module) -> None:
    known = set().union(*(field_names(node) for node in CLASSES))
    set_here = {
        ast.literal_eval(key)
        for part in ast.walk(tree)
        if isinstance(part, ast.Dict)
        for key, value in zip(part.keys, part.values, strict=True)
        if key is not None and isinstance(value, ast.Call)
        and getattr(value.func, "id", "") == "ParameterValue"
    }  # fmt: skip
    assert set_here <= known
    assert {"scene", "speed", "bag", "out", "other_sea"} <= set_here


def test_it_runs_where_launch_is_installed() -> None:
    pytest.importorskip("launch_ros")
    spec = importlib.util.spec_from_file_location("rope_twin_launch", LAUNCH)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    entities = module.generate_launch_description().entities
    variables = 0 if "ROS_AUTOMATIC_DISCOVERY_RANGE" in os.environ else 2
    assert len(entities) == len(module.ARGUMENTS) + variables + len(CLASSES)


def test_it_keeps_to_the_loopback_interface_and_starts_again_what_dies(tree: ast.Module) -> None:
    """Checked in the text only: the test machines have no launch package."""
    text = ast.unparse(tree)
    (closed,) = calls(tree, "_loopback")
    assert ast.unparse(closed) == "_loopback(value('network'))"
    assert [ast.unparse(one) for one in calls(tree, "UnlessCondition")] == [
        "UnlessCondition(network)"
    ]
    assert all(
        word in text
        for word in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", "fastdds_loopback.xml",
                     "'respawn': True", "'respawn_max_retries'", "'beside': True")
    )  # fmt: skip
    profile = share_dir() / "config" / "ros" / "fastdds_loopback.xml"
    assert "<address>127.0.0.1</address>" in profile.read_text(encoding="utf-8")
    taken = {
        ast.unparse(key.value)
        for call in calls(tree, "Node")
        for key in call.keywords
        if key.arg is None
    }
    assert taken == {"common", "shown"}  # a viewer's window that was closed stays closed


def test_the_parameter_file_says_the_defaults_of_every_parameter() -> None:
    written: dict[str, dict[str, Any]] = {
        name.removeprefix("/**/"): content["ros__parameters"]
        for name, content in yaml.safe_load(SUITE.read_text(encoding="utf-8")).items()
    }
    assert set(written) == set(CLASSES)
    for node, values in written.items():
        defaults = {field.name: field.default for field in dataclasses.fields(CLASSES[node])}
        if node == "simulation":  # the suite's simulation awaits the suite's inputs
            defaults["wait_for"] = "ship/heave winch/speed_command"
        assert values == defaults
        for name, value in values.items():
            assert type(value) is type(defaults[name]), f"{node}.{name}"


def test_the_parameter_file_is_understood_by_ros(processes: Any, tmp_path: Path) -> None:
    changed = tmp_path / "mine.yaml"
    text = SUITE.read_text(encoding="utf-8").replace("scene: deep_lift", "scene: deep_lfit")
    changed.write_text(text, encoding="utf-8")
    process = processes.start(
        ["-m", "rope_twin.ros.winch_schedule_node", "--ros-args", "--params-file", str(changed)]
    )
    assert process.wait() == 1
    assert "deep_lfit" in process.text
    assert "unknown" not in process.text
