"""Cost and error of the step over scenes, numbers of elements and steps; never one alone.

`nodes` are moving nodes: as many as elements, since the hang-off's node is prescribed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.trial import Errors, Reference, Trial, doubt, find_reference
from rope_twin.scene.load import load_scene
from rope_twin.studies.accuracy_study import Machine, this_machine
from rope_twin.studies.driven_twin import variant
from validation.case import Listener

Case = tuple[str, int, float]  # scene, nodes, step [s]

FIT_FROM = 100  # nodes; below, what a step costs besides its nodes shows
MAX_PIECES, PIECE_NODE_STEPS = 100, 50_000  # a piece takes some 4 ms at least
SHORTEST_S, MAX_REPETITIONS = 2.0, 9


@dataclass(frozen=True)
class Plan:
    """Settings of the benchmark."""

    nodes: tuple[int, ...]  # of smooth_2km
    steps_s: tuple[float, ...]
    snaps: tuple[Case, ...]
    references: tuple[Case, ...]
    seconds: float  # simulated, in each run
    repetitions: int  # at least; more where a run is short


FULL = Plan(
    nodes=(20, 50, 100, 250, 500, 1000, 2500, 7000),
    steps_s=(0.01, 0.02),
    snaps=(
        ("snap_2km", 500, 0.02), ("snap_2km", 1000, 0.02), ("snap_2km", 1000, 0.01),
        ("snap_2km", 2500, 0.01), ("snap_vertical", 250, 0.01), ("snap_vertical", 250, 0.02),
        ("snap_vertical", 1000, 0.01), ("slack_5km", 1000, 0.01), ("slack_5km", 1000, 0.02),
        ("slack_5km", 2500, 0.01),
    ),
    references=(
        ("smooth_2km", 2000, 0.0025), ("snap_2km", 4000, 0.0025), ("snap_vertical", 500, 0.00125),
        ("slack_5km", 5000, 0.005),
    ),
    seconds=60.0,
    repetitions=3,
)  # fmt: skip
QUICK = Plan(
    nodes=(20, 100, 200),
    steps_s=(0.01, 0.02),
    snaps=(("snap_2km", 100, 0.02),),
    references=(("smooth_2km", 400, 0.005), ("snap_2km", 200, 0.005)),
    seconds=16.0,
    repetitions=2,
)


@dataclass(frozen=True)
class Row:
    """One case. Figures of speed are medians over the repetitions.

    `best` is the sum of the run's pieces, each the fastest of its repetitions: what other programs
    take from a piece now and then does not count.
    """

    scene: str
    nodes: int
    step_s: float
    ns_per_node_step: float
    ns_per_node_step_best: float
    real_time_factor: float
    real_time_factor_best: float
    error_pct: float  # rms, of the reference's standard deviation
    peak_error_pct: float
    trough_error_pct: float  # of the reference's standard deviation
    longest_step_s: float | None  # longest single step, each the faster of two runs; snaps only
    solves_per_step: float
    substeps_max: int
    unconverged: int
    repetitions: int
    processor_share: float  # processor time over time taken; far below 1: others ran as well


@dataclass(frozen=True)
class Basis:
    """A reference and what is left of it when elements and steps are twice as coarse."""

    scene: str
    nodes: int
    step_s: float
    mean_n: float
    max_n: float
    min_n: float
    doubt: Errors


@dataclass(frozen=True)
class Speed:
    """Results of the benchmark."""

    machine: Machine
    seconds: float
    references: tuple[Basis, ...]
    rows: tuple[Row, ...]  # smooth_2km
    snaps: tuple[Row, ...]
    exponents: dict[str, float]  # of the cost of a step over the nodes, by the step in seconds


def measure_speed(plan: Plan, report: Listener) -> Speed:
    """Run everything in the plan.

    Raises:
        RopeTwinError: a scene is not there, or a step of it is not finite.
    """
    machine = this_machine()
    smooth = [("smooth_2km", nodes, step_s) for step_s in plan.steps_s for nodes in plan.nodes]
    total, done = len(plan.references) + len(smooth) + len(plan.snaps), 0
    references: dict[str, Reference] = {}
    bases = []
    for case in plan.references:
        report(done, total, f"reference of {described(case)}")
        references[case[0]] = find_reference(*case, plan.seconds)
        bases.append(_basis(references[case[0]], plan.seconds))
        done += 1
    rows = []
    for case in (*smooth, *plan.snaps):
        report(done, total, described(case))
        rows.append(_row(case, references[case[0]], plan, stepwise=case in plan.snaps))
        done += 1
    report(total, total, "done")
    main = tuple(rows[: len(smooth)])
    exponents = {f"{step_s:g}": exponent(main, step_s) for step_s in plan.steps_s}
    return Speed(machine, plan.seconds, tuple(bases), main, tuple(rows[len(smooth) :]), exponents)


def described(case: Case) -> str:
    """Return a case in words."""
    scene, nodes, step_s = case
    return f"{scene}, {nodes} nodes at {1e3 * step_s:g} ms"


def exponent(rows: tuple[Row, ...], step_s: float) -> float:
    """Return the log-log slope of the best time of a step over the nodes, from FIT_FROM on."""
    fitted = [row for row in rows if row.step_s == step_s and row.nodes >= FIT_FROM]
    nodes = np.log([row.nodes for row in fitted])
    cost = np.log([row.ns_per_node_step_best * row.nodes for row in fitted])
    return float(np.polyfit(nodes, cost, 1)[0])


def _basis(reference: Reference, seconds: float) -> Basis:
    tension = reference.tension_n
    return Basis(
        reference.scene,
        reference.nodes,
        reference.step_s,
        float(tension.mean()),
        float(tension.max()),
        float(tension.min()),
        doubt(reference, seconds),
    )


def _row(case: Case, reference: Reference, plan: Plan, stepwise: bool) -> Row:
    scene, nodes, step_s = case
    trial = Trial(variant(load_scene(scene), nodes, step_s), plan.seconds)
    longest_s = _longest_step(trial) if stepwise else None
    pieces = max(1, min(MAX_PIECES, trial.steps * nodes // PIECE_NODE_STEPS))
    runs = [first := trial.run(math.ceil(trial.steps / pieces))]
    while len(runs) < plan.repetitions or (
        sum(run.took_s.sum() for run in runs) < SHORTEST_S and len(runs) < MAX_REPETITIONS
    ):
        runs.append(trial.run(math.ceil(trial.steps / pieces)))
    took = np.array([run.took_s for run in runs])
    middle, fastest = float(np.median(took.sum(axis=1))), float(took.min(axis=0).sum())
    errors = reference.errors(first.tension_n, step_s)
    work = trial.steps * nodes * 1e-9
    return Row(
        scene=scene,
        nodes=nodes,
        step_s=step_s,
        ns_per_node_step=middle / work,
        ns_per_node_step_best=fastest / work,
        real_time_factor=plan.seconds / middle,
        real_time_factor_best=plan.seconds / fastest,
        error_pct=errors.rms_pct,
        peak_error_pct=errors.peak_pct,
        trough_error_pct=errors.trough_pct,
        longest_step_s=longest_s,
        solves_per_step=first.solves / trial.steps,
        substeps_max=first.substeps_max,
        unconverged=first.unconverged,
        repetitions=len(runs),
        processor_share=sum(run.busy_s for run in runs) / float(took.sum()),
    )


def _longest_step(trial: Trial) -> float:
    """Return the longest of all steps [s], each the faster of two runs on a shared machine."""
    took = [trial.run(steps_at_once=1).took_s for _ in range(2)]
    return float(np.min(took, axis=0).max())
