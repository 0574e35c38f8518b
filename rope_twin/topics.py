"""Topic table: every topic that the suite publishes or subscribes to.

The ROS interface page of the documentation is generated from it. All names are relative, so that
the whole suite can be moved into a namespace. All message types are standard ones.

Which of the twin's topics are due at which cycle is the same for every runner. A cycle is one
publish period of the twin. Scalars are due at each cycle, slower topics at every n-th, with n such
that the topic is never slower than the table states (if cycles are not).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from rope_twin.scene.schema import WINCH
from rope_twin.scene.winch import SWITCHES
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.snapshot import DEPTH, LENGTH, SPEED, TENSION, Snapshot


class Qos(Enum):
    """QoS profiles of the suite; `QOS_ROWS` has their policies."""

    STREAM = "stream"  # only the newest message matters
    SENSOR = "sensor"  # every sample counts, lost ones are not sent again
    COMMAND = "command"  # every message is delivered
    LATCHED = "latched"  # late joiners receive the newest message too
    LOG = "log"  # every message is delivered, also in bursts


class QosRow(NamedTuple):
    """Policies of a QoS profile; the history is always keep-last."""

    reliable: bool  # False: best effort
    for_late_joiners: bool  # transient local; False: volatile
    depth: int


QOS_ROWS = {
    Qos.STREAM: QosRow(reliable=False, for_late_joiners=False, depth=1),
    Qos.SENSOR: QosRow(reliable=False, for_late_joiners=False, depth=50),
    Qos.COMMAND: QosRow(reliable=True, for_late_joiners=False, depth=10),
    Qos.LATCHED: QosRow(reliable=True, for_late_joiners=True, depth=1),
    Qos.LOG: QosRow(reliable=True, for_late_joiners=False, depth=1000),
}


@dataclass(frozen=True)
class Topic:
    """One row of the topic table."""

    name: str
    type_name: str
    qos: Qos
    rate_hz: float  # nominal; 0: on change
    publisher: str  # node of the suite that publishes it
    about: str
    only_with: str = ""  # published only if this field of the Snapshot is set; "": always
    of_snapshot: bool = True  # False: an input, or made from more or less than a snapshot
    in_view: bool = True  # drawn by the viewer


TOPICS: tuple[Topic, ...] = (
    # inputs
    Topic("ship/heave", "nav_msgs/msg/Odometry", Qos.SENSOR, 20.0, "sea_state",
          "heave of the hang-off: pose.position.z [m, up], twist.linear.z [m/s]",
          of_snapshot=False),
    Topic("ship/odometry", "nav_msgs/msg/Odometry", Qos.SENSOR, 20.0, "sea_state",
          "in place of ship/heave: pose of the ship's reference point relative to its still-water "
          "position [m], and twist in body axes [m/s, rad/s]", of_snapshot=False),
    Topic("lower_end/odometry", "nav_msgs/msg/Odometry", Qos.SENSOR, 50.0, "",
          "position [m] and velocity [m/s] of the rope's lower end in the axes of map, as another "
          "simulator holds it (co-simulation); of a scene with `end_motion: {from_outside: true}`; "
          "attitude and rates of turn are not read", of_snapshot=False, in_view=False),
    Topic("winch/speed_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 10.0,
          "winch_schedule", "velocity[0] pay-out rate [m/s], positive = pay out; `header.stamp` = "
          "0: apply immediately; `name[0]` selects the winch", of_snapshot=False, in_view=False),
    Topic("winch/length_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 10.0, "winch_schedule",
          "position[0] line out to stop at [m]; stamp and name as for speed_command",
          of_snapshot=False, in_view=False),
    Topic("winch/depth_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 10.0, "winch_schedule",
          "position[0] payload depth to stop at [m]; stamp and name as for speed_command",
          of_snapshot=False, in_view=False),
    Topic("winch/tension_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 10.0,
          "winch_schedule", "effort[0] set-point of the top tension in constant-tension mode [N]; "
          "stamp and name as for speed_command", of_snapshot=False, in_view=False),
    Topic("winch/switch_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 0.0,
          "winch_schedule", "name[0] the winch, name[1] one of " + ", ".join(SWITCHES),
          of_snapshot=False, in_view=False),
    Topic("ropes/cut", "sensor_msgs/msg/JointState", Qos.COMMAND, 0.0, "winch_schedule",
          "cuts the rope, once: position[0] unstretched length from hang-off to cut [m], infinite: "
          "at the lower end; `header.stamp` = 0: apply immediately; `name[0]` selects the rope",
          of_snapshot=False, in_view=False),
    Topic("current", "std_msgs/msg/Float64MultiArray", Qos.COMMAND, 0.0, "",
          "current profile: rows of z [m], east, north (, up) [m/s], from the surface down",
          of_snapshot=False, in_view=False),
    Topic("winch/measured", "sensor_msgs/msg/JointState", Qos.SENSOR, 20.0, "",
          "measured values of each named winch; position: line out [m]; velocity: line speed "
          "[m/s], positive = pay out; effort: tension at the sheave (load cell) [N]; NaN or "
          "missing: not measured; `header.stamp`: time of the measurement",
          of_snapshot=False, in_view=False),
    Topic("winch/motor_tension", "sensor_msgs/msg/JointState", Qos.SENSOR, 20.0, "",
          "effort: tension at the drum by the motor's torque [N]; names and stamp as for "
          "winch/measured", of_snapshot=False, in_view=False),
    Topic("payload/measured_depth", "geometry_msgs/msg/PointStamped", Qos.SENSOR, 1.0, "",
          "point.z: measured height of the payload [m, up from the mean water level]; "
          "`header.stamp`: time of the measurement", of_snapshot=False, in_view=False),
    # used by the forecast alone
    Topic("sea/measured_elevation", "geometry_msgs/msg/PointStamped", Qos.SENSOR, 4.0, "",
          "point.z: surface elevation measured up-sea of the ship at point.x, point.y [m]; "
          "`header.stamp`: time of the measurement", of_snapshot=False, in_view=False),
    # for display only, not used by the rope
    Topic("sea/elevation", "geometry_msgs/msg/PointStamped", Qos.STREAM, 20.0, "sea_state",
          "sea surface elevation at the ship: point.z [m]", of_snapshot=False),
    # outputs; ropes are in the same order in all topics `ropes/...`
    Topic("ropes/tension_top", "sensor_msgs/msg/JointState", Qos.STREAM, 50.0, "simulation",
          "effort: top tension of each rope [N], magnitude of its force at the upper end"),
    Topic("ropes/tension_bottom", "sensor_msgs/msg/JointState", Qos.STREAM, 50.0, "simulation",
          "effort: tension of each rope at its lower end [N], as payload, anchor or connection "
          "feel it"),
    Topic("ropes/length", "sensor_msgs/msg/JointState", Qos.STREAM, 50.0, "simulation",
          "each rope as the prismatic joint that a winch drives; position: line out (unstretched "
          "length) [m]; velocity: pay-out rate [m/s], positive = pay out"),
    Topic("ropes/tension_top_error", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 50.0, "simulation",
          "discretisation error of the top tension, per rope: name; rms_pct, upper bound of the "
          "RMS error, % of the standard deviation (from the scene's convergence study); lower_n, "
          "upper_n, 95 % interval [N], if enabled; NaN: unknown"),
    Topic("ropes/nodes", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 25.0, "simulation",
          "x, y, z [m], tension_n [N] and rope (its number, from 0) of each node, rope by rope, "
          "from the upper end down; 32-bit"),
    Topic("ropes/element_tension", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 25.0, "simulation",
          "tension_n [N] and rope of each element, rope by rope, from the upper end down"),
    Topic("ropes/utilisation", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 5.0, "simulation",
          "per rope since the start: name; utilisation, maximum tension over MBL; "
          "dynamic_amplification (DAF), maximum over static tension at the same line out; "
          "max_tension_n; static_tension_n, present static tension [N]; NaN: unknown",
          only_with="strength", in_view=False),
    Topic("ropes/bend_radius", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 25.0, "simulation",
          "smallest bend radius of each rope with bending stiffness or minimum_bend_radius_m: "
          "name; x, y, z [m]; radius_m; line_out_m down to it; smallest_radius_m since the start; "
          "minimum_radius_m (MBR), NaN if none is given", only_with="bends"),
    Topic("ropes/vibration", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 5.0, "simulation",
          "VIV response, rope by rope, from the upper end down: x, y, z [m] of each node, "
          "cross_flow [A/D], cross_flow_hz, in_line and in_line_hz where the model has them, "
          "drag_amplification (1: none), and rope (its number, from 0); if enabled, or with a VIV "
          "model outside the time step; 32-bit", only_with="vibration"),
    Topic("ropes/fatigue", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 1.0, "simulation",
          "accumulated fatigue damage (Miner) per metre of rope, from the lower end up: "
          "from_lower_end_m, from_hang_off_m (negative: aboard), damage, rope; bends over sheaves "
          "and drum, their bend_damage, and discard_fraction, bends over the maker's discard value "
          "(NaN: unknown); if enabled",
          only_with="fatigue"),
    Topic("ropes/markers", "visualization_msgs/msg/MarkerArray", Qos.STREAM, 25.0, "simulation",
          "ropes coloured by tension, payloads, hang-off, for display", in_view=False),
    Topic("hang_off/wrench", "geometry_msgs/msg/WrenchStamped", Qos.STREAM, 50.0, "simulation",
          "force of the first rope on its hang-off [N], in the axes of map", in_view=False),
    Topic("hang_off/odometry", "nav_msgs/msg/Odometry", Qos.STREAM, 50.0, "simulation",
          "position [m] and velocity [m/s] of the first rope's hang-off, in the axes of map",
          in_view=False),
    Topic("lower_end/wrench", "geometry_msgs/msg/WrenchStamped", Qos.STREAM, 50.0, "simulation",
          "force of the rope on what holds its lower end [N], in the axes of map, where the scene "
          "moves that end (`end_motion`)", only_with="lower_end_force_n", in_view=False),
    Topic("payloads/state", "sensor_msgs/msg/MultiDOFJointState", Qos.STREAM, 50.0, "simulation",
          "pose of each payload in map [m] and its velocity [m/s]; of a 6-DOF payload also "
          "attitude, and twist [m/s, rad/s] in body axes; names are frames"),
    Topic("payloads/body", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 25.0, "simulation",
          "6-DOF payload: name; size_x_m, size_y_m, size_z_m, outline in body axes; "
          "deck_clearance_m of the lowest corner; deck_reaction_n; NaN without a deck",
          only_with="body"),
    Topic("slings/state", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 25.0, "simulation",
          "slings of a 6-DOF payload: name; x, y, z of the attachment point [m]; length_m; "
          "tension_n", only_with="body"),
    Topic("struts/state", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 25.0, "simulation",
          "struts (spreader bars): name; from_x, from_y, from_z, to_x, to_y, to_z, both ends [m]; "
          "length_m; tension_n, negative: compression", only_with="struts"),
    Topic("compensator/state", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 50.0, "simulation",
          "heave compensator at the hook: stroke_m beyond the retracted length; "
          "stroke_rate_m_per_s; tension_n; gas_pressure_pa; gas_force_n; damper_n, friction_n, "
          "stop_n, water_n, active_n (active cylinder), the other parts of the tension",
          only_with="compensator", in_view=False),
    Topic("winch/state", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 50.0, "simulation",
          "component states of each winch: name; target, set-point in the unit of winch/mode; "
          "drum_radius_m, motor_torque_n_m and others of the scene's components, with their unit "
          "in the name; NaN: not of this winch", only_with="winches"),
    Topic("winch/mode", "std_msgs/msg/String", Qos.STREAM, 10.0, "simulation",
          "winch control mode and active limit (text)", only_with="winches", in_view=False),
    Topic("winch/seat", "std_msgs/msg/String", Qos.LATCHED, 0.0, "simulation",
          "node in command of each winch, for example `winch: console`; or that the seat is free, "
          "and how the last commander was lost", of_snapshot=False, in_view=False),
    Topic("seabed/contact", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 50.0, "simulation",
          "payload_height_m above the seabed; payload_reaction_n; rope_on_seabed_m, length of rope "
          "on it; rope_reaction_n", only_with="seabed", in_view=False),
    Topic("seabed/touchdown", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 25.0, "simulation",
          "touchdown point (TDP) of each rope on the seabed: name; x, y, z [m]; line_out_m; "
          "layback_m; tension_n; angle_deg", only_with="seabed"),
    Topic("ropes/contact", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 50.0, "simulation",
          "contact with the hull, between ropes or payloads: name (hull, ropes, payloads); x, y, z "
          "[m] of the largest force, NaN: none; normal_force_n, the sum of all",
          only_with="contacts", in_view=False),
    Topic("lines/crossings", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 5.0, "simulation",
          "two lines around a sheave: name (nearest, crossing_1, ...); x, y, z [m]; distance_m "
          "between the lines; angle_deg; NaN: unknown", only_with="lines"),
    Topic("residuals", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 10.0, "simulation",
          "measured less computed values: name, a quantity (top_tension_n, line_out_m, "
          "payload_depth_m) with winch or payload; age_s; measured; computed; residual; lower, "
          "upper, 95 % interval of the residual; instrument, twin, standard uncertainties; mean, "
          "rms, outside (fraction outside the interval) of the last 60 s; NaN: unknown",
          only_with="residuals"),
    Topic("twin/quality", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 5.0, "simulation",
          "quality index of each functional element: name (top_tension, payload_depth, slack, "
          "fatigue, forecast); index, 0 to 1; cause, number of the component that limits it; "
          "input, numerics, discretisation, validity, residual, history: components; NaN: unknown",
          only_with="quality"),
    Topic("estimate/figures", "sensor_msgs/msg/PointCloud2", Qos.COMMAND, 0.0, "simulation",
          "figures learned from the measured tension, after each minute: name; value with low, "
          "high, 90 % interval, and prior, the scene's value (N, kg, m², N, N·s, kg/m², current: "
          "-; load pin: bias N, gain -; motion sensor: gain -, delay s; sheave friction -; of "
          "further winches, as winch/figure, also line offset m and slip -); "
          "prior_sd, sd, standard deviations (of the logarithm for the scene's figures); state, 0 "
          "not observable, 1 weak, 2 learned, 3 at the limit of the prior; correlation, the "
          "largest with another figure; stamped with the end of the data",
          of_snapshot=False, in_view=False),
    Topic("estimate/alarms", "std_msgs/msg/String", Qos.LATCHED, 0.0, "simulation",
          "with the parameter learn: fault found by its tests, at each change of the alarm: its "
          "cause, or the two that remain, and since when [s of twin time] (text); empty: "
          "acknowledged", of_snapshot=False, in_view=False),
    Topic("lines/events", "std_msgs/msg/String", Qos.COMMAND, 0.0, "simulation",
          "start or end of a crossing of two lines: time, depth, angle (text)",
          only_with="line_events"),
    Topic("alerts", "diagnostic_msgs/msg/DiagnosticArray", Qos.LATCHED, 1.0, "simulation",
          "alerts of the lift in the order to be shown, shelved ones last: priority, state and "
          "times as values; on every change, and each second while there are any",
          of_snapshot=False, in_view=False),
    Topic("alerts/command", "std_msgs/msg/String", Qos.COMMAND, 0.0, "",
          "what a crew does with an alert: acknowledge, silence or transfer ID or all; shelve ID "
          "SECONDS; unshelve ID; limit NAME VALUE or scene (text)",
          of_snapshot=False, in_view=False),
    Topic("forecast/tension", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 1.0, "forecast",
          "forecast of the next minute, stamped with its origin, a row every 0.5 s: lead_s; "
          "5, 50 and 95 % of top_tension, payload_tension, payload_depth, payload_speed and "
          "slack_margin (minimum tension of an element), such as top_tension_5_n; heave_skill; "
          "factor, on the spread; age_s of the inputs", of_snapshot=False),
    Topic("forecast/ropes", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 1.0, "forecast",
          "where several ropes come from hang-offs, a row for each of them and lead_s, stamped "
          "with the origin: rope, its number as in ropes/nodes; top_tension_5_n, _50_n and _95_n; "
          "above, probability that it exceeds tension_limit_n until then; age_s", of_snapshot=False,
          in_view=False),
    Topic("forecast/risk", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 1.0, "forecast",
          "probabilities within span_s of the origin: tension above tension_limit_n, where ropes "
          "meet that of any rope from a hang-off above its own limit; slack; "
          "contact with the seabed above contact_limit_m_per_s; landing; horizon_s, to which heave "
          "is known; coverage of the last 100 bands; judged, how many are known; factor on the "
          "spread, mean; age_s; NaN: unknown", of_snapshot=False,
          in_view=False),
    Topic("forecast/quiet", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 1.0, "forecast",
          "quiet windows: begin_s after the origin; length_s; probability that the payload stays "
          "below speed_limit_m_per_s; age_s", of_snapshot=False, in_view=False),
    Topic("forecast/what_if", "std_msgs/msg/String", Qos.COMMAND, 0.0, "",
          "orders that the next forecast compares with hold, such as: lower:0.5 stop "
          "compensation:off hold@aft_sheave; nothing is commanded (text)",
          of_snapshot=False, in_view=False),
    Topic("forecast/orders", "sensor_msgs/msg/PointCloud2", Qos.COMMAND, 0.0, "forecast",
          "answer to forecast/what_if, stamped with its origin, a row for each order and span_s: "
          "name of the order; tension, slack, contact, landing as in forecast/risk; number "
          "of a rope from a hang-off, and the change of its maximum tension in the span against "
          "hold on the same heave, 5, 50 and 95 %: rope, peak_change_5_n ...; lower, share of "
          "members in which that is lower",
          of_snapshot=False, in_view=False),
    Topic("diagnostics", "diagnostic_msgs/msg/DiagnosticArray", Qos.COMMAND, 1.0, "simulation",
          "pacing, solver and inputs: OK, WARN or ERROR with the reason; also of the recorder",
          of_snapshot=False),
    Topic("twin/epoch", "builtin_interfaces/msg/Time", Qos.LATCHED, 0.0, "simulation",
          "ROS time of the simulation's t = 0; replayed inputs are stamped from it",
          of_snapshot=False),
    Topic("twin/session", "std_msgs/msg/String", Qos.LATCHED, 0.0, "simulation",
          "JSON, at each start and after each pause, for `rope_twin replay`: scene, parameters, "
          "program, machine, seeds, and the initial state if it is not the static equilibrium",
          of_snapshot=False, in_view=False),
    Topic("twin/inputs", "std_msgs/msg/String", Qos.LOG, 0.0, "simulation",
          "JSON, for each real-time cycle with inputs: the simulation time at which they were "
          "applied, and each call with all its values", of_snapshot=False, in_view=False),
)  # fmt: skip

# command topic of each control mode of a winch
ORDER_TOPICS = {
    SPEED: "winch/speed_command",
    LENGTH: "winch/length_command",
    DEPTH: "winch/depth_command",
    TENSION: "winch/tension_command",
}
SWITCH_TOPIC = "winch/switch_command"
CUT_TOPIC = "ropes/cut"
SEAT_TOPIC = "winch/seat"
WINCH_TOPICS = (*ORDER_TOPICS.values(), SWITCH_TOPIC)
SESSION_TOPIC, INPUT_LOG_TOPIC = "twin/session", "twin/inputs"
MOTION_TOPICS = "ship/heave", "ship/odometry"
LOWER_END = "lower_end/odometry"
WINCH_MEASURED, MOTOR_TENSION = "winch/measured", "winch/motor_tension"
MEASURED_DEPTH = "payload/measured_depth"
MEASURED_ELEVATION = "sea/measured_elevation"
MEASURED_TOPICS = WINCH_MEASURED, MOTOR_TENSION, MEASURED_DEPTH
ALERTS, ALERT_COMMAND = "alerts", "alerts/command"
WHAT_IF, WHAT_IF_ORDERS = "forecast/what_if", "forecast/orders"
FORECAST_RISK = "forecast/risk"  # its score is judged by the quality index
# topics with which the twin is driven and judged; the simulation subscribes to ALERT_COMMAND and
# FORECAST_RISK too
INPUTS = (
    *MOTION_TOPICS, LOWER_END, *WINCH_TOPICS, CUT_TOPIC, "current", *MEASURED_TOPICS
)  # fmt: skip


@dataclass(frozen=True)
class Service:
    """One row of the table of services; `{winch}` is `winch`, or `winch/NAME` for another one."""

    name: str
    type_name: str
    about: str


TAKE, RELEASE = "take_seat", "release_seat"
# switches of a winch by service: name of the service, command for true (or a Trigger) and for false
WINCH_SERVICES = {
    "emergency_stop": ("emergency_stop", ""),
    "reset": ("reset", ""),
    "set_brake": ("set_brake", "release_brake"),
    "set_compensation": ("compensate", "stop_compensating"),
}
SAVE_STATE = "simulation/save_state"
ESTIMATE_TOPIC = "estimate/figures"
APPLY_ESTIMATE, TARE_ESTIMATE = "estimate/apply", "estimate/tare"
ALARM_TOPIC, ACKNOWLEDGE_ALARM = "estimate/alarms", "estimate/acknowledge"
SERVICES: tuple[Service, ...] = (
    Service("winch/emergency_stop", "std_srvs/srv/Trigger",
            "stops the winch; accepted from everybody at any time"),
    Service("winch/reset", "std_srvs/srv/Trigger",
            "ends an emergency stop; only while the seat is free"),
    Service("winch/set_brake", "std_srvs/srv/SetBool",
            "true: sets the brake, false: releases it; only while the seat is free"),
    Service("winch/set_compensation", "std_srvs/srv/SetBool",
            "heave compensation (AHC) on or off; only while the seat is free"),
    Service(f"winch/{TAKE}", "std_srvs/srv/Trigger",
            "the next command of another node of the commander's priority takes the seat"),
    Service(f"winch/{RELEASE}", "std_srvs/srv/Trigger",
            "frees the seat of a commander that has sent no command for 1 s"),
    Service(SAVE_STATE, "std_srvs/srv/Trigger",
            "saves the state at the end of the cycle, to the file of the parameter save_state"),
    Service(APPLY_ESTIMATE, "std_srvs/srv/Trigger",
            "takes the learned figures over, in 20 s (parameter learn)"),
    Service(TARE_ESTIMATE, "std_srvs/srv/Trigger",
            "the load pin was set to zero with an empty hook: its bias is learned from there"),
    Service(ACKNOWLEDGE_ALARM, "std_srvs/srv/Trigger",
            "ends the alarm of estimate/alarms; learning goes on"),
)  # fmt: skip


def service_name(winch: str, what: str) -> str:
    """Return the service name for a winch: winch/take_seat, or winch/NAME/take_seat."""
    return f"winch/{what}" if winch == WINCH else f"winch/{winch}/{what}"


BY_NAME: dict[str, Topic] = {topic.name: topic for topic in TOPICS}


def recorded_name(name: str) -> str:
    """Return the name under which a topic of the (relative) table is recorded in a bag."""
    return name if name.startswith("/") else f"/{name}"


def is_topic(name: str, topic: str) -> bool:
    """Return whether a name in a bag is this topic of the table, in any namespace."""
    return f"/{name}".endswith(f"/{topic}")


SNAPSHOT_TOPICS = tuple(one for one in TOPICS if one.of_snapshot and not one.only_with)
EXTRA_TOPICS = tuple(one for one in TOPICS if one.of_snapshot and one.only_with)
DIAGNOSTICS_PERIOD_NS = 1_000_000_000


def every(rate_hz: float, slot_ns: int) -> int:
    """Return n of the n-th cycles at which a topic is due; 1 for a topic published on change."""
    if rate_hz == 0.0:
        return 1
    return max(1, int(1e9 / (rate_hz * slot_ns) + 1e-9))


def slot_of(snapshot: Snapshot) -> tuple[int, int]:
    """Return number and length [ns] of the cycle that the snapshot ends, from its time step."""
    slot_ns = steps_in_slot(snapshot.step_s) * round(snapshot.step_s * 1e9)
    return snapshot.stamp_ns // slot_ns, slot_ns


def due_topics(slot: int, slot_ns: int, snapshot: Snapshot | None = None) -> list[str]:
    """Return the topics due from the snapshot at the end of a cycle (the first is cycle 1).

    Without the snapshot: those that every one has.
    """
    topics = SNAPSHOT_TOPICS
    if snapshot is not None:
        given = (t for t in EXTRA_TOPICS if getattr(snapshot, t.only_with))
        topics = (*SNAPSHOT_TOPICS, *given)
    return [topic.name for topic in topics if slot % every(topic.rate_hz, slot_ns) == 0]
