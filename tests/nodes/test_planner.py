"""The planner: what it remembers, and what it suggests on request."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from turnmill_msgs.srv import Replan

from tests.nodes.ros_tools import Probe
from turnmill_core.machine.conditions import with_cut
from turnmill_core.monitoring.verdict import ChatterKind, Reason, Verdict
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.stability.margin import stability_margin, stability_point
from turnmill_ros import topics
from turnmill_ros.conversions import margin_to_message, operation_to_message, verdict_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support
from turnmill_ros.nodes.planner import Planner
from turnmill_ros.observed import AGREEING, KEPT, Observed

RPM = math.pi / 30


def verdict(stamp_ns: int, state: ChatterKind, frequency: float = math.nan) -> Verdict:
    return Verdict(stamp_ns - 1, stamp_ns, 2, "daq", 1, "mic", state, Reason.ASYNCHRONOUS, "", frequency)


def feed(observed: Observed, start_ns: int, depth: float, states: list[ChatterKind], frequency: float = 900.0) -> None:
    for k, state in enumerate(states):
        observed.cut(start_ns + k, 300.0, 1.0, depth, in_cut=True)
        observed.verdict(verdict(start_ns + k, state, frequency))


def test_a_cut_judged_alike_often_enough_is_an_observation() -> None:
    observed = Observed()
    feed(observed, 0, 1e-3, [ChatterKind.STABLE] * (AGREEING - 1))
    assert observed.observations() == ()
    feed(observed, 10, 1e-3, [ChatterKind.MARGINAL] + [ChatterKind.STABLE] * AGREEING)
    (stable,) = observed.observations()
    assert (stable.chatter, stable.depth) == (False, 1e-3)
    assert math.isnan(stable.frequency)
    feed(observed, 20, 2e-3, [ChatterKind.HOPF] * AGREEING)
    feed(observed, 30, 1.001e-3, [ChatterKind.FLIP] * AGREEING)
    assert [(o.depth, o.chatter, o.frequency) for o in observed.observations()] == [
        (2e-3, True, 900.0), (1.001e-3, True, 900.0)], "a cut that is the same is replaced"
    for k in range(8):
        feed(observed, 100 + 10 * k, 3e-3 + k * 1e-3, [ChatterKind.STABLE] * AGREEING)
    assert len(observed.observations()) == KEPT


def test_a_ramp_and_a_late_verdict_are_no_observation() -> None:
    observed = Observed()
    for k in range(20):
        observed.cut(k, 300.0 * 1.05**k, 1.0, 1e-3, in_cut=True)
        observed.verdict(verdict(k, ChatterKind.HOPF, 900.0))
    for k in range(20):
        observed.verdict(verdict(3_000_000_000 + k, ChatterKind.HOPF, 900.0))
    assert observed.observations() == ()
    observed.cut(10**10, 300.0, 1.0, -1e-3, in_cut=False)
    assert observed.present is None


def ask(probe: Probe, **request: Any) -> Any:
    client = probe.create_client(Replan, "replan")
    assert client.wait_for_service(10.0)
    answer = client.call_async(Replan.Request(**request))
    assert probe.until(answer.done)
    return answer.result()


def operation() -> Operation:
    return read_operation(shipped_operations()["milling_benchmark_1dof"])


@pytest.mark.ros
def test_chatter_that_was_heard_leads_to_a_stable_suggestion_with_reasons(probe: Probe) -> None:
    op, types = operation(), ros_types()
    probe.announce(topics.OPERATION, topics.STABILITY_MARGIN, topics.CHATTER_STATE)
    probe.publish(topics.OPERATION, operation_to_message(op, 0, types))
    probe.listen(topics.PLAN_SUGGESTION)
    planner = probe.add(Planner, match=["stability_margin=1", "chatter_state=1", "plan_suggestion=1"])
    assert support.start(planner)
    deep = 2 * stability_margin(op, op.conditions, speed_search=False).depth_limit
    cut = with_cut(op, depth=deep)
    heard = stability_point(op, cut).chatter_frequency
    margin = replace(stability_margin(op, cut, speed_search=False), depth=deep)
    for k in range(AGREEING + 1):
        stamp = 10**12 + k * 50_000_000
        probe.publish(topics.STABILITY_MARGIN, margin_to_message(margin, stamp, op.sha256, types))
        probe.publish(topics.CHATTER_STATE, verdict_to_message(
            verdict(stamp, ChatterKind.HOPF, heard), op.sha256, types))
    assert probe.until(lambda: probe.value("planner", "cuts_observed") == "1")
    assert ask(probe, samples=8, seed=3).accepted
    suggestions = probe.heard["plan_suggestion"]
    assert probe.until(lambda: len(suggestions) == 1, 90.0)
    found = suggestions[0]
    assert found.feasible
    assert found.operation_hash == op.sha256
    assert found.share_feasible >= 0.9
    assert found.present_removal_rate > 0
    assert f"measured: chatter at {heard:.1f} Hz" in found.reasons[0]
    assert list(found.margins) == sorted(found.margins)
    assert stability_point(op, with_cut(op, tool_speed=found.tool_speed, depth=found.depth)).spectral_radius < 1
    assert planner.diagnostics.failure is None


@pytest.mark.ros
def test_a_request_that_makes_no_sense_is_told(probe: Probe) -> None:
    planner = probe.add(Planner)
    refused = ask(probe)
    assert not refused.accepted
    assert "no operation" in refused.message
    op = operation()
    probe.announce(topics.OPERATION)
    probe.publish(topics.OPERATION, operation_to_message(op, 0, ros_types()))
    assert support.start(planner)
    assert "share" in ask(probe, share=2.0).message
    assert "mode frequencies" in ask(probe, mode_frequencies=[100.0, 200.0, 300.0]).message
    assert not ask(probe, mode_frequencies=[-100.0]).accepted
    assert ask(probe, samples=20).accepted
    assert planner._search is not None
    process = planner._search[0]
    planner.trigger_deactivate()
    assert process.wait(10.0) != 0, "a search that goes on ends with the node"
