"""Single nodes: what they answer, refuse, and say of themselves."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.parameter import Parameter
from turnmill_msgs.srv import GetStability, LoadOperation

from tests.bag_cases import block, write
from tests.nodes.ros_tools import Probe
from turnmill_core.cutting.along_path import loads_along
from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import conditions_from_axes
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.operation import Operation
from turnmill_core.operation_file import parse_operation, read_operation, shipped_operations
from turnmill_core.stability.margin import stability_margin
from turnmill_ros import topics
from turnmill_ros.bag import bag_info
from turnmill_ros.conversions import (
    axes_from_message,
    axes_to_message,
    block_from_message,
    block_to_message,
    loads_from_message,
    margin_from_message,
    operation_to_message,
    time_from_message,
    wrench_to_message,
)
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support
from turnmill_ros.nodes.chatter_monitor import ChatterMonitor
from turnmill_ros.nodes.controller import Controller, Overrides, overridden
from turnmill_ros.nodes.force_predictor import ForcePredictor
from turnmill_ros.nodes.operation_server import OperationServer
from turnmill_ros.nodes.player import Player
from turnmill_ros.nodes.process_simulator import ProcessSimulator
from turnmill_ros.nodes.stability_monitor import StabilityMonitor
from turnmill_ros.operations import changed_text

pytestmark = pytest.mark.ros


def operation(name: str = "thesis_table_4_9") -> Operation:
    return read_operation(shipped_operations()[name])


def ask(probe: Probe, kind: Any, name: str, request: Any) -> Any:
    client = probe.create_client(kind, name)
    assert client.wait_for_service(10.0)
    answer = client.call_async(request)
    assert probe.until(answer.done)
    return answer.result()


def publish_operation(probe: Probe, op: Operation) -> None:
    probe.announce(topics.OPERATION)
    probe.publish(topics.OPERATION, operation_to_message(op, 0, ros_types()))


def test_the_operation_server_keeps_the_old_operation_when_a_new_one_is_bad(probe: Probe) -> None:
    first, second = operation(), operation("thesis_table_4_10")
    server = probe.add(OperationServer, operation_text=first.text)
    refused = ask(probe, LoadOperation, "load_operation", LoadOperation.Request(
        yaml=first.text.replace("diameter: 20 mm", "diameter: 20")))
    assert not refused.success
    assert "diameter" in refused.message
    assert refused.sha256 == first.sha256 == server.operation.sha256
    probe.listen(topics.OPERATION)  # latched: a late subscriber gets it
    heard = probe.heard["operation"]
    assert probe.until(lambda: len(heard) == 1)
    before = probe.get_clock().now().nanoseconds
    taken = ask(probe, LoadOperation, "load_operation", LoadOperation.Request(yaml=second.text))
    assert taken.success
    assert taken.sha256 == second.sha256
    assert probe.until(lambda: len(heard) == 2)
    assert [m.sha256 for m in heard] == [first.sha256, second.sha256]
    assert heard[1].yaml == second.text
    assert time_from_message(heard[1].header.stamp) > before + 150_000_000, "it holds from a little later on"


@given(st.lists(st.tuples(st.floats(0, 2), st.floats(0, 2), st.floats(-1e-3, 1e-3)), min_size=2, max_size=30))
@settings(max_examples=30, deadline=None)
def test_overrides_keep_axes_continuous_and_positions_the_integral_of_velocity(
    chosen: list[tuple[float, float, float]],
) -> None:
    op, dt = operation(), 0.004
    offsets, before, last = (0.0,) * 6, axis_state_at(op, 0.0, 0), None
    for k, by in enumerate(chosen):
        now = axis_state_at(op, k * dt, k)
        state, offsets = overridden(op, offsets, before, now, Overrides(*by))
        if last is not None:
            for axis in (2, 4, 5):  # z, c, s: at constant set speed the step is the velocity times the time
                assert state.position[axis] - last.position[axis] == pytest.approx(state.velocity[axis] * dt, abs=1e-9)
        assert state.velocity[5] == pytest.approx(by[0] * now.velocity[5])
        assert state.velocity[2] == pytest.approx(by[1] * now.velocity[2]), "the feed follows the workpiece"
        assert state.position[0] == pytest.approx(now.position[0] - by[2])
        before, last = now, state


def test_the_controller_takes_overrides_while_it_runs(probe: Probe) -> None:
    op = operation()
    publish_operation(probe, op)
    probe.listen(topics.JOINT_STATES)
    controller = probe.add(Controller, match=["joint_states=1"])
    assert support.start(controller)
    heard = probe.heard["joint_states"]
    assert probe.until(lambda: len(heard) > 20)
    controller.set_parameters([Parameter("tool_speed_override", value=0.5), Parameter("depth_offset", value=0.001)])
    nominal = op.conditions
    assert probe.until(lambda: axes_from_message(heard[-1]).velocity[5] == pytest.approx(nominal.tool_speed / 2))
    controller.trigger_deactivate()
    states = [axes_from_message(m) for m in heard]
    assert {b.stamp_ns - a.stamp_ns for a, b in pairwise(states)} == {4_000_000}
    assert conditions_from_axes(op, states[0]).depth == pytest.approx(nominal.depth)
    assert conditions_from_axes(op, states[-1]).depth == pytest.approx(nominal.depth + 0.001)


def test_a_parameter_out_of_range_is_refused(probe: Probe) -> None:
    controller = probe.add(Controller)
    answer = controller.set_parameters_atomically([Parameter("tool_speed_override", value=3.0)])
    assert not answer.successful
    assert "out of range" in answer.reason
    described = controller.describe_parameter("tool_speed_override")
    assert "factor" in described.description
    assert described.floating_point_range[0].to_value == 2.0


def test_the_force_predictor_publishes_what_the_core_computes(probe: Probe) -> None:
    op = operation()
    publish_operation(probe, op)
    for topic in (topics.CUTTING_LOADS, topics.WRENCH_TOOL, topics.WRENCH_MACHINE):
        probe.listen(topic)
    probe.announce(topics.JOINT_STATES)
    predictor = probe.add(ForcePredictor, match=["joint_states=1", "cutting_loads=1", "wrench/machine=1"])
    assert support.start(predictor)
    states = [axis_state_at(op, k * 0.004, 10**12 + k * 4_000_000) for k in range(50)]
    for state in states:
        probe.publish(topics.JOINT_STATES, axes_to_message(state, ros_types()))
    heard = probe.heard["cutting_loads"]
    assert probe.until(lambda: len(heard) == 10 and len(probe.heard["wrench/machine"]) == 10)
    loads = loads_from_message(heard[3])
    expected = cutting_loads(op, conditions_from_axes(op, states[15]))
    assert loads["stamp_ns"] == states[15].stamp_ns, "50 of 250 axis states a second"
    np.testing.assert_allclose(loads["force_tool_mean"], expected.force_tool_mean, rtol=1e-6)
    assert loads["tool_torque_mean"] == pytest.approx(expected.tool_torque_mean)
    assert heard[3].operation_hash == op.sha256
    tool, machine = probe.heard["wrench/tool"][3].wrench, probe.heard["wrench/machine"][3].wrench
    assert (tool.torque.x, tool.torque.y) == (0.0, 0.0)
    assert tool.torque.z == pytest.approx(expected.tool_torque_mean)
    assert machine.torque.x == pytest.approx(tool.torque.z), "z_T is x_M in turn-milling"
    assert machine.force.x == pytest.approx(tool.force.z)
    far = replace(states[0], stamp_ns=2 * 10**12, position=(*states[0].position[:3], 0.7, 0.0, 0.0))
    probe.publish(topics.JOINT_STATES, axes_to_message(far, ros_types()))
    assert probe.until(lambda: any("no prediction" in s.message and "axis b" in s.message
                                   for s in probe.statuses("force_predictor")))


def test_the_force_predictor_follows_the_workpiece_in_process(probe: Probe) -> None:
    """A tilted tool has no closed form; the node gives what the path gives."""
    op = parse_operation(changed_text(operation().text, ["cut.tilt=2 deg", "tool.flute_length=40 mm"]))
    publish_operation(probe, op)
    probe.listen(topics.CUTTING_LOADS)
    probe.announce(topics.JOINT_STATES)
    predictor = probe.add(ForcePredictor, match=["joint_states=1", "cutting_loads=1"])
    assert support.start(predictor)
    states = [axis_state_at(op, k * 0.02, 10**12 + k * 20_000_000) for k in range(12)]
    for axes in states:
        probe.publish(topics.JOINT_STATES, axes_to_message(axes, ros_types()))
    heard = probe.heard["cutting_loads"]
    assert probe.until(lambda: len(heard) == 12)
    expected = loads_along(op, states)
    assert expected.method == "swept"
    assert expected.in_cut.all()
    found = np.array([loads_from_message(m)["force_machine_mean"] for m in heard])
    np.testing.assert_allclose(found, expected.force_machine, rtol=1e-9)
    with pytest.raises(InputError, match=r"engagement.*guess.*auto or closed or swept"):
        probe.add(ForcePredictor, engagement="guess")


def test_the_force_predictor_estimates_the_scale_of_the_force_coefficients(probe: Probe) -> None:
    """Force channels of sensor blocks and a dynamometer's wrench, 1.2 times the prediction."""
    op = operation()
    publish_operation(probe, op)
    probe.listen(topics.FORCE_SCALE)
    for topic in (topics.JOINT_STATES, topics.SENSOR_BLOCKS, topics.WRENCH_MEASURED):
        probe.announce(topic)
    predictor = probe.add(ForcePredictor, match=["joint_states=1", "sensor_blocks=1", "wrench/measured=1"])
    assert support.start(predictor)
    start = 10**12
    loads = cutting_loads(op, op.conditions)
    force = 1.2 * loads.force_tool_mean
    channels = tuple(Channel(f"force_{axis}", "force", "N", "dynamometer") for axis in "xyz")
    for k in range(60):
        stamp = start + k * 20_000_000
        samples = np.tile(force, (20, 1)).astype(np.float32)
        probe.publish(topics.SENSOR_BLOCKS, block_to_message(
            SensorBlock(stamp, "dyno", 1, 20 * k, 1000.0, channels, samples), ros_types()))
        for j in range(10):
            probe.publish(topics.WRENCH_MEASURED, wrench_to_message(
                1.2 * loads.force_machine_mean, np.zeros(3), stamp + j * 2_000_000, "machine", ros_types()))
        probe.publish(topics.JOINT_STATES, axes_to_message(axis_state_at(op, k * 0.02, stamp), ros_types()))
    heard = probe.heard["force_scale"]
    assert probe.until(lambda: len(heard) == 10)
    found = {source: [m for m in heard if m.source == source] for source in {m.source for m in heard}}
    assert set(found) == {"dyno: force_x, force_y, force_z", "wrench/measured"}
    for messages in found.values():
        assert [m.reason != "" for m in messages] == [True, True, False, False, False]
        assert messages[-1].scale == pytest.approx(1.2, rel=1e-6)
        assert messages[-1].lower <= 1.2 + 1e-6
        assert messages[-1].operation_hash == op.sha256
        np.testing.assert_allclose(messages[-1].measured, 1.2 * np.array(messages[-1].predicted), rtol=1e-5)
    assert {m.header.frame_id for m in found["wrench/measured"]} == {"machine"}


def test_the_stability_monitor_draws_lobes_again_where_the_workpiece_turns_faster(probe: Probe) -> None:
    """In a process of its own; an unchanged cut asks for none."""
    op = operation("thesis_table_4_9")
    publish_operation(probe, op)
    probe.listen(topics.STABILITY_LOBES)
    probe.announce(topics.JOINT_STATES)
    monitor = probe.add(StabilityMonitor, lobe_points=2, match=["joint_states=1", "stability_lobes=1"])
    assert support.start(monitor)
    heard, state = probe.heard["stability_lobes"], axis_state_at(op, 1.0, 0)

    def feed(factor: float, drawn: int, start: int) -> bool:
        velocity = (*state.velocity[:2], factor * state.velocity[2], 0.0, factor * state.velocity[4], state.velocity[5])
        for k in range(300):
            moved = replace(state, stamp_ns=start + k * 100_000_000, velocity=velocity)
            probe.publish(topics.JOINT_STATES, axes_to_message(moved, ros_types()))
            if probe.until(lambda: len(heard) >= drawn, 0.1):
                return True
        return False

    assert feed(1.0, 1, 10**9)
    assert feed(3.5, 2, 10**11)
    assert probe.until(lambda: probe.value("stability_monitor", "diagram_in_work") == "False")
    assert heard[1].workpiece_speed == pytest.approx(3.5 * op.conditions.workpiece_speed)
    assert (len(heard[0].tool_speeds), len(heard[0].depths)) == (2, 32)


def test_the_stability_monitor_answers_and_repeats_an_unchanged_cut_cheaply(probe: Probe) -> None:
    op = operation("milling_benchmark_1dof")
    publish_operation(probe, op)
    probe.listen(topics.STABILITY_MARGIN)
    probe.announce(topics.JOINT_STATES)
    monitor = probe.add(StabilityMonitor, every_change=True, lobe_points=0,
                        match=["joint_states=1", "stability_margin=1"])
    assert support.start(monitor)
    state = axis_state_at(op, 1.0, 0)
    for k in range(1, 250):
        probe.publish(topics.JOINT_STATES, axes_to_message(replace(state, stamp_ns=k * 4_000_000), ros_types()))
    heard = probe.heard["stability_margin"]
    assert probe.until(lambda: len(heard) == 10)
    found = [margin_from_message(m) for m in heard]
    cut = conditions_from_axes(op, state)
    margin = stability_margin(op, cut)
    assert all(f["spectral_radius"] == pytest.approx(margin.spectral_radius, rel=1e-9) for f in found)
    assert {f["predicted_type"] for f in found} == {margin.predicted_type}
    assert [f["stamp_ns"] for f in found] == [k * 100_000_000 + 4_000_000 for k in range(10)]
    assert found[-1]["depth_limit"] == pytest.approx(margin.depth_limit)
    assert found[-1]["depth_ratio"] == pytest.approx(cut.depth / margin.depth_limit)
    assert probe.until(lambda: probe.value("stability_monitor", "cuts_evaluated") == "1")
    nan = math.nan
    answer = ask(probe, GetStability, "get_stability",
                 GetStability.Request(tool_speed=nan, workpiece_speed=nan, depth=2 * margin.depth_limit))
    assert answer.success
    assert answer.margin.spectral_radius > 1
    assert answer.margin.operation_hash == op.sha256
    bad = ask(probe, GetStability, "get_stability",
              GetStability.Request(tool_speed=-1.0, workpiece_speed=nan, depth=nan))
    assert not bad.success
    assert "tool speed" in bad.message


def test_the_chatter_monitor_counts_gaps_and_judges_up_to_the_end(probe: Probe) -> None:
    op = operation()
    publish_operation(probe, op)
    probe.listen(topics.CHATTER_STATE)
    probe.announce(topics.SENSOR_BLOCKS)
    monitor = probe.add(ChatterMonitor, axes="none", prior="none", hop=0.04,
                        match=["sensor_blocks=1", "chatter_state=1"])
    assert support.start(monitor)
    for k in (*range(40), *range(45, 90)):
        probe.publish(topics.SENSOR_BLOCKS, block_to_message(block(k), ros_types()))
    assert probe.until(lambda: probe.value("chatter_monitor", "received_blocks") == "85")
    assert probe.value("chatter_monitor", "received_gaps") == "1"
    assert probe.value("chatter_monitor", "received_missing_samples") == "640"
    assert any(s.level == DiagnosticStatus.WARN and "breaks" in s.message for s in probe.statuses("chatter_monitor"))
    monitor.trigger_deactivate()
    heard = probe.heard["chatter_state"]
    probe.until(lambda: len(heard) >= 40, 5.0)
    ends = [m.last_sample + 1 for m in heard]
    assert ends == [k * 256 for k in range(1, 46) if not 5120 < k * 256 <= 5760]
    assert any("missing" in m.reason for m in heard)
    assert {m.operation_hash for m in heard} == {op.sha256}


@pytest.mark.parametrize(("name", "volts"), [("thesis_table_4_9", False), ("demo_sensors", True)])
def test_the_process_simulator_makes_the_blocks_of_the_core_and_says_when_it_is_late(
        probe: Probe, name: str, volts: bool) -> None:
    from turnmill_core.process.simulation import SimulationConfig, simulate

    op = operation(name)
    publish_operation(probe, op)
    probe.listen(topics.SENSOR_BLOCKS)
    probe.announce(topics.JOINT_STATES)
    simulator = probe.add(ProcessSimulator, sample_rate=6400, channels=["sound", "tool_x"], volts=volts,
                          seed=3, match=["joint_states=1", "sensor_blocks=1"])
    assert support.start(simulator)
    start = probe.get_clock().now().nanoseconds - 5_000_000_000
    states = [axis_state_at(op, k * 0.004, start + k * 4_000_000) for k in range(60)]
    for state in states:
        probe.publish(topics.JOINT_STATES, axes_to_message(state, ros_types()))
    heard = probe.heard["sensor_blocks"]
    assert probe.until(lambda: len(heard) >= 8)
    config = SimulationConfig(sample_rate=6400, start_ns=start, volts=volts)
    expected = [b for chunk in simulate(op, config, 3, duration=0.16) for b in chunk.blocks]
    for one, message in zip(expected, heard, strict=False):
        found = block_from_message(message)
        assert (found.stamp_ns, found.first_sample) == (one.stamp_ns, one.first_sample)
        assert {c.unit for c in found.channels} == ({"V"} if volts else {"Pa", "m"})
        np.testing.assert_array_equal(found.samples, one.samples)
    assert probe.until(lambda: any(s.level == DiagnosticStatus.WARN and "behind" in s.message
                                   for s in probe.statuses("process_simulator")))


def test_the_player_plays_inputs_only_again_and_again_with_its_clock(probe: Probe, tmp_path: Path) -> None:
    path = write(tmp_path / "in.mcap", [block(k) for k in range(20)])
    for topic in (topics.SENSOR_BLOCKS, topics.JOINT_STATES, topics.OPERATION, topics.CLOCK):
        probe.listen(topic)
    player = probe.add(Player, bag=str(path), rate=4.0, loop=True,
                       match=["sensor_blocks=1", "joint_states=1", "operation=1"])
    assert support.start(player)
    heard = probe.heard["sensor_blocks"]
    assert probe.until(lambda: len(heard) >= 50)
    player.trigger_deactivate()
    blocks = [block_from_message(m) for m in heard]
    assert [b.first_sample for b in blocks[:41]] == [k * 128 for k in (*range(20), *range(20), 0)]
    assert [b.stream_id for b in blocks[:41]] == [1] * 20 + [2] * 20 + [3]
    stamps = [b.stamp_ns for b in blocks]
    assert stamps == sorted(stamps)
    assert blocks[20].stamp_ns - blocks[19].stamp_ns < 100_000_000
    clock = [time_from_message(m.clock) for m in probe.heard["/clock"]]
    assert clock == sorted(clock)
    assert len(clock) > 3
    assert len(probe.heard["operation"]) == 3


def test_an_operation_that_only_the_metadata_hold_is_published(probe: Probe, tmp_path: Path) -> None:
    path = write(tmp_path / "in.mcap", [block(k) for k in range(3)], with_operation=False)
    probe.listen(topics.OPERATION)
    player = probe.add(Player, bag=str(path))
    player.trigger_configure()
    heard = probe.heard["operation"]
    assert probe.until(lambda: len(heard) == 1)
    assert heard[0].sha256 == bag_info(path).metadata["operation"]["sha256"]


def test_a_recording_that_cannot_be_played_is_refused(probe: Probe, tmp_path: Path) -> None:
    (tmp_path / "bad.mcap").write_bytes(b"no recording")
    player = probe.add(Player, bag=str(tmp_path / "bad.mcap"))
    assert not support.start(player)
    assert probe.until(lambda: any(s.level == DiagnosticStatus.ERROR and "bad.mcap" in s.message
                                   for s in probe.statuses("player")))


def test_an_axis_state_without_an_axis_is_no_reason_to_stop(probe: Probe) -> None:
    op = operation()
    publish_operation(probe, op)
    probe.listen(topics.CUTTING_LOADS)
    probe.announce(topics.JOINT_STATES)
    predictor = probe.add(ForcePredictor, match=["joint_states=1", "cutting_loads=1"])
    assert support.start(predictor)
    message = axes_to_message(AxisState(10**9, (0.0,) * 6, (0.0,) * 6), ros_types())
    message.name = ["x", "y", "z"]
    probe.publish(topics.JOINT_STATES, message)
    assert probe.until(lambda: any(s.level == DiagnosticStatus.WARN and "joint" in s.message
                                   for s in probe.statuses("force_predictor")))
    probe.publish(topics.JOINT_STATES, axes_to_message(axis_state_at(op, 0.0, 2 * 10**9), ros_types()))
    assert probe.until(lambda: len(probe.heard["cutting_loads"]) == 1)
