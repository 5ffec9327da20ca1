"""Loads: fields of the message, no cut, frames, balances."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest

from tests.cutting.cases import AL6061, MM, milling, table_31, turn_milling
from turnmill_core.cutting.loads import CuttingLoads, cutting_loads
from turnmill_core.machine.conditions import machine_from_tool
from turnmill_core.operation import Tool

MESSAGE = Path(__file__).parents[2] / "msg_schemas/turnmill_msgs/msg/CuttingLoads.msg"


def test_has_every_field_of_the_message() -> None:
    names = re.findall(r"^(?:float64|bool|string|geometry_msgs/\w+) (\w+)", MESSAGE.read_text(), re.MULTILINE)
    fields = [f.name for f in dataclasses.fields(CuttingLoads)]
    assert fields[: len(names)] == names


@pytest.mark.parametrize("change", [
    {"depth": -0.002}, {"depth": 0.0}, {"tool_speed": 0.0}, {"cross_feed_span": (0.008, 0.008)},
    {"feed_speed": 0.0, "workpiece_speed": 0.0}])
def test_no_cut_is_zero_and_no_error(change: dict[str, object]) -> None:
    op = table_31()
    loads = cutting_loads(op, dataclasses.replace(op.conditions, **change))
    assert loads.in_cut is False
    for field in dataclasses.fields(loads):
        value = getattr(loads, field.name)
        if field.name not in ("cutting_speed", "tooth_passing_frequency", "operation_hash", "angle", "engagement"):
            assert np.all(np.asarray(value) == 0), field.name
    assert loads.force_tool.shape == (360, 3)


def test_frames_and_peaks() -> None:
    op = table_31()
    loads = cutting_loads(op, op.conditions)
    rotation = machine_from_tool(op, op.conditions)
    assert loads.force_machine_mean == pytest.approx(rotation @ loads.force_tool_mean)
    assert loads.force_machine_peak == pytest.approx(rotation @ loads.force_tool_peak)
    assert loads.force_machine_peak[1] == pytest.approx(-loads.force_tool_peak[0])  # x_T = -y_M
    assert loads.force_tool_peak[0] == pytest.approx(loads.force_tool[:, 0].min(), rel=0.01)
    assert loads.force_tool_peak[0] <= loads.force_tool[:, 0].min() < 0
    assert loads.tool_torque_peak == pytest.approx(loads.tool_torque.max(), rel=0.01)
    assert loads.force_tool_mean == pytest.approx(loads.force_tool.mean(axis=0), abs=0.2)
    assert loads.tool_torque_mean == pytest.approx(loads.tool_torque.mean(), rel=0.01)
    assert loads.in_cut
    assert loads.operation_hash == op.sha256


def test_scalars() -> None:
    op = table_31()
    loads = cutting_loads(op, op.conditions)
    assert loads.cutting_speed == pytest.approx(math.pi * 16 * MM * 500 / 60)
    assert loads.tooth_passing_frequency == pytest.approx(2 * 500 / 60)
    assert loads.material_removal_rate == pytest.approx(2 / 60 * 2e-3 * 1e-3 * math.pi * 104e-3)
    assert loads.tool_power_mean == pytest.approx(loads.tool_torque_mean * op.conditions.tool_speed)
    assert loads.workpiece_power_mean == pytest.approx(loads.workpiece_torque_mean * op.conditions.workpiece_speed)
    assert loads.workpiece_torque_peak > loads.workpiece_torque_mean > 0
    assert 0.13 < loads.bottom_share < 0.15


def test_workpiece_torque_is_force_times_effective_radius() -> None:
    """Eq. 3.53, to the small moment of the axial force."""
    op = table_31()
    loads = cutting_loads(op, op.conditions)
    expected = -loads.force_tool[:, 0] * 52e-3
    assert loads.workpiece_torque == pytest.approx(expected, abs=0.03 * loads.workpiece_torque_peak)


def test_specific_cutting_power_is_the_tangential_coefficient() -> None:
    """Without edge forces the tool's power over the volume it removes with its side is K_tc."""
    sharp = dataclasses.replace(AL6061, Kte=0.0, Kre=0.0, Kae=0.0)
    op = milling(Tool("t", 20 * MM, 4, math.radians(30)), sharp, 2 * MM, 0.1 * MM, (2 * MM, 10 * MM))
    loads = cutting_loads(op, op.conditions)
    assert loads.tool_power_mean / loads.material_removal_rate == pytest.approx(AL6061.Ktc, rel=1e-4)
    bar = turn_milling(Tool("t", 16 * MM, 2), sharp, 105 * MM, 1 * MM, 2 * MM, 500, 2)
    loads = cutting_loads(bar, bar.conditions)
    side = loads.material_removal_rate * (1 - loads.bottom_share)
    assert loads.tool_power_mean / side == pytest.approx(AL6061.Ktc, rel=1e-3)


def test_reversed_workpiece_reverses_the_machine_forces_it_should() -> None:
    tool = Tool("t", 16 * MM, 2, math.radians(25))
    there = turn_milling(tool, AL6061, 105 * MM, 1 * MM, 2 * MM, 500, 2, "up")
    back = turn_milling(tool, AL6061, 105 * MM, 1 * MM, 2 * MM, 500, -2, "up")
    a, b = (cutting_loads(o, o.conditions) for o in (there, back))
    assert b.force_tool == pytest.approx(a.force_tool)
    assert b.force_machine_mean == pytest.approx(a.force_machine_mean * [1, -1, -1])
    assert b.workpiece_power_mean == pytest.approx(a.workpiece_power_mean)


def test_deeper_than_the_flutes_is_an_error() -> None:
    op = table_31()
    with pytest.raises(ValueError, match=r"depth is 0\.04 m.*flute length"):
        cutting_loads(op, dataclasses.replace(op.conditions, depth=0.04, effective_radius=0.0125))
