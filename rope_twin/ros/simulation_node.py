"""The node that steps the rope in real time: a lifecycle around a PacedTwin.

configure reads the scene, builds and compiles; activate publishes the epoch and paces; deactivate
pauses (activate goes on with a new epoch); cleanup drops the twin. Callbacks only pass bytes on.
"""

from __future__ import annotations

import sys
import time
import traceback
from collections import Counter
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import InvalidServiceNameException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from rope_twin.errors import InputError, RopeTwinError, did_you_mean, phrase
from rope_twin.messages import Level, Status, encode_diagnostics, encode_epoch, encode_seat
from rope_twin.ros.company import Senders, publisher_name
from rope_twin.ros.entry import run_node
from rope_twin.ros.paced_twin import PacedTwin
from rope_twin.ros.params import SimulationParams, declare, read
from rope_twin.ros.qos import (
    asked_of,
    message_type,
    profile,
    quiet_publisher,
    unheard_publishers,
    unsuited,
)
from rope_twin.ros.run_status import Clocks, with_hint
from rope_twin.run.seat import RELEASE, TAKE, service_name
from rope_twin.scene.change import at_setting
from rope_twin.scene.checks.rope import sense_checks
from rope_twin.scene.load import load_scene
from rope_twin.topics import (
    BY_NAME,
    CUT_TOPIC,
    INPUT_LOG_TOPIC,
    INPUTS,
    MOTION_TOPICS,
    SEAT_TOPIC,
    TOPICS,
    WINCH_TOPICS,
)
from rope_twin.twin.pacing import keep_pauses_short

_SUCCESS, _FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE
_POLL_S, _TELL_S, _LOOK_S = 0.1, 1.0, 0.5
_DESCRIBE_S = 10.0  # between two descriptions for recorders that join
WAITING_FOR_CLOCK = "waiting for the first message on /clock, as use_sim_time is true"


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
        self._published = Counter[str]()  # messages by topic
        self._listeners, self._described_s = 0, float("-inf")  # of the log of inputs
        self._senders = Senders(self)
        self._seat_services: list[Any] = []
        self._seat_words = ""  # as published last
        self._looked_s = 0.0  # when commanders were looked for
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
        self._inputs = tuple(n for n in INPUTS if n != CUT_TOPIC or self._params.allow_cut)
        for name in self._inputs:
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
        return self._state in (WAITING_FOR_CLOCK, "waiting for inputs")

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
            known = (*self._inputs, *self._own_publishers)
            unknown = [name for name in self._params.wait_for.split() if name not in known]
            if unknown:
                where = "node simulation, parameter wait_for"
                raise InputError(phrase(where, f"'{unknown[0]}'", did_you_mean(unknown[0], known)))
            scene = load_scene(self._params.scene)
            scene = at_setting(scene, self._params.elements or None, self._params.step_s or None)
            for warning in sense_checks(scene):
                self.get_logger().warning(warning)
            self.paced = PacedTwin(scene, self._params, self._publish, self._published.copy)
            self._offer_seats()
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
        self._state = WAITING_FOR_CLOCK  # of the epoch; the system's is always there
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
        for service in self._seat_services:
            self.destroy_service(service)
        self._seat_services.clear()
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
        if self._state == WAITING_FOR_CLOCK and self._has_time():
            self._state = "waiting for inputs"
        if self._state == "waiting for inputs":
            missing = [name for name in self._params.wait_for.split() if not self._is_there(name)]
            if not missing or self._waited_s >= self._params.wait_for_s:
                if missing:
                    self.get_logger().warning(
                        f"nobody is there yet for {', '.join(missing)}: starting without"
                    )
                epoch_ns = self.paced.begin(self.get_clock().now().nanoseconds)
                self._publish("twin/epoch", encode_epoch(epoch_ns))
                self._describe_to_newcomers(begun=True)
                self._publish_seat()
                self._state = "active"
            self._waited_s += _POLL_S
        elif self._state == "active" and self.paced.pacer.health().finished:
            self.paced.halt()
            self._state = "finished"
            self._tell()
            self._told_finished = True
        elif self._state == "active":
            self._describe_to_newcomers()
            self._look_at_commanders()

    def _describe_to_newcomers(self, begun: bool = False) -> None:
        """Let a recorder that joins while the twin runs know all that a replay needs."""
        assert self.paced is not None
        listeners = self._own_publishers[INPUT_LOG_TOPIC].get_subscription_count()
        now_s = time.monotonic()
        if begun:
            self._listeners, self._described_s = listeners, float("-inf")
        elif listeners <= self._listeners:
            self._listeners = listeners
        elif now_s - self._described_s >= _DESCRIBE_S:
            self._listeners, self._described_s = listeners, now_s
            self.paced.describe_again()

    def _has_time(self) -> bool:
        """Whether ROS time is known: with use_sim_time it is 0 until the first /clock."""
        return bool(self.get_clock().now().nanoseconds > 0)

    def _look_at_commanders(self) -> None:
        """See twice a second whether who commands a winch is still there."""
        now_s = time.monotonic()
        if (
            self.paced is None
            or not self.paced.border.seats.taken
            or now_s < self._looked_s + _LOOK_S
        ):
            return
        self._looked_s = now_s
        present = self._senders.present(WINCH_TOPICS)
        for sentence in self.paced.border.seats.look(present, self.paced.twin.time_ns):
            self.get_logger().warning(sentence)
        self._publish_seat()

    def _publish_seat(self) -> None:
        """Say who commands each winch, where that has changed."""
        words = self.paced.border.seats.words() if self.paced is not None else ""
        if words != self._seat_words:
            self._seat_words = words
            self._publish(SEAT_TOPIC, encode_seat(words))

    def _offer_seats(self) -> None:
        """Make the services by which the seats of the winches are taken and released."""
        assert self.paced is not None
        for winch in self.paced.border.seats.winches:
            for what in (TAKE, RELEASE):
                name = service_name(winch, what)
                try:
                    made = self.create_service(Trigger, name, self._seat_server(winch, what))
                except InvalidServiceNameException:
                    self.get_logger().warning(f"no service {name}: that is no name in ROS")
                else:
                    self._seat_services.append(made)

    def _seat_server(self, winch: str, what: str) -> Any:
        def serve(request: Any, response: Any) -> Any:
            response.message = f"the simulation is {self._state}"
            if self.paced is not None:
                seats = self.paced.border.seats
                act = seats.ask if what == TAKE else seats.release
                response.success, response.message = act(winch)
                self._publish_seat()
            return response

        return serve

    def _is_there(self, name: str) -> bool:
        """Whether an input has a publisher, or one of our topics a listener."""
        if name in self._inputs:
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
        self._published[name] += 1

    def _taker(self, name: str) -> Any:
        def take_motion(data: bytes, info: dict[str, Any]) -> None:
            if self.paced is not None:
                sender, now_ns = info["publisher_gid"]["data"], self.get_clock().now().nanoseconds
                self.paced.border.take_motion(name, data, sender, self.paced.arrival_ns(now_ns))

        def take_command(data: bytes, info: dict[str, Any]) -> None:
            if self.paced is None:
                return
            publisher = publisher_name(info["publisher_gid"]["data"])
            sender = self._senders.name(name, info) or publisher
            self.paced.border.take_order(name, data, sender, publisher)
            self._publish_seat()

        def take(data: bytes) -> None:
            if self.paced is None:
                return
            if name == CUT_TOPIC:
                self.paced.border.take_cut(data)
            else:
                self.paced.border.take_current(data)

        if name in WINCH_TOPICS:
            return take_command
        return take_motion if name in MOTION_TOPICS else take

    def _tell(self) -> None:
        """Diagnostics, once a second and at each change of state."""
        now = Clocks(self.get_clock().now().nanoseconds, time.monotonic_ns())
        level = Level.WARN if self._state == WAITING_FOR_CLOCK else Level.OK
        rows = [Status("simulation: state", level, self._state), *self._graph_rows()]
        if self._sentence and self.paced is None:
            rows = [Status("simulation: state", Level.ERROR, self._sentence)]
        if self.paced is not None:
            rows += with_hint(self.paced.rows(now), self._motion_hint)
        self._publish("diagnostics", encode_diagnostics(now.ros_ns, rows))

    def _motion_hint(self) -> str:
        """Return where ship motion is awaited, and who publishes what cannot be taken."""
        domain = self.context.get_domain_id()
        names = [self.resolve_topic_name(name) for name in MOTION_TOPICS]
        hint = (
            f"awaited on {' or '.join(names)} in ROS domain {domain}, "
            f"QoS {asked_of(BY_NAME[MOTION_TOPICS[0]])}"
        )
        unheard = [words for name in MOTION_TOPICS
                   for words in unheard_publishers(self, BY_NAME[name])]  # fmt: skip
        if unheard:
            return f"{hint}; {', '.join(unheard)}"
        if not any(self.count_publishers(name) for name in MOTION_TOPICS):
            return f"{hint}; nobody publishes there"
        return hint

    def _graph_rows(self) -> list[Status]:
        """Who else is on our topics: one source of motion is heard, two twins confuse everybody."""
        mixed = [name for name in MOTION_TOPICS if self.count_publishers(name) > 1]
        twins = self.count_publishers("tension_top")
        values = {name: str(self.count_publishers(name)) for name in self._inputs}
        deaf = [name for name in self._own_publishers if unsuited(self, BY_NAME[name])]
        unheard = [f"{name}: {words}" for name in INPUTS
                   for words in unheard_publishers(self, BY_NAME[name])]  # fmt: skip
        level = Level.WARN
        if twins > 1:
            message = f"{twins} simulations publish here; give each its own ROS_DOMAIN_ID"
            level = Level.ERROR
        elif mixed:
            message = f"more than one publisher of {', '.join(mixed)}: only one of them is heard"
        elif unheard:
            message = f"an input cannot be heard: {'; '.join(unheard)}"
        elif deaf:
            message = (
                f"who listens to {', '.join(deaf)} and asks for more than is offered hears nothing"
            )
        else:
            return [Status("simulation: sources", Level.OK, "one source for each input", values)]
        if message != self._told_of_others:
            self.get_logger().warning(message)
            self._told_of_others = message
        return [Status("simulation: sources", level, message, values)]


def main(args: list[str] | None = None) -> int:
    """Console entry."""
    return run_node(SimulationNode, args)


if __name__ == "__main__":
    sys.exit(main())
