"""A valid scene as text for tests of the strict reader, and the form of a refusal."""

from pathlib import Path

import pytest

from rope_twin.errors import SceneError
from rope_twin.scene.load import load_scene

GOOD = """\
about: a good scene
source: made up
look_at: nothing
ropes:
  - name: hoist
    rope: steel_wire_40mm
    length_m: 500.0
    elements: 50
    damping: {fraction_of_first_axial_mode: 0.02}
    to: tool
payloads:
  - name: tool
    mass_kg: 20000.0
    shape: {box: {length_m: 3.0, width_m: 2.0, height_m: 1.5}}
winch:
  speed_limit_m_per_s: 1.0
  acceleration_limit_m_per_s2: 0.3
  min_line_out_m: 50.0
  max_line_out_m: 800.0
  schedule:
    - {at_s: 0.0, speed_m_per_s: 0.5}
    - {at_s: 20.0, speed_m_per_s: -0.5}
  schedule_repeats_every_s: 40.0
ship: {hang_off_m: [0.0, 0.0, 0.0], motion_ramp_s: 8.0}
sea_state: {start_s: 10.0, loop: true}
environment: {water_density_kg_per_m3: 1025.0, gravity_m_per_s2: 9.80665}
effects:
  - payload: {}
  - drag: {normal: 1.2, tangential: 0.02}
  - current: {profile: [[0.0, [0.5, 0.0]], [-900.0, [0.1, 0.05]]]}
  - weight: {}
time: {step_s: 0.01, newton_tolerance_n: 100.0}
"""

# The same with added mass: what most scenes that are stepped have, so that it is compiled anyway.
STEPPED = GOOD.replace("  - weight: {}\n", "  - weight: {}\n  - added_mass: {normal: 1.0}\n")


def spoilt(old: str, new: str) -> str:
    """Return GOOD with its only occurrence of `old` replaced."""
    assert GOOD.count(old) == 1, f"'{old}' occurs {GOOD.count(old)} times"
    return GOOD.replace(old, new)


def written(folder: Path, text: str | bytes) -> Path:
    """Write a scene file with this text."""
    path = folder / "scene.yaml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def assert_refused(text: str, place: str, words: tuple[str, ...], folder: Path) -> None:
    """Assert one sentence `file, line, place: what; right.` that contains these words."""
    path = written(folder, text)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert len(sentence) < 500
    assert sentence[-1] in ".?"
    where, _, rest = sentence.partition(": ")
    what, _, right = rest.partition("; ")
    assert where.startswith(str(path))
    assert where.removeprefix(str(path)).partition(", line ")[2].partition(", ")[2] == place
    assert what
    assert right
    for word in words:
        assert word in sentence
