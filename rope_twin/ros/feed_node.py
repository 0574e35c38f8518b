"""Feed node: publishes what instruments send, and reports in diagnostics what it refused.

Each instrument is read by a thread of its own, which stamps bytes at their arrival; the node turns
them into messages within `_POLL_S`. FeedSimulator does the reverse: it sends the winch and the ship
of a running simulation as lines of the same instruments.
"""

from __future__ import annotations

import heapq
import math
import queue
import sys
import time
from collections import Counter
from functools import partial
from typing import Any

from rope_twin.errors import InputError, counted
from rope_twin.feeds.configuration import FeedSettings, read_settings, with_source
from rope_twin.feeds.instrument import Instrument, LineSample, MotionSample, Sample
from rope_twin.feeds.line_faults import (
    FaultySink,
    LineFaults,
    read_faults,
    replay_with_faults,
    with_faults,
)
from rope_twin.feeds.motion_track import HeaveOutput, MotionOutput, MotionTrack, motion_of_pose
from rope_twin.feeds.transports import Sink, Source, hand_over, open_sink, open_source
from rope_twin.feeds.writers import writer
from rope_twin.messages import (
    Level,
    Status,
    decode,
    encode_diagnostics,
    encode_heave,
    encode_measurement,
    encode_pose,
)
from rope_twin.messages.templates import nanoseconds, xyz
from rope_twin.quantity import or_none
from rope_twin.ros.entry import SuiteNode, run_node
from rope_twin.ros.params import FeedParams, declare
from rope_twin.ros.qos import listen, publish
from rope_twin.topics import BY_NAME, MOTOR_TENSION, WINCH_MEASURED
from rope_twin.twin.motion.ship_motion import ShipPose, pose_fault
from rope_twin.twin.readings import Measurement

_POLL_S = 0.005
_DIAGNOSTICS_S = 1.0
_WAITING = 10_000  # pieces of bytes that may wait for the node
_STALE_NS = 100_000_000
_RECENT_S = 60.0  # for so long after a refused line the row is WARN


class _Channel:
    """One instrument with its source, and the pieces of bytes that wait for the node."""

    def __init__(
        self,
        name: str,
        settings: FeedSettings,
        speed: float,
        start_ns: int,
        faults: LineFaults,
        number: int,
    ) -> None:
        self.name, self.settings = name, settings
        self.instrument = Instrument(settings)
        self.track = MotionTrack(settings)
        take = replay_with_faults(self._put, faults, settings, number)
        self.source: Source = open_source(settings, take, speed, start_ns)
        self.sink: Sink | None = open_sink(settings.forward) if settings.forward else None
        self._pieces: queue.Queue[tuple[bytes, int, bool]] = queue.Queue(_WAITING)
        self.lost = 0
        self.heard_s = time.monotonic()
        self.refused_s, self._refused = -math.inf, 0

    def _put(self, data: bytes, arrival_ns: int, is_complete: bool) -> None:
        if self.sink is not None:
            self.sink.send(data)
        if not hand_over(self._pieces, (data, arrival_ns, is_complete), self.source):
            self.lost += not self.source.closing

    @property
    def ended(self) -> bool:
        """Return whether a file has come to its end, with nothing left to be published."""
        return self.source.ended and self._pieces.empty()

    def samples(self) -> list[Sample]:
        """Return the samples of everything that has arrived until now."""
        samples: list[Sample] = []
        for _ in range(self._pieces.qsize()):  # not until it is empty: a fast file refills it
            samples += self.instrument.take(*self._pieces.get_nowait())
        now_s = time.monotonic()
        if samples:
            self.heard_s = now_s
        if self.instrument.counts.refused_total > self._refused:
            self._refused, self.refused_s = self.instrument.counts.refused_total, now_s
        return samples

    def status(self) -> Status:
        """Return the diagnostics row of the feed."""
        title, counts, now_s = f"feed: {self.name}", self.instrument.counts, time.monotonic()
        values = {
            "lines": str(counts.lines),
            "accepted": str(counts.accepted),
            "of other sentences": str(counts.others),
            "refused": str(counts.refused_total),
            **{f"refused: {reason}": str(count) for reason, count in counts.refused.most_common()},
            "lost by this node": str(self.lost),  # pieces of bytes that it was too late for
            # samples of motion that came with their successor, which replaced them
            "held up on the way": str(self.track.replaced),
            "holes": str(counts.holes),
            "longest hole [s]": f"{counts.longest_hole_s:.1f}",
        }
        if self.source.fault:
            return Status(title, Level.ERROR, f"no connection: {self.source.fault}", values)
        silent_s = now_s - self.heard_s
        if silent_s > self.settings.silent_after_s:
            words = "no valid line yet" if not counts.accepted else f"silent for {silent_s:.0f} s"
            if counts.last_fault and not counts.accepted:
                words += f"; last one refused: {counts.last_fault}"
            return Status(title, Level.ERROR, words, values)
        accepted = f"{counted(counts.accepted, 'line')} accepted"
        if now_s - self.refused_s < _RECENT_S:
            words = f"{counts.refused_total} refused, the last one: {counts.last_fault}"
            return Status(title, Level.WARN, f"{accepted}; {words}", values)
        if doubt := self.track.heading_doubt:
            return Status(title, Level.WARN, f"{accepted}; {doubt}", values)
        return Status(title, Level.OK, accepted, values)

    def close(self) -> None:
        """Stop reading; may be called twice."""
        self.source.close()
        if self.sink is not None:
            self.sink.close()


class FeedNode(SuiteNode):
    """Publishes the measurements of all instruments of a settings file."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("feed", **node_options)
        self._params = declare(self, FeedParams)
        self._channels: list[_Channel] = []
        self._own_publishers: dict[str, Any] = {}
        self._diagnostics = publish(self, BY_NAME["diagnostics"])
        self._logged: dict[str, tuple[Level, str, str]] = {}  # of the last warnings
        self._began_s = time.monotonic()

    @property
    def finished(self) -> bool:
        """Return whether all files have ended, or the time is over."""
        stop_s = self._params.stop_after_s
        if stop_s and time.monotonic() - self._began_s > stop_s:
            return True
        return bool(self._channels) and all(channel.ended for channel in self._channels)

    def begin(self) -> None:
        """Open all sources."""
        feeds = chosen_feeds(self._params.settings, self._params.feed, self._params.source)
        start_ns = self.get_clock().now().nanoseconds
        faults = read_faults(self._params.faults)
        for number, (name, settings) in enumerate(feeds.items()):
            channel = _Channel(name, settings, self._params.speed, start_ns, faults, number)
            self._channels.append(channel)
            self.get_logger().info(f"{name}: {settings.format} from {settings.source}")
            for topic in topics_of(settings):
                if topic not in self._own_publishers:
                    self._own_publishers[topic] = publish(self, BY_NAME[topic])
        self.every(_POLL_S, self._publish_arrived)
        self.every(_DIAGNOSTICS_S, self._publish_diagnostics)
        self._began_s = time.monotonic()
        for channel in self._channels:
            channel.source.start()

    def close(self) -> None:
        """Stop all sources and report; may be called twice."""
        for channel in self._channels:
            channel.close()

    def figures(self) -> dict[str, Any]:
        """Return the counts of all feeds for an output in JSON."""
        counts = {channel.name: channel.instrument.counts for channel in self._channels}
        return {"feeds": {name: of_feed.figures() for name, of_feed in counts.items()}}

    def statuses(self) -> list[Status]:
        """Return a diagnostics row for each instrument."""
        return [channel.status() for channel in self._channels]

    def _publish_arrived(self) -> None:
        for channel in self._channels:
            for sample in channel.samples():
                for topic, data in _messages(channel, sample):
                    self._own_publishers[topic].publish(data)

    def _publish_diagnostics(self) -> None:
        rows = self.statuses()
        self._diagnostics.publish(encode_diagnostics(self.get_clock().now().nanoseconds, rows))
        for row, channel in zip(rows, self._channels, strict=True):
            counts = channel.instrument.counts
            kind = (row.level, channel.source.fault, counts.last_fault.partition(":")[0])
            if row.level != Level.OK and self._logged.get(row.name) != kind:
                self.get_logger().warning(f"{row.name}: {row.message}")
            self._logged[row.name] = kind


def topics_of(settings: FeedSettings) -> tuple[str, ...]:
    """Return the topics of an instrument."""
    if settings.is_line_monitor:
        return WINCH_MEASURED, MOTOR_TENSION
    return ("ship/heave" if settings.heave_of == "crane_tip" else "ship/odometry",)


def _messages(channel: _Channel, sample: Sample) -> list[tuple[str, bytes]]:
    if isinstance(sample, LineSample):
        return _encode_line(sample, channel.settings.winch)
    return [_encode_output(output) for output in channel.track.take(sample)]


def chosen_feeds(settings: str, feed: str, source: str) -> dict[str, FeedSettings]:
    """Return the feeds to run: all of a settings file, or one, with another source if given.

    Raises:
        RopeTwinError: the settings are invalid, or a feed has no source.
    """
    if not settings:
        raise InputError("settings", "none", "name a file or one of config/feeds/")
    feeds = read_settings(settings)
    if feed or source:
        feeds = with_source(feeds, source, feed)
    for name, feed_settings in feeds.items():
        if not feed_settings.source:
            raise InputError(f"feed '{name}'", "it has no source", "give one")
    return feeds


class FeedSimulator(SuiteNode):
    """Sends winch and ship of a running simulation as lines of instruments."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("feed_simulator", **node_options)
        self._params = declare(self, FeedParams)
        self._writers: list[tuple[FeedSettings, Any, Sink]] = []
        self._tension_n: dict[str, float] = {}
        self._ahead: list[tuple[int, int, MotionSample | ShipPose]] = []  # stamp, number, motion
        self._number = 0
        self._began_s = time.monotonic()
        self.sent = 0

    @property
    def finished(self) -> bool:
        """Return whether the time is over."""
        stop_s = self._params.stop_after_s
        return bool(stop_s) and time.monotonic() - self._began_s > stop_s

    def begin(self) -> None:
        """Open the ways out and listen to the simulation."""
        params = self._params
        feeds = chosen_feeds(params.settings, params.feed, params.source)
        faults = read_faults(params.faults)
        for number, settings in enumerate(feeds.values()):
            out = settings.source.replace("tcp://", "tcp-server://")
            sink = with_faults(open_sink(out), faults, settings, number)
            self._writers.append((settings, writer(settings), sink))
        for topic, take in (
            ("ropes/tension_top", self._take_tension),
            ("ropes/length", self._take_length),
            ("ship/heave", self._take_heave),
            ("ship/odometry", self._take_pose),
        ):
            listen(self, BY_NAME[topic], take)
        self.every(_POLL_S, self._send_due)

    def close(self) -> None:
        """Close the ways out; may be called twice."""
        for *_, sink in self._writers:
            sink.close()

    def figures(self) -> dict[str, Any]:
        """Return the number of telegrams sent, and of lines by fault, for an output in JSON."""
        faulty = [sink.line.counts for *_, sink in self._writers if isinstance(sink, FaultySink)]
        return {"sent": self.sent, "faults": dict(sum(faulty, Counter[str]()))}

    def _take_tension(self, data: bytes) -> None:
        message = decode("ropes/tension_top", data)
        self._tension_n = dict(zip(message.name, message.effort.tolist(), strict=True))

    def _take_length(self, data: bytes) -> None:
        message = decode("ropes/length", data)
        for k, rope in enumerate(message.name):
            tension_n = self._tension_n.get(rope, math.nan)
            sample = LineSample(
                nanoseconds(message.header.stamp), tension_n, float(message.velocity[k]),
                float(message.position[k]), tension_n,
            )  # fmt: skip
            for feed, write, sink in self._writers:
                is_winch = feed.winch == rope or (k == 0 and feed.winch == "winch")
                if feed.is_line_monitor and is_winch:
                    sink.send(write(sample))
                    self.sent += 1

    def _take_heave(self, data: bytes) -> None:
        message = decode("ship/heave", data)
        heave, rate = message.pose.pose.position.z, message.twist.twist.linear.z
        stamp_ns = nanoseconds(message.header.stamp)
        self._hold(MotionSample(stamp_ns, heave, rate, 0.0, 0.0, math.nan))

    def _take_pose(self, data: bytes) -> None:
        message = decode("ship/odometry", data)
        pose, velocity = message.pose.pose, xyz(message.twist.twist.linear)
        turn, stamp_ns = pose.orientation, nanoseconds(message.header.stamp)
        ship_pose = ShipPose(stamp_ns, xyz(pose.position), velocity, (*xyz(turn), turn.w))
        if not pose_fault(ship_pose):
            self._hold(ship_pose)

    def _hold(self, motion: MotionSample | ShipPose) -> None:
        """Keep a motion until its time: a replay publishes it in advance."""
        self._number += 1
        if len(self._ahead) < _WAITING:
            heapq.heappush(self._ahead, (motion.stamp_ns, self._number, motion))

    def _send_due(self) -> None:
        now_ns = self.get_clock().now().nanoseconds
        while self._ahead and self._ahead[0][0] <= now_ns:
            stamp_ns, _, motion = heapq.heappop(self._ahead)
            if now_ns - stamp_ns > _STALE_NS:
                continue  # what waited while this process was held up: a sensor sends no bursts
            for settings, write, sink in self._writers:
                if settings.is_line_monitor:
                    continue
                sample = motion
                if isinstance(sample, ShipPose):
                    sample = motion_of_pose(sample, settings.rest_heading_deg or 0.0)
                sink.send(write(sample))
                self.sent += 1


def _encode_line(sample: LineSample, winch: str) -> list[tuple[str, bytes]]:
    """Return topics and messages of a measurement on a winch.

    Tension of the motor has a topic of its own, since losses of sheaves and gear are in it.
    """
    stamp_ns, measured = sample.stamp_ns, []
    payout, speed = or_none(sample.payout_m), or_none(sample.speed_m_per_s)
    tension = or_none(sample.tension_n)
    if (payout, speed, tension) != (None, None, None):
        measured.append(Measurement.of_winch(stamp_ns, payout, speed, tension, winch))
    if not math.isnan(sample.motor_tension_n):
        measured.append(Measurement.of_motor(stamp_ns, sample.motor_tension_n, winch))
    return [encode_measurement(stamp_ns, measurement) for measurement in measured]


def _encode_output(output: MotionOutput) -> tuple[str, bytes]:
    """Return topic and message of a motion."""
    if isinstance(output, HeaveOutput):
        data = encode_heave(output.stamp_ns, output.heave_m, output.heave_rate_m_per_s)
        return "ship/heave", data
    return "ship/odometry", encode_pose(output.stamp_ns, output)


main = partial(run_node, FeedNode)  # console entry

if __name__ == "__main__":
    sys.exit(main())
