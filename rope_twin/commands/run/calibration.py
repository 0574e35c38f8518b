"""CPU cost of a setting on this machine: time steps and encoding, paced as in a run.

Processor time of the thread counts, so that other programs on the machine do not. What the
middleware takes to send the messages is not in it; the run itself tells it (`core_share`).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from statistics import mean, median
from typing import NamedTuple

from rope_twin.cadence import due_topics, slot_of
from rope_twin.messages import Encoder
from rope_twin.run.options import RunOptions
from rope_twin.scene.card import Rung, Setting
from rope_twin.scene.schema import Scene
from rope_twin.studies.variants import variant
from rope_twin.twin.kinds import twin_class
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.twin import Twin

SLOTS, PAUSE_S = 20, 0.002  # of a rung: the pause cools the caches, as pacing does
FEW, MANY = 1, 4  # steps in a slot
SOLVES_AT_REST = 2.0  # per step
WARM_UP, PACED_SLOTS = 4, 40  # of a setting: a whole number of rounds of all topics


class Cost(NamedTuple):
    """Share of one core that a setting needs [%]."""

    steps_pct: float
    publishing_pct: float  # without the middleware

    @property
    def pct(self) -> float:
        """Return the sum."""
        return self.steps_pct + self.publishing_pct


def measure_shares(scene: Scene, rungs: Sequence[Rung], speed: float) -> list[float]:
    """Measure the share of one core [%] that the time steps of each setting need here.

    A rope at rest is stepped in slots with pauses between, as a paced run does: in each slot a few
    steps and then many, so that what a slot costs and what a step costs are told apart. The solves
    that the card counted in each rung scale the latter. Takes about a second.
    """
    costs: dict[int, tuple[float, float]] = {}
    shares = []
    for rung in rungs:
        if rung.elements not in costs:
            costs[rung.elements] = _slot_costs(Twin(variant(scene, rung.elements)))
        slot_s, step_s = costs[rung.elements]
        steps = steps_in_slot(rung.step_s)
        busy_s = slot_s + steps * step_s * rung.solves_per_step / SOLVES_AT_REST
        shares.append(100.0 * busy_s / (steps * rung.step_s) * speed)
    return shares


def _slot_costs(twin: Twin) -> tuple[float, float]:
    """Return the cost of a cycle without its time steps, and of a time step [s]."""
    took = {FEW: [0.0] * SLOTS, MANY: [0.0] * SLOTS}
    twin.advance(MANY)
    for steps, times in took.items():
        for slot in range(SLOTS):
            time.sleep(PAUSE_S)
            began = time.thread_time()
            twin.advance(steps)
            twin.snapshot()
            times[slot] = time.thread_time() - began
    few, many = median(took[FEW]), median(took[MANY])
    step_s = max(many - few, 0.0) / (MANY - FEW)
    return max(few - FEW * step_s, 0.0), step_s


def measure_setting(
    scene: Scene, options: RunOptions, setting: Setting, solves_per_step: float
) -> Cost:
    """Measure the cost of a run with these options at a setting, over most of a second.

    solves_per_step: what the card counted where the rope moves; it scales the steps.
    """
    kind = twin_class(options.energy, options.error_band, options.watch)
    twin = kind(variant(scene, setting.elements, setting.step_s))
    steps = steps_in_slot(setting.step_s)
    encoder = Encoder(0)
    period_s = steps * setting.step_s / options.speed
    stepping, publishing = [], []
    due_s = time.monotonic()
    for slot in range(WARM_UP + PACED_SLOTS):
        due_s = max(due_s + period_s, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))
        began_s = time.thread_time()
        twin.advance(steps)
        snapshot = twin.snapshot()
        stepped_s = time.thread_time()
        for name in due_topics(*slot_of(snapshot), snapshot):
            encoder.encode(name, snapshot)
        if slot >= WARM_UP:
            stepping.append(stepped_s - began_s)
            publishing.append(time.thread_time() - stepped_s)
    solver = snapshot.solver
    busier = max(1.0, solves_per_step * solver.steps / solver.solves) if solver.solves else 1.0
    return Cost(100.0 * busier * median(stepping) / period_s, 100.0 * mean(publishing) / period_s)
