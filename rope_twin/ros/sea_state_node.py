"""Sea-state node: ship motion from recorded heave or poses, a regular heave, or a spectrum.

Samples are stamped with their own time and published `lead_s` in advance, which a replay can do.
With wait_for_epoch false the record starts immediately, stamped with ROS time.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

from rope_twin.messages import encode_elevation
from rope_twin.recording.heave import replay_sea
from rope_twin.recording.motion_source import FIRST_NS, Sea, encode_motion, open_sea
from rope_twin.ros.entry import run_node
from rope_twin.ros.input_streamer import InputNode
from rope_twin.ros.params import SeaStateParams, declare
from rope_twin.scene.load import load_scene
from rope_twin.sea.ship_motion import BoxHull
from rope_twin.sea.spectrum import jonswap
from rope_twin.twin.motion.ship_motion import synthesise

_SECOND_NS = 1_000_000_000


class SeaStateNode(InputNode):
    """Publishes ship/heave or ship/odometry and, where the record has it, sea/elevation."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("sea_state", **node_options)
        self._params = declare(self, SeaStateParams)
        self._replay: Sea | None = None
        self._newest_ns = 0  # stamp of the last published sample
        self.ended = False

    def begin(self) -> None:
        """Read or synthesise the sea, then follow the simulation's epoch."""
        self._replay = _open(self._params)
        if self._replay is None:
            self.get_logger().warning(f"scene {self._params.scene} has no sea: no ship motion")
            return
        self.get_logger().info(self._replay.source)
        if self._replay.note:
            self.get_logger().warning(self._replay.note)
        topics = (self._replay.topic, "sea/elevation")
        self.start_publishing(topics, self._params.lead_s, self._params.speed, FIRST_NS)
        if self._params.wait_for_epoch:
            self.await_epoch(self._params.simulation_node)
        else:
            self.follow_now()

    def publish_interval(self, epoch_ns: int, from_ns: int, to_ns: int) -> None:
        """Publish the samples of an interval of simulation time."""
        assert self._replay is not None
        samples = self._replay.between(from_ns, to_ns)
        for sample in samples:
            at_ns = epoch_ns + sample.stamp_ns
            self.send(*encode_motion(at_ns, sample))
            if sample.elevation_m is not None:
                self.send("sea/elevation", encode_elevation(at_ns, sample.elevation_m))
        if samples:
            self._newest_ns = samples[-1].stamp_ns
        elif (
            not self.ended and to_ns - self._newest_ns > _SECOND_NS and self._replay.is_over(to_ns)
        ):
            self.ended = True
            self.get_logger().warning("end of the recorded sea: ship motion no longer published")


def _open(params: SeaStateParams) -> Sea | None:
    if params.significant_height_m > 0.0:
        spectrum = jonswap(params.significant_height_m, params.peak_period_s)
        sea = synthesise(spectrum, BoxHull(), params.seed)
        return replay_sea(sea, params.sea_offset_s, params.loop)
    scene, start_s = load_scene(params.scene), params.sea_offset_s
    return open_sea(scene, params.bag, params.topic, start_s, params.loop, params.poses)


main = partial(run_node, SeaStateNode)  # console entry

if __name__ == "__main__":
    sys.exit(main())
