"""A node in a process of its own, as `turnmill live --separate-processes` starts it, and this process beside it."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

os.environ.setdefault("ROS_DOMAIN_ID", "97")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import rclpy
import yaml
from rclpy.node import Node

from turnmill_core.operation import Operation
from turnmill_ros import topics
from turnmill_ros.conversions import operation_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support

PROFILE = Path(support.__file__).parents[1] / "fastdds.xml"


def cpu_seconds(pid: int) -> float:
    """Processor time that a process has used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def running(
    name: str, op: Operation, parameters: Mapping[str, object], heard: topics.Topic,
) -> Iterator[SimpleNamespace]:
    """Node `name` on an operation, active: its `pid`, our publishers `out` by topic, our subscription `heard`."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node: Any = Node("bench", context=context, use_global_arguments=False)
    node.diagnostics = SimpleNamespace(phase=support.ACTIVE, refuse=print)
    out = {t: support.publisher(node, t, keep_all=True) for t in topics.INPUTS}
    support.send(out[topics.OPERATION], operation_to_message(op, 0, ros_types()))
    subscribed = node.create_subscription(ros_types()[heard.type], heard.name, lambda message: None, 1000)
    told: list[str] = []
    states = support.subscription(node, topics.DIAGNOSTICS, lambda message: told.extend(
        entry.value for status in message.status if status.name == name
        for entry in status.values if entry.key == "phase"))
    parameters = {"match": ["joint_states=1", f"{heard.name}=1"], **parameters}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "parameters.yaml"
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}), encoding="utf-8")
        environment = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(PROFILE), **os.environ}
        with subprocess.Popen([sys.executable, "-m", f"turnmill_ros.nodes.{name}", "--ros-args", "--params-file",
                               str(file)], env=environment) as child:
            while support.ACTIVE not in told:
                if child.poll() is not None:
                    raise SystemExit(f"{name} ended with exit code {child.returncode}")
                support.drain(node)
                time.sleep(0.01)
            node.destroy_subscription(states)
            yield SimpleNamespace(pid=child.pid, out=out, heard=subscribed)
            child.terminate()
    node.destroy_node()
    rclpy.shutdown(context=context)


def received(subscribed: Any, handle: Callable[[Any, Mapping[str, int]], None]) -> None:
    """Hand every message that has arrived to `handle`, with when it was sent and received [ns]."""
    while True:
        with subscribed.handle:
            found = subscribed.handle.take_message(subscribed.msg_type, False)
        if found is None:
            return
        handle(*found)
