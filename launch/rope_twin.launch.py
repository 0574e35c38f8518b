"""The suite as separate processes, for machines with ros2 launch.

ros2 launch rope_twin rope_twin.launch.py scene:=storm record:=true

`rope_twin run --processes` does the same where there is no ros2 launch.
"""

import inspect
import os

from launch.actions import DeclareLaunchArgument, ExecuteLocal, SetEnvironmentVariable
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import (
    LaunchConfiguration,
    LaunchLogDir,
    PathJoinSubstitution,
    PythonExpression,
)
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription

# name, default, description
ARGUMENTS = (
    ("scene", "deep_lift", "name of a scene in config/scenes, or a path to one"),
    ("bag", "", "recorded heave to replay: a name in bags/ or a path; empty: the scene's own"),
    ("poses", "", "recorded poses of the ship to replay instead: a name in bags/ or a path"),
    ("topic", "", "topic in that bag; empty: the only one that fits"),
    ("sea_offset", "0.0", "offset into the recording [s]"),
    ("speed", "1.0", "twin time over real time"),
    ("sea", "true", "play the recorded sea; false: a motion sensor publishes ship/heave"),
    ("feed", "", "settings of instruments to read, in config/feeds or a path; empty: none"),
    ("schedule", "true", "play the scene's winch schedule; false: somebody else commands"),
    ("follow_measured", "false", "winches follow winch/measured; with it schedule:=false"),
    ("learn", "false", "learn weight, mass, drag and stiffness from winch/measured"),
    ("apply_learned", "false", "with it: take the figures over after each minute"),
    ("ahead", "false", "forecast tension, risks and quiet windows of the next minute"),
    ("record", "false", "record every topic"),
    ("out", "", "bag directory to create; empty: rope_twin_DATE_TIME"),
    ("view", "false", "show the run in rerun"),
    ("view_file", "", "write this .rrd file instead of opening a window"),
    ("console", "", "HOST:PORT of the operator console, a web page; empty: none"),
    ("control", "false", "let its pages command the winch, with the token that it prints"),
    ("allow_cut", "false", "listen to ropes/cut: whoever publishes there cuts the rope"),
    ("network", "false", "let other machines take part; false: loopback interface only"),
    (
        "state",
        [LaunchLogDir(), "/simulation.state"],
        "file that the state is saved to, and from which a simulation that died goes on",
    ),
    ("namespace", "", "namespace of all nodes and topics"),
    (
        "params",
        PathJoinSubstitution([FindPackageShare("rope_twin"), "config", "ros", "suite.yaml"]),
        "parameter file of all nodes; the other arguments win over it",
    ),
)


def generate_launch_description() -> LaunchDescription:
    """All arguments and one process for each node."""
    value = LaunchConfiguration
    text = {"value_type": str}
    scene = {"scene": ParameterValue(value("scene"), **text)}
    speed = {"speed": ParameterValue(value("speed"), value_type=float)}
    common = {
        "package": "rope_twin",
        "namespace": value("namespace"),
        "output": "screen",
        "respawn": True,  # what dies is started again ...
        "respawn_delay": 0.5,
    }
    if "respawn_max_retries" in inspect.signature(ExecuteLocal.__init__).parameters:
        common["respawn_max_retries"] = 3  # ... so often at most
    shown = {**common, "respawn": False}  # whoever closes the window wants no other one
    file = ParameterFile(value("params"), allow_substs=True)
    sea = {
        "bag": ParameterValue(value("bag"), **text),
        "poses": ParameterValue(value("poses"), **text),
        "topic": ParameterValue(value("topic"), **text),
        "sea_offset_s": ParameterValue(value("sea_offset"), value_type=float),
    }
    named = PythonExpression(["'", value("bag"), value("poses"), "' != ''"])
    other = {"other_sea": ParameterValue(named, value_type=bool)}  # no error by the card then
    cut = {"allow_cut": ParameterValue(value("allow_cut"), value_type=bool)}
    follow = {"follow_measured": ParameterValue(value("follow_measured"), value_type=bool)}
    follow |= {
        "learn": ParameterValue(value("learn"), value_type=bool),
        "apply_learned": ParameterValue(value("apply_learned"), value_type=bool),
    }
    bag = {"out": ParameterValue(value("out"), **text), "beside": True}
    state = ParameterValue(value("state"), **text)
    saved = {"save_state": state, "from_state": state, "save_every_s": 2.0}
    read = PythonExpression(["'", value("feed"), "' != ''"])
    instruments = {"settings": ParameterValue(value("feed"), **text)}
    picture = {"file": ParameterValue(value("view_file"), **text)}
    asked = PythonExpression(["'", value("console"), "' != ''"])
    served = {
        "address": ParameterValue(value("console"), **text),
        "control": ParameterValue(value("control"), value_type=bool),
    }
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=about)
                for name, default, about in ARGUMENTS
            ),
            *_loopback(value("network")),
            Node(
                executable="recorder_node",
                name="recorder",
                parameters=[file, bag, cut],
                condition=IfCondition(value("record")),
                **common,
            ),
            Node(
                executable="viewer_node",
                name="viewer",
                parameters=[file, picture],
                condition=IfCondition(value("view")),
                **shown,
            ),
            Node(
                executable="forecast_node",
                name="forecast",
                parameters=[file, scene],
                condition=IfCondition(value("ahead")),
                **common,
            ),
            Node(
                executable="console_node",
                name="console",
                parameters=[file, scene, served],
                condition=IfCondition(asked),
                **common,
            ),
            Node(
                executable="sea_state_node",
                name="sea_state",
                parameters=[file, scene, speed, sea],
                condition=IfCondition(value("sea")),
                **common,
            ),
            Node(
                executable="feed_node",
                name="feed",
                parameters=[file, instruments],
                condition=IfCondition(read),
                **common,
            ),
            Node(
                executable="winch_schedule_node",
                name="winch_schedule",
                parameters=[file, scene, speed],
                condition=IfCondition(value("schedule")),
                **common,
            ),
            Node(
                executable="simulation_node",
                name="simulation",
                parameters=[file, scene, speed, other, cut, follow, saved],
                **common,
            ),
        ]
    )


def _loopback(network: LaunchConfiguration) -> list[SetEnvironmentVariable]:
    """Keep the nodes to this machine, unless the argument or the environment says otherwise."""
    discovery, profiles = "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTDDS_DEFAULT_PROFILES_FILE"
    if discovery in os.environ:
        return []
    own = PathJoinSubstitution(
        [FindPackageShare("rope_twin"), "config", "ros", "fastdds_loopback.xml"]
    )
    wanted = {discovery: "LOCALHOST", profiles: os.environ.get(profiles, own)}
    closed = UnlessCondition(network)
    return [SetEnvironmentVariable(*pair, condition=closed) for pair in wanted.items()]
