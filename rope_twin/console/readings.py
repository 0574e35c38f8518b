"""Newest message of each topic as the values that the console's pages show, in SI units.

A value keeps the name and unit of its topic; NaN and infinity are None, since JSON has neither.
Values of ropes are lists with an entry for each rope, in the order of the topics `ropes/...`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.messages import CloudReader, decode
from rope_twin.messages.reports import (
    CREW_LIMITS_ROW,
    FIGURE_COLUMNS,
    FORECAST_COLUMNS,
    FORECAST_TOPICS,
    QUIET_TOPIC,
    RISK_TOPIC,
    ROPES_TOPIC,
    STATES,
    band_columns,
    figure_unit,
    read_alerts,
)
from rope_twin.messages.reports import TENSION_TOPIC as FORECAST
from rope_twin.messages.templates import NANOSECONDS, nanoseconds, xyz
from rope_twin.topics import ALARM_TOPIC, ALERTS, BY_NAME, ESTIMATE_TOPIC, WHAT_IF_ORDERS
from rope_twin.twin.motion.ship_motion import turned
from rope_twin.twin.snapshot import CAUSES

Values = dict[str, Any]
Points = NDArray[Any]  # structured: a table

TENSION, NODES, EPOCH = "ropes/tension_top", "ropes/nodes", "twin/epoch"
SESSION, DIAGNOSTICS = "twin/session", "diagnostics"
SHORTEST_LIMIT_S = 0.7  # age above which a value of a fast topic is stale
PERIODS = 3.0  # of its topic: age above which a value of a slow one is stale
SLOW_EVERY, NUMBERS_EVERY = 4, 2  # calls of `update`: of figures in tables, and of large ones
AHEAD_S = 30.0  # of a forecast that is drawn
_TOP = band_columns("top_tension_n")
_BAND_S = AHEAD_S + 5.0  # of its lead: it counts from an origin some seconds ago
_DIGITS = 8  # significant digits of a number on the page's side


class Readings:
    """Newest message of each topic, decoded when its values are asked for."""

    def __init__(self) -> None:
        self._arrived_s: dict[str, float] = {}
        self._pending: dict[str, bytes] = {}
        self._texts: dict[str, bytes] = {}  # last message of a topic of text, which often repeats
        self._diagnostics: list[bytes] = []  # every one: each node publishes only its own rows
        self._tables = {topic: CloudReader(topic) for topic in _TABLES}
        self._updates = 0
        self._changed: Values = {}  # since the last `take_changed`
        self.values: Values = {}
        # twin's time of the newest top tension [s], by the epoch of its run; None: not known yet
        self.time_s: float | None = None
        self.epoch_ns: int | None = None  # ROS time of the twin's t = 0
        self.nodes: bytes | None = None  # newest ropes/nodes that `take_nodes` has not returned
        self.session: bytes | None = None  # likewise twin/session

    def take(self, topic: str, data: bytes, now_s: float) -> None:
        """Keep a message of one of SHOWN; `now_s`: steady time of its arrival."""
        self._arrived_s[topic] = now_s
        if topic == NODES:
            self.nodes = data
        elif topic == SESSION:
            self.session = data
        elif topic == DIAGNOSTICS:
            self._diagnostics.append(data)
        else:
            self._pending[topic] = data

    def due(self, topic: str) -> bool:
        """Return whether the next `update` reads a topic; others need not be taken."""
        return self._updates % _EVERY.get(topic, 1) == 0

    def update(self) -> Values:
        """Decode the messages taken since the last call and return the values they changed.

        Those of topics which no curve needs wait until they are due.
        """
        changed: Values = {}
        remaining: dict[str, bytes] = {}
        for topic, data in self._pending.items():
            if not self.due(topic):
                remaining[topic] = data
            elif self._texts.get(topic) != data:
                self._decode(topic, data, changed)
        for data in self._diagnostics:
            self._decode(DIAGNOSTICS, data, changed)
        self._pending, self._diagnostics = remaining, []
        self._updates += 1
        self._changed |= changed
        self.values |= changed
        return changed

    def _decode(self, topic: str, data: bytes, changed: Values) -> None:
        """Add the values of a message, or the reason why it cannot be read."""
        try:
            changed |= self._read(topic, data)
        except InputError as error:
            changed[f"fault {topic}"] = str(error)
            return
        except (ValueError, LookupError, TypeError) as error:  # lists of other lengths and the like
            remedy = "publish it with this version of rope_twin"
            changed[f"fault {topic}"] = phrase(topic, f"{type(error).__name__}: {error}", remedy)
            return
        if self.values.get(f"fault {topic}"):
            changed[f"fault {topic}"] = ""
        if topic in _UNSTAMPED:
            self._texts[topic] = data

    def take_changed(self) -> Values:
        """Decode what has arrived; return the values changed since the last call, once."""
        self.update()
        changed, self._changed = self._changed, {}
        return changed

    def put(self, name: str, value: Any) -> None:
        """Set a value of the console's own, such as a fault, if it differs."""
        if self.values.get(name) != value:
            self._changed[name] = self.values[name] = value

    def take_nodes(self) -> bytes | None:
        """Return the newest ropes/nodes message, once."""
        nodes, self.nodes = self.nodes, None
        return nodes

    def take_session(self) -> bytes | None:
        """Return the newest twin/session message, once."""
        session, self.session = self.session, None
        return session

    def ages(self, now_s: float) -> dict[str, float]:
        """Return the time since the newest message of each topic arrived [s]."""
        return {name: round(now_s - at_s, 3) for name, at_s in self._arrived_s.items()}

    def touch(self, now_s: float) -> None:
        """Take all messages as having arrived now, as of a recording that is paused."""
        self._arrived_s = dict.fromkeys(self._arrived_s, now_s)

    def _twin_s(self, stamp_ns: int) -> float | None:
        """Return the twin's time of a stamp [s]; None: t = 0 is not known yet."""
        return None if self.epoch_ns is None else (stamp_ns - self.epoch_ns) / NANOSECONDS

    def forget(self) -> None:
        """Forget all messages, as before a jump in a recording."""
        self.__init__()  # type: ignore[misc]

    def _read(self, topic: str, data: bytes) -> Values:
        if topic in _TABLES:
            stamp_ns, points = self._tables[topic].read(data)
            values = _TABLES[topic](points)
            if topic in _DATED:  # the stamp is of the data that it was made from, some time ago
                for table in values.values():
                    table["at_s"] = self._twin_s(stamp_ns)
            return values
        message = decode(topic, data)
        if topic == EPOCH:
            self.epoch_ns = nanoseconds(message)
            return {"epoch_s": self.epoch_ns / NANOSECONDS}
        if topic == TENSION:
            stamp_ns = nanoseconds(message.header.stamp)
            if self.epoch_ns is None:
                self.epoch_ns = stamp_ns
            self.time_s = self._twin_s(stamp_ns)
        return _READERS[topic](message)


def stale_limits_s() -> dict[str, float]:
    """Return the age above which the values of each topic are stale [s]; topics on change: none."""
    return {
        name: max(SHORTEST_LIMIT_S, PERIODS / BY_NAME[name].rate_hz)
        for name in SHOWN
        if BY_NAME[name].rate_hz > 0.0
    }


def number(value: float) -> float | None:
    """Return a number with the digits that a page can show, or None if it is not finite."""
    return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None


_BETWEEN_WINCHES = re.compile(r"; (?![^(]*\))")  # not within the limits in parentheses


def of_winches(text: str) -> list[str]:
    """Return what a text such as winch/mode says of each winch, with its name."""
    return [part for part in _BETWEEN_WINCHES.split(text) if part]


def of_winch(text: str, winch: str) -> str:
    """Return what a text such as winch/mode says of a winch, with its name; "": nothing."""
    return next((part for part in of_winches(text) if part.startswith(f"{winch}: ")), "")


def crew_limit(values: Values, name: str) -> float | None:
    """Return the crew's limit that the twin reports in the diagnostics; None: it reports none."""
    row = values.get(f"diagnostics {CREW_LIMITS_ROW}", {})
    text = row.get("values", {}).get(name)
    return None if text is None else float(text)


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [number(float(value)) for value in values]


def _rows(points: Points) -> list[Values]:
    """Return the points of a table as mappings; names become text."""
    columns = _columns(points, points.dtype.names or ())
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _columns(points: Points, names: Iterable[str]) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {}
    for name in names:
        column = points[name]
        if column.dtype.kind == "S":
            columns[name] = [value.decode("utf-8", "replace") for value in column.tolist()]
        else:
            columns[name] = [number(value) for value in column.tolist()]
    return columns


def _having(topic: str, required: Iterable[str], points: Points) -> Points:
    """Return the points of a table that must have certain columns.

    Raises:
        InputError: a column is missing.
    """
    missing = [name for name in required if name not in (points.dtype.names or ())]
    if missing:
        problem = f"the table has no column {', '.join(missing)}"
        raise InputError(topic, problem, "publish it with this version of rope_twin")
    return points


def _payloads(message: Any) -> Values:
    """Return place, velocity in map and attitude of each payload.

    Attitude as roll, pitch and heading [deg]: the angles of the rotation Rz·Ry·Rx of REP 103.
    """
    rows = []
    for name, pose, twist in zip(message.joint_names, message.transforms, message.twist,
                                 strict=True):  # fmt: skip
        turn = pose.rotation
        speed = turned((*xyz(turn), turn.w), xyz(twist.linear))
        roll = math.atan2(2 * (turn.w * turn.x + turn.y * turn.z),
                          1 - 2 * (turn.x**2 + turn.y**2))  # fmt: skip
        pitch = math.asin(max(-1.0, min(1.0, 2 * (turn.w * turn.y - turn.z * turn.x))))
        heading = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y),
                             1 - 2 * (turn.y**2 + turn.z**2))  # fmt: skip
        rows.append(
            {
                "name": str(name),
                "place_m": _numbers(xyz(pose.translation)),
                "velocity_m_per_s": _numbers(speed),
                "attitude_deg": _numbers(math.degrees(angle) for angle in (roll, pitch, heading)),
            }
        )
    return {"payloads": rows}


def _hang_off(message: Any) -> Values:
    place, speed = message.pose.pose.position, message.twist.twist.linear
    return {"hang_off_m": _numbers(xyz(place)), "hang_off_m_per_s": _numbers(xyz(speed))}


def _residuals(points: Points) -> Values:
    """Return the residuals; the name of a row is its quantity and the winch or payload."""
    rows = _rows(points)
    for row in rows:
        row["quantity"], _, row["name"] = row["name"].partition(" ")
    return {"residuals": rows}


def _quality(points: Points) -> Values:
    rows = _rows(points)
    for row in rows:
        number_of = row["cause"]
        known = number_of is not None and 0 <= number_of < len(CAUSES)
        row["cause"] = CAUSES[int(number_of)] if known else ""
    return {"quality": rows}


def _diagnostics(message: Any) -> Values:
    """Return the rows by name, since each node publishes only its own."""
    rows = {}
    for row in message.status:
        level = row.level[0] if isinstance(row.level, bytes) else int(row.level) & 0xFF
        values = {str(value.key): str(value.value) for value in row.values}
        rows[f"diagnostics {row.name}"] = {
            "level": level, "message": str(row.message), "values": values,
        }  # fmt: skip
    return rows


def _alerts(message: Any) -> Values:
    """Return the alerts in the order to be shown; times are those of the twin [s]."""
    _, now_ns, alerts = read_alerts(message)
    rows = [
        {
            "id": alert.key,
            "instance": alert.instance,
            "title": alert.name,
            "priority": alert.priority.name.lower(),
            "category": alert.category,
            "state": alert.state.name.lower(),
            "text": alert.text,
            "since_s": alert.since_ns / NANOSECONDS,
            "revision": alert.revision,
            "shelved": alert.shelved(now_ns),
            "first_out": alert.first_out,
            "sounds": alert.sounds(now_ns),
        }
        for alert in alerts
    ]
    return {"alerts": rows}


def _forecast(points: Points) -> Values:
    """Return the band of the main winch's rope."""
    return {"forecast": _band(_having(FORECAST, ("lead_s", *_TOP), points))}


def _forecast_ropes(points: Points) -> Values:
    """Return the band of each rope from a hang-off, by its number."""
    ahead = _having(ROPES_TOPIC, ("rope", "lead_s", *_TOP), points)
    numbers = np.unique(ahead["rope"][np.isfinite(ahead["rope"])])
    bands = {f"{number:g}": _band(ahead[ahead["rope"] == number]) for number in numbers}
    return {"forecast_ropes": {"bands": bands}}


def _band(ahead: Points) -> dict[str, list[Any]]:
    """Return a band of the top tension over the lead, a list for each column that is drawn."""
    columns = _columns(ahead[ahead["lead_s"] <= _BAND_S], ("lead_s", *_TOP))
    return dict(zip(("lead_s", "low_n", "median_n", "high_n"), columns.values(), strict=True))


def _risk(points: Points) -> Values:
    """Return the risk of each span, and whether it is known or the climatology of this sea."""
    rows = _rows(_having(RISK_TOPIC, FORECAST_COLUMNS[RISK_TOPIC], points))
    for row in rows:
        span, horizon = row["span_s"], row["horizon_s"]
        row["climatology"] = span is None or horizon is None or span > horizon
    return {"risk": {"rows": rows}}


def _figures(points: Points) -> Values:
    """Return the learned figures, with their units and state in words."""
    rows = _rows(_having(ESTIMATE_TOPIC, FIGURE_COLUMNS.split(), points))
    for row in rows:
        state = row["state"]
        known = state is not None and 0 <= state < len(STATES)
        row["state"] = STATES[int(state)] if known else ""
        row["unit"] = figure_unit(row["name"])
    return {"learned": {"rows": rows}}


def _table(name: str) -> Callable[[Points], Values]:
    return lambda points: {name: _rows(points)}


def _forecast_table(name: str, topic: str) -> Callable[[Points], Values]:
    columns = FORECAST_COLUMNS[topic]
    return lambda points: {name: {"rows": _rows(_having(topic, columns, points))}}


def _text(name: str) -> Callable[[Any], Values]:
    return lambda message: {name: str(message.data)}


_READERS: Mapping[str, Callable[[Any], Values]] = {
    TENSION: lambda message: {
        "ropes": [str(name) for name in message.name], "tension_n": _numbers(message.effort),
    },
    "ropes/length": lambda message: {
        "line_out_m": _numbers(message.position),
        "line_speed_m_per_s": _numbers(message.velocity),
    },
    "payloads/state": _payloads,
    "hang_off/odometry": _hang_off,
    "sea/elevation": lambda message: {"elevation_m": number(message.point.z)},
    "winch/mode": _text("winch_mode"),
    "winch/seat": _text("seat"),
    DIAGNOSTICS: _diagnostics,
    ALERTS: _alerts,
    ALARM_TOPIC: _text("fault_alarm"),
}  # fmt: skip
_TABLES: Mapping[str, Callable[[Points], Values]] = {
    "ropes/tension_top_error": _table("error_interval"),
    "ropes/utilisation": _table("utilisation"),
    "ropes/bend_radius": _table("bends"),
    "payloads/body": _table("body"),
    "seabed/contact": _table("bed"),
    "seabed/touchdown": _table("touchdowns"),
    "lines/crossings": _table("crossings"),
    "winch/state": _table("winches"),
    "compensator/state": _table("compensator"),
    "residuals": _residuals,
    "twin/quality": _quality,
    FORECAST: _forecast,
    ROPES_TOPIC: _forecast_ropes,
    RISK_TOPIC: _risk,
    QUIET_TOPIC: _forecast_table("quiet", QUIET_TOPIC),
    WHAT_IF_ORDERS: _forecast_table("orders", WHAT_IF_ORDERS),
    ESTIMATE_TOPIC: _figures,
}
_UNSTAMPED = ("winch/mode", "winch/seat", ALARM_TOPIC)
_DATED = (*FORECAST_TOPICS, ESTIMATE_TOPIC)
_EVERY = dict.fromkeys(
    ("ropes/utilisation", "ropes/bend_radius", "payloads/body", "seabed/contact",
     "seabed/touchdown", "lines/crossings", "sea/elevation", "winch/state", "compensator/state",
     "twin/quality", ESTIMATE_TOPIC, *FORECAST_TOPICS),
    SLOW_EVERY,
)  # fmt: skip
_EVERY |= dict.fromkeys(("ropes/length", "payloads/state", "hang_off/odometry"), NUMBERS_EVERY)
# topics that the console subscribes to
SHOWN = tuple(name for name in (EPOCH, SESSION, NODES, *_READERS, *_TABLES) if name in BY_NAME)
