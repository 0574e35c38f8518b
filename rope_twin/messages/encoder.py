"""Snapshot -> CDR bytes of every topic that the simulation publishes from a snapshot.

The same bytes are published and recorded. Every message is stamped. One rope and many ropes use the
same topics: the names of ropes, payloads and struts are in the messages, since a cut changes the
set of ropes during a run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean
from rope_twin.messages import templates
from rope_twin.messages.cdr import Template, Templates, encode_text, new
from rope_twin.messages.reports import QUALITY_COLUMNS, quality_rows
from rope_twin.messages.templates import RopeMarkers
from rope_twin.quantity import or_nan
from rope_twin.twin.snapshot import (
    CONTROL_MODES,
    BodySnapshot,
    PayloadSnapshot,
    RopeSnapshot,
    Snapshot,
    WinchSnapshot,
    first_rope,
)
from rope_twin.vortex.fatigue import BendResult
from rope_twin.vortex.results import RopeVibration

MAP = "map"  # REP 105: the fixed frame; x east, y north, z up, z = 0 at mean water level
HANG_OFF, PAYLOAD = "hang_off", "payload"  # frames of the first hang-off and of a single payload
ROPE = "rope"  # name of a rope whose name the snapshot does not have
NAME_LENGTH = 32  # of a name in a table

Rows = Iterable[tuple[Any, ...]]  # values of the columns of a table


class Encoder:
    """Holds the message templates; one per publishing thread."""

    def __init__(self, epoch_ns: int) -> None:
        self._epoch_ns = epoch_ns
        header = templates.header(MAP)
        self._wrench = Template(new("geometry_msgs/msg/WrenchStamped", header=header))
        self._hang_off = Template(templates.odometry(MAP, HANG_OFF))
        self._sized = Templates()
        self._rope_markers = RopeMarkers(MAP, self._stamp)
        self._encoders: dict[str, Callable[[Snapshot], bytes]] = {
            "ropes/nodes": self._nodes,
            "ropes/element_tension": self._element_tension,
            "ropes/vibration": self._vibration,
            "ropes/fatigue": self._fatigue,
            "ropes/markers": lambda snapshot: self._rope_markers.encode(
                snapshot, *all_elements(snapshot)
            ),
            "hang_off/wrench": self._hang_off_wrench,
            "hang_off/odometry": self._hang_off_odometry,
            "lower_end/wrench": self._lower_end_wrench,
            "payloads/state": self._payloads_state,
            "winch/state": self._winch_state,
            "winch/mode": winch_mode,
            "lines/events": line_events,
            **{topic: partial(self._joints, topic) for topic in JOINTS},
            **{topic: partial(self._rows, topic) for topic in TABLES},
        }

    @property
    def topics(self) -> tuple[str, ...]:
        """Return the topics that `encode` supports."""
        return tuple(self._encoders)

    def encode(self, topic_name: str, snapshot: Snapshot) -> bytes:
        """Return the message of a topic at the snapshot's time, stamped epoch + stamp_ns.

        Raises:
            InputError: if the topic is not made from a snapshot.
        """
        encoder = self._encoders.get(topic_name)
        if encoder is None:
            problem = f"topic '{topic_name}' is not made from a snapshot"
            raise InputError("encode", problem, did_you_mean(topic_name, self._encoders))
        return encoder(snapshot)

    def _stamp(self, snapshot: Snapshot, path: str = "header.stamp") -> dict[str, int]:
        return templates.stamp(self._epoch_ns + snapshot.stamp_ns, path)

    def _joints(self, topic: str, snapshot: Snapshot) -> bytes:
        """Return a JointState of JOINTS, with a joint for each rope."""
        ropes = ropes_of(snapshot)
        names, values = tuple(rope.name for rope in ropes), JOINTS[topic](ropes)
        template = self._sized.get(topic, names, lambda: templates.joint_state(names, values))
        return template.fill({**self._stamp(snapshot), **values})

    def _rows(self, topic: str, snapshot: Snapshot) -> bytes:
        """Return a table of TABLES."""
        names, rows = TABLES[topic]
        return self._table(topic, snapshot, names, rows(snapshot))

    def _table(self, topic: str, snapshot: Snapshot, names: str, rows: Rows) -> bytes:
        """Return a PointCloud2 with a point for each row; names: of the columns."""
        encoded = [tuple(v.encode() if isinstance(v, str) else v for v in row) for row in rows]
        points = np.array(encoded, templates.point_type(templates.columns(names)))
        return self._cloud(topic, snapshot, points)

    def _numbers(
        self, topic: str, snapshot: Snapshot, names: str, table: NDArray[np.floating]
    ) -> bytes:
        """Return a PointCloud2 of the rows of a table of numbers; names: of its columns."""
        point_type = templates.point_type(templates.columns(names, table.dtype.str))
        return self._cloud(topic, snapshot, table.view(point_type).ravel())

    def _cloud(self, topic: str, snapshot: Snapshot, points: NDArray[Any]) -> bytes:
        """Return a PointCloud2 of points of a structured type."""
        template = self._sized.get(
            topic,
            (len(points), points.dtype),
            lambda: templates.cloud(MAP, len(points), points.dtype),
        )
        data = {"data": points.view(np.uint8)} if len(points) else {}
        return template.fill({**self._stamp(snapshot), **data})

    # -- ropes ---------------------------------------------------------------------------------

    def _nodes(self, snapshot: Snapshot) -> bytes:
        ropes = ropes_of(snapshot)
        points = np.empty((sum(len(rope.node_position_m) for rope in ropes), 5), dtype="<f4")
        points[:, :3] = np.concatenate([rope.node_position_m for rope in ropes])
        points[:, 3] = np.concatenate([rope.node_tension_n for rope in ropes])
        points[:, 4] = _numbers_of([len(rope.node_tension_n) for rope in ropes])
        return self._numbers("ropes/nodes", snapshot, "x y z tension_n rope", points)

    def _element_tension(self, snapshot: Snapshot) -> bytes:
        ropes = ropes_of(snapshot)
        columns = (*templates.columns("tension_n"), *templates.columns("rope", "<f4"))
        counts = [len(rope.element_tension_n) for rope in ropes]
        points = np.empty(sum(counts), templates.point_type(columns))
        points["tension_n"] = np.concatenate([rope.element_tension_n for rope in ropes])
        points["rope"] = _numbers_of(counts)
        return self._cloud("ropes/element_tension", snapshot, points)

    def _vibration(self, snapshot: Snapshot) -> bytes:
        """Return x, y, z of the nodes of each rope, amplitude, frequency, drag amplification."""
        tables, names = [], ""
        for number, rope in enumerate(ropes_of(snapshot)):
            vibration = rope.vibration if number else snapshot.vibration
            if vibration is not None:
                columns = vibration_columns(vibration)
                of_rope = np.full(len(vibration.cross_flow), number)
                tables.append(np.column_stack([rope.node_position_m, *columns.values(), of_rope]))
                names = " ".join(("x", "y", "z", *columns, "rope"))
        if not tables:
            raise InputError("encode", "the snapshot has no vibration", "ask for it")
        return self._numbers("ropes/vibration", snapshot, names, np.vstack(tables).astype("<f4"))

    def _fatigue(self, snapshot: Snapshot) -> bytes:
        """Return accumulated damage and position of each metre of rope."""
        tables = []
        for number, rope in enumerate(ropes_of(snapshot)):
            fatigue = rope.fatigue if number else snapshot.fatigue
            if fatigue is not None:
                of_rope = np.full(len(fatigue.used), float(number))
                unknown = np.full(len(fatigue.used), np.nan)
                bending = fatigue.bent or BendResult(unknown, unknown, unknown, "")
                columns = (
                    fatigue.from_lower_end_m, fatigue.from_hang_off_m, fatigue.used, of_rope,
                    bending.bends, bending.damage, bending.discard,
                )  # fmt: skip
                tables.append(np.column_stack(columns))
        if not tables:
            raise InputError("encode", "the snapshot has no fatigue", "ask for it")
        names = "from_lower_end_m from_hang_off_m damage rope bends bend_damage discard_fraction"
        return self._numbers("ropes/fatigue", snapshot, names, np.concatenate(tables))

    # -- hang-off, payloads, winches, seabed -----------------------------------------------------

    def _hang_off_wrench(self, snapshot: Snapshot) -> bytes:
        force = {"wrench.force": snapshot.hang_off_force_n}
        return self._wrench.fill({**self._stamp(snapshot), **force})

    def _lower_end_wrench(self, snapshot: Snapshot) -> bytes:
        if not snapshot.lower_end_force_n:
            problem = "the snapshot has no force on a lower end"
            raise InputError("encode", problem, "give a scene with `end_motion`")
        force = {"wrench.force": snapshot.lower_end_force_n}
        return self._wrench.fill({**self._stamp(snapshot), **force})

    def _hang_off_odometry(self, snapshot: Snapshot) -> bytes:
        place, speed = snapshot.hang_off_position_m, snapshot.hang_off_velocity_m_per_s
        motion = {"pose.pose.position": place, "twist.twist.linear": speed}
        return self._hang_off.fill({**self._stamp(snapshot), **motion})

    def _payloads_state(self, snapshot: Snapshot) -> bytes:
        """Return pose and velocity of each payload; a 6-DOF payload has its twist in body axes."""
        single = PAYLOAD, snapshot.payload_position_m, snapshot.payload_velocity_m_per_s
        payloads = snapshot.payloads or (PayloadSnapshot(*single),)
        names = tuple(payload.name for payload in payloads)
        template = self._sized.get(
            "payloads/state", names, lambda: templates.free_bodies(MAP, names)
        )
        values: dict[str, Any] = self._stamp(snapshot)
        for number, payload in enumerate(payloads):
            values[f"transforms.{number}.translation"] = payload.position_m
            values[f"twist.{number}.linear"] = payload.velocity_m_per_s
        body = snapshot.body
        if body is not None:
            body_number = _carried(snapshot)
            values[f"transforms.{body_number}.rotation"] = body.quaternion
            velocity_m_per_s = payloads[body_number].velocity_m_per_s
            values[f"twist.{body_number}.linear"] = velocity_m_per_s @ body.turn
            values[f"twist.{body_number}.angular"] = body.angular_velocity_rad_per_s
        return template.fill(values)

    def _winch_state(self, snapshot: Snapshot) -> bytes:
        """Return the component states of each winch; NaN for what a winch does not have."""
        winches = [
            {"name": winch.name, "target": winch.target, **dict(winch.figures)}
            for winch in snapshot.winches
        ]
        names = list(dict.fromkeys(name for row in winches for name in row)) or ["name"]
        rows = (tuple(row.get(name, math.nan) for name in names) for row in winches)
        return self._table("winch/state", snapshot, " ".join(names), rows)


def _numbers_of(counts: Sequence[int]) -> NDArray[np.int_]:
    """Return the number of the rope of each row, for ropes of so many rows."""
    return np.repeat(np.arange(len(counts)), counts)


def ropes_of(snapshot: Snapshot) -> tuple[RopeSnapshot, ...]:
    """Return all ropes of a snapshot, also of one with a single rope."""
    if snapshot.ropes:
        return snapshot.ropes
    return (first_rope(snapshot, snapshot.strength[0].name if snapshot.strength else ROPE),)


def all_elements(snapshot: Snapshot) -> tuple[Any, Any]:
    """Return ends (2·elements, 3) and tension (elements,) of the elements of all ropes."""
    if not snapshot.ropes:
        return _ends(snapshot.node_position_m), snapshot.element_tension_n
    ropes = snapshot.ropes
    ends = np.concatenate([_ends(rope.node_position_m) for rope in ropes])
    return ends, np.concatenate([rope.element_tension_n for rope in ropes])


def _ends(nodes: Any) -> Any:
    """Return the ends of the elements: nodes 0 1, 1 2, 2 3, ..."""
    return np.repeat(nodes, 2, axis=0)[1:-1]


def vibration_columns(vibration: RopeVibration) -> dict[str, np.ndarray]:
    """Return the columns of the cloud in addition to the positions, by name."""
    columns = {"cross_flow": vibration.cross_flow, "cross_flow_hz": vibration.cross_flow_hz}
    if vibration.in_line is not None and vibration.in_line_hz is not None:
        columns |= {"in_line": vibration.in_line, "in_line_hz": vibration.in_line_hz}
    return columns | {"drag_amplification": vibration.drag_amplification}


def winch_mode(snapshot: Snapshot) -> bytes:
    """Return control mode and active limit of each winch, in words."""
    words = "; ".join(mode_words(winch) for winch in snapshot.winches)
    return encode_text(words)


def mode_words(winch: WinchSnapshot) -> str:
    """Return the control mode in words, such as `winch: length 350 m (limit)`."""
    unit = CONTROL_MODES.get(winch.mode, "")
    set_point = f"{winch.mode} {winch.target:g} {unit}" if unit else winch.mode.replace("_", " ")
    return f"{winch.name}: {set_point}" + (f" ({winch.at_limit})" if winch.at_limit else "")


def line_events(snapshot: Snapshot) -> bytes:
    """Return crossings of two lines that began or ended, such as `121.4 s: the lines cross at 836
    m`.
    """
    words = "; ".join(f"{event.time_s:.1f} s: {event.words()}" for event in snapshot.line_events)
    return encode_text(words)


def _carried(snapshot: Snapshot) -> int:
    """Return which payload of `payloads/state` is the 6-DOF one: the one at its position."""
    body_m = snapshot.payload_position_m
    is_body = [bool((payload.position_m == body_m).all()) for payload in snapshot.payloads]
    return is_body.index(True) if any(is_body) else 0


def _body(snapshot: Snapshot) -> BodySnapshot:
    if snapshot.body is None:
        raise InputError("encode", "the payload is no rigid body", "list the effect `rigid_body`")
    return snapshot.body


def _errors(snapshot: Snapshot) -> Rows:
    """Yield error bound and interval of each rope; NaN where unknown."""
    for number, rope in enumerate(ropes_of(snapshot)):
        interval = rope.error_interval if number else snapshot.error_interval
        rms_pct = math.nan if number else snapshot.study_error.rms_pct
        bounds = (interval.low_n, interval.high_n) if interval else (math.nan, math.nan)
        yield rope.name, rms_pct, *bounds


def _utilisation(snapshot: Snapshot) -> Rows:
    """Yield utilisation and tensions of each rope; NaN without a static tension."""
    for rope in snapshot.strength:
        amplified = or_nan(rope.dynamic_amplification)
        yield rope.name, rope.utilisation, amplified, rope.max_n, or_nan(rope.static_n)


def _bend_radius(snapshot: Snapshot) -> Rows:
    """Yield the smallest bend radius of each monitored rope, and its minimum if given."""
    for rope in snapshot.bends:
        radii = rope.now.radius_m, rope.now.line_out_m, rope.tightest.radius_m
        yield rope.now.name, *rope.position_m, *radii, rope.now.minimum_m or math.nan


def _payloads_body(snapshot: Snapshot) -> Rows:
    body = _body(snapshot)
    name = snapshot.payloads[_carried(snapshot)].name if snapshot.payloads else PAYLOAD
    yield name, *body.size_m, or_nan(body.deck_clearance_m), or_nan(body.deck_reaction_n)


def _slings(snapshot: Snapshot) -> Rows:
    body = _body(snapshot)
    slings = zip(body.leg_end_m, body.leg_length_m, body.leg_tension_n, strict=True)
    for number, (end_m, length_m, tension_n) in enumerate(slings, start=1):
        yield f"sling_{number}", *end_m, length_m, tension_n


def _struts(snapshot: Snapshot) -> Rows:
    for strut in snapshot.struts:
        length_m = float(np.linalg.norm(strut.ends_m[1] - strut.ends_m[0]))
        yield strut.name, *strut.ends_m[0], *strut.ends_m[1], length_m, strut.pull_n


COMPENSATOR_COLUMNS = (
    "stroke_m", "stroke_rate_m_per_s", "tension_n", "gas_pressure_pa", "gas_force_n", "damper_n",
    "friction_n", "stop_n", "water_n", "active_n",
)  # fmt: skip


def _compensator(snapshot: Snapshot) -> Rows:
    if snapshot.compensator is None:
        raise InputError("encode", "the scene has no compensator", "list the effect")
    yield tuple(getattr(snapshot.compensator, name) for name in COMPENSATOR_COLUMNS)


def _seabed_contact(snapshot: Snapshot) -> Rows:
    bed = snapshot.seabed
    if bed is None:
        raise InputError("encode", "the scene has no seabed", "list the effect")
    yield bed.payload_height_m, bed.payload_reaction_n, bed.rope_on_bed_m, bed.rope_reaction_n


def _touchdown(snapshot: Snapshot) -> Rows:
    """Yield the touchdown point of each rope on the seabed; none if there is none."""
    for touchdown in snapshot.touchdowns:
        lengths_m, tension_n = (touchdown.line_out_m, touchdown.layback_m), touchdown.tension_n
        yield touchdown.name, *touchdown.position_m, *lengths_m, tension_n, touchdown.angle_deg


def _contact(snapshot: Snapshot) -> Rows:
    """Yield contact with the hull and between ropes, as far as the scene lists it."""
    for contact in snapshot.contacts:
        yield contact.name, *contact.position_m, contact.normal_n


def _crossings(snapshot: Snapshot) -> Rows:
    """Yield where two lines are nearest, then their crossings."""
    lines, unknown = snapshot.lines, math.nan
    if lines is not None:
        nearest = lines.nearest
        yield "nearest", unknown, unknown, -nearest.depth_m, nearest.distance_m, unknown
        for number, crossing in enumerate(lines.crossings, start=1):
            position = (*crossing.position_m[:2], -crossing.depth_m)
            yield f"crossing_{number}", *position, crossing.gap_m, crossing.angle_deg


def _residuals(snapshot: Snapshot) -> Rows:
    """Yield the newest residual of each measured quantity, and its statistics."""
    for residual in snapshot.residuals:
        half_width = or_nan(residual.half_width)
        yield (
            f"{residual.quantity} {residual.name}"[:NAME_LENGTH], snapshot.time_s - residual.at_s,
            residual.measured, residual.computed, residual.residual, -half_width, half_width,
            or_nan(residual.instrument),
            or_nan(residual.twin), residual.mean, residual.rms, or_nan(residual.outside),
        )  # fmt: skip


# Joints of all ropes by topic: values by the field that carries them, in the order of the ropes.
JOINTS: dict[str, Callable[[Sequence[RopeSnapshot]], dict[str, list[float]]]] = {
    "ropes/tension_top": lambda ropes: {"effort": [rope.tension_top_n for rope in ropes]},
    "ropes/tension_bottom": lambda ropes: {
        "effort": [float(rope.node_tension_n[-1]) for rope in ropes]
    },
    "ropes/length": lambda ropes: {
        "position": [rope.line_out_m for rope in ropes],
        "velocity": [rope.payout_speed_m_per_s for rope in ropes],
    },
}
# Tables with fixed columns by topic: names of the columns, and what yields the rows.
TABLES: dict[str, tuple[str, Callable[[Snapshot], Rows]]] = {
    "ropes/tension_top_error": ("name rms_pct lower_n upper_n", _errors),
    "ropes/utilisation": (
        "name utilisation dynamic_amplification max_tension_n static_tension_n", _utilisation
    ),
    "ropes/bend_radius": (
        "name x y z radius_m line_out_m smallest_radius_m minimum_radius_m", _bend_radius
    ),
    "payloads/body": (
        "name size_x_m size_y_m size_z_m deck_clearance_m deck_reaction_n", _payloads_body
    ),
    "slings/state": ("name x y z length_m tension_n", _slings),
    "struts/state": ("name from_x from_y from_z to_x to_y to_z length_m tension_n", _struts),
    "compensator/state": (" ".join(COMPENSATOR_COLUMNS), _compensator),
    "seabed/contact": (
        "payload_height_m payload_reaction_n rope_on_seabed_m rope_reaction_n", _seabed_contact
    ),
    "seabed/touchdown": ("name x y z line_out_m layback_m tension_n angle_deg", _touchdown),
    "ropes/contact": ("name x y z normal_force_n", _contact),
    "lines/crossings": ("name x y z distance_m angle_deg", _crossings),
    "residuals": (
        "name age_s measured computed residual lower upper instrument twin mean rms outside",
        _residuals,
    ),
    "twin/quality": (QUALITY_COLUMNS, quality_rows),
}  # fmt: skip
