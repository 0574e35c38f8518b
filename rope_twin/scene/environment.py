"""Rules of a scene's water, sea state and prescribed ship motion."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import cos, pi, radians, sin
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rope_twin.effects.current import CurrentParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams, WaveSystem
from rope_twin.errors import InputError, did_you_mean
from rope_twin.files import share_dir
from rope_twin.scene.schema import Fault, Rule, Scene, Triple
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.raos import NO_CONVENTIONS, Responses
from rope_twin.sea.ship_motion import FASTEST_M_PER_S, read_time_history
from rope_twin.sea.spectrum import WaveSpectrum, breaking_fault, jonswap
from rope_twin.sea.tables import is_path

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
    soundings = bed.soundings
    if soundings is not None:
        at_x = [np.interp(x, soundings.x_m, row) for row in soundings.depth_m]
        return -float(np.interp(y, soundings.y_m, at_x))
    assert bed.depth_m is not None, "checked when the scene was read"
    return -bed.depth_m + bed.slope[0] * x + bed.slope[1] * y


def steepest_shear(profile: NDArray[np.float64]) -> tuple[float, int]:
    """Return the largest shear [1/s] of rows z, east, north (, up), and its upper row."""
    if len(profile) < 2:
        return 0.0, 0
    step = np.diff(profile, axis=0)
    shear = np.linalg.norm(step[:, 1:], axis=1) / np.abs(step[:, 0])
    return float(shear.max()), int(shear.argmax())


def _current(scene: Scene) -> Iterator[Fault]:
    """Rows of a current profile are far enough apart for a finite shear."""
    current = scene.listed(CurrentParams)
    if current is None or len(current.profile) < 2:
        return
    rows = current.table
    spacing = -np.diff(rows[:, 0])
    shear, steepest = steepest_shear(rows)
    if spacing.min() < MIN_ROW_SPACING_M:
        row = int(spacing.argmin())
        problem = f"rows {row} and {row + 1} of the current are {spacing[row]:g} m apart"
        yield "effects", problem, f"give rows at least {MIN_ROW_SPACING_M:g} m apart, or `layers`"
    elif shear > SHEAR_LIMIT_PER_S:
        problem = f"the current changes by {shear:.3g} m/s a metre below row {steepest}"
        yield "effects", problem, f"give at most {SHEAR_LIMIT_PER_S:g} m/s a metre, or `layers`"


def _held_sheaves(scene: Scene) -> Iterator[Fault]:
    """A sheave's tether is fixed between surface and seabed."""
    bed = scene.listed(SeabedParams)
    for number, sheave in enumerate(scene.sheaves):
        if sheave.tether is None:
            continue
        x, y, z = sheave.tether.at_m
        path = f"sheaves[{number}].tether.at_m"
        if z > 0.0:
            problem = f"'{sheave.name}' is held {z:g} m above the water"
            yield path, problem, "a lower sheave is held below water: give a negative z"
        elif bed is not None and z < bed_at(bed, x, y):
            low = bed_at(bed, x, y)
            problem = f"'{sheave.name}' is held at z = {z:g} m, below the seabed at {low:g} m"
            yield path, problem, "hold it at the seabed or above, or deepen `seabed`"


def _held_ends(scene: Scene) -> Iterator[Fault]:
    """A rope's fixed end is not below the seabed."""
    bed = scene.listed(SeabedParams)
    for number, line in enumerate(scene.ropes):
        if bed is None or line.fixed_at_m is None:
            continue
        x, y, z = line.fixed_at_m
        low = bed_at(bed, x, y)
        if z < low - BURIED_M:
            problem = f"the lower end is fixed at z = {z:g} m, below the seabed at {low:g} m"
            remedy = "fix it at the seabed or above, or deepen `seabed`"
            yield f"ropes[{number}].fixed_at_m", problem, remedy


def _spectrum(scene: Scene) -> Iterator[Fault]:
    """A measured spectrum has no gap, which would be interpolated linearly."""
    waves = scene.listed(WavesParams)
    for where, system in {} if waves is None else waves.systems.items():
        if system.measured is not None:
            yield from _gap(where, system.measured.spectrum())


def _gap(where: str, spectrum: WaveSpectrum) -> Iterator[Fault]:
    """Yield the first gap of a spectrum."""
    frequency = spectrum.frequency_hz.tolist()
    steps = [high - low for low, high in pairwise(frequency)]
    for k, step in enumerate(steps):
        neighbours = [steps[j] for j in (k - 1, k + 1) if 0 <= j < len(steps)]
        limit = GAP if len(neighbours) == 2 else GAP_AT_AN_END
        if neighbours and step > limit * max(neighbours):
            problem = (
                f"the spectrum has a gap from {frequency[k]:g} to {frequency[k + 1]:g} Hz, "
                f"among steps of {max(neighbours):.3g} Hz"
            )
            remedy = "add the rows in between, with 0 where there is no energy"
            yield f"effects.{where}", problem, remedy
            return


def bag_path(scene: Scene) -> Path | None:
    """Return the path of a scene's bag (existing or not); None without a bag."""
    poses = scene.sea_state.poses
    bag = scene.sea_state.bag or (poses.bag if poses else "")
    if not bag:
        return None
    if is_bag_path(bag):
        return scene.path.parent / bag
    return share_dir() / "bags" / bag


def is_bag_path(bag: str) -> bool:
    """Return whether a bag is given by a path instead of a name in bags/."""
    return "/" in bag or bag.startswith(".") or bag.endswith(".mcap")


def _bag(scene: Scene) -> Iterator[Fault]:
    path, sea = bag_path(scene), scene.sea_state
    if path is None or path.is_dir() or path.is_file():
        return
    where, bag = "sea_state.bag", sea.bag
    if sea.poses is not None and not bag:
        where, bag = "sea_state.poses.bag", sea.poses.bag
    if is_bag_path(bag):
        yield where, f"there is no bag at {path}", "give a bag's folder or .mcap file"
        return
    known = [folder.name for folder in path.parent.glob("*") if folder.is_dir()]
    remedy = did_you_mean(bag, known) if known else "give the path of a bag"
    yield where, f"there is no bag '{bag}' in bags/", remedy


def _regular_heave(scene: Scene) -> Iterator[Fault]:
    sea = scene.sea_state
    if sea.heave is None:
        return
    if sea.bag:
        problem = f"both `bag` ('{sea.bag}') and `heave` are given"
        yield "sea_state", problem, "keep the record or the sine"
    if not sea.loop:
        remedy = "remove `loop`, it is for bags"
        yield "sea_state.loop", "a regular heave has no end", remedy
    fastest = 2.0 * pi * sea.heave.amplitude_m / sea.heave.period_s
    if fastest > FASTEST_M_PER_S:
        problem = f"it moves the ship at up to {fastest:.1f} m/s"
        remedy = f"plausible is {FASTEST_M_PER_S:g} m/s: lower it, or lengthen its period"
        yield "sea_state.heave", problem, remedy
        return
    omega = 2.0 * pi / sea.heave.period_s
    needed = {
        "max_heave_m": sea.heave.amplitude_m,
        "max_hang_off_speed_m_per_s": fastest,
        "max_hang_off_acceleration_m_per_s2": omega * fastest,
    }
    for key, smallest in needed.items():
        limit = getattr(scene.ship, key)
        if smallest > limit:
            problem = f"it is {limit:g}, and `sea_state.heave` needs {smallest:.2f}"
            yield f"ship.{key}", problem, "raise it, or lower the heave"


def _on_waves(scene: Scene) -> Iterator[Fault]:
    sea = scene.sea_state
    if sea.on_waves is None:
        return
    waves = scene.listed(WavesParams)
    if waves is None:
        yield "sea_state.on_waves", "`waves` is not listed", "add the effect `waves`"
        return
    if sea.bag or sea.heave is not None or sea.path:
        yield "sea_state", "the ship is moved by waves and by a record", "keep one of them"
    if sea.start_s != 0.0 or not sea.loop:
        remedy = "remove `start_s` and `loop`, they are for records"
        yield "sea_state", "waves start with the scene and have no end", remedy
    if waves.ramp_s != scene.ship.motion_ramp_s:
        problem = (
            f"the sea builds up in {waves.ramp_s:g} s, the ship in {scene.ship.motion_ramp_s:g} s"
        )
        yield "ship.motion_ramp_s", problem, "give `ramp_s` of `waves` the same value"


def spectrum_of(waves: WaveSystem) -> WaveSpectrum | None:
    """Return the spectrum of a wave system; None for a regular wave.

    Raises:
        InputError: it cannot be read.
    """
    if waves.jonswap is not None:
        sea = waves.jonswap
        return jonswap(sea.significant_height_m, sea.peak_period_s, sea.gamma)
    return None if waves.measured is None else waves.measured.spectrum()


def _breaking_sea(scene: Scene) -> Iterator[Fault]:
    waves = scene.listed(WavesParams)
    for where, system in {} if waves is None else waves.systems.items():
        spectrum = spectrum_of(system)
        if spectrum is None:
            continue
        fault = breaking_fault(spectrum, scene.environment.gravity_m_per_s2)
        if fault is not None:
            yield f"effects.{where}", *fault


def beside(scene: Scene, name_or_path: str) -> str:
    """Return a table's name as is, or the absolute path of one relative to the scene's file."""
    if not is_path(name_or_path):
        return name_or_path
    return str((scene.path.parent / name_or_path).resolve())


def _way(scene: Scene) -> Iterator[Fault]:
    sea = scene.sea_state
    if not sea.path:
        return
    if sea.bag or sea.heave is not None:
        yield "sea_state", "the hang-off has a prescribed motion and a record", "keep one of them"
    if not sea.loop:
        yield "sea_state.loop", "a prescribed motion ends with its table", "remove `loop`"
    try:
        history = read_time_history(beside(scene, sea.path))
    except InputError as error:
        yield "sea_state.path", *_halves(error)
        return
    if sea.start_s >= history.end_s:
        problem = f"the prescribed motion of {history.end_s:g} s has ended by then"
        yield "sea_state.start_s", problem, "start earlier"


def _poses(scene: Scene) -> Iterator[Fault]:
    sea = scene.sea_state
    if sea.poses is None:
        return
    if not sea.poses.bag.strip():
        yield "sea_state.poses.bag", "it is empty", "name a bag, or remove `poses`"
    if sea.bag or sea.path or sea.heave is not None or sea.on_waves is not None:
        yield "sea_state", "recorded poses and another motion are given", "keep one of them"


def _responses(scene: Scene) -> Iterator[Fault]:
    riding = scene.sea_state.on_waves
    if riding is None:
        return
    where = "sea_state.on_waves"
    if not riding.responses:
        if riding.heading_deg != 0.0:
            remedy = "give `responses`, or remove `heading_deg`"
            yield where, "a box hull is in head seas at any heading", remedy
        if riding.crane_tip_m is not None or riding.conventions != NO_CONVENTIONS:
            remedy = "give `responses`, or remove them"
            yield where, "`crane_tip_m` and `conventions` are those of an RAO file", remedy
        return
    try:
        table = vessel_raos(scene)
    except InputError as error:
        yield f"{where}.responses", *_halves(error)
        return
    assert table is not None, "its file is named"
    if riding.crane_tip_m is not None:
        if scene.ship.reference_m is not None:
            problem = "both `crane_tip_m` and `ship.reference_m` are given"
            yield where, problem, "keep `crane_tip_m` for a file with an origin"
        if table.origin_m is None:
            problem = "the table does not state the point that its RAOs are for"
            remedy = "give `conventions: {origin_m: [x, y, z]}`, or `ship.reference_m` alone"
            yield f"{where}.crane_tip_m", problem, remedy
    elif table.origin_m is not None and scene.ship.reference_m is None:
        x, y, z = table.origin_m
        problem = f"its RAOs are those of the point [{x:g}, {y:g}, {z:g}] m of the vessel"
        remedy = "give `crane_tip_m`, the hang-off in the same axes"
        yield where, problem, remedy


def vessel_raos(scene: Scene) -> Responses | None:
    """Return the RAOs that a scene's ship moves by; None if it has no table of them.

    Raises:
        InputError: the file is invalid.
    """
    riding = scene.sea_state.on_waves
    if riding is None or not riding.responses:
        return None
    return read_responses(beside(scene, riding.responses), riding.conventions)


def reference_point_m(scene: Scene) -> Triple:
    """Return the mean position of the point that poses and RAOs are for: x, y, z.

    With `crane_tip_m` it follows from the hang-off, the RAO file's own origin and the heading of
    the bow; else it is `ship.reference_m`, or the hang-off.

    Raises:
        InputError: the RAO file is invalid.
    """
    riding, hang_off_m = scene.sea_state.on_waves, scene.ship.hang_off_m
    if riding is None or riding.crane_tip_m is None:
        return scene.ship.reference_m or hang_off_m
    table = vessel_raos(scene)
    assert table is not None, "its file is named"
    assert table.origin_m is not None, "checked when the scene was read"
    x, y, z = (tip - own for tip, own in zip(riding.crane_tip_m, table.origin_m, strict=True))
    c, s = cos(radians(riding.heading_deg)), sin(radians(riding.heading_deg))
    return hang_off_m[0] - (c * x - s * y), hang_off_m[1] - (s * x + c * y), hang_off_m[2] - z


def _halves(error: InputError) -> tuple[str, str]:
    """Return fault and remedy of an error's sentence, without its full stop."""
    problem, _, remedy = str(error).removesuffix(".").rpartition("; ")
    return problem, remedy


ENVIRONMENT_RULES: tuple[Rule, ...] = (
    _bag,
    _regular_heave,
    _on_waves,
    _breaking_sea,
    _way,
    _poses,
    _responses,
    _held_sheaves,
    _held_ends,
    _spectrum,
    _current,
)
