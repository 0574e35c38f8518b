"""Ship motion of a run: selection of its source, the same for every runner.

Together with the winch schedule (`rope_twin.twin.winch.commands`) this is all input of a run.
The stamps are the same in a real-time run over ROS and in an unpaced one.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

from rope_twin.errors import InputError, RopeTwinError, phrase
from rope_twin.messages import encode_heave, encode_pose
from rope_twin.recording.heave import HeaveSample, RegularSea, open_heave
from rope_twin.recording.poses import PoseReplay, open_poses
from rope_twin.recording.ship_sea import ShipOnWaves, WayOfHangOff, open_way, sea_of_waves
from rope_twin.scene.schema import RecordedPoses, Scene
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.motion.heave_series import HeaveSeries
from rope_twin.twin.twin import Twin

FIRST_NS = -100_000_000  # samples begin this early, so that t = 0 lies between two of them
LEAD_NS = 200_000_000  # samples are passed to the twin this long before they are needed


class Sea(Protocol):
    """Source of ship motion, in simulation time."""

    source: str  # description
    note: str  # fault of the source and how it is handled; empty: none

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return the samples with from_ns <= stamp_ns < to_ns, in order; each stamp once."""

    def is_over(self, from_ns: int) -> bool:
        """Return whether there is no sample from a time on."""


def open_sea(
    scene: Scene,
    bag: str = "",
    topic: str = "",
    start_s: float = 0.0,
    loop: bool = True,
    poses: str = "",
) -> Sea | None:
    """Return the ship motion: heave of `bag`, poses of `poses`, or the scene's sea; None: none.

    `start_s` counts from the scene's own start if it is the scene's sea. A regular heave has no
    end, whatever `loop` is. The ship's still-water position in `poses` is taken from the scene's
    own poses.

    Raises:
        BagError: the bag cannot be used; one sentence.
        InputError: a topic is named without a bag, heave and poses are both given, or a table that
            the scene names is invalid.
    """
    if bag and poses:
        right = "give heave or poses of the ship, not both"
        raise InputError(phrase(f"bag {bag}", f"poses of {poses} are named too", right))
    if bag:
        return open_heave(bag, topic or None, start_s, loop)
    sea = scene.sea_state
    if poses:
        named = replace(sea.poses or RecordedPoses(bag=poses), bag=poses, topic=topic)
        return open_poses(scene, named, start_s, loop)
    if sea.poses is not None:
        named = replace(sea.poses, topic=topic or sea.poses.topic)
        return open_poses(scene, named, sea.start_s + start_s, loop and sea.loop)
    if sea.bag:
        return open_heave(sea.bag, topic or None, sea.start_s + start_s, loop and sea.loop)
    if topic:
        what = f"scene {scene.name} has no bag to look for it in"
        raise InputError(phrase(f"topic '{topic}'", what, "name a bag too, or leave the topic out"))
    if sea.path:
        return open_way(scene, start_s)
    if sea.heave is not None:
        return RegularSea(sea.heave, sea.start_s + start_s)
    return sea_of_waves(scene)


def expect_own_sea(twin: Twin) -> None:
    """Compare the motion input of a twin with its scene's own sea.

    For a run with input from topics or a recording. If the scene's convergence study gives no
    error, there is nothing to invalidate, and the sea is not opened.
    """
    if math.isnan(twin.card_error.rms_pct):
        return
    try:
        twin.inputs.expect_motion(open_sea(twin.scene))
    except RopeTwinError as error:
        twin.invalidate_error(f"the scene's own sea cannot be opened: {error}")


def offer(twin: Twin | InputQueue, sample: HeaveSample) -> str:
    """Pass one sample to a twin; return why it was rejected, or ""."""
    if sample.pose is not None:
        return twin.offer_pose(sample.pose)
    return twin.offer_heave(sample.stamp_ns, sample.position_m, sample.velocity_m_per_s)


def motion_topic(sea: Sea) -> str:
    """Return the topic that a sea's samples are published on."""
    posed = isinstance(sea, ShipOnWaves | WayOfHangOff | PoseReplay)
    return "ship/odometry" if posed else "ship/heave"


def encode_motion(stamp_ns: int, sample: HeaveSample) -> tuple[str, bytes]:
    """Return topic and message of a sample with this stamp."""
    if sample.pose is not None:
        return "ship/odometry", encode_pose(stamp_ns, sample.pose)
    return "ship/heave", encode_heave(stamp_ns, sample.position_m, sample.velocity_m_per_s)


def series_of(samples: list[HeaveSample]) -> HeaveSeries | None:
    """Return the hang-off motion of the samples, for many steps at once; None if there are none.

    Raises:
        InputError: the motion is implausible for a ship.
    """
    if not samples:
        return None
    heave = ((one.stamp_ns, one.position_m, one.velocity_m_per_s) for one in samples)
    aside = [one.aside for one in samples if one.aside is not None]
    return HeaveSeries.of(heave, aside)
