"""Rules for the motion of a scene's ship: a record, a sine, or waves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import pi
from pathlib import Path

from rope_twin.effects.waves import WavesParams
from rope_twin.errors import did_you_mean
from rope_twin.scene.rules.fault import Fault
from rope_twin.scene.schema import Scene
from rope_twin.sea.spectrum import WaveSpectrum, jonswap
from rope_twin.sea.steepness import breaking_fault
from rope_twin.sea.way import FASTEST_M_PER_S
from rope_twin.share import share_dir


def bag_path(scene: Scene) -> Path | None:
    """Return the path of a scene's bag (existing or not); None without a bag."""
    poses = scene.sea_state.poses
    bag = scene.sea_state.bag or (poses.bag if poses else "")
    if not bag:
        return None
    if is_path(bag):
        return scene.path.parent / bag
    return share_dir() / "bags" / bag


def is_path(bag: str) -> bool:
    """Return whether a bag is given by a path instead of a name in bags/."""
    return "/" in bag or bag.startswith(".") or bag.endswith(".mcap")


def _bag(scene: Scene) -> Iterator[Fault]:
    path, sea = bag_path(scene), scene.sea_state
    if path is None or path.is_dir() or path.is_file():
        return
    where, bag = "sea_state.bag", sea.bag
    if sea.poses is not None and not bag:
        where, bag = "sea_state.poses.bag", sea.poses.bag
    if is_path(bag):
        yield where, f"there is no bag at {path}", "give a bag's folder or .mcap file"
        return
    known = [folder.name for folder in path.parent.glob("*") if folder.is_dir()]
    right = did_you_mean(bag, known) if known else "give the path of a bag"
    yield where, f"there is no bag '{bag}' in bags/", right


def _regular_heave(scene: Scene) -> Iterator[Fault]:
    sea = scene.sea_state
    if sea.heave is None:
        return
    if sea.bag:
        what = f"both `bag` ('{sea.bag}') and `heave` are given"
        yield "sea_state", what, "keep the record or the sine"
    if not sea.loop:
        right = "remove `loop`, it is for bags"
        yield "sea_state.loop", "a regular heave has no end", right
    fastest = 2.0 * pi * sea.heave.amplitude_m / sea.heave.period_s
    if fastest > FASTEST_M_PER_S:
        what = f"it moves the ship at up to {fastest:.1f} m/s"
        right = f"plausible is {FASTEST_M_PER_S:g} m/s: lower it, or lengthen its period"
        yield "sea_state.heave", what, right
        return
    omega = 2.0 * pi / sea.heave.period_s
    needed = {
        "max_heave_m": sea.heave.amplitude_m,
        "max_hang_off_speed_m_per_s": fastest,
        "max_hang_off_acceleration_m_per_s2": omega * fastest,
    }
    for key, least in needed.items():
        limit = getattr(scene.ship, key)
        if least > limit:
            what = f"it is {limit:g}, and `sea_state.heave` needs {least:.2f}"
            yield f"ship.{key}", what, "raise it, or lower the heave"


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
        right = "remove `start_s` and `loop`, they are for records"
        yield "sea_state", "waves start with the scene and have no end", right
    if waves.ramp_s != scene.ship.motion_ramp_s:
        what = (
            f"the sea builds up in {waves.ramp_s:g} s, the ship in {scene.ship.motion_ramp_s:g} s"
        )
        yield "ship.motion_ramp_s", what, "give `ramp_s` of `waves` the same value"


def spectrum_of(waves: WavesParams) -> WaveSpectrum | None:
    """Return the spectrum of the scene's sea state; None for a regular wave.

    Raises:
        InputError: it cannot be read.
    """
    if waves.jonswap is not None:
        sea = waves.jonswap
        return jonswap(sea.significant_height_m, sea.peak_period_s, sea.gamma)
    return None if waves.measured is None else waves.measured.spectrum()


def _breaking_sea(scene: Scene) -> Iterator[Fault]:
    waves = scene.listed(WavesParams)
    spectrum = None if waves is None else spectrum_of(waves)
    if waves is None or spectrum is None:
        return
    fault = breaking_fault(spectrum, scene.environment.gravity_m_per_s2)
    if fault is not None:
        yield "effects.waves", *fault


SEA_RULES: tuple[Callable[[Scene], Iterator[Fault]], ...] = (
    _bag,
    _regular_heave,
    _on_waves,
    _breaking_sea,
)
