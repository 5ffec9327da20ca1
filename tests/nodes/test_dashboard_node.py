"""The node behind the live page: what it takes from the graph, and a port that is taken."""

from __future__ import annotations

import socket

import pytest

from tests.nodes.ros_tools import Probe
from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.monitoring.verdict import ChatterKind, Reason, Verdict
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.stability.margin import stability_margin
from turnmill_ros import topics
from turnmill_ros.conversions import (
    loads_to_message,
    margin_to_message,
    operation_to_message,
    suggestion_to_message,
    verdict_to_message,
)
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes.dashboard import Dashboard

pytestmark = pytest.mark.ros


def test_the_page_gets_what_the_graph_publishes(probe: Probe) -> None:
    op, types = read_operation(shipped_operations()["milling_benchmark_1dof"]), ros_types()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        taken.listen()
        with pytest.raises(InputError, match=f"port {port}"):
            probe.add(Dashboard, port=port)
    node = probe.add(Dashboard, port=port)
    sent = (topics.OPERATION, topics.CHATTER_STATE, topics.STABILITY_MARGIN, topics.CUTTING_LOADS,
            topics.PLAN_SUGGESTION)
    probe.announce(*sent)
    assert probe.until(lambda: all(probe.out[t.name].get_subscription_count() for t in sent))
    verdict = Verdict(0, 10**9, 1, "daq", 1, "mic", ChatterKind.HOPF, Reason.ASYNCHRONOUS, "why", 778.0)
    nothing = {"tool_speed": 300.0, "workpiece_speed": 0.0, "depth": 1e-3, "feed": 1e-4, "material_removal_rate": 1e-7,
               "present_removal_rate": 1e-7, "form_error": 0.0, "share_feasible": 1.0, "draws": 2, "widened": 1.0,
               "limits": [], "margins": [], "operation_hash": op.sha256}
    for topic, message in (
        (topics.OPERATION, operation_to_message(op, 0, types)),
        (topics.CHATTER_STATE, verdict_to_message(verdict, op.sha256, types)),
        (topics.STABILITY_MARGIN, margin_to_message(
            stability_margin(op, op.conditions, speed_search=False), 10**9, op.sha256, types)),
        (topics.CUTTING_LOADS, loads_to_message(cutting_loads(op, op.conditions), 10**9, op.sha256, types)),
        (topics.PLAN_SUGGESTION, suggestion_to_message(
            {**nothing, "feasible": True, "reasons": ["because"]}, 10**9, types)),
    ):
        probe.publish(topic, message)
    data = node._data
    assert probe.until(lambda: bool(data.verdicts and data.margins and data.loads and data.suggestion))
    assert data.operation == op.name
    assert data.verdicts[0].chatter_frequency == 778.0
    assert data.margins[0][1] == pytest.approx(op.conditions.depth * 1e3)
    assert data.suggestion == ("tool 2865 rpm, 1 mm", "because")
