"""Winch-schedule node: publishes a scene's winch schedule, and a planned cut, as commands.

The node yields: as soon as a node of another name publishes on a command topic, it logs a warning
and stops publishing for good, so that an operator who takes the winch keeps it (restart the node to
give it back). Until the other node's first command the last commanded speed remains in force. A
node of the same name is a killed predecessor that is still in the graph, and no reason to yield.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import partial
from typing import Any

from rope_twin.messages import encode_cut, encode_order
from rope_twin.ros.entry import run_node
from rope_twin.ros.input_streamer import InputNode
from rope_twin.ros.params import WinchScheduleParams, declare
from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.schema import Winch
from rope_twin.scene.winch import FOLLOWS_COMMANDS
from rope_twin.topics import CUT_TOPIC, ORDER_TOPICS, SWITCH_TOPIC, WINCH_TOPICS
from rope_twin.twin.cut_input import PlannedCut, plan_for
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.winch.commands import motion_of, schedule_samples


class WinchScheduleNode(InputNode):
    """Publishes winch commands at 10 Hz and at each change of the schedule."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("winch_schedule", **node_options)
        self._params = declare(self, WinchScheduleParams)
        self._winches: dict[str, Winch] = {}
        self._cut: PlannedCut | None = None
        self.yielded = False

    def begin(self) -> None:
        """Read the scene and wait for the simulation's epoch."""
        scene = load_scene(self._params.scene)
        winches = winches_by_name(scene).items()
        self._winches = {n: w for n, w in winches if w.schedule and w.follows == FOLLOWS_COMMANDS}
        self._cut = plan_for(scene, self._params.cut)
        if not self._winches and self._cut is None:
            if winches_by_name(scene):
                problem = f"scene {scene.name} has no winch schedule: no winch commands published"
                self.get_logger().warning(problem)
            else:
                self.get_logger().info(f"scene {scene.name} has no winch: constant line out")
            return
        topics = topics_of(self._winches.values()) if self._winches else ()
        topics += (CUT_TOPIC,) if self._cut is not None else ()
        self.start_publishing(topics, self._params.lead_s, self._params.speed)
        self.await_epoch(self._params.simulation_node)

    def publish_interval(self, epoch_ns: int, from_ns: int, to_ns: int) -> None:
        """Publish the commands of an interval of simulation time, unless another node commands."""
        if self._cut is not None and from_ns <= self._cut.at_ns < to_ns:
            cut = self._cut
            self.send(*encode_cut(epoch_ns + cut.at_ns, cut.below_m, cut.rope))
        if self._winches and not self.yielded and (others := self._other_commanders()):
            self.yielded = True
            self.get_logger().warning(
                f"{', '.join(others)} also commands the winch: the schedule yields and stops "
                "(restart this node to resume it)"
            )
        if self.yielded:
            return
        for name, winch in self._winches.items():
            for sample in schedule_samples(winch, from_ns, to_ns):
                self.send(*encode_order(epoch_ns + sample.stamp_ns, sample.command, name))

    def _other_commanders(self) -> list[str]:
        """Return the names of others that publish on a winch command topic."""
        if all(self.count_publishers(topic) <= self.publishes(topic) for topic in WINCH_TOPICS):
            return []
        return self.senders.others(WINCH_TOPICS)


def topics_of(winches: Iterable[Winch]) -> tuple[str, ...]:
    """Return the topics of these winches' schedules; always a speed, for before the first row."""
    rows = [row for winch in winches for row in winch.schedule]
    motions = {motion.kind for row in rows if (motion := motion_of(row))}
    used = {ORDER_TOPICS[SPEED], *(ORDER_TOPICS[kind] for kind in motions)}
    if any(row.switch for row in rows):
        used.add(SWITCH_TOPIC)
    return tuple(topic for topic in WINCH_TOPICS if topic in used)


main = partial(run_node, WinchScheduleNode)  # console entry

if __name__ == "__main__":
    sys.exit(main())
