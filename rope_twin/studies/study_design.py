"""Runs of a study: the value of each variable in each run, and the scene that results.

A run of a multi-line scene is a twin of its own, with results by rope. The tension of a rope is
that at its upper end, or at its sheave. Figures of the top tension without the name of a rope are
those of the first one, from the winch.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.errors import InputError, RopeTwinError, SceneError, SolverError
from rope_twin.quantity import json_value, quantity, text
from rope_twin.scene.joined_model import over_sheaves
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import Change, change_scene, load_scene, rope_preset
from rope_twin.scene.reader import Place, read_document, read_object
from rope_twin.scene.relations import faults
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import feed
from rope_twin.twin.ensemble.ensemble import BATCH_STEPS, Ensemble, Variation, whole_steps
from rope_twin.twin.ensemble.member import MemberResults
from rope_twin.twin.monitors import NO_MONITORS, Monitors, TensionMonitor
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.twin import Twin
from rope_twin.twin.vortex_monitor import damage_of
from rope_twin.vortex.fatigue import CURVES, OWN
from rope_twin.vortex.results import MaterialFatigue, RopeDamage

SEA_OFFSET_S = "sea_offset_s"  # the path of a variable that moves a run along the recorded sea
MAX_RUNS = 100_000
Row = dict[str, Any]
Value = float | str
Counts = dict[int, RopeDamage]  # by the number of the rope


@dataclass(frozen=True, kw_only=True)
class Case:
    """Several numbers of the scene that belong together, such as a sea's height and period."""

    name: str = text("what it is called in the table")
    set_: dict[str, float] = text("number by path of the scene")


@dataclass(frozen=True, kw_only=True)
class Variable:
    """Something that differs from run to run: numbers, names or cases."""

    name: str = text("its column in the table; absent: the path", "")
    path: str = text("what of the scene it is, such as payloads[0].mass_kg", "")
    from_: float | None = quantity("lowest number", default=None)
    to: float | None = quantity("highest number", default=None)
    count: int | None = quantity("numbers from lowest to highest, on a grid", "", 2, 10_000,
                                 default=None)  # fmt: skip
    values: tuple[float, ...] = quantity("numbers", default=())
    names: tuple[str, ...] = text("presets of `ropes[N].rope`, or bags of `sea_state.bag`", ())
    cases: tuple[Case, ...] = text("numbers that belong together", ())
    multiply: bool = text("the numbers multiply what the scene says", False)

    @property
    def column(self) -> str:
        """Return the name of the variable in tables."""
        return self.name or self.path + ("*" if self.multiply else "")

    def __str__(self) -> str:
        """Return it as `rope_twin ensemble` takes it."""
        numbers = ",".join(f"{value:g}" for value in self.values)
        return f"{self.column}={numbers or f'{self.from_:g}..{self.to:g}'}"

    def changes(self, value: Value) -> list[Change]:
        """Return the changes that give a run one of its numbers, or a case by its name."""
        if self.cases:
            case = next(named_case for named_case in self.cases if named_case.name == value)
            return [Change(path, number, self.multiply) for path, number in case.set_.items()]
        return [Change(self.path, float(value), self.multiply)]

    @property
    def ranges(self) -> bool:
        """Return whether any number from lowest to highest may be drawn."""
        return self.from_ is not None

    def at(self, share: float) -> float:
        """Return the number at a fraction from 0 to 1 of the range."""
        assert self.from_ is not None
        assert self.to is not None
        return self.from_ + share * (self.to - self.from_)

    def check(self) -> str | None:
        """Check that exactly one kind of values is given."""
        ways = [self.from_ is not None or self.to is not None, bool(self.values), bool(self.names),
                bool(self.cases)]  # fmt: skip
        if sum(ways) != 1:
            remedy = "give one of from and to, values, names, cases"
            return f"{sum(ways)} ways of saying what it can be; {remedy}"
        if self.cases:
            if self.path or not self.name:
                return "cases have paths of their own; give `name` and leave `path` out"
            called = [case.name for case in self.cases]
            return (
                None if len(set(called)) == len(called) else "two cases have one name; rename one"
            )
        if not self.path:
            return "it is not said what of the scene it is; add `path`"
        if self.names and self.multiply:
            return "names cannot multiply; leave `multiply` out"
        if ways[0] and (self.from_ is None or self.to is None or self.from_ >= self.to):
            return "`from` and `to` are no range; give both, the lesser as `from`"
        if self.count is not None and not ways[0]:
            return "`count` goes with `from` and `to`; leave it out"
        return None


@dataclass(frozen=True, kw_only=True)
class LatinHypercube:
    """Runs drawn so that each variable meets each part of its range equally often."""

    runs: int = quantity("how many runs", "", 2, MAX_RUNS)
    seed: int = quantity("picks them", "", 0, 2**31, default=1)


@dataclass(frozen=True, kw_only=True)
class FatigueRequest:
    """Damage along the rope, counted in every run."""

    curve: str = text(f"one of {', '.join(CURVES)}, or {OWN}, that of the rope in the scene")
    piece_m: float = quantity("length of a piece of rope", "m", 0.5, 1e4, default=20.0)
    sample_s: float = quantity("sampling interval of the tension", "s", 1e-3, 10.0, default=0.1)

    def check(self) -> str | None:
        """Check that the S-N curve is known."""
        known = (*CURVES, OWN)
        if self.curve in known:
            return None
        return f"there is no curve '{self.curve}'; known: {', '.join(known)}"


@dataclass(frozen=True, kw_only=True)
class Study:
    """Parameter study."""

    name: str
    path: Path
    digest: str  # SHA-256 of the file's text
    about: str = text("one line: what is asked")
    scene: str = text("a scene's name, or its path from this file")
    seconds: float = quantity("twin time of each run", "s", 1e-2, 1e6)
    slack_interval_s: float = quantity("sampling interval for slack detection", "s", 1e-3, 100.0,
                             default=0.5)  # fmt: skip
    vary: tuple[Variable, ...] = text("what differs from run to run")
    latin_hypercube: LatinHypercube | None = text("drawn runs; absent: a grid of all values", None)
    fatigue: FatigueRequest | None = text("count damage along the rope", None)

    def check(self) -> str | None:
        """Check that the variables are consistent."""
        columns = [variable.column for variable in self.vary]
        twice = next((name for name in columns if columns.count(name) > 1), "")
        if not self.vary:
            return "nothing varies; add variables to `vary`"
        if twice:
            return f"two variables are called '{twice}'; give one of them a `name`"
        uncounted = next(
            (variable for variable in self.vary if variable.ranges and variable.count is None), None
        )
        if uncounted is not None and self.latin_hypercube is None:
            remedy = "add `count`, or `latin_hypercube`"
            return f"on a grid '{uncounted.column}' needs its numbers; {remedy}"
        return None


def read_study(path: Path) -> tuple[Study, Scene]:
    """Return a study and its scene.

    Raises:
        SceneError: one sentence on what is wrong in the file or the scene.
    """
    tree, data = read_document(path)
    digest = hashlib.sha256(data).hexdigest()
    place = Place(path)
    study: Study = read_object(Study, tree, place, name=path.stem, path=path, digest=digest)
    scene_path = path.parent / study.scene
    return study, load_scene(scene_path if scene_path.suffix in (".yaml", ".yml") else study.scene)


def design_runs(study: Study) -> list[tuple[Value, ...]]:
    """Return the value of each variable in each run: a number, a name, or a case's name.

    Always in the same order.

    Raises:
        InputError: there are too many.
    """
    if study.latin_hypercube is None:
        sizes = [_choices(variable) for variable in study.vary]
        count = math.prod(len(size) for size in sizes)
        if count > MAX_RUNS:
            remedy = f"give fewer values ({MAX_RUNS} points at most), or draw a latin_hypercube"
            raise InputError(f"{study.path}: vary", f"the grid has {count} points", remedy)
        rows: Iterator[tuple[Value, ...]] = itertools.product(*sizes)
    else:
        from scipy.stats import qmc  # a second to load, and only studies want it

        cube_wish = study.latin_hypercube
        cube = qmc.LatinHypercube(d=len(study.vary), rng=np.random.default_rng(cube_wish.seed))
        rows = (
            tuple(
                _drawn(variable, share) for variable, share in zip(study.vary, point, strict=True)
            )
            for point in cube.random(cube_wish.runs).tolist()
        )
    return list(rows)


def _choices(variable: Variable) -> Sequence[Value]:
    """Return the values of a variable on a grid."""
    if variable.ranges:
        low, high, count = variable.from_, variable.to, variable.count
        assert low is not None
        assert high is not None
        assert count is not None
        values: list[float] = np.linspace(low, high, count).tolist()
        return values
    return variable.values or variable.names or tuple(case.name for case in variable.cases)


def _drawn(variable: Variable, share: float) -> Value:
    """Return the value of a variable at a fraction from 0 to 1 of its range or list."""
    if variable.ranges:
        return variable.at(share)
    choices = _choices(variable)
    return choices[min(int(share * len(choices)), len(choices) - 1)]


@dataclass(frozen=True)
class StudyRun:
    """One run of a study, and its scene made from that of the study."""

    number: int
    values: tuple[Value, ...]  # of each variable
    scene: Scene  # with its names, and with what all ropes of an ensemble must share
    changes: tuple[Change, ...]  # to that
    sea_offset_s: float


def run_of(study: Study, scene: Scene, number: int, values: tuple[Value, ...]) -> StudyRun:
    """Return a run with these values, checked to be valid.

    Raises:
        InputError: a variable leads nowhere or out of a range; one sentence with its place.
    """
    changes: list[Change] = []
    offset_s = 0.0
    varied = list(zip(study.vary, values, strict=True))
    for k, (variable, value) in enumerate(varied):
        with _at(f"{study.path}: vary[{k}]"):
            if variable.names:
                scene = _named(scene, variable.path, str(value))
            elif variable.path == SEA_OFFSET_S:
                offset_s += _offset_s(scene, float(value))
            else:
                changes += variable.changes(value)
    shared = [change for change in changes if change.path.startswith("time.")]
    run_changes = tuple(change for change in changes if change not in shared)
    try:
        scene = change_scene(scene, shared)
        change_scene(scene, run_changes)
    except RopeTwinError:
        for k, (variable, value) in enumerate(varied):  # one may be invalid by itself
            if not variable.names and variable.path != SEA_OFFSET_S:
                with _at(f"{study.path}: vary[{k}]"):
                    change_scene(scene, variable.changes(value))
        with _at(f"{study.path}: run {number}"):
            raise
    return StudyRun(number, values, scene, run_changes, offset_s)


def _offset_s(scene: Scene, value: float) -> float:
    """Return the offset into the sea [s].

    Raises:
        InputError: the scene has no sea that could begin elsewhere.
    """
    if scene.sea_state.on_waves is not None:
        remedy = "vary effects.waves.seed instead"
        raise InputError(SEA_OFFSET_S, "the ship rides on waves that begin with it", remedy)
    if not scene.sea_state.moves:
        raise InputError(SEA_OFFSET_S, "the scene's ship lies still", "leave it out")
    return value


@contextmanager
def _at(where: str) -> Iterator[None]:
    """Add the place in the study to an error."""
    try:
        yield
    except RopeTwinError as error:
        raise InputError(f"{where}: {error}") from error


_preset = lru_cache(maxsize=64)(rope_preset)


def _named(scene: Scene, path: str, name: str) -> Scene:
    """Return the scene with another rope or another bag.

    Raises:
        RopeTwinError: there is none of that name, or a rule of scenes is broken by it.
    """
    ropes = {f"ropes[{number}].rope": number for number in range(len(scene.ropes))}
    if path in ropes:
        lines = list(scene.ropes)
        lines[ropes[path]] = replace(lines[ropes[path]], rope=_preset(name), sections=())
        variant = replace(scene, ropes=tuple(lines))
    elif path == "sea_state.bag":
        variant = replace(scene, sea_state=replace(scene.sea_state, bag=name))
    else:
        remedy = f"names serve {', '.join(ropes)} and sea_state.bag"
        raise InputError(path, "it takes no name", remedy)
    for where, problem, remedy in faults(variant):
        raise InputError(where, problem, remedy)
    key = f"{scene.digest}\n{path}={name}"
    return dataclasses.replace(variant, digest=hashlib.sha256(key.encode()).hexdigest())


def new_counts(scene: Scene, request: FatigueRequest) -> Counts:
    """Return the fatigue counts of a scene's ropes.

    Raises:
        InputError: the curve does not fit a rope.
    """
    counts = (
        (r, damage_of(scene, r, request.curve, piece_m=request.piece_m))
        for r in range(len(scene.ropes))
    )
    return {r: count for r, count in counts if count is not None}


def run_system(
    run: StudyRun, seconds: float, slack_interval_s: float, request: FatigueRequest | None
) -> Row:
    """Make a run of a multi-line scene by its own twin, and return its results.

    Raises:
        RopeTwinError: the sea cannot be opened, or the curve does not fit a rope.
    """
    run_scene = change_scene(run.scene, run.changes)
    sea = replace(run_scene.sea_state, start_s=run_scene.sea_state.start_s + run.sea_offset_s)
    run_scene = replace(run_scene, sea_state=sea)
    counts = new_counts(run_scene, request) if request is not None else {}
    checks = Monitors(
        slack_steps=whole_steps("slack_interval_s", slack_interval_s, run_scene.time.step_s)
    )
    try:
        twin = Twin(run_scene, checks)
    except SceneError as error:
        return _row(run_scene, None, str(error), counts)
    failure = ""
    try:
        _step(twin, seconds, counts, request)
    except SolverError as error:
        failure = str(error)
    return _row(run_scene, twin, failure, counts)


def stepped(ensemble: Ensemble, seconds: float, every: int = BATCH_STEPS) -> Iterator[None]:
    """Advance all members by this time [s]; yield after each `every` steps, and at the end."""
    left = whole_steps("seconds", seconds, ensemble.step_s)
    while left:
        count = min(left, every)
        ensemble.advance(count * ensemble.step_s)
        left -= count
        yield


def run_together(
    scene: Scene,
    variations: Sequence[Variation],
    seconds: float,
    slack_interval_s: float,
    request: FatigueRequest | None,
) -> list[Row]:
    """Run a scene once for each variation, together, and return their results.

    seconds: whole samples of `request`.

    Raises:
        RopeTwinError: the sea is too short, or the curve does not fit a rope.
    """
    joined, step_s = is_joined(scene), scene.time.step_s
    checks = (
        Monitors(slack_steps=whole_steps("slack_interval_s", slack_interval_s, step_s))
        if joined
        else NO_MONITORS
    )
    ensemble = Ensemble(scene, variations, slack_interval_s, threads=1, monitors=checks)
    scenes = [ensemble.scene_of(number) for number in range(len(variations))]
    counts = [
        new_counts(member_scene, request) if request is not None else {} for member_scene in scenes
    ]
    every = round(request.sample_s / step_s) if request is not None else BATCH_STEPS
    for _ in stepped(ensemble, seconds, every):
        for number, member in enumerate(ensemble.figures()):
            if not counts[number] or member.failure:
                continue
            if joined:
                _sample(ensemble.twin_of(number), counts[number])
            else:
                snapshot = ensemble.snapshot(number)
                from_lower_m = (snapshot.arc_length_m[-1] - snapshot.arc_length_m)[::-1]
                tension_n = snapshot.element_tension_n[::-1]
                counts[number][0].take_tensions(from_lower_m, tension_n, snapshot.tension_top_n)
    return [
        _row(member_scene, ensemble.twin_of(number), member.failure, counts[number])
        if joined
        else _rope_row(member_scene, member, counts[number])
        for number, (member_scene, member) in enumerate(
            zip(scenes, ensemble.figures(), strict=True)
        )
    ]


def _rope_row(scene: Scene, member: MemberResults, counts: Counts) -> Row:
    """Return the results of a run of a single-line scene."""
    breaking_load_n = min(bar.rope.breaking_load_n for bar in lift_figures(scene).bars)
    tensions = _top(member)
    max_n = tensions["tension_top_max_n"]
    return {
        "seconds": member.steps * scene.time.step_s,
        "elements": scene.ropes[0].elements,
        "step_s": scene.time.step_s,
        **tensions,
        "max_utilisation": None if max_n is None else max_n / breaking_load_n,
        **_damage(scene, counts),
    }


def _row(scene: Scene, twin: Twin | None, failure: str, counts: Counts) -> Row:
    """Return the results of a run; twin: None if it never started."""
    fixed = {
        "seconds": 0.0,
        "elements": sum(line.elements for line in scene.ropes),
        "step_s": scene.time.step_s,
    }
    if twin is None:
        unknown = MemberResults(0, math.nan, math.nan, math.nan, 0.0, 0, failure)
        return {**fixed, **_top(unknown), **_by_rope(scene, None), **_damage(scene, counts)}
    tension = twin.monitor(TensionMonitor)
    assert tension is not None
    top = tension.upper_n[0]
    unconverged = int(twin.rope.state.health[rows.SUBSTEPS_UNCONVERGED])
    results = MemberResults(
        twin.steps, top.high, top.mean, top.low, tension.slack_share, unconverged, failure
    )
    fixed["seconds"] = twin.steps * twin.step_s
    return {**fixed, **_top(results), **_by_rope(scene, tension), **_damage(scene, counts)}


def _step(twin: Twin, seconds: float, counts: Counts, request: FatigueRequest | None) -> None:
    """Step the twin to the end; its ropes are sampled for fatigue at the requested intervals."""
    slot = steps_in_slot(twin.step_s)
    every = round(request.sample_s / twin.step_s) if request is not None else slot
    for _ in feed(twin, seconds, math.gcd(every, slot)):
        if counts and twin.steps % every == 0:
            _sample(twin, counts)


def _sample(twin: Twin | None, counts: Counts) -> None:
    assert twin is not None
    system = twin.joined
    assert system is not None
    ropes, beyond = system.system(twin.rope).ropes, dict(over_sheaves(twin.scene))
    pulls = [float(tension[rows.PULL]) for tension in system.pull]
    for r, count in counts.items():
        if (other := beyond.get(r)) is not None:
            count.take_over_sheave(ropes[r], ropes[other], (pulls[r], pulls[other]))
        else:
            count.take(ropes[r], pulls[r])


def _top(results: MemberResults) -> Row:
    return dict(json_value(vars(results)))


def _by_rope(scene: Scene, tension: TensionMonitor | None) -> Row:
    """Return the tensions of each rope, and the largest of them over the breaking load.

    seen: None if the run never started.
    """
    row: Row = {}
    shares = []
    for number, line in enumerate(scene.ropes):
        upper = None if tension is None else tension.upper_n[number]
        row[f"{line.name}.tension_max_n"] = None if upper is None else json_value(upper.high)
        row[f"{line.name}.tension_mean_n"] = None if upper is None else json_value(upper.mean)
        row[f"{line.name}.tension_min_n"] = None if upper is None else json_value(upper.low)
        shares.append(math.nan if upper is None else upper.high / line.breaking_load_n)
    return {"max_utilisation": json_value(float(np.max(shares))), **row}


def _damage(scene: Scene, counts: Counts) -> Row:
    """Return the damage of each rope's pieces, and the worst piece of all; empty: not counted."""
    if not counts:
        return {}
    all_found = {r: count.snapshot(0.0, 0.0) for r, count in counts.items()}
    worst_number = max(all_found, key=lambda r: float(all_found[r].used.max()))
    worst_rope = all_found[worst_number]
    joined = is_joined(scene)
    row: Row = {
        "damage_worst": float(worst_rope.used[worst_rope.worst]),
        **({"damage_worst_rope": scene.ropes[worst_number].name} if joined else {}),
        "damage_worst_from_lower_end_m": float(worst_rope.from_lower_end_m[worst_rope.worst]),
    }
    for r, damage in all_found.items():
        prefix = f"{scene.ropes[r].name}." if joined else ""
        row[f"{prefix}damage"] = damage.used.tolist()
        row[f"{prefix}damage_from_lower_end_m"] = damage.from_lower_end_m.tolist()
        row |= {f"{prefix}{key}": value for key, value in _most_bent(damage).items()}
    return row


def _most_bent(damage: MaterialFatigue) -> Row:
    """Return bends and damage of the most bent metre of a rope; empty: it runs over no sheave."""
    if damage.bent is None:
        return {}
    node = damage.most_bent
    return {
        "bends": float(damage.bent.bends[node]),
        "bends_from_lower_end_m": float(damage.from_lower_end_m[node]),
        "bend_damage": json_value(float(damage.bent.damage[node])),
        "discard_fraction": json_value(float(damage.bent.discard[node])),
    }
