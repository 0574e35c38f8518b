"""Digests of a scene's properties, and the version of the solver.

A convergence study and the rows of a parameter study are valid for both. The solver's version is a
number that is incremented with every change of results, not a digest of its sources: renaming and
comments change no result, and `test/stability/test_golden_states.py` ensures that no result changes
unnoticed.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

from rope_twin.core import SOLVER_VERSION
from rope_twin.effects import EFFECTS
from rope_twin.scene.schema import Rope, RopeLine, Scene


def scene_digest(scene: Scene) -> str:
    """Return the digest of all properties of a scene except mesh and step, which a study varies."""
    ropes = tuple(replace(_bare_line(line), elements=0) for line in scene.ropes)
    sea = replace(scene.sea_state, bag=Path(scene.sea_state.bag).name)
    if sea.poses is not None:
        sea = replace(sea, poses=replace(sea.poses, bag=Path(sea.poses.bag).name))
    parts = (ropes, scene.payloads, scene.winch, scene.ship, sea, scene.environment, scene.effects)
    met = (scene.hang_offs, scene.joints, scene.struts, scene.sheaves)
    told = repr((*parts, *met, scene.time.newton_tolerance_n))
    return hashlib.sha256(told.encode()).hexdigest()[:16]


def solver_version(scene: Scene) -> str:
    """Return the version of the solver, and of each of the scene's effects beyond version 1.

    Such as "1", or "1, drag 2" for a scene that lists a drag whose results were changed once.
    """
    listed = {type(params) for params in scene.effects}
    changed = [f"{one.name} {one.version}" for one in EFFECTS
               if one.params in listed and one.version > 1]  # fmt: skip
    return ", ".join([str(SOLVER_VERSION), *changed])


def _bare_line(line: RopeLine) -> RopeLine:
    """Return the line without descriptive text."""
    sections = tuple(replace(one, rope=_bare(one.rope)) for one in line.sections)
    rope = None if line.rope is None else _bare(line.rope)
    return replace(line, rope=rope, sections=sections)


def _bare(rope: Rope) -> Rope:
    return replace(rope, about="", source="")
