"""Rules between a scene and the water: seabed, surface and spectrum."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rope_twin.effects.current import CurrentParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.scene.rules.fault import Fault
from rope_twin.scene.schema import Scene

# A frequency step of a spectrum is a gap when it is this many times both adjacent steps: one
# missing row doubles it; the first and the last have only one adjacent step.
GAP, GAP_AT_AN_END = 1.8, 3.0
BURIED_M = 1.0  # accepted depth of a buried anchor
# Requirements on a current profile, from a scene or from a sensor:
MIN_ROW_SPACING_M = 0.01
SHEAR_LIMIT_PER_S = 100.0  # [m/s per m]: 1 m/s within the minimum row spacing
DEEPEST_ROW_M = -12e3


def bed_at(bed: SeabedParams, x: float, y: float) -> float:
    """Return the elevation of the seabed [m]; for soundings as in effects/seabed.py."""
    told = bed.soundings
    if told is not None:
        return -float(np.interp(y, told.y_m, [np.interp(x, told.x_m, row) for row in told.depth_m]))
    assert bed.depth_m is not None, "checked when the scene was read"
    return -bed.depth_m + bed.slope[0] * x + bed.slope[1] * y


def bed_of(scene: Scene) -> SeabedParams | None:
    """Return the scene's seabed, or None."""
    return scene.listed(SeabedParams)


def steepest_shear(profile: NDArray[np.float64]) -> tuple[float, int]:
    """Return the largest shear [1/s] of rows z, east, north (rows, 3), and its upper row."""
    if len(profile) < 2:
        return 0.0, 0
    step = np.diff(profile, axis=0)
    shear = np.hypot(step[:, 1], step[:, 2]) / np.abs(step[:, 0])
    return float(shear.max()), int(shear.argmax())


def _current(scene: Scene) -> Iterator[Fault]:
    """Rows of a current profile are far enough apart for a finite shear."""
    current = scene.listed(CurrentParams)
    if current is None or len(current.profile) < 2:
        return
    rows = np.array([[z, *velocity] for z, velocity in current.profile], dtype=float)
    spacing = -np.diff(rows[:, 0])
    shear, steepest = steepest_shear(rows)
    if spacing.min() < MIN_ROW_SPACING_M:
        row = int(spacing.argmin())
        what = f"rows {row} and {row + 1} of the current are {spacing[row]:g} m apart"
        yield "effects", what, f"give rows at least {MIN_ROW_SPACING_M:g} m apart, or `layers`"
    elif shear > SHEAR_LIMIT_PER_S:
        what = f"the current changes by {shear:.3g} m/s a metre below row {steepest}"
        yield "effects", what, f"give at most {SHEAR_LIMIT_PER_S:g} m/s a metre, or `layers`"


def _held_sheaves(scene: Scene) -> Iterator[Fault]:
    """A sheave's tether is fixed between surface and seabed."""
    bed = bed_of(scene)
    for number, sheave in enumerate(scene.sheaves):
        if sheave.tether is None:
            continue
        x, y, z = sheave.tether.at_m
        path = f"sheaves[{number}].tether.at_m"
        if z > 0.0:
            what = f"'{sheave.name}' is held {z:g} m above the water"
            yield path, what, "a lower sheave is held below water: give a negative z"
        elif bed is not None and z < bed_at(bed, x, y):
            low = bed_at(bed, x, y)
            what = f"'{sheave.name}' is held at z = {z:g} m, below the seabed at {low:g} m"
            yield path, what, "hold it at the seabed or above, or deepen `seabed`"


def _held_ends(scene: Scene) -> Iterator[Fault]:
    """A rope's fixed end is not below the seabed."""
    bed = bed_of(scene)
    for number, line in enumerate(scene.ropes):
        if bed is None or line.fixed_at_m is None:
            continue
        x, y, z = line.fixed_at_m
        low = bed_at(bed, x, y)
        if z < low - BURIED_M:
            what = f"the lower end is fixed at z = {z:g} m, below the seabed at {low:g} m"
            right = "fix it at the seabed or above, or deepen `seabed`"
            yield f"ropes[{number}].fixed_at_m", what, right


def _spectrum(scene: Scene) -> Iterator[Fault]:
    """A measured spectrum has no gap, which would be interpolated linearly."""
    waves = scene.listed(WavesParams)
    if waves is None or waves.measured is None:
        return
    frequency = waves.measured.spectrum().frequency_hz.tolist()
    steps = [high - low for low, high in pairwise(frequency)]
    for k, step in enumerate(steps):
        beside = [steps[j] for j in (k - 1, k + 1) if 0 <= j < len(steps)]
        most = GAP if len(beside) == 2 else GAP_AT_AN_END
        if beside and step > most * max(beside):
            what = (
                f"the spectrum has a gap from {frequency[k]:g} to {frequency[k + 1]:g} Hz, "
                f"among steps of {max(beside):.3g} Hz"
            )
            yield "effects", what, "add the rows in between, with 0 where there is no energy"
            return


WATER_RULES: tuple[Callable[[Scene], Iterator[Fault]], ...] = (
    _held_sheaves,
    _held_ends,
    _spectrum,
    _current,
)
