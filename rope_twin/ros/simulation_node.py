"""Simulation node: steps the rope in real time; a lifecycle node around a PacedTwin.

configure reads the scene, builds and compiles; activate publishes the epoch and runs in real time;
deactivate pauses (activate resumes with a new epoch); cleanup drops the twin. Callbacks only pass
serialised messages on.
"""

from __future__ import annotations

import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.exceptions import InvalidServiceNameException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import SetBool, Trigger

from rope_twin.alerts.monitor import LONGEST
from rope_twin.errors import InputError, RopeTwinError, did_you_mean, phrase
from rope_twin.messages import Level, Status, decode, encode_diagnostics, encode_epoch, encode_text
from rope_twin.messages.diagnostics import MOTION_ROW
from rope_twin.messages.reports import RECORDER_ROW, read_diagnostics
from rope_twin.messages.templates import nanoseconds
from rope_twin.ros import qos
from rope_twin.ros.entry import SuiteNode, run_node
from rope_twin.ros.middleware import sent_ago_s
from rope_twin.ros.paced_twin import PacedTwin
from rope_twin.ros.params import SimulationParams, declare, read
from rope_twin.run.border import SenderLags
from rope_twin.scene.load import at_setting, following_measured, load_scene
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.topics import (
    ACKNOWLEDGE_ALARM,
    ALERT_COMMAND,
    APPLY_ESTIMATE,
    BY_NAME,
    CUT_TOPIC,
    FORECAST_RISK,
    INPUT_LOG_TOPIC,
    INPUTS,
    LOWER_END,
    MEASURED_TOPICS,
    MOTION_TOPICS,
    RELEASE,
    SAVE_STATE,
    SEAT_TOPIC,
    SWITCH_TOPIC,
    TAKE,
    TARE_ESTIMATE,
    TOPICS,
    WINCH_SERVICES,
    WINCH_TOPICS,
    service_name,
)
from rope_twin.twin.pacing import keep_pauses_short
from rope_twin.twin.winch.commands import EMERGENCY_STOP

_SUCCESS, _FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE
_POLL_S, _DIAGNOSTICS_S, _COMMANDERS_S = 0.1, 1.0, 0.5
_DESCRIBE_S = 10.0  # minimum time between two session descriptions for joining recorders
_SILENT_S = 5.0  # of a recorder, which reports once a second
NO_RECORDER = Status(RECORDER_ROW, Level.OK, "no recorder has reported")
WAITING_FOR_CLOCK = "waiting for the first message on /clock (use_sim_time is true)"


class SimulationNode(SuiteNode, LifecycleNode):
    """Publishes all topics of the table whose publisher is `simulation`."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("simulation", **node_options)
        self._params = declare(self, SimulationParams, read_only=False)
        self.add_on_set_parameters_callback(self._judge_parameters)
        self._state = "unconfigured"
        self._sentence = ""  # why the last transition failed
        self._waited_s = 0.0
        self._finished = False
        self._logged_sources = ""
        self._published = Counter[str]()  # messages by topic
        self._listeners, self._described_s = 0, float("-inf")  # subscribers of the input log
        self._senders = qos.Senders(self)
        self._lags = SenderLags()
        self._own_services: list[Any] = []
        self._seat_words = ""  # last published text
        self._checked_s = 0.0  # time of the last check of the commanders
        self._recorder, self._recorded_s = NO_RECORDER, 0.0  # newest row, and when it came
        self.paced: PacedTwin | None = None
        self._own_publishers = {
            topic.name: qos.publish(self, topic)
            for topic in TOPICS
            if topic.publisher == "simulation"
        }
        self._inputs = tuple(n for n in INPUTS if n != CUT_TOPIC or self._params.allow_cut)
        for name in (*self._inputs, ALERT_COMMAND, FORECAST_RISK):
            topic = BY_NAME[name]
            self.create_subscription(
                qos.message_type(topic), name, self._taker(name), qos.profile(topic.qos), raw=True
            )
        qos.listen(self, BY_NAME["diagnostics"], self._take_diagnostics)
        if self._params.lockstep:
            best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            self.create_subscription(ClockMessage, "/clock", self._grant, best_effort)
        self.every(_DIAGNOSTICS_S, self._publish_diagnostics)
        self.every(_POLL_S, self._poll)

    # -- lifecycle -----------------------------------------------------------------------------

    def begin(self) -> None:
        """Configure and activate if the parameter `autostart` is true."""
        if not self._params.autostart:
            return
        if self.trigger_configure() != _SUCCESS or self.trigger_activate() != _SUCCESS:
            raise InputError(self._sentence or "simulation: cannot start")

    @property
    def finished(self) -> bool:
        """Return whether `stop_after_s` has been reached and reported."""
        return self._finished

    @property
    def waiting(self) -> bool:
        """Return whether the node is active but still waits for `wait_for` or the clock."""
        return self._state in (WAITING_FOR_CLOCK, "waiting for inputs")

    def close(self) -> None:
        """Stop, publish all computed snapshots and a last diagnostics message."""
        if self.paced is not None and self._state != "closed":
            self.paced.halt()
            self._state = "closed"
            self._publish_diagnostics()
            # The last message must be sent before the publisher is destroyed.
            self._own_publishers["diagnostics"].wait_for_all_acked(Duration(seconds=1))

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the scene, build and compile; a failure is logged in one sentence."""
        self._params, self._sentence = read(self, SimulationParams), ""
        try:
            topics = (*self._inputs, *self._own_publishers)
            if self._params.lockstep and not self._uses_sim_time:
                where = "node simulation, parameter lockstep"
                raise InputError(where, "it needs the time of /clock", "set use_sim_time")
            if self._params.apply_learned and not self._params.learn:
                where = "node simulation, parameter apply_learned"
                raise InputError(where, "nothing is learned", "set learn too")
            unknown = [name for name in self._params.wait_for.split() if name not in topics]
            if unknown:
                where = "node simulation, parameter wait_for"
                raise InputError(where, f"'{unknown[0]}'", did_you_mean(unknown[0], topics))
            scene = load_scene(self._params.scene)
            scene = at_setting(scene, self._params.elements or None, self._params.step_s or None)
            scene = following_measured(scene) if self._params.follow_measured else scene
            for warning in sense_checks(scene):
                self.get_logger().warning(warning)
            self.paced = PacedTwin(scene, self._params, self._publish, self._published.copy)
            self._submit_services(self.paced)
            if self._params.from_state:
                self.get_logger().info(self.paced.begun)
            for sentence in self.paced.dropped:
                self.get_logger().warning(f"limit of the crew left out: {sentence}")
            if self.paced.twin.notice:
                self.get_logger().info(self.paced.twin.notice)
        except RopeTwinError as error:
            return self._fail(str(error))
        except Exception as error:
            # rclpy discards exceptions of a transition; the operator must see the reason.
            self.get_logger().debug(traceback.format_exc())
            reason = str(error).partition("\n")[0]
            return self._fail(f"simulation: build failed ({type(error).__name__}: {reason})")
        self._state = "inactive"
        return _SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run from now on, or as soon as the topics of `wait_for` are connected."""
        keep_pauses_short()
        self._waited_s = 0.0
        self._state = WAITING_FOR_CLOCK  # ends at once with the system clock
        self._poll()
        return _SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Pause after the current cycle."""
        assert self.paced is not None
        self.paced.halt()
        self._state = "inactive"
        self._publish_diagnostics()
        return _SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Drop the twin."""
        self.paced = None
        self._withdraw_services()
        self._state = "unconfigured"
        return _SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Shut down, from any state; no service promises anything from then on."""
        self.close()
        self._withdraw_services()
        return _SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop after a failed transition; configure may be tried again."""
        if self.paced is not None:
            self.paced.halt()
        return self.on_cleanup(state)

    def _fail(self, sentence: str) -> TransitionCallbackReturn:
        self._sentence = sentence
        self.get_logger().error(sentence)
        return _FAILURE

    def _poll(self) -> None:
        """Start when the awaited topics are connected; detect the end of the run."""
        if self.paced is None:
            return
        for sentence in self.paced.notices():
            self.get_logger().warning(sentence)
        # with use_sim_time the time is 0 until the first /clock
        if self._state == WAITING_FOR_CLOCK and self.get_clock().now().nanoseconds > 0:
            self._state = "waiting for inputs"
        if self._state == "waiting for inputs":
            missing = [name for name in self._params.wait_for.split() if not self._is_there(name)]
            if not missing or self._waited_s >= self._params.wait_for_s:
                if missing:
                    self.get_logger().warning(
                        f"no publisher or subscriber yet for {', '.join(missing)}: starting anyway"
                    )
                epoch_ns = self.paced.begin(self.get_clock().now().nanoseconds)
                self._publish("twin/epoch", encode_epoch(epoch_ns))
                self._describe_to_new_subscribers(begun=True)
                self._publish_seat()
                self._state = "active"
            self._waited_s += _POLL_S
        elif self._state == "active" and self.paced.pacer.health().finished:
            self.paced.halt()
            self._state = "finished"
            self._publish_diagnostics()
            self._finished = True
        elif self._state == "active":
            self._describe_to_new_subscribers()
            self._check_commanders()

    def _describe_to_new_subscribers(self, begun: bool = False) -> None:
        """Begin a new session for a recorder that joins, so that its bag can be replayed."""
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

    @property
    def _uses_sim_time(self) -> bool:
        return bool(self.get_parameter("use_sim_time").value)

    def _check_commanders(self) -> None:
        """Check twice a second whether the commanders of the winches are still present."""
        now_s = time.monotonic()
        if (
            self.paced is None
            or not self.paced.border.seats.watched
            or now_s < self._checked_s + _COMMANDERS_S
        ):
            return
        self._checked_s = now_s
        present = self._senders.present(WINCH_TOPICS)
        for sentence in self.paced.border.seats.check(present, self.paced.twin.time_ns):
            self.get_logger().warning(sentence)
        self._publish_seat()

    def _publish_seat(self) -> None:
        """Publish the commander of each winch if it has changed."""
        words = self.paced.border.seats.words() if self.paced is not None else ""
        if words != self._seat_words:
            self._seat_words = words
            self._publish(SEAT_TOPIC, encode_text(words))

    def _submit_services(self, paced: PacedTwin) -> None:
        """Create the services of the table for each winch, and the one that saves the state."""
        seats = paced.border.seats
        for winch in seats.winches:
            self._serve(service_name(winch, TAKE), Trigger, partial(paced.border.ask_seat, winch))
            self._serve(service_name(winch, RELEASE), Trigger, partial(seats.release, winch))
            for what, (on, off) in WINCH_SERVICES.items():
                switch = partial(_switch, paced, winch, on, off)
                self._serve(service_name(winch, what), SetBool if off else Trigger, switch)
        self._serve(SAVE_STATE, Trigger, paced.save)
        if paced.learning is not None:
            self._serve(APPLY_ESTIMATE, Trigger, paced.learning.apply)
            self._serve(TARE_ESTIMATE, Trigger, paced.learning.tare)
            self._serve(ACKNOWLEDGE_ALARM, Trigger, paced.learning.acknowledge)

    def _withdraw_services(self) -> None:
        for service in self._own_services:
            self.destroy_service(service)
        self._own_services.clear()

    def _serve(self, name: str, kind: Any, act: Callable[..., tuple[bool, str]]) -> None:
        """Create a service; `act` returns success and text, by the value of a SetBool."""

        def serve(request: Any, response: Any) -> Any:
            values = (request.data,) if kind is SetBool else ()
            sent_s = sent_ago_s(getattr(service, "sent_ns", None))
            paced, stops = self.paced, name.endswith(EMERGENCY_STOP)
            late = "" if paced is None or stops else paced.border.refuse_late(name, "call", sent_s)
            response.success, response.message = (False, late) if late else act(*values)
            self._publish_seat()
            return response

        try:
            service = self.create_service(kind, name, serve)
        except InvalidServiceNameException:
            self.get_logger().warning(f"no service {name}: not a valid ROS name")
        else:
            self._own_services.append(service)

    def _is_there(self, name: str) -> bool:
        """Return whether an input has a publisher, or an output a subscriber."""
        if name in self._inputs:
            return bool(self.count_publishers(name))
        listeners: int = self._own_publishers[name].get_subscription_count()
        return listeners > 0

    def _judge_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        if self._state == "unconfigured" or all(
            change.name == "use_sim_time" and change.value == self._uses_sim_time
            for change in changes
        ):
            return SetParametersResult(successful=True)
        reason = f"the simulation is {self._state}; deactivate and clean up first, then configure"
        return SetParametersResult(successful=False, reason=reason)

    def _grant(self, message: Any) -> None:
        """Let the twin step to the time of a master."""
        if self.paced is not None and self.paced.granted is not None:
            self.paced.granted.grant(nanoseconds(message.clock))

    # -- messages ------------------------------------------------------------------------------

    def _publish(self, name: str, data: bytes) -> None:
        self._own_publishers[name].publish(data)
        self._published[name] += 1

    def _taker(self, name: str) -> Any:
        def take(data: bytes, info: dict[str, Any]) -> None:
            if (paced := self.paced) is None:
                if name == SWITCH_TOPIC:
                    problem = f"a switch came, and the simulation is {self._state} and has no winch"
                    self.get_logger().warning(
                        phrase(name, problem, "configure it"), throttle_duration_sec=10.0
                    )
                return
            publisher = info["publisher_gid"]["data"]
            sent_s = sent_ago_s(info["source_timestamp"])
            sent_s = self._lags.since_sent_s(bytes(publisher), sent_s, time.monotonic())
            arrival_ns = paced.arrival_ns(self.get_clock().now().nanoseconds)
            if name in MOTION_TOPICS:
                paced.border.take_motion(name, data, publisher, arrival_ns)
            elif name in MEASURED_TOPICS:
                paced.border.take_measurement(name, data, publisher, arrival_ns)
            elif name in WINCH_TOPICS:
                sender = self._senders.name(name, info) or qos.publisher_name(publisher)
                paced.border.seats.name_holders(
                    lambda holder: self._senders.node_of(holder, WINCH_TOPICS)
                )
                paced.border.take_order(name, data, sender, sent_s, qos.process_of(publisher))
                self._publish_seat()
            elif name == CUT_TOPIC:
                paced.border.take_cut(data, sent_s)
            elif name == LOWER_END:
                paced.border.take_lower_end(data)
            elif name == FORECAST_RISK:
                paced.alerts.take_risks(paced.border.take_forecast(data))
            elif name == ALERT_COMMAND:
                self._command_alerts(paced, data, sent_s)
            else:
                paced.border.take_current(data)

        return take

    def _command_alerts(self, paced: PacedTwin, data: bytes, sent_s: float) -> None:
        try:
            words = str(decode(ALERT_COMMAND, data).data)
            if late := paced.border.refuse_late(ALERT_COMMAND, words[:LONGEST], sent_s):
                self._warn_of_alerts(late)
            else:
                self.get_logger().info(paced.command_alerts(words))
        except InputError as error:
            self._warn_of_alerts(str(error))

    def _warn_of_alerts(self, sentence: str) -> None:
        """Log a command that is rejected, at most one a second."""
        self.get_logger().warning(sentence, throttle_duration_sec=1.0)

    def _publish_diagnostics(self) -> None:
        """Publish diagnostics, once per second and at each change of state."""
        now_ns, steady_ns = self.get_clock().now().nanoseconds, time.monotonic_ns()
        level = Level.WARN if self._state == WAITING_FOR_CLOCK else Level.OK
        rows = [Status("simulation: state", level, self._state), *self._graph_rows()]
        if self._sentence and self.paced is None:
            rows = [Status("simulation: state", Level.ERROR, self._sentence)]
        if self.paced is not None:
            rows += [self._with_hint(row) for row in self.paced.rows(now_ns - steady_ns)]
            self.paced.alerts.take_rows([*rows, self._recorder_row()])
        self._publish("diagnostics", encode_diagnostics(now_ns, rows))

    def _take_diagnostics(self, data: bytes) -> None:
        """Keep the recorder's row: its trouble is one of the alerts."""
        if RECORDER_ROW.encode() not in data:
            return  # this node's own, most of the time: not worth the decoding
        try:
            rows = read_diagnostics(data)
        except InputError:
            return  # of another program: no input of the twin
        for row in rows:
            if row.name == RECORDER_ROW:
                self._recorder, self._recorded_s = row, time.monotonic()

    def _recorder_row(self) -> Status:
        """Return the recorder's newest row, or that it is silent."""
        silent_s = time.monotonic() - self._recorded_s
        if self._recorder is NO_RECORDER or silent_s < _SILENT_S:
            return self._recorder
        words = f"the recorder has been silent for {silent_s:.0f} s: the run may not be recorded"
        return Status(RECORDER_ROW, Level.ERROR, words)

    def _with_hint(self, row: Status) -> Status:
        """Return a row; that of ship motion with where it is expected, if none was received.

        The hint names the publishers there that are incompatible.
        """
        if row.name != MOTION_ROW or row.level is not Level.ERROR or row.values["accepted"] != "0":
            return row
        domain = self.context.get_domain_id()
        names = [self.resolve_topic_name(name) for name in MOTION_TOPICS]
        hint = (
            f"expected on {' or '.join(names)} in ROS domain {domain}, "
            f"QoS {qos.asked_of(BY_NAME[MOTION_TOPICS[0]])}"
        )
        unheard = [words for name in MOTION_TOPICS
                   for words in qos.unheard_publishers(self, BY_NAME[name])]  # fmt: skip
        if unheard:
            hint += f"; {', '.join(unheard)}"
        elif not any(self.count_publishers(name) for name in MOTION_TOPICS):
            hint += "; no publisher there"
        return replace(row, message=f"{row.message}; {hint}")

    def _graph_rows(self) -> list[Status]:
        """Return the row on publishers and subscribers of our topics, as the graph has them."""
        mixed = [name for name in MOTION_TOPICS if self.count_publishers(name) > 1]
        twins = self.count_publishers("ropes/tension_top")
        values = {name: str(self.count_publishers(name)) for name in self._inputs}
        deaf = [name for name in self._own_publishers if qos.unsuited(self, BY_NAME[name])]
        unheard = [f"{name}: {words}" for name in INPUTS
                   for words in qos.unheard_publishers(self, BY_NAME[name])]  # fmt: skip
        level = Level.WARN
        if twins > 1:
            message = f"{twins} simulations publish here; give each its own ROS_DOMAIN_ID"
            level = Level.ERROR
        elif mixed:
            message = f"more than one publisher of {', '.join(mixed)}: only one of them is used"
        elif unheard:
            message = f"incompatible publisher of an input: {'; '.join(unheard)}"
        elif deaf:
            message = f"incompatible QoS: a subscriber of {', '.join(deaf)} receives nothing"
        else:
            return [Status("simulation: sources", Level.OK, "one source per input", values)]
        if message != self._logged_sources:
            self.get_logger().warning(message)
            self._logged_sources = message
        return [Status("simulation: sources", level, message, values)]


def _switch(
    paced: PacedTwin, winch: str, on: str, off: str, value: bool = True
) -> tuple[bool, str]:
    """Execute a switch by a service; return success and text."""
    if error := paced.pacer.health().error:
        return False, phrase(f"winch {winch}", "nothing is executed any more", error.rstrip("."))
    return paced.border.switch(winch, on if value else off)


main = partial(run_node, SimulationNode)  # console entry

if __name__ == "__main__":
    sys.exit(main())
