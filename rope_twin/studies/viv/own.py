"""A scene's rope as its own model of vortices shakes it: what a VIV engineer asks of the run.

The model steps with the rope; nothing here is lagged or in modes. Of the motion of the nodes what
is slower than a fifth of the fastest vortices (ship, winch, sway) is left out, forward and backward
in time by a Butterworth filter, and the rest is told across the flow and with it.

Drag amplification is that of the run: the mean of |u_n|·u_n over |U_n|·U_n, with the water's
velocity relative to the rope across it, u_n, and its mean, U_n. Stress is that of bending, E·d/2
times the curvature of the rope as the nodes have it, in the direction in which it is largest; the
damage is that of tension and bending together (rope_twin.twin.fatigue.wear), per year of the run.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.errors import InputError, SceneError, phrase
from rope_twin.scene.arrays.composite import ends_m
from rope_twin.scene.figures import lift_figures
from rope_twin.scene.rules.shedding import expected_pace, refuse_beside, shedding_model
from rope_twin.scene.schema import Scene
from rope_twin.studies.rigs import march
from rope_twin.studies.viv.moving import regular_motion
from rope_twin.studies.viv.study import YEAR_S
from rope_twin.twin.fatigue.endurance import metal_area
from rope_twin.twin.fatigue.wear import RopeWear, WearWish, bending_stiffness, curvature
from rope_twin.twin.findings import MaterialFatigue
from rope_twin.twin.twin import Twin
from rope_twin.twin.vibration.own_motion import SLOW, relative_flow, sides, tangents
from rope_twin.viv.drag import amplified_drag

PLACES = 200  # along the rope, over its length at the time
PER_PERIOD = 24  # looks per period of the fastest vortices
STEADY = 0.5  # of a run: the part that counts
LEAST_PERIODS = 10  # of the fastest vortices in that part
_PLACE = slice(rows.POSITION, rows.POSITION + 3)


class _Look(NamedTuple):
    """One instant at the places, from the hang-off down."""

    place: Floats  # (3, places)
    across: Floats  # water less rope, across it [m/s], (3, places)
    bent: Floats  # curvature [1/m], (2, places)


@dataclass(frozen=True)
class OwnRun:
    """The steady part of a run; places are from the hang-off down."""

    scene: str
    model: str
    vortices_hz: float  # the fastest that were expected
    every_s: float
    from_hang_off_m: Floats  # unstretched, at the end, (places,)
    time_s: Floats  # (times,)
    motion: Floats  # across the flow and with it, over the diameter, (2, times, places)
    tension_top_n: Floats  # (times,)
    drag_amplification: Floats  # (places,)
    stress_rms_pa: Floats  # of bending; NaN where no stress is known, (places,)
    fatigue: MaterialFatigue | None  # None: no stress is known

    @property
    def rms(self) -> Floats:
        """Of the motion over the diameter, across the flow and with it, (2, places)."""
        return np.asarray(self.motion.std(axis=1))

    @property
    def frequency_hz(self) -> Floats:
        """Rice's (1944) mean frequency of both, 0 where nothing moves, (2, places)."""
        rise = np.diff(self.motion, axis=1).std(axis=1)
        total = (self.motion[:, 1:] + self.motion[:, :-1]).std(axis=1)
        moves = total > 1e-9
        angle = np.arctan(rise / np.where(moves, total, 1.0))
        return np.where(moves, angle / (np.pi * self.every_s), 0.0)

    @property
    def damage_per_year(self) -> Floats:
        """Miner's sum per year of such a run; NaN where no stress is known, (places,)."""
        if self.fatigue is None:
            return np.full(len(self.from_hang_off_m), np.nan)
        own, used = self.fatigue.from_hang_off_m[::-1], self.fatigue.used[::-1]
        return np.interp(self.from_hang_off_m, own, used) * YEAR_S / self.fatigue.counted_s

    @property
    def vandiver(self) -> Floats:
        """Drag amplification that Vandiver (1983) found of such a motion, (places,)."""
        return amplified_drag(self.rms[0])

    def spectra(self) -> tuple[Floats, Floats]:
        """Frequencies [Hz] and power across the flow [d²/Hz], (frequencies, places)."""
        from scipy.signal import welch

        length = max(16, len(self.time_s) // 2)
        found: tuple[Floats, Floats] = welch(
            self.motion[0], fs=1.0 / self.every_s, nperseg=length, axis=0
        )
        return found


def run_own(scene: Scene, duration_s: float, curve: str) -> OwnRun:
    """A scene from rest, with its regular heave and winch schedule; its second half counts.

    curve: name of an S-N curve of stress.

    Raises:
        SceneError: it lists no model of vortices, nothing flows, or it cannot be built.
        InputError: the run is too short, its sea is neither still nor a regular heave, or its
            winch is told other things than speeds.
        SolverError: the twin's next state would not be finite.
    """
    hz = _expected_hz(scene)
    least = LEAST_PERIODS / (hz * (1.0 - STEADY))
    if duration_s < least:
        what = f"{duration_s:g} s are too short for vortices of {hz:.3g} Hz"
        raise InputError(phrase("--for", what, f"give {least:.2g} or more"))
    heave, speeds = regular_motion(scene)
    twin = Twin(scene)
    every = max(1, int(1.0 / (PER_PERIOD * hz * twin.step_s)))
    wear = _wear(scene, twin, curve)
    looks: list[_Look] = []
    seen = []
    for shot in march(twin, heave, duration_s, every, speeds):
        if shot.time_s < STEADY * duration_s:
            continue
        rope = twin.rope
        if not looks:
            split = _sides(rope)
        looks.append(_look(rope))
        seen.append((shot.time_s, shot.tension_top_n))
        if wear is not None:
            s, bent = curvature(rope)
            pieces = np.stack([np.interp(wear.middles, s, part) for part in bent])
            wear.take(rope, shot.tension_top_n, pieces)
    line_out = float(twin.rope.state.s[int(twin.rope.state.counts[rows.ELEMENTS])])
    from_top = np.linspace(0.0, line_out, PLACES)
    place, across, bent = (np.array(part) for part in zip(*looks, strict=True))
    thick, stiff = _figures(scene, line_out - from_top, bending_stiffness(twin.rope.effects))
    times, pulls = (np.array(part) for part in zip(*seen, strict=True))
    every_s = every * twin.step_s
    moved = np.einsum("skp,tkp->stp", split, place) / thick
    return OwnRun(
        scene.name, shedding_model(scene), hz, every_s, from_top, times, _fast(moved, hz, every_s),
        pulls, _amplification(across), stiff * _worst_rms(bent),
        None if wear is None else wear.shot(line_out, len(times) * every_s),
    )  # fmt: skip


def _expected_hz(scene: Scene) -> float:
    if not shedding_model(scene):
        what = "it lists no model of vortices"
        right = "list wake_oscillator, strouhal_forcing or travelling_waves, or leave --own out"
        raise SceneError(phrase(f"{scene.path}: effects", what, right))
    what, right = "its vibration is no motion of the nodes", "leave --own out: it is told in modes"
    refuse_beside(scene, what, right)
    pace = expected_pace(scene, lift_figures(scene))
    if pace is None:
        what = "nothing flows, so no vortices"
        raise SceneError(phrase(f"{scene.path}: effects", what, "give 'current' a speed"))
    return pace.frequency_hz


def _look(rope: Rope) -> _Look:
    n = int(rope.state.counts[rows.ELEMENTS])
    s, place = rope.state.s[: n + 1], rope.state.nodes[_PLACE, : n + 1]
    along, flow = tangents(place), relative_flow(rope)
    across = flow - (flow * along).sum(axis=0) * along
    return _Look(*(_at_places(s, part) for part in (place, across, curvature(rope)[1])))


def _at_places(s: Floats, values: Floats) -> Floats:
    at = np.linspace(s[-1], s[0], PLACES)
    return np.stack([np.interp(at, s, part) for part in values])


def _sides(rope: Rope) -> Floats:
    """Unit vectors across rope and water, and across the rope with the water, (2, 3, places)."""
    n = int(rope.state.counts[rows.ELEMENTS])
    water = rope.work[rows.FLOW : rows.FLOW + 3, : n + 1].copy()
    water[:, n] = water[:, n - 1]
    both = sides(rope.state.nodes[_PLACE, : n + 1], water)
    return np.stack([_at_places(rope.state.s[: n + 1], own) for own in both])


def _figures(scene: Scene, from_lower_m: Floats, EI: float) -> tuple[Floats, Floats]:
    """Diameter that the water sees [m] and E·d/2 [Pa·m] at places; NaN: not all of steel."""
    line = scene.ropes[0]
    made = [section.rope for section in line.made_of]
    which = np.minimum(np.searchsorted(ends_m(line), from_lower_m, side="right"), len(made) - 1)
    thick = np.array([rope.hydrodynamic_diameter_m for rope in made])
    areas = [metal_area(rope, EI) for rope in made]
    stiff = [
        0.5 * rope.tangent_n(0.0) * rope.diameter_m / area
        for rope, area in zip(made, areas, strict=True)
    ]
    return thick[which], np.array(stiff)[which]


def _wear(scene: Scene, twin: Twin, curve: str) -> RopeWear | None:
    """None: some of the rope is neither all of steel nor a pipe."""
    line, EI = scene.ropes[0], bending_stiffness(twin.rope.effects)
    if any(np.isnan(metal_area(section.rope, EI)) for section in line.made_of):
        return None
    most = scene.winch.most_line_out_m if scene.winch else line.length_m
    return RopeWear(line, most, WearWish(curve, True), EI)


def _fast(motion: Floats, hz: float, every_s: float) -> Floats:
    """Without what is slower than a fifth of the vortices; (sides, times, places)."""
    from scipy.signal import butter, sosfiltfilt

    mean = motion.mean(axis=1, keepdims=True)
    filtered = sosfiltfilt(
        butter(2, SLOW * hz, "highpass", fs=1.0 / every_s, output="sos"), motion - mean, axis=1
    )
    return np.asarray(filtered)


def _amplification(across: Floats) -> Floats:
    """Mean drag over that of the mean velocity, (times, 3, places) to (places,).

    1 where the water stands still.
    """
    speed = np.sqrt((across * across).sum(axis=1, keepdims=True))
    drag, mean = (speed * across).mean(axis=0), across.mean(axis=0)
    still = (mean * mean).sum(axis=0)
    flows = still > 1e-12
    shaken = (drag * mean).sum(axis=0) / np.sqrt(np.where(flows, still, 1.0))
    return np.where(flows, shaken / np.where(flows, still, 1.0), 1.0)


def _worst_rms(bent: Floats) -> Floats:
    """Standard deviation of vectors (times, 2, places) where it is largest, (places,)."""
    off = bent - bent.mean(axis=0)
    xx, yy = (off * off).mean(axis=0)
    xy = (off[:, 0] * off[:, 1]).mean(axis=0)
    return np.asarray(np.sqrt(0.5 * (xx + yy + np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy))))
