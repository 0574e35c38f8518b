"""Golden wording: all diagnostics rows and the run summary of a few situations.

Other tests assert levels, key values and key words only. After a deliberate change of the wording,
rewrite the file with `python test/cli/test_wording.py` and review its difference.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

from sample_snapshot import hanging_rope

from rope_twin.messages import Status, statuses
from rope_twin.ros.paced_twin import clock_row, publishing_row, saving_row
from rope_twin.run.seat import PRIORITY, CommandSeat
from rope_twin.run.summary import CpuUsage, RunSummary
from rope_twin.scene.error_bound import KnownError
from rope_twin.twin.pacing import PacingHealth
from rope_twin.twin.snapshot import (
    BedContact,
    Bend,
    CutSnapshot,
    EnergyBalance,
    InputHealth,
    LimitBreach,
    RopeBend,
    RopeStrength,
    Snapshot,
    SolverHealth,
    Touchdown,
)
from rope_twin.twin.state_file import SavingStatus
from rope_twin.twin.winch.commands import WinchCommand

GOLDEN = Path(__file__).with_name("golden") / "wording.txt"
PACED = PacingHealth(running=True, steps=100, real_time_factor=420.0)
LATE = PACED._replace(late_steps=2, worst_lateness_s=0.004)
ENERGY = EnergyBalance(
    since_s=1.0, kinetic_j=2e4, elastic_j=3e5, potential_j=-4e6, change_j=-9e4, hang_off_j=-8e4,
    passing_j=1e3, water_j=-9e3, damped_j=1.5e3, residual_j=500.0, exchanged_j=1e6,
)  # fmt: skip
TDP = Touchdown("cable", (120.0, -3.0, -299.0), 362.2, 162.2, 12340.0, 0.5)
BEND = Bend("cable", 2.5, 361.0, 17.3, 3.0, 1.5)
BREACH = LimitBreach("tension_n", "hoist", 2e5, 1.0, 4.0, 2.104e5, 3.0)
SUMMARY = RunSummary(
    scene="deep_lift", effects=("drag", "payload"), elements=100, step_s=0.01, steps=6000,
    time_s=60.0, late_steps=0, worst_lateness_s=0.0, real_time_factor=700.0,
    paced_real_time_factor=60.0, tension_top_now_n=3.2e5, tension_top_max_n=3.5e5,
    tension_top_mean_n=3.2e5, tension_top_min_n=2.9e5, tension_top_error_pct=0.5,
    tension_top_peak_error_pct=0.1, tension_top_error_reason="at most, in a run on paper",
    line_out_m=3000.0, payload_depth_m=3005.0, heave_accepted=1200, heave_refused=0, heave_late=0,
    heave_refusal="", commands_accepted=0, commands_refused=0,
)  # fmt: skip


def with_input(name: str, health: InputHealth) -> Snapshot:
    return replace(hanging_rope(), inputs={name: health})


def snapshots() -> dict[str, tuple[Snapshot, PacingHealth | None]]:
    rope = hanging_rope()
    hoist = RopeStrength("hoist", 4.2e5, 1e6, 3.5e5, 1.2)
    bend = RopeBend(replace(BEND, radius_m=40.0), (119.0, -3.0, -298.9), BEND)
    coarse = replace(bend, tightest=replace(BEND, radius_m=3.2, element_m=4.0))
    straight = replace(bend, tightest=replace(BEND, radius_m=math.inf, minimum_m=0.0))
    failed = SolverHealth(
        steps=10, recoveries=1, recovered_ago_s=1.0, recovery="step 4: not finite; state restored"
    )
    return {
        "normal operation": (replace(rope, energy=ENERGY, strength=(hoist,)), PACED),
        "winch stopped, payload above the seabed": (
            replace(rope, payout_speed_m_per_s=0.0, seabed=BedContact(3.21, 0.0, 0.0, 0.0)),
            PACED._replace(running=False),
        ),
        "build-up, hauling in, error unknown": (
            replace(rope, motion_ramp=0.25, payout_speed_m_per_s=-0.5, strength=(),
                    study_error=KnownError(words="unknown: no study")),
            LATE._replace(late_ago_s=61.0),
        ),
        "overload": (
            replace(rope, breaches=(BREACH,), strength=(RopeStrength("hoist", 1.04e6, 1e6),),
                    winch_at_limit="2,000 m of line are out"),
            LATE._replace(late_ago_s=3.0),
        ),
        "solver not converged, behind real time": (
            replace(rope, not_converged=True, energy=replace(ENERGY, residual_j=-2e3)),
            LATE._replace(behind_s=1.5),
        ),
        "solver recovered": (replace(rope, solver=failed), PACED._replace(error="disk full")),
        "solver recovered a while ago": (
            replace(rope, solver=failed._replace(recovered_ago_s=100.0)), None,
        ),
        "unconverged substeps": (
            replace(rope, solver=SolverHealth(steps=10, unconverged_substeps=1)), None,
        ),
        "shape of the rope": (replace(rope, touchdowns=(TDP,), bends=(bend,)), None),
        "shape not resolved": (replace(rope, bends=(coarse,)), None),
        "straight rope": (replace(rope, bends=(straight,)), None),
        "rope cut": (replace(rope, cut=CutSnapshot(12.0, 45.0, 55.0), error_interval=None,
                             no_error_interval="unknown: the rope was cut"), None),
        "one of several ropes cut": (replace(rope, cut=CutSnapshot(12.0, 45.0, 55.0, "aft")), None),
        "no input yet": (with_input("heave", InputHealth()), None),
        "input stale": (with_input("heave", InputHealth(accepted=7, age_s=4.2, stale=True)), None),
        "input rejected": (
            with_input("heave", InputHealth(accepted=7, late=1, recently_refused=1,
                                            refusal="it came late.", note="samples are back")),
            None,
        ),
        "input rejected a while ago": (
            with_input("heave", InputHealth(accepted=7, late=1, note="it came late.")), None,
        ),
        "input faulty": (
            with_input("heave", InputHealth(accepted=7, stuck=2, fault="the sender is stuck")),
            None,
        ),
    }  # fmt: skip


def seats() -> dict[str, Status]:
    free, held, lost = (CommandSeat("winch", PRIORITY, "ramp_to_zero") for _ in range(3))
    for seat in (held, lost):
        seat.judge("bench", WinchCommand("speed", 0.2), 0.0)
    held.judge("other", WinchCommand("speed", 0.1), 1.0)
    lost.check(set(), 0, 1.0)
    lost.check(set(), 2_000_000_000, 3.0)
    return {"seat free": free.row(0.0), "seat held": held.row(2.0), "seat lost": lost.row(4.0)}


def run_rows() -> Iterator[Status]:
    yield from (publishing_row("", 0), publishing_row("", 3), publishing_row("disk full", 0))
    yield from (clock_row(0.0), clock_row(-3.0))
    state = SavingStatus(Path("run.state"))
    yield from (saving_row(state), saving_row(replace(state, saved_s=12.0)))


def summaries() -> dict[str, RunSummary]:
    share = asdict(CpuUsage(1.6, 2.0, 9.0, 10.0))
    return {
        "summary": SUMMARY,
        "summary of an overloaded run": replace(
            SUMMARY, late_steps=3, worst_lateness_s=0.012, core_share=share, level_changes=2,
            heave_refused=4, heave_refusal="heave: position 90 m.", recoveries=1,
            recovery="step 4: not finite", bag="run", not_recorded=250,
            tension_top_error_pct=None, tension_top_error_reason="unknown: no study",
            limits_broken=[vars(BREACH)], touchdowns=[vars(TDP)], bends=[vars(BEND)],
        ),
        "summary of a run with all monitors": replace(
            SUMMARY, energy=ENERGY.figures(),
            error_interval={"low_n": 3.1e5, "high_n": 3.3e5, "bound_n": 1e4, "cost_pct": 50.0},
            vibration={"model": "time-domain", "cross_flow_diameters": 0.4, "frequency_hz": 1.2,
                       "from_hang_off_m": 300.0, "drag_amplification": 1.8, "cost_pct": 2.0},
            fatigue={"curve": "stranded_wire", "used": 1e-5, "from_lower_end_m": 3000.0,
                     "counted_s": 60.0},
        ),
    }  # fmt: skip


def line(row: Status) -> str:
    return f"{row.level.name:5} {row.name}: {row.message}"


def wording() -> str:
    parts = []
    seen: set[str] = set()
    for title, (snapshot, pacing) in snapshots().items():
        rows = [one for one in map(line, statuses(snapshot, pacing)) if one not in seen]
        seen.update(rows)
        parts.append(f"# {title}\n" + "\n".join(rows))
    parts += [f"# {title}\n{line(row)}" for title, row in seats().items()]
    parts.append("# rows of a real-time run\n" + "\n".join(map(line, run_rows())))
    for title, summary in summaries().items():
        parts.append(f"# {title}\n{summary.as_text()}\n{summary.as_progress()}")
    return "\n\n".join(parts) + "\n"


def test_the_wording_is_the_golden_one() -> None:
    assert wording() == GOLDEN.read_text(encoding="utf-8")


if __name__ == "__main__":
    GOLDEN.write_text(wording(), encoding="utf-8")
