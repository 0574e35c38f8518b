"""Comparison with MoorDyn and CableDyn at equal error: the same case in one run, in turns.

A peer gets, for each scheme, the largest time step within LIMIT_PCT; the rope_twin setting compared
is the cheapest whose error is not larger (or not larger than the uncertainty of the reference),
with the peer's number of elements, and with any number.

Damping is the scene's, in N·s. With many elements that is far above an element's critical damping,
which limits the time step of explicit schemes; in smooth scenes, where the result does not depend
on it, MoorDyn may therefore also use a fraction of critical damping, and its better result counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np

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
from benchmarks.peers.ladder import CABLEDYN_LONG_S, ELEMENTS, REACH, Case, Ours, marks
from rope_twin.scene.schema import Scene
from rope_twin.studies.page import Machine, this_machine

LIMIT_PCT = 1.0
BEYOND, SHORTER, TRIES, TRIES_LONG = 1.2, 0.8, 7, 2
LOST = 3.0  # times the reference's highest tension
SEARCHED = 100  # segments; above, the fastest schemes of that search at their steps' share
CARRIED = 2
CRITICAL = -1.0
REPEATS, LONG_S = 3, 4.0  # in turns; one run of a peer that takes longer
FEW = ("Euler", "Midpoint4", "Midpoint5")  # the fastest of smooth_2km
Report = Callable[[int, int, str], None]


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


def race(cases: Sequence[Case], report: Report) -> PeerRace:
    """Search the settings of each peer and compare them.

    Raises:
        InputError: a peer is not installed.
    """
    require_peers()
    machine, rows, carried = this_machine(), [], dict[str, list[Setting]]()
    refused: dict[str, str] = {}
    for number, case in enumerate(cases):
        report(number, len(cases), f"{case.scene}, {case.segments} segments")
        ours = Ours(case)
        found = list(_search_moordyn(ours, carried.get(case.scene, [])))
        try:
            found.append(_search_cabledyn(ours))
        except PeerRefusal as refusal:
            refused[case.scene] = str(refusal)
        carried[case.scene] = _fastest(found, ours.scene, case.segments)
        rows += [_row(ours, one) for one in sorted(found, key=_speed, reverse=True)]
    report(len(cases), len(cases), "")
    return PeerRace(machine, dict(PEERS), LIMIT_PCT, tuple(rows), refused)


def _speed(found: Found) -> tuple[str, float]:
    return found.peer, found.history.real_time_factor


def _search_moordyn(ours: Ours, carried: list[Setting]) -> Iterator[Found]:
    """Return each scheme with its largest step within the limit; of two dampings the faster."""
    given, segments = figures(ours.scene), ours.case.segments
    omega, ratio = given.frequency(segments), given.damping_ratio(segments)
    if segments > SEARCHED and carried:
        for was in carried:  # its step is told as a share of the element's
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
