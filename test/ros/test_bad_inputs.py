"""Bad messages on the input topics: refused, counted, reported, and the twin keeps running."""

from __future__ import annotations

import time

import numpy as np
import pytest
from ros_bench import Bench, ros_ahead_ns
from ros_messages import BAD, encode_speed, multi_array

from rope_twin.messages import Level, Status, encode_heave

pytestmark = pytest.mark.ros
INPUT_ROW = {"ship/heave": "heave", "winch/speed_command": "winch command", "current": "current"}
CASES = [(topic, kind) for topic, kinds in BAD.items() for kind in kinds]


class Running:
    """A running simulation, publishers to it and what it says of its inputs."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        # A second behind: what is sent a little ahead is in time though this process be held up.
        self.node = bench.make("simulation", scene="shallow_lift", input_delay_s=1.0)
        self.node.begin()
        self.publishers = {topic: bench.publisher(topic) for topic in BAD}
        bench.until(lambda: self.steps > 0, "the twin runs")
        bench.until(
            lambda: all(p.get_subscription_count() for p in self.publishers.values()),
            "the twin listens",
        )

    @property
    def steps(self) -> int:
        return int(self.node.paced.pacer.health().steps)

    def rows(self) -> dict[str, Status]:
        return {row.name: row for row in self.node.paced.rows(ros_ahead_ns())}

    def refused(self, topic: str) -> int:
        rows = self.rows()
        health = rows[f"simulation: input {INPUT_ROW[topic]}"].values
        return int(health["refused"]) + int(rows["simulation: messages"].values[topic])

    def accepted(self, topic: str) -> int:
        return int(self.rows()[f"simulation: input {INPUT_ROW[topic]}"].values["accepted"])

    def newest_reason(self, topic: str) -> str:
        rows = self.rows()
        note = rows[f"simulation: input {INPUT_ROW[topic]}"].values["last note"]
        return note + rows["simulation: messages"].message


@pytest.fixture(scope="module")
def running(module_bench: Bench) -> Running:
    return Running(module_bench)


@pytest.mark.parametrize(("topic", "kind"), CASES, ids=[f"{t}-{k}" for t, k in CASES])
def test_it_is_refused_counted_and_reported_while_the_twin_runs_on(
    running: Running, topic: str, kind: str
) -> None:
    refused, accepted, steps = running.refused(topic), running.accepted(topic), running.steps
    data = BAD[topic][kind](time.time_ns() + 100_000_000)
    running.publishers[topic].publish(data)
    running.bench.until(lambda: running.refused(topic) > refused, f"{kind} is refused")
    assert running.refused(topic) == refused + 1
    assert running.accepted(topic) == accepted
    assert len(running.newest_reason(topic)) > 20
    running.bench.until(lambda: running.steps >= steps + 4, "the twin runs on")
    last = running.node.paced.last
    assert np.isfinite(last.node_position_m).all()
    assert last.tension_top_n > 0.0
    running.bench.until(
        lambda: running.rows()["simulation: pacing"].level != Level.ERROR, "it is not behind"
    )


def test_repeated_and_backward_stamps_are_refused(running: Running) -> None:
    heave, speed = running.publishers["ship/heave"], running.publishers["winch/speed_command"]
    at = time.time_ns() + 300_000_000
    for topic, publisher, data in (
        ("ship/heave", heave, encode_heave(at, 0.0, 0.0)),
        ("winch/speed_command", speed, encode_speed(at, 0.0)),
    ):
        taken = running.accepted(topic)
        publisher.publish(data)
        running.bench.until(
            lambda topic=topic, taken=taken: running.accepted(topic) > taken, f"{topic} is taken"
        )
    for stamp in (at, at - 50_000_000):
        for topic, data in (
            ("ship/heave", encode_heave(stamp, 0.0, 0.0)),
            ("winch/speed_command", encode_speed(stamp, 0.0)),
        ):
            refused = running.refused(topic)
            running.publishers[topic].publish(data)
            running.bench.until(
                lambda topic=topic, refused=refused: running.refused(topic) == refused + 1,
                f"{topic} with an old stamp is refused",
            )


def test_a_ship_does_not_jump(running: Running) -> None:
    heave = running.publishers["ship/heave"]
    at = time.time_ns() + 400_000_000
    accepted = running.accepted("ship/heave")
    heave.publish(encode_heave(at, 0.0, 0.0))
    running.bench.until(lambda: running.accepted("ship/heave") > accepted, "a good sample")
    refused = running.refused("ship/heave")
    heave.publish(encode_heave(at + 50_000_000, 8.0, 0.0))
    running.bench.until(lambda: running.refused("ship/heave") == refused + 1, "the jump is refused")


def test_good_inputs_are_still_taken_after_all_that(running: Running) -> None:
    taken = {topic: running.accepted(topic) for topic in BAD}
    at = time.time_ns() + 500_000_000
    running.publishers["ship/heave"].publish(encode_heave(at, 0.05, 0.0))
    running.publishers["winch/speed_command"].publish(encode_speed(at, 0.2))
    running.publishers["current"].publish(multi_array([0.0, 0.3, 0.1, -100.0, 0.1, 0.0], [2, 3]))
    for topic in BAD:
        running.bench.until(
            lambda topic=topic: running.accepted(topic) == taken[topic] + 1, f"{topic} is taken"
        )
    speed = lambda: running.node.paced.last.payout_speed_m_per_s  # noqa: E731
    running.bench.until(lambda: speed() == pytest.approx(0.2), "the winch pays out")


def test_somebody_else_on_an_input_is_reported(running: Running) -> None:
    second = running.bench.publisher("ship/heave")
    heard = running.bench.listen("diagnostics")
    running.bench.until(
        lambda: any(
            "more than one publisher of ship/heave" in row.message
            for message in heard
            for row in message.status
        ),
        "a warning about two sources",
    )
    running.bench.own.destroy_publisher(second)
