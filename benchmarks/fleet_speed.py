"""Cost of a fleet on short horizons, with the error of its coarse mesh and step.

Members run through parts of a recorded sea, each one of its own, while the winch follows the
scene's schedule or one of four orders. In multi-line systems all winches follow their schedules,
once at the same speed in all members and once at one of its own in each. Errors are of the top
tension, against a fine mesh and step in the same seas. Times are the processor's own; best and
median of the repetitions of one run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary, Floats
from rope_twin.scene.load import at_setting, load_scene
from rope_twin.scene.rigging import winch_of
from rope_twin.scene.schema import WINCH, RopeLine, Scene
from rope_twin.studies.accuracy_study import Machine, this_machine
from rope_twin.studies.ensemble import make_plan, variations
from rope_twin.studies.study_design import SEA_OFFSET_S, Variable
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs, live_state
from rope_twin.twin.motion.boundary_conditions import SharedBoundary, WinchMotion
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.twin import Twin
from validation.case import Listener

SCENE = "deep_lift"
MEETING = ("two_line_lift", "bridle_lift", "two_line_loop", "two_line_landing")
SLOWEST = 0.5  # of the schedule's speed, in the member that is slowest
RAMP_M_PER_S2 = 0.3  # of the winch in the four orders
ORDERS_M_PER_S = (0.0, 0.5, -0.5, -1.0)  # hold, lower, haul, haul faster
SEED = 1


@dataclass(frozen=True)
class Plan:
    """Settings of the benchmark."""

    members: int
    seas_per_order: int
    seconds: float  # of the members that are timed
    repetitions: int
    settings: tuple[tuple[int, float], ...]  # elements and step [s] whose error is measured
    chosen: tuple[int, float]  # those of the other rows
    reference: tuple[int, float]
    error_members: int
    error_s: float
    live_elements: int
    copies: int  # number of states copied to time one
    meeting: tuple[str, ...]  # scenes in which ropes meet
    meeting_members: int
    meeting_reference: tuple[int, float]  # over `seconds`: these take longer


FULL = Plan(
    members=100, seas_per_order=48, seconds=60.0, repetitions=7,
    settings=((10, 0.05), (20, 0.05), (40, 0.025), (100, 0.05), (100, 0.02)), chosen=(20, 0.05),
    reference=(400, 0.005), error_members=4, error_s=180.0, live_elements=1000, copies=500,
    meeting=MEETING, meeting_members=48, meeting_reference=(100, 0.01),
)  # fmt: skip
QUICK = Plan(
    members=8, seas_per_order=2, seconds=4.0, repetitions=2, settings=((10, 0.05),),
    chosen=(10, 0.05), reference=(40, 0.025), error_members=2, error_s=20.0, live_elements=40,
    copies=5, meeting=("two_line_lift",), meeting_members=4,
    meeting_reference=(40, 0.025),
)  # fmt: skip


@dataclass(frozen=True)
class FleetRow:
    """A fleet on the horizon."""

    work: str
    members: int
    elements: int  # of all ropes
    step_s: float
    cpu_s: float  # median
    cpu_best_s: float
    ns_per_node_step: float  # of the best
    error_pct: float  # rms of the top tension, % of its standard deviation
    failed: int


@dataclass(frozen=True)
class StateRow:
    """Time to take or to give states."""

    work: str
    microseconds: float  # median
    microseconds_best: float


@dataclass(frozen=True)
class FleetSpeed:
    """Result of the benchmark."""

    machine: Machine
    scene: str
    seconds: float
    reference: tuple[int, float]
    rows: tuple[FleetRow, ...]
    states: tuple[StateRow, ...]


class _Seas:
    """Parts of the sea of SCENE, and winches by the schedules of a scene."""

    def __init__(self, scene: Scene, members: int, seconds: float) -> None:
        plan = make_plan([Variable(path=SEA_OFFSET_S, from_=0.0, to=600.0)], members, SEED)
        self._scene, self._seconds = scene, seconds
        self._heave = [
            variation.heave for variation in variations(load_scene(SCENE), plan, seconds)
        ]

    def inputs(self, step_s: float, count: int) -> FleetInputs:
        """Return the motion of the first `count` members at the borders of such steps."""
        scene, steps = self._scene, round(self._seconds / step_s)

        def through(line: RopeLine, heave: HeaveSeries | None) -> Boundary:
            winch = WinchMotion(winch_of(scene, line), line.length_m, None, step_s)
            return SharedBoundary(scene.ship, winch, heave, step_s).through(0, steps)

        lines = {}
        for line in scene.ropes:
            if winch_of(scene, line):
                length_m, speed = (
                    table[:, rows.LINE].copy() for table in through(line, self._heave[0])
                )
                lines[line.from_] = length_m, speed
        value, rate = np.empty((2, steps + 1, count))
        for k, heave in enumerate(self._heave[:count]):
            value[:, k], rate[:, k] = (table[:, rows.Z] for table in through(scene.ropes[0], heave))
        return FleetInputs(value - scene.ship.hang_off_m[2], rate, *lines.pop(WINCH), lines)


def at_own_speeds(inputs: FleetInputs, members: int) -> FleetInputs:
    """Return members whose winches run at SLOWEST to 1 times the speed given for all."""
    factors = np.linspace(SLOWEST, 1.0, members)

    def scaled(line: Floats, speed: Floats) -> tuple[Floats, Floats]:
        return line[0] + np.outer(line - line[0], factors), np.outer(speed, factors)

    line, speed = scaled(inputs.line_out_m, inputs.line_speed_m_per_s)
    further = {name: scaled(*both) for name, both in inputs.lines.items()}
    return replace(inputs, line_out_m=line, line_speed_m_per_s=speed, lines=further)


def ordered(inputs: FleetInputs, step_s: float, seas: int) -> FleetInputs:
    """Return each of the first `seas` members once under each order."""
    steps, repeats = len(inputs.heave_m) - 1, len(ORDERS_M_PER_S)
    times = step_s * np.arange(steps + 1)
    line, speed = [], []
    for order in ORDERS_M_PER_S:
        ramp_s = abs(order) / RAMP_M_PER_S2
        rising = np.minimum(times, ramp_s)
        speed.append(np.sign(order) * RAMP_M_PER_S2 * rising)
        commanded_m = 0.5 * np.sign(order) * RAMP_M_PER_S2 * rising**2 + order * (times - rising)
        line.append(inputs.line_out_m[0] + commanded_m)
    return FleetInputs(
        np.tile(inputs.heave_m[:, :seas], repeats),
        np.tile(inputs.heave_rate_m_per_s[:, :seas], repeats),
        np.repeat(np.array(line).T, seas, axis=1),
        np.repeat(np.array(speed).T, seas, axis=1),
    )


def measure_fleet(
    plan: Plan = FULL, report: Listener = lambda done, total, what: None
) -> FleetSpeed:
    """Measure errors, costs and copies.

    Raises:
        RopeTwinError: the scene is not there, or cannot be run.
    """
    scene, total = load_scene(SCENE), len(plan.settings) + len(plan.meeting) + 3
    report(0, total, "the reference")
    seas = _Seas(scene, plan.error_members, plan.error_s)
    truth = _tension(scene, plan.reference, seas, plan.error_members)
    timed = _Seas(scene, plan.members, plan.seconds)
    rows, errors = [], {}
    for done, (elements, step_s) in enumerate(plan.settings, start=1):
        report(done, total, f"{elements} elements at {step_s:g} s")
        errors[elements, step_s] = _error_pct(scene, (elements, step_s), seas, truth)
        fleet = Fleet(scene, plan.members, elements=elements, step_s=step_s)
        inputs = timed.inputs(step_s, plan.members)
        error = errors[elements, step_s]
        rows.append(_timed(f"{plan.seconds:g} s", fleet, inputs, plan, error))
    report(len(plan.settings) + 1, total, "orders")
    elements, step_s = plan.chosen
    fleet = Fleet(
        scene, len(ORDERS_M_PER_S) * plan.seas_per_order, elements=elements, step_s=step_s
    )
    inputs = ordered(timed.inputs(step_s, plan.seas_per_order), step_s, plan.seas_per_order)
    work = f"{len(ORDERS_M_PER_S)} orders × {plan.seas_per_order}, {plan.seconds:g} s"
    rows.append(_timed(work, fleet, inputs, plan, errors[plan.chosen]))
    for done, name in enumerate(plan.meeting, start=len(plan.settings) + 2):
        report(done, total, name)
        rows += _where_ropes_meet(load_scene(name), plan)
    report(total - 1, total, "states")
    states = _states(scene, fleet, plan)
    report(total, total, "done")
    return FleetSpeed(this_machine(), SCENE, plan.seconds, plan.reference, tuple(rows), states)


def _where_ropes_meet(scene: Scene, plan: Plan) -> list[FleetRow]:
    elements, step_s = plan.chosen
    seas, reference = _Seas(scene, plan.error_members, plan.seconds), plan.meeting_reference
    truth = _tension(scene, reference, seas, plan.error_members)
    error = _error_pct(scene, plan.chosen, seas, truth)
    members = plan.meeting_members
    inputs = _Seas(scene, members, plan.seconds).inputs(step_s, members)
    works = {f"{plan.seconds:g} s": inputs, "own speeds": at_own_speeds(inputs, members)}
    rows = []
    for work, fleet_inputs in works.items():
        fleet = Fleet(scene, members, elements=elements, step_s=step_s)
        rows.append(_timed(f"{scene.name}, {work}", fleet, fleet_inputs, plan, error))
    return rows


def _error_pct(scene: Scene, setting: tuple[int, float], seas: _Seas, truth: Floats) -> float:
    """Return the rms error of the top tension in per cent of its standard deviation."""
    steps, members = truth.shape
    tension_n = _tension(scene, setting, seas, members)
    every = steps // len(tension_n)
    exact_n = truth[every - 1 :: every]
    return 100.0 * float(np.sqrt(np.mean((tension_n - exact_n) ** 2)) / np.std(exact_n))


def _tension(scene: Scene, setting: tuple[int, float], seas: _Seas, members: int) -> Floats:
    elements, step_s = setting
    fleet = Fleet(scene, members, elements=elements, step_s=step_s)
    return fleet.advance(seas.inputs(step_s, members)).top_tension_n


def _timed(work: str, fleet: Fleet, inputs: FleetInputs, plan: Plan, error_pct: float) -> FleetRow:
    """Time the fleet on these inputs, from rest each time."""
    start, took = fleet.state(0), []
    for _ in range(plan.repetitions + 1):  # the first fills caches
        fleet.restore(start)
        began = time.process_time()
        record = fleet.advance(inputs)
        took.append(time.process_time() - began)
    took = took[1:]
    elements, step_s = sum(line.elements for line in fleet.scene.ropes), fleet.scene.time.step_s
    node_steps = elements * len(fleet) * len(record.top_tension_n)
    fastest = min(took)
    return FleetRow(
        work, len(fleet), elements, step_s, median(took), fastest,
        1e9 * fastest / node_steps, error_pct, len(record.failures),
    )  # fmt: skip


def _states(scene: Scene, fleet: Fleet, plan: Plan) -> tuple[StateRow, ...]:
    """Time copies of states: of one live twin, and to the members."""
    twin = Twin(at_setting(scene, plan.live_elements))
    twin.advance(100)
    live, state, members = live_state(twin), fleet.state(0), len(fleet)
    states = [fleet.state(k) for k in range(members)]
    factors = {name: np.linspace(0.95, 1.05, members) for name in fleet.figures}
    count = max(plan.copies // 10, 2)
    return (
        _copied(f"live state of {plan.live_elements:,} elements", lambda: live_state(twin), plan),
        _copied("a member: begin from it", lambda: fleet.begin_from(live), plan, count, members),
        _copied("a member: one state for all", lambda: fleet.restore(state), plan, count, members),
        _copied("a member: a state each", lambda: fleet.restore(states), plan, count, members),
        _copied("a member: all figures", lambda: fleet.set_figures(factors), plan, count, members),
    )


def _copied(
    work: str, copy: Callable[[], object], plan: Plan, times: int = 0, share: int = 1
) -> StateRow:
    took = []
    for _ in range(times or plan.copies):
        began = time.process_time()
        copy()
        took.append((time.process_time() - began) * 1e6 / share)
    return StateRow(work, median(took), min(took))


def fleet_table(rows: Sequence[FleetRow]) -> list[list[str]]:
    """Return the rows as cells, the first row being the heads."""
    head = ["work", "members", "elements", "step [s]", "cpu [s]", "best", "ns/node/step", "rms %"]
    return [head] + [
        [
            row.work,
            f"{row.members}",
            f"{row.elements}",
            f"{row.step_s:g}",
            f"{row.cpu_s:.3f}",
            f"{row.cpu_best_s:.3f}",
            f"{row.ns_per_node_step:.0f}",
            f"{row.error_pct:.2g}" + (f", {row.failed} failed" if row.failed else ""),
        ]
        for row in rows
    ]


def state_table(states: Sequence[StateRow]) -> list[list[str]]:
    """Return the copies as cells, the first row being the heads."""
    return [["copy", "µs", "best"]] + [
        [row.work, f"{row.microseconds:.1f}", f"{row.microseconds_best:.1f}"] for row in states
    ]
