"""Loads along a path: closed form and swept workpiece beside each other, frames, volume, air, refusals."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.cutting.cases import AL6061, MM, RPM, milling, turn_milling
from turnmill_core.cutting.along_path import follow, has_closed_form, loads_along
from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import nominal_axes
from turnmill_core.machine.kinematics import NT3150
from turnmill_core.machine.path_motion import axis_states, path_motion
from turnmill_core.machine.turn_milling_paths import cut_from_operation, orthogonal_path, tangential_path
from turnmill_core.operation import Operation, Shape, Tool, Workpiece

TOOL = Tool("t", 16 * MM, 2, math.radians(25), 60 * MM)


def short_bar(sense: str = "up", tool: Tool = TOOL) -> Operation:
    op = turn_milling(tool, AL6061, 60 * MM, 1 * MM, 3 * MM, 2000, 30, sense)
    return dataclasses.replace(op, workpiece=Workpiece("bar", diameter=60 * MM, length=30 * MM))


def states_of(op: Operation, rate: float = 5.0) -> tuple[AxisState, ...]:
    path = orthogonal_path(cut_from_operation(op))
    return axis_states(path_motion(NT3150, path), path, rate)


@pytest.mark.parametrize("sense", ["up", "down"])
def test_closed_form_and_swept_workpiece_agree_on_a_whole_pass(sense: str) -> None:
    """An orthogonal pass; entry and exit at the bar's end differ by what the end face's corner adds."""
    op = short_bar(sense)
    states = states_of(op)
    closed, swept = (loads_along(op, states, method) for method in ("closed", "swept"))  # type: ignore[arg-type]
    assert (closed.method, swept.method) == ("closed", "swept")
    assert closed.refused == swept.refused == ()
    steady = (closed.time > 4.5) & (closed.time < 11)
    assert steady.sum() > 20
    nominal = cutting_loads(op, op.conditions)
    assert closed.force_tool[steady] == pytest.approx(np.tile(nominal.force_tool_mean, (steady.sum(), 1)), rel=1e-6)
    assert swept.force_tool[steady] == pytest.approx(closed.force_tool[steady], rel=1e-3)
    assert swept.tool_torque[steady] == pytest.approx(closed.tool_torque[steady], rel=1e-3)
    assert swept.bottom_share[steady] == pytest.approx(closed.bottom_share[steady], abs=0.01)
    assert not closed.in_cut[0]
    assert not swept.in_cut[0]


def test_a_plunge_into_the_whole_bar_is_a_wider_cut() -> None:
    """Down-milling begins at the chuck in full material, which only the swept workpiece knows."""
    op = short_bar("down")
    states = [axes for axes in states_of(op) if 2.0 < axes.stamp_ns * 1e-9 < 7.0]
    closed, swept = (loads_along(op, states, method) for method in ("closed", "swept"))  # type: ignore[arg-type]
    assert swept.removal_rate[3] > 3 * closed.removal_rate[3]
    assert swept.removal_rate[-1] == pytest.approx(closed.removal_rate[-1], rel=0.01)


def test_frames_and_powers_belong_together() -> None:
    op = short_bar()
    states = states_of(op)
    found = loads_along(op, states)
    assert found.method == "closed"
    length = np.linalg.norm(found.force_tool, axis=1)
    for forces in (found.force_machine, found.force_workpiece):
        assert np.linalg.norm(forces, axis=1) == pytest.approx(length, abs=1e-9)
    assert found.force_machine[:, 0] == pytest.approx(found.force_tool[:, 2]), "z_T = x_M"
    k = 50
    c = states[k].position[4]
    x, y, z = found.force_machine[k]
    turned = [x * math.cos(c) + y * math.sin(c), y * math.cos(c) - x * math.sin(c), z]
    assert found.force_workpiece[k] == pytest.approx(turned)
    assert found.tool_power == pytest.approx(found.tool_torque * 2000 * RPM)
    assert found.workpiece_power == pytest.approx(found.workpiece_torque * 30 * RPM)


def test_a_path_beside_the_axis_takes_the_swept_workpiece() -> None:
    """Tangential turn-milling has no closed form."""
    op = short_bar()
    path = tangential_path(cut_from_operation(op))
    found = loads_along(op, axis_states(path_motion(NT3150, path), path, 2.0))
    assert found.method == "swept"
    assert found.refused == ()
    assert found.in_cut.any()
    middle = found.force_tool[found.in_cut][5:-5]
    assert (np.linalg.norm(middle, axis=1) > 0).all()
    refused = loads_along(op, axis_states(path_motion(NT3150, path), path, 2.0), "closed")
    assert refused.method == "closed"
    assert "axis y" in refused.refused[0][1]
    assert np.isnan(refused.force_tool[refused.refused[0][0]]).all()


def test_air_gives_zero_loads_and_no_error() -> None:
    op = short_bar()
    above = nominal_axes(op, dataclasses.replace(op.conditions, depth=-1 * MM, effective_radius=31 * MM))
    for method in ("closed", "swept"):
        found = loads_along(op, [above, dataclasses.replace(above, stamp_ns=10**8)], method)  # type: ignore[arg-type]
        assert not found.in_cut.any()
        assert (found.force_tool == 0).all()
        assert (found.tool_power == 0).all()


def test_what_has_a_closed_form() -> None:
    op = short_bar()
    assert has_closed_form(op)
    assert has_closed_form(milling(TOOL, AL6061, 1 * MM, 0.1 * MM, (0.0, 8 * MM)))
    assert not has_closed_form(short_bar(tool=dataclasses.replace(TOOL, shape=Shape(corner_radius=2 * MM))))
    assert not has_closed_form(dataclasses.replace(op, eccentricity=1 * MM))
    assert not has_closed_form(dataclasses.replace(op, tilt=0.1))


def test_state_in_state_out() -> None:
    """Going on from a state gives what the whole path gives, and the state is left as it was."""
    op = short_bar()
    states = states_of(op)[20:30]
    workpiece = None
    loads = []
    for axes in states:
        before = workpiece
        workpiece, found = follow(op, workpiece, axes, "swept")
        again, repeated = follow(op, before, axes, "swept")
        assert repeated.loads.force_tool_mean == pytest.approx(found.loads.force_tool_mean, abs=0)
        assert again is not None
        assert again.poses == workpiece.poses  # type: ignore[union-attr]
        loads.append(found.loads.force_tool_mean)
    assert np.array(loads) == pytest.approx(loads_along(op, states, "swept").force_tool, abs=0)


def test_no_states_no_loads() -> None:
    assert loads_along(short_bar(), []).force_tool.shape == (0, 3)
