"""Listed effects are compiled and vectorised; effects that are not listed leave no code.

Read from the assembly of the whole step, compiled here afresh (cached code cannot be inspected).
"""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from benchmarks.effect_speed import step_assembly
from benchmarks.effect_speed import traces as symbols
from rope_twin import load_scene
from rope_twin.core.elements import stretch
from rope_twin.core.jit.decorators import assembly
from rope_twin.core.loads.balance import add_load
from rope_twin.core.state import Stage
from rope_twin.effects import EFFECTS
from rope_twin.effects.coupled_vibration import ModalVibrationParams
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rope_mass import WeightParams
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.vortex.drag_amplification import DragGrowth

# a square root of several doubles at once: x86-64 and aarch64
PACKED_ROOT = re.compile(r"\bv?sqrtpd\b|\bfsqrt\s+v\d+\.2d")
BARE = (WeightParams, PayloadParams)
MIN_LINES = 1000  # of assembly that current, drag and added mass are: 1,500 when written
# What runs over nodes; elsewhere LLVM inlines more or less of the same code.
PASSES = re.compile(r"^_ZN9rope_twin(4core6newton9_evaluate|4core5loads|7effects)\S*:")
NAMES = {effect.name for effect in EFFECTS}
# The kernel of an effect whose module has others too.
KERNELS = {
    "weight": "rope_mass.weight_load", "added_mass": "rope_mass.added_mass_load",
    "wetting": "rope_in_air.flow", "wind": "rope_in_air.wind_load", "payload": "payload.load_end",
    "splash_zone": "payload.splash_load_end", "net": "payload_faces.net_load_end",
    "fairing": "payload_faces.fairing_load_end",
}  # fmt: skip


def main_job() -> Scene:
    """The scene of the main job."""
    return load_scene("deep_lift")


def listed(scene: Scene) -> set[str]:
    """The names of its effects."""
    return {e.name for e in EFFECTS if any(type(params) is e.params for params in scene.effects)}


def lines_of_passes(code: str) -> int:
    """Return the number of lines of assembly of loads and of the pass that calls them."""
    count, inside = 0, False
    for line in code.splitlines():
        if line.startswith("_ZN"):
            inside = PASSES.match(line) is not None
        count += inside
    return count


def traces(code: str, name: str) -> int:
    """Count symbols of the effect's module, or of its kernel there."""
    return symbols(code, f"rope_twin.effects.{KERNELS.get(name, name)}")


@pytest.fixture(scope="module")
def whole() -> str:
    """The step of the main job."""
    return step_assembly(main_job())


@pytest.fixture(scope="module")
def bare() -> str:
    """Step of a scene with nothing but weight and payload."""
    scene = main_job()
    return step_assembly(
        replace(scene, effects=tuple(params for params in scene.effects if type(params) in BARE))
    )


def test_a_listed_effect_is_in_the_assembly(whole: str) -> None:
    """The next test must not pass by looking for the wrong name."""
    names = listed(main_job())
    assert {"current", "weight", "drag", "added_mass", "payload"} <= names
    assert not [name for name in names if not traces(whole, name)]


def test_an_absent_effect_is_not_in_the_assembly(whole: str, bare: str) -> None:
    """Neither a symbol nor a square root, and less code."""
    names = {"weight", "payload"}
    assert not [name for name in names if not traces(bare, name)]
    assert not [name for name in NAMES - names if traces(bare, name)]
    assert not [name for name in NAMES - listed(main_job()) if traces(whole, name)]
    assert "eliminate_coupled" not in whole
    assert "body_balance" not in whole
    assert lines_of_passes(bare) > 500, "the pass itself is found"
    assert lines_of_passes(whole) - lines_of_passes(bare) > MIN_LINES


def test_a_stiffness_table_is_compiled_only_where_listed(whole: str) -> None:
    """Its law is in the elements' loop of a rope that has one, and nowhere in the main job."""
    law = "by_table"
    rope = build(load_scene("hybrid_lift"))
    arguments = (rope.law, rope.work, rope.state.offset, 1.0, 0.0, 0, 1)
    assert law in assembly(stretch, arguments)
    assert law not in whole
    assert "by_stiffness" in whole


def test_drag_amplification_is_compiled_only_where_needed(whole: str) -> None:
    """Its kernels are in the loads of a rope whose vortices are beside the step."""
    module = "rope_twin.vortex.drag_amplification"
    scene = main_job()
    rope = build(replace(scene, effects=(*scene.effects, ModalVibrationParams())))
    grown = tuple(own for own in rope.effects if isinstance(own, DragGrowth))
    arguments = (grown, rope.work, Stage(0.0, 1.0, 1.0, 0.0), 0, 1)
    assert symbols(assembly(add_load, arguments), module)
    assert not symbols(whole, module)


def test_the_node_loop_of_drag_is_vectorised(whole: str, bare: str) -> None:
    """Drag brings a packed square root into the step.

    Where LLVM gives up on the overlap checks of many arrays it is a scalar one, and the loop five
    times slower, without a word (tried with a limit of 8 checks: none is left).
    """
    assert PACKED_ROOT.search(bare), "the loop over elements"
    assert len(PACKED_ROOT.findall(whole)) > len(PACKED_ROOT.findall(bare))
