"""CPU cost of each effect in a scene, and its influence on the top tension.

An effect that the scene lists is removed; one that it does not list is added with parameters from
the scene or common practice , which are reported. Everything else is
unchanged, including the ship motion, even if it results from the waves that are removed. With a VIV
model outside the time step the scene is run by its twin, with and without it. Effects are varied
one at a time: the joint influence of two is not the sum of both.
"""

from __future__ import annotations

import copy
import dataclasses
import statistics
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import pi
from typing import Any

import numpy as np

from rope_twin.effects import EFFECTS, Effect
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import Jonswap, WavesParams
from rope_twin.errors import RopeTwinError
from rope_twin.scene.environment import bed_at
from rope_twin.scene.error_bound import Setting
from rope_twin.scene.lift import listed_effects
from rope_twin.scene.relations import faults
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import Scene, SeaState, Triple
from rope_twin.scene.vortex import model_beside
from rope_twin.studies.accuracy_run import MotionWindow, Trial
from rope_twin.studies.driven_twin import fed, with_effect
from rope_twin.twin.twin import Twin

SURFACE, BELOW = (0.5, 0.0), (0.1, 0.0)  # m/s
SEA_STATE_4 = Jonswap(significant_height_m=1.9, peak_period_s=8.8)
CLEARANCE_M = 10.0


def suggested(effect: Effect, scene: Scene) -> Any:
    """Return parameters for an effect that the scene does not list, or what is missing."""
    if effect.name == "line_contact" and len(scene.ropes) < 2:
        return "it acts between ropes, and the scene has one"
    defaults = _usual(effect.name, scene)
    lacking = [
        field
        for field in dataclasses.fields(effect.params)
        if field.default is dataclasses.MISSING
        and field.default_factory is dataclasses.MISSING
        and field.name not in defaults
    ]
    if lacking:
        return "it needs " + ", ".join(f"{field.name} ({_about(field)})" for field in lacking)
    params = effect.params(**defaults)
    complaint = params.check() if hasattr(params, "check") else None
    return f"the scene has no data for it: {complaint}" if complaint else params


def _usual(name: str, scene: Scene) -> dict[str, Any]:
    """Return known or typical parameters; empty if the effect is not applicable or needs more."""
    lowest, line = _lowest_m(scene), scene.ropes[0]
    if name == "drag":
        return {"normal": 1.2, "tangential": 0.02}
    if name == "current" and lowest < 0.0:
        return {"profile": ((0.0, SURFACE), (lowest, BELOW))}
    if name == "waves" and lowest < 0.0:
        bed = scene.listed(SeabedParams)
        depth = -bed_at(bed, *scene.ship.hang_off_m[:2]) if bed is not None else None
        return {"jonswap": SEA_STATE_4, "depth_m": depth}
    if name == "bending":
        rope = line.made_of[-1].rope  # that from the winch: a chain below it does not bend
        return {"stiffness_n_m2": rope.tangent_n(0.0) * rope.diameter_m**2 / 16.0}
    if name == "seabed" and lowest < 0.0:
        waves = scene.listed(WavesParams)
        known = waves.depth_m if waves is not None else None
        return {"depth_m": CLEARANCE_M - lowest if known is None else known}
    if (sides := _sides(scene)) is None:
        return {}
    length, width, height = sides  # of the payload, suspended at the middle of its top
    if name == "splash_zone":
        return {"height_m": height, "bottom_area_m2": length * width}
    if name == "fairing":
        return {"face_m2": length * width}
    if name == "rigid_body":
        return {"size_m": sides, "pinned_at_m": (0.0, 0.0, 0.5 * height)}
    return {}


def _sides(scene: Scene) -> Triple | None:
    """Return the sides of the payload's outline, or of an equal square if round [m]."""
    shape = scene.payloads[0].shape if scene.payloads else None
    diameter = getattr(shape, "diameter_m", None)
    height = getattr(shape, "height_m", diameter)
    if height is None:
        return None
    square = (0.25 * pi) ** 0.5 * (diameter or 0.0)
    return getattr(shape, "length_m", square), getattr(shape, "width_m", square), height


def _lowest_m(scene: Scene) -> float:
    """Return the lowest z that the first rope reaches [m]."""
    line = scene.ropes[0]
    if line.fixed_at_m is not None:
        return line.fixed_at_m[2]
    max_line_m = scene.winch.max_line_out_m if scene.winch else line.length_m
    return scene.ship.hang_off_m[2] - max_line_m


def _about(field: dataclasses.Field[Any]) -> str:
    quantity = field.metadata.get("quantity")
    return quantity.about if quantity else str(field.metadata.get("about", ""))


LOOK_S = 0.5
Listener = Callable[[int, int, str], None]


@dataclass(frozen=True)
class SceneRun:
    """One run of a scene."""

    us_per_step: float
    mean_n: float  # of the top tension
    max_n: float


@dataclass(frozen=True)
class EffectRow:
    """One effect; changes are with it less without it."""

    effect: str
    listed: bool
    parameters: str  # what it was put in with; of a listed one nothing
    us_per_step: float | None  # None, like the others: it could not be measured
    mean_change_n: float | None
    max_change_n: float | None
    why_not: str = ""


@dataclass(frozen=True)
class EffectStudy:
    """A scene and its effects."""

    scene: str
    seconds: float
    elements: int
    step_s: float
    as_it_is: SceneRun
    us_noise: float  # difference of two timings of the scene as it is, before and after all else
    rows: tuple[EffectRow, ...]


def measure_effects(scene: Scene, seconds: float, listen: Listener) -> EffectStudy:
    """Run the scene, and run it again for each effect.

    Raises:
        RopeTwinError: the unchanged scene cannot be run for so long.
    """
    by_twin = is_joined(scene) or model_beside(scene) is not None
    course = None if by_twin else MotionWindow(scene, seconds, LOOK_S)
    listed = listed_effects(scene)
    count = len(EFFECTS) + 2
    listen(0, count, "as it is")
    as_listed = _run(scene, course, seconds)
    rows = []
    for number, effect in enumerate(EFFECTS, start=1):
        listen(number, count, effect.name)
        effect_course = None if effect.beside else course
        base = _run(scene, effect_course, seconds) if effect_course is not course else as_listed
        rows.append(_row(scene, effect, base, partial(_run, course=effect_course, seconds=seconds)))
    listen(len(EFFECTS) + 1, count, "as it is, again")
    repeated = _run(scene, course, seconds)
    listen(count, count, "done")
    rows.sort(key=lambda row: row.effect not in listed)
    return EffectStudy(
        scene=scene.name,
        seconds=seconds,
        elements=scene.ropes[0].elements,
        step_s=scene.time.step_s,
        as_it_is=as_listed,
        us_noise=abs(repeated.us_per_step - as_listed.us_per_step),
        rows=tuple(rows),
    )


def _row(
    scene: Scene, effect: Effect, base: SceneRun, run: Callable[[Scene], SceneRun]
) -> EffectRow:
    """Return the result with one effect removed or added."""
    listed = effect.name in listed_effects(scene)
    text = ""
    try:
        if listed:
            effects = tuple(item for item in scene.effects if type(item) is not effect.params)
            with_it, without = base, run(_sound(replace(scene, effects=effects)))
        else:
            params = suggested(effect, scene)
            if isinstance(params, str):
                return EffectRow(effect.name, False, "", None, None, None, params)
            text = _words(params)
            with_it, without = run(_sound(with_effect(scene, params))), base
    except RopeTwinError as error:
        why = str(error).removesuffix(".")
        return EffectRow(effect.name, listed, text, None, None, None, why)
    return EffectRow(
        effect.name,
        listed,
        text,
        with_it.us_per_step - without.us_per_step,
        with_it.mean_n - without.mean_n,
        with_it.max_n - without.max_n,
    )


def _sound(scene: Scene) -> Scene:
    """Return the scene if it is valid; the motion of its ship is already given.

    Raises:
        RopeTwinError: one is.
    """
    sea_state = scene.sea_state if is_joined(scene) else SeaState()
    for where, problem, remedy in faults(replace(scene, sea_state=sea_state)):
        raise RopeTwinError(f"{where}: {problem}; {remedy}")
    return scene


def _run(scene: Scene, course: MotionWindow | None, seconds: float) -> SceneRun:
    if course is None:
        return _run_twin(scene, seconds)
    scene_course = copy.copy(course)
    scene_course.scene = scene
    trial = Trial(scene_course, Setting(scene.ropes[0].elements, scene.time.step_s))
    tension = trial.run().tension_n
    us_per_step = 1e6 * scene.time.step_s / trial.real_time_factor()
    return SceneRun(us_per_step, float(np.mean(tension)), float(np.max(tension)))


def _run_twin(scene: Scene, seconds: float) -> SceneRun:
    """Run the scene by its twin; return the median over its publish periods, inputs included."""
    twin = Twin(scene)
    times_s, before = [], twin.statistics()
    for _ in fed(twin, seconds):
        after = twin.statistics()
        times_s.append((after.computing_s - before.computing_s) / (after.steps - before.steps))
        before = after
    return SceneRun(
        1e6 * statistics.median(times_s), before.tension_top_mean_n, before.tension_top_max_n
    )


def _words(params: Any) -> str:
    """Return parameters as a scene would give them, without those that are not set."""
    changes = {
        field.name: getattr(params, field.name)
        for field in dataclasses.fields(params)
        if getattr(params, field.name) != field.default
    }
    return ", ".join(f"{name} {value}" for name, value in changes.items())


def effect_table(study: EffectStudy) -> Iterator[str]:
    """Return the results as lines of text."""
    base = study.as_it_is
    yield (
        f"{study.scene}: {study.seconds:g} s, {study.elements} elements, steps of "
        f"{1e3 * study.step_s:g} ms; {base.us_per_step:.2f} µs a step "
        f"(timed again: {study.us_noise:.2f} µs other)"
    )
    yield f"top tension: mean {base.mean_n / 1e3:.2f} kN, highest {base.max_n / 1e3:.2f} kN"
    yield "with an effect less without it:"
    yield f"{'effect':18}{'listed':>8}{'µs a step':>12}{'mean [kN]':>12}{'highest [kN]':>14}"
    for row in study.rows:
        head = f"{row.effect:18}{'yes' if row.listed else 'no':>8}"
        if row.us_per_step is None or row.mean_change_n is None or row.max_change_n is None:
            yield f"{head}  {row.why_not}"
            continue
        numbers = (row.us_per_step, row.mean_change_n / 1e3, row.max_change_n / 1e3)
        cells = "".join(f"{n:+{w}.2f}" for n, w in zip(numbers, (12, 12, 14), strict=True))
        yield f"{head}{cells}" + (f"  with {row.parameters}" if row.parameters else "")
