"""Convergence study of a scene: error bound of its tension over mesh and time step.

`rope_twin accuracy SCENE` writes it to the folder `convergence` next to the scene's file; here it
is read. It stores the digest of the scene's properties and the version of the solver. If either
has changed it is outdated, and the error is unknown until the study is repeated.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rope_twin.core import CONNECTIONS_VERSION, SOLVER_VERSION
from rope_twin.effects import EFFECTS
from rope_twin.errors import SceneError
from rope_twin.scene.error_bound import PEAK, RMS, Figure, KnownError, Setting, StudyLevel
from rope_twin.scene.grid import elements_with
from rope_twin.scene.schema import Rope, RopeLine, Scene


def scene_digest(scene: Scene) -> str:
    """Return the digest of all properties of a scene except mesh and step, which a study varies."""
    ropes = tuple(replace(_bare_line(line), elements=0) for line in scene.ropes)
    sea = replace(scene.sea_state, bag=Path(scene.sea_state.bag).name)
    if sea.poses is not None:
        sea = replace(sea, poses=replace(sea.poses, bag=Path(sea.poses.bag).name))
    parts = (ropes, scene.payloads, scene.winch, scene.ship, sea, scene.environment, scene.effects)
    met = (scene.hang_offs, scene.joints, scene.struts, scene.sheaves)
    key = repr((*parts, *met, scene.time.newton_tolerance_n))
    return hashlib.sha256(key.encode()).hexdigest()[:16]


def solver_version(scene: Scene) -> str:
    """Return the version of the solver, and of each of the scene's effects beyond version 1.

    Such as "1", or "1, drag 2" for a scene that lists a drag whose results were changed once. With
    several ropes it includes the version of connections beyond 1.
    """
    listed = {type(params) for params in scene.effects}
    changed = [f"{effect.name} {effect.version}" for effect in EFFECTS
               if effect.params in listed and effect.version > 1]  # fmt: skip
    if len(scene.ropes) > 1 and CONNECTIONS_VERSION > 1:
        changed = [f"connections {CONNECTIONS_VERSION}", *changed]
    return ", ".join([str(SOLVER_VERSION), *changed])


def _bare_line(line: RopeLine) -> RopeLine:
    """Return the line without descriptive text."""
    sections = tuple(replace(section, rope=_bare(section.rope)) for section in line.sections)
    rope = None if line.rope is None else _bare(line.rope)
    return replace(line, rope=rope, sections=sections)


def _bare(rope: Rope) -> Rope:
    return replace(rope, about="", source="")


FORMAT = 2
FOLDER = "convergence"
OTHER_SEA = "the study's run has another sea"


@dataclass(frozen=True)
class ConvergenceStudy:
    """A convergence study as stored in its file."""

    scene: str
    seconds: float  # simulated time of the run
    scene_digest: str
    solver: str  # version of the solver and of the effects
    machine: str
    levels: tuple[StudyLevel, ...]
    rope_elements: tuple[int, ...] = ()  # of every rope of a multi-line scene

    @property
    def own_levels(self) -> tuple[StudyLevel, ...]:
        """Return the settings with the scene's own tolerance, by elements and then by step."""
        levels = (level for level in self.levels if level.newton_tolerance_n is None)
        return tuple(sorted(levels, key=lambda level: (level.elements, level.step_s)))

    @property
    def finest(self) -> Setting:
        """Return the most elements and the shortest step of the study."""
        levels = self.own_levels
        return Setting(
            max(level.elements for level in levels), min(level.step_s for level in levels)
        )

    def age(self, scene: Scene) -> str:
        """Return why the study does not apply to the scene any more; "" if it does."""
        now = [line.elements for line in scene.ropes]
        if self.rope_elements and elements_with(self.rope_elements, now[0]) != now:
            return "the scene's elements were changed since its study was made"
        if self.scene_digest != scene_digest(scene):
            return "the scene was changed since its study was made"
        if self.solver != solver_version(scene):
            return "the convergence study is outdated: the solver was changed since it was made"
        return ""

    def at(self, elements: int, step_s: float) -> tuple[StudyLevel, ...]:
        """Return the entry of a setting, or those around it if it lies between entries.

        A finer setting counts as the finest; a coarser one than all has none.
        """
        levels, finest = self.own_levels, self.finest
        counts = _around(
            min(elements, finest.elements), sorted({level.elements for level in levels})
        )
        steps = _around(max(step_s, finest.step_s), sorted({level.step_s for level in levels}))
        return tuple(
            level for level in levels if level.elements in counts and level.step_s in steps
        )


def study_path(scene: Scene) -> Path:
    """Return the path of the scene's study, whether it exists or not."""
    return scene.path.parent / FOLDER / f"{scene.path.stem}.json"


def read_study(scene: Scene) -> ConvergenceStudy | None:
    """Return the scene's study, which may be outdated; None if there is none.

    Raises:
        SceneError: the file is not a study; one sentence.
    """
    path = study_path(scene)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(str(path), f"it cannot be read ({error})", _REMAKE) from error
    try:
        study = json.loads(text)
        if study["format"] != FORMAT:
            problem = f"a study of format {study['format']}, this version reads {FORMAT}"
            raise SceneError(str(path), problem, _REMAKE)
        return ConvergenceStudy(
            scene=str(study["scene"]),
            seconds=float(study["seconds"]),
            scene_digest=str(study["scene_digest"]),
            solver=str(study["solver"]),
            machine=str(study["machine"]),
            levels=tuple(_level_of(row) for row in study["rows"]),
            rope_elements=tuple(int(count) for count in study.get("rope_elements", ())),
        )
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise SceneError(
            str(path), f"it is not a convergence study ({error!r})", _REMAKE
        ) from error


def known_error(scene: Scene) -> KnownError:
    """Return the error of the scene at its own mesh and step, from its study.

    Between entries the largest error of the surrounding entries holds, for finer settings that of
    the finest: no better one is claimed than was measured. It is unknown for settings coarser than
    the study, and with an outdated study.
    """
    try:
        study = read_study(scene)
    except SceneError as error:
        return KnownError(words=f"unknown: {error}")
    if study is None:
        return KnownError(words="unknown: no study")
    problem = study.age(scene)
    neighbours = () if problem else study.at(scene.ropes[0].elements, scene.time.step_s)
    rms = max((level.bound(RMS) for level in neighbours), default=math.nan)
    peak = max((level.bound(PEAK) for level in neighbours), default=math.nan)
    if problem or not neighbours:
        reason = problem or "this setting is not one of the convergence study"
        return KnownError(words=f"unknown: {reason}")
    if any(math.isnan(level.bound(RMS)) for level in neighbours):
        return KnownError(peak_pct=peak, words="unknown: the run does not converge (see its study)")
    words = f"at most, in the study's run of {study.seconds:g} s"
    finest = study.finest
    if scene.ropes[0].elements > finest.elements or scene.time.step_s < finest.step_s:
        words += ", which ends at a coarser setting"
    return KnownError(rms, peak, words, study.seconds)


_REMAKE = "make it again with `rope_twin accuracy SCENE`"


def _around(value: float, sizes: list[Any]) -> list[Any]:
    """Return the size equal to the value, else the two on either side; none if outside."""
    if value in sizes:
        return [value]
    below, above = [one for one in sizes if one < value], [one for one in sizes if one > value]
    return [below[-1], above[0]] if below and above else []


def _level_of(row: dict[str, Any]) -> StudyLevel:
    tolerance = row["newton_tolerance_n"]
    figures = {
        name: Figure(_number(figure["error"]), _number(figure["at_most"]))
        for name, figure in row["figures"].items()
    }
    if not {RMS, PEAK} <= set(figures):
        raise KeyError(RMS)
    return StudyLevel(
        elements=int(row["elements"]),
        step_s=float(row["step_s"]),
        newton_tolerance_n=_number(tolerance),
        real_time_factor=float(row["real_time_factor"]),
        solves_per_step=float(row["solves_per_step"]),
        memory_mb=float(row["memory_mb"]),
        figures=figures,
    )


def _number(value: Any) -> float | None:
    return None if value is None else float(value)
