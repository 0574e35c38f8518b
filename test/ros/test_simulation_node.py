"""The simulation node in this process: its life, its topics, its parameters."""

from __future__ import annotations

import itertools
import time
from pathlib import Path
from typing import Any

import pytest
from ros_bench import Bench, ros_ahead_ns

from rope_twin.errors import InputError, SolverError
from rope_twin.messages import Level, encode_heave
from rope_twin.ros.paced_twin import CLOCK_STEP_S
from rope_twin.topics import BY_NAME, SNAPSHOT_TOPICS, Qos

pytestmark = pytest.mark.ros
SCENE = "shallow_lift"


def simulation(bench: Bench, **parameters: Any) -> Any:
    """A simulation node of the bench, not yet begun."""
    return bench.make("simulation", **{"scene": SCENE, **parameters})


@pytest.fixture
def running(bench: Bench) -> Any:
    node = simulation(bench)
    node.begin()
    return node


def rows_of(message: Any) -> dict[str, Any]:
    return {status.name: status for status in message.status}


def level(status: Any) -> int:
    return status.level[0] if isinstance(status.level, bytes) else int(status.level)


def test_every_topic_comes_at_its_rate_with_the_state_of_its_stamp(bench: Bench) -> None:
    heard = {topic.name: bench.listen(topic.name) for topic in SNAPSHOT_TOPICS}
    node = simulation(bench, stop_after_s=2.0, wait_for=" ".join(heard))
    node.begin()
    bench.until(lambda: node.finished, "two seconds of twin time")
    wanted = {t.name: 100 if t.rate_hz == 50.0 else 50 for t in SNAPSHOT_TOPICS}
    bench.until(
        lambda: {name: len(messages) for name, messages in heard.items()} == wanted,
        "every message of two seconds",
    )
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec
              for m in heard["payloads/state"]]  # fmt: skip
    assert {b - a for a, b in itertools.pairwise(stamps)} == {20_000_000}
    # one instant, one tension, in whatever message it comes
    top = [m.effort[0] for m in heard["ropes/tension_top"]]
    assert node.paced.last.tension_top_n == top[-1]
    pacing = node.paced.pacer.health()
    assert pacing.finished
    assert pacing.error == ""
    assert pacing.steps == 200


def test_a_setting_that_was_bought_runs(bench: Bench) -> None:
    """Elements and step in place of the scene's; too few are refused in the scene's words."""
    from rope_twin.ros.params import node_parameters
    from rope_twin.run.options import RunOptions

    bought = node_parameters(RunOptions(scene=SCENE, elements=20, step_s=0.02))["simulation"]
    node = simulation(bench, **{name: bought[name] for name in ("elements", "step_s")})
    node.trigger_configure()
    assert node.paced.twin.step_s == 0.02
    assert node.paced.scene.ropes[0].elements == 20
    with pytest.raises(InputError, match=r"ropes\[0\].elements: 2 "):
        simulation(bench, elements=2).begin()


def test_in_another_sea_no_error_is_reported(bench: Bench) -> None:
    """The study's run had the scene's."""
    from rope_twin.ros.params import node_parameters
    from rope_twin.run.options import RunOptions

    for options, known in ((RunOptions(), True), (RunOptions(bag="sea_1p2m"), False)):
        reported = node_parameters(options)["simulation"]["other_sea"]
        node = simulation(bench, other_sea=reported)
        node.trigger_configure()
        error = node.paced.twin.snapshot().study_error
        assert (error.rms_pct >= 0.0) is known
        assert error.words.endswith("the study's run has another sea") is not known


def test_a_listener_that_comes_late_still_learns_the_epoch(bench: Bench, running: Any) -> None:
    tension = bench.listen("ropes/tension_top")
    bench.until(lambda: tension, "the twin runs")
    epochs = bench.listen("twin/epoch")
    bench.until(lambda: epochs, "the latched epoch")
    assert epochs[0].sec * 10**9 + epochs[0].nanosec == running.paced.border.epoch_ns


def test_deactivate_pauses_activate_goes_on_cleanup_drops(bench: Bench, running: Any) -> None:
    paced = running.paced
    bench.until(lambda: paced.pacer.health().steps >= 10, "it runs")
    running.trigger_deactivate()
    steps = paced.pacer.health().steps
    diagnostics = bench.listen("diagnostics")
    bench.until(lambda: diagnostics, "diagnostics go on in the pause")
    assert paced.pacer.health().steps == steps
    assert rows_of(diagnostics[-1])["simulation: state"].message == "inactive"
    epochs = bench.listen("twin/epoch")
    running.trigger_activate()
    bench.until(lambda: paced.pacer.health().steps >= steps + 10, "it goes on")

    def newest() -> int:
        return int(epochs[-1].sec) * 10**9 + int(epochs[-1].nanosec)

    bench.until(lambda: epochs and newest() == paced.border.epoch_ns, "the new epoch")
    now_ns = time.time_ns()
    # the new epoch places the twin's present at ROS time, less the input delay
    assert abs(newest() + paced.twin.time_ns - now_ns) < 1_500_000_000
    running.trigger_deactivate()
    running.trigger_cleanup()
    assert running.paced is None


def test_a_simulation_that_was_shut_down_takes_no_emergency_stop(
    bench: Bench, running: Any
) -> None:
    """It will never go on, so that no stop can be latched for it: its services are gone."""

    def served() -> bool:
        services = bench.own.get_service_names_and_types()
        return any(name == "/winch/emergency_stop" for name, _ in services)

    bench.until(served, "the service")
    running.trigger_shutdown()
    bench.until(lambda: not served(), "its end", timeout_s=30.0)


def test_an_emergency_stop_in_a_pause_holds_from_the_first_step_after_it(bench: Bench) -> None:
    from rope_twin.messages import encode_order
    from rope_twin.twin.winch.commands import WinchCommand

    node, diagnostics = simulation(bench, scene="emergency_stop"), bench.listen("diagnostics")
    node.begin()
    paced, (topic, stop) = node.paced, encode_order(0, WinchCommand("emergency_stop"))
    panel = bench.publisher(topic)
    bench.until(lambda: paced.pacer.health().steps and panel.get_subscription_count(), "it runs")
    node.trigger_deactivate()
    steps = paced.pacer.health().steps
    panel.publish(stop)

    def latched() -> bool:
        row = rows_of(diagnostics[-1])["simulation: messages"] if diagnostics else None
        return row is not None and "winch winch: emergency stop latched" in row.message

    bench.until(latched, "it is reported in the pause")
    modes = bench.listen("winch/mode")
    node.trigger_activate()
    bench.until(lambda: modes, "the mode after the pause")
    assert modes[0].data.startswith("winch: emergency stop")
    assert paced.pacer.health().steps > steps


def test_a_scene_that_does_not_exist_fails_to_configure_with_one_sentence(bench: Bench) -> None:
    node = simulation(bench, scene="shalow_lift")
    with pytest.raises(InputError, match="did you mean 'shallow_lift'"):
        node.begin()
    assert node.paced is None
    diagnostics = bench.listen("diagnostics")
    bench.until(lambda: diagnostics, "it tells")
    state = rows_of(diagnostics[-1])["simulation: state"]
    assert level(state) == 2
    assert "shalow_lift" in state.message


def test_a_failure_is_no_longer_reported_once_it_is_mended(bench: Bench) -> None:
    from rclpy.parameter import Parameter

    node, diagnostics = simulation(bench, scene="shalow_lift"), bench.listen("diagnostics")
    node.trigger_configure()
    node.set_parameters([Parameter("scene", value=SCENE)])
    node.trigger_configure()
    node.trigger_cleanup()
    diagnostics.clear()
    bench.until(lambda: diagnostics, "the state after it")
    state = rows_of(diagnostics[-1])["simulation: state"]
    assert (level(state), state.message) == (0, "unconfigured")


def test_it_waits_for_inputs_but_not_for_ever(bench: Bench) -> None:
    waiting = simulation(bench, wait_for="ship/heave", wait_for_s=60.0)
    waiting.begin()
    assert waiting.waiting
    heave = bench.publisher("ship/heave")
    bench.until(lambda: not waiting.waiting, "the heave has a publisher")
    bench.own.destroy_publisher(heave)
    waiting.close()
    impatient = simulation(bench, wait_for="winch/speed_command", wait_for_s=0.1)
    impatient.begin()
    bench.until(lambda: not impatient.waiting, "it starts without")


def test_a_solver_that_gives_up_is_reported_and_the_node_lives(bench: Bench, running: Any) -> None:
    paced = running.paced
    bench.until(lambda: paced.pacer.health().steps >= 10, "it runs")
    diagnostics = bench.listen("diagnostics")

    def give_up(steps: int) -> None:
        raise SolverError("step 12 at 0.12 s: the next state is not finite; shorten the step.")

    paced.twin.advance = give_up
    bench.until(
        lambda: any(
            level(row) == 2 and "the next state is not finite" in row.message
            for message in diagnostics
            for row in message.status
        ),
        "an ERROR with the solver's sentence",
    )
    assert paced.last.step >= 10  # the last good state is still there
    reported = len(diagnostics)
    bench.until(lambda: len(diagnostics) > reported, "the node still tells")
    assert not running.finished
    stop = next(one for one in running._own_services if one.service_name.endswith("/set_brake"))
    answer = stop.callback(stop.srv_type.Request(), stop.srv_type.Response())
    assert not answer.success
    assert "nothing is executed any more; the twin gives up" in answer.message


def test_parameters_carry_description_and_range(bench: Bench) -> None:
    node = simulation(bench, autostart=False)
    described = node.describe_parameter("input_delay_s")
    assert "behind ROS time" in described.description
    assert "[s]" in described.description
    span = described.floating_point_range[0]
    assert (span.from_value, span.to_value) == (0.0, 10.0)
    node.begin()
    assert node.paced is None  # autostart is off


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("speed", 50.0, "50.0; it must be a number such as 2.0, 0.01 to 5"),
        ("speed", 2, "2; it must be a number such as 2.0"),
        ("speed", "fast", "'fast'; it must be a number"),
        ("input_delay_s", -1.0, "0 to 10 s"),
        ("scene", 3, "3; it must be text"),
        ("autostart", "yes", "it must be true or false"),
    ],
)
def test_a_wrong_parameter_gets_one_sentence(
    bench: Bench, name: str, value: object, words: str
) -> None:
    with pytest.raises(InputError) as caught:
        simulation(bench, **{name: value})
    assert f"node simulation, parameter {name}" in str(caught.value)
    assert words in str(caught.value)


def test_what_is_not_learned_cannot_be_applied(bench: Bench) -> None:
    words = "parameter apply_learned: nothing is learned; set learn too"
    with pytest.raises(InputError, match=words):
        simulation(bench, apply_learned=True).begin()


def test_parameters_cannot_change_under_a_running_twin(bench: Bench, running: Any) -> None:
    from rclpy.parameter import Parameter

    result = running.set_parameters([Parameter("speed", value=2.0)])[0]
    assert not result.successful
    assert "clean up first" in result.reason
    # with another clock every stamp of an input would be wrong
    assert not running.set_parameters([Parameter("use_sim_time", value=True)])[0].successful
    assert running.set_parameters([Parameter("use_sim_time", value=False)])[0].successful
    running.trigger_deactivate()
    running.trigger_cleanup()
    assert running.set_parameters([Parameter("speed", value=2.0)])[0].successful
    running.trigger_configure()
    assert running.paced.pacer.health().speed == 2.0


def test_a_heave_that_stops_is_stale_and_the_twin_goes_on(bench: Bench, running: Any) -> None:
    heave = bench.publisher("ship/heave")
    paced = running.paced
    bench.until(lambda: paced.pacer.health().steps > 0, "it runs")
    sent = 0

    def feed() -> bool:
        nonlocal sent
        heave.publish(encode_heave(time.time_ns(), 0.1, 0.0))
        sent += 1
        return paced.last.inputs["heave"].accepted >= 5

    bench.until(feed, "heave is taken")
    steps = paced.pacer.health().steps
    bench.until(lambda: paced.last.inputs["heave"].stale, "its absence is noticed")
    assert paced.pacer.health().steps > steps


def test_a_listener_that_gets_nothing_is_reported(bench: Bench, running: Any) -> None:
    """It asks for reliable numbers, and streams are best effort."""
    from rope_twin.ros.qos import message_type, profile

    reported = bench.listen("diagnostics")
    asked = profile(Qos.COMMAND)
    bench.own.create_subscription(message_type(BY_NAME["ropes/nodes"]), "ropes/nodes", print, asked)
    bench.until(
        lambda: any(
            "QoS: a subscriber of ropes/nodes" in rows_of(one)["simulation: sources"].message
            for one in reported
        ),
        "a word on the listener",
    )


def test_a_step_of_the_system_clock_is_reported(running: Any) -> None:
    ahead_ns = ros_ahead_ns()
    row = {row.name: row for row in running.paced.rows(ahead_ns)}["simulation: clocks"]
    assert row.level == Level.OK
    row = {row.name: row for row in running.paced.rows(ahead_ns - 3_000_000_000)}[row.name]
    assert row.level == Level.WARN
    # two clocks cannot be read at one instant: what lies between them is not a step
    reported_s = float(row.values["ROS time against steady time [s]"])
    assert reported_s == pytest.approx(-3.0, abs=CLOCK_STEP_S)
    assert f"{reported_s:+.3f} s" in row.message


def test_scene_files_may_be_named_by_path(bench: Bench, tmp_path: Path) -> None:
    from rope_twin.files import share_dir

    text = (share_dir() / "config" / "scenes" / f"{SCENE}.yaml").read_text(encoding="utf-8")
    mine = tmp_path / "mine.yaml"
    mine.write_text(text, encoding="utf-8")
    node = simulation(bench, scene=str(mine))
    node.begin()
    assert node.paced.scene.name == "mine"
