"""The JSON Schema of a scene file admits every shipped scene and rejects broken ones."""

from __future__ import annotations

import json
from copy import deepcopy
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator

from rope_twin.cli import main
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.scene.reference import scene_schema

SCHEMA = scene_schema()
VALIDATOR = Draft202012Validator(SCHEMA)


def content(name: str) -> Any:
    """Return the parsed content of a scene file."""
    return yaml.safe_load(load_scene(name).path.read_text(encoding="utf-8"))


def test_the_schema_is_valid_in_its_dialect() -> None:
    Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("name", scene_names())
def test_every_shipped_scene_is_valid(name: str) -> None:
    assert [error.message for error in VALIDATOR.iter_errors(content(name))] == []


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["ropes", 0, "elements"], "many"),
        (["ropes", 0, "elements"], 2),
        (["ropes", 0, "elements"], 50.5),
        (["ropes", 0, "rope"], "steel_wire"),
        (["ropes", 0, "length"], 3000.0),
        (["payloads", 0, "mass_kg"], -1.0),
        (["payloads", 0, "shape"], {"ball": {}}),
        (["payloads", 0, "shape"], {"box": {}, "cylinder": {}}),
        (["ship"], {"hang_off_m": [0.0, 0.0]}),
        (["time"], {}),
        (["effects", 0], {"drag": {"normal": 99.0, "tangential": 0.02}}),
        (["effects", 0], {"drga": {}}),
        (["effects", 0], "weight"),
        (["winch", "schedule", 0], {"speed_m_per_s": 0.5}),
    ],
)
def test_a_broken_scene_is_invalid(path: list[str | int], value: object) -> None:
    scene = deepcopy(content("deep_lift"))
    parent = scene
    for key in path[:-1]:
        parent = parent[key]
    parent[path[-1]] = value
    assert not VALIDATOR.is_valid(scene)


def test_units_ranges_and_meanings_are_those_of_the_fields() -> None:
    load = SCHEMA["$defs"]["Rope"]["properties"]["breaking_load_n"]
    assert load == {
        "description": "minimum breaking load MBL [N]",
        "type": "number",
        "minimum": 1e2,
        "maximum": 1e9,
    }


def test_the_command_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["scene", "schema"], ["scene", "schema", "--json"]):
        assert main(words) == 0
        assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(SCHEMA))
