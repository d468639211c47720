"""A compensator, and where no real stage is there a simulated one, in one namespace.

ros2 launch fomrc_ros stage.launch.py namespace:=axis1 model:=/path/to/model.yaml
"""

import os

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription


def generate_launch_description():
    config = os.path.join(get_package_share_directory("fomrc_ros"), "config")
    arguments = [
        DeclareLaunchArgument("namespace", default_value="", description="namespace of the axis"),
        DeclareLaunchArgument(
            "model", default_value=os.path.join(config, "pi_p753_table1.yaml"), description="model file"
        ),
        DeclareLaunchArgument(
            "parameters", default_value=os.path.join(config, "compensator.yaml"), description="parameter file"
        ),
        DeclareLaunchArgument("simulate", default_value="true", description="start a simulated stage"),
        DeclareLaunchArgument("identify", default_value="true", description="start the identification"),
        DeclareLaunchArgument("watch", default_value="false", description="start the watch"),
        DeclareLaunchArgument("use_sim_time", default_value="false", description="follow /clock"),
        DeclareLaunchArgument(
            "stop_timeout_s",
            default_value="60",
            description="how long a node may take to end: the whole range at safe_ramp_v_per_s, and some",
        ),
    ]
    common = {
        "package": "fomrc_ros",
        "namespace": LaunchConfiguration("namespace"),
        "parameters": [
            # The model first: ~/reload_parameters of the compensator reads the first file it was given.
            LaunchConfiguration("model"),
            LaunchConfiguration("parameters"),
            {"use_sim_time": LaunchConfiguration("use_sim_time")},
        ],
        "output": "screen",
        # After Ctrl-C the voltage is ramped to the safe one; what is stopped before it is there leaves it where it is.
        "sigterm_timeout": LaunchConfiguration("stop_timeout_s"),
        "sigkill_timeout": LaunchConfiguration("stop_timeout_s"),
    }
    nodes = [
        Node(executable="compensator", name="compensator", **common),
        Node(
            executable="simulated_pea",
            name="simulated_pea",
            condition=IfCondition(LaunchConfiguration("simulate")),
            **common,
        ),
        Node(
            executable="identification",
            name="identification",
            condition=IfCondition(LaunchConfiguration("identify")),
            **common,
        ),
        Node(
            executable="watch",
            name="watch",
            condition=IfCondition(LaunchConfiguration("watch")),
            **common,
        ),
    ]
    return LaunchDescription(arguments + nodes)
