"""An ensemble run to an end: members from a plan, their figures and the quantiles over them."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from rope_twin.errors import InputError
from rope_twin.recording.heave import HeaveReplay, open_heave
from rope_twin.recording.motion_source import FIRST_NS, Sea, open_sea, series_of
from rope_twin.recording.track import check_start
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.schema import Scene, SeaState
from rope_twin.studies.study_design import SEA_OFFSET_S, Variable, stepped
from rope_twin.twin.ensemble.ensemble import Ensemble, Lanes, Variation, whole_steps
from rope_twin.twin.ensemble.member import MemberResults
from rope_twin.twin.motion.heave_track import HeaveSeries

MAX_MEMBERS = 10_000
MEMBERS_USUAL = 100
RIGHT = "write PATH=LOW..HIGH, PATH=LOW..HIGH:COUNT or PATH=A,B,C (*= to multiply)"


@dataclass(frozen=True)
class Plan:
    """Values of the variables for each member."""

    axes: tuple[Variable, ...]
    seed: int
    rows: tuple[tuple[float, ...], ...]  # a value of each; members of a grid point together
    per_point: int  # members at each point of the grid


def read_axis(option: str, text: str) -> Variable:
    """Return a variable as written on a command line. Raises InputError."""
    path, sign, numbers = text.partition("=")
    multiply = path.endswith("*")
    path = path.removesuffix("*")
    if not sign or not path or not numbers:
        raise InputError(f"{option} '{text}'", "it names no path or no numbers", RIGHT)
    return read_range(option, path, numbers, multiply)


def read_range(option: str, path: str, numbers: str, multiply: bool = False) -> Variable:
    """Return a variable from `LOW..HIGH`, `LOW..HIGH:COUNT` or `A,B,C`. Raises InputError."""
    where = f"{option} '{numbers}'"
    if ".." not in numbers:
        values = tuple(_read_number(where, word) for word in numbers.split(","))
        return Variable(path=path, values=values, multiply=multiply)
    ends, colon, count = numbers.partition(":")
    low, high = (_read_number(where, word) for word in ends.split("..", 1))
    if low >= high:
        raise InputError(where, f"{low:g} is not below {high:g}", "give the lesser first")
    if not colon:
        return Variable(path=path, from_=low, to=high, multiply=multiply)
    if not count.isdecimal() or not 2 <= int(count) <= MAX_MEMBERS:
        problem = f"'{count}' is no number of values"
        raise InputError(where, problem, f"give 2 to {MAX_MEMBERS} after the colon")
    values = tuple(np.linspace(low, high, int(count)).tolist())
    return Variable(path=path, values=values, multiply=multiply)


def make_plan(axes: Sequence[Variable], members: int | None, seed: int) -> Plan:
    """Return each member's values. More members of the same seed begin with the same ones.

    members: at each point of the grid; None: one, or 100 where anything is drawn at random.

    Raises:
        InputError: nothing varies, or there are too many members.
    """
    random_axes = [axis for axis in axes if not axis.values]
    if not axes:
        raise InputError("ensemble", "nothing varies", "say what does, with --vary or --sea-offset")
    paths = [axis.path for axis in axes if not axis.multiply]
    twice = next((path for path in paths if paths.count(path) > 1), "")
    if twice:
        raise InputError(f"--vary {twice}", "it is set twice", "keep one of them")
    per_point = members if members is not None else (MEMBERS_USUAL if random_axes else 1)
    points = math.prod(len(axis.values) for axis in axes if axis.values)
    if not 1 <= per_point * points <= MAX_MEMBERS:
        problem = f"{per_point} members at each of {points} points of the grid"
        raise InputError("--members", problem, f"give 1 to {MAX_MEMBERS} in all")
    if per_point > 1 and not random_axes:
        problem = f"{per_point} members at each point would all be equal"
        raise InputError("--members", problem, "leave it out, or draw a number at random")
    random = np.random.default_rng(seed).random((per_point * points, len(random_axes)))
    rows = []
    grid = itertools.product(*(axis.values for axis in axes if axis.values))
    for number, point in enumerate(point for point in grid for _ in range(per_point)):
        numbers, shares = iter(point), iter(random[number].tolist())
        rows.append(tuple(next(numbers) if axis.values else axis.at(next(shares)) for axis in axes))
    return Plan(tuple(axes), seed, tuple(rows), per_point)


def _read_number(where: str, word: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(where, f"'{word.strip()}' is no finite number", RIGHT)
    return number


QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
FIGURES = ("tension_top_max_n", "tension_top_mean_n", "tension_top_min_n", "slack_share")
MINUTE_NS = 60_000_000_000
AFTER_NS = 1_000_000_000  # heave goes on so long after the end: the last step looks ahead


@dataclass(frozen=True)
class StudyResult:
    """Results of an ensemble, one row per member."""

    plan: Plan
    figures: list[MemberResults]
    breaking_loads_n: list[float]
    time_s: float  # twin time of each member
    step_s: float
    threads: int
    lanes: Lanes
    starting_s: float  # real time spent on building, compiling and finding where each rope starts
    computing_s: float  # real time spent on stepping

    @property
    def real_time_factor(self) -> float:
        """Return simulation time over real time, for all members together."""
        return self.time_s / self.computing_s if self.computing_s > 0.0 else 0.0

    @property
    def failed(self) -> int:
        """Return the number of members that stopped early."""
        return sum(bool(figure.failure) for figure in self.figures)

    @property
    def slack(self) -> int:
        """Return the number of members with a slack line."""
        return sum(figure.slack_share > 0.0 for figure in self.figures)

    @property
    def overloaded(self) -> int:
        """Return the number of members whose MBL was exceeded."""
        pairs = zip(self.figures, self.breaking_loads_n, strict=True)
        return sum(figure.tension_top_max_n > limit_n for figure, limit_n in pairs)

    def quantiles(self, first: int = 0, count: int | None = None) -> dict[str, list[float]]:
        """Return QUANTILES of each of FIGURES over the completed members; empty: none."""
        end = None if count is None else first + count
        complete = [figure for figure in self.figures[first:end] if not figure.failure]
        if not complete:
            return {}
        return {
            name: np.quantile([getattr(member, name) for member in complete], QUANTILES).tolist()
            for name in FIGURES
        }


def run_study(
    scene: Scene,
    plan: Plan,
    seconds: float,
    slack_interval_s: float,
    report: Callable[[float, float], None],
    threads: int | None = None,
) -> StudyResult:
    """Run all members; `report(simulation time, real time)` is called every 800 steps.

    Raises:
        RopeTwinError: a member, the sea or a value is invalid; one sentence.
    """
    start_s = time.perf_counter()
    whole_steps("--duration", seconds, scene.time.step_s)
    whole_steps("--slack-interval", slack_interval_s, scene.time.step_s)
    if not scene.sea_state.moves and any(axis.path == SEA_OFFSET_S for axis in plan.axes):
        raise InputError("--sea-offset", "the scene's ship lies still", "leave it out")
    ensemble = Ensemble(scene, variations(scene, plan, seconds), slack_interval_s, threads)
    lanes = ensemble.lanes()
    ensemble.make_ready()
    started = time.perf_counter()
    report(0.0, 0.0)
    for _ in stepped(ensemble, seconds):
        report(ensemble.time_ns * 1e-9, time.perf_counter() - started)
    return StudyResult(
        plan=plan,
        figures=ensemble.figures(),
        breaking_loads_n=[
            min(bar.rope.breaking_load_n for bar in lift_figures(ensemble.scene_of(k)).bars)
            for k in range(len(ensemble))
        ],
        time_s=seconds,
        step_s=scene.time.step_s,
        threads=ensemble.threads,
        lanes=lanes,
        starting_s=started - start_s,
        computing_s=time.perf_counter() - started,
    )


def variations(scene: Scene, plan: Plan, seconds: float) -> list[Variation]:
    """Return each member's changes and its section of the sea.

    Raises:
        InputError: a sea ends before the run does.
    """
    result = []
    seas = MemberHeave(scene, seconds)
    for number, row in enumerate(plan.rows):
        pairs = list(zip(plan.axes, row, strict=True))
        scene_pairs = [(axis, value) for axis, value in pairs if axis.path != SEA_OFFSET_S]
        changes = tuple(change for axis, value in scene_pairs for change in axis.changes(value))
        offset_s = sum(value for axis, value in pairs if axis.path == SEA_OFFSET_S)
        where = f"--duration {seconds:g}"
        result.append(seas.variation(changes, offset_s, where, f"member {number}"))
    return result


class MemberHeave:
    """The heave of members; those of one record share its samples."""

    def __init__(self, scene: Scene, seconds: float) -> None:
        self._scene, self._seconds = scene, seconds
        self._length_ns = round(seconds * 1e9) + AFTER_NS
        self._records: dict[SeaState, HeaveSeries] = {}

    def variation(
        self, changes: tuple[Change, ...], offset_s: float, where: str, member: str
    ) -> Variation:
        """Return a member's changes and its section of the sea.

        Raises:
            RopeTwinError: there is no such sea, or it ends before the run does (`where`).
        """
        heave = self.heave(changes, offset_s)
        if heave is not None and heave.end_ns < self._seconds * 1e9:
            problem = f"the sea of {member} ends after {heave.end_ns * 1e-9:g} s"
            raise InputError(where, problem, "let it loop, or run shorter")
        return Variation(changes, heave)

    def heave(self, changes: Sequence[Change], offset_s: float) -> HeaveSeries | None:
        """Return the ship motion of a member, from `offset_s` after the scene's own start.

        The samples are those that `rope_twin run` feeds to its twin.

        Raises:
            RopeTwinError: there is no such sea; one sentence.
        """
        if self._scene.sea_state.on_waves is not None:
            return self._on_waves(changes, offset_s)
        sea_changes = [change for change in changes if change.path.startswith("sea_state.")]
        state = change_scene(self._scene, sea_changes).sea_state
        if not state.moves:
            return None
        if state.start_s + offset_s < 0.0:
            problem = f"{offset_s:g} s lies before the sea's beginning"
            raise InputError("--sea-offset", problem, f"give {-state.start_s:g} or more")
        if not state.bag:
            sooner = replace(state, start_s=state.start_s + offset_s)
            return _sampled(replace(self._scene, sea_state=sooner), self._length_ns)
        start_ns = round((state.start_s + offset_s) * 1e9)
        from_start = replace(state, start_s=0.0)
        check_start(state.start_s + offset_s, _opened(from_start).duration_s)
        record = self._records.get(from_start)
        if record is None or (from_start.loop and record.end_ns < start_ns + self._length_ns):
            # more than this member needs: offsets to come are like its own
            minutes = -(-(2 * start_ns + self._length_ns) // MINUTE_NS)
            # of a minute times a power of two, so that similar lengths share a record
            until_ns = MINUTE_NS << (minutes - 1).bit_length()
            record = self._records[from_start] = _recorded(from_start, until_ns)
        return record.starting_at(start_ns)

    def _on_waves(self, changes: Sequence[Change], offset_s: float) -> HeaveSeries:
        """Return the motion of a ship on the member's own waves, which any change may affect."""
        if offset_s != 0.0:
            problem = "the ship rides on waves, which begin with the scene"
            raise InputError("--sea-offset", problem, "vary effects.waves.seed instead")
        return _sampled(change_scene(self._scene, changes), self._length_ns)


def _sampled(scene: Scene, until_ns: int) -> HeaveSeries:
    sea = open_sea(scene)
    assert sea is not None
    return _series(sea, until_ns)


@lru_cache(maxsize=8)
def _opened(state: SeaState) -> HeaveReplay:
    """Return the motion in a bag, read once for all ensembles of a process."""
    return open_heave(state.bag, None, state.start_s, state.loop)


@lru_cache(maxsize=8)
def _recorded(state: SeaState, until_ns: int) -> HeaveSeries:
    """Return a bag's samples, made once for all ensembles of a process."""
    return _series(_opened(state), until_ns)


def _series(sea: Sea, until_ns: int) -> HeaveSeries:
    series = series_of(sea.between(FIRST_NS, until_ns))
    assert series is not None
    return series
