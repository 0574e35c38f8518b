"""Test of the discretisation-error interval against a converged reference.

Every scene runs with its own sea and winch. The reference is the same scene with four times the
elements and a quarter of the time step, or finer if a case requires it; a reference with half that
resolution gives its uncertainty. If the rope was never slack nor on the seabed, both are of second
order and extrapolated (Richardson 1911), and the uncertainty is the extrapolated part; if it was,
or the current has jumps between layers, or the winch has tension feedback, the uncertainty is the
full difference of the two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.trial import Vector
from rope_twin.core import state as rows
from rope_twin.core.joined.levels import interpolate_from
from rope_twin.core.joined.statics import refine_joined_statics
from rope_twin.errors import SolverError
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import is_joined
from rope_twin.studies.driven_twin import fed, variant
from rope_twin.twin.accuracy.error_fraction import has_layers
from rope_twin.twin.accuracy.error_interval import ErrorIntervalTwin
from rope_twin.twin.ensemble.boundary_conditions import is_known_in_advance
from rope_twin.twin.results import TensionInterval
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from validation.case import choose


@dataclass(frozen=True)
class BandCase:
    """Scene with a duration, and a reference of so many times its elements and steps."""

    scene: str
    seconds: float
    times: int = 4

    def __str__(self) -> str:
        return self.scene


FITTED = (  # the bound's numbers were found on these
    BandCase("deep_lift", 120.0), BandCase("shallow_lift", 120.0), BandCase("hmpe_lift", 120.0),
    BandCase("hybrid_lift", 120.0, 8), BandCase("storm", 120.0), BandCase("wave_zone", 60.0),
    BandCase("splash_zone", 80.0), BandCase("landing", 100.0, 8), BandCase("riser_300m", 60.0),
    BandCase("smooth_2km", 60.0), BandCase("smooth_5km", 60.0), BandCase("slack_5km", 60.0),
    BandCase("snap_vertical", 60.0), BandCase("snap_2km", 60.0),
)  # fmt: skip
LATER = (  # and not on these
    BandCase("chain_on_bottom", 60.0, 8), BandCase("hmpe_deep", 60.0),
    BandCase("tow_with_net", 60.0), BandCase("rov_tether", 60.0), BandCase("grab_lift", 60.0),
    BandCase("ahc_lift", 60.0), BandCase("deep_tow_turn", 60.0), BandCase("ship_6dof", 60.0),
)  # fmt: skip
MEETING = (  # ropes that meet, and payloads that are rigid bodies
    BandCase("bridle_lift", 60.0), BandCase("two_line_lift", 80.0),
    BandCase("two_line_landing", 130.0), BandCase("two_line_loop", 80.0),
    BandCase("two_line_14km", 60.0), BandCase("manifold_lift", 180.0),
)  # fmt: skip
ANSWERING = (  # winches whose line out follows from the tension: each has one of its own
    BandCase("emergency_stop", 80.0, 8), BandCase("abandonment_and_recovery", 140.0, 8),
)  # fmt: skip
VORTICES = (  # in the step
    BandCase("strouhal_lift", 60.0), BandCase("cable_waves", 60.0), BandCase("viv_calm", 120.0),
    BandCase("viv_in_heave", 120.0), BandCase("sonde_cast", 120.0), BandCase("curved_pipe", 60.0),
)  # fmt: skip
BESIDE = (  # vortices beside the step
    BandCase("vortices_modal", 60.0), BandCase("vortices_decomposed", 60.0),
)  # fmt: skip
BLOWS = (BandCase("lift_off", 80.0),)  # of a load on a deck
FULL = (*FITTED, *LATER, *MEETING, *ANSWERING, *VORTICES, *BESIDE, *BLOWS)
QUICK = (
    BandCase("shallow_lift", 25.0), BandCase("storm", 30.0), BandCase("bridle_lift", 20.0),
    BandCase("emergency_stop", 60.0), BandCase("cable_waves", 10.0), BandCase("sonde_cast", 30.0),
)  # fmt: skip
FROM_S = 2.0  # before, the ship's motion has hardly begun and neither has an error
HELD_PCT, RATIO = 95.0, 5.0  # what a band must hold at least, and be wider than the error at most
RUNS, COST_S = 3, 30.0  # of each scene for the cost, so long at most: the middle one counts
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
    cost_pct: float  # time that the band took, of the time of all else; the middle of some runs
    times: int  # elements of the reference over the scene's

    @property
    def ok(self) -> bool:
        """Return whether the interval covers the error and is narrow."""
        return self.held_pct >= HELD_PCT and self.ratio <= RATIO


def choose_cases(names: Sequence[str]) -> tuple[BandCase, ...]:
    """Return the cases of these scenes in the order of FULL; all if there are none.

    Raises:
        InputError: a scene without a case.
    """
    if not names:
        return FULL
    return choose("python -m benchmarks band", FULL, names, lambda case: case.scene)


def measure_bands(cases: Sequence[BandCase], listen: Listener) -> Iterator[BandRow]:
    """Return a row per scene.

    Raises:
        SolverError: a run failed, or the interval was lost during it.
    """
    for number, case in enumerate(cases):
        listen(number, len(cases), case.scene)
        yield measure_band(case)
    listen(len(cases), len(cases), "")


def measure_band(case: BandCase) -> BandRow:
    """Measure one scene."""
    scene = load_scene(case.scene)
    twin = ErrorIntervalTwin(scene)
    seen = list(fed(twin, case.seconds))
    smooth = is_known_in_advance(scene.winch, None) and not has_layers(twin.rope)
    rough = not smooth or any(map(_is_rough, seen))
    middle, fine = (
        np.array([s.tension_top_n for s in fed(_reference(scene, times), case.seconds)])
        for times in (case.times // 2, case.times)
    )
    doubt = np.abs(fine - middle) / (1.0 if rough else 3.0)
    truth = fine if rough else fine + (fine - middle) / 3.0
    bound = np.array([_band_of(shot).bound_n for shot in seen])
    tension = np.array([s.tension_top_n for s in seen])
    first = int(np.searchsorted([s.time_s for s in seen], FROM_S))
    error, bound, doubt = np.abs(tension - truth)[first:], bound[first:], doubt[first:]
    costs = [_band_of(seen[-1]).cost_pct, *(_cost_pct(scene, case) for _ in range(1, RUNS))]
    return BandRow(
        scene=scene.name,
        seconds=case.seconds,
        elements=scene.ropes[0].elements,
        step_s=scene.time.step_s,
        deviation_n=float(tension.std()),
        error_n=float(np.median(error)),
        doubt_n=float(np.median(doubt)),
        bound_n=float(np.median(bound)),
        ratio=float(np.median(bound) / np.median(error)),
        held_pct=_share(error <= bound),
        held_or_doubtful_pct=_share(error <= bound + doubt),
        cost_pct=float(np.median(costs)),
        times=case.times,
    )


def _is_rough(shot: Snapshot) -> bool:
    """Return whether there was slack or contact with seabed or deck: first-order error."""
    pulls = [one.element_tension_n for one in shot.ropes] or [shot.element_tension_n]
    bed, body, stands = shot.seabed, shot.body, False
    if bed is not None:
        stands = bed.payload_height_m <= 0.0 or bed.rope_on_bed_m > 0.0
    if body is not None:
        pulls.append(body.leg_pull_n)
        stands = stands or (body.deck_clearance_m is not None and body.deck_clearance_m <= 0.0)
    return stands or any(float(some.min()) <= 0.0 for some in pulls)


def _band_of(shot: Snapshot) -> TensionInterval:
    if shot.band is None:
        raise SolverError(f"{shot.time_s:g} s: the band's companion could not go on.")
    return shot.band


def _cost_pct(scene: Scene, case: BandCase) -> float:
    """Return the cost of the interval in another run of the scene [%]."""
    *_, last = fed(ErrorIntervalTwin(scene), min(case.seconds, COST_S))
    return _band_of(last).cost_pct


def _reference(scene: Scene, times: int) -> Twin:
    """Return the scene with more elements and a shorter step, from the same static equilibrium.

    In a multi-line system a payload may rotate freely, as a strut on a single rope does: its
    attitude at rest is arbitrary and differs between grids. The finer grid therefore begins with
    the shape of the coarser one.
    """
    finer = Twin(variant(scene, times * scene.ropes[0].elements, scene.time.step_s / times))
    if is_joined(scene) and not scene.sheaves:
        begin_alike(finer, Twin(scene))
    return finer


def begin_alike(finer: Twin, own: Twin) -> None:
    """Solve the equilibrium of a multi-line system near that on fewer elements."""
    assert finer.joined is not None
    assert own.joined is not None
    system = finer.joined.system(finer.rope)
    place = np.zeros((len(system.ropes), rows.MOTIONS))
    for row, rope in zip(place, system.ropes, strict=True):
        top = int(rope.state.counts[rows.ELEMENTS])
        row[: rows.LINE] = rope.state.nodes[rows.POSITION : rows.POSITION + 3, top]
        row[rows.LINE] = rope.state.s[top]
    interpolate_from(system, own.joined.system(own.rope))
    refine_joined_statics(system, place)


def _share(holds: Vector) -> float:
    return 100.0 * float(np.mean(holds))
