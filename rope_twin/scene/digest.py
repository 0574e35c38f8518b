"""Digests of a scene's figures and of the solver that steps it: what a card or a study was made of.

The solver's is of the sources that the scene's step and statics are compiled from, so that a change
of one effect leaves what was made of other scenes as it is.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from rope_twin.core.joined import reeving
from rope_twin.core.statics import equilibrium
from rope_twin.scene.rules.rigging import is_joined
from rope_twin.scene.rules.shedding import model_beside
from rope_twin.scene.schema import Rope, RopeLine, Scene

_ROOMS = ("rope_twin.core", "rope_twin.effects", "rope_twin.sea")
# ... and of a scene whose model of vortices is computed beside the step:
_BESIDE = "rope_twin.twin.vibration.shaking"
_BESIDE_ROOMS = ("rope_twin.twin.vibration", "rope_twin.viv")
_PACKAGE = Path(__file__).resolve().parent.parent
_BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")  # where statements have others


def scene_digest(scene: Scene) -> str:
    """Of all figures of a scene but its elements and step, which a card's ladder varies."""
    ropes = tuple(replace(_bare_line(line), elements=0) for line in scene.ropes)
    sea = replace(scene.sea_state, bag=Path(scene.sea_state.bag).name)
    if sea.poses is not None:
        sea = replace(sea, poses=replace(sea.poses, bag=Path(sea.poses.bag).name))
    parts = (ropes, scene.payloads, scene.winch, scene.ship, sea, scene.environment, scene.effects)
    met = (scene.hang_offs, scene.joints, scene.struts, scene.sheaves)
    told = repr((*parts, *met, scene.time.newton_tolerance_n))
    return hashlib.sha256(told.encode()).hexdigest()[:16]


def solver_digest(scene: Scene, package: Path = _PACKAGE) -> str:
    """Of the sources of step and statics and of the effects that the scene lists."""
    effects = sorted({type(params).__module__ for params in scene.effects})
    solver = reeving if is_joined(scene) else equilibrium
    modules = (solver.__name__, *effects)
    if model_beside(scene) is None:
        return _digest_of(modules, package)
    return _digest_of((*modules, _BESIDE), package, (*_ROOMS, *_BESIDE_ROOMS))


def solver_sources(
    modules: Sequence[str], package: Path = _PACKAGE, rooms: tuple[str, ...] = _ROOMS
) -> list[Path]:
    """The files of these modules and of all that they import from these rooms."""
    found: dict[str, Path] = {}
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        path = package.joinpath(*name.split(".")[1:]).with_suffix(".py")
        if name not in found and path.is_file():
            found[name] = path
            waiting += _imported(path, rooms)
    return [found[name] for name in sorted(found)]


def _imported(path: Path, rooms: tuple[str, ...]) -> Iterator[str]:
    """Names of modules that a file may import: `from a import b` is of a, or of a module a.b."""
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:  # statements alone: `ast.walk` takes a fifth of a second for all of them
        node = waiting.pop()
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith(rooms):
            yield str(node.module)
            yield from (f"{node.module}.{one.name}" for one in node.names)
        for block in _BLOCKS:
            waiting += getattr(node, block, ())


@lru_cache(maxsize=64)
def _digest_of(modules: tuple[str, ...], package: Path, rooms: tuple[str, ...] = _ROOMS) -> str:
    digest = hashlib.sha256()
    for path in solver_sources(modules, package, rooms):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _bare_line(line: RopeLine) -> RopeLine:
    """The line without words."""
    sections = tuple(replace(one, rope=_bare(one.rope)) for one in line.sections)
    rope = None if line.rope is None else _bare(line.rope)
    return replace(line, rope=rope, sections=sections)


def _bare(rope: Rope) -> Rope:
    return replace(rope, about="", source="")
