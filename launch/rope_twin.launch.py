"""The suite as separate processes, for machines with ros2 launch.

ros2 launch rope_twin rope_twin.launch.py scene:=storm record:=true

`rope_twin run --processes` does the same where there is no ros2 launch.
"""

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
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
    ("bag_start", "0.0", "offset into the bag [s]"),
    ("speed", "1.0", "twin time over real time"),
    ("sea", "true", "play the recorded sea; false: a motion sensor publishes ship/heave"),
    ("schedule", "true", "play the scene's winch schedule; false: somebody else commands"),
    ("record", "false", "record every topic"),
    ("directory", "", "bag directory to make; empty: rope_twin_DATE_TIME"),
    ("view", "false", "show the run in rerun"),
    ("view_file", "", "write this .rrd file instead of opening a window"),
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
    }
    file = ParameterFile(value("params"), allow_substs=True)
    sea = {
        "bag": ParameterValue(value("bag"), **text),
        "poses": ParameterValue(value("poses"), **text),
        "topic": ParameterValue(value("topic"), **text),
        "start_s": ParameterValue(value("bag_start"), value_type=float),
    }
    named = PythonExpression(["'", value("bag"), value("poses"), "' != ''"])
    other = {"other_sea": ParameterValue(named, value_type=bool)}  # no error by the card then
    bag = {"directory": ParameterValue(value("directory"), **text)}
    picture = {"file": ParameterValue(value("view_file"), **text)}
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=about)
                for name, default, about in ARGUMENTS
            ),
            Node(
                executable="recorder_node",
                name="recorder",
                parameters=[file, bag],
                condition=IfCondition(value("record")),
                **common,
            ),
            Node(
                executable="viewer_node",
                name="viewer",
                parameters=[file, picture],
                condition=IfCondition(value("view")),
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
                executable="winch_schedule_node",
                name="winch_schedule",
                parameters=[file, scene, speed],
                condition=IfCondition(value("schedule")),
                **common,
            ),
            Node(
                executable="simulation_node",
                name="simulation",
                parameters=[file, scene, speed, other],
                **common,
            ),
        ]
    )
