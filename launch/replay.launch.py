"""Replay of a recording on a ROS 2 machine: player, predictions, monitor, recorder.

    ros2 launch launch/replay.launch.py recording:=cut.mcap bag:=again.mcap rate:=1.0

The nodes and what each waits for before it starts come from turnmill_ros.node_table. A rate of 0 is as fast
as nothing is lost.
"""

import sys
from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from turnmill_core.operation_file import read_operation
from turnmill_ros.bag import bag_info
from turnmill_ros.monitor_feed import settings_for
from turnmill_ros.node_table import replay_specs, with_matches

ARGUMENTS = {
    "recording": ("", "MCAP file to play"),
    "operation": ("", "operation file (YAML) instead of the recorded one"),
    "bag": ("", "MCAP file to record to; empty: do not record"),
    "namespace": ("", "namespace of all nodes and topics"),
    "rate": ("1.0", "speed; 0: as fast as nothing is lost"),
}


def nodes(context):
    """Launch actions of all nodes."""
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    operation = read_operation(Path(value["operation"])) if value["operation"] else None
    settings = settings_for(bag_info(value["recording"]), operation)
    specs = with_matches(replay_specs(
        value["recording"], value["bag"] or None, rate=float(value["rate"]), prior=settings.prior, axes=settings.axes,
        operation_text=operation.text if operation else None))
    return [
        Node(executable=sys.executable, arguments=["-m", spec.kind.module], name=spec.name,
             namespace=value["namespace"], output="screen",
             parameters=[{**spec.parameters, **({"linger": 3.0} if spec.name == "recorder" else {})}])
        for spec in specs
    ]


def generate_launch_description():
    """What ros2 launch runs."""
    declared = [DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
