"""The topic table: every topic that the suite publishes or listens to, in one place.

The ROS interface page of the documentation is generated from it. All names are relative, so a
namespace moves the whole suite; all types are standard ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from rope_twin.scene.winch import SWITCHES
from rope_twin.twin.hoisting.orders import DEPTH, LENGTH, SPEED, TENSION


class Qos(Enum):
    """The rows of quality of service that the suite uses."""

    STREAM = "stream"  # only the newest matters
    SENSOR = "sensor"  # every sample counts, none is asked for again
    COMMAND = "command"  # every one arrives
    LATCHED = "latched"  # late joiners get the newest too
    LOG = "log"  # every one arrives, also where many come at once


class QosRow(NamedTuple):
    """What a row of quality of service asks of the middleware."""

    reliable: bool  # else best effort
    for_late_joiners: bool  # transient local, else volatile
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
    """One row of the table."""

    name: str
    type_name: str
    qos: Qos
    rate_hz: float  # nominal; 0: on change
    publisher: str  # node that publishes it in the suite
    about: str
    only_with: str = ""  # field of a Snapshot without which there is nothing to publish


TOPICS: tuple[Topic, ...] = (
    # what the twin listens to
    Topic("ship/heave", "nav_msgs/msg/Odometry", Qos.SENSOR, 20.0, "sea_state",
          "heave of the hang-off: pose.position.z [m, up], twist.linear.z [m/s]"),
    Topic("ship/odometry", "nav_msgs/msg/Odometry", Qos.SENSOR, 20.0, "sea_state",
          "in place of ship/heave: pose of the ship's reference point against its rest [m], "
          "and twist in the turned axes [m/s, rad/s]"),
    Topic("winch/speed_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 10.0,
          "winch_schedule", "velocity[0] [m/s], + pays out; stamp 0 means at once; "
          "name[0] tells one of several winches"),
    Topic("winch/length_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 10.0, "winch_schedule",
          "position[0] line out to stop at [m]; stamp and name as for a speed"),
    Topic("winch/depth_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 10.0, "winch_schedule",
          "position[0] depth of the payload to stop at [m]; stamp and name as for a speed"),
    Topic("winch/tension_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 10.0,
          "winch_schedule", "effort[0] top tension to keep [N]; stamp and name as for a speed"),
    Topic("winch/switch_command", "sensor_msgs/msg/JointState", Qos.COMMAND, 0.0,
          "winch_schedule", "name[0] the winch, name[1] one of " + ", ".join(SWITCHES)),
    Topic("rope/cut", "sensor_msgs/msg/JointState", Qos.COMMAND, 0.0, "winch_schedule",
          "cuts the rope, once: position[0] unstretched rope from hang-off to cut [m], infinite: "
          "at its lower end; stamp 0 means at once; name[0] tells one of several ropes"),
    Topic("current", "std_msgs/msg/Float64MultiArray", Qos.COMMAND, 0.0, "",
          "current profile, rows of z [m], east, north [m/s], from the surface down"),
    # what the sea is doing (for the eye, not used by the rope)
    Topic("sea/elevation", "geometry_msgs/msg/PointStamped", Qos.STREAM, 20.0, "sea_state",
          "water surface at the ship: point.z [m]"),
    # what the twin says
    Topic("tension_top", "std_msgs/msg/Float64", Qos.STREAM, 50.0, "simulation",
          "magnitude of the rope's pull on the hang-off [N]"),
    Topic("tension_top_error_pct", "std_msgs/msg/Float64", Qos.STREAM, 50.0, "simulation",
          "what its rms error is at most, by the scene's card [% of its standard deviation]; NaN: "
          "unknown"),
    Topic("tension_top/band", "sensor_msgs/msg/JointState", Qos.STREAM, 50.0, "simulation",
          "where the converged top tension lies: effort low, high [N], then those of each further "
          "rope from the ship; with an error band only",
          only_with="band"),
    Topic("tension_payload", "std_msgs/msg/Float64", Qos.STREAM, 50.0, "simulation",
          "tension at the payload [N]"),
    Topic("hang_off/wrench", "geometry_msgs/msg/WrenchStamped", Qos.STREAM, 50.0, "simulation",
          "the rope's pull on the hang-off [N], frame sea"),
    Topic("tension", "std_msgs/msg/Float64MultiArray", Qos.STREAM, 25.0, "simulation",
          "tension of each element [N], from the hang-off down"),
    Topic("payload/odometry", "nav_msgs/msg/Odometry", Qos.STREAM, 50.0, "simulation",
          "payload position [m], frame sea, and velocity [m/s]; of a rigid body its attitude too, "
          "and the twist [m/s, rad/s] in its own axes"),
    Topic("winch/state", "sensor_msgs/msg/JointState", Qos.STREAM, 50.0, "simulation",
          "position line out [m], velocity [m/s, + pays out], effort tension [N]"),
    Topic("winch/mode", "std_msgs/msg/String", Qos.STREAM, 10.0, "simulation",
          "what the winch was told and which of its limits holds it back, in words",
          only_with="winches"),
    Topic("winch/parts", "sensor_msgs/msg/JointState", Qos.STREAM, 50.0, "simulation",
          "what its parts do, by name with the unit in it, like winch/drum_radius_m: position",
          only_with="winches"),
    Topic("winch/seat", "std_msgs/msg/String", Qos.LATCHED, 0.0, "simulation",
          "which node commands each winch, like `winch: console`; or that its seat is free, and "
          "how the last commander was lost"),
    Topic("rope/nodes", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 25.0, "simulation",
          "x, y, z [m] and tension [N] of each node, from the hang-off down"),
    Topic("rope/markers", "visualization_msgs/msg/MarkerArray", Qos.STREAM, 25.0, "simulation",
          "rope coloured by tension, payload, hang-off"),
    Topic("rope/vibration", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 5.0, "simulation",
          "how the rope shakes: x, y, z [m] of each node, from the hang-off down, cross_flow "
          "[A/d], cross_flow_hz, in_line, in_line_hz where the model has them, and "
          "drag_amplification, what it multiplies the rope's drag by (1: nothing); if asked for, "
          "or the scene's model is beside the step",
          only_with="vibration"),
    Topic("rope/fatigue", "std_msgs/msg/Float64MultiArray", Qos.STREAM, 1.0, "simulation",
          "fatigue used of each metre of material, from the lower end up: its distance from there "
          "and from the hang-off (negative: aboard) [m], Miner's sum; if asked for",
          only_with="fatigue"),
    Topic("rope/bend", "sensor_msgs/msg/JointState", Qos.STREAM, 25.0, "simulation",
          "tightest bend of each rope with bending stiffness or minimum_bend_radius_m, by name "
          "with the unit in it: cable/radius_m, /line_out_m down to it, /x_m, /y_m, /z_m, "
          "/tightest_m since the start, /minimum_m if given: position",
          only_with="bends"),
    Topic("rope/utilisation", "sensor_msgs/msg/JointState", Qos.STREAM, 5.0, "simulation",
          "of each rope by name since the start: cable/utilisation, highest tension over MBL; "
          "/dynamic_amplification, highest tension over static at the same line out; /highest_n; "
          "/static_n now: position", only_with="strength"),
    Topic("ropes/state", "sensor_msgs/msg/JointState", Qos.STREAM, 50.0, "simulation",
          "where ropes meet, or one was cut, of each rope by name: position length [m], velocity "
          "payout [m/s], effort tension at its upper end [N]; of each bar: length, 0, pull",
          only_with="ropes"),
    Topic("ropes/nodes", "sensor_msgs/msg/PointCloud2", Qos.STREAM, 25.0, "simulation",
          "where ropes meet, or one was cut: x, y, z [m], tension [N] and number of the rope of "
          "each node, rope after rope, from its upper end down", only_with="ropes"),
    Topic("payloads/state", "sensor_msgs/msg/JointState", Qos.STREAM, 50.0, "simulation",
          "where ropes meet, or one was cut: position [m] and velocity [m/s] of each payload, "
          "names like tool/x", only_with="ropes"),
    Topic("bars/state", "sensor_msgs/msg/JointState", Qos.STREAM, 25.0, "simulation",
          "ends of each bar between ropes that meet, names like bar/from_x, bar/to_z: position [m]",
          only_with="struts"),
    Topic("lines/crossings", "sensor_msgs/msg/JointState", Qos.STREAM, 5.0, "simulation",
          "of two lines around a sheave, by name with the unit in it: nearest/depth_m, "
          "nearest/distance_m, crossing_1/depth_m, /angle_deg, /gap_m, /x_m, /y_m: position",
          only_with="lines"),
    Topic("lines/events", "std_msgs/msg/String", Qos.COMMAND, 0.0, "simulation",
          "where two lines begin to cross or part again: time, depth, angle, in words",
          only_with="line_events"),
    Topic("seabed/contact", "sensor_msgs/msg/JointState", Qos.STREAM, 50.0, "simulation",
          "with a seabed, of payload and rope: position height of the payload above it, length of "
          "rope on it [m]; effort the bed's push on each [N]", only_with="seabed"),
    Topic("seabed/touchdown", "sensor_msgs/msg/JointState", Qos.STREAM, 25.0, "simulation",
          "with a seabed, where each rope that touches it first does, by name with the unit in it: "
          "cable/x_m, /y_m, /z_m, /line_out_m, /layback_m, /tension_n, /angle_deg: position",
          only_with="seabed"),
    Topic("payload/rigging", "sensor_msgs/msg/JointState", Qos.STREAM, 25.0, "simulation",
          "of a rigid body: position length [m] and effort pull [N] of each sling; of a deck "
          "height of the lowest corner above it and push; of size/x, y, z its outline [m]; of "
          "sling_1/x, y, z where a sling holds the body [m], in frame sea",
          only_with="body"),
    Topic("diagnostics", "diagnostic_msgs/msg/DiagnosticArray", Qos.COMMAND, 1.0, "simulation",
          "pacing, solver, inputs: OK, WARN, ERROR with the reason; of the recorder too"),
    Topic("twin/epoch", "builtin_interfaces/msg/Time", Qos.LATCHED, 0.0, "simulation",
          "ROS time of the twin's t = 0; replayed inputs are stamped from it"),
    Topic("twin/session", "std_msgs/msg/String", Qos.LATCHED, 0.0, "simulation",
          "JSON, at each start and after each pause: what `rope_twin replay` needs: scene, "
          "parameters, program, machine, seeds, and the state where it does not start at rest"),
    Topic("twin/inputs", "std_msgs/msg/String", Qos.LOG, 0.0, "simulation",
          "JSON, for each slot with inputs: the twin time at which they were applied, and each "
          "call with all its numbers"),
)  # fmt: skip

# where each kind of order to a winch comes in
ORDER_TOPICS = {
    SPEED: "winch/speed_command",
    LENGTH: "winch/length_command",
    DEPTH: "winch/depth_command",
    TENSION: "winch/tension_command",
}
SWITCH_TOPIC = "winch/switch_command"
CUT_TOPIC = "rope/cut"
SEAT_TOPIC = "winch/seat"
WINCH_TOPICS = (*ORDER_TOPICS.values(), SWITCH_TOPIC)
SESSION_TOPIC, INPUT_LOG_TOPIC = "twin/session", "twin/inputs"
MOTION_TOPICS = "ship/heave", "ship/odometry"
# what the simulation listens to
INPUTS = (*MOTION_TOPICS, *WINCH_TOPICS, CUT_TOPIC, "current")

BY_NAME: dict[str, Topic] = {topic.name: topic for topic in TOPICS}
