"""Cost of a fleet on short horizons, with the error of its coarse mesh and step.

Members run through parts of the scene's sea, each one of its own, while the winch follows the
scene's schedule or one of four orders. Errors are of the top tension, against a fine mesh and step
in the same seas. Times are the processor's own; best and median of the repetitions of one run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.scene.load import at_setting, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy_study import Machine, this_machine
from rope_twin.studies.ensemble import SEA_OFFSET, Axis, make_plan, variations
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs, live_state
from rope_twin.twin.motion.boundary_conditions import SharedBoundary, WinchMotion
from rope_twin.twin.twin import Twin
from validation.case import Listener

SCENE = "deep_lift"
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


FULL = Plan(
    members=100, seas_per_order=48, seconds=60.0, repetitions=7,
    settings=((10, 0.05), (20, 0.05), (40, 0.025), (100, 0.05), (100, 0.02)), chosen=(20, 0.05),
    reference=(400, 0.005), error_members=4, error_s=180.0, live_elements=1000, copies=500,
)  # fmt: skip
QUICK = Plan(
    members=8, seas_per_order=2, seconds=4.0, repetitions=2, settings=((10, 0.05),),
    chosen=(10, 0.05), reference=(40, 0.025), error_members=2, error_s=20.0, live_elements=40,
    copies=5,
)  # fmt: skip


@dataclass(frozen=True)
class FleetRow:
    """A fleet on the horizon."""

    work: str
    members: int
    elements: int
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
    """Parts of the scene's sea, and the winch by the scene's schedule."""

    def __init__(self, scene: Scene, members: int, seconds: float) -> None:
        plan = make_plan([Axis(SEA_OFFSET, 0.0, 600.0)], members, SEED)
        self._scene, self._seconds = scene, seconds
        self._series = [own.heave for own in variations(scene, plan, seconds)]

    def inputs(self, step_s: float, count: int) -> FleetInputs:
        """Return the motion of the first `count` members at the borders of such steps."""
        scene, steps = self._scene, round(self._seconds / step_s)
        winch = WinchMotion(scene.winch, scene.ropes[0].length_m, None, step_s)
        borders = [SharedBoundary(scene.ship, winch, own, step_s) for own in self._series[:count]]
        value, rate = np.empty((2, steps + 1, rows.MOTIONS, count))
        for k, own in enumerate(borders):
            value[..., k], rate[..., k] = own.through(0, steps)
        heave = value[:, rows.Z] - scene.ship.hang_off_m[2]
        line, speed = (table[:, rows.LINE, 0].copy() for table in (value, rate))
        return FleetInputs(heave, rate[:, rows.Z].copy(), line, speed)


def ordered(inputs: FleetInputs, step_s: float, seas: int) -> FleetInputs:
    """Return each of the first `seas` members once under each order."""
    steps, each = len(inputs.heave_m) - 1, len(ORDERS_M_PER_S)
    times = step_s * np.arange(steps + 1)
    line, speed = [], []
    for order in ORDERS_M_PER_S:
        until = abs(order) / RAMP_M_PER_S2
        rising = np.minimum(times, until)
        speed.append(np.sign(order) * RAMP_M_PER_S2 * rising)
        own = 0.5 * np.sign(order) * RAMP_M_PER_S2 * rising**2 + order * (times - rising)
        line.append(inputs.line_out_m[0] + own)
    return FleetInputs(
        np.tile(inputs.heave_m[:, :seas], each),
        np.tile(inputs.heave_rate_m_per_s[:, :seas], each),
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
    scene, total = load_scene(SCENE), len(plan.settings) + 3
    report(0, total, "the reference")
    seas = _Seas(scene, plan.error_members, plan.error_s)
    truth = _tension(scene, plan.reference, seas, plan.error_members)
    timed = _Seas(scene, plan.members, plan.seconds)
    found, errors = [], {}
    for done, (elements, step_s) in enumerate(plan.settings, start=1):
        report(done, total, f"{elements} elements at {step_s:g} s")
        own = _tension(scene, (elements, step_s), seas, plan.error_members)
        every = round(step_s / plan.reference[1])
        there = truth[every - 1 :: every]
        away = np.sqrt(np.mean((own - there) ** 2)) / np.std(there)
        errors[elements, step_s] = 100.0 * float(away)
        fleet = Fleet(scene, plan.members, elements=elements, step_s=step_s)
        inputs = timed.inputs(step_s, plan.members)
        error = errors[elements, step_s]
        found.append(_timed(f"{plan.seconds:g} s", fleet, inputs, plan, error))
    report(total - 2, total, "orders")
    elements, step_s = plan.chosen
    fleet = Fleet(
        scene, len(ORDERS_M_PER_S) * plan.seas_per_order, elements=elements, step_s=step_s
    )
    inputs = ordered(timed.inputs(step_s, plan.seas_per_order), step_s, plan.seas_per_order)
    work = f"{len(ORDERS_M_PER_S)} orders × {plan.seas_per_order}, {plan.seconds:g} s"
    found.append(_timed(work, fleet, inputs, plan, errors[plan.chosen]))
    report(total - 1, total, "states")
    states = _states(scene, fleet, plan)
    report(total, total, "done")
    return FleetSpeed(this_machine(), SCENE, plan.seconds, plan.reference, tuple(found), states)


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
    elements, step_s = fleet.scene.ropes[0].elements, fleet.scene.time.step_s
    node_steps = elements * len(fleet) * len(record.top_tension_n)
    best = min(took)
    return FleetRow(
        work, len(fleet), elements, step_s, median(took), best, 1e9 * best / node_steps, error_pct,
        len(record.failures),
    )  # fmt: skip


def _states(scene: Scene, fleet: Fleet, plan: Plan) -> tuple[StateRow, ...]:
    """Time copies of states: of one live twin, and to the members."""
    twin = Twin(at_setting(scene, plan.live_elements))
    twin.advance(100)
    live, one, members = live_state(twin), fleet.state(0), len(fleet)
    each = [fleet.state(k) for k in range(members)]
    factors = {name: np.linspace(0.95, 1.05, members) for name in fleet.figures}
    few = max(plan.copies // 10, 2)
    return (
        _copied(f"live state of {plan.live_elements:,} elements", lambda: live_state(twin), plan),
        _copied("a member: begin from it", lambda: fleet.begin_from(live), plan, few, members),
        _copied("a member: one state for all", lambda: fleet.restore(one), plan, few, members),
        _copied("a member: a state each", lambda: fleet.restore(each), plan, few, members),
        _copied("a member: all figures", lambda: fleet.set_figures(factors), plan, few, members),
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
