"""A probe in a fresh ROS domain."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'turnmill[ros]'")
pytest.importorskip("turnmill_msgs", reason="turnmill_msgs is not installed: pip install ./msg_schemas/turnmill_msgs")


@pytest.fixture
def probe(ros_context: Any) -> Iterator[Any]:
    from tests.nodes.ros_tools import Probe

    probe = Probe(ros_context)
    yield probe
    for node in list(probe.executor_.get_nodes()):
        node.destroy_node()
    probe.executor_.shutdown(timeout_sec=1.0)
