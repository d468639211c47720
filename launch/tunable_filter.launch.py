"""A tunable filter: three axes, each with compensator and stage in a namespace, and the gap they set together.

ros2 launch fomrc_ros tunable_filter.launch.py parameters:=/path/to/tunable_filter.yaml
"""

import os

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription


def make_nodes(context):
    parameters = LaunchConfiguration("parameters").perform(context)
    is_simulated = LaunchConfiguration("simulate").perform(context).lower() in ("true", "1", "yes")
    axes = [axis for axis in LaunchConfiguration("axes").perform(context).split(",") if axis]
    common = {
        "package": "fomrc_ros",
        "parameters": [parameters],
        "output": "screen",
        # After Ctrl-C the voltage is ramped to the safe one; what is stopped before it is there leaves it where it is.
        "sigterm_timeout": LaunchConfiguration("stop_timeout_s"),
        "sigkill_timeout": LaunchConfiguration("stop_timeout_s"),
    }
    nodes = []
    for axis in axes:
        nodes.append(Node(executable="compensator", name="compensator", namespace=axis, **common))
        if is_simulated:
            nodes.append(Node(executable="simulated_pea", name="simulated_pea", namespace=axis, **common))
    if len(axes) == 3:
        # After the file, so that the axes started are those the gap is made of.
        # One string: in a list of a parameter file the client library takes an axis y for a truth value.
        gap = common | {"parameters": [parameters, {"axes": ",".join(axes)}]}
        nodes.append(Node(executable="gap_command", name="gap_command", **gap))
        nodes.append(Node(executable="gap_monitor", name="gap_monitor", **gap))
    return nodes


def generate_launch_description():
    config = os.path.join(get_package_share_directory("fomrc_ros"), "config")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "parameters",
                default_value=os.path.join(config, "tunable_filter.yaml"),
                description="one parameter file for all axes",
            ),
            DeclareLaunchArgument("axes", default_value="axis1,axis2,axis3", description="namespaces"),
            DeclareLaunchArgument("simulate", default_value="true", description="start simulated stages"),
            DeclareLaunchArgument(
                "stop_timeout_s",
                default_value="60",
                description="how long a node may take to end: the whole range at safe_ramp_v_per_s, and some",
            ),
            OpaqueFunction(function=make_nodes),
        ]
    )
