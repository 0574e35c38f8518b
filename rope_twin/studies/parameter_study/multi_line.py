"""One run of a study of a multi-line scene: a twin of its own, with results by rope.

The tension of a rope is that at its upper end, or at its sheave. Figures of the top tension without
the name of a rope are those of the first one, from the winch.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.errors import SceneError, SolverError
from rope_twin.scene.change import change_scene
from rope_twin.scene.model.joined import over_sheaves
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import feed
from rope_twin.studies.parameter_study.design import FatigueWish, Made
from rope_twin.twin.ensemble.ensemble import whole_steps
from rope_twin.twin.ensemble.member import MemberResults
from rope_twin.twin.monitors.damage import damage_of
from rope_twin.twin.monitors.settings import Monitors
from rope_twin.twin.monitors.tension import TensionMonitor
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.twin import Twin
from rope_twin.vortex.results import MaterialFatigue, RopeDamage

Row = dict[str, Any]
Counts = dict[int, RopeDamage]  # by the number of the rope


def new_counts(scene: Scene, wish: FatigueWish) -> Counts:
    """Return the fatigue counts of a scene's ropes.

    Raises:
        InputError: the curve does not fit a rope.
    """
    found = (
        (r, damage_of(scene, r, wish.curve, piece_m=wish.piece_m)) for r in range(len(scene.ropes))
    )
    return {r: count for r, count in found if count is not None}


def run_system(scene: Scene, made: Made, seconds: float, look_s: float, wish: FatigueWish | None
               ) -> Row:  # fmt: skip
    """Run a multi-line scene with the changes of a run, and return its results.

    Raises:
        RopeTwinError: the sea cannot be opened, or the curve does not fit a rope.
    """
    own = change_scene(scene, made.changes)
    sea = replace(own.sea_state, start_s=own.sea_state.start_s + made.sea_offset_s)
    own = replace(own, sea_state=sea)
    counts = new_counts(own, wish) if wish is not None else {}
    fixed = {
        "seconds": 0.0,
        "elements": sum(line.elements for line in own.ropes),
        "step_s": own.time.step_s,
    }
    checks = Monitors(slack_steps=whole_steps("look_s", look_s, own.time.step_s))
    try:
        twin = Twin(own, checks)
    except SceneError as error:
        unknown = MemberResults(0, math.nan, math.nan, math.nan, 0.0, 0, str(error))
        return {**fixed, **_top(unknown), **_by_rope(own, None), **_damage(own, counts)}
    failure = ""
    try:
        _step(twin, seconds, counts, wish)
    except SolverError as error:
        failure = str(error)
    seen = twin.monitor(TensionMonitor)
    assert seen is not None
    top = seen.upper_n[0]
    unconverged = int(twin.rope.state.health[rows.SUBSTEPS_UNCONVERGED])
    results = MemberResults(
        twin.steps, top.high, top.mean, top.low, seen.slack_share, unconverged, failure
    )
    fixed["seconds"] = twin.steps * twin.step_s
    return {**fixed, **_top(results), **_by_rope(own, seen), **_damage(own, counts)}


def _step(twin: Twin, seconds: float, counts: Counts, wish: FatigueWish | None) -> None:
    """Step the twin to the end; its ropes are sampled for fatigue at the intervals wished for."""
    slot = steps_in_slot(twin.step_s)
    every = round(wish.sample_s / twin.step_s) if wish is not None else slot
    for _ in feed(twin, seconds, math.gcd(every, slot)):
        if counts and twin.steps % every == 0:
            _sample(twin, counts)


def _sample(twin: Twin, counts: Counts) -> None:
    system = twin.joined
    assert system is not None
    ropes, beyond = system.system(twin.rope).ropes, dict(over_sheaves(twin.scene))
    pulls = [float(pull[rows.PULL]) for pull in system.pull]
    for r, count in counts.items():
        if (other := beyond.get(r)) is not None:
            count.take_over_sheave(ropes[r], ropes[other], (pulls[r], pulls[other]))
        else:
            count.take(ropes[r], pulls[r])


def _top(results: MemberResults) -> Row:
    return {name: known(value) for name, value in vars(results).items()}


def known(value: Any) -> Any:
    """Return a number of a row, None for one that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _by_rope(scene: Scene, seen: TensionMonitor | None) -> Row:
    """Return the tensions of each rope, and the largest of them over the breaking load.

    seen: None if the run never started.
    """
    found: Row = {}
    shares = []
    for number, line in enumerate(scene.ropes):
        upper = None if seen is None else seen.upper_n[number]
        found[f"{line.name}.tension_max_n"] = None if upper is None else known(upper.high)
        found[f"{line.name}.tension_mean_n"] = None if upper is None else known(upper.mean)
        found[f"{line.name}.tension_min_n"] = None if upper is None else known(upper.low)
        shares.append(math.nan if upper is None else upper.high / line.breaking_load_n)
    return {"highest_over_breaking_load": known(float(np.max(shares))), **found}


def _damage(scene: Scene, counts: Counts) -> Row:
    """Return the damage of each rope's pieces, and the worst piece of all; empty: not counted."""
    if not counts:
        return {}
    all_found = {r: count.shot(0.0, 0.0) for r, count in counts.items()}
    worst = max(all_found, key=lambda r: float(all_found[r].used.max()))
    there = all_found[worst]
    row: Row = {
        "damage_worst": float(there.used[there.worst]),
        "damage_worst_rope": scene.ropes[worst].name,
        "damage_worst_from_lower_end_m": float(there.from_lower_end_m[there.worst]),
    }
    for r, found in all_found.items():
        name = scene.ropes[r].name
        row[f"{name}.damage"] = found.used.tolist()
        row[f"{name}.damage_from_lower_end_m"] = found.from_lower_end_m.tolist()
        row |= {f"{name}.{key}": value for key, value in most_bent(found).items()}
    return row


def most_bent(found: MaterialFatigue) -> Row:
    """Return what the most bent metre of a rope has had; empty: it runs over nothing."""
    if found.bent is None:
        return {}
    at = found.most_bent
    return {
        "bends": float(found.bent.bends[at]),
        "bends_from_lower_end_m": float(found.from_lower_end_m[at]),
        "bend_damage": known(float(found.bent.damage[at])),
        "discard_fraction": known(float(found.bent.discard[at])),
    }
