"""P11: bounces of a mass on a tension-only spring below a moving hang-off, in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from rope_twin.studies.driven_twin import march
from rope_twin.studies.picture import Line, Panel, Vector
from validation.case import Case, Finding, Found, between, limited
from validation.rigs import Rig

SPRING = Rig(
    length=100.0, elements=3, mass=1e-6, EA=6.9e6, diameter=1e-6, load=5e3, volume=1.0,
    added=(2e3, 2e3, 2e3), density=1025.0, tolerance=1e-5,
)  # fmt: skip
STEPS_S = (0.02, 0.014, 0.01, 0.007, 0.005, 0.0035)
SLACK_N = 1.0  # tension below which the spring counts as slack
JUDGED_S = 0.005
SCAN_S = 1e-3  # in which the closed form changes between taut and slack at most once
Piece = Callable[[float], tuple[float, float]]  # time [s] to position and velocity


@dataclass(frozen=True)
class Heave:
    """Motion a·(1 - cos(Ω·t)) of the hang-off, and from `stop` on none."""

    name: str
    amplitude: float  # a [m]
    period: float  # [s]
    seconds: float  # watched
    stop: float = math.inf  # at an extreme [s]

    @property
    def omega(self) -> float:
        """Return Ω [1/s]."""
        return 2.0 * math.pi / self.period

    def at(self, time: float) -> tuple[float, float]:
        """Return position [m] and velocity [m/s]."""
        angle = self.omega * min(time, self.stop)
        rate = self.amplitude * self.omega * math.sin(angle) if time < self.stop else 0.0
        return self.amplitude * (1.0 - math.cos(angle)), rate


FALL = Heave("hang-off dropped by 3 m in 1 s", -1.5, 2.0, 15.0, stop=1.0)
HEAVE = Heave("heave of 1 m, 3.1 s", 1.0, 3.1, 17.0)


@dataclass(frozen=True)
class Bounces:
    """Closed form of a mass on the spring, from rest, piece by piece.

    Taut: M'·z" = -K·(z - z_h + L) - W, the sum of an oscillation of its own and of one with the
    hang-off; slack: M'·z" = -W. A piece ends where z_h - z - L changes its sign.
    """

    rig: Rig
    heave: Heave

    def follow(self, times: Vector) -> tuple[Vector, Vector, list[float]]:
        """Return positions [m] and tensions [N] at these times, and when it went slack or taut."""
        length, stiffness = self.rig.length, self.rig.EA / self.rig.length
        place, pull, changes = np.empty(len(times)), np.empty(len(times)), []
        done = 0
        for end, changed, piece in self._pieces(float(times[-1])):
            while done < len(times) and times[done] <= end:
                z = piece(times[done])[0]
                stretch = self.heave.at(times[done])[0] - z - length
                place[done], pull[done] = z, stiffness * max(stretch, 0.0)
                done += 1
            if changed:
                changes.append(end)
        return place, pull, changes

    def _pieces(self, last: float) -> Iterator[tuple[float, bool, Piece]]:
        """Yield the end of each piece, whether slack or taut begins there, and its motion."""
        weight, stiffness = self.rig.load_weight, self.rig.EA / self.rig.length
        begin, z, v = 0.0, -self.rig.length - weight / stiffness, 0.0
        taut = True
        while begin < last:
            piece = self._taut(begin, z, v) if taut else self._slack(begin, z, v)
            border = self.heave.stop if begin < self.heave.stop else math.inf
            change = self._change(piece, begin, min(border, last), taut)
            end = min(border, last) if change is None else change
            yield end, change is not None, piece
            (z, v), begin, taut = piece(end), end, taut != (change is not None)

    def _change(self, piece: Piece, begin: float, end: float, taut: bool) -> float | None:
        def stretch(time: float) -> float:
            return self.heave.at(time)[0] - piece(time)[0] - self.rig.length

        before = begin + 1e-2 * SCAN_S  # past the change with which the piece began
        while before < end:
            after = min(before + SCAN_S, end)
            if (stretch(after) > 0.0) != taut:
                return float(brentq(stretch, before, after, xtol=1e-14))
            before = after
        return None

    def _taut(self, begin: float, z: float, v: float) -> Piece:
        moving, stiffness = self.rig.load + self.rig.added[2], self.rig.EA / self.rig.length
        natural = math.sqrt(stiffness / moving)
        omega, a = self.heave.omega, self.heave.amplitude
        mean = -self.rig.length - self.rig.load_weight / stiffness
        swing = -a / (1.0 - (omega / natural) ** 2)
        if begin >= self.heave.stop:
            mean, swing, a = mean + self.heave.at(begin)[0], 0.0, 0.0

        def forced(time: float) -> tuple[float, float]:
            angle = omega * time
            return mean + a + swing * math.cos(angle), -swing * omega * math.sin(angle)

        c = z - forced(begin)[0]
        s = (v - forced(begin)[1]) / natural

        def piece(time: float) -> tuple[float, float]:
            angle = natural * (time - begin)
            place, rate = forced(time)
            return (
                place + c * math.cos(angle) + s * math.sin(angle),
                rate + natural * (s * math.cos(angle) - c * math.sin(angle)),
            )

        return piece

    def _slack(self, begin: float, z: float, v: float) -> Piece:
        gravity = self.rig.load_weight / (self.rig.load + self.rig.added[2])

        def piece(time: float) -> tuple[float, float]:
            elapsed = time - begin
            return z + v * elapsed - 0.5 * gravity * elapsed**2, v - gravity * elapsed

        return piece


def _against(heave: Heave, steps_s: Sequence[float]) -> tuple[list[Finding], tuple[Panel, ...]]:
    """Compare position and tension over all bounces, at each of these time steps."""
    places, pulls, findings = [], [], []
    panels: tuple[Panel, ...] = ()
    for step in steps_s:
        rig = replace(SPRING, step=step)
        snapshots = march(rig.twin(), heave.at, heave.seconds)
        rows = [(s.time_s, s.payload_position_m[2], s.tension_top_n) for s in snapshots]
        time, place, pull = np.array(rows).T
        z, exact, changes = Bounces(rig, heave).follow(time)
        places.append(float(np.sqrt(np.mean((place - z) ** 2))) / float(np.ptp(z)))
        pulls.append(float(np.sqrt(np.mean((pull - exact) ** 2))) / float(exact.max()))
        if step == JUDGED_S:
            name = f"{heave.name}, {1e3 * step:g} ms"
            slack = 100.0 * float((pull < SLACK_N).mean())
            exact_pct = 100.0 * float((exact < SLACK_N).mean())
            peak = 100.0 * abs(pull.max() / exact.max() - 1.0)
            findings += [
                between(f"{heave.name}: times slack or taut", len(changes), (8, math.inf),
                        "several"),
                limited(f"{name}: largest position off, of its range",
                        100.0 * float(np.abs(place - z).max() / np.ptp(z)), 0.1),
                limited(f"{name}: largest tension off, of its peak",
                        100.0 * float(np.abs(pull - exact).max() / exact.max()), 0.3),
                limited(f"{name}: maximum tension off", peak, 0.01),
                between(f"{name}: time slack", slack, (exact_pct - 0.2, exact_pct + 0.2),
                        f"{exact_pct:.3f}", "%"),
            ]  # fmt: skip
            panels = (
                Panel(heave.name, "time [s]", "tension [kN]",
                      (Line(time, 1e-3 * exact, "closed form"),
                       Line(time[::10], 1e-3 * pull[::10], f"ours, {1e3 * step:g} ms", "k."))),
            )  # fmt: skip
    order = [float(np.polyfit(np.log(steps_s), np.log(errors), 1)[0]) for errors in (places, pulls)]
    for quantity_name, slope in zip(("position", "tension"), order, strict=True):
        quantity = f"{heave.name}: order of convergence, rms of the {quantity_name}"
        findings.append(between(quantity, slope, (1.8, math.inf), "2, of TR-BDF2"))
    lines = (Line(steps_s, places, "position over its range", "o-"),
             Line(steps_s, pulls, "tension over its peak", "s-"))  # fmt: skip
    return findings, (*panels, Panel(heave.name, "step [s]", "rms off", lines, log=True))


def _bounces(heaves: Sequence[Heave] = (FALL, HEAVE), steps_s: Sequence[float] = STEPS_S) -> Found:
    pairs = [_against(heave, steps_s) for heave in heaves]
    findings = [finding for results, _ in pairs for finding in results]
    return Found(tuple(findings), tuple(panel for _, panels in pairs for panel in panels), NOTES)


NOTES = (
    "The order is a straight line through six steps: how much a step that goes slack or taut "
    "midway is off depends on where in the step that is, so that a single pair of steps may show "
    "any order between 1 and 3.",
)

CASES = (
    Case("P11", "bounces of a mass on a tension-only spring, taut and slack, undamped",
         "closed form, piece by piece", _bounces, 15.0,
         lambda: _bounces((FALL,), (0.02, 0.01, JUDGED_S))),
)  # fmt: skip
