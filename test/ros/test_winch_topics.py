"""Orders to a winch over DDS, and what it says of them: mode, parts, refusals."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from ros_bench import Bench, ros_ahead_ns

from rope_twin.messages import encode_order, read_cloud
from rope_twin.scene.load import load_scene
from rope_twin.topics import WINCH_TOPICS
from rope_twin.twin.winch.commands import WinchCommand

pytestmark = pytest.mark.ros


def test_a_winch_is_commanded_stopped_and_refuses_over_its_topics(
    bench: Bench, tmp_path: Path
) -> None:
    """The scene emergency_stop, on a drive that is strong enough not to render."""
    text = load_scene("emergency_stop").path.read_text()
    path = tmp_path / "strong.yaml"
    path.write_text(text.replace("torque_limit_n_m: 178000.0", "torque_limit_n_m: 400000.0"))
    node = bench.make("simulation", scene=str(path), speed=5.0)
    publishers = {topic: bench.publisher(topic) for topic in WINCH_TOPICS}
    mode, parts = (bench.listen(f"winch/{name}") for name in ("mode", "state"))
    state = bench.listen("ropes/length")
    node.begin()
    bench.until(lambda: mode and parts and state, "the winch speaks")
    bench.until(
        lambda: all(p.get_subscription_count() for p in publishers.values()), "the twin listens"
    )

    def tell(order: WinchCommand) -> None:
        topic, data = encode_order(0, order)
        publishers[topic].publish(data)

    def figures() -> dict[str, float]:
        (row,) = read_cloud(parts[-1])
        return {f"{row['name'].decode()}/{name}": float(row[name]) for name in row.dtype.names[1:]}

    tell(WinchCommand("length", 1003.0))
    bench.until(lambda: mode[-1].data == "winch: length 1003 m", "the order is reported")
    bench.until(lambda: abs(state[-1].position[0] - 1003.0) < 1e-5, "it is there")
    assert max(message.position[0] for message in state) < 1003.0 + 1e-6
    assert figures()["winch/target"] == 1003.0
    assert figures()["winch/layer"] == 1.0
    assert figures()["winch/drum_radius_m"] == pytest.approx(0.8 + 0.5 * 0.9 * 0.04)

    tell(WinchCommand("speed", 1.0))
    bench.until(lambda: state[-1].velocity[0] > 0.9, "it pays out")
    tell(WinchCommand("emergency_stop"))
    bench.until(lambda: figures()["winch/brake_holds"] == 1.0, "the brake holds")
    assert mode[-1].data.startswith("winch: emergency stop (emergency stop: no motion is obeyed")
    bench.until(lambda: state[-1].velocity[0] == 0.0, "it stands")

    tell(WinchCommand("compensate"))
    tell(WinchCommand("tension", 1e5))
    with _rows_if_it_fails(node):
        bench.until(lambda: _refused(node, "winch switch") == 1, "there is no compensation")
    bench.until(lambda: _refused(node, "winch command") == 1, "no tension is kept")


@contextmanager
def _rows_if_it_fails(node: Any) -> Iterator[None]:
    """Add the rows of winch and seat to the error: who had the seat, and what was refused."""
    try:
        yield
    except AssertionError as error:
        for row in node.paced.rows(ros_ahead_ns()):
            if "winch" in row.name or row.name.endswith("messages"):
                error.add_note(f"{row.name}: {row.message} {row.values}")
        raise


def _refused(node: Any, name: str) -> int:
    rows = {row.name: row for row in node.paced.rows(ros_ahead_ns())}
    return int(rows[f"simulation: input {name}"].values["refused"])


def test_a_schedule_publishes_where_its_rows_need_it() -> None:
    from rope_twin.ros.winch_schedule_node import topics_of

    def topics(scene: str) -> tuple[str, ...]:
        winch = load_scene(scene).winch
        assert winch is not None
        return topics_of([winch])

    speed = "winch/speed_command"
    assert topics("deep_lift") == (speed,)
    assert topics("emergency_stop") == (speed, "winch/switch_command")
    assert topics("abandonment_and_recovery") == WINCH_TOPICS[:4]


def test_orders_for_another_winch_and_stops_with_any_stamp(bench: Bench) -> None:
    """A one-rope scene refuses what is not for its winch; a stop by a broken clock stops it."""
    from ros_messages import with_bad_nanoseconds

    node = bench.make("simulation", scene="emergency_stop")
    speed, switch = (bench.publisher(f"winch/{name}_command") for name in ("speed", "switch"))
    mode = bench.listen("winch/mode")
    node.begin()
    bench.until(lambda: mode, "the winch speaks")
    for publisher in (speed, switch):
        bench.until(publisher.get_subscription_count, "the twin listens")
    speed.publish(encode_order(0, WinchCommand("speed", 0.5), "port_crane")[1])
    bench.until(lambda: _refused(node, "winch command") == 1, "it is not for this winch")
    speed.publish(encode_order(0, WinchCommand("speed", 0.5), "")[1])
    bench.until(lambda: "speed 0.5 m/s" in mode[-1].data, "without a name it is")
    switch.publish(with_bad_nanoseconds(encode_order(0, WinchCommand("emergency_stop"))[1]))
    bench.until(lambda: "emergency stop" in mode[-1].data, "it stops")
    row = next(
        r for r in node.paced.rows(ros_ahead_ns()) if r.name == "simulation: input winch switch"
    )
    assert "executed at once all the same" in row.message
    assert row.values["refused"] == "0"
