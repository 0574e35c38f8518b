"""Sound messages of every input, as a ship's sensors, a console and a current meter send them."""

from __future__ import annotations

import math

from rope_twin.effects.current import CurrentParams
from rope_twin.errors import InputError, phrase
from rope_twin.recording.heave_replay import HeaveSample
from rope_twin.run.inputs import FIRST_NS, open_sea
from rope_twin.scene.schema import Scene
from rope_twin.studies.faults.injection import CURRENT, HEAVE, ODOMETRY, SECOND_NS, Message
from rope_twin.studies.faults.injection import WINCH as WINCH_TOPIC
from rope_twin.twin.motion.ship_pose import ShipPose
from rope_twin.twin.winch.commands import SPEED, WinchCommand

LATENCY_NS = 10_000_000  # from a stamp to the arrival of its message
PITCH_RAD, PITCH_PERIOD_S = math.radians(2.0), 8.0  # of a ship whose sea is known by heave alone
SPEEDS_M_PER_S = (0.0, 0.4, 0.0, -0.4)  # of the winch, each for SPEED_FOR_S
SPEED_FOR_S = 6.0
PROFILE = ((0.0, 0.5, 0.1), (-100.0, 0.3, 0.1), (-1000.0, 0.1, 0.0))  # z [m], east, north [m/s]
COMMAND_NS, PROFILE_NS = SECOND_NS // 10, SECOND_NS


def motion(scene: Scene, until_s: float, posed: bool) -> list[Message]:
    """Return the ship's motion in the scene's sea, as heave or as odometry.

    Raises:
        InputError: the scene's ship lies still.
    """
    sea = open_sea(scene)
    if sea is None:
        what, right = "its ship lies still", "name a scene with a sea"
        raise InputError(phrase(f"scene {scene.name}", what, right))
    samples = sea.between(FIRST_NS, round(until_s * SECOND_NS))
    if posed:
        poses = [one.pose or _pitched(one) for one in samples]
        return [Message(ODOMETRY, one.stamp_ns + LATENCY_NS, one.stamp_ns, one) for one in poses]
    return [
        Message(HEAVE, one.stamp_ns + LATENCY_NS, one.stamp_ns,
                (one.position_m, one.velocity_m_per_s))
        for one in samples
    ]  # fmt: skip


def _pitched(sample: HeaveSample) -> ShipPose:
    """Return the heave of a ship that pitches about its reference point as well."""
    omega = 2.0 * math.pi / PITCH_PERIOD_S
    phase = omega * sample.stamp_ns * 1e-9
    angle, rate = PITCH_RAD * math.sin(phase), PITCH_RAD * omega * math.cos(phase)
    w = sample.velocity_m_per_s
    return ShipPose(
        stamp_ns=sample.stamp_ns,
        position_m=(0.0, 0.0, sample.position_m),
        # The twist is in the turned axes: R(angle) about y, transposed, times (0, 0, w).
        velocity_m_per_s=(-w * math.sin(angle), 0.0, w * math.cos(angle)),
        orientation=(0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)),
        rate_rad_per_s=(0.0, rate, 0.0),
    )


def commands(scene: Scene, until_s: float) -> list[Message]:
    """Return speed commands at 10 Hz; nothing where the scene has no winch of that name."""
    if scene.winch is None:
        return []
    stamps = range(0, round(until_s * SECOND_NS), COMMAND_NS)
    found = []
    for stamp_ns in stamps:
        turn = int(stamp_ns * 1e-9 / SPEED_FOR_S) % len(SPEEDS_M_PER_S)
        order = WinchCommand(SPEED, SPEEDS_M_PER_S[turn])
        found.append(Message(WINCH_TOPIC, stamp_ns + LATENCY_NS, stamp_ns, order, "console"))
    return found


def profiles(scene: Scene, until_s: float) -> list[Message]:
    """Return a current profile every second; nothing where the scene lists no current."""
    if not any(isinstance(params, CurrentParams) for params in scene.effects):
        return []
    stamps = range(0, round(until_s * SECOND_NS), PROFILE_NS)
    return [Message(CURRENT, stamp + LATENCY_NS, stamp, PROFILE, "meter") for stamp in stamps]
