"""Damaged, foreign or impossible saved states are rejected with one sentence each."""

from __future__ import annotations

import logging
import os
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import SMALL_SCENE, small_scene

import rope_twin.twin.state as saved_state_module
from rope_twin import Twin, load_scene
from rope_twin.errors import StateError
from rope_twin.scene.schema import Scene
from rope_twin.twin.state import load_state
from rope_twin.twin.state_file import FORMAT, read_state, write_state


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return small_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def good(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("saved") / "good.state"
    twin = Twin(scene)
    twin.advance(5)
    twin.save(path)
    return path


def refusal(path: Path, scene: Scene | None = None) -> str:
    """Return the one sentence with which a file is rejected."""
    with pytest.raises(StateError) as caught:
        load_state(path) if scene is None else Twin.restore(path, scene)
    sentence = str(caught.value)
    assert str(path) in sentence
    assert "\n" not in sentence
    assert sentence.endswith(".")
    return sentence


def altered(good: Path, folder: Path, **changes: Any) -> Path:
    """Return the good file with changed header entries and a matching checksum."""
    header, arrays = read_state(good)
    write_state(folder / "altered.state", header | changes, arrays)
    return folder / "altered.state"


def test_any_flipped_bit_is_noticed(good: Path, tmp_path: Path) -> None:
    """Each byte of the two lines of text, and 300 anywhere else."""
    data = good.read_bytes()
    text = data.index(b"{")
    rng = random.Random(7)
    positions = [*range(text), *(rng.randrange(text, len(data)) for _ in range(300))]
    path = tmp_path / "flipped.state"
    for position in positions:
        flipped = bytearray(data)
        flipped[position] ^= 1 << rng.randrange(8)
        path.write_bytes(flipped)
        refusal(path)


def test_a_file_of_any_other_length_is_refused(good: Path, tmp_path: Path) -> None:
    data = good.read_bytes()
    path = tmp_path / "short.state"
    for length in (*range(120), len(data) // 2, len(data) - 1):
        path.write_bytes(data[:length])
        refusal(path)
    assert f"cut off after {len(data) - 1} of {len(data)} bytes" in refusal(path)
    path.write_bytes(data + b"\0")
    assert "damaged" in refusal(path)


def test_header_faults_are_named(good: Path, tmp_path: Path) -> None:
    assert "cannot be read (No such file" in refusal(tmp_path / "none.state")
    assert "cannot be read (Is a directory" in refusal(tmp_path)
    path = tmp_path / "other.state"
    path.write_text(SMALL_SCENE)
    assert "it is no saved state" in refusal(path)
    for other in (FORMAT - 1, FORMAT + 1):
        data = good.read_bytes()
        path.write_bytes(data.replace(b"state %d\n" % FORMAT, b"state %d\n" % other, 1))
        sentence = f"it has version {other} of the format; this program reads version {FORMAT}."
        assert sentence in refusal(path)
    flipped = bytearray(good.read_bytes())
    flipped[-1] ^= 1
    path.write_bytes(flipped)
    assert "damaged (its check-sum is another)" in refusal(path)


@pytest.mark.parametrize(
    "name", ["rope/state/nodes", "motion/boundary/value", "inputs/current/effects/0/U"]
)
def test_nan_is_rejected_in_reading_and_writing(
    good: Path, scene: Scene, tmp_path: Path, name: str
) -> None:
    """In the rope, in the inputs, in an effect; a good file stays where a bad one is refused."""
    header, arrays = read_state(good)
    arrays[name].flat[0] = np.nan
    write_state(tmp_path / "nan.state", header, arrays)
    assert f"1 values of {name} are not numbers (NaN)" in refusal(tmp_path / "nan.state")
    state = load_state(good)
    state.arrays[name].flat[0] = np.nan
    before = good.read_bytes()
    with pytest.raises(StateError, match="are not numbers"):
        state.write(good)
    assert good.read_bytes() == before


def test_another_scene_is_rejected_with_the_difference(good: Path, tmp_path: Path) -> None:
    path = tmp_path / "heavier.yaml"
    path.write_text(SMALL_SCENE.replace("mass_kg: 8000.0", "mass_kg: 9000.0"))
    sentence = refusal(good, load_scene(path))
    assert "of another scene, small: payloads[0].mass_kg is 8000.0 there and 9000.0" in sentence
    path.write_text(SMALL_SCENE.replace("  - added_mass: {normal: 1.0}\n", ""))
    assert "effects has 5 entries there and 4" in refusal(good, load_scene(path))


def test_texts_sea_and_schedule_may_change(good: Path, tmp_path: Path) -> None:
    """They are no part of the state: an operator may mend the plan and go on."""
    path = tmp_path / "renamed.yaml"
    text = SMALL_SCENE.replace("a small scene with every effect", "something else")
    schedule = "  schedule: [{at_s: 3.0, speed_m_per_s: 0.5}]\n"
    path.write_text("# a remark\n" + text.replace("winch:\n", f"winch:\n{schedule}"))
    scene = load_scene(path)
    assert scene.winch is not None
    assert scene.winch.schedule
    assert Twin.restore(good, scene).steps == 5


def test_another_solver_is_reported(
    good: Path, scene: Scene, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It goes on, but whoever relies on the bits learns that they are others."""
    with caplog.at_level(logging.WARNING):
        Twin.restore(good, scene)
        assert not caplog.records
        monkeypatch.setattr(saved_state_module, "_solver_digest", lambda: "0123456789abcdef")
        Twin.restore(good, scene)
    assert "not to the bit" in caplog.text
    assert "0123456789abcdef" in caplog.text


def test_states_with_other_parts_or_shapes_are_rejected(
    good: Path, scene: Scene, tmp_path: Path
) -> None:
    """More or fewer parts, or arrays of another shape: no guess is made."""
    header, arrays = read_state(good)
    memory = header["memory"]
    ropes, inputs = memory["ropes"], memory["inputs"]["fields"]
    more = altered(good, tmp_path, memory=memory | {"ropes": ropes | {"rope/wind": 1.0}})
    assert "does not hold the same parts (rope/wind)" in refusal(more, scene)
    fewer = {name: part for name, part in inputs.items() if name != "winch"}
    changed = altered(good, tmp_path, memory=memory | {"inputs": {"fields": fewer}})
    assert "inputs does not have the same parts (winch)" in refusal(changed, scene)
    wrong = inputs | {"winch": {"fields": {"_target": 0.0}}}
    changed = altered(good, tmp_path, memory=memory | {"inputs": {"fields": wrong}})
    assert "winch does not have the same parts" in refusal(changed, scene)
    arrays["rope/state/nodes"] = arrays["rope/state/nodes"][:, :-1]
    write_state(tmp_path / "shape.state", header, arrays)
    assert "rope/state/nodes is float64" in refusal(tmp_path / "shape.state", scene)
    del header["step"]
    write_state(tmp_path / "lacking.state", header, arrays)
    assert "its header lacks 'step'" in refusal(tmp_path / "lacking.state")


def test_a_full_disk_leaves_the_old_file(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Full in the middle of writing: the old state stays, whole, and nothing is left beside it."""
    twin = Twin(scene)
    path = tmp_path / "run.state"
    twin.save(path)
    before = path.read_bytes()
    twin.advance(1)

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StateError, match=r"cannot be written \(No space left on device\)"):
        twin.save(path)
    monkeypatch.undo()
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(StateError, match="cannot be written"):
        twin.save(tmp_path / "none" / "run.state")
