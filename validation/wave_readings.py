"""Readings of the modal approach in waves, tried for L4: `python -m validation.wave_readings`.

Le Cunff and Durand 1999, section 3.2.2, on the response core with the water speed renewed every
0.1 s. The paper prints neither the phase of the lift on a place that goes over to another mode, nor
its factor C_c "for the phase shift and the length of the excited zone". Kept: each mode's lift has
the phase of the mode on all of its zone. Tried here:

- the vortices' phase on a place runs on where the place goes over to another mode, and so differs
  from that of the mode; with `settles` it approaches the mode's over so many periods;
- the lift on a place is at its own Strouhal frequency, not at that of the mode that it drives;
- C_c is the length of a mode's zone over the length of its waves, at most 1;
- no lift while the water flows backwards;
- drag across, ½·ρ·d·C_D·U·ẏ with C_D 1, in place of what the water damps outside the band.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.studies.accuracy_study import page_table
from rope_twin.vortex.line_model import Span
from rope_twin.vortex.modal_response import ModalResponse, advance_modes
from rope_twin.vortex.shedding import Shedding
from validation.published_ropes import DENSITY, LCD_CABLE, LCD_RISER, PublishedRope, lcd_current

NODES = 151
HEIGHT_M, WAVE_HZ, GRAVITY = 15.0, 0.0833, 9.81
EVERY_S = 0.1
LASTING_S = {LCD_RISER: (48.0, 72.0), LCD_CABLE: (16.0, 36.0)}  # without and with the wave
PERIODS = 2  # of the wave, evaluated at the end


@dataclass(frozen=True)
class Reading:
    """A reading of what the paper leaves open."""

    name: str
    runs_on: bool = False  # the phase of the lift on a place that changes its mode
    settles: float = 0.0  # periods in which that phase approaches the mode's; 0: never
    own_hz: bool = False  # the lift is at the place's own Strouhal frequency
    by_zone: bool = False  # C_c: zone over wave length
    forward: bool = False  # no lift in water that flows backwards
    drag: bool = False  # across, in place of the damping of the water


READINGS = (
    Reading("kept: the lift of a zone is in phase with its mode"),
    Reading("phase runs on where a place changes its mode", runs_on=True),
    Reading("the same, nearing the mode's over 3 periods", runs_on=True, settles=3.0),
    Reading("the same, over 10 periods", runs_on=True, settles=10.0),
    Reading("lift at the place's own Strouhal frequency", runs_on=True, own_hz=True),
    Reading("C_c: zone over wave length", by_zone=True),
    Reading("no lift while the water flows backwards", forward=True),
    Reading("drag across in place of the water's damping", drag=True),
)


class ReadResponse(ModalResponse):
    """Modal response by a reading; the lift of a place has a phase of its own.

    Raises:
        InputError: the rope is slack somewhere.
    """

    def __init__(self, span: Span, reading: Reading) -> None:
        self._reading = reading
        super().__init__(span, Shedding())
        self._phase = self.angle[self.zones.argmax(axis=1)].copy()  # of the lift, (places,)
        self.flow = self.span.speed  # with its sign, (places,)

    def _advance(self, h: float) -> None:
        drive, reading = self._drive, self._reading
        lift: Any = self.shedding.lift(self.amplitude)
        if reading.forward:
            lift = lift * (self.flow > 0.0)
        if reading.runs_on:
            pushed = (lift * np.exp(1j * self._phase)) @ drive.force
            pushed = pushed * np.exp(-1j * self.angle[drive.active])
            self._run_on(h)
        else:
            pushed = (lift @ drive.force).astype(complex)
        if reading.by_zone:
            zone = self.span.node_length @ self.zones[:, drive.active]
            speed = float(np.sqrt(self.span.tension / self.span.mass).mean())
            pushed = pushed * np.minimum(zone * self.frequency[drive.active] / speed, 1.0)
        force, unit = np.zeros_like(drive.force), np.zeros(len(lift))
        force[0], unit[0] = np.abs(pushed), 1.0
        self.angle[drive.active] += np.angle(pushed)
        self.amplitude, work = self.amplitude.copy(), np.empty((2, len(drive.active)))
        advance_modes(h, unit, self._damped(force), self._ringing, self.amplitude, work)
        self.angle[drive.active] -= np.angle(pushed)

    def _damped(self, force: Floats) -> Any:
        drive, span = self._drive._replace(force=force), self.span
        if not self._reading.drag:
            return drive
        structural = 2.0 * self.shedding.structural * drive.omega * drive.mass
        hydrodynamic = 0.5 * DENSITY * span.diameter * span.speed * span.node_length
        damping = structural + hydrodynamic @ self.modes.shape[:, drive.active] ** 2
        return drive._replace(damping=damping, growing=np.zeros_like(drive.growing))

    def _run_on(self, h: float) -> None:
        mode, locked = self.zones.argmax(axis=1), self.zones.max(axis=1) > 0.0
        shedding = self.shedding.strouhal * self.span.speed / self.span.diameter
        hz = np.where(locked & (not self._reading.own_hz), self.frequency[mode], shedding)
        self._phase = self._phase + 2.0 * np.pi * hz * h
        if self._reading.settles > 0.0:
            ahead = self.angle[mode] + 2.0 * np.pi * self.frequency[mode] * h - self._phase
            share = locked * (1.0 - np.exp(-hz * h / self._reading.settles))
            self._phase += share * np.angle(np.exp(1j * ahead))


def largest_rms(rope: PublishedRope, reading: Reading, wave: bool) -> float:
    """Return the largest rms/d along a published line."""
    current = lcd_current(NODES)
    below = np.linspace(-rope.length, 0.0, NODES)
    k = 4.0 * np.pi**2 * WAVE_HZ**2 / GRAVITY
    orbital = np.pi * HEIGHT_M * WAVE_HZ if wave else 0.0
    response = ReadResponse(rope.span(current + orbital * np.exp(k * below)), reading)
    z = response.span.s - response.span.s[-1]
    steady, moving = np.interp(z, below, current), orbital * np.exp(k * z)
    count = round(LASTING_S[rope][wave] / EVERY_S)
    motion = np.zeros((count, len(z)))
    for row in range(count):
        now = (row + 1) * EVERY_S
        turn = min(now * WAVE_HZ, 1.0) * np.cos(2.0 * np.pi * WAVE_HZ * now)
        response.flow = steady + turn * moving
        response.follow_speed(np.abs(response.flow))
        response.advance(EVERY_S)
        motion[row] = response.motion / rope.diameter
    late = round(PERIODS / WAVE_HZ / EVERY_S) if wave else count // 2
    return float(motion[-late:].std(axis=0).max())


def tried() -> str:
    """Return a table of all readings; each is reported when it is done."""
    rows = [["reading", "riser", "ratio", "cable", "ratio"]]
    rows.append(["published", "0.464 → 0.242", "0.522", "0.285 → 0.019", "0.067"])
    for reading in READINGS:
        cells = [reading.name]
        for rope in (LCD_RISER, LCD_CABLE):
            calm, wavy = (largest_rms(rope, reading, wave) for wave in (False, True))
            cells += [f"{calm:.3f} → {wavy:.3f}", f"{wavy / calm:.3f}"]
        rows.append(cells)
        sys.stderr.write(f"{cells}\n")
    return page_table(rows)


if __name__ == "__main__":
    sys.stdout.write(f"{tried()}\n")
