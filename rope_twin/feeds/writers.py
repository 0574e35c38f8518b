"""Lines of instruments from samples: for `rope_twin feed --simulate` and for tests.

A writer makes what the instrument would send with these settings; the parser reads it back, up to
the digits of the telegram.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from rope_twin.feeds.configuration import (
    CRANE_TIP,
    MODBUS,
    MOTOR,
    OPCUA,
    SIGNS,
    UNITS,
    FeedSettings,
)
from rope_twin.feeds.instrument import LineSample, MotionSample, Sample
from rope_twin.feeds.readings import OPCUA_START, clock_of, line_of, nmea, sum_of
from rope_twin.feeds.telegrams import EM3000_RECORD

Writer = Callable[[Sample], bytes]


def writer(settings: FeedSettings) -> Writer:
    """Return the function that writes the lines of a sample, as the settings describe them."""
    if settings.is_line_monitor:
        return _LineWriter(settings).write
    return _MotionWriter(settings).write


class _Scale:
    """Values in the units and signs of the telegram."""

    def __init__(self, settings: FeedSettings) -> None:
        self._factor = {name: UNITS[name][unit] for name, unit in settings.units.items()}
        self._sign = {name: SIGNS[name][word] for name, word in settings.positive.items()}

    def of(self, name: str, value: float, usual: float = 1.0) -> float:
        """Return a value in SI as the telegram has it; 0 for one that is not known."""
        if math.isnan(value):
            return 0.0
        sign, factor = self._sign.get(name, usual), self._factor.get(name, 1.0)
        return value * sign / factor + 0.0  # no minus zero


def _eight(value: float) -> str:
    """Return a number in the eight characters of an LCI-90."""
    digits = max(0, min(3, 5 - len(str(int(abs(value))))))
    return f"{value:08.{digits}f}"


class _LineWriter:
    def __init__(self, settings: FeedSettings) -> None:
        self._settings, self._scale = settings, _Scale(settings)

    def write(self, sample: Sample) -> bytes:
        assert isinstance(sample, LineSample)
        settings, of = self._settings, self._scale.of
        own_tension = sample.motor_tension_n if settings.tension_of == MOTOR else sample.tension_n
        tension = of("tension", own_tension)
        speed, payout = of("speed", sample.speed_m_per_s), of("payout", sample.payout_m)
        motor = of("tension", sample.motor_tension_n)
        known = {"tension": tension, "speed": speed, "payout": payout, "motor_tension": motor}
        moment = clock_of(sample.stamp_ns)
        values = [_eight(tension), _eight(speed), _eight(payout)]
        if settings.format == "lci90":
            time = moment.isoformat(timespec="milliseconds").removesuffix("+00:00")
            body = ",".join([f"{settings.channel or '01'}RD", time, *values, ""])
            return f"\x01{body}{sum_of(body)}\r\n".encode("ascii")
        if settings.format == "wir":
            clock = f"{moment:%Y-%m-%d},{moment:%H:%M:%S}.{moment.microsecond // 1000:03d}"
            body = ",".join(["$WIR", clock, *values, "00000000", "00000000", ""])
            return f"{body}{sum_of(body)}\r\n".encode("ascii")
        if settings.format == OPCUA:
            return line_of([known[name] for name in settings.nodes], OPCUA_START)
        if settings.format == MODBUS:
            return line_of([known[name] for name in settings.registers])
        if settings.format == "rcwd":
            length = f"{payout:.2f}"
            at_motor = f"RCWD,{settings.channel or '1'},1,{length},{motor:.3f},{speed:.2f},0"
            return nmea(f"{at_motor},{length},{tension:.6f}", "@")
        fields = [settings.start, *["0"] * max(settings.columns.values())]
        for name, place in settings.columns.items():
            fields[place] = f"{known[name]:.3f}" if name in known else settings.channel or "1"
        body = ",".join(fields)
        if settings.checksum == "xor":
            return nmea(body[1:], body[0])
        end = f",{sum_of(body + ',')}" if settings.checksum == "sum" else ""
        return f"{body}{end}\r\n".encode("ascii")


def _signed(value: float, width: int) -> str:
    """Return a whole number with a blank or a minus before its digits."""
    return f"{'-' if value < -0.5 else ' '}{min(abs(round(value)), 10**width - 1):0{width}d}"


class _MotionWriter:
    def __init__(self, settings: FeedSettings) -> None:
        self._settings, self._scale = settings, _Scale(settings)
        self._count = 0

    def write(self, sample: Sample) -> bytes:
        assert isinstance(sample, MotionSample)
        of = self._scale.of
        heave, rate = of("heave", sample.heave_m), of("heave", sample.heave_rate_m_per_s)
        roll = of("roll", math.degrees(sample.roll_rad))
        pitch = of("pitch", math.degrees(sample.pitch_rad), -1.0)
        heading = 0.0 if math.isnan(sample.heading_deg) else sample.heading_deg % 360.0
        self._count = (self._count + 1) % 32768
        form = self._settings.format
        if form in ("tss1", "tss3"):
            return self._tss(form, 100.0 * heave, 100.0 * roll, 100.0 * pitch)
        if form == "em3000":
            numbers = (round(100.0 * value) for value in (roll, pitch, heave, heading))
            return EM3000_RECORD.pack(0x90, 0x90, *numbers)
        if form == "octans":
            return self._octans(heave, rate, roll, pitch, heading)
        if form == "phtrh":
            up = self._settings.positive["letter"]
            down = "U" if up == "O" else "O"
            body = f"PHTRH,{_tilts(pitch, roll)},{abs(heave):.2f},{up if heave >= 0.0 else down}"
            return nmea(body)
        if form == "psxn":
            lines = nmea("PSXN,20,0,0,0,0")
            lines += nmea(f"PSXN,23,{roll:.2f},{pitch:.2f},{heading:.2f},{heave:.3f}")
            if self._settings.sentences == "23 24":
                lines += nmea(f"PSXN,24,0.00,0.00,0.00,{rate:.3f}")
            return lines
        if form == "pashr":
            moment = clock_of(sample.stamp_ns)
            time = f"{moment:%H%M%S}.{moment.microsecond // 1000:03d}"
            return nmea(
                f"PASHR,{time},{heading:.2f},T,{roll:+.2f},{pitch:+.2f},{heave:+.3f},"
                "0.029,0.029,0.059,1,1"
            )
        if form == "smc":
            body = f"PSMCK,{heave:+07.3f},{rate:+07.3f},+00.000,{roll:+06.2f},{pitch:+06.2f}"
            return nmea(f"{body},{self._count:05d}")
        time_us = sample.stamp_ns // 1000 % 2**32
        body = f"{roll:.3f},{pitch:.3f},{heading:.2f},{heave:.3f},{rate:.3f},0"
        return nmea(f"PNORSUB2,{time_us},0,{body}")

    def _tss(self, form: str, heave_cm: float, roll: float, pitch: float) -> bytes:
        heave = _signed(heave_cm, 4)
        turns = f"{_signed(roll, 4)} {_signed(pitch, 4)}\r\n"
        if form == "tss1":
            return f":00FFCA {heave}F{turns}".encode("ascii")
        other = _signed(0.0, 4)
        both = f"{heave} {other}" if self._settings.heave_of == CRANE_TIP else f"{other} {heave}"
        return f":R{both}H{turns}".encode("ascii")

    def _octans(
        self, heave: float, rate: float, roll: float, pitch: float, heading: float
    ) -> bytes:
        wanted = (self._settings.sentences or "PHTRO PHLIN").split()
        lines = nmea(f"HEHDT,{heading:.2f},T")
        if "PHTRO" in wanted:
            lines += nmea(f"PHTRO,{_tilts(pitch, roll)}")
        if "PHLIN" in wanted:
            lines += nmea(f"PHLIN,0.000,0.000,{heave:.3f}")
        if "PHSPD" in wanted:
            lines += nmea(f"PHSPD,0.000,0.000,{rate:.3f}")
        return lines


def _tilts(pitch: float, roll: float) -> str:
    """Return pitch and roll [°], bow up and port up, with the letters of Octans."""
    bow, port = "M" if pitch >= 0.0 else "P", "T" if roll >= 0.0 else "B"
    return f"{abs(pitch):.2f},{bow},{abs(roll):.2f},{port}"
