"""Verification of `run --within`: the selected setting is run again against a finer reference.

That reference is independent of the convergence study's: half its time step, and twice its elements
unless those are sufficient already.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from rope_twin.errors import RopeTwinError, SceneError
from rope_twin.scene.convergence import ConvergenceStudy, read_study
from rope_twin.scene.error_bound import Setting, StudyLevel, format_bound
from rope_twin.scene.load import argument_for
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy_run import MotionWindow, Quantity, Trial, differences
from rope_twin.studies.accuracy_study import make_plan

NOTHING = 1e-6  # below, errors are round-off


def current_study(
    scene: Scene, where: str, kind: type[RopeTwinError] = SceneError
) -> ConvergenceStudy:
    """Return the scene's convergence study.

    Raises:
        RopeTwinError: of this kind, at this place: there is none, or it is outdated.
    """
    study = read_study(scene)
    why = "it has no convergence study" if study is None else study.age(scene)
    if study is None or why:
        raise kind(where, why, f"make it with `rope_twin accuracy {argument_for(scene)}`")
    return study


def sure_bound(level: StudyLevel, levels: Iterable[StudyLevel], name: str) -> float:
    """Return the bound without coincidental cancellation; NaN if a finer level has none."""
    elements, step_s, tolerance = level.setting
    finer = [
        other.bound(name)
        for other in levels
        if other.newton_tolerance_n == tolerance
        and other.elements >= elements
        and other.step_s <= step_s
    ]
    return math.nan if any(map(math.isnan, finer)) else max(finer)


def cheapest_within(levels: Sequence[StudyLevel], name: str, target: float) -> StudyLevel | None:
    """Return the fastest level with the scene's own tolerance whose bound is at most `target`."""
    candidates = [level for level in levels if level.newton_tolerance_n is None]
    sufficient = [level for level in candidates if sure_bound(level, candidates, name) <= target]
    return max(sufficient, key=lambda level: level.real_time_factor, default=None)


def most_accurate(
    levels: Sequence[StudyLevel], name: str, costs: Sequence[float], budget: float
) -> StudyLevel | None:
    """Return the level with the smallest bound among those whose cost is within the budget.

    Of levels whose bounds differ by less than a tenth, the cheapest is returned.
    """
    fitting = [
        (sure_bound(level, levels, name), cost, level)
        for level, cost in zip(levels, costs, strict=True)
        if cost <= budget
    ]
    known = [entry for entry in fitting if not math.isnan(entry[0])]
    if not known:
        return None
    min_bound = min(entry[0] for entry in known)
    near_best = [entry for entry in known if entry[0] <= max(1.1 * min_bound, NOTHING)]
    return min(near_best, key=lambda entry: entry[1])[2]


def next_better(
    levels: Sequence[StudyLevel], name: str, bound: float, costs: Sequence[float]
) -> StudyLevel | None:
    """Return the cheapest level with a bound smaller by at least a tenth; None if there is none."""
    better = [
        (cost, number)
        for number, (level, cost) in enumerate(zip(levels, costs, strict=True))
        if sure_bound(level, levels, name) < max(0.9 * bound, NOTHING)
    ]
    return levels[min(better)[1]] if better and bound > NOTHING else None


def best_bound(levels: Sequence[StudyLevel], name: str) -> float:
    """Return the smallest error of all levels; NaN if none is known."""
    bounds = [sure_bound(level, levels, name) for level in levels]
    return min((bound for bound in bounds if not math.isnan(bound)), default=math.nan)


ENOUGH = 1000  # elements of a reference that are not doubled
Report = Callable[[int, int, str], None]  # done, of how many, what comes next


@dataclass(frozen=True)
class SelectedSetting:
    """Selected setting of one scene, and its measured error."""

    scene: str
    quantity: str
    within: float  # asked for, in the quantity's unit
    seconds: float | None  # over which it was measured, or None if nothing was selected
    elements: int | None  # None: nothing was selected
    step_s: float | None
    real_time_factor: float | None  # by the study
    at_most: float | None  # by the study
    error: float | None  # measured again
    reference: str  # the run that it was measured against
    refusal: str  # why nothing was selected; else empty

    @property
    def ok(self) -> bool:
        """Return whether the error meets the target; a refused selection does not violate it."""
        return self.error is None or abs(self.error) <= self.within


def check_scenes(
    scenes: Sequence[Scene],
    quantity: Quantity,
    within: float,
    seconds: float | None,
    report: Report,
) -> Iterator[SelectedSetting]:
    """Yield the selection of each scene for a target, and its error over a window.

    within: in the quantity's unit; seconds: of the window, None: the study's.

    Raises:
        RopeTwinError: an accuracy table is missing or old, or a run failed.
    """
    for number, scene in enumerate(scenes):
        report(number, len(scenes), scene.name)
        yield _check_scene(scene, quantity, within, seconds)
    report(len(scenes), len(scenes), "done")


def _check_scene(
    scene: Scene, quantity: Quantity, within: float, seconds: float | None
) -> SelectedSetting:
    study = current_study(scene, f"scene {scene.name}")
    known = [level for level in study.own_levels if not math.isnan(level.bound(quantity.name))]
    level = cheapest_within(known, quantity.name, within)
    if level is None:
        refusal = f"its study knows no error of {quantity.name}"
        if known:
            best = format_bound(best_bound(known, quantity.name))
            refusal = f"the best of its study is {best} {quantity.unit}"
        nothing = (None,) * 6
        return SelectedSetting(scene.name, quantity.name, within, *nothing, "", refusal)
    plan = make_plan(scene, seconds or study.seconds)
    course = MotionWindow(scene, plan.seconds, plan.sampling_s)
    elements, step_s, tolerance_n = plan.reference
    times = 1 if elements > ENOUGH else 2
    finer = Setting(times * elements, 0.5 * step_s, tolerance_n)
    result = Trial(course, level.setting).run()
    error = differences(result, Trial(course, finer).run())[quantity.name]
    return SelectedSetting(
        scene.name, quantity.name, within, plan.seconds, level.elements, level.step_s,
        level.real_time_factor, level.bound(quantity.name), error,
        f"{finer.elements} at {1e3 * finer.step_s:g} ms", "",
    )  # fmt: skip


def selected_table(rows: Sequence[SelectedSetting], unit: str) -> list[list[str]]:
    """Return the results as rows of text, below a head."""
    head = ["scene", "elements", "step ms", "× real time", f"study ≤ {unit}", f"measured {unit}",
            "over s", "against", "holds"]  # fmt: skip
    return [head, *([row.scene, *_cells(row)] for row in rows)]


def _cells(row: SelectedSetting) -> list[str]:
    if row.error is None or row.step_s is None:
        return ["", "", "", "", "", "", "", f"nothing selected: {row.refusal}"]
    return [
        f"{row.elements}",
        f"{1e3 * row.step_s:g}",
        f"{row.real_time_factor:,.0f}",
        f"{row.at_most:.2g}",
        f"{row.error:.2g}",
        f"{row.seconds:g}",
        row.reference,
        "yes" if row.ok else "NO",
    ]
