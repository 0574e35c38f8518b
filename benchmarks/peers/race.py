"""Comparison with MoorDyn and CableDyn at equal error: the same case in one run, in turns.

A peer gets, for each scheme, the largest time step within LIMIT_PCT; the rope_twin setting compared
is the cheapest whose error is not larger (or not larger than the uncertainty of the reference),
with the peer's number of elements, and with any number.

Damping is the scene's, in N·s. With many elements that is far above an element's critical damping,
which limits the time step of explicit schemes; in smooth scenes, where the result does not depend
on it, MoorDyn may therefore also use a fraction of critical damping, and its better result counts.

Errors are of the top tension over whole periods of the heave after its build-up: the largest of the
errors of mean, maximum and minimum, each in per cent of itself; the minimum of a rope that goes
slack in per cent of the mean.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.codes import (
    PEERS,
    RUNS,
    History,
    Job,
    PeerRefusal,
    Setting,
    require_peers,
)
from benchmarks.peers.decks import figures
from benchmarks.trial import Trial
from rope_twin.effects.current import CurrentParams
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy_study import Machine, this_machine
from rope_twin.studies.driven_twin import variant
from validation.case import Listener, announced

LIMIT_PCT = 1.0
BEYOND, SHORTER, TRIES, TRIES_LONG = 1.2, 0.8, 7, 2
LOST = 3.0  # times the reference's maximum tension
SEARCHED = 100  # segments; above, the fastest schemes of that search at their steps' share
CARRIED = 2
CRITICAL = -1.0
REPEATS, LONG_S = 3, 4.0  # in turns; one run of a peer that takes longer
FEW = ("Euler", "Midpoint4", "Midpoint5")  # the fastest of smooth_2km
# A scheme of MoorDyn still runs at so many times the inverse of an element's frequency, critically
# damped.
REACH = {
    "Euler": 1.93, "RK2": 1.93, "RK4": 2.67, "Midpoint4": 5.95, "Midpoint5": 7.07,
    "BEuler5": 4.20, "ACA5": 3.46,
}  # fmt: skip
CABLEDYN_S = (0.04, 0.02, 0.01, 0.005)
CABLEDYN_LONG_S = (0.01,)
STEPS_S = (0.2, 0.16, 0.125, 0.1, 0.08, 0.05, 0.04, 0.025, 0.02, 0.0125, 0.01, 0.005, 0.0025)
ELEMENTS = (20, 50, 100, 250, 500, 1000, 2500, 5000)
REFERENCE_STEP_S = 0.005
SLACK = 0.05  # of the mean: a lower minimum is that of a rope that falls slack


@dataclass(frozen=True)
class Case:
    """One comparison."""

    scene: str
    segments: int
    seconds: float
    from_s: float  # the start is not judged
    schemes: tuple[str, ...] = tuple(REACH)
    cabledyn_s: tuple[float, ...] = CABLEDYN_S
    still: bool = False  # without the scene's current

    @property
    def job(self) -> Scene:
        """Return the case as a job for a peer code."""
        scene = load_scene(self.scene)
        if not self.still:
            return scene
        effects = [params for params in scene.effects if not isinstance(params, CurrentParams)]
        return replace(scene, effects=tuple(effects))


@dataclass(frozen=True)
class Marks:
    """Quantities that the error is taken of [N]."""

    mean: float
    highest: float
    lowest: float

    @property
    def slack(self) -> bool:
        """Return whether the rope goes slack."""
        return self.lowest < SLACK * self.mean

    def error_pct(self, other: Marks) -> float:
        """Return the error of other quantities relative to these [%]; infinite if not a number."""
        apart = (
            abs(other.mean / self.mean - 1.0),
            abs(other.highest / self.highest - 1.0),
            abs(other.lowest - self.lowest) / (self.mean if self.slack else self.lowest),
        )
        return 100.0 * max(apart) if np.isfinite(apart).all() else float("inf")


def marks(tension_n: NDArray[np.float64], every_s: float, case: Case) -> Marks | None:
    """Return the quantities of a tension at the ends of equal intervals; None if it ended early."""
    times = every_s * np.arange(1, len(tension_n) + 1)
    if not len(times) or times[-1] < case.seconds - 1e-6:
        return None
    seen = tension_n[(times > case.from_s) & (times <= case.seconds + 1e-6)]
    return Marks(float(seen.mean()), float(seen.max()), float(seen.min()))


class Ours:
    """Results of rope_twin in a case: its reference, and each setting once."""

    def __init__(self, case: Case) -> None:
        self.case, self.scene = case, case.job
        fine = max(1000, 2 * case.segments)
        half = self._marks(fine // 2, 2.0 * REFERENCE_STEP_S)
        self.truth = self._marks(fine, REFERENCE_STEP_S)
        self.doubt_pct = self.truth.error_pct(half)
        self._found: dict[tuple[int, float], float] = {}

    def trial(self, elements: int, step_s: float) -> Trial:
        """Return the scene, ready to run with this setting."""
        return Trial(variant(self.scene, elements, step_s), self.case.seconds)

    def cheapest(self, within_pct: float, elements: Sequence[int]) -> tuple[int, float] | None:
        """Return elements and largest step within an error, for the first suitable number of
        elements.
        """
        for number in elements:
            for step_s in STEPS_S:
                if self.error_pct(number, step_s) <= within_pct:
                    return number, step_s
        return None

    def error_pct(self, elements: int, step_s: float) -> float:
        """Return the error of a setting [%]."""
        key = elements, step_s
        if key not in self._found:
            self._found[key] = self.truth.error_pct(self._marks(*key))
        return self._found[key]

    def _marks(self, elements: int, step_s: float) -> Marks:
        found = marks(self.trial(elements, step_s).run().tension_n, step_s, self.case)
        assert found is not None
        return found


FULL = (
    Case("smooth_2km", 20, 44.0, 20.0),
    Case("smooth_2km", 100, 44.0, 20.0),
    Case("smooth_2km", 1000, 20.0, 12.0, cabledyn_s=CABLEDYN_LONG_S),
    Case("smooth_5km", 100, 24.0, 16.0, FEW, still=True),
    Case("smooth_5km", 2500, 24.0, 16.0, FEW, CABLEDYN_LONG_S, still=True),
    Case("snap_vertical", 100, 36.0, 20.0),
)
QUICK = (Case("smooth_2km", 20, 28.0, 20.0, ("RK2", "Midpoint5"), (0.02,)),)


@dataclass(frozen=True)
class PeerRow:
    """A peer with one scheme at its best setting, and rope_twin at an error not larger.

    None: rope_twin has no setting with that error; the peer wins.
    """

    peer: str
    scheme: str  # with step and damping
    case: str  # scene
    segments: int
    seconds: float  # simulated
    peer_real_time_factor: float
    peer_error_pct: float | None  # None: it was lost on the way
    elements: int | None  # as many as segments, or the next more
    step_s: float | None
    real_time_factor: float | None
    error_pct: float | None
    ratio: float | None  # of the real-time factors
    any_elements: int | None  # the same with any number of elements
    any_step_s: float | None
    any_real_time_factor: float | None
    any_error_pct: float | None
    doubt_pct: float  # of the reference


@dataclass(frozen=True)
class PeerRace:
    """Results of all comparisons."""

    machine: Machine
    peers: dict[str, str]  # versions
    limit_pct: float
    rows: tuple[PeerRow, ...]
    refused: dict[str, str]  # by CableDyn: scene, and its words

    def as_json(self) -> dict[str, Any]:
        """Return the results for `--json`."""
        return asdict(self)


@dataclass(frozen=True)
class Found:
    """A peer's setting and what came of it."""

    peer: str
    setting: Setting
    history: History
    error_pct: float


def race(cases: Sequence[Case], listen: Listener) -> PeerRace:
    """Search the settings of each peer and compare them.

    Raises:
        InputError: a peer is not installed.
    """
    require_peers()
    machine, rows, carried = this_machine(), [], dict[str, list[Setting]]()
    refused: dict[str, str] = {}
    for case in announced(cases, listen, lambda one: f"{one.scene}, {one.segments} segments"):
        ours = Ours(case)
        found = list(_search_moordyn(ours, carried.get(case.scene, [])))
        try:
            found.append(_search_cabledyn(ours))
        except PeerRefusal as refusal:
            refused[case.scene] = str(refusal)
        carried[case.scene] = _fastest(found, ours.scene, case.segments)
        rows += [_row(ours, one) for one in sorted(found, key=_speed, reverse=True)]
    return PeerRace(machine, dict(PEERS), LIMIT_PCT, tuple(rows), refused)


def _speed(found: Found) -> tuple[str, float]:
    return found.peer, found.history.real_time_factor


def _search_moordyn(ours: Ours, carried: list[Setting]) -> Iterator[Found]:
    """Return each scheme with its largest step within the limit; of two dampings the faster."""
    given, segments = figures(ours.scene), ours.case.segments
    omega, ratio = given.frequency(segments), given.damping_ratio(segments)
    if segments > SEARCHED and carried:
        for was in carried:  # its step is stated as a share of the element's
            start = Setting(was.scheme, was.step_s / omega, was.damping)
            yield _largest_step(ours, "moordyn", start, TRIES_LONG)
        return
    for scheme in ours.case.schemes:
        reach = BEYOND * REACH[scheme] / omega
        tried = [Setting(scheme, reach / max(1.0, 2.0 * ratio), given.damping)]
        if not ours.truth.slack:
            tried.append(Setting(scheme, reach, CRITICAL))
        found = [_largest_step(ours, "moordyn", start, TRIES) for start in tried]
        good = [one for one in found if one.error_pct <= LIMIT_PCT]
        yield max(good, key=_speed) if good else min(found, key=lambda one: one.error_pct)


def _search_cabledyn(ours: Ours) -> Found:
    damping, tried = figures(ours.scene).damping, []
    for step_s in ours.case.cabledyn_s:
        tried.append(_try(ours, "cabledyn", Setting("generalised-alpha", step_s, damping)))
        if tried[-1].error_pct <= LIMIT_PCT:
            return tried[-1]
    return min(tried, key=lambda one: one.error_pct)


def _largest_step(ours: Ours, peer: str, start: Setting, tries: int) -> Found:
    """Return the first step within the limit as it shrinks; else that with the smallest error."""
    found, step_s = [], start.step_s
    for _ in range(tries):
        found.append(_try(ours, peer, Setting(start.scheme, step_s, start.damping)))
        if found[-1].error_pct <= LIMIT_PCT:
            return found[-1]
        step_s *= SHORTER
    return min(found, key=lambda one: one.error_pct)


def _try(ours: Ours, peer: str, setting: Setting) -> Found:
    case = ours.case
    job = Job(ours.scene, case.segments, case.seconds, LOST * ours.truth.highest)
    history = RUNS[peer](job, setting)
    seen = marks(history.tension_n, history.every_s, ours.case)
    return Found(peer, setting, history, ours.truth.error_pct(seen) if seen else float("inf"))


def _fastest(found: Sequence[Found], scene: Scene, segments: int) -> list[Setting]:
    """Return MoorDyn's best setting, with the step as a fraction of an element's limit, if any."""
    omega, damped = figures(scene).frequency(segments), figures(scene).damping > 0.0
    good = [
        one
        for one in found
        if one.peer == "moordyn"
        and one.error_pct <= LIMIT_PCT
        and (one.setting.damping < 0.0 or not damped)
    ]
    best = sorted(good, key=_speed, reverse=True)[:CARRIED]
    return [
        Setting(one.setting.scheme, one.setting.step_s * omega, one.setting.damping) for one in best
    ]


def _row(ours: Ours, found: Found) -> PeerRow:
    case = ours.case
    within = max(found.error_pct, ours.doubt_pct)
    more = [case.segments, *(number for number in ELEMENTS if number > case.segments)]
    fair = ours.cheapest(within, more)
    free = ours.cheapest(within, [n for n in ELEMENTS if n <= case.segments] + more)
    peer, mine, other = _in_turns(ours, found, fair, free)
    return PeerRow(
        peer=found.peer,
        scheme=found.setting.words,
        case=case.scene,
        segments=case.segments,
        seconds=case.seconds,
        peer_real_time_factor=peer,
        peer_error_pct=found.error_pct if np.isfinite(found.error_pct) else None,
        elements=fair[0] if fair else None,
        step_s=fair[1] if fair else None,
        real_time_factor=mine,
        error_pct=ours.error_pct(*fair) if fair else None,
        ratio=mine / peer if mine else None,
        any_elements=free[0] if free else None,
        any_step_s=free[1] if free else None,
        any_real_time_factor=other,
        any_error_pct=ours.error_pct(*free) if free else None,
        doubt_pct=ours.doubt_pct,
    )


def _in_turns(
    ours: Ours, found: Found, fair: tuple[int, float] | None, free: tuple[int, float] | None
) -> tuple[float, float | None, float | None]:
    """Return real-time factors of the peer and of both rope_twin settings: medians of turns."""
    trials = [ours.trial(*setting) if setting else None for setting in (fair, free)]
    peer, own = [found.history.real_time_factor], (list[float](), list[float]())
    for turn in range(REPEATS):
        if turn and found.history.took_s < LONG_S:
            peer.append(_try(ours, found.peer, found.setting).history.real_time_factor)
        for trial, seen in zip(trials, own, strict=True):
            if trial is not None:
                began = time.process_time()
                trial.run()
                seen.append(ours.case.seconds / (time.process_time() - began))
    return median(peer), median(own[0]) if own[0] else None, median(own[1]) if own[1] else None
