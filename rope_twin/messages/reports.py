"""Reports: rows of the diagnostics, and messages on learned figures, forecasts and alerts.

Residuals are measured less computed. Forecasts are tables: the band of each quantity over the lead,
risks, and quiet windows. The alert list has one DiagnosticStatus for each alert, in the order to be
shown.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from rope_twin.alerts.alert_list import Alert, Priority, State
from rope_twin.errors import InputError
from rope_twin.messages import templates
from rope_twin.messages.cdr import decode, new, serialise
from rope_twin.quantity import or_nan
from rope_twin.topics import ALERTS, FORECAST_RISK, WHAT_IF_ORDERS
from rope_twin.twin.snapshot import (
    CAUSES,
    DISCRETISATION,
    RESIDUAL,
    UNPROVEN,
    Quality,
    Residual,
    Snapshot,
    disagrees,
)

HARDWARE_ID = "rope_twin"
RECORDER_ROW = "recorder: bag"
_QUANTITIES = {  # name, scale, unit and number format of what is measured
    "top_tension_n": ("top tension", 1e-3, "kN", ".2f"),
    "line_out_m": ("line out", 1.0, "m", ".2f"),
    "payload_depth_m": ("payload depth", 1.0, "m", ".2f"),
}
DOUBTFUL = 0.5  # below it a result must not be used for a decision
QUALITY_COLUMNS = f"name index cause {' '.join(CAUSES)}"
_ROUND_OFF = 1e-9


class Level(IntEnum):
    """Level of a diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Status:
    """Diagnostics row: name, level, message of one sentence, and key values."""

    name: str
    level: Level
    message: str
    values: dict[str, str] = field(default_factory=dict)


def encode_diagnostics(stamp_ns: int, rows: Sequence[Status]) -> bytes:
    """Return a `diagnostics` message with one DiagnosticStatus per row."""
    header = new("std_msgs/msg/Header", stamp=templates.time(stamp_ns))
    status = [
        new(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=int(row.level),
            name=row.name,
            message=row.message,
            hardware_id=HARDWARE_ID,
            values=[
                new("diagnostic_msgs/msg/KeyValue", key=key, value=value)
                for key, value in row.values.items()
            ],
        )
        for row in rows
    ]
    return serialise(new("diagnostic_msgs/msg/DiagnosticArray", header=header, status=status))


def read_diagnostics(data: bytes) -> list[Status]:
    """Return the rows of a `diagnostics` message; a level beyond ERROR (stale) is ERROR.

    Raises:
        InputError: the bytes are not such a message.
    """
    return [
        Status(
            str(row.name),
            Level(min(int(row.level) & 0xFF, Level.ERROR)),  # a byte, with a sign in its array
            str(row.message),
            {str(pair.key): str(pair.value) for pair in row.values},
        )
        for row in decode("diagnostics", data).status
    ]


def residuals_status(residuals: Sequence[Residual], now_s: float = -math.inf) -> Status:
    """Return the row on measured less computed values: WARN if one disagrees for long.

    now_s: twin time, to report old measurements as such.
    """
    values: dict[str, str] = {}
    for residual in residuals:
        quantity, scale, unit, form = _QUANTITIES[residual.quantity]
        label = f"{residual.name}: {quantity}"
        values |= {
            f"{label}, measured [{unit}]": f"{scale * residual.measured:{form}}",
            f"{label}, computed [{unit}]": f"{scale * residual.computed:{form}}",
            f"{label}, mean residual of 60 s [{unit}]": f"{scale * residual.mean:{form}}",
            f"{label}, RMS residual of 60 s [{unit}]": f"{scale * residual.rms:{form}}",
        }
        if residual.outside is not None:
            values[f"{label}, outside its interval [%]"] = f"{100.0 * residual.outside:.0f}"
    outside = [residual for residual in residuals if disagrees(residual)]
    words = "; ".join(residual_words(residual, now_s) for residual in outside or residuals)
    level = Level.WARN if outside else Level.OK
    return Status("simulation: residuals", level, words, values)


OLD_S = 10.0  # age from which a measurement is reported with it


def residual_words(residual: Residual, now_s: float = -math.inf) -> str:
    """Return a residual in words, with its interval and statistics; now_s: twin time."""
    quantity, scale, unit, form = _QUANTITIES[residual.quantity]
    age_s = now_s - residual.at_s
    old = f", {age_s:.0f} s ago" if age_s > OLD_S else ""
    words = (
        f"{quantity} of '{residual.name}'{old}: "
        f"measured {scale * residual.measured:{form}} {unit}, "
        f"computed {scale * residual.computed:{form}} {unit}, mean residual "
        f"{scale * residual.mean:+{form}} {unit}"
    )
    if residual.half_width is None or residual.outside is None:
        words = f"{words}, interval unknown (give `measured` in the scene)"
        if residual.explained is None or not disagrees(residual):
            return words
        return (
            f"{words}; the scene's uncertainties of load and load pin explain "
            f"±{scale * residual.explained:{form}} {unit}"
        )
    scope = "" if residual.twin is not None else " (of the instrument alone)"
    outside = f"{100.0 * residual.outside:.0f} % outside"
    return f"{words}, {outside} ±{scale * residual.half_width:{form}} {unit}{scope}"


def quality_rows(snapshot: Snapshot) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of `twin/quality`; cause: its number in CAUSES, NaN: unknown."""
    for quality in snapshot.quality:
        components = map(or_nan, quality.components)
        yield quality.element, quality.index, CAUSES.index(quality.cause), *components


def quality_status(elements: Sequence[Quality]) -> Status:
    """Return the row on the lowest index: OK from UNPROVEN, ERROR below DOUBTFUL."""
    values: dict[str, str] = {}
    for element in elements:
        label = element.element.replace("_", " ")
        values[f"{label}: index"] = f"{element.index:.3f}"
        values[f"{label}: reason"] = f"{element.cause}: {element.reason}" if element.reason else ""
        values |= {
            f"{label}: {cause}": "unknown" if value is None else f"{value:.3f}"
            for cause, value in zip(CAUSES, element.components, strict=True)
        }
    worst = min(elements, key=lambda element: element.index)
    level = Level.OK if worst.index >= UNPROVEN - _ROUND_OFF else Level.WARN
    level = Level.ERROR if worst.index < DOUBTFUL - _ROUND_OFF else level
    return Status("simulation: quality", level, quality_words(worst), values)


def quality_words(quality: Quality) -> str:
    """Return the lowest index in words, in tenths as it rises, with its reason."""
    tenths = math.floor(10.0 * quality.index + 10.0 * _ROUND_OFF) / 10.0
    words = f"lowest index {tenths:.1f} ({quality.element.replace('_', ' ')})"
    relation = "rising after" if is_rising(quality) else "limited by"
    return f"{words}, {relation} {quality.cause}: {quality.reason}" if quality.reason else words


def is_rising(quality: Quality) -> bool:
    """Return whether the index is below all that limits it now, after a fall."""
    components = dict(zip(CAUSES, quality.components, strict=True))
    limits = [value for value in quality.components if value is not None]
    unproven = components[RESIDUAL] is None or components[DISCRETISATION] is None
    return quality.index < min([*limits, UNPROVEN if unproven else 1.0]) - _ROUND_OFF


def lowest_words(elements: Sequence[dict[str, Any]]) -> str:
    """Return the lowest index of a run, from the fields of each Quality, and the present one."""
    worst = min(elements, key=lambda element: float(element["lowest"]))
    present = min(float(element["index"]) for element in elements)
    name = worst["element"].replace("_", " ")
    words = f"quality index: {present:.2f} now, lowest {worst['lowest']:.2f} ({name}"
    if worst["lowest_at_s"] > 0.0:
        words += f" at {worst['lowest_at_s']:.1f} s"
    reason = worst["reason" if worst["index"] <= worst["lowest"] else "lowest_reason"]
    return f"{words}): {reason}" if reason else f"{words})"


FIGURE_COLUMNS = "name value low high prior prior_sd sd state correlation"
STATES = "not observable", "weak", "learned", "at limit"  # numbers 0 to 3 of the column `state`
# of value, low, high and prior
UNITS = {
    "submerged_weight": "N", "oscillating_mass": "kg", "payload_drag": "m²",
    "axial_stiffness": "N", "axial_damping": "N·s", "tangential_drag": "kg/m²", "current": "-",
    "tension_bias": "N", "tension_gain": "-", "heave_gain": "-", "heave_delay": "s",
    "sheave_friction": "-", "line_offset": "m", "line_slip": "-",
}  # fmt: skip
ROW = "simulation: learned figures"
TENSION_TOPIC, RISK_TOPIC, QUIET_TOPIC = "forecast/tension", FORECAST_RISK, "forecast/quiet"
ROPES_TOPIC = "forecast/ropes"
SCORE = "coverage", "judged", "factor", "age_s"  # verification of the last forecasts
FORECAST_TOPICS = TENSION_TOPIC, ROPES_TOPIC, RISK_TOPIC, QUIET_TOPIC, WHAT_IF_ORDERS
QUANTITIES = (
    "top_tension_n", "payload_tension_n", "payload_depth_m", "payload_speed_m_per_s",
    "slack_margin_n",
)  # fmt: skip
PERCENTILES = (5, 50, 95)
_LEVELS = {
    Priority.CAUTION: Level.WARN, Priority.WARNING: Level.WARN,
    Priority.ALARM: Level.ERROR, Priority.EMERGENCY: Level.ERROR,
}  # fmt: skip
CREW_LIMITS_ROW = "simulation: crew limits"


def figure_unit(name: str) -> str:
    """Return the unit of a learned figure, also of a further winch (winch/figure); "": unknown."""
    return UNITS.get(name.rpartition("/")[2], "")


def encode_estimate(stamp_ns: int, rows: Sequence[dict[str, Any]]) -> bytes:
    """Return a message of estimate/figures.

    stamp_ns: ROS time of the end of the data that were learned from. rows: values of
    FIGURE_COLUMNS, with `state` one of STATES.
    """
    numbered = [row | {"state": STATES.index(row["state"])} for row in rows]
    return _encode_table(FIGURE_COLUMNS.split(), stamp_ns, "map", numbered)


def _encode_table(
    columns: Sequence[str], stamp_ns: int, frame_id: str, rows: Sequence[Mapping[str, float | str]]
) -> bytes:
    """Return a PointCloud2 of rows: values by column, the column name in at most 32 bytes."""
    points = np.zeros(len(rows), templates.point_type(templates.columns(" ".join(columns))))
    for name in columns:
        values = [row.get(name, "" if name == "name" else math.nan) for row in rows]
        points[name] = [value.encode() if isinstance(value, str) else value for value in values]
    message: Any = templates.cloud(frame_id, len(rows), points.dtype)
    message.data = np.frombuffer(points.tobytes(), np.uint8)
    message.header.stamp = templates.time(stamp_ns)
    return serialise(message)


def alarm_words(alarm: dict[str, Any]) -> str:
    """Return an alarm of a run in words, from its `--json`."""
    return f"alarm at {alarm['found_s']:.0f} s: {alarm['causes']}, since {alarm['begun_s']:.0f} s"


def learned_words(row: dict[str, Any]) -> str:
    """Return a learned figure in words, from the fields of a FigureEstimate."""
    unit = "" if row["unit"] == "-" else f" {row['unit']}"
    words = (
        f"{row['name'].replace('_', ' ')}: {row['value']:.4g}{unit}, 90 % {row['low']:.4g} to "
        f"{row['high']:.4g}{unit} (scene {row['prior']:.4g}), {row['state']}"
    )
    return f"{words}; {row['advice']}" if row["advice"] else words


def estimate_status(
    words: str, trouble: str, rows: Sequence[dict[str, Any]], minutes: int, core_pct: float
) -> Status:
    """Return the row on learning: WARN if it has stopped.

    words: its present activity; trouble: why it has stopped, or ""; rows: as for `encode_estimate`.
    """
    values = {
        "minutes learned from": str(minutes),
        "CPU [% of a core]": f"{core_pct:.2f}",
    }
    for row in rows:
        spread = f"{row['low']:.4g} to {row['high']:.4g} {row['unit']}, {row['state']}"
        values[row["name"]] = f"{row['value']:.4g} {row['unit']}, 90 % {spread}"
    return Status(ROW, Level.WARN if trouble else Level.OK, trouble or words, values)


def band_columns(quantity: str) -> tuple[str, ...]:
    """Return the columns of a quantity's band, such as top_tension_5_n."""
    name, _, unit = quantity.replace("_m_per_s", " m_per_s").partition(" ")
    if not unit:
        name, _, unit = quantity.rpartition("_")
    return tuple(f"{name}_{percent}_{unit}" for percent in PERCENTILES)


_BANDS = [column for quantity in QUANTITIES for column in band_columns(quantity)]
FORECAST_COLUMNS = {
    TENSION_TOPIC: ("lead_s", *_BANDS, "heave_skill", "factor", "age_s"),
    ROPES_TOPIC: (
        "rope", "lead_s", *band_columns("top_tension_n"), "above", "tension_limit_n", "age_s",
    ),
    RISK_TOPIC: (
        "span_s", "tension", "slack", "contact", "landing", "tension_limit_n",
        "contact_limit_m_per_s", "horizon_s", "coverage", "judged", "factor", "age_s",
    ),
    QUIET_TOPIC: ("begin_s", "length_s", "probability", "speed_limit_m_per_s", "age_s"),
    WHAT_IF_ORDERS: (
        "name", "span_s", "tension", "slack", "contact", "landing", "rope",
        *band_columns("peak_change_n"), "lower",
    ),
}  # fmt: skip


def encode_forecast(
    topic: str, origin_ns: int, frame_id: str, rows: Sequence[Mapping[str, float | str]]
) -> bytes:
    """Return a table of one of FORECAST_TOPICS, stamped with the origin [ROS time, ns].

    rows: values by column, the column name in at most 32 bytes; a missing one is NaN.
    """
    return _encode_table(FORECAST_COLUMNS[topic], origin_ns, frame_id, rows)


def read_risks(data: bytes) -> list[dict[str, float]]:
    """Return the rows of a message on RISK_TOPIC.

    Raises:
        InputError: it is no such message, has no row, or a row lacks a column.
    """
    table = templates.read_cloud(decode(RISK_TOPIC, data))
    columns = FORECAST_COLUMNS[RISK_TOPIC]
    if not len(table) or not set(columns).issubset(table.dtype.names or ()):
        problem = f"{len(table)} rows without {', '.join(SCORE)}"
        raise InputError(RISK_TOPIC, problem, "send the forecast node's")
    return [{name: float(row[name]) for name in columns} for row in table]


class PublishedAlerts(NamedTuple):
    """Alerts of one message."""

    stamp_ns: int  # ROS time
    now_ns: int  # twin time
    alerts: tuple[Alert, ...]


def encode_alerts(stamp_ns: int, now_ns: int, alerts: Sequence[Alert]) -> bytes:
    """Return an `alerts` message, stamped with a ROS time.

    now_ns: twin time, to which the times of the alerts refer; alerts: in the order to be shown,
    shelved ones at the end.
    """
    return encode_diagnostics(stamp_ns, [_row(alert, now_ns) for alert in alerts])


def _row(alert: Alert, now_ns: int) -> Status:
    """Return the row of an alert."""
    is_over = alert.state in (State.RECTIFIED, State.NORMAL)
    values = {
        "identifier": str(alert.identifier),
        "instance": str(alert.instance),
        "priority": alert.priority.name.lower(),
        "category": alert.category,
        "state": alert.state.name.lower(),
        "now [ns]": str(now_ns),
        "since [ns]": str(alert.since_ns),
        "changed [ns]": str(alert.changed_ns),
        "revision": str(alert.revision),
        "escalation": str(alert.escalation),
        "shelved until [ns]": str(alert.shelved_until_ns),
        "first out": str(alert.first_out).lower(),
        "sounds": str(alert.sounds(now_ns)).lower(),
        "standing": str(alert.standing(now_ns)).lower(),
    }
    level = Level.OK if is_over else _LEVELS[alert.priority]
    return Status(f"{alert.key} {alert.name}", level, alert.text, values)


def crew_limits_row(limits: Mapping[str, float], words: str) -> Status:
    """Return the row of the diagnostics on the limits of a crew: SI values by name, and words."""
    values = {name: repr(value) for name, value in limits.items()}
    return Status(CREW_LIMITS_ROW, Level.OK, words, values)


def decode_alerts(data: bytes) -> PublishedAlerts:
    """Return the alerts of a message.

    Raises:
        InputError: the bytes are not such a message.
    """
    return read_alerts(decode(ALERTS, data))


def read_alerts(message: Any) -> PublishedAlerts:
    """Return the alerts of a decoded message.

    Raises:
        InputError: a row is no alert.
    """
    alerts, now_ns = [], 0
    for row in message.status:
        values = {pair.key: pair.value for pair in row.values}
        try:
            now_ns = int(values["now [ns]"])
            alerts.append(
                Alert(
                    identifier=int(values["identifier"]),
                    instance=int(values["instance"]),
                    name=row.name.partition(" ")[2],
                    priority=Priority[values["priority"].upper()],
                    category=values["category"],
                    state=State[values["state"].upper()],
                    text=row.message,
                    since_ns=int(values["since [ns]"]),
                    changed_ns=int(values["changed [ns]"]),
                    revision=int(values["revision"]),
                    escalation=int(values["escalation"]),
                    shelved_until_ns=int(values["shelved until [ns]"]),
                    first_out=values["first out"] == "true",
                )
            )
        except (KeyError, ValueError) as error:
            problem = f"row '{row.name}' is no alert ({error})"
            raise InputError(ALERTS, problem, "only the simulation publishes here") from None
    return PublishedAlerts(templates.nanoseconds(message.header.stamp), now_ns, tuple(alerts))
