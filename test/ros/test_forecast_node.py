"""The forecast node in this process: what it hears, when it publishes, and that it ends."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from ros_bench import Bench
from small_scene import small_scene

from rope_twin.estimation.figures import INDEX, Gaussian, scene_prior
from rope_twin.estimation.report import base_values, estimates
from rope_twin.forecast.tension_forecast import LEARNED_SPREAD
from rope_twin.messages import (
    Level,
    Status,
    decode,
    encode_diagnostics,
    encode_elevation,
    encode_heave,
    encode_measurement,
    read_cloud,
)
from rope_twin.messages.cdr import encode_text, new, serialise
from rope_twin.messages.diagnostics import MOTION_ROW, SAMPLE_AGE
from rope_twin.messages.encoder import Encoder
from rope_twin.messages.reports import encode_estimate
from rope_twin.ros.forecast_node import learned_figures
from rope_twin.ros.params import node_parameters
from rope_twin.run.options import RunOptions
from rope_twin.scene.load import load_scene
from rope_twin.twin.readings import Measurement
from rope_twin.twin.twin import Twin

pytestmark = pytest.mark.ros
S = 1_000_000_000
BEGIN_NS = 1_700_000_000 * S
PERIOD_S = 0.25


def test_it_publishes_what_it_forecasts(bench: Bench, tmp_path: Path) -> None:
    """Two minutes of measured motion, then a forecast stamped with the newest instant of it."""
    scene = small_scene(tmp_path)
    node = bench.make("forecast", scene=str(scene.path), members=19, tension_limit_n=80e3)
    names = ("ship/heave", "winch/measured", "sea/measured_elevation", "forecast/what_if")
    publishers = {name: bench.publisher(name) for name in names}
    tables = {
        name: bench.listen(f"forecast/{name}") for name in ("tension", "risk", "quiet", "orders")
    }
    heard = bench.listen("diagnostics")
    node.begin()
    for publisher in publishers.values():
        bench.until(publisher.get_subscription_count, "the node listens")
    bench.until(lambda: any("waits for" in one.status[0].message for one in heard), "it waits")
    count = round(125.0 / PERIOD_S)
    for k in range(count):
        at, ns = PERIOD_S * k, BEGIN_NS + round(PERIOD_S * k * 1e9)
        z = 0.5 * math.sin(0.6 * at)
        publishers["ship/heave"].publish(encode_heave(ns, z, 0.3 * math.cos(0.6 * at)))
        reading = Measurement.of_winch(ns, 200.0, 0.0, 76e3 + 4e3 * z)
        other = ("tugger", 15.0, 0.0, 9e3)  # another winch on the same line monitor
        both = reading._replace(rows=(other, *reading.rows))
        publishers["winch/measured"].publish(encode_measurement(ns, both)[1])
        if k % 4 == 0:
            publishers["sea/measured_elevation"].publish(encode_elevation(ns, 0.4 * z))
        if k % 20 == 0:
            length = len(node._inputs.heave_m.table())
            bench.until(
                lambda before=length: len(node._inputs.heave_m.table()) >= before, "it keeps up"
            )
        bench._spin(0.002)
    bench.until(lambda: all(tables[name] for name in ("tension", "risk", "quiet")), "forecasts")
    publishers["forecast/what_if"].publish(encode_text("swim"))  # a warning, and no more
    publishers["forecast/what_if"].publish(encode_text("lower:0.5 stop"))
    bench.until(lambda: node._inputs.asked, "the orders are heard")
    ns += round(0.5e9)
    publishers["ship/heave"].publish(encode_heave(ns, 0.1, 0.0))
    publishers["winch/measured"].publish(
        encode_measurement(ns, Measurement.of_winch(ns, 200.0, 0.0, 76e3))[1]
    )
    bench.until(lambda: tables["orders"], "orders are compared")
    answer = read_cloud(tables["orders"][0])
    assert {bytes(name) for name in answer["name"]} == {b"hold", b"lower:0.5", b"stop"}
    assert set(node._inputs.line_out_m.table()[:, 1].tolist()) == {200.0}
    message = tables["tension"][0]
    newest_s = BEGIN_NS // S + math.floor((count - 1) * PERIOD_S / 0.5) * 0.5
    assert message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec <= newest_s
    rows = read_cloud(message)
    assert len(rows) == 120
    assert (rows["top_tension_5_n"] <= rows["top_tension_95_n"]).all()
    risk = read_cloud(tables["risk"][0])
    assert risk["span_s"].tolist() == [10.0, 20.0, 30.0, 60.0]
    assert (risk["tension_limit_n"] == 80e3).all()
    assert read_cloud(tables["quiet"][0])["begin_s"][0] == 0.0
    assert len(node._inputs.waves) > 30
    node.close()
    assert not node.worker._thread.is_alive()


def test_it_hears_the_line_of_each_winch(bench: Bench) -> None:
    """By the name of its hang-off, or by that of its rope from the simulation."""
    node = bench.make("forecast", scene="two_line_lift", members=19)
    names = ("ship/heave", "winch/measured", "ropes/length")
    publishers = {name: bench.publisher(name) for name in names}
    node.begin()
    for publisher in publishers.values():
        bench.until(publisher.get_subscription_count, "the node listens")
    snapshot = Twin(load_scene("two_line_lift")).snapshot()
    publishers["ropes/length"].publish(Encoder(BEGIN_NS).encode("ropes/length", snapshot))
    lines = node._inputs.lines_m
    bench.until(lambda: "aft_sheave" in lines, "the simulation's line is heard")
    ns = BEGIN_NS + S
    rows = (("aft_sheave", 600.2, 0.0, 1e5), ("winch", 600.3, 0.0, 1e5))
    reading = Measurement.of_winch(ns)._replace(rows=rows)
    publishers["winch/measured"].publish(encode_measurement(ns, reading)[1])
    bench.until(lambda: len(lines["aft_sheave"].rows()) == 2, "the measured line is heard")
    assert lines["aft_sheave"].rows()[:, 1].tolist() == [600.0, 600.2]
    assert node._inputs.line_out_m.rows()[:, 1].tolist() == [600.0, 600.3]
    assert list(lines) == ["aft_sheave"]
    node.close()


def test_what_the_twin_would_refuse_is_not_heard(bench: Bench, tmp_path: Path) -> None:
    """Value by value; and while the simulation has lost the ship, nothing is forecast."""
    node = bench.make("forecast", scene=str(small_scene(tmp_path).path), members=19)
    names = "ship/heave", "winch/measured", "diagnostics", "estimate/figures", "hang_off/odometry"
    publishers = {name: bench.publisher(name) for name in names}
    rows = bench.listen("diagnostics")
    snapshot = Twin(load_scene(node._params.scene)).snapshot()
    node.begin()
    for publisher in publishers.values():
        bench.until(publisher.get_subscription_count, "the node listens")
    heard, ns = node._inputs, BEGIN_NS
    for k in range(4):
        ns += S // 4
        publishers["ship/heave"].publish(encode_heave(ns, 1e6 if k == 2 else 0.01 * k, 0.04))
        line_out_m = 350.0 if k == 2 else 200.0
        reading = Measurement.of_winch(ns, line_out_m, 0.0, 1e12 if k == 1 else 76e3)
        publishers["winch/measured"].publish(encode_measurement(ns, reading)[1])
        bench.until(lambda k=k: len(heard.line_out_m.rows()) >= k, "it keeps up")
    bench.until(lambda: len(heard.line_out_m.rows()) == 3, "the last reading is heard")
    assert heard.heave_m.rows()[:, 1].tolist() == [0.0, 0.01, 0.03]
    assert heard.line_out_m.rows()[:, 1].tolist() == [200.0] * 3
    assert heard.tension_n.rows()[:, 1].tolist() == [76e3] * 3

    node._add_line("winch", ns * 1e-9 + 0.1, 203.0)
    assert heard.line_out_m.rows()[:, 1].tolist() == [203.0], "no winch is so fast"

    def simulate(after_s: int) -> None:
        message = Encoder(ns + after_s * S).encode("hang_off/odometry", snapshot)
        publishers["hang_off/odometry"].publish(message)

    simulate(2)
    bench.until(lambda: len(heard.heave_m.rows()) == 4, "the simulation's heave is heard")
    for level, age, doubted in ((2, "4.2", True), (2, "0.1", False), (0, "0.1", False)):
        row = Status(MOTION_ROW, Level(level), "stale", {SAMPLE_AGE: age})
        strange = new("diagnostic_msgs/msg/DiagnosticStatus", level=-56, name=MOTION_ROW)
        publishers["diagnostics"].publish(
            serialise(new("diagnostic_msgs/msg/DiagnosticArray", status=[strange]))
        )
        publishers["estimate/figures"].publish(serialise(new("sensor_msgs/msg/PointCloud2")))
        publishers["diagnostics"].publish(encode_diagnostics(ns, [row]))
        bench.until(lambda on=doubted: bool(heard.doubt) == on, "the simulation's doubt is heard")
        rows.clear()
        bench.until(lambda: any(one.status[0].name == "forecast: worker" for one in rows), "rows")
        own = next(one.status[0] for one in rows if one.status[0].name == "forecast: worker")
        assert own.level == (Level.WARN if doubted else Level.OK)
        counts = {pair.key: pair.value for pair in own.values}
        assert counts["ship/heave: refused"] == "1"
        assert counts["winch/measured: refused"] == "2"
        if doubted:
            simulate(3)
            bench._spin(0.2)
            assert len(heard.heave_m.rows()) == 3, "an extrapolation is no part of the record"
    node.close()


def test_a_run_without_it_has_no_such_node() -> None:
    """`--ahead` alone starts it."""
    assert "forecast" not in node_parameters(RunOptions())
    assert node_parameters(RunOptions(ahead=True))["forecast"] == {"scene": "deep_lift"}


def test_learned_figures_are_heard_as_they_were_published() -> None:
    """Mean and deviation of the logarithms of the factors on the scene's figures; no others.

    None of them count while one is at the limit of its prior.
    """
    scene = load_scene("shallow_lift")
    prior, base = scene_prior(scene), base_values(scene)
    posterior = Gaussian(prior.mean + 0.3 * prior.sd, 0.25 * prior.gaussian.covariance)

    def heard(at_limit: tuple[str, ...]) -> Any:
        rows = [asdict(one) for one in estimates(base, prior, posterior, at_limit=at_limit)]
        return learned_figures(decode("estimate/figures", encode_estimate(0, rows)))

    mean, spread = heard(())
    known = [name for name in LEARNED_SPREAD if base[name]]
    assert "submerged_weight" in known
    assert mean == pytest.approx({name: posterior.mean[INDEX[name]] for name in known}, rel=1e-4)
    assert spread == pytest.approx({name: posterior.sd[INDEX[name]] for name in known}, rel=1e-6)
    assert heard(("tension_bias",)) is None
