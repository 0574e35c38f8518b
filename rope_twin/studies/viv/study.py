"""VIV assessment of a rope: lock-in zones, VIV response and fatigue damage.

Modal response (rope_twin.vortex.modal_response) about the static equilibrium. Drag is amplified by
1 + 1.043·(2·rms/d)^0.65 (Vandiver 1983). Stress is that of bending, E·d/2·y″ with E = EA over the
metal area: an upper bound for a stranded rope, whose wires slide. A rope with the bending stiffness
of a pipe of its diameter, EI/EA = (d² + d_i²)/16, is treated as a pipe, with its metal area. Damage
is counted by rainflow of the bending stress alone; the tension is static.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.scene.model.grid import ends_m
from rope_twin.scene.schema import Scene
from rope_twin.studies.fatigue import stress_damage
from rope_twin.studies.viv.scene import SceneSpan, span_of
from rope_twin.vortex.drag_amplification import amplified_drag
from rope_twin.vortex.fatigue import StressCurve, metal_area
from rope_twin.vortex.modal_response import ModalResponse
from rope_twin.vortex.shedding import Shedding

YEAR_S = 365.25 * 86400.0
STEADY = 0.5  # of a run: the part that statistics are taken of
RECORDED = 3  # times as often as the response needs its amplitude
PLACES = 240  # at most, that stress and damage are counted at
HARDLY = 1e-2  # of the largest motion: what moves less is as good as at rest


@dataclass(frozen=True)
class VivRun:
    """A response over time; places from the lower end up."""

    scene: SceneSpan
    response: ModalResponse
    time_s: Floats  # (times,)
    coordinate: Floats  # of the modes [m], (times, modes)
    from_top_m: Floats  # unstretched, of the places

    @property
    def first(self) -> int:
        """Return the index of the first steady time."""
        return int((1.0 - STEADY) * len(self.time_s))

    def motion(self, places: Floats | None = None) -> Floats:
        """Return the steady motion over the diameter, (times, places), at all or some places by
        number.
        """
        shape, diameter = self.response.modes.shape, self.response.span.diameter
        if places is not None:
            some = places.astype(int)
            shape, diameter = shape[some], diameter[some]
        return np.asarray(self.coordinate[self.first :] @ shape.T / diameter)

    @property
    def covariance(self) -> Floats:
        """Return the covariance of the steady modal coordinates [m²], (modes, modes)."""
        late = self.coordinate[self.first :]
        late = late - late.mean(axis=0)
        return np.asarray(late.T @ late / len(late))

    def rms(self) -> Floats:
        """Return the RMS of the motion over the diameter, (places,)."""
        shape = self.response.modes.shape
        square = np.einsum("pm,mn,pn->p", shape, self.covariance, shape, optimize=True)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)) / self.response.span.diameter)

    def frequency_hz(self) -> Floats:
        """Return the mean frequency rms(ẏ)/rms(y)/2π of the motion, by modes; 0 without motion."""
        shape = self.response.modes.shape
        variance = np.diag(self.covariance)
        square = shape**2 @ variance
        rate = shape**2 @ (variance * self.response.frequency**2)
        moves = square > 1e-12 * square.max(initial=1e-300)
        return np.sqrt(np.where(moves, rate / np.where(moves, square, 1.0), 0.0))

    def drag_amplification(self) -> Floats:
        """Return the amplification of the normal drag coefficient (Vandiver 1983)."""
        return amplified_drag(self.rms())

    def spectra(self, places: Floats) -> tuple[Floats, Floats]:
        """Return frequencies [Hz] and power of the motion per Hz [d²/Hz], (frequencies, places)."""
        from scipy.signal import welch

        motion = self.motion(places)
        step = float(self.time_s[1] - self.time_s[0])
        length = max(16, min(len(motion), len(motion) // 2))
        found: tuple[Floats, Floats] = welch(motion, fs=1.0 / step, nperseg=length, axis=0)
        return found

    @property
    def modal_rms(self) -> Floats:
        """Return the RMS of each mode over the mean diameter."""
        mean = float(self.response.span.diameter.mean())
        return np.asarray(np.sqrt(np.diag(self.covariance)) / mean)


@dataclass(frozen=True)
class Fatigue:
    """Stress and damage at places of the run."""

    from_top_m: Floats
    stress_rms_pa: Floats  # NaN where the rope is not all of steel
    damage_per_year: Floats  # Miner's sum; NaN likewise


def run_viv(scene: Scene, shedding: Shedding, duration_s: float) -> VivRun:
    """Compute the VIV response of a scene's rope from rest for a given time.

    Raises:
        SceneError: a multi-line system, no current, or no static equilibrium.
        InputError: the rope is slack somewhere.
    """
    lying = span_of(scene)
    response = ModalResponse(lying.span, shedding)
    step = min(response.step_s / RECORDED, duration_s / 16.0)
    count = int(np.ceil(duration_s / step))
    coordinate = np.zeros((count, len(response.frequency)))
    for row in range(count):
        response.advance(step)
        coordinate[row] = response.coordinate
    time_s: Floats = np.asarray(step * np.arange(1.0, count + 1.0), dtype=np.float64)
    from_top = np.interp(response.span.s, lying.span.s, lying.unstretched)
    return VivRun(lying, response, time_s, coordinate, from_top)


def most_moved(run: VivRun, count: int) -> Floats:
    """Return the numbers of the modes with the largest motion, at most `count`, in rising order."""
    rms = run.modal_rms
    most = np.argsort(-rms, kind="stable")[:count]
    return np.sort(most[rms[most] > HARDLY * rms.max(initial=0.0)])


def where_it_moves(frequency_hz: Floats, rms: Floats) -> Floats:
    """Return frequencies for pictures, NaN where the motion is negligible."""
    return np.where(rms > HARDLY * rms.max(initial=0.0), frequency_hz, np.nan)


def chosen_places(run: VivRun, most: int = PLACES) -> Floats:
    """Return the numbers of a limited number of equally spaced places."""
    last = len(run.response.span.s) - 1
    count = min(most, last + 1)
    return np.unique(np.linspace(0.0, last, count).round())


def count_fatigue(run: VivRun, scene: Scene, curve: StressCurve) -> Fatigue:
    """Return bending stress of the steady part of the run, and its damage per year."""
    places = chosen_places(run)
    some = places.astype(int)
    s = run.response.span.s
    bent = np.gradient(np.gradient(run.response.modes.shape, s, axis=0), s, axis=0)
    per_curvature = _stress_per_curvature(run, scene, some)
    stress = run.coordinate[run.first :] @ bent[some].T * per_curvature
    known = np.isfinite(per_curvature)
    damage = np.full(len(some), np.nan)
    damage[known] = stress_damage(stress[:, known], curve)
    lasted = float(run.time_s[-1] - run.time_s[run.first])
    rms = np.where(known, stress.std(axis=0), np.nan)
    return Fatigue(run.from_top_m[some], rms, damage * YEAR_S / lasted)


def _stress_per_curvature(run: VivRun, scene: Scene, some: np.ndarray) -> Floats:
    """Return E·d/2 [Pa·m] at places; NaN where the rope is not solid steel."""
    line = scene.ropes[0]
    figures = []
    for section in line.made_of:
        rope = section.rope
        area = metal_area(rope, run.response.span.stiffness)
        figures.append(rope.tangent_n(0.0) / area * 0.5 * rope.diameter_m)
    below = run.from_top_m[0] - run.from_top_m[some]
    which = np.searchsorted(ends_m(line), below, side="left")
    return np.asarray(np.array(figures)[np.minimum(which, len(figures) - 1)])
