"""Plan of a convergence study: accuracy levels, time window and reference run.

It depends on the scene only, not on the machine, so that a study can be repeated anywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rope_twin.errors import InputError, phrase
from rope_twin.scene.model.joined import build_joined
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import is_joined
from rope_twin.scene.validation.vortices import shedding_model
from rope_twin.studies.accuracy.run import Setting

LONGEST_STEP_S = 0.2  # the longest that a scene may have
FEWEST, MOST = 10, 1000  # elements of a ladder; at least half and twice the scene's own
TOLERANCES = (0.1, 10.0)  # times the scene's own, at its own elements and step
REFERENCE_TOLERANCE = 0.1
REFERENCE_WORK = 33e6  # nodes times steps of the finest run, about
FINER_MOST = 4  # elements of the reference over those of the finest rung
MOST_WORK = 800e6  # nodes times steps of everything together: about a minute and a half
DEAR = 2.0  # a scene whose nodes cost more than twice as much has a short ladder
COMPONENTS = 14.0  # so many waves cost a node as much as all else
VORTICES = 1.4  # what a model of vortices costs a node beside all else, at most
SHORTEST_WINDOW = 10  # looks


@dataclass(frozen=True)
class Reach:
    """Extent of a convergence study."""

    step_factors: tuple[float, ...]  # of the scene's own step
    doublings: int  # of its own elements, as long as MOST allows; one at least
    reference_step: float  # of the scene's own step
    window_s: float  # at least
    longest_window_s: float


USUAL = Reach((0.5, 1.0, 2.0, 5.0), 2, 0.25, 60.0, 120.0)
SHORT = Reach((1.0, 2.0, 5.0), 1, 0.5, 30.0, 30.0)  # of scenes that cost much


@dataclass(frozen=True)
class Plan:
    """Runs of a convergence study."""

    seconds: float
    own: Setting
    look_s: float  # a whole number of every step
    settings: tuple[Setting, ...]
    reference: Setting
    ropes: float = 1.0  # all ropes' elements over the first one's

    @property
    def work(self) -> float:
        """Return nodes times steps, including the reference's coarser grids and repeated timing."""
        ladder = math.fsum(one.elements / one.step_s for one in self.settings)
        fine = self.reference.elements / self.reference.step_s
        return self.ropes * self.seconds * (2.5 * fine + 2.5 * ladder)


def make_plan(scene: Scene, seconds: float | None = None) -> Plan:
    """Return accuracy levels and window of a scene (None: as the scene's events require).

    Raises:
        SceneError: the scene cannot be built.
        InputError: the window is too short, or the scene's elements cannot be varied.
    """
    where = f"scene {scene.name}"
    if any(line.grading is not None and line.grading.nodes_m is not None for line in scene.ropes):
        right = "give the lowest element's length and its growth instead"
        raise InputError(phrase(where, "grading.nodes_m holds the elements fixed", right))
    usual = _plan(scene, seconds, USUAL)
    dear = dearness(scene) > DEAR or usual.work > MOST_WORK
    return _plan(scene, seconds, SHORT) if dear else usual


def dearness(scene: Scene) -> float:
    """Return the cost of a node and step relative to those of a rope without waves and vortices."""
    components = sum(int(getattr(one, "components", 0)) for one in scene.effects)
    vortices = VORTICES if shedding_model(scene) else 0.0
    return 1.0 + components / COMPONENTS + vortices


def _plan(scene: Scene, seconds: float | None, reach: Reach) -> Plan:
    own = Setting(scene.ropes[0].elements, scene.time.step_s)
    h = own.step_s
    factors = [one for one in reach.step_factors if one * h <= LONGEST_STEP_S]
    look_s = _whole(math.lcm(*(round(2.0 * one) for one in factors)) * 0.5 * h)
    span = _window_s(scene, reach) if seconds is None else seconds
    span = _whole(math.floor(span / look_s + 1e-6) * look_s)
    least = _whole(SHORTEST_WINDOW * look_s)
    if span < least:
        raise InputError(
            phrase("--duration", f"{seconds:g} s is too short", f"give {least:g} or more")
        )
    counts = _counts(own.elements, reach.doublings)
    ropes = sum(line.elements for line in scene.ropes) / own.elements
    first = build_joined(scene).system.ropes[0] if is_joined(scene) else build(scene)
    tolerance = first.model.tolerance
    ladder = [Setting(count, _whole(factor * h)) for count in counts for factor in factors]
    others = [Setting(own.elements, h, min(part * tolerance, 1e4)) for part in TOLERANCES]
    finest_s = _whole(reach.reference_step * h)
    most = REFERENCE_WORK / ropes / dearness(scene) / (span / finest_s) / counts[-1]
    finer = 2 ** math.floor(math.log2(max(most, 1.0)))
    elements = counts[-1] * min(max(finer, 2), FINER_MOST)
    fine = Setting(elements, finest_s, REFERENCE_TOLERANCE * tolerance)
    return Plan(span, own, look_s, (*ladder, *others), fine, ropes)


def _window_s(scene: Scene, reach: Reach) -> float:
    """Return a minute, or one cycle of the winch schedule if longer (two minutes at most) [s]."""
    winch = scene.winch
    scheduled = winch.schedule_repeats_every_s or 0.0 if winch and winch.schedule else 0.0
    return min(max(reach.window_s, scheduled), reach.longest_window_s)


def _counts(own: int, doublings: int) -> list[int]:
    """Return the numbers of elements: the scene's own, halved and doubled."""
    counts, down = [own], own
    while round(down / 2) >= FEWEST:
        down = round(down / 2)
        counts.insert(0, down)
    for doubling in range(1, doublings + 1):
        if doubling == 1 or own * 2**doubling <= MOST:
            counts.append(own * 2**doubling)
    return counts


def _whole(seconds: float) -> float:
    """Return a number without its last bits, which depend on how a time was computed."""
    return round(seconds, 12)
