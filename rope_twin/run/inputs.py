"""What moves the ship in a run, chosen in one place for every runner.

With the winch schedule (`rope_twin.twin.winch.schedule`) this is all that a run feeds to its
twin, with the same stamps whether it is paced over ROS or not.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

from rope_twin.errors import InputError, RopeTwinError, phrase
from rope_twin.messages import encode_heave, encode_pose
from rope_twin.recording.heave_replay import HeaveSample, open_heave
from rope_twin.recording.pose_replay import PoseReplay, open_poses
from rope_twin.recording.regular_heave import RegularSea
from rope_twin.recording.ship_sea import ShipOnWaves, WayOfHangOff, open_way
from rope_twin.recording.wave_sea import sea_of_waves
from rope_twin.scene.schema import Scene
from rope_twin.scene.sea_state import RecordedPoses
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.motion.heave_series import HeaveSeries
from rope_twin.twin.twin import Twin

FIRST_NS = -100_000_000  # samples begin this early, so that t = 0 lies between two of them
LEAD_NS = 200_000_000  # samples are given this long before they are needed


class Sea(Protocol):
    """Where heave comes from, in twin time."""

    source: str  # what it is, in words
    note: str  # what was wrong with it and what is done about it; empty: nothing

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Samples with from_ns <= stamp_ns < to_ns, in order; each stamp once."""

    def is_over(self, from_ns: int) -> bool:
        """Whether there is no sample from a time on."""


def open_sea(
    scene: Scene,
    bag: str = "",
    topic: str = "",
    start_s: float = 0.0,
    loop: bool = True,
    poses: str = "",
) -> Sea | None:
    """What moves the ship: heave of `bag`, poses of `poses`, or the scene's sea; None: nothing.

    `start_s` counts from the scene's own start if it is the scene's sea. A regular heave has no
    end, whatever `loop` says. Where the ship rests in `poses`, the scene's own poses say.

    Raises:
        BagError: one sentence on what is wrong with the bag.
        InputError: a topic is named but there is no bag to look for it in, heave and poses are
            both given, or a table that the scene names is wrong.
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
    """Compare the motion that a twin takes from elsewhere with its scene's own sea.

    For a run that is fed from outside, over topics or from a recording. Without an error of the
    scene's card there is nothing to lose, and the sea is not opened.
    """
    if math.isnan(twin.card_error.rms_pct):
        return
    try:
        twin.expect_motion(open_sea(twin.scene))
    except RopeTwinError as error:
        twin.invalidate_error(f"the scene's own sea cannot be opened: {error}")


def offer(twin: Twin | InputQueue, sample: HeaveSample) -> str:
    """Give a twin one sample; "" or why it was refused."""
    if sample.pose is not None:
        return twin.offer_pose(sample.pose)
    return twin.offer_heave(sample.stamp_ns, sample.position_m, sample.velocity_m_per_s)


def motion_topic(sea: Sea) -> str:
    """The topic that a sea's samples are told in."""
    posed = isinstance(sea, ShipOnWaves | WayOfHangOff | PoseReplay)
    return "ship/odometry" if posed else "ship/heave"


def encode_motion(stamp_ns: int, sample: HeaveSample) -> tuple[str, bytes]:
    """The topic and message that tell of a sample, stamped so."""
    if sample.pose is not None:
        return "ship/odometry", encode_pose(stamp_ns, sample.pose)
    return "ship/heave", encode_heave(stamp_ns, sample.position_m, sample.velocity_m_per_s)


def series_of(samples: list[HeaveSample]) -> HeaveSeries | None:
    """What the samples make of the hang-off, for many steps at once; None if there are none.

    Raises:
        InputError: no ship moves so.
    """
    if not samples:
        return None
    heave = ((one.stamp_ns, one.position_m, one.velocity_m_per_s) for one in samples)
    aside = [one.aside for one in samples if one.aside is not None]
    return HeaveSeries.of(heave, aside)
