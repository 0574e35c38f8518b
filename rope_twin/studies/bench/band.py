"""Whether the live error band holds: its bound beside the error against a converged reference.

Every scene runs with its own sea and winch. The reference is the same scene on four times the
elements with a quarter of the step; one on twice and a half tells how far to trust it. Where the
rope never was slack nor on the bed both are of second order and extrapolated (Richardson 1911), and
the doubt is what that adds; where it was, the doubt is the whole difference of the two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rope_twin.commands.run.inputs import FIRST_NS, LEAD_NS, offer, open_sea
from rope_twin.errors import SolverError
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.trial import Vector
from rope_twin.studies.variants import variant
from rope_twin.twin.error_band import BandedTwin, bed_below, nodes_on
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.schedule import schedule_samples
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin

FULL = (
    ("deep_lift", 120.0), ("shallow_lift", 120.0), ("hmpe_lift", 120.0), ("hybrid_lift", 120.0),
    ("storm", 120.0), ("wave_zone", 60.0), ("riser_300m", 60.0), ("smooth_2km", 60.0),
    ("smooth_5km", 60.0), ("slack_5km", 60.0), ("snap_vertical", 60.0), ("snap_2km", 60.0),
    ("splash_zone", 80.0), ("landing", 100.0),
)  # fmt: skip
UNSEEN = (  # scenes that the bound's numbers were not found on
    ("chain_on_bottom", 60.0), ("hmpe_deep", 60.0), ("tow_with_net", 60.0), ("rov_tether", 60.0),
    ("grab_lift", 60.0), ("ahc_lift", 60.0), ("deep_tow_turn", 60.0), ("ship_6dof", 60.0),
)  # fmt: skip
QUICK = (("shallow_lift", 25.0), ("storm", 30.0))
FROM_S = 2.0  # before, the ship's motion has hardly begun and neither has an error
FINE, MIDDLE = 4, 2  # times the elements and parts of the step of the references
Listener = Callable[[int, int, str], None]


@dataclass(frozen=True)
class BandRow:
    """One scene; forces are of the top tension."""

    scene: str
    seconds: float
    elements: int
    step_s: float
    deviation_n: float  # standard deviation of the tension
    error_n: float  # median magnitude
    doubt_n: float  # of the reference, median
    bound_n: float  # the band's, median
    ratio: float  # of the two medians
    held_pct: float  # of the time the error lay under the bound
    held_or_doubtful_pct: float  # ... or over it by less than the reference's doubt
    cost_pct: float  # time that the band took, of the time of all else


def measure_bands(cases: Sequence[tuple[str, float]], listen: Listener) -> Iterator[BandRow]:
    """A row per scene.

    Raises:
        SolverError: a run could not go on, or the band was lost on the way.
    """
    for number, (name, seconds) in enumerate(cases):
        listen(number, len(cases), name)
        yield measure_band(load_scene(name), seconds)
    listen(len(cases), len(cases), "")


def measure_band(scene: Scene, seconds: float) -> BandRow:
    """One scene."""
    elements, step_s = scene.ropes[0].elements, scene.time.step_s
    twin, seen, rough = BandedTwin(scene), [], False
    bed = bed_below(twin.rope)
    for shot in fed(twin, seconds):
        seen.append(shot)
        slack = shot.element_tension_n.min() <= 0.0
        rough = rough or slack or (bed is not None and nodes_on(bed, twin.rope) > 0)
    middle, fine = (
        np.array([s.tension_top_n for s in fed(Twin(_finer(scene, times)), seconds)])
        for times in (MIDDLE, FINE)
    )
    doubt = np.abs(fine - middle) / (1.0 if rough else 3.0)
    truth = fine if rough else fine + (fine - middle) / 3.0
    bands = [s.band for s in seen]
    if any(band is None for band in bands):
        raise SolverError(f"scene {scene.name}: the band's companion could not go on.")
    bound = np.array([band.bound_n for band in bands if band is not None])
    tension = np.array([s.tension_top_n for s in seen])
    first = int(np.searchsorted([s.time_s for s in seen], FROM_S))
    error, bound, doubt = np.abs(tension - truth)[first:], bound[first:], doubt[first:]
    last = bands[-1]
    assert last is not None
    return BandRow(
        scene=scene.name,
        seconds=seconds,
        elements=elements,
        step_s=step_s,
        deviation_n=float(tension.std()),
        error_n=float(np.median(error)),
        doubt_n=float(np.median(doubt)),
        bound_n=float(np.median(bound)),
        ratio=float(np.median(bound) / np.median(error)),
        held_pct=_share(error <= bound),
        held_or_doubtful_pct=_share(error <= bound + doubt),
        cost_pct=last.cost_pct,
    )


def fed(twin: Twin, seconds: float) -> Iterator[Snapshot]:
    """Step a twin with its scene's sea and winch; a snapshot after each publish period.

    Raises:
        SolverError: a step that is not finite.
    """
    sea, winch = open_sea(twin.scene), twin.scene.winch
    steps, offered_ns = steps_in_slot(twin.step_s), FIRST_NS
    while twin.time_ns < round(seconds * 1e9):
        until_ns = twin.time_ns + steps * twin.step_ns + LEAD_NS
        for heave in sea.between(offered_ns, until_ns) if sea else ():
            offer(twin, heave)
        for command in schedule_samples(winch, offered_ns, until_ns):
            twin.offer_order(command.stamp_ns, command.order)
        offered_ns = until_ns
        twin.advance(steps)
        yield twin.snapshot()


def band_table(rows: Sequence[BandRow]) -> list[tuple[str, ...]]:
    """The rows as words, below a head."""
    head = ("scene", "std kN", "error N", "doubt N", "bound N", "ratio", "held %", "or doubtful %",
            "cost %")  # fmt: skip
    return [head, *(_words(row) for row in rows)]


def _words(row: BandRow) -> tuple[str, ...]:
    return (
        row.scene,
        f"{row.deviation_n / 1e3:.2f}",
        f"{row.error_n:.3g}",
        f"{row.doubt_n:.2g}",
        f"{row.bound_n:.3g}",
        f"{row.ratio:.1f}",
        f"{row.held_pct:.1f}",
        f"{row.held_or_doubtful_pct:.1f}",
        f"{row.cost_pct:.0f}",
    )


def _finer(scene: Scene, times: int) -> Scene:
    return variant(scene, times * scene.ropes[0].elements, scene.time.step_s / times)


def _share(holds: Vector) -> float:
    return 100.0 * float(np.mean(holds))
