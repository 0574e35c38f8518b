"""The node that steps the rope in real time: a lifecycle around a PacedTwin.

configure reads the scene, builds and compiles; activate publishes the epoch and paces; deactivate
pauses (activate goes on with a new epoch); cleanup drops the twin. Callbacks only pass bytes on.
"""

from __future__ import annotations

import sys
import time
import traceback
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from rope_twin.errors import InputError, RopeTwinError, did_you_mean, phrase
from rope_twin.messages import Level, Status, encode_diagnostics, encode_epoch
from rope_twin.ros.company import Turns
from rope_twin.ros.entry import run_node
from rope_twin.ros.paced_twin import PacedTwin
from rope_twin.ros.params import SimulationParams, declare, read
from rope_twin.ros.qos import message_type, profile, quiet_publisher, unsuited
from rope_twin.ros.run_status import Clocks
from rope_twin.scene.change import at_setting
from rope_twin.scene.checks.rope import sense_checks
from rope_twin.scene.load import load_scene
from rope_twin.topics import BY_NAME, CUT_TOPIC, INPUTS, TOPICS, WINCH_TOPICS
from rope_twin.twin.pacing import keep_pauses_short

_SUCCESS, _FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE
_POLL_S, _TELL_S = 0.1, 1.0
MOTION_TOPICS = "ship/heave", "ship/odometry"


class SimulationNode(LifecycleNode):
    """Publishes all topics of the table whose publisher is `simulation`."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("simulation", **node_options)
        self._params = declare(self, SimulationParams)
        self.add_on_set_parameters_callback(self._judge_parameters)
        self._state = "unconfigured"
        self._sentence = ""  # why the newest transition failed
        self._waited_s = 0.0
        self._told_finished = False
        self._told_of_others = ""
        self.paced: PacedTwin | None = None
        self._own_publishers = {
            topic.name: self.create_publisher(
                message_type(topic),
                topic.name,
                profile(topic.qos),
                event_callbacks=quiet_publisher(),
            )
            for topic in TOPICS
            if topic.publisher == "simulation"
        }
        for name in INPUTS:
            topic = BY_NAME[name]
            self.create_subscription(
                message_type(topic), name, self._taker(name), profile(topic.qos), raw=True
            )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_TELL_S, self._tell, clock=steady)
        self.create_timer(_POLL_S, self._poll, clock=steady)

    # -- life ----------------------------------------------------------------------------------

    def begin(self) -> None:
        """Configure and activate, if the parameter `autostart` says so."""
        if not self._params.autostart:
            return
        if self.trigger_configure() != _SUCCESS or self.trigger_activate() != _SUCCESS:
            raise InputError(self._sentence or "simulation: it cannot start")

    @property
    def finished(self) -> bool:
        """Whether `stop_after_s` has been reached and told."""
        return self._told_finished

    @property
    def waiting(self) -> bool:
        """Whether it is active but still awaits the publishers of `wait_for`."""
        return self._state == "waiting for inputs"

    def close(self) -> None:
        """Stop pacing, publish what was computed and say so in a last diagnostics message."""
        if self.paced is not None and self._state != "closed":
            self.paced.halt()
            self._state = "closed"
            self._tell()
            # The last word must be out before the publisher is gone.
            self._own_publishers["diagnostics"].wait_for_all_acked(Duration(seconds=1))

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the scene, build, compile; a failure is one sentence in the log."""
        self._params = read(self, SimulationParams)
        try:
            known = (*INPUTS, *self._own_publishers)
            unknown = [name for name in self._params.wait_for.split() if name not in known]
            if unknown:
                where = "node simulation, parameter wait_for"
                raise InputError(phrase(where, f"'{unknown[0]}'", did_you_mean(unknown[0], known)))
            scene = load_scene(self._params.scene)
            scene = at_setting(scene, self._params.elements or None, self._params.step_s or None)
            for warning in sense_checks(scene):
                self.get_logger().warning(warning)
            self.paced = PacedTwin(scene, self._params, self._publish)
            if self._params.start_from:
                self.get_logger().info(self.paced.begun)
            if self.paced.twin.told:
                self.get_logger().info(self.paced.twin.told)
        except RopeTwinError as error:
            return self._fail(str(error))
        except Exception as error:
            # rclpy swallows what a transition raises; an operator must not be left without a word.
            self.get_logger().debug(traceback.format_exc())
            reason = str(error).partition("\n")[0]
            return self._fail(f"the twin cannot be built: {type(error).__name__}: {reason}")
        self._state = "inactive"
        return _SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Pace from now on, or as soon as the awaited inputs have publishers."""
        keep_pauses_short()
        self._waited_s = 0.0
        self._state = "waiting for inputs"
        self._poll()
        return _SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Pause after the slot at hand."""
        assert self.paced is not None
        self.paced.halt()
        self._state = "inactive"
        self._tell()
        return _SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Drop the twin."""
        self.paced = None
        self._state = "unconfigured"
        return _SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End for good, from any state."""
        self.close()
        return _SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """After a failed transition nothing runs; configure may be tried again."""
        if self.paced is not None:
            self.paced.halt()
        return self.on_cleanup(state)

    def _fail(self, sentence: str) -> TransitionCallbackReturn:
        self._sentence = sentence
        self.get_logger().error(sentence)
        return _FAILURE

    def _poll(self) -> None:
        """Start when the inputs are there; notice the end."""
        if self.paced is None:
            return
        for sentence in self.paced.sayings():
            self.get_logger().warning(sentence)
        if self._state == "waiting for inputs":
            missing = [name for name in self._params.wait_for.split() if not self._is_there(name)]
            if not missing or self._waited_s >= self._params.wait_for_s:
                if missing:
                    self.get_logger().warning(
                        f"nobody is there yet for {', '.join(missing)}: starting without"
                    )
                epoch_ns = self.paced.begin(self.get_clock().now().nanoseconds)
                self._publish("twin/epoch", encode_epoch(epoch_ns))
                self._state = "active"
            self._waited_s += _POLL_S
        elif self._state == "active" and self.paced.pacer.health().finished:
            self.paced.halt()
            self._state = "finished"
            self._tell()
            self._told_finished = True

    def _is_there(self, name: str) -> bool:
        """Whether an input has a publisher, or one of our topics a listener."""
        if name in INPUTS:
            return bool(self.count_publishers(name))
        listeners: int = self._own_publishers[name].get_subscription_count()
        return listeners > 0

    def _judge_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        if self._state == "unconfigured" or all(
            change.name == "use_sim_time" for change in changes
        ):
            return SetParametersResult(successful=True)
        reason = f"the simulation is {self._state}; deactivate and clean up first, then configure"
        return SetParametersResult(successful=False, reason=reason)

    # -- messages ------------------------------------------------------------------------------

    def _publish(self, name: str, data: bytes) -> None:
        self._own_publishers[name].publish(data)

    def _taker(self, name: str) -> Any:
        def take_motion(data: bytes, info: dict[str, Any]) -> None:
            if self.paced is None:
                return
            turns.count(info)
            if turns.mixed and not self.paced.mixed:
                self.paced.mixed = f"{name}: it came from several senders by turns"
                self.get_logger().error(self.paced.mixed)
            offer = self.paced.offer_heave if name == "ship/heave" else self.paced.offer_pose
            offer(data)

        def take(data: bytes) -> None:
            if self.paced is None:
                return
            if name in WINCH_TOPICS:
                self.paced.offer_order(name, data)
            elif name == CUT_TOPIC:
                self.paced.offer_cut(data)
            else:
                self.paced.offer_current(data)

        turns = Turns()
        return take_motion if name in MOTION_TOPICS else take

    def _tell(self) -> None:
        """Diagnostics, once a second and at each change of state."""
        now = Clocks(self.get_clock().now().nanoseconds, time.monotonic_ns())
        rows = [Status("simulation: state", Level.OK, self._state), *self._graph_rows()]
        if self._sentence and self.paced is None:
            rows = [Status("simulation: state", Level.ERROR, self._sentence)]
        if self.paced is not None:
            rows += self.paced.rows(now)
        self._publish("diagnostics", encode_diagnostics(now.ros_ns, rows))

    def _graph_rows(self) -> list[Status]:
        """Who else is on our topics: two sources of one input mix, two twins confuse everybody."""
        mixed = [name for name in (*MOTION_TOPICS, *WINCH_TOPICS)
                 if self.count_publishers(name) > 1]  # fmt: skip
        twins = self.count_publishers("tension_top")
        values = {name: str(self.count_publishers(name)) for name in INPUTS}
        deaf = [name for name in self._own_publishers if unsuited(self, BY_NAME[name])]
        level = Level.WARN
        if twins > 1:
            message = f"{twins} simulations publish here; give each its own ROS_DOMAIN_ID"
            level = Level.ERROR
        elif mixed:
            message = f"more than one publisher of {', '.join(mixed)}: their samples mix"
        elif deaf:
            message = (
                f"who listens to {', '.join(deaf)} and asks for more than is offered hears nothing"
            )
        else:
            return [Status("simulation: sources", Level.OK, "one source for each input", values)]
        # Of a hand at the winch the schedule tells, which yields to it.
        by_hand = twins <= 1 and bool(mixed) and not set(mixed).intersection(MOTION_TOPICS)
        if message != self._told_of_others and not by_hand:
            self.get_logger().warning(message)
            self._told_of_others = message
        return [Status("simulation: sources", level, message, values)]


def main(args: list[str] | None = None) -> int:
    """Console entry."""
    return run_node(SimulationNode, args)


if __name__ == "__main__":
    sys.exit(main())
