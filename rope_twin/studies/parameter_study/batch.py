"""Batches of runs of a study that are stepped together, one per core or cluster worker.

Each run is bit-identical to a twin of its own, so that results do not depend on the batches.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rope_twin.core.jit.wide import LANES
from rope_twin.errors import InputError, phrase
from rope_twin.scene.card import KnownError, known_error
from rope_twin.scene.model.lift import lift_figures
from rope_twin.scene.schema import Scene
from rope_twin.studies.ensemble.study import AFTER_NS, Seas
from rope_twin.studies.fatigue import RopeFatigue
from rope_twin.studies.parameter_study.design import Made, StudyRun
from rope_twin.studies.parameter_study.file import FatigueWish, Study
from rope_twin.twin.ensemble.ensemble import BATCH_S, Ensemble, Variation
from rope_twin.twin.fatigue.curves import CURVES

Row = dict[str, Any]
CHANGED = "; the convergence study is of the scene before its numbers were varied"


@dataclass(frozen=True)
class Batch:
    """Runs of one scene; all that a worker needs to know."""

    scene: Scene
    runs: tuple[StudyRun, ...]
    made: tuple[Made, ...]
    columns: tuple[str, ...]  # names of the variables
    seconds: float
    look_s: float
    fatigue: FatigueWish | None


def cut_into_batches(
    study: Study, runs: Sequence[tuple[StudyRun, Made]], at_once: int = LANES
) -> list[Batch]:
    """Group runs of the same scene into batches of limited size."""
    groups: dict[str, list[tuple[StudyRun, Made]]] = {}
    for run, one in runs:
        groups.setdefault(one.scene.digest, []).append((run, one))
    columns = tuple(one.column for one in study.vary)
    batches = []
    for alike in groups.values():
        for first in range(0, len(alike), at_once):
            runs_here, made = zip(*alike[first : first + at_once], strict=True)
            batches.append(
                Batch(made[0].scene, runs_here, made, columns, study.seconds, study.look_s,
                      study.fatigue)
            )  # fmt: skip
    return batches


def run_batch(batch: Batch) -> list[Row]:
    """Return a row of results for each run.

    Raises:
        RopeTwinError: the sea is not there or too short, or the curve does not fit the rope.
    """
    began = time.perf_counter()
    ensemble = Ensemble(batch.scene, list(_variations(batch)), batch.look_s, threads=1)
    followed = _follow(batch, ensemble)
    known = known_error(batch.scene)
    took_s = (time.perf_counter() - began) / len(batch.runs)
    rows = []
    for number, run in enumerate(batch.runs):
        rows.append(
            {
                "run": run.number,
                **dict(zip(batch.columns, run.values, strict=True)),
                **_figures(ensemble, number, batch.seconds),
                **_card(known, bool(batch.made[number].changes)),
                **(_damage(followed[number]) if followed else {}),
                "took_s": took_s,
            }
        )
    return rows


def _variations(batch: Batch) -> Iterator[Variation]:
    seas = Seas(batch.scene, round(batch.seconds * 1e9) + AFTER_NS)
    for run, made in zip(batch.runs, batch.made, strict=True):
        heave = seas.heave(made.changes, made.sea_offset_s)
        if heave is not None and heave.end_ns < batch.seconds * 1e9:
            what = f"the sea of run {run.number} ends after {heave.end_ns * 1e-9:g} s"
            raise InputError(phrase("seconds", what, "let it loop, or run shorter"))
        yield Variation(made.changes, heave)


def _follow(batch: Batch, ensemble: Ensemble) -> list[RopeFatigue]:
    """Step all runs to the end, with an eye on each piece of rope where that is wished."""
    wish = batch.fatigue
    if wish is None:
        left, step_s = round(batch.seconds / ensemble.step_s), ensemble.step_s
        while left:
            some = min(left, max(1, round(BATCH_S / step_s)))
            ensemble.advance(some * step_s)
            left -= some
        return []
    counts = [_fatigue(ensemble.scene_of(number), wish) for number in range(len(ensemble))]
    for _ in range(round(batch.seconds / wish.sample_s)):
        ensemble.advance(wish.sample_s)
        going = (k for k, one in enumerate(ensemble.figures()) if not one.failure)
        for number in going:
            counts[number].take(ensemble.snapshot(number))
    return counts


def _fatigue(scene: Scene, wish: FatigueWish) -> RopeFatigue:
    line = scene.ropes[0]
    most = scene.winch.most_line_out_m if scene.winch else line.length_m
    sheave = scene.winch.sheave if scene.winch else None
    bent_pa = sheave.bending_stress_pa(line.made_of[0].rope.diameter_m) if sheave else 0.0
    return RopeFatigue(line, most, wish.piece_m, CURVES[wish.curve], bent_pa)


def _figures(ensemble: Ensemble, number: int, seconds: float) -> Row:
    scene, figures = ensemble.scene_of(number), ensemble.figures()[number]
    least = min(bar.rope.breaking_load_n for bar in lift_figures(scene).bars)
    told = {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in asdict(figures).items()
    }
    most = told["tension_top_max_n"]
    share = None if most is None else most / least
    whole = {"seconds": figures.steps * scene.time.step_s, "elements": scene.ropes[0].elements,
             "step_s": scene.time.step_s}  # fmt: skip
    return {**whole, **told, "highest_over_breaking_load": share}


def _card(known: KnownError, changed: bool) -> Row:
    """Return the error of the scene's convergence study; indicative for a run with other values."""
    return {
        "card_error_rms_pct": None if math.isnan(known.rms_pct) else known.rms_pct,
        "card_error_peak_pct": None if math.isnan(known.peak_pct) else known.peak_pct,
        "card_error_words": known.words + (CHANGED if changed else ""),
    }


def _damage(counted: RopeFatigue) -> Row:
    found = counted.damage()
    return {
        "damage_worst": float(found.damage[found.worst]),
        "damage_worst_from_lower_end_m": float(found.from_lower_end_m[found.worst]),
        "damage": found.damage.tolist(),
        "damage_from_lower_end_m": found.from_lower_end_m.tolist(),
    }
