"""Natural modes and VIV assessment of a line that lies on the seabed in part."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rope_twin import Twin, load_scene
from rope_twin.errors import SceneError
from rope_twin.scene.schema import Scene
from rope_twin.studies.modes import find_modes
from rope_twin.studies.viv_frequency_domain import spans_of

CABLE = """about: a cable from a chute down to the bed
ropes:
  - name: cable
    rope: {{diameter_m: 0.12, mass_kg_per_m: 30.0, hydrodynamic_diameter_m: 0.12,
           axial_stiffness_n: 4.0e+8, breaking_load_n: 4.0e+5}}
    length_m: {length_m}
    elements: {elements}
    damping: {{fraction_of_first_axial_mode: 0.02}}
    fixed_at_m: {end}
effects:
  - current: {{profile: [[0.0, [0.0, 0.4]], [-300.0, [0.0, 0.4]]]}}
  - weight: {{}}
  - drag: {{normal: 0.0, tangential: 0.0}}
  - added_mass: {{}}
  - seabed: {{depth_m: {depth_m}, stiffness_n_per_m3: 1.0e+6}}
time: {{step_s: 0.01}}
"""


def cable(folder: Path, length_m: float, elements: int, end: list[float], depth: float) -> Scene:
    """Return the scene of a cable to an anchor."""
    text = CABLE.format(length_m=length_m, elements=elements, end=end, depth_m=depth)
    path = folder / "cable.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(str(path))


def test_modes_are_those_of_the_suspended_part(tmp_path: Path) -> None:
    """A catenary with 88 m on the bed vibrates as the one that ends at its touchdown: 2 %."""
    laid = cable(tmp_path, 450.0, 180, [250.0, 0.0, -300.0], 300.0)
    (down,) = Twin(laid).snapshot().touchdowns
    end = [float(x) for x in down.position_m]
    hung = cable(tmp_path, down.line_out_m, 145, end, 900.0)
    ours, expected = find_modes(laid, 8), find_modes(hung, 8)
    found = [mode.frequency_hz for mode in ours.lowest]
    assert found == pytest.approx([mode.frequency_hz for mode in expected.lowest], rel=0.02)
    assert [mode.kind for mode in ours.lowest] == [mode.kind for mode in expected.lowest]
    assert all(mode.largest_at_m < down.line_out_m for mode in ours.lowest)


def test_viv_is_assessed_for_the_suspended_part(tmp_path: Path) -> None:
    """The span ends at the touchdown, within an element, and is fixed there."""
    laid = cable(tmp_path, 450.0, 180, [250.0, 0.0, -300.0], 300.0)
    (down,) = Twin(laid).snapshot().touchdowns
    (line,) = spans_of(laid)
    assert line.unstretched[0] == pytest.approx(down.line_out_m, abs=450.0 / 180.0)
    assert line.span.s[0] == 0.0
    assert line.place[2, 0] <= -300.0 < line.place[2, 1]
    assert line.span.end_mass is None
    sizes = {len(line.span.s), len(line.span.speed), len(line.span.diameter)}
    assert sizes == {line.place.shape[1]}
    assert len(line.span.tension) == len(line.span.mass) == line.place.shape[1] - 1
    assert np.diff(line.span.s).min() > 0.0


def test_a_line_that_lies_all_on_the_seabed_is_not_assessed(tmp_path: Path) -> None:
    """One sentence instead of modes of a line that cannot move."""
    scene = cable(tmp_path, 100.0, 20, [100.2, 0.0, -300.01], 300.0)
    scene = replace(scene, ship=replace(scene.ship, hang_off_m=(0.0, 0.0, -300.01)))
    with pytest.raises(SceneError, match="the whole line lies on the seabed"):
        spans_of(scene)
