"""What accuracy costs: a scene over a ladder of elements, steps and tolerances, with each error.

Error against a reference that states its own uncertainty, real-time factor and memory, rung by
rung; from these the accuracy card (`rope_twin.scene.card` reads it).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from rope_twin.errors import InputError, RopeTwinError, phrase
from rope_twin.scene.build import build
from rope_twin.scene.card import FORMAT, scene_digest, solver_digest
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy_figures import BY_NAME, QUANTITIES, Values, differences, values
from rope_twin.studies.accuracy_reference import REFINED, Reference, find_reference
from rope_twin.studies.accuracy_run import Course, Setting, Trial
from rope_twin.studies.accuracy_witness import Witness, call_witness
from rope_twin.studies.machine import Machine, this_machine

Report = Callable[[int, int, str], None]  # done, of how many, what comes next

STEP_FACTORS = (0.5, 1.0, 2.0, 5.0)  # of the scene's own step
LONGEST_STEP_S = 0.2  # the longest that a scene may have
FEWEST, MOST = 10, 1000  # elements of a ladder; at least half and twice the scene's own
UP = 2  # doublings above the scene's own elements, as long as MOST allows
TOLERANCES = (0.1, 10.0)  # times the scene's own, at its own elements and step
REFERENCE_TOLERANCE = 0.1
REFERENCE_S = 8.0  # about what the finest run may take, at 120 ns a node and step
FINER_MOST = 8  # times the finest of the ladder, in elements
NS_PER_NODE_STEP = 120e-9
WINDOW_S, LONGEST_WINDOW_S, SHORTEST_WINDOW = 60.0, 120.0, 10  # the last: looks


@dataclass(frozen=True)
class Plan:
    """What is run."""

    seconds: float
    own: Setting
    look_s: float  # a whole number of every step
    settings: tuple[Setting, ...]
    reference: Setting


@dataclass(frozen=True)
class Row:
    """One rung."""

    setting: Setting
    real_time_factor: float
    solves_per_step: float
    unconverged: int
    memory_mb: float
    values: Values
    errors: Values  # against the reference; None: not converged, or nothing to compare
    at_most: Values  # their magnitudes and the reference's uncertainty

    def place(self) -> tuple[int, float, float | None]:
        """Elements, step [s] and tolerance [N] (None: the scene's own)."""
        return self.setting.elements, self.setting.step_s, self.setting.tolerance_n

    def bound(self, name: str) -> float:
        """What a quantity's error is at most, in its unit; NaN where it is unknown."""
        at_most = self.at_most[name]
        return math.nan if at_most is None else at_most


@dataclass(frozen=True)
class Study:
    """Everything that a card tells."""

    scene: Scene
    plan: Plan
    machine: Machine
    reference: Reference
    witness: Witness | str
    rows: tuple[Row, ...]
    failures: tuple[str, ...]  # settings that cannot be run, and why

    @property
    def own(self) -> Row | None:
        """The rung of the scene's own setting."""
        return next((row for row in self.rows if row.setting == self.plan.own), None)


def make_plan(scene: Scene, seconds: float | None = None) -> Plan:
    """The ladder of a scene and its window (None: as the scene's events ask for).

    Raises:
        SceneError: the scene cannot be built.
        InputError: the window is too short, or the scene's elements cannot be varied.
    """
    line, h = scene.ropes[0], scene.time.step_s
    if line.grading is not None and line.grading.nodes_m is not None:
        right = "give the lowest element's length and its growth instead"
        raise InputError(
            phrase(f"scene {scene.name}", "grading.nodes_m holds the elements fixed", right)
        )
    factors = [one for one in STEP_FACTORS if one * h <= LONGEST_STEP_S]
    steps = [_whole(one * h) for one in factors]
    look_s = _whole(math.lcm(*(round(2.0 * one) for one in factors)) * 0.5 * h)
    span = window_s(scene) if seconds is None else seconds
    span = _whole(math.floor(span / look_s + 1e-6) * look_s)
    least = _whole(SHORTEST_WINDOW * look_s)
    if span < least:
        raise InputError(phrase("--for", f"{seconds:g} s is too short", f"give {least:g} or more"))
    own = Setting(line.elements, h)
    counts = _counts(line.elements)
    tolerance = build(scene).rope.model.tolerance
    others = [Setting(*_pair(own), min(part * tolerance, 1e4)) for part in TOLERANCES]
    ladder = [Setting(count, step_s) for count in counts for step_s in steps]
    finest = _whole(h / REFINED)
    most = REFERENCE_S / NS_PER_NODE_STEP / (span / finest)
    finer = min(max(2 ** math.floor(math.log2(max(most / counts[-1], 1.0))), 2), FINER_MOST)
    fine = Setting(counts[-1] * finer, finest, REFERENCE_TOLERANCE * tolerance)
    return Plan(span, own, look_s, (*ladder, *others), fine)


def window_s(scene: Scene) -> float:
    """A minute, or one round of the winch schedule if that is longer (two minutes at most)."""
    winch = scene.winch
    scheduled = winch.schedule_repeats_every_s or 0.0 if winch and winch.schedule else 0.0
    return min(max(WINDOW_S, scheduled), LONGEST_WINDOW_S)


def measure_accuracy(scene: Scene, plan: Plan, report: Report, timed: bool = True) -> Study:
    """Run the reference, its witness and every rung. Untimed, the real-time factors are zero.

    Raises:
        RopeTwinError: the reference cannot be run. A rung that cannot is one of the failures.
    """
    machine = this_machine()
    course = Course(scene, plan.seconds, plan.look_s)
    total, done = 5 + 1 + len(plan.settings), 0

    def tell(what: str) -> None:
        nonlocal done
        report(done, total, f"{scene.name}: {what}")
        done += 1

    reference = find_reference(course, plan.reference, tell)
    tell("witness")
    witness = call_witness(scene, plan.reference.step_s, plan.seconds)
    rows, failures = [], []
    for setting in plan.settings:
        tell(str(setting))
        try:
            rows.append(_row(course, setting, reference, timed))
        except RopeTwinError as error:
            failures.append(f"{setting}: {error}")
    report(total, total, f"{scene.name}: done")
    return Study(scene, plan, machine, reference, witness, tuple(rows), tuple(failures))


def as_card(study: Study) -> dict[str, Any]:
    """The card as its JSON file has it, and as `--json` prints it."""
    scene, reference = study.scene, study.reference
    witness = study.witness
    seen = witness if isinstance(witness, str) else {**asdict(witness), "words": str(witness)}
    return {
        "format": FORMAT,
        "scene": scene.name,
        "scene_digest": scene_digest(scene),
        "solver_digest": solver_digest(scene),
        "seconds": study.plan.seconds,
        "machine": study.machine.as_text(),
        "own": {"elements": study.plan.own.elements, "step_s": study.plan.own.step_s},
        "reference": {
            **asdict(reference.setting),
            "values": reference.values,
            "doubts": {name: asdict(doubt) for name, doubt in reference.doubts.items()},
        },
        "witness": seen,
        "units": {quantity.name: quantity.unit for quantity in QUANTITIES},
        "rows": [_as_row(row) for row in study.rows],
        "failures": list(study.failures),
    }


def _as_row(row: Row) -> dict[str, Any]:
    return {
        "elements": row.setting.elements,
        "step_s": row.setting.step_s,
        "newton_tolerance_n": row.setting.tolerance_n,
        "real_time_factor": row.real_time_factor,
        "error_rms_pct": row.at_most["tension_rms"],
        "error_peak_pct": row.at_most["tension_peak"],
        "memory_mb": row.memory_mb,
        "solves_per_step": row.solves_per_step,
        "unconverged_substeps": row.unconverged,
        "values": row.values,
        "figures": {
            name: {"error": row.errors[name], "at_most": row.at_most[name]} for name in BY_NAME
        },
    }


def _row(course: Course, setting: Setting, reference: Reference, timed: bool) -> Row:
    trial = Trial(course, setting)
    series = trial.look()
    found = differences(series, reference.series)
    errors: Values = {}
    at_most: Values = {}
    for name, error in found.items():
        doubt = reference.doubts[name].uncertainty
        known = error is not None and doubt is not None
        errors[name] = error if known else None
        at_most[name] = abs(error) + doubt if error is not None and doubt is not None else None
    return Row(
        setting,
        trial.real_time_factor() if timed else 0.0,
        series.solves_per_step,
        series.unconverged,
        series.memory_mb,
        values(series),
        errors,
        at_most,
    )


def _counts(own: int) -> list[int]:
    """Elements of the ladder: the scene's own, halved and doubled."""
    counts, down = [own], own
    while round(down / 2) >= FEWEST:
        down = round(down / 2)
        counts.insert(0, down)
    for doubling in range(1, UP + 1):
        if doubling == 1 or own * 2**doubling <= MOST:
            counts.append(own * 2**doubling)
    return counts


def _pair(setting: Setting) -> tuple[int, float]:
    return setting.elements, setting.step_s


def _whole(seconds: float) -> float:
    """Without the last bits, which differ between ways to compute one time."""
    return round(seconds, 12)
