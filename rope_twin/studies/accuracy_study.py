"""Convergence study: a scene at several numbers of elements, time steps and tolerances.

Each level has an error against a reference of known uncertainty, a real-time factor and a memory
size; together they are the accuracy table (`rope_twin.scene.convergence` reads it).
Its numbers name the machine that they were measured on.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from rope_twin.core.jit.decorators import source_digest
from rope_twin.core.jit.functions import chain
from rope_twin.effects.fluid_ramp import FluidRampParams
from rope_twin.errors import InputError, RopeTwinError
from rope_twin.recording.session import machine
from rope_twin.scene.convergence import FORMAT, scene_digest, solver_version
from rope_twin.scene.error_bound import PEAK, RMS, Figure, Setting, StudyLevel
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import shedding_model
from rope_twin.studies.accuracy_run import (
    BY_NAME,
    QUANTITIES,
    MotionWindow,
    Series,
    Trial,
    Values,
    differences,
    values,
)
from rope_twin.studies.independent_code import IndependentResult, run_independent_code

LONGEST_STEP_S = 0.2  # the longest that a scene may have
FEWEST, MOST = 10, 1000  # elements of settings; at least half and twice the scene's own
TOLERANCES = (0.1, 10.0)  # times the scene's own, at its own elements and step
REFERENCE_TOLERANCE = 0.1
REFERENCE_WORK = 33e6  # nodes times steps of the finest run, about
MAX_FINER = 4  # elements of the reference over those of the finest level
MAX_WORK = 800e6  # nodes times steps of everything together: about a minute and a half
DEAR = 2.0  # a scene whose nodes cost more than twice as much has few settings
COMPONENTS = 14.0  # so many waves cost a node as much as all else
VORTICES = 1.4  # what a model of vortices costs a node beside all else, at most
SHORTEST_WINDOW = 10  # looks


@dataclass(frozen=True)
class StudyExtent:
    """Extent of a convergence study."""

    step_factors: tuple[float, ...]  # of the scene's own step
    doublings: int  # of its own elements, as long as MOST allows; one at least
    reference_step: float  # of the scene's own step
    window_s: float  # at least
    longest_window_s: float


USUAL = StudyExtent((0.5, 1.0, 2.0, 5.0), 2, 0.25, 60.0, 120.0)
SHORT = StudyExtent((1.0, 2.0, 5.0), 1, 0.5, 30.0, 30.0)  # of scenes that cost much


@dataclass(frozen=True)
class Plan:
    """Runs of a convergence study."""

    seconds: float
    own: Setting
    sampling_s: float  # a whole number of every step
    settings: tuple[Setting, ...]
    reference: Setting
    ropes: float = 1.0  # all ropes' elements over the first one's

    @property
    def work(self) -> float:
        """Return nodes times steps, including the reference's coarser grids and repeated timing."""
        settings = math.fsum(setting.elements / setting.step_s for setting in self.settings)
        fine = self.reference.elements / self.reference.step_s
        return self.ropes * self.seconds * (2.5 * fine + 2.5 * settings)


def make_plan(scene: Scene, seconds: float | None = None) -> Plan:
    """Return accuracy levels and window of a scene (None: as the scene's events require).

    Raises:
        SceneError: the scene cannot be built.
        InputError: the window is too short, or the scene's elements cannot be varied.
    """
    where = f"scene {scene.name}"
    if any(line.grading is not None and line.grading.nodes_m is not None for line in scene.ropes):
        remedy = "give the lowest element's length and its growth instead"
        raise InputError(where, "grading.nodes_m holds the elements fixed", remedy)
    usual = _plan(scene, seconds, USUAL)
    is_expensive = dearness(scene) > DEAR or usual.work > MAX_WORK
    return _plan(scene, seconds, SHORT) if is_expensive else usual


def dearness(scene: Scene) -> float:
    """Return the cost of a node and step relative to those of a rope without waves and vortices."""
    components = sum(int(getattr(effect, "components", 0)) for effect in scene.effects)
    vortices = VORTICES if shedding_model(scene) else 0.0
    return 1.0 + components / COMPONENTS + vortices


def _plan(scene: Scene, seconds: float | None, reach: StudyExtent) -> Plan:
    setting = Setting(scene.ropes[0].elements, scene.time.step_s)
    h = setting.step_s
    factors = [factor for factor in reach.step_factors if factor * h <= LONGEST_STEP_S]
    sampling_s = _whole(math.lcm(*(round(2.0 * multiple) for multiple in factors)) * 0.5 * h)
    span = _window_s(scene, reach) if seconds is None else seconds
    span = _whole(math.floor(span / sampling_s + 1e-6) * sampling_s)
    min_s = _whole(SHORTEST_WINDOW * sampling_s)
    if span < min_s:
        raise InputError("--duration", f"{seconds:g} s is too short", f"give {min_s:g} or more")
    counts = _counts(setting.elements, reach.doublings)
    ropes = sum(line.elements for line in scene.ropes) / setting.elements
    first = build_joined(scene).system.ropes[0] if is_joined(scene) else build(scene)
    tolerance = first.model.tolerance
    grid = [Setting(count, _whole(factor * h)) for count in counts for factor in factors]
    others = [Setting(setting.elements, h, min(part * tolerance, 1e4)) for part in TOLERANCES]
    finest_s = _whole(reach.reference_step * h)
    max_multiple = REFERENCE_WORK / ropes / dearness(scene) / (span / finest_s) / counts[-1]
    finer = 2 ** math.floor(math.log2(max(max_multiple, 1.0)))
    elements = counts[-1] * min(max(finer, 2), MAX_FINER)
    fine = Setting(elements, finest_s, REFERENCE_TOLERANCE * tolerance)
    return Plan(span, setting, sampling_s, (*grid, *others), fine, ropes)


def _window_s(scene: Scene, reach: StudyExtent) -> float:
    """Return a minute, or one cycle of the winch schedule if longer (two minutes at most) [s].

    A build-up of the water's forces comes before it.
    """
    winch = scene.winch
    scheduled = winch.schedule_repeats_every_s or 0.0 if winch and winch.schedule else 0.0
    ramp = scene.listed(FluidRampParams)
    ramp_s = max((curve.last[0] for curve in ramp.curves.values()), default=0.0) if ramp else 0.0
    return max(ramp_s, 0.0) + min(max(reach.window_s, scheduled), reach.longest_window_s)


def _counts(elements: int, doublings: int) -> list[int]:
    """Return the numbers of elements: the scene's own, halved and doubled."""
    counts, down = [elements], elements
    while round(down / 2) >= FEWEST:
        down = round(down / 2)
        counts.insert(0, down)
    for doubling in range(1, doublings + 1):
        if doubling == 1 or elements * 2**doubling <= MOST:
            counts.append(elements * 2**doubling)
    return counts


def _whole(seconds: float) -> float:
    """Return a number without its last bits, which depend on how a time was computed."""
    return round(seconds, 12)


SAFETY, FORMAL_ORDER, MIN_ORDER = 1.25, 2.0, 0.4
NO_ORDER = 3.0  # safety where there is no order: the factor for two grids
LITTLE = {"%": 5.0, "m": 0.1}  # three times differences that do not matter though they do not fall
NOTHING = {"%": 1e-6, "m": 1e-8}  # round-off


@dataclass(frozen=True)
class ReferenceUncertainty:
    """Uncertainty of one quantity of the reference, in the quantity's unit."""

    element_order: float | None  # None: there was none, or nothing to measure it by
    step_order: float | None
    uncertainty: float | None  # None: not converged
    spread: tuple[float, float] | None  # where not converged: least and largest over the grids


@dataclass(frozen=True)
class Reference:
    """Finest run, its results and their uncertainty."""

    setting: Setting
    series: Series
    values: Values
    doubts: dict[str, ReferenceUncertainty]


def find_reference(
    course: MotionWindow, setting: Setting, report: Callable[[str], None]
) -> Reference:
    """Run the five grids around the finest setting, each tighter in tolerance than the scene.

    Raises:
        RopeTwinError: a run failed.
    """
    n, h, tolerance = setting.elements, setting.step_s, setting.tolerance_n
    grids = [(n, h), (n // 2, h), (n // 4, h), (n, 2.0 * h), (n, 4.0 * h)]
    runs = []
    for elements, step_s in grids:
        grid_setting = Setting(elements, step_s, tolerance)
        report(f"reference, {grid_setting}")
        runs.append(Trial(course, grid_setting).run())
    return judge(setting, runs)


def judge(setting: Setting, runs: list[Series]) -> Reference:
    """Return the reference from the runs: the finest, two coarser in elements, two in time step."""
    fine, n2, n4, h2, h4 = runs
    by_element = differences(n4, n2), differences(n2, fine)
    by_step = differences(h4, h2), differences(h2, fine)
    results = [values(run) for run in runs]
    doubts = {}
    for name, quantity in BY_NAME.items():
        pairs = [(coarse[name], middle[name]) for coarse, middle in (by_element, by_step)]
        parts = [uncertainty(*pair, quantity.unit) for pair in pairs]
        known = [term for term, _ in parts]
        total = None if None in known else math.fsum(term for term in known if term is not None)
        spread = None if total is not None else _spread(name, results, [*by_element, *by_step])
        doubts[name] = ReferenceUncertainty(parts[0][1], parts[1][1], total, spread)
    return Reference(setting, fine, results[0], doubts)


def uncertainty(
    coarse: float | None, middle: float | None, unit: str
) -> tuple[float | None, float | None]:
    """Return uncertainty and order of the finest grid from two differences; None if not defined.

    Both differences None (nothing to compare, as the peaks of snaps without slack): zero.
    """
    if coarse is None and middle is None:
        return 0.0, None
    if coarse is None or middle is None:
        return None, None
    d1, d2 = abs(coarse), abs(middle)
    if max(d1, d2) <= NOTHING[unit]:
        return max(d1, d2), None
    order = math.log2(d1 / d2) if d1 > 0.0 and d2 > 0.0 else math.inf if d2 == 0.0 else -math.inf
    if order < MIN_ORDER:
        bound = NO_ORDER * max(d1, d2)
        return (bound, None) if bound <= LITTLE[unit] else (None, None)
    p = min(order, FORMAL_ORDER)
    # Where the order is chance, what the coarse grid's difference makes of it counts.
    d2 = max(d2, d1 / 2.0**FORMAL_ORDER)
    return SAFETY * d2 / (2.0**p - 1.0), order if math.isfinite(order) else None


def _spread(name: str, runs: list[Values], errors: list[Values]) -> tuple[float, float] | None:
    """Return minimum and maximum over the grids; for an RMS quantity, of the differences."""
    value = BY_NAME[name].value
    grid_values = [run[value] for run in runs] if value else [run[name] for run in errors]
    held = [value for value in grid_values if value is not None]
    return (min(held), max(held)) if held else None


Report = Callable[[int, int, str], None]  # done, of how many, what comes next


@dataclass(frozen=True)
class Study:
    """Results of a convergence study."""

    scene: Scene
    plan: Plan
    machine: Machine
    reference: Reference
    independent: IndependentResult | str
    rows: tuple[StudyLevel, ...]
    failures: tuple[str, ...]  # settings that cannot be run, and why

    @property
    def own(self) -> StudyLevel | None:
        """Return the level of the scene's own setting."""
        return next((row for row in self.rows if row.setting == self.plan.own), None)


def measure_accuracy(scene: Scene, plan: Plan, report: Report, timed: bool = True) -> Study:
    """Run the reference, the independent code and every level; untimed: errors only.

    Raises:
        RopeTwinError: the reference cannot be run. A level that cannot is listed as a failure.
    """
    computer = this_machine()
    course = MotionWindow(scene, plan.seconds, plan.sampling_s)
    total, done = 5 + 1 + len(plan.settings), 0

    def tell(activity: str) -> None:
        nonlocal done
        report(done, total, f"{scene.name}: {activity}")
        done += 1

    reference = find_reference(course, plan.reference, tell)
    tell("independent check")
    independent = (
        "not called"
        if not timed
        else run_independent_code(scene, plan.reference.step_s, plan.seconds)
    )
    rows, failures = [], []
    for setting in plan.settings:
        tell(str(setting))
        try:
            rows.append(_level(course, setting, reference, timed))
        except RopeTwinError as error:
            failures.append(f"{setting}: {error}")
    report(total, total, f"{scene.name}: done")
    return Study(scene, plan, computer, reference, independent, tuple(rows), tuple(failures))


def as_content(study: Study) -> dict[str, Any]:
    """Return the study as its JSON file and `--json` have it."""
    scene, reference = study.scene, study.reference
    independent = study.independent
    check = (
        independent
        if isinstance(independent, str)
        else {**asdict(independent), "words": str(independent)}
    )
    extra = {"rope_elements": [line.elements for line in scene.ropes]} if is_joined(scene) else {}
    return {
        "format": FORMAT,
        "scene": scene.name,
        **extra,
        "scene_digest": scene_digest(scene),
        "solver": solver_version(scene),
        "seconds": study.plan.seconds,
        "machine": study.machine.as_text(),
        "own": {"elements": study.plan.own.elements, "step_s": study.plan.own.step_s},
        "reference": {
            **reference.setting._asdict(),
            "values": reference.values,
            "doubts": {name: asdict(doubt) for name, doubt in reference.doubts.items()},
        },
        "independent_code": check,
        "units": {quantity.name: quantity.unit for quantity in QUANTITIES},
        "rows": [_as_row(row) for row in study.rows],
        "failures": list(study.failures),
    }


def _as_row(row: StudyLevel) -> dict[str, Any]:
    return {
        "elements": row.elements,
        "step_s": row.step_s,
        "newton_tolerance_n": row.newton_tolerance_n,
        "real_time_factor": row.real_time_factor,
        "error_rms_pct": row.figures[RMS].at_most,
        "error_peak_pct": row.figures[PEAK].at_most,
        "memory_mb": row.memory_mb,
        "solves_per_step": row.solves_per_step,
        "unconverged_substeps": row.unconverged_substeps,
        "values": row.values,
        "figures": {name: asdict(row.figures[name]) for name in BY_NAME},
    }


def _level(course: MotionWindow, setting: Setting, reference: Reference, timed: bool) -> StudyLevel:
    trial = Trial(course, setting)
    series = trial.run()
    figures = {}
    for name, error in differences(series, reference.series).items():
        doubt = reference.doubts[name].uncertainty
        figures[name] = Figure(None, None)
        if error is not None and doubt is not None:
            figures[name] = Figure(error, abs(error) + doubt)
    return StudyLevel(
        *setting,
        trial.real_time_factor() if timed else 0.0,
        series.solves_per_step,
        series.memory_mb,
        figures,
        series.unconverged,
        values(series),
    )


def page_table(rows: Iterable[Sequence[str]]) -> str:
    """Return the lines of a Markdown table; the first row is the head."""
    head, *others = rows
    lines = [f"| {' | '.join(row)} |" for row in (head, *others)]
    return "\n".join([lines[0], f"|{' --- |' * len(head)}", *lines[1:]])


LINKS, REPETITIONS = 1_000_000, 15


@dataclass(frozen=True)
class Machine:
    """Properties of the machine that computing times depend on."""

    processor: str
    cores: int  # that this process may use
    load: float  # processes that wanted to run in the last minute, this one included
    multiply_add_ns: float  # one dependent multiply-add; best of REPETITIONS
    python: str
    numba: str
    run: str = ""  # which day, and which solver; empty: not known

    def as_text(self) -> str:
        """Return the properties as one line of text."""
        return (
            f"{self.processor}, {self.cores} cores, load {self.load:.1f}; a dependent multiply-add "
            f"takes {self.multiply_add_ns:.2f} ns; Python {self.python}, numba {self.numba}"
            f"{self.run and '; '}{self.run}"
        )


def this_machine() -> Machine:
    """Query the machine and measure its speed (about 50 ms)."""
    description, times_s = machine(), []
    chain(1.0, 0.5, 0.5, 1)  # compiled here
    for _ in range(REPETITIONS):
        start_s = time.perf_counter()
        chain(1.0, 0.5, 0.5, LINKS)
        times_s.append(time.perf_counter() - start_s)
    return Machine(
        processor=description["processor"],
        cores=len(os.sched_getaffinity(0)),
        load=os.getloadavg()[0],
        multiply_add_ns=min(times_s) / LINKS * 1e9,
        python=description["python"],
        numba=description["numba"],
        run=f"{datetime.now(UTC).date()}, solver {source_digest()[:8]}",
    )
