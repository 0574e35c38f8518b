"""Which sources a card depends on: what its scene's step imports, in whatever folder it is."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from rope_twin.core.joined import reeving
from rope_twin.core.statics import equilibrium
from rope_twin.scene.digest import solver_digest, solver_sources
from rope_twin.scene.load import load_scene

PACKAGE = Path(equilibrium.__file__).parents[2]


def sources(*modules: str) -> set[str]:
    return {path.relative_to(PACKAGE).as_posix() for path in solver_sources(modules)}


def test_a_module_in_a_folder_is_followed(tmp_path: Path) -> None:
    """However it is imported: by its name, from its folder, over several lines, in a function."""
    package = tmp_path / "rope_twin"
    files = {
        "core/step.py": "from rope_twin.core.deep.one import f\nfrom rope_twin.core.deep import (\n"
        "    two,\n)\n\ndef g():\n    from rope_twin.sea import three\n",
        "core/deep/one.py": "from rope_twin.effects.four import LOAD\n",
        "core/deep/two.py": "",
        "core/deep/five.py": "",
        "effects/four.py": "from rope_twin.twin.six import no_part_of_it\n",
        "sea/three.py": "",
        "twin/six.py": "",
    }
    for name, text in files.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text, encoding="utf-8")
    found = solver_sources(["rope_twin.core.step"], package)
    assert {path.relative_to(package).as_posix() for path in found} == {
        "core/step.py", "core/deep/one.py", "core/deep/two.py", "effects/four.py", "sea/three.py",
    }  # fmt: skip


def test_one_rope_depends_on_its_own_statics_and_step() -> None:
    one = sources(equilibrium.__name__)
    assert {"core/step.py", "core/statics/shape.py", "core/compiler/wide.py"} <= one
    assert not any(name.startswith(("core/joined/", "core/body/")) for name in one)


def test_ropes_that_meet_depend_on_theirs_too() -> None:
    assert {"core/joined/step.py", "core/joined/chains.py"} <= sources(reeving.__name__)


@pytest.mark.parametrize(
    ("scene", "source"),
    [("lift_off", "core/body/step.py"), ("viv_calm", "core/vortices/van_der_pol.py")],
)
def test_an_effect_brings_what_it_imports(scene: str, source: str) -> None:
    modules = [type(params).__module__ for params in load_scene(scene).effects]
    assert source in sources(*modules)
    assert source not in sources(equilibrium.__name__)


@pytest.mark.parametrize(
    ("source", "aged"),
    [
        ("core/compiler/wide.py", {"shallow_lift", "landing", "bridle_lift"}),
        ("core/joined/step.py", {"bridle_lift"}),
        ("core/bed.py", {"landing"}),
    ],
)
def test_one_byte_ages_what_imports_it_and_nothing_else(
    tmp_path: Path, source: str, aged: set[str]
) -> None:
    """One rope, one above a bed, and ropes that meet above none."""
    scenes = [load_scene(name) for name in ("shallow_lift", "landing", "bridle_lift")]
    changed = tmp_path / "rope_twin"
    for room in ("core", "effects", "sea"):
        shutil.copytree(PACKAGE / room, changed / room, ignore=shutil.ignore_patterns("*.pyc"))
    with (changed / source).open("a", encoding="utf-8") as file:
        file.write("#")
    found = {one.name for one in scenes if solver_digest(one, changed) != solver_digest(one)}
    assert found == aged
