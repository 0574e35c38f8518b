"""A loop of two lines run calm and in a sea state: tensions, noise, distance and crossings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.scene.rigging import winches_by_name
from rope_twin.sea.ship_motion import BoxHull
from rope_twin.sea.spectrum import jonswap
from rope_twin.studies.picture import check_picture, new_figure, write_picture
from rope_twin.twin.motion.ship_motion import SeaRecord, synthesise
from rope_twin.twin.multi_line_snapshot import ClearanceMonitor
from rope_twin.twin.snapshot import LineEvent, Nearest, Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import schedule_samples

# Hs [m] and Tp [s] of sea states (STANAG 4194)
SEA_STATES = {3: (0.9, 7.5), 4: (1.9, 8.8), 5: (3.3, 9.7), 6: (5.0, 12.4)}
SAMPLES_PER_S = 5
NOISE_S = 8.0  # at the end of the calm run, looked at step by step
SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Noise:
    """Smoothness of a line's tension at the ship from step to step."""

    jump_pct: float  # largest |F(k+1) - 2·F(k) + F(k-1)| over the mean
    events: int  # splits and merges of elements meanwhile


@dataclass(frozen=True)
class LineRun:
    """Results of one run."""

    sea: str
    time_s: Floats
    tension_n: Floats  # of main and haulback at the ship, (2, samples)
    nearest: list[Nearest]
    events: list[LineEvent]
    crossing_m: list[list[float]]  # depths of the crossings at each sample
    turned_up: int
    noise: tuple[Noise, Noise] | None  # of the calm run
    lines_m: tuple[Floats, Floats]  # x along the plane and depth of both at the end, (nodes, 2)
    real_time_factor: float

    def figures(self) -> dict[str, Any]:
        """Return the results for a JSON file."""
        nearest = min(self.nearest, key=lambda approach: approach.distance_m)
        return {
            "sea": self.sea,
            "tension_n": {
                name: {"mean": float(row.mean()), "min": float(row.min()), "max": float(row.max())}
                for name, row in zip(("main", "haulback"), self.tension_n, strict=True)
            },
            "noise": None if self.noise is None else [asdict(noise) for noise in self.noise],
            "nearest": asdict(nearest),
            "crossings": [asdict(event) for event in self.events],
            "crossing_depths_at_the_end_m": self.crossing_m[-1],
            "samples_with_a_line_turned_up": self.turned_up,
            "real_time_factor": self.real_time_factor,
        }


def record_of(sea_state: int, seed: int) -> SeaRecord:
    """Return the heave of a medium-sized vessel in a sea state, a record of 600 s that repeats."""
    height, period = SEA_STATES[sea_state]
    return synthesise(jonswap(height, period), BoxHull(), seed, duration_s=600.0)


class _Sample(NamedTuple):
    """Values of one instant; see LineRun."""

    time_s: float
    tension_n: list[float]
    nearest: Nearest
    crossing_m: list[float]


def run_lines(
    twin: Twin, seconds: int, sea: SeaRecord | None, tell: Callable[[LineEvent], None]
) -> LineRun:
    """Run a twin of a loop by its winches' schedules; calm without a sea."""
    watch = ClearanceMonitor(twin.scene)
    tops = [line[0] for line in watch.lines]
    samples, events = list[_Sample](), list[LineEvent]()
    for second in range(seconds):
        _submit(twin, second, sea)
        for _ in range(SAMPLES_PER_S):
            twin.advance(round(1.0 / (SAMPLES_PER_S * twin.step_s)))
            snapshot = twin.snapshot()
            clearance, new_events = watch.observe(snapshot)
            tensions = [snapshot.ropes[number].tension_top_n for number in tops]
            crossings = [crossing.depth_m for crossing in watch.crossings]
            samples.append(_Sample(snapshot.time_s, tensions, clearance, crossings))
            events += new_events
            for event in new_events:
                tell(event)
    factor = twin.statistics().real_time_factor
    times, tensions_n, nearest, crossing_m = zip(*samples, strict=True)
    return LineRun(
        sea="calm" if sea is None else sea.source,
        time_s=np.array(times),
        tension_n=np.array(tensions_n).T,
        nearest=list(nearest),
        events=events,
        crossing_m=list(crossing_m),
        turned_up=watch.turned_up,
        noise=_listen(twin, seconds, tops) if sea is None else None,
        lines_m=_flat(snapshot, watch),
        real_time_factor=factor,
    )


def _flat(snapshot: Snapshot, watch: ClearanceMonitor) -> tuple[Floats, Floats]:
    """Return both lines in their vertical plane, (nodes, 2)."""
    positions = (
        np.concatenate([snapshot.ropes[number].node_position_m for number in line])
        for line in watch.lines
    )
    first, second = (np.stack([x[:, :2] @ watch.plane, -x[:, 2]], axis=1) for x in positions)
    return first, second


def _submit(twin: Twin, second: int, sea: SeaRecord | None) -> None:
    """Pass on commands and heave of (second, second + 1]."""
    for name, winch in winches_by_name(twin.scene).items():
        for row in schedule_samples(winch, second * SECOND_NS, (second + 1) * SECOND_NS):
            twin.submit_command(row.stamp_ns, row.command, name)
    if sea is None:
        return
    rate = round(sea.rate_hz)
    for part in range(1, rate + 1):
        k = (second * rate + part) % len(sea.heave_m)
        stamp = second * SECOND_NS + part * SECOND_NS // rate
        twin.submit_heave(stamp, float(sea.heave_m[k]), float(sea.heave_velocity_m_per_s[k]))


def _listen(twin: Twin, second: int, tops: list[int]) -> tuple[Noise, Noise]:
    """Continue step by step, calm, and measure the smoothness of the tensions."""
    pulls, before = [], twin.snapshot().solver
    for more in range(round(NOISE_S)):
        _submit(twin, second + more, None)
        for _ in range(round(1.0 / twin.step_s)):
            twin.advance(1)
            snapshot = twin.snapshot()
            pulls.append([snapshot.ropes[number].tension_top_n for number in tops])
    events = snapshot.solver.splits + snapshot.solver.merges - before.splits - before.merges
    rows = np.array(pulls).T
    jumps = [100.0 * float(np.abs(np.diff(row, 2)).max() / row.mean()) for row in rows]
    return Noise(jumps[0], events), Noise(jumps[1], events)


COLOURS = {"main": "tab:blue", "haulback": "tab:red"}


def draw_lines(name: str, calm: LineRun, rough: LineRun, label: str, path: Path) -> None:
    """Write the picture; label: of the rough run.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    check_picture(path)
    figure = new_figure(12.0, 4.6)
    left, middle, right = figure.subplots(1, 3, width_ratios=(2.0, 1.0, 1.2))
    for k, (line, colour) in enumerate(COLOURS.items()):
        for run, style, legend in ((rough, "-", label), (calm, "--", "calm")):
            left.plot(
                run.time_s, 1e-3 * run.tension_n[k], style, color=colour, linewidth=1.0,
                label=f"{line}, {legend}",
            )  # fmt: skip
    _name(left, "tension at the ship", "time [s]", "[kN]")
    left.legend(fontsize=7)
    for line_m, (line, colour) in zip(calm.lines_m, COLOURS.items(), strict=True):
        middle.plot(line_m[:, 0], line_m[:, 1], color=colour, linewidth=1.0, label=line)
    low, high = middle.get_xlim()
    for depth in calm.crossing_m[-1]:
        middle.axhline(depth, color="black", linewidth=0.6, linestyle=":")
        middle.text(low + 0.02 * (high - low), depth, f"{depth:.0f} m", fontsize=7, va="bottom")
    middle.invert_yaxis()
    _name(middle, "both lines at the end, calm", "along the hang-offs' plane [m]", "depth [m]")
    for run, style, legend in ((rough, "-", label), (calm, "--", "calm")):
        times = [t for t, depths in zip(run.time_s, run.crossing_m, strict=True) for _ in depths]
        depths = [depth for crossings in run.crossing_m for depth in crossings]
        right.plot(times, depths, "." if style == "-" else "k.", markersize=2, label=legend)
    right.invert_yaxis()
    _name(right, "where the lines cross", "time [s]", "depth [m]")
    right.legend(fontsize=7)
    figure.suptitle(name, fontsize=10)
    write_picture(figure, path, 90)


def _name(axes: Any, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
    axes.grid(True, linewidth=0.3)
