"""Displacement RAOs of a vessel in six degrees of freedom: one representation for every format.

Axes of the vessel (REP 103): x to the bow, y to port, z up, right-handed rotations, so that pitch
is positive bow down and roll positive starboard down. Headings are directions of propagation: 0 for
following seas, 180 for head seas, 90 for waves that travel to port. A wave a·cos(ωt) at the
reference point moves that point by |A|·a·cos(ωt + arg A): a positive phase leads the wave.

A file may give the motion of one point and phases relative to another. `assemble` refers both to
the point of the phases by a rigid motion, which is exact in linear theory without a wave number.

A table need not cover the whole wave spectrum: below its lowest frequency the RAOs are constant,
above its highest they fade to zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.quantity import SparingRepr, quantity, text
from rope_twin.sea.spectrum import Waves
from rope_twin.sea.tables import Vector

SHIFTS, TURNS = ("surge", "sway", "heave"), ("roll", "pitch", "yaw")
FREEDOMS = (*SHIFTS, *TURNS)
FADE = 1.2  # times the highest frequency of a table: RAOs are zero above
MIRRORED = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # in the xz plane
MIRRORED_FORE_AND_AFT = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])  # in the yz plane
WIDEST_GAP_DEG = 90.0  # between headings: linear interpolation of sin β is 0.21 off in the middle
SAME_DEG, SAME_M = 1e-6, 1e-6  # headings and points nearer than this are one
LONG_WAVE_S = 18.0  # periods from which a ship of up to 150 m follows the waves
MIN_HEAVE, MAX_HEAVE, MAX_PHASE_DEG = 0.5, 1.5, 60.0  # accepted in long waves
GRAVITY_M_PER_S2 = 9.80665

NO_SYMMETRY, XZ_PLANE, XZ_AND_YZ_PLANES = "none", "xz_plane", "xz_and_yz_planes"
SYMMETRIES = (NO_SYMMETRY, XZ_PLANE, XZ_AND_YZ_PLANES)

Answers = NDArray[np.complex128]
Point = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, repr=False)
class RaoConventions(SparingRepr):
    """Conventions of an RAO file that the file itself does not state.

    Coordinates count in the vessel's axes: x forward, y to port, z up, from any fixed point that is
    the same for all of them and for the crane tip.
    """

    _later = frozenset(
        ("origin_m", "phase_origin_m", "scale_length_m", "symmetry", "vessel", "draught")
    )

    origin_m: Point | None = quantity(
        "point whose motion the RAOs give: x, y, z in the vessel's axes", "m", -1e3, 1e3,
        default=None,
    )  # fmt: skip
    phase_origin_m: Point | None = quantity(
        "point at which the wave has phase zero: x, y, z in the vessel's axes", "m", -1e3, 1e3,
        default=None,
    )  # fmt: skip
    scale_length_m: float | None = quantity(
        "length that rotations are made dimensionless with (WAMIT: ULEN)", "m", 1e-3, 1e3,
        default=None,
    )  # fmt: skip
    symmetry: str = text("planes of symmetry: none, xz_plane or xz_and_yz_planes", "")
    vessel: str = text("name of the vessel type, in a file of several", "")
    draught: str = text("name of the draught, in a file of several", "")

    def check(self) -> str | None:
        """Return a fault of the symmetry, or None."""
        if self.symmetry and self.symmetry not in SYMMETRIES:
            return f"symmetry is '{self.symmetry}'; {did_you_mean(self.symmetry, SYMMETRIES)}"
        return None

    def require(self, where: str, needed: tuple[str, ...], states: str) -> None:
        """Check that exactly these conventions are given. `states`: reason why others are not.

        Raises:
            InputError: one is missing, or one is given that does not belong to the file.
        """
        if fault := self.check():
            problem, _, remedy = fault.partition("; ")
            raise InputError(where, problem, remedy)
        for name in needed:
            if getattr(self, name) in (None, ""):
                remedy = f"give it as `{name}` in the scene's `conventions`, or as an option"
                raise InputError(where, f"the file does not state its {name}", remedy)
        for name in self._later:
            if name not in needed and getattr(self, name) not in (None, ""):
                raise InputError(where, f"`{name}` is given, and {states}", "remove it")


NO_CONVENTIONS = RaoConventions()


@dataclass(frozen=True)
class Responses:
    """Complex RAOs per metre of wave amplitude: m/m for translations, rad/m for rotations."""

    heading_deg: Vector  # ascending, (h,); they reach from 0 to 180, or to 360 if not mirrored
    frequency_hz: Vector  # ascending, (f,)
    answer: Answers  # (6, h, f)
    source: str
    mirrored: bool = True  # waves from the other side: sway, roll and yaw change sign
    origin_m: Point | None = None  # of motion and phase, in the vessel's axes; None: not stated

    def at(self, frequency_hz: Vector, heading: Vector) -> Answers:
        """Return RAOs, (6, n), for waves that travel at `heading` [rad] relative to the bow.

        Linear in heading and frequency, of real and imaginary part. Below the lowest frequency
        amplitude and phase are constant: a ship follows long waves. Above the highest they fade to
        zero (`fade`).
        """
        return np.asarray(self.fade(frequency_hz) * self._interpolate(frequency_hz, heading))

    def fade(self, frequency_hz: Vector) -> Vector:
        """Return the factor on the highest frequency's RAOs at frequencies above it, (n,).

        Half a cosine, from 1 at the highest frequency to 0 at FADE times it.
        """
        beyond = (frequency_hz / self.frequency_hz[-1] - 1.0) / (FADE - 1.0)
        return np.asarray(0.5 * (1.0 + np.cos(np.pi * np.clip(beyond, 0.0, 1.0))))

    def scaled(self, motion: float, heave: float) -> Responses:
        """Return the RAOs times a factor on all of them, and that of heave times another one."""
        if motion == heave == 1.0:
            return self
        factors = np.array([1.0, 1.0, heave, 1.0, 1.0, 1.0]) * motion
        remark = f"all × {motion:g}, heave × {heave:g} besides"
        answer = factors[:, None, None] * self.answer
        return replace(self, answer=answer, source=f"{self.source} ({remark})")

    def moved(self, to_m: Point) -> Responses:
        """Return the RAOs of another point of the vessel, such as the crane tip.

        to_m: in the vessel's axes, as `origin_m`. Phases still refer to the wave at `origin_m`,
        which the result keeps.

        Raises:
            InputError: `origin_m` is not known.
        """
        if self.origin_m is None:
            problem = "its RAOs are those of a point that is not stated"
            raise InputError(self.source, problem, "give `origin_m`, or the option --origin")
        full = self.around()
        return replace(full, answer=moved_by(full.answer, _arm(self.origin_m, to_m)))

    def around(self) -> Responses:
        """Return the same RAOs as a table over all headings, without symmetry."""
        if not self.mirrored:
            return self
        inner = (np.abs(self.heading_deg) > SAME_DEG) & (self.heading_deg < 180.0 - SAME_DEG)
        mirrored = MIRRORED[:, None, None] * self.answer[:, inner]
        headings, answer = _full_circle(
            self.source,
            np.concatenate([self.heading_deg, -self.heading_deg[inner]]),
            np.concatenate([self.answer, mirrored], axis=1),
        )
        return replace(self, heading_deg=headings, answer=answer, mirrored=False)

    def share_left_out(self, waves: Waves, bow: float, arm_m: Point) -> float:
        """Return the fraction of a point's motion variance that is lost above the highest
        frequency.

        It is that of the motion in three directions with RAOs constant beyond the highest
        frequency, hence an upper bound where they decrease with frequency. bow: heading of the bow
        [rad]; arm_m: from the reference point to the point, in sea axes.
        """
        frequency = waves.omega / (2.0 * np.pi)
        c, s = np.cos(bow), np.sin(bow)
        x, y, z = c * arm_m[0] + s * arm_m[1], c * arm_m[1] - s * arm_m[0], arm_m[2]
        moved = moved_by(self._interpolate(frequency, waves.heading - bow), (x, y, z))
        variance = waves.amplitude_m**2 * (np.abs(moved[:3]) ** 2).sum(axis=0)
        total = float(variance.sum())
        lost = float((variance * (1.0 - self.fade(frequency) ** 2)).sum())
        return lost / total if total > 0.0 else 0.0

    def _interpolate(self, frequency_hz: Vector, heading: Vector) -> Answers:
        """Return RAOs, (6, n), constant beyond the outermost frequencies."""
        turn = np.angle(np.exp(1j * heading))
        side = np.where(turn < 0.0, -1.0, 1.0)
        degrees = np.abs(np.degrees(turn)) if self.mirrored else np.degrees(turn) % 360.0
        i, a = _cells(self.heading_deg, degrees)
        j, b = _cells(self.frequency_hz, frequency_hz)
        low = (1.0 - a) * self.answer[:, i, j] + a * self.answer[:, i + 1, j]
        high = (1.0 - a) * self.answer[:, i, j + 1] + a * self.answer[:, i + 1, j + 1]
        interpolated = (1.0 - b) * low + b * high
        if not self.mirrored:
            return np.asarray(interpolated)
        return np.asarray(np.where(side < 0.0, MIRRORED[:, None] * interpolated, interpolated))


def moved_by(answer: Answers, arm_m: Point) -> Answers:
    """Return RAOs, (6, ...), of a point at `arm_m` from that of `answer`, in the vessel's axes.

    Rigid motion by small angles, u + θ × r: surge + pitch·z - yaw·y, sway + yaw·x - roll·z, heave +
    roll·y - pitch·x; the rotations stay.
    """
    x, y, z = arm_m
    surge, sway, heave, roll, pitch, yaw = answer
    shifts = surge + pitch * z - yaw * y, sway + yaw * x - roll * z, heave + roll * y - pitch * x
    return np.stack([*shifts, roll, pitch, yaw])


def _arm(from_m: Point, to_m: Point) -> Point:
    x, y, z = (float(b - a) for a, b in zip(from_m, to_m, strict=True))
    return x, y, z


def _cells(axis: Vector, values: Vector) -> tuple[NDArray[np.int64], Vector]:
    """Return the interval of each value, and the fraction inside it."""
    i = np.clip(np.searchsorted(axis, values, side="right") - 1, 0, len(axis) - 2)
    return i, np.clip((values - axis[i]) / (axis[i + 1] - axis[i]), 0.0, 1.0)


@dataclass(frozen=True)
class FileRaos:
    """RAOs as a file has them, in the units, signs and phases of `Responses`."""

    where: str  # path of the file, for errors
    source: str  # description for headers
    heading_deg: Vector  # (h,), in any order
    frequency_hz: Vector  # (f,), in any order
    answer: Answers  # (6, h, f)
    symmetry: str  # one of SYMMETRIES
    origin_m: Point  # point whose motion they are
    phase_origin_m: Point  # point whose wave the phases refer to


def assemble(written: FileRaos) -> Responses:
    """Return RAOs with ascending axes that cover every heading, of the point of their phases.

    Raises:
        InputError: headings or frequencies are double, or too few; numbers are not finite.
    """
    where, answer = written.where, written.answer
    if not np.isfinite(answer).all():
        raise InputError(where, "an RAO is not a finite number", "give finite numbers")
    order = np.argsort(written.frequency_hz)
    frequencies = written.frequency_hz[order]
    if len(frequencies) < 2:
        raise InputError(where, "it has one wave period", "give two or more")
    if not (np.isfinite(frequencies).all() and frequencies[0] >= 0.0):
        raise InputError(where, "a wave period is not above 0", "give positive periods")
    if (np.diff(frequencies) <= 1e-9 * frequencies[1:]).any():
        raise InputError(where, "a wave period is double", "give each once")
    answer = answer[:, :, order]
    if written.symmetry == NO_SYMMETRY:
        headings, answer = _full_circle(where, written.heading_deg, answer)
    else:
        both = written.symmetry == XZ_AND_YZ_PLANES
        headings, answer = _one_side(where, written.heading_deg, answer, both)
    gaps = np.diff(headings)
    widest = int(np.argmax(gaps))
    if gaps[widest] > WIDEST_GAP_DEG + SAME_DEG:
        pair = f"{headings[widest] % 360.0:g}° and {headings[widest + 1] % 360.0:g}°"
        problem = f"no heading between {pair}, with symmetry {written.symmetry}"
        raise InputError(where, problem, f"give them at most {WIDEST_GAP_DEG:g}° apart")
    arm = _arm(written.origin_m, written.phase_origin_m)
    off_centreline = (written.symmetry != NO_SYMMETRY and abs(arm[1]) > SAME_M) or (
        written.symmetry == XZ_AND_YZ_PLANES and abs(arm[0]) > SAME_M
    )
    if off_centreline:
        problem = f"the points of motion and of phase are not both in the {written.symmetry}"
        remedy = "give points on the plane of symmetry, or symmetry none with all headings"
        raise InputError(where, problem, remedy)
    return Responses(
        headings, frequencies, moved_by(answer, arm), written.source,
        written.symmetry != NO_SYMMETRY, written.phase_origin_m,
    )  # fmt: skip


def _full_circle(where: str, given_deg: Vector, answer: Answers) -> tuple[Vector, Answers]:
    """Return headings and RAOs that reach from 0 or below to 360 or above."""
    folded = given_deg % 360.0
    folded = np.where(folded > 360.0 - SAME_DEG, 0.0, folded)
    headings, answer = _ascending(where, folded, answer)
    circle = np.concatenate([[headings[-1] - 360.0], headings, [headings[0] + 360.0]])
    return circle, np.concatenate([answer[:, -1:], answer, answer[:, :1]], axis=1)


def _one_side(
    where: str, given_deg: Vector, answer: Answers, fore_and_aft: bool
) -> tuple[Vector, Answers]:
    """Return headings and RAOs that reach from 0 or below to 180 or above."""
    turn = (given_deg + 180.0) % 360.0 - 180.0
    turn = np.where(turn < -180.0 + SAME_DEG, 180.0, turn)
    inner = (np.abs(turn) > SAME_DEG) & (np.abs(turn) < 180.0 - SAME_DEG)
    if (turn[inner] > 0.0).any() and (turn[inner] < 0.0).any():
        problem = "headings on both sides of the plane of symmetry"
        raise InputError(where, problem, "give one side, or symmetry none")
    port = np.where(turn < 0.0, -1.0, 1.0)[:, None]
    answer = np.where(port < 0.0, MIRRORED[:, None, None] * answer, answer)
    headings, answer = _ascending(where, np.abs(turn), answer)
    if fore_and_aft:
        if headings[0] < 90.0 - SAME_DEG and headings[-1] > 90.0 + SAME_DEG:
            problem = "headings from ahead and from astern, and the yz plane is one of symmetry"
            raise InputError(where, problem, "give one quarter, or symmetry xz_plane")
        mirrored = np.abs(headings - 90.0) > SAME_DEG
        more = MIRRORED_FORE_AND_AFT[:, None, None] * answer[:, mirrored]
        headings, answer = _ascending(
            where,
            np.concatenate([headings, 180.0 - headings[mirrored]]),
            np.concatenate([answer, more], axis=1),
        )
    if headings[0] > 0.0:
        headings = np.concatenate([[-headings[0]], headings])
        answer = np.concatenate([MIRRORED[:, None, None] * answer[:, :1], answer], axis=1)
    if headings[-1] < 180.0:
        headings = np.concatenate([headings, [360.0 - headings[-1]]])
        answer = np.concatenate([answer, MIRRORED[:, None, None] * answer[:, -1:]], axis=1)
    return headings, answer


def _ascending(where: str, headings: Vector, answer: Answers) -> tuple[Vector, Answers]:
    """Return headings in order, those that are given twice with equal RAOs once."""
    order = np.argsort(headings, kind="stable")
    headings, answer = headings[order], answer[:, order]
    double = np.flatnonzero(np.diff(headings) <= SAME_DEG)
    for k in double.tolist():
        if not np.allclose(answer[:, k], answer[:, k + 1], rtol=1e-6, atol=1e-12):
            problem = f"the heading {headings[k]:g}° is double, with other RAOs"
            raise InputError(where, problem, "give each once")
    return np.delete(headings, double), np.delete(answer, double, axis=1)


def long_wave_doubts(responses: Responses) -> Iterator[str]:
    """Yield what contradicts the motion of a free ship in its longest waves, one sentence each.

    There a ship follows the surface: heave 1 and in phase, pitch the wave slope k·cos β, a quarter
    of a period ahead of the crest in following seas. A wrong convention (lag for lead, a direction
    that waves come from, a sign) shows here. Nothing is yielded for tables that end below
    LONG_WAVE_S.
    """
    lowest = responses.frequency_hz[responses.frequency_hz > 0.0][0]
    if lowest > 1.0 / LONG_WAVE_S:
        return
    period = f"T = {1.0 / lowest:.3g} s"
    k = (2.0 * np.pi * lowest) ** 2 / GRAVITY_M_PER_S2
    for degrees in np.unique(np.clip(responses.heading_deg, 0.0, 360.0)):
        beta = np.radians(degrees)
        where = f"RAOs at heading {degrees:g}°, {period}"
        _, _, heave, _, pitch, _ = responses.at(np.array([lowest]), np.array([beta]))[:, 0]
        lead = np.degrees(np.angle(heave))
        if not MIN_HEAVE <= abs(heave) <= MAX_HEAVE or abs(lead) > MAX_PHASE_DEG:
            problem = f"heave is {abs(heave):.3g} m/m, {lead:.0f}° ahead of the crest"
            yield phrase(where, problem, "a free ship heaves 1 m/m in phase: check the conventions")
        slope = 1j * k * np.cos(beta)
        if abs(np.cos(beta)) < 0.5 or abs(pitch) < 1e-9:
            continue
        lead = np.degrees(np.angle(pitch / slope))
        if abs(lead) > MAX_PHASE_DEG:
            problem = f"pitch is {lead:.0f}° off the phase of the wave slope"
            remedy = "a free ship pitches with the slope: check the conventions"
            yield phrase(where, problem, remedy)
