"""Range in which a scene's model holds, against the present of a run: what lies outside it, if any.

Each finding has a value for the validity of the quality index (twin/quality.py) and says in words
what the model does not contain. The scene's own warnings stand for the whole run, unless the scene
accepts them; all else is judged at snapshots. Nothing here acts on the twin.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from rope_twin.effects.current import profile_of
from rope_twin.effects.line_contact import LineContactParams
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.scene.schema import Scene
from rope_twin.scene.shapes import payload_figures
from rope_twin.scene.validation.rigging import is_joined
from rope_twin.scene.warnings.rope import validity_warnings
from rope_twin.scene.warnings.water import is_air
from rope_twin.twin.snapshot import Snapshot

LINE_FOLLOWING = "line_following"  # input of a winch that follows its measured line
DOUBTED, OUTSIDE = 0.6, 0.5  # values: an error of unknown size, and one that must be expected
PENETRATION_M = 0.5, 2.0  # of a payload in an elastic bed: from 1 to 0
LINE_TOL_M = 0.5  # of the measured line out beyond the winch's range
SPEED_TOL = 1.1  # of the measured line speed over the winch's limit
HELD_M_PER_S, HELD_SHARE = 0.25, 0.1  # of a current below its last row, and of the depth
PRIOR_SDS = 3.0  # of a learned figure from the scene's


class Finding(NamedTuple):
    """Reason for leaving the model's range, and how far results may be relied on there, 0 to 1."""

    value: float
    reason: str


def falling(value: float, good: float, bad: float) -> float:
    """Return 1 up to `good`, 0 from `bad` on, and linear between them."""
    return min(1.0, max(0.0, (bad - value) / (bad - good)))


class ModelRange:
    """Range of one scene's model; it has no state."""

    def __init__(self, scene: Scene) -> None:
        """Read the scene.

        Raises:
            SceneError: the payload's properties are incomplete.
        """
        self._standing = _standing(scene)
        self._winch = scene.winch
        self._surfacing = _half_heights(scene)
        waves, bed = scene.listed(WavesParams), scene.listed(SeabedParams)
        self._water_m = waves.depth_m if waves is not None and bed is None else None
        self._touching = scene.listed(LineContactParams) is not None
        self._prior = scene.learning

    def outside(
        self, shot: Snapshot, effects: tuple[Any, ...], factors: Mapping[str, float]
    ) -> Iterator[Finding]:
        """Yield what is outside the range.

        effects: kernel data of the first rope's, in use now; factors: learned ones, on the scene's
        figures.
        """
        yield from self._standing
        yield from self._at_the_surface(shot)
        yield from self._below_the_bed(shot)
        yield from self._beyond_the_winch(shot)
        yield from _below_the_profile(shot, effects)
        if shot.lines is not None and shot.lines.crossings and not self._touching:
            at_m = shot.lines.crossings[0].depth_m
            words = f"the lines cross at {at_m:.0f} m; contact between them is not modelled"
            yield Finding(DOUBTED, words)
        for name, factor in factors.items():
            spread = 0.01 * getattr(self._prior, f"{name}_pct", math.inf)
            if abs(math.log(factor)) > PRIOR_SDS * spread:
                words = f"the learned {name.replace('_', ' ')} is {factor:.3g} times the scene's"
                yield Finding(DOUBTED, f"{words}: another lift than the one prepared")

    def _at_the_surface(self, shot: Snapshot) -> Iterator[Finding]:
        if not self._surfacing:
            return
        places = {one.name: one.position_m for one in shot.payloads}
        for name, half_m in self._surfacing.items():
            z = float(places.get(name, shot.payload_position_m)[2])
            if z > -half_m:
                words = f"payload '{name}' is at the surface, z = {z:.1f} m, without `splash_zone`"
                yield Finding(OUTSIDE, words)

    def _below_the_bed(self, shot: Snapshot) -> Iterator[Finding]:
        depth_m = -float(shot.payload_position_m[2])
        if self._water_m is not None and depth_m > self._water_m:
            yield Finding(
                0.0, f"the payload is at {depth_m:.1f} m in water {self._water_m:g} m deep"
            )
        if shot.seabed is None:
            return
        sunk_m = -shot.seabed.payload_height_m
        if sunk_m > PENETRATION_M[0]:
            words = f"the payload is {sunk_m:.1f} m in the seabed, whose model is elastic"
            yield Finding(falling(sunk_m, *PENETRATION_M), words)
        bed_m = depth_m + shot.seabed.payload_height_m
        for one in shot.residuals:
            beyond_m = one.measured - bed_m - (one.half_width or 0.0)
            if one.quantity == "payload_depth_m" and beyond_m > PENETRATION_M[0]:
                words = f"the measured depth, {one.measured:.1f} m, is below the scene's seabed"
                yield Finding(OUTSIDE, f"{words} at {bed_m:.1f} m")

    def _beyond_the_winch(self, shot: Snapshot) -> Iterator[Finding]:
        """Check the line that a winch follows; one that is commanded stays within its limits."""
        winch = self._winch
        if winch is None or shot.cut is not None or LINE_FOLLOWING not in shot.inputs:
            return
        low_m, high_m = winch.least_line_out_m - LINE_TOL_M, winch.most_line_out_m + LINE_TOL_M
        if not low_m <= shot.line_out_m <= high_m:
            words = f"line out of {shot.line_out_m:.1f} m, the scene's winch has "
            words += f"{winch.least_line_out_m:g} to {winch.most_line_out_m:g} m"
            yield Finding(DOUBTED, words)
        speed = abs(shot.payout_speed_m_per_s)
        if speed > SPEED_TOL * winch.speed_limit_m_per_s:
            words = f"line speed of {speed:.2f} m/s, the scene's winch has at most "
            yield Finding(DOUBTED, f"{words}{winch.speed_limit_m_per_s:g} m/s")


def _below_the_profile(shot: Snapshot, effects: tuple[Any, ...]) -> Iterator[Finding]:
    """Check whether a current from a sensor ends far above the payload, and not at rest."""
    heard, profile = shot.inputs.get("current"), profile_of(effects)
    if heard is None or not heard.accepted or profile is None:
        return
    last_m, end_m = float(profile.z[0]), float(shot.payload_position_m[2])
    speed = float(np.hypot(*(row[0] for row in profile.U[:2])))
    if speed > HELD_M_PER_S and last_m - end_m > -HELD_SHARE * end_m > 0.0:
        words = f"the current ends at z = {last_m:g} m with {speed:.2f} m/s, which is used down to "
        yield Finding(DOUBTED, f"{words}the payload at z = {end_m:.0f} m")


@functools.lru_cache(maxsize=8)
def _standing(scene: Scene) -> tuple[Finding, ...]:
    """Return a finding for each warning of the scene on what its model does not contain."""
    return tuple(
        Finding(DOUBTED, f"the scene warns: {words.removesuffix('.')}")
        for words in validity_warnings(scene)
    )


def _half_heights(scene: Scene) -> dict[str, float]:
    """Return half the height of each payload whose way through the surface is not modelled [m].

    It is that of a cube of the same volume. Empty: it is modelled, or there is no water.
    """
    modelled = any(isinstance(e, SplashZoneParams | RigidBodyParams) for e in scene.effects)
    if modelled or is_air(scene):
        return {}
    if is_joined(scene):
        own = [one for one in scene.payloads if one.splash_zone is None]
    else:
        own = list(scene.payloads[:1])
    density = scene.environment.water_density_kg_per_m3
    return {one.name: 0.5 * payload_figures(one, density).volume_m3 ** (1.0 / 3.0) for one in own}
