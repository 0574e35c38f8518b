"""Remarks on a plan's results: what limits their validity, in numbers, and what is not covered."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rope_twin.effects.current import CurrentParams
from rope_twin.effects.waves import WavesParams
from rope_twin.planning.seas import ResponsesTip, SeaState
from rope_twin.sea.components import DEEP, irregular_waves, spread
from rope_twin.sea.spectrum import STANDARD_GRAVITY, usual_height_m

if TYPE_CHECKING:
    from rope_twin.planning.run import PlanResult

NOT_COVERED = (
    "Motion of the crane's boom and slewing, off-lead and side-lead; the tip moves with the hull.",
    "Second-order motions, manoeuvring and positioning of the vessel; forward speed.",
    "Vortex-induced vibration of the wire, its fatigue and wear.",
    "Trapped air, flooding and the swinging of the object in air.",
    "Shielding of waves by the vessel, and its radiated and reflected waves.",
    "Weather forecasts: limits are operational limits, before any alpha factor.",
)
COMPONENTS, LOST_SHARE = 200, 0.01  # of a spectrum; of the motion's variance, beyond the RAOs
DEEP_WATER_LENGTHS = 0.5  # of the wave: below, its kinematics are 4 % of those at the surface


def notes(result: PlanResult) -> Iterator[str]:
    """Yield remarks on the results, the most important first."""
    yield from _static(result)
    yield from _failures(result)
    yield from _intervals(result)
    yield from _errors(result)
    yield from _shallow(result)
    yield from _seas(result)
    yield from _beyond_table(result)
    winch = result.scene.winch
    if winch is not None and winch.heave_compensation is not None:
        yield "The simplified method has no heave compensation: it shows what the runs gain by it."
    if any(work.legs[0].deck is not None for work in result.works):
        yield (
            "The deck of the lift-off moves up and down as its vessel does below the object, by "
            "heave, roll and pitch; it stays level and in its place. The table of the lift-off has "
            "what the crane tip does against it sideways."
        )
    if result.scene.listed(CurrentParams) is None:
        yield "The scene has no current: the payload hangs plumb."


def _cells(count: int) -> str:
    """Return a number of cells in words."""
    return "1 cell" if count == 1 else f"{count} cells"


def _static(result: PlanResult) -> Iterator[str]:
    for work in result.works:
        if work.static_use > 1.0:
            most = work.static_hook_n / work.static_use
            yield (
                f"{work.title}: the static hook load of {1e-3 * work.static_hook_n:.3g} kN alone "
                f"is above its limit of {1e-3 * most:.3g} kN, so that no sea meets it; check swl_n "
                "[N] and safety_factor."
            )


def _failures(result: PlanResult) -> Iterator[str]:
    for cell in result.cells:
        judged = (cell.judged, cell.beyond)
        failed = sum(one.failures for one in judged if one is not None)
        faults = [one.fault for one in judged if one is not None and one.fault]
        where = f"{cell.phase}, {cell.sea}"
        if failed:
            yield f"{where}: {failed} runs did not reach their end; such a sea counts as too high."
        if faults:
            yield f"{where}: {faults[0]}"


def _intervals(result: PlanResult) -> Iterator[str]:
    method = result.plan.method
    wide = [
        (max(one.half_width for one in cell.judged.uses.values()), cell)
        for cell in result.cells
        if cell.judged is not None and cell.judged.uses and not cell.judged.narrow(method.within)
    ]
    if wide:
        worst, cell = max(wide, key=lambda pair: pair[0])
        yield (
            f"In {_cells(len(wide))} {method.seeds.most} seeds leave an interval wider than "
            f"±{100.0 * method.within:g} % (up to ±{100.0 * worst:.0f} %, {cell.phase}, Tp "
            f"{cell.period_s:g} s); raise method.seeds.most."
        )


def _errors(result: PlanResult) -> Iterator[str]:
    most = result.plan.method.error_within
    known = [cell for cell in result.cells if not math.isnan(cell.error)]
    large = [cell for cell in known if cell.error > most]
    unknown = sum(cell.judged is not None for cell in result.cells) - len(known)
    if large:
        worst = max(large, key=lambda cell: cell.error)
        yield (
            f"In {_cells(len(large))} the discretisation error of the governing run is above "
            f"{100.0 * most:g} % (up to {100.0 * worst.error:.2g} %, {worst.phase}, Tp "
            f"{worst.period_s:g} s): after slack, runs of two meshes drift apart."
        )
    if unknown:
        yield f"In {_cells(unknown)} the discretisation error could not be measured."


def _shallow(result: PlanResult) -> Iterator[str]:
    if result.scene.listed(WavesParams) is not None:
        return
    longest = STANDARD_GRAVITY * max(result.plan.sea.tp_s) ** 2 / (2.0 * math.pi)
    for work in result.works:
        depth = min(leg.from_m for leg in work.legs)
        if 0.0 < depth < DEEP_WATER_LENGTHS * longest:  # above the water there are none
            yield (
                f"{work.title}: the payload is at {depth:.0f} m, less than half of the longest "
                f"waves' {longest:.0f} m, and the scene has no waves: their force on payload and "
                "rope is missing."
            )


def _beyond_table(result: PlanResult) -> Iterator[str]:
    """Yield a remark on motion that the RAOs do not reach."""
    tip, sea = result.works[0].ship.tip, result.plan.sea
    if not isinstance(tip, ResponsesTip):
        return
    lost: dict[float, float] = {}
    for period in sea.tp_s:
        spectrum = SeaState(sea.hs_m.from_, period, 0.0, sea.gamma).spectrum()
        waves = irregular_waves(spectrum, COMPONENTS, 1, DEEP, STANDARD_GRAVITY)
        for heading in sea.headings_deg:
            own = spread(waves, math.radians(heading), None, 1)
            lost[period] = max(
                lost.get(period, 0.0), tip.responses.share_left_out(own, 0.0, tip.arm_m)
            )
    much = [period for period, share in lost.items() if share > LOST_SHARE]
    if much:
        yield (
            f"At Tp {', '.join(f'{one:g}' for one in much)} s up to "
            f"{100.0 * max(lost.values()):.2g} % of the variance of the tip's motion lies above "
            "the highest frequency of the RAOs and is left out."
        )


def _seas(result: PlanResult) -> Iterator[str]:
    steep = [
        cell for cell in result.cells
        if cell.height_m is not None and cell.height_m > 1.005 * usual_height_m(cell.period_s)
    ]  # fmt: skip
    if steep:
        periods = sorted({cell.period_s for cell in steep})
        words = ", ".join(f"{period:g}" for period in periods)
        yield (
            f"At Tp {words} s limits lie above the steepest usual seas of DNV-RP-C205: such seas "
            "are rare, and their limits seldom decide."
        )
