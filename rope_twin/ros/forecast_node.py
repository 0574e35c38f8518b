"""Forecast node: publishes tension, risks and quiet windows of the next minute every second.

It subscribes to the ship's heave, line out and tension (measured, or those of the simulation) and
to waves measured up-sea; a worker thread forecasts. The simulation does not depend on it.
"""

from __future__ import annotations

import math
import sys
import time
from functools import partial
from typing import Any

from rope_twin.errors import InputError
from rope_twin.forecast import live
from rope_twin.forecast.admission import Admission
from rope_twin.forecast.heave_process import MotionError
from rope_twin.forecast.orders import other_winches, read_orders
from rope_twin.forecast.recorded_lift import seabed_depth_m
from rope_twin.forecast.tension_forecast import (
    ERROR_MARGIN,
    LEARNED_SPREAD,
    ForecastSettings,
    unlearned_spread,
)
from rope_twin.messages import Level, Status, decode, encode_diagnostics, read_cloud
from rope_twin.messages.diagnostics import MOTION_ROW, SAMPLE_AGE
from rope_twin.messages.inputs import read_heave, read_measurement
from rope_twin.messages.reports import (
    FORECAST_TOPICS,
    STATES,
    encode_forecast,
    read_diagnostics,
)
from rope_twin.messages.templates import nanoseconds
from rope_twin.ros.entry import SuiteNode, run_node
from rope_twin.ros.params import ForecastParams, declare
from rope_twin.ros.qos import listen, publish
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import WINCH
from rope_twin.topics import (
    BY_NAME,
    ESTIMATE_TOPIC,
    MEASURED_ELEVATION,
    WHAT_IF,
    WHAT_IF_ORDERS,
    WINCH_MEASURED,
)

_WINCH_STATE = "winch/state"
_SUBSCRIBED = ("ship/heave", "hang_off/odometry", "ropes/length", "ropes/tension_top",
          WINCH_MEASURED, MEASURED_ELEVATION, _WINCH_STATE, ESTIMATE_TOPIC, WHAT_IF,
          "diagnostics")  # fmt: skip
_DEPTH = 200  # messages that may queue in the middleware
_DIAGNOSTICS_S = 1.0
# after which values of the simulation replace measured ones: shorter than a gap that ends a series
_SILENT_S = 0.5 * live.LARGEST_GAP_S
_LOST_S = 0.5  # age of the newest heave that the simulation has accepted
_AHEAD_S = 10.0  # of the simulation; later measurements are of another run


class ForecastNode(SuiteNode):
    """Subscribes to motion, line and tension; its worker publishes the forecasts."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("forecast", **node_options)
        self._params = declare(self, ForecastParams)
        self._own_publishers = {name: publish(self, BY_NAME[name]) for name in FORECAST_TOPICS}
        self._diagnostics = publish(self, BY_NAME["diagnostics"])
        self._inputs = live.LiveInputs()
        self._measured_s = {"heave": -math.inf, "line": -math.inf, "tension": -math.inf}
        self.worker: live.ForecastWorker | None = None

    def begin(self) -> None:
        """Read the scene, subscribe and start the worker."""
        params = self._params
        scene = load_scene(params.scene)
        limits = params.tension_limit_n, params.contact_limit_m_per_s
        self._limits = live.read_limits(scene, (*limits, params.quiet_m_per_s, params.quiet_s))
        self._hang_off, self._seabed_m = scene.ship.hang_off_m, seabed_depth_m(scene)
        error = MotionError(coloured_m=ERROR_MARGIN * params.motion_error_m)
        settings = ForecastSettings(
            members=params.members, motion_error=error, spread=unlearned_spread(scene.learning)
        )
        # names of the main winch in the topics of the simulation
        self._winches = "", WINCH, scene.ropes[0].name
        self._others = {
            label: name
            for name, (r, _) in other_winches(scene).items()
            for label in (name, scene.ropes[r].name)
        }
        self._admission = Admission(scene)
        self._bias_m, self._bias_n = scene.measured.line_out.bias, scene.measured.tension.bias
        heading = math.radians(params.wave_heading_deg)
        forecaster = live.LiveForecaster(
            scene, self._limits, settings, params.wave_noise_m, heading
        )
        self.worker = live.ForecastWorker(
            forecaster, self._inputs, self._send, self._now_s, params.interval_s
        )
        for name in _SUBSCRIBED:
            listen(self, BY_NAME[name], self._taker(name), _DEPTH)
        self.every(_DIAGNOSTICS_S, self._publish_diagnostics)
        self.worker.start()

    def close(self) -> None:
        """Stop the worker."""
        if self.worker is not None:
            self.worker.close()

    def _now_s(self) -> float:
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def _send(self, forecasts: live.LiveForecast) -> None:
        """Publish the tables of a forecast, stamped with its origin (in the worker's thread)."""
        origin_ns = round(forecasts.forecast.origin_s * 1e9)
        tables = live.forecast_rows(forecasts, self._limits)
        if forecasts.orders:
            tables[WHAT_IF_ORDERS] = live.order_rows(forecasts, self._limits, self._seabed_m)
        for name, rows in tables.items():
            self._own_publishers[name].publish(encode_forecast(name, origin_ns, "map", rows))
        for reason in forecasts.refused:
            self.get_logger().warning(reason)

    def _taker(self, name: str) -> Any:
        def take(data: bytes, info: dict[str, Any]) -> None:
            try:
                if name == "ship/heave":
                    self._take_heave(data)
                elif name == "diagnostics":
                    self._take_diagnostics(data)
                elif name == WINCH_MEASURED:
                    self._take_measured(data)
                else:
                    self._take(name, decode(name, data))
            except (InputError, IndexError, AttributeError) as error:
                if name == WHAT_IF:  # a user waits for the answer
                    self.get_logger().warning(f"{name}: {error}")
                else:
                    self.get_logger().warning(f"{name}: {error}", once=True)

        return take

    def _take(self, name: str, message: Any) -> None:
        """Append the values of a message; simulated ones only where none is measured."""
        if name == _WINCH_STATE:
            table = read_cloud(message)
            if len(table) and "compensation_on" in (table.dtype.names or ()):
                self._inputs.compensation_on = bool(table["compensation_on"][0] > 0.5)
            return
        if name == WHAT_IF:
            self._inputs.asked = read_orders(message.data)
            return
        if name == ESTIMATE_TOPIC:
            self._inputs.figures = learned_figures(message) or self._inputs.figures
            return
        stamp = message.header.stamp
        at_s, inputs = stamp.sec + 1e-9 * stamp.nanosec, self._inputs
        if name == "hang_off/odometry":
            self._admission.note_simulated(nanoseconds(stamp))
            if self._is_silent("heave", at_s) and not inputs.doubt:
                z = float(message.pose.pose.position.z)
                inputs.heave_m.add(at_s, z - self._hang_off[2])
        elif name == MEASURED_ELEVATION:
            point = message.point
            heading = math.radians(self._params.wave_heading_deg)
            downwave_m = (point.x - self._hang_off[0]) * math.cos(heading)
            downwave_m += (point.y - self._hang_off[1]) * math.sin(heading)
            if math.isfinite(downwave_m + point.z):
                inputs.waves.append((at_s, -downwave_m, float(point.z)))
        else:
            self._take_simulated(at_s, message)

    def _take_heave(self, data: bytes) -> None:
        """Append a measured heave, unless the twin would reject it."""
        stamp_ns, (z, rate) = read_heave(data)
        if self._admission.heave(stamp_ns, z, rate):
            at_s = self._measured_s["heave"] = 1e-9 * stamp_ns
            self._inputs.heave_m.add(at_s, z)

    def _take_measured(self, data: bytes) -> None:
        """Append the readings of each winch that the twin accepts."""
        _, stamp_ns, rows = read_measurement(WINCH_MEASURED, data)
        at_s, inputs = 1e-9 * stamp_ns, self._inputs
        for row in rows:
            name = WINCH if row[0] in self._winches else self._others.get(row[0])
            if name is None:
                continue
            _, line_out_m, _, tension_n = self._admission.reading(stamp_ns, name, row)
            if line_out_m is not None:
                self._measured_s["line" if name == WINCH else f"line of {name}"] = at_s
                self._add_line(name, at_s, line_out_m - self._bias_m)
            if tension_n is not None and name == WINCH:
                self._measured_s["tension"] = at_s
                # `pin_n` verifies by measurements only, not by the twin's tension
                for series in (inputs.tension_n, inputs.pin_n):
                    series.add(at_s, tension_n - self._bias_n)

    def _add_line(self, winch: str, at_s: float, line_out_m: float) -> None:
        """Append a line out; after a jump that no winch makes the record begins again."""
        inputs = self._inputs
        series = inputs.line_out_m
        if winch != WINCH:
            series = inputs.lines_m.setdefault(winch, live.Series())
        since_s = at_s - series.newest_s
        series.add(at_s, line_out_m, self._admission.reach_m(winch, max(since_s, 0.0)))

    def _is_silent(self, quantity: str, at_s: float) -> bool:
        """Return whether a quantity was not measured recently, or with another clock."""
        measured_s = self._measured_s.get(quantity, -math.inf)
        return not at_s - _SILENT_S <= measured_s <= at_s + _AHEAD_S

    def _take_simulated(self, at_s: float, message: Any) -> None:
        """Append line out and tension of the simulation where they are not measured."""
        for k, label in enumerate(message.name):
            name = WINCH if k == 0 else self._others.get(label)
            if name is None:
                continue
            quantity = "line" if name == WINCH else f"line of {name}"
            if len(message.position) > k and self._is_silent(quantity, at_s):
                self._add_line(name, at_s, float(message.position[k]))
        if len(message.effort) and self._is_silent("tension", at_s):
            self._inputs.tension_n.add(at_s, float(message.effort[0]))

    def _take_diagnostics(self, data: bytes) -> None:
        """Suspend forecasts while the simulation has no ship motion.

        Its heave is then extrapolated, even before these diagnostics arrive, and is removed from
        the record.
        """
        for row in read_diagnostics(data):
            if row.name == MOTION_ROW:
                age = row.values.get(SAMPLE_AGE, "never")
                is_lost = row.level == Level.ERROR and (age == "never" or float(age) > _LOST_S)
                lost = f"the ship's heave is lost, see {MOTION_ROW}"
                self._inputs.doubt = lost if is_lost else ""
                if is_lost:
                    self._inputs.heave_m.drop_after(self._measured_s.get("heave", -math.inf))

    def _publish_diagnostics(self) -> None:
        worker = self.worker
        if worker is None:
            return
        values = {"forecasts": str(worker.made), "CPU time [s]": f"{worker.processor_s:.2f}"}
        refused = self._admission.refused
        values |= {f"{topic}: refused": str(count) for topic, count in refused.items()}
        if refused:
            values["last refusal"] = self._admission.last_refusal
        works, words = worker.state(time.monotonic())
        row = Status("forecast: worker", Level.OK if works else Level.WARN, words, values)
        now_ns = self.get_clock().now().nanoseconds
        self._diagnostics.publish(encode_diagnostics(now_ns, [row]))


def learned_figures(message: Any) -> tuple[dict[str, float], dict[str, float]] | None:
    """Return mean and standard deviation of the logarithms of the figures of estimate/figures.

    None: one of them is at the limit of its prior, so that they are not those of this lift.

    Raises:
        InputError: a column is missing.
    """
    mean, spread = dict[str, float](), dict[str, float]()
    table = read_cloud(message)
    missing = {"name", "value", "prior", "sd", "state"}.difference(table.dtype.names or ())
    if missing:
        problem = f"the table has no column {', '.join(sorted(missing))}"
        raise InputError(ESTIMATE_TOPIC, problem, "publish it with this version of rope_twin")
    if (table["state"] == STATES.index("at limit")).any():
        return None
    for row in table:
        name = bytes(row["name"]).rstrip(b"\0").decode("utf-8", "replace")
        value, scene_value, sd = (float(row[key]) for key in ("value", "prior", "sd"))
        if name in LEARNED_SPREAD and value * scene_value > 0.0 and math.isfinite(sd):
            mean[name], spread[name] = math.log(value / scene_value), sd  # sd of the logarithm
    return mean, spread


main = partial(run_node, ForecastNode)  # console entry

if __name__ == "__main__":
    sys.exit(main())
