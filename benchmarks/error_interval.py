"""Benchmark of the error interval: variants of the shipped scenes against finer references.

Each variant is a shipped scene with another depth, payload, sea, current, number of elements and
step, drawn by a seed. Its reference has four times the elements and a quarter of the step. The
interval covers the error at a time if the reference's top tension lies within it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.trial import Vector
from rope_twin.core import state as rows
from rope_twin.core.joined.initial_guess import interpolate_from
from rope_twin.core.joined.statics import refine_joined_statics
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import SceneError
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy_study import page_table
from rope_twin.studies.driven_twin import fed, variant
from rope_twin.twin.monitors import ERROR_INTERVAL
from rope_twin.twin.twin import Twin
from validation.case import Listener
from validation.marked_page import MarkedPage

VARIANTS, SEED, SECONDS = 40, 90417, 45.0
QUICK_VARIANTS, QUICK_SECONDS = 2, 5.0
RESOLUTION = 4  # elements of the reference over the variant's, and step over the reference's
FROM_S = 2.0  # earlier, the ship's motion has hardly begun and neither has an error
COVERED_PCT, COVERED_VARIANTS_PCT = 90.0, 90.0  # of the time, and of the variants with an interval
STILL = ("still_water",)  # scenes in which nothing moves
MIN_ELEMENTS = 6
PAGE = MarkedPage(
    "error_interval.md",
    "<!-- written by python -m benchmarks error_interval -->",
    "<!-- end of what is written -->",
)
HEAD = (
    "variant of", "elements", "step ms", "standard deviation kN", "error N", "bound N",
    "bound / error", "covered %", "cost %", "unknown",
)  # fmt: skip


@dataclass(frozen=True)
class Variant:
    """One drawn variant: factors on a scene's values, and its sea."""

    name: str  # of the scene
    depth: float  # on the rope's length; 1 with a seabed, a fixed end or several ropes
    payload: float  # on its mass
    sea: float  # on heave amplitude or significant wave height
    start_s: float  # offset into a recorded sea; seed of waves
    current: float  # on its velocity
    elements: float
    step: float

    def scene(self) -> Scene:
        """Return the scene with these values."""
        scene = load_scene(self.name)
        scene = self._with_current_and_sea(self._with_payload(self._with_depth(scene)))
        count = max(round(self.elements * scene.ropes[0].elements), MIN_ELEMENTS)
        return variant(scene, count, self.step * scene.time.step_s)

    def _with_depth(self, scene: Scene) -> Scene:
        line, winch = scene.ropes[0], scene.winch
        fixed = is_joined(scene) or line.fixed_at_m or scene.listed(SeabedParams)
        if fixed or line.grading is not None:
            return scene
        if winch is not None:
            shortest = self.depth * winch.min_line_out_m
            longest = self.depth * winch.max_line_out_m
            winch = replace(winch, min_line_out_m=shortest, max_line_out_m=longest)
        line = replace(line, length_m=self.depth * line.length_m)
        return replace(scene, ropes=(line,), winch=winch)

    def _with_payload(self, scene: Scene) -> Scene:
        loads = tuple(
            replace(payload, mass_kg=self.payload * payload.mass_kg) for payload in scene.payloads
        )
        return replace(scene, payloads=loads)

    def _with_current_and_sea(self, scene: Scene) -> Scene:
        sea = replace(scene.sea_state, start_s=scene.sea_state.start_s + self.start_s)
        if sea.heave is not None:
            heave = replace(sea.heave, amplitude_m=self.sea * sea.heave.amplitude_m)
            sea = replace(sea, heave=heave)
        effects = tuple(self._changed(effect) for effect in scene.effects)
        return replace(scene, sea_state=sea, effects=effects)

    def _changed(self, effect: Any) -> Any:
        if isinstance(effect, CurrentParams):
            points = tuple(
                (z, tuple(self.current * part for part in velocity))
                for z, velocity in effect.points
            )
            return replace(effect, profile=points, layers=None)
        if isinstance(effect, WavesParams) and effect.jonswap is not None:
            height = self.sea * effect.jonswap.significant_height_m
            jonswap = replace(effect.jonswap, significant_height_m=height)
            return replace(effect, jonswap=jonswap, seed=int(self.start_s))
        return effect


@dataclass(frozen=True)
class IntervalRow:
    """Result of one variant; forces are of the first rope's top tension."""

    variant: str
    elements: int  # of the first rope
    step_s: float
    deviation_n: float  # standard deviation of the tension
    error_n: float  # median magnitude
    bound_n: float  # median; NaN if unknown
    covered_pct: float  # of the time with an interval; NaN if there was none
    known_pct: float  # of the time
    unknown: str  # reason at the end of the run; "" if known
    cost_pct: float  # CPU time of the interval, relative to all other work

    @property
    def known(self) -> bool:
        """Return whether the run had an interval."""
        return self.known_pct > 0.0

    @property
    def covered(self) -> bool:
        """Return whether the interval covers the error for enough of the time."""
        return self.covered_pct >= COVERED_PCT


@dataclass(frozen=True)
class IntervalResult:
    """Result of the benchmark."""

    seed: int
    seconds: float
    rows: tuple[IntervalRow, ...]

    @property
    def known(self) -> tuple[IntervalRow, ...]:
        """Return the variants that had an interval."""
        return tuple(row for row in self.rows if row.known)

    @property
    def covered(self) -> int:
        """Return the number of variants whose error was covered."""
        return sum(row.covered for row in self.known)

    @property
    def ratio(self) -> float:
        """Return the median over the variants of median bound over median error."""
        ratios = [row.bound_n / row.error_n for row in self.known if row.error_n > 0.0]
        return float(np.median(ratios)) if ratios else np.nan

    @property
    def ok(self) -> bool:
        """Return whether enough variants with an interval are covered."""
        return 100.0 * self.covered >= COVERED_VARIANTS_PCT * len(self.known)

    def as_sentence(self) -> str:
        """Return the result in a sentence."""
        return (
            f"The interval is known in {len(self.known)} of {len(self.rows)} variants (seed "
            f"{self.seed}, {self.seconds:g} s each). It covers the error for at least "
            f"{COVERED_PCT:g} % of the time in {self.covered} of these {len(self.known)}. The "
            f"median of bound over error is {self.ratio:.1f}."
        )


@dataclass(frozen=True)
class Series:
    """Time series of one variant after each publish period."""

    time_s: Vector
    tension_n: Vector
    reference_n: Vector
    bound_n: Vector  # NaN while unknown
    unknown: str
    cost_pct: float


def draw_variants(seed: int, names: Sequence[str] = ()) -> Iterator[Variant]:
    """Yield variants without end; names: of the scenes, default: all in which something moves."""
    draw = np.random.default_rng(seed)
    known = [name for name in names or scene_names() if name not in STILL]
    while True:
        yield Variant(
            name=str(draw.choice(known)),
            depth=float(np.exp(draw.uniform(np.log(0.7), np.log(1.3)))),
            payload=float(np.exp(draw.uniform(np.log(0.7), np.log(1.4)))),
            sea=float(draw.uniform(0.5, 1.4)),
            start_s=float(draw.integers(0, 600)),
            current=float(draw.uniform(0.0, 1.5)),
            elements=float(np.exp(draw.uniform(np.log(0.6), np.log(1.6)))),
            step=float(draw.choice([0.5, 1.0, 2.0])),
        )


def measure_variants(
    count: int, seed: int, seconds: float, listen: Listener, names: Sequence[str] = ()
) -> Iterator[IntervalRow]:
    """Yield a row per variant; one that has no static equilibrium is replaced by the next draw.

    Raises:
        SolverError: a run failed.
    """
    done = 0
    for drawn in draw_variants(seed, names):
        if done == count:
            break
        listen(done, count, drawn.name)
        try:
            twin = Twin(drawn.scene(), ERROR_INTERVAL)
        except SceneError:
            continue
        yield row_of(drawn.name, twin.scene, series_of(twin, seconds))
        done += 1
    listen(count, count, "")


def series_of(twin: Twin, seconds: float) -> Series:
    """Run a variant and, if it has an interval, its reference.

    Raises:
        SolverError: a run failed.
    """
    snapshots = list(fed(twin, seconds))
    tension = np.array([snapshot.tension_top_n for snapshot in snapshots])
    intervals = [snapshot.error_interval for snapshot in snapshots]
    reference = np.full(len(snapshots), np.nan)
    if any(intervals):
        reference[:] = [snapshot.tension_top_n for snapshot in fed(_reference(twin.scene), seconds)]
    return Series(
        time_s=np.array([snapshot.time_s for snapshot in snapshots]),
        tension_n=tension,
        reference_n=reference,
        bound_n=np.array(
            [np.nan if interval is None else interval.bound_n for interval in intervals]
        ),
        unknown=snapshots[-1].no_error_interval,
        cost_pct=intervals[-1].cost_pct if intervals[-1] else np.nan,
    )


def row_of(name: str, scene: Scene, series: Series) -> IntervalRow:
    """Judge the interval of one variant."""
    counted = series.time_s >= FROM_S
    error, bound = np.abs(series.tension_n - series.reference_n)[counted], series.bound_n[counted]
    known = np.isfinite(bound)
    claimed = bool(known.any())
    return IntervalRow(
        variant=name,
        elements=scene.ropes[0].elements,
        step_s=scene.time.step_s,
        deviation_n=float(series.tension_n.std()),
        error_n=float(np.median(error[known])) if claimed else np.nan,
        bound_n=float(np.median(bound[known])) if claimed else np.nan,
        covered_pct=100.0 * float(np.mean(error[known] <= bound[known])) if claimed else np.nan,
        known_pct=100.0 * float(np.mean(known)),
        unknown=series.unknown,
        cost_pct=series.cost_pct,
    )


def _reference(scene: Scene) -> Twin:
    """Return the scene with more elements and a shorter step, from the same static equilibrium.

    In a multi-line system a payload may rotate freely, as a strut on a single rope does: its
    attitude at rest is arbitrary and differs between grids. The finer grid therefore begins with
    the shape of the coarser one.
    """
    elements, step_s = RESOLUTION * scene.ropes[0].elements, scene.time.step_s / RESOLUTION
    finer = Twin(variant(scene, elements, step_s))
    if is_joined(scene) and not scene.sheaves:
        _begin_alike(finer, Twin(scene))
    return finer


def _begin_alike(finer: Twin, twin: Twin) -> None:
    """Solve the equilibrium of a multi-line system near that on fewer elements."""
    assert finer.joined is not None
    assert twin.joined is not None
    system = finer.joined.system(finer.rope)
    place = np.zeros((len(system.ropes), rows.MOTIONS))
    for row, rope in zip(place, system.ropes, strict=True):
        top = int(rope.state.counts[rows.ELEMENTS])
        row[: rows.LINE] = rope.state.nodes[rows.POSITION : rows.POSITION + 3, top]
        row[rows.LINE] = rope.state.s[top]
    interpolate_from(system, twin.joined.system(twin.rope))
    refine_joined_statics(system, place)


def interval_table(results: Sequence[IntervalRow]) -> list[tuple[str, ...]]:
    """Return the rows as text, below a head."""
    return [HEAD, *(_as_text(row) for row in results)]


def _as_text(row: IntervalRow) -> tuple[str, ...]:
    first = row.variant, str(row.elements), f"{1e3 * row.step_s:g}", _rounded(row.deviation_n / 1e3)
    if not row.known:
        return (*first, *(5 * ("",)), row.unknown)
    return (
        *first,
        _rounded(row.error_n),
        _rounded(row.bound_n),
        f"{row.bound_n / row.error_n:.1f}" if row.error_n > 0.0 else "",
        f"{row.covered_pct:.1f}",
        f"{row.cost_pct:.0f}",
        row.unknown,
    )


def _rounded(value: float) -> str:
    """Return a value with two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):.10g}"


def as_json(result: IntervalResult) -> dict[str, Any]:
    """Return the result as a JSON object; numbers that are unknown are null."""
    rows = [
        {key: None if value != value else value for key, value in asdict(row).items()}
        for row in result.rows
    ]
    return {
        "seed": result.seed,
        "seconds": result.seconds,
        "variants": len(result.rows),
        "known": len(result.known),
        "covered": result.covered,
        "bound_over_error": None if np.isnan(result.ratio) else result.ratio,
        "ok": result.ok,
        "rows": rows,
    }


def write_page(result: IntervalResult, folder: Path) -> Path:
    """Write the result between the marks of a folder's page; return its path.

    Raises:
        InputError: there is no such page, or it has no marks.
    """
    command = f"python -m benchmarks error_interval --variants {len(result.rows)}"
    table = page_table(interval_table(result.rows))
    text = f"`{command} --seed {result.seed}`: {result.as_sentence()}"
    return PAGE.write(folder, f"{text}\n\n{table}")
