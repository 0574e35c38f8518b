"""Speed of an ensemble, and whether it is bit-identical to single runs.

It is compared, within the same minute, with its members on the same threads without SIMD lanes, and
with one single rope.

Every member has its own load and section of the sea. Some are run again as twins: results that are
not bit-identical are counted, so that the speed refers to the same computation.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from rope_twin.core.jit.wide import LANES
from rope_twin.scene.load import change_scene, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant
from rope_twin.studies.ensemble import Plan, make_plan, variations
from rope_twin.studies.study_design import SEA_OFFSET_S, Variable
from rope_twin.twin.ensemble.ensemble import Ensemble, Variation
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from validation.case import Listener, announced

SCENE = "smooth_2km"
WARM_S = 10.0  # until the ship's motion has faded in; not measured
MIN_SINGLE = 20_000  # steps of the rope alone in a repetition: its share of the time is small
CHECKED = 3  # members that are run again as twins
SEED = 1


@dataclass(frozen=True)
class Case:
    """Settings of the benchmark."""

    members: int
    elements: int
    step_s: float
    threads: int | None = None  # None: as many as there are cores
    seconds: float = 5.0  # of twin time in each repetition
    repetitions: int = 5

    def __str__(self) -> str:
        """Return members, elements and step in words."""
        return f"{self.members} ropes of {self.elements} elements at {self.step_s:g} s"


FULL = (
    Case(1000, 100, 0.02),
    Case(1000, 100, 0.02, threads=1, repetitions=3),
    Case(1000, 100, 0.01, repetitions=3),
    Case(100, 1000, 0.02, repetitions=3),
    Case(100, 100, 0.02),
)
QUICK = (Case(12, 20, 0.02, seconds=1.0, repetitions=2),)


@dataclass(frozen=True)
class EnsembleRow:
    """One case; medians over the repetitions, `best` the fastest of them."""

    scene: str
    members: int
    elements: int
    step_s: float
    threads: int
    real_time_factor: float  # of all members together
    real_time_factor_best: float
    ns_per_node_step: float  # of a thread: real time times threads over node steps of all members
    ns_per_node_step_best: float
    in_lanes: int  # members that step side by side in SIMD lanes
    threads_only_ns_per_node_step: float  # the same members without lanes, between the repetitions
    threads_only_ns_per_node_step_best: float
    single_ns_per_node_step: float  # one rope alone on one thread, between the repetitions
    single_ns_per_node_step_best: float
    processor_share: float  # processor time over real time and threads; far below 1: not alone
    starting_s: float  # building all members and finding where each starts
    failed: int
    checked: int
    unequal: int  # of the checked ones, those that differ from a twin of their own in any bit


def ensemble_rows(
    cases: tuple[Case, ...] = FULL, listen: Listener = lambda done, total, what: None
) -> list[EnsembleRow]:
    """Return a row for each case; `listen` hears of each before it runs, and at the end.

    Raises:
        RopeTwinError: the scene is not there, or cannot be run.
    """
    scene = load_scene(SCENE)
    return [
        _measure(variant(scene, case.elements, case.step_s), case)
        for case in announced(cases, listen, str)
    ]


def _measure(scene: Scene, case: Case) -> EnsembleRow:
    """Time repetitions of the ensemble and of a single rope, in turns."""
    length_s = WARM_S + 2.0 * case.repetitions * case.seconds
    single_s = max(1, round(MIN_SINGLE * scene.time.step_s / case.seconds)) * case.seconds
    plan = _plan(scene, case.members)
    members = variations(scene, plan, length_s)
    (variation,) = variations(scene, _plan(scene, 1), WARM_S + case.repetitions * single_s)
    alone = Ensemble(scene, [variation], threads=1)
    began = time.perf_counter()
    ensemble = Ensemble(scene, members, threads=case.threads)
    starting_s = time.perf_counter() - began
    ensemble.advance(WARM_S)
    alone.advance(WARM_S)
    turns = [_turn(ensemble, alone, case.seconds, single_s) for _ in range(case.repetitions)]
    together, threads_only, single, shares = zip(*turns, strict=True)
    rate = _node_steps_per_s(scene, case.members) / ensemble.threads
    checked = sorted({0, case.members // 2, case.members - 1})[:CHECKED]
    unequal = sum(
        not _same(ensemble.snapshot(k), _alone(scene, members[k], ensemble.steps)) for k in checked
    )
    return EnsembleRow(
        scene=scene.name,
        members=case.members,
        elements=case.elements,
        step_s=case.step_s,
        threads=ensemble.threads,
        real_time_factor=1e9 / (median(together) * rate),
        real_time_factor_best=1e9 / (min(together) * rate),
        ns_per_node_step=median(together),
        ns_per_node_step_best=min(together),
        in_lanes=ensemble.lanes().members,
        threads_only_ns_per_node_step=median(threads_only),
        threads_only_ns_per_node_step_best=min(threads_only),
        single_ns_per_node_step=median(single),
        single_ns_per_node_step_best=min(single),
        processor_share=median(shares),
        starting_s=starting_s,
        failed=sum(bool(figures.failure) for figures in ensemble.figures()),
        checked=len(checked),
        unequal=unequal,
    )


def _turn(
    ensemble: Ensemble, alone: Ensemble, seconds: float, single_s: float
) -> tuple[float, float, float, float]:
    """Return nanoseconds of a thread per node and step: in lanes, without, and of a single rope;
    and the share of CPU time in the threads' time in lanes.
    """
    began, busy_s = time.perf_counter(), time.process_time()
    together = _ns(ensemble, seconds) * ensemble.threads
    busy_s = time.process_time() - busy_s
    share = busy_s / (ensemble.threads * (time.perf_counter() - began))
    ensemble.max_lanes = 1
    threads_only = _ns(ensemble, seconds) * ensemble.threads
    ensemble.max_lanes = LANES
    return together, threads_only, _ns(alone, single_s), share


def _plan(scene: Scene, members: int) -> Plan:
    """Return loads around the scene's, and starts anywhere in the first minute of its sea."""
    load = Variable(path="payloads[0].mass_kg", from_=0.9, to=1.1, multiply=True)
    return make_plan([load, Variable(path=SEA_OFFSET_S, from_=0.0, to=60.0)], members, SEED)


def _ns(ensemble: Ensemble, seconds: float) -> float:
    """Return the real time [ns] over the steps of all nodes of all members."""
    began = time.perf_counter()
    ensemble.advance(seconds)
    spent_ns = (time.perf_counter() - began) * 1e9
    return spent_ns / (seconds * _node_steps_per_s(ensemble.scene, len(ensemble)))


def _node_steps_per_s(scene: Scene, members: int) -> float:
    """Return the node steps per second of simulation time, for all members together."""
    return members * scene.ropes[0].elements / scene.time.step_s


def _alone(scene: Scene, variation: Variation, steps: int) -> Snapshot:
    """Return the member as a twin with input sample by sample."""
    twin = Twin(change_scene(scene, variation.changes))
    if variation.heave is not None:
        end_ns = (steps + 1) * twin.step_ns + 10**9
        stamps = variation.heave.stamp_ns - variation.heave.start_ns
        last = int(np.searchsorted(stamps, end_ns))
        for k in range(last):
            position, velocity = variation.heave.position_m[k], variation.heave.velocity_m_per_s[k]
            twin.submit_heave(int(stamps[k]), float(position), float(velocity))
    twin.advance(steps)
    return twin.snapshot()


def _same(snapshot: Snapshot, expected: Snapshot) -> bool:
    """Return whether motion and tension of every node are equal."""
    names = ("node_position_m", "node_velocity_m_per_s", "node_tension_n", "hang_off_force_n")
    return all(np.array_equal(getattr(snapshot, name), getattr(expected, name)) for name in names)


def ensemble_table(rows: Sequence[EnsembleRow]) -> list[list[str]]:
    """Return the rows as cells, the first row being the heads."""
    heads = ["members", "elements", "step [s]", "threads", "× real time", "best", "in lanes",
             "ns/node/step", "best", "threads only", "best", "one rope alone", "best", "processor",
             "equal to a twin"]  # fmt: skip
    cells = [
        [
            f"{row.members}",
            f"{row.elements}",
            f"{row.step_s:g}",
            f"{row.threads}",
            f"{row.real_time_factor:.2f}",
            f"{row.real_time_factor_best:.2f}",
            f"{row.in_lanes}",
            f"{row.ns_per_node_step:.0f}",
            f"{row.ns_per_node_step_best:.0f}",
            f"{row.threads_only_ns_per_node_step:.0f}",
            f"{row.threads_only_ns_per_node_step_best:.0f}",
            f"{row.single_ns_per_node_step:.0f}",
            f"{row.single_ns_per_node_step_best:.0f}",
            f"{100.0 * row.processor_share:.0f} %",
            f"{row.checked - row.unequal} of {row.checked}",
        ]
        for row in rows
    ]
    return [heads, *cells]
