"""Convergence of the VIV models of Q1 and L2 with element length and time step.

One of the two is refined while the other is fixed; the last run of a sweep is its reference. A
sweep is converged from the coarsest setting on for which this one and all finer ones are within the
limits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from math import pi, sqrt
from typing import Any

import numpy as np

from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.studies.picture import Line, Panel, Vector
from rope_twin.vortex.shedding import Shedding
from validation import curved_pipe, modal_lines, wave_lines
from validation.case import Listener, announced
from validation.published_ropes import LCD_CABLE, lcd_current

AMPLITUDE_PCT, FREQUENCY_PCT = 2.0, 0.5  # within which a setting counts as converged
FLOOR_PCT = 1e-3  # in the picture
Response = tuple[float, float]  # largest rms [D] and dominant frequency [Hz]


@dataclass(frozen=True)
class Sweep:
    """One case by one model, refined in one of the two."""

    id: str  # of the case
    model: str
    elements: tuple[int, ...]  # one alone: the step is refined
    steps_s: tuple[float, ...]  # likewise
    respond: Callable[[int, float], Response]
    length_m: float
    wave_speed_m_per_s: float  # where the wave is shortest


@dataclass(frozen=True)
class Point:
    """One setting and the response it gives."""

    elements: int
    step_s: float
    element_m: float
    per_wave: float  # elements per wave of the dominant frequency
    per_period: float  # steps per period of it
    rms_diameters: float
    frequency_hz: float
    rms_off_pct: float  # of the finest
    frequency_off_pct: float

    @property
    def close(self) -> bool:
        """Return whether a run is within the limits of the finest one."""
        return (
            abs(self.rms_off_pct) <= AMPLITUDE_PCT and abs(self.frequency_off_pct) <= FREQUENCY_PCT
        )


@dataclass(frozen=True)
class Convergence:
    """A sweep's points, coarse to fine."""

    case: str
    model: str
    refined: str  # "element" or "step"
    points: tuple[Point, ...]

    @property
    def converged(self) -> Point | None:
        """Return the coarsest setting from which all are close; None: only the finest is."""
        coarsest = None
        for point in reversed(self.points[:-1]):
            if not point.close:
                break
            coarsest = point
        return coarsest

    @property
    def words(self) -> str:
        """Return in a sentence where the sweep is converged."""
        limits = f"{AMPLITUDE_PCT:g} % in amplitude and {FREQUENCY_PCT:g} % in frequency"
        finest = self.points[-1]
        if self.refined == "element":
            setting = f"{1e3 * finest.step_s:g} ms"
        else:
            setting = f"elements of {finest.element_m:.3g} m"
        name = f"{self.case} by {self.model}, at {setting}:"
        point = self.converged
        if point is None:
            return f"{name} not within {limits} of the finest anywhere."
        if self.refined == "element":
            size = f"elements of {point.element_m:.3g} m ({point.per_wave:.0f} per wave)"
        else:
            size = f"steps of {1e3 * point.step_s:.3g} ms ({point.per_period:.0f} per period)"
        return f"{name} within {limits} of the finest from {size} on."


def towed_pipe(elements: int, step_s: float) -> Response:
    """Return for Q1 the maximum RMS, and the frequency of the lowest third, the power-in region."""
    watched = curved_pipe.watch(elements, step_s, curved_pipe.SETTLE_S, curved_pipe.WATCH_S)
    low = watched.s < 0.3 * watched.s[-1]
    return float(watched.rms.max()), peak_hz(watched.y[:, low], curved_pipe.SAMPLE_S)


def cable_by_waves(elements: int, step_s: float) -> Response:
    """Return the response of L2 by travelling waves, 24 s."""
    cable = wave_lines.rig(LCD_CABLE, wave_lines.CABLE_EA, elements, step_s)
    run = wave_lines.wave_run(cable, TravellingWavesParams(), 24.0)
    return float(run.rms.max()), peak_hz(run.motion, step_s)


def cable_by_modes(elements: int, step_s: float) -> Response:
    """Return the response of L2 by modes, 40 s."""
    run = modal_lines.record(LCD_CABLE, lcd_current(elements + 1), Shedding(), 40.0, step_s)
    return float(run.rms.max()), run.dominant_hz


def peak_hz(motion: Vector, step_s: float) -> float:
    """Return the frequency of most power in all columns, by a parabola through the log peak."""
    moved = (motion - motion.mean(axis=0)) * np.hanning(len(motion))[:, None]
    power = (np.abs(np.fft.rfft(moved, axis=0)) ** 2).sum(axis=1)
    k = int(power[1:-1].argmax()) + 1
    left, top, right = np.log(power[k - 1 : k + 2])
    shift = 0.5 * (left - right) / (left - 2.0 * top + right)
    return float((k + shift) / (len(motion) * step_s))


def _wave_speed(tension_n: float, moved_kg_per_m: float, EI: float, hz: float) -> float:
    """Return the wave speed at a frequency [m/s] on a beam in tension; EI·k⁴ + T·k² = m·ω²."""
    inertia = moved_kg_per_m * (2.0 * pi * hz) ** 2
    number = sqrt(2.0 * inertia / (tension_n + sqrt(tension_n**2 + 4.0 * EI * inertia)))
    return 2.0 * pi * hz / number


_PIPE = (152.4, _wave_speed(3225.0, 1.2682 + 1035.0 * 0.25 * pi * 0.0363**2, 613.0, 4.65))
_LOW_N = float(LCD_CABLE.span(lcd_current(151)).tension[0])
_CABLE = (LCD_CABLE.length, _wave_speed(_LOW_N, LCD_CABLE.moved, 0.0, 12.75))
SWEEPS = (
    Sweep("Q1", "wake oscillator", (50, 100, 200, 400, 800), (2e-3,), towed_pipe, *_PIPE),
    Sweep("Q1", "wake oscillator", (200,), (1e-2, 5e-3, 2e-3, 1e-3, 5e-4), towed_pipe, *_PIPE),
    Sweep("L2", "travelling waves", (150, 300, 600, 1200), (2e-3,), cable_by_waves, *_CABLE),
    Sweep("L2", "travelling waves", (300,), (8e-3, 4e-3, 2e-3, 1e-3, 5e-4), cable_by_waves,
          *_CABLE),
    Sweep("L2", "modes", (450, 900, 1800), (0.0125,), cable_by_modes, *_CABLE),
    Sweep("L2", "modes", (450,), (0.0125, 0.00625, 0.003125, 0.0015625), cable_by_modes, *_CABLE),
)  # fmt: skip


def measure(sweeps: Sequence[Sweep], listen: Listener) -> Iterator[Convergence]:
    """Run the sweeps, yielding each at its end; a setting that two sweeps share is run once.

    Raises:
        SolverError: a step is not finite.
    """
    known: dict[tuple[str, str, int, float], Response] = {}
    for sweep in announced(sweeps, listen, lambda one: f"{one.id} by {one.model}"):
        settings = [(n, h) for n in sweep.elements for h in sweep.steps_s]
        found = []
        for n, h in settings:
            key = sweep.id, sweep.model, n, h
            known[key] = known.get(key) or sweep.respond(n, h)
            found.append(known[key])
        refined = "step" if len(sweep.elements) == 1 else "element"
        points = [_point(sweep, *one, found[-1]) for one in zip(settings, found, strict=True)]
        yield Convergence(sweep.id, sweep.model, refined, tuple(points))


def _point(sweep: Sweep, setting: tuple[int, float], response: Response, finest: Response) -> Point:
    elements, step_s = setting
    element, hz = sweep.length_m / elements, response[1]
    return Point(
        elements, step_s, element, sweep.wave_speed_m_per_s / hz / element, 1.0 / (hz * step_s),
        response[0], hz, 100.0 * (response[0] / finest[0] - 1.0), 100.0 * (hz / finest[1] - 1.0),
    )  # fmt: skip


def as_json(rows: Sequence[Convergence]) -> list[dict[str, Any]]:
    """Return the results as plain data, with the setting from which each is converged."""
    return [asdict(row) | {"words": row.words} for row in rows]


def panels(rows: Sequence[Convergence]) -> tuple[Panel, ...]:
    """Return panels of the deviation from the finest run, over the refined quantity."""
    drawn = []
    for row in rows:
        some = row.points[:-1]
        by_step = row.refined == "step"
        sizes = [1e3 * point.step_s if by_step else point.element_m for point in some]
        lines = tuple(
            Line(sizes, [max(abs(getattr(point, name)), FLOOR_PCT) for point in some], label, style)
            for name, label, style in (
                ("rms_off_pct", "largest rms", "o-"), ("frequency_off_pct", "frequency", "s--"),
            )
        )  # fmt: skip
        x = "step [ms]" if by_step else "element [m]"
        drawn.append(Panel(f"{row.case} by {row.model}", x, "off the finest [%]", lines, log=True))
    return tuple(drawn)


def table(stored: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return plain rows as cells, below a head."""
    head = ("case", "model", "elements", "per wave", "step ms", "per period", "rms D", "off %",
            "Hz", "off %")  # fmt: skip
    cells: list[tuple[str, ...]] = [head]
    for row in stored:
        for p in row["points"]:
            cells.append(
                (row["case"], row["model"], f"{p['elements']}", f"{p['per_wave']:.3g}",
                 f"{1e3 * p['step_s']:g}", f"{p['per_period']:.3g}", f"{p['rms_diameters']:.4f}",
                 f"{p['rms_off_pct']:+.2f}", f"{p['frequency_hz']:.4g}",
                 f"{p['frequency_off_pct']:+.3f}")
            )  # fmt: skip
    return cells
