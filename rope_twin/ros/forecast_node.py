"""Forecast node: publishes tension, risks and quiet windows of the next minute every second.

It hears the ship's heave, line out and tension (measured ones, or the simulation's), and waves
measured up-sea; a thread of its own forecasts. The simulation does not depend on it.
"""

from __future__ import annotations

import math
import sys
from typing import Any

from rope_twin.errors import InputError
from rope_twin.forecast.heave_process import MotionError
from rope_twin.forecast.live import (
    LARGEST_GAP_S,
    ForecastWorker,
    Heard,
    LiveForecast,
    LiveForecaster,
    Series,
    orders_of,
    tables_of,
    usual_limits,
)
from rope_twin.forecast.orders import other_winches, read_orders
from rope_twin.forecast.recorded_lift import seabed_depth_m
from rope_twin.forecast.tension_forecast import (
    ERROR_MARGIN,
    LEARNED_SPREAD,
    ForecastSettings,
    unlearned_spread,
)
from rope_twin.messages import Level, Status, decode, encode_diagnostics, read_cloud
from rope_twin.messages.reports import FORECAST_TOPICS, encode_forecast
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
_HEARD = ("ship/heave", "hang_off/odometry", "ropes/length", "ropes/tension_top",
          WINCH_MEASURED, MEASURED_ELEVATION, _WINCH_STATE, ESTIMATE_TOPIC, WHAT_IF)  # fmt: skip
_DEPTH = 200  # messages that may queue in the middleware
_DIAGNOSTICS_S = 1.0
# after which the simulation's values stand in for measured ones: less than a gap that ends a series
_SILENT_S = 0.5 * LARGEST_GAP_S


class ForecastNode(SuiteNode):
    """Subscribes to motion, line and tension; its worker publishes the forecasts."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("forecast", **node_options)
        self._params = declare(self, ForecastParams)
        self._own_publishers = {name: publish(self, BY_NAME[name]) for name in FORECAST_TOPICS}
        self._diagnostics = publish(self, BY_NAME["diagnostics"])
        self._heard = Heard()
        self._measured_s = {"heave": -math.inf, "line": -math.inf, "tension": -math.inf}
        self.worker: ForecastWorker | None = None

    def begin(self) -> None:
        """Read the scene, subscribe and start the worker.

        Raises:
            RopeTwinError: the scene cannot be read, or a limit is not possible.
        """
        own = self._params
        scene = load_scene(own.scene)
        given = own.tension_limit_n, own.contact_limit_m_per_s, own.quiet_m_per_s, own.quiet_s
        self._limits = usual_limits(scene, given)
        self._hang_off, self._seabed_m = scene.ship.hang_off_m, seabed_depth_m(scene)
        error = MotionError(coloured_m=ERROR_MARGIN * own.motion_error_m)
        settings = ForecastSettings(
            members=own.members, motion_error=error, spread=unlearned_spread(scene.learning)
        )
        self._winches = ("", WINCH, scene.ropes[0].name)  # as the simulation calls its winch
        self._others = {
            called: name
            for name, (r, _) in other_winches(scene).items()
            for called in (name, scene.ropes[r].name)
        }
        self._bias_m, self._bias_n = scene.measured.line_out.bias, scene.measured.tension.bias
        heading = math.radians(own.wave_heading_deg)
        forecaster = LiveForecaster(scene, self._limits, settings, own.wave_noise_m, heading)
        self.worker = ForecastWorker(
            forecaster, self._heard, self._send, self._now_s, own.interval_s
        )
        for name in _HEARD:
            listen(self, BY_NAME[name], self._taker(name), _DEPTH)
        self.every(_DIAGNOSTICS_S, self._publish_diagnostics)
        self.worker.start()

    def close(self) -> None:
        """End the worker."""
        if self.worker is not None:
            self.worker.close()

    def _now_s(self) -> float:
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def _send(self, made: LiveForecast) -> None:
        """Publish the tables of a forecast, stamped with its origin (in the worker's thread)."""
        origin_ns = round(made.forecast.origin_s * 1e9)
        tables = tables_of(made, self._limits)
        if made.orders:
            tables[WHAT_IF_ORDERS] = orders_of(made, self._limits, self._seabed_m)
        for name, rows in tables.items():
            self._own_publishers[name].publish(encode_forecast(name, origin_ns, "map", rows))
        for words in made.refused:
            self.get_logger().warning(words)

    def _taker(self, name: str) -> Any:
        def take(data: bytes, info: dict[str, Any]) -> None:
            try:
                self._take(name, decode(name, data))
            except (InputError, IndexError, AttributeError) as error:
                if name == WHAT_IF:  # someone waits for the answer
                    self.get_logger().warning(f"{name}: {error}")
                else:
                    self.get_logger().warning(f"{name}: {error}", once=True)

        return take

    def _take(self, name: str, message: Any) -> None:
        """Append what a message says; the simulation's values only where nothing is measured."""
        if name == _WINCH_STATE:
            table = read_cloud(message)
            if len(table) and "compensation_on" in (table.dtype.names or ()):
                self._heard.compensation_on = bool(table["compensation_on"][0] > 0.5)
            return
        if name == WHAT_IF:
            self._heard.asked = read_orders(message.data)
            return
        if name == ESTIMATE_TOPIC:
            self._heard.figures = learned_figures(message)
            return
        at = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        heard = self._heard
        if name in ("ship/heave", "hang_off/odometry"):
            z = float(message.pose.pose.position.z)
            if name == "ship/heave":
                self._measured_s["heave"] = at
                heard.heave_m.add(at, z)
            elif at > self._measured_s["heave"] + _SILENT_S:
                heard.heave_m.add(at, z - self._hang_off[2])
        elif name == MEASURED_ELEVATION:
            place = message.point
            heading = math.radians(self._params.wave_heading_deg)
            along = (place.x - self._hang_off[0]) * math.cos(heading)
            along += (place.y - self._hang_off[1]) * math.sin(heading)
            if math.isfinite(along + place.z):
                heard.waves.append((at, -along, float(place.z)))
        else:
            self._take_line(at, name == WINCH_MEASURED, message)

    def _take_line(self, at: float, measured: bool, message: Any) -> None:
        for k, called in enumerate(message.name):
            name = self._others.get(called)
            if name is not None and len(message.position) > k:
                self._take_other(at, measured, name, float(message.position[k]))
        own = 0
        if measured:  # a message may have the readings of other winches too
            own = next((k for k, name in enumerate(message.name) if name in self._winches), -1)
            if own < 0:
                return
        rows = (("line", message.position, self._heard.line_out_m, self._bias_m),
                ("tension", message.effort, self._heard.tension_n, self._bias_n))  # fmt: skip
        for what, values, series, bias in rows:
            value = float(values[own]) - bias * measured if len(values) > own else math.nan
            if not math.isfinite(value):
                continue
            if measured:
                self._measured_s[what] = at
                if what == "tension":  # the twin's own would only judge itself
                    self._heard.pin_n.add(at, value)
            if measured or at > self._measured_s[what] + _SILENT_S:
                series.add(at, value)

    def _take_other(self, at: float, measured: bool, name: str, line_out_m: float) -> None:
        """Append the line out of a winch other than the main one."""
        if not math.isfinite(line_out_m):
            return
        what = f"line of {name}"
        if measured:
            self._measured_s[what] = at
            line_out_m -= self._bias_m
        if measured or at > self._measured_s.get(what, -math.inf) + _SILENT_S:
            self._heard.lines_m.setdefault(name, Series()).add(at, line_out_m)

    def _publish_diagnostics(self) -> None:
        worker = self.worker
        if worker is None:
            return
        values = {"forecasts": str(worker.made), "CPU time [s]": f"{worker.processor_s:.2f}"}
        level = Level.WARN if worker.trouble else Level.OK
        words = worker.trouble or "a forecast every second"
        if worker.waits and not worker.trouble:
            words = f"waits for {worker.waits}"
        row = Status("forecast: worker", level, words, values)
        now_ns = self.get_clock().now().nanoseconds
        self._diagnostics.publish(encode_diagnostics(now_ns, [row]))


def learned_figures(message: Any) -> tuple[dict[str, float], dict[str, float]]:
    """Return mean and standard deviation of the logarithms of the figures of estimate/figures."""
    mean, spread = dict[str, float](), dict[str, float]()
    for row in read_cloud(message):
        name = bytes(row["name"]).rstrip(b"\0").decode()
        value, scene_value, sd = (float(row[key]) for key in ("value", "prior", "sd"))
        if name in LEARNED_SPREAD and value * scene_value > 0.0 and math.isfinite(sd):
            mean[name], spread[name] = math.log(value / scene_value), sd / abs(value)
    return mean, spread


def main(args: list[str] | None = None) -> int:
    """Run the node (console entry); return the exit code."""
    return run_node(ForecastNode, args)


if __name__ == "__main__":
    sys.exit(main())
