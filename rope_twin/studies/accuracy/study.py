"""Convergence study: a scene at several numbers of elements, time steps and tolerances.

Each level has an error against a reference of known uncertainty, a real-time factor and a memory
size; together they are the accuracy table (`rope_twin.scene.card` reads it).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from rope_twin.errors import RopeTwinError
from rope_twin.scene.card import FORMAT, scene_digest, solver_version
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import is_joined
from rope_twin.studies.accuracy.figures import BY_NAME, QUANTITIES, Values, differences, values
from rope_twin.studies.accuracy.plan import Plan
from rope_twin.studies.accuracy.reference import Reference, find_reference
from rope_twin.studies.accuracy.run import Course, Setting, Trial
from rope_twin.studies.accuracy.witness import Witness, call_witness
from rope_twin.studies.machine import Machine, this_machine

Report = Callable[[int, int, str], None]  # done, of how many, what comes next


@dataclass(frozen=True, eq=False)
class Row:
    """One accuracy level."""

    setting: Setting
    real_time_factor: float
    solves_per_step: float
    unconverged: int
    memory_mb: float
    values: Values
    errors: Values  # against the reference; None: not converged, or nothing to compare
    at_most: Values  # their magnitudes and the reference's uncertainty

    def place(self) -> tuple[int, float, float | None]:
        """Return elements, time step [s] and tolerance [N] (None: the scene's own)."""
        return self.setting.elements, self.setting.step_s, self.setting.tolerance_n

    def bound(self, name: str) -> float:
        """Return the error bound of a quantity, in its unit; NaN if it is unknown."""
        at_most = self.at_most[name]
        return math.nan if at_most is None else at_most


@dataclass(frozen=True)
class Study:
    """Results of a convergence study."""

    scene: Scene
    plan: Plan
    machine: Machine
    reference: Reference
    witness: Witness | str
    rows: tuple[Row, ...]
    failures: tuple[str, ...]  # settings that cannot be run, and why

    @property
    def own(self) -> Row | None:
        """Return the level of the scene's own setting."""
        return next((row for row in self.rows if row.setting == self.plan.own), None)


def measure_accuracy(scene: Scene, plan: Plan, report: Report, timed: bool = True) -> Study:
    """Run the reference, the independent code and every level; untimed: errors only.

    Raises:
        RopeTwinError: the reference cannot be run. A level that cannot is listed as a failure.
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
    witness = (
        "not called" if not timed else call_witness(scene, plan.reference.step_s, plan.seconds)
    )
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
    """Return the study as its JSON file and `--json` have it."""
    scene, reference = study.scene, study.reference
    witness = study.witness
    seen = witness if isinstance(witness, str) else {**asdict(witness), "words": str(witness)}
    met = {"rope_elements": [line.elements for line in scene.ropes]} if is_joined(scene) else {}
    return {
        "format": FORMAT,
        "scene": scene.name,
        **met,
        "scene_digest": scene_digest(scene),
        "solver": solver_version(scene),
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
