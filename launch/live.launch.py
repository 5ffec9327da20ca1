"""Live run on a ROS 2 machine: simulated machine and process, predictions, monitor, recorder.

    ros2 launch launch/live.launch.py operation:=cut.yaml bag:=cut.mcap

The nodes and what each waits for before it starts come from turnmill_ros.node_table.
"""

import sys
from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from turnmill_ros.node_table import live_specs, with_matches

ARGUMENTS = {
    "operation": ("", "operation file (YAML)"),
    "bag": ("", "MCAP file to record to; empty: do not record"),
    "namespace": ("", "namespace of all nodes and topics"),
    "sample_rate": ("51200", "Hz, of the simulated sensors"),
    "channels": ("", "number of simulated channels in SI units, 1 to 5; empty: the operation's sensors in volts, or 5"),
    "seed": ("0", "seed of the simulated noise"),
}


def nodes(context):
    """Launch actions of all nodes."""
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    specs = with_matches(live_specs(
        Path(value["operation"]).read_text(encoding="utf-8"), value["bag"] or None, seed=int(value["seed"]),
        sample_rate=float(value["sample_rate"]), channels=int(value["channels"] or 0) or None))
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
