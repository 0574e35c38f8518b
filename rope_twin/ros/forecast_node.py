"""Forecast node: publishes tension, risks and quiet windows of the next minute every second.

It hears the ship's heave, line out and tension (measured ones, or the simulation's), and waves
measured up-sea; a thread of its own forecasts. The simulation does not depend on it.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any

from rope_twin.errors import InputError
from rope_twin.forecast.admission import Admission
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
from rope_twin.messages.diagnostics import MOTION_ROW, SAMPLE_AGE
from rope_twin.messages.inputs import read_heave, read_measurement
from rope_twin.messages.reports import FORECAST_TOPICS, encode_forecast
from rope_twin.messages.status import read_diagnostics
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
          WINCH_MEASURED, MEASURED_ELEVATION, _WINCH_STATE, ESTIMATE_TOPIC, WHAT_IF,
          "diagnostics")  # fmt: skip
_DEPTH = 200  # messages that may queue in the middleware
_DIAGNOSTICS_S = 1.0
# after which the simulation's values stand in for measured ones: less than a gap that ends a series
_SILENT_S = 0.5 * LARGEST_GAP_S
_LOST_S = 0.5  # age of the newest heave that the simulation has accepted
_AHEAD_S = 10.0  # of the simulation; what was measured later is of another run


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
        self._admission = Admission(scene)
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
                if name == "ship/heave":
                    self._take_heave(data)
                elif name == "diagnostics":
                    self._take_diagnostics(data)
                elif name == WINCH_MEASURED:
                    self._take_measured(data)
                else:
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
        stamp = message.header.stamp
        at, heard = stamp.sec + 1e-9 * stamp.nanosec, self._heard
        if name == "hang_off/odometry":
            self._admission.note_simulated(stamp.sec * 1_000_000_000 + stamp.nanosec)
            if self._is_silent("heave", at) and not heard.doubt:
                z = float(message.pose.pose.position.z)
                heard.heave_m.add(at, z - self._hang_off[2])
        elif name == MEASURED_ELEVATION:
            place = message.point
            heading = math.radians(self._params.wave_heading_deg)
            along = (place.x - self._hang_off[0]) * math.cos(heading)
            along += (place.y - self._hang_off[1]) * math.sin(heading)
            if math.isfinite(along + place.z):
                heard.waves.append((at, -along, float(place.z)))
        else:
            self._take_simulated(at, message)

    def _take_heave(self, data: bytes) -> None:
        """Append a measured heave, unless the twin would refuse it."""
        stamp_ns, (z, rate) = read_heave(data)
        if self._admission.heave(stamp_ns, z, rate):
            at = self._measured_s["heave"] = 1e-9 * stamp_ns
            self._heard.heave_m.add(at, z)

    def _take_measured(self, data: bytes) -> None:
        """Append what the twin accepts of the readings of each winch."""
        _, stamp_ns, rows = read_measurement(WINCH_MEASURED, data)
        at, heard = 1e-9 * stamp_ns, self._heard
        for row in rows:
            name = WINCH if row[0] in self._winches else self._others.get(row[0])
            if name is None:
                continue
            _, line_out_m, _, tension_n = self._admission.reading(stamp_ns, name, row)
            if line_out_m is not None:
                self._measured_s["line" if name == WINCH else f"line of {name}"] = at
                self._line_of(name).add(at, line_out_m - self._bias_m)
            if tension_n is not None and name == WINCH:
                self._measured_s["tension"] = at
                for series in (heard.tension_n, heard.pin_n):  # the twin's would judge itself
                    series.add(at, tension_n - self._bias_n)

    def _line_of(self, winch: str) -> Series:
        heard = self._heard
        return heard.line_out_m if winch == WINCH else heard.lines_m.setdefault(winch, Series())

    def _is_silent(self, what: str, at: float) -> bool:
        """Return whether a quantity was not measured of late, or by another clock."""
        measured_s = self._measured_s.get(what, -math.inf)
        return not at - _SILENT_S <= measured_s <= at + _AHEAD_S

    def _take_simulated(self, at: float, message: Any) -> None:
        """Append line out and tension of the simulation where they are not measured."""
        for k, called in enumerate(message.name):
            name = WINCH if k == 0 else self._others.get(called)
            if name is None:
                continue
            what = "line" if name == WINCH else f"line of {name}"
            if len(message.position) > k and self._is_silent(what, at):
                self._line_of(name).add(at, float(message.position[k]))
        if len(message.effort) and self._is_silent("tension", at):
            self._heard.tension_n.add(at, float(message.effort[0]))

    def _take_diagnostics(self, data: bytes) -> None:
        """Forecast nothing while the simulation has lost the ship.

        Its heave is extrapolated then, also before these diagnostics came, and is not part of the
        record.
        """
        for row in read_diagnostics(data):
            if row.name == MOTION_ROW:
                age = row.values.get(SAMPLE_AGE, "never")
                lost = row.level == Level.ERROR and (age == "never" or float(age) > _LOST_S)
                self._heard.doubt = f"the ship's heave is lost, see {MOTION_ROW}" if lost else ""
                if lost:
                    self._heard.heave_m.drop_after(self._measured_s.get("heave", -math.inf))

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


def learned_figures(message: Any) -> tuple[dict[str, float], dict[str, float]]:
    """Return mean and standard deviation of the logarithms of the figures of estimate/figures.

    Raises:
        InputError: a column is missing.
    """
    mean, spread = dict[str, float](), dict[str, float]()
    table = read_cloud(message)
    missing = {"name", "value", "prior", "sd"}.difference(table.dtype.names or ())
    if missing:
        problem = f"the table has no column {', '.join(sorted(missing))}"
        raise InputError(ESTIMATE_TOPIC, problem, "publish it with this version of rope_twin")
    for row in table:
        name = bytes(row["name"]).rstrip(b"\0").decode("utf-8", "replace")
        value, scene_value, sd = (float(row[key]) for key in ("value", "prior", "sd"))
        if name in LEARNED_SPREAD and value * scene_value > 0.0 and math.isfinite(sd):
            mean[name], spread[name] = math.log(value / scene_value), sd / abs(value)
    return mean, spread


def main(args: list[str] | None = None) -> int:
    """Run the node (console entry); return the exit code."""
    return run_node(ForecastNode, args)


if __name__ == "__main__":
    sys.exit(main())
