"""What the simulation describes beyond the closed form: general engagement, process damping, all kinds of modes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.process.cases import ALUMINIUM, RPM, exact_config, milling, samples, turn_milling
from tests.process.test_linear import made, nonlinear
from tests.process.test_rigid import EDGES, VERY_STIFF
from turnmill_core.cutting.engagement import Engagement, engagement
from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import conditions_from_axes
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.operation import Mode, Operation, Shape, Structure
from turnmill_core.operation_stability import ProcessDamping
from turnmill_core.operation_structure import CrossMode
from turnmill_core.process.engagement_path import along_path
from turnmill_core.process.periodic_orbit import periodic_orbit
from turnmill_core.process.simulation import initial, simulate, step

X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
CHANNELS = ("force_x", "force_y", "force_z", "tool_torque", "workpiece_torque")
BASE = milling((Mode(600.0, 0.05, 1.0, X), Mode(900.0, 0.05, 1.0, Y)), speed=3000 * RPM, depth=5e-4, teeth=3,
               span=(-3e-3, 3e-3), material=ALUMINIUM)


def test_arcs_of_the_closed_form_give_its_forces() -> None:
    """A bar with helix: engagement handed in by height, against the kernel's own."""
    op = turn_milling(VERY_STIFF, material=EDGES, depth=2e-3, helix_angle=math.radians(25))

    def arcs(axes: AxisState) -> Engagement:
        return engagement(op, conditions_from_axes(op, axes), np.linspace(0.0, 2e-3, 81))

    config = exact_config(90_000, CHANNELS, slices=48)
    closed, general = (samples(list(simulate(op, config, 0, duration=0.06, engagement_at=given)))[-1800:]
                       for given in (None, arcs))
    size = np.abs(closed).max(axis=0)
    np.testing.assert_allclose(general.mean(axis=0), closed.mean(axis=0), rtol=2e-3)
    assert np.all(np.sqrt(np.mean((general - closed) ** 2, axis=0)) < 1e-2 * size)


def test_tool_runs_into_a_block() -> None:
    """Along a real path the first chips are small: the tool's leading edge reaches the block before its axis does."""
    op = milling(VERY_STIFF, depth=1e-3, material=ALUMINIUM, feed=2e-4)
    op = replace(op, workpiece=replace(op.workpiece, length=0.05))

    def outside(time: float, stamp_ns: int) -> AxisState:
        state = axis_state_at(op, time, stamp_ns)
        return replace(state, position=(state.position[0] - 6e-3, *state.position[1:]))

    config = exact_config(50_000, CHANNELS, axes_rate=50.0, block_duration=0.02)
    found = samples(list(simulate(op, config, 0, outside, 0.36, along_path(op, elements=4))))
    peaks = np.abs(found[:, 1]).reshape(-1, 1000).max(axis=1)
    assert peaks[0] == 0  # 6 mm before the edge, a tool of 5 mm radius is in the air
    assert np.count_nonzero(peaks == 0) <= 3
    full = samples(list(simulate(op, config, 0, duration=0.06)))
    assert peaks[-1] == pytest.approx(np.abs(full[1000:, 1]).max(), rel=0.02)
    assert 0.1 < np.abs(found[5000:6000, 0]).mean() / np.abs(found[-1000:, 0]).mean() < 0.9


def test_an_eccentric_tool_cuts_as_the_cutting_room_says() -> None:
    """Mean force of the simulation against the rigid cut with the numeric engagement."""
    op = replace(turn_milling(VERY_STIFF, material=ALUMINIUM, depth=2e-3), eccentricity=3e-3)
    found = samples(list(simulate(op, exact_config(90_000, CHANNELS), 0, duration=0.12)))[-1800:]
    loads = cutting_loads(op, op.conditions)
    size = np.abs(loads.force_tool_mean).max()
    assert found[:, :3].mean(axis=0) == pytest.approx(loads.force_tool_mean, abs=0.005 * size)
    assert found[:, 3].mean() == pytest.approx(loads.tool_torque_mean, rel=0.005)
    centred = cutting_loads(replace(op, eccentricity=0.0), op.conditions)
    assert abs(centred.force_tool_mean[0] / loads.force_tool_mean[0] - 1) > 0.05  # it makes a difference


def test_loads_of_both_spindles() -> None:
    """Torques of the simulation are those of the cutting room's rigid cut."""
    from turnmill_core.cutting.forces import revolution

    op = turn_milling(VERY_STIFF, material=EDGES, depth=2e-3)
    found = samples(list(simulate(op, exact_config(90_000, CHANNELS), 0, duration=0.12)))[-1800:]
    expected = revolution(op, op.conditions, 1800, 128, average=True)
    assert found[:, 3].mean() == pytest.approx(expected.tool_torque.mean(), rel=5e-3)
    assert found[:, 4].mean() == pytest.approx(expected.workpiece_torque.mean(), rel=5e-3)


def steady(op: Operation) -> tuple[np.ndarray, np.ndarray]:
    """Tool displacement over the last of 30 revolutions: nonlinear, and the periodic orbit."""
    orbit = periodic_orbit(made(op, 1200))
    return nonlinear(op, 3 * 1200 * 50, 30, 29), orbit.tool


SLOW = replace(BASE, process_damping=ProcessDamping(2e13, 1e-4, 0.3))
CROSS = replace(BASE, tool=replace(BASE.tool, structure=replace(
    BASE.tool.structure, cross_modes=(CrossMode(800.0, 0.04, 4.0, "xy"),), cross_reading="symmetric")))
COMPLEX = replace(BASE, tool=replace(BASE.tool, structure=Structure((
    Mode(600.0, 0.05, 1.0, X, phase=0.2), Mode(680.0, 0.05, 1.0, X, phase=-0.2), Mode(900.0, 0.05, 1.0, Y)))))


@pytest.mark.parametrize("op", [SLOW, CROSS, COMPLEX], ids=["process damping", "cross mode", "complex"])
def test_nonlinear_and_linear_agree(op: Operation) -> None:
    found, expected = steady(op)
    size = np.abs(expected).max()
    plain = periodic_orbit(made(BASE, 1200)).tool
    assert np.abs(expected - plain).max() > 0.01 * size  # it makes a difference
    assert np.abs(found - expected).max() < 2e-3 * size


def test_what_the_simulation_does_not_describe() -> None:
    config = exact_config()
    ball = replace(BASE, tool=replace(BASE.tool, shape=Shape(corner_radius=5e-3)))
    turning = replace(BASE, tool=replace(BASE.tool, structure=replace(BASE.tool.structure, frame="rotating")))
    for op, what in ((ball, "tool shape"), (turning, "frame")):
        with pytest.raises(ValueError, match=what):
            initial(op, config, 0)
    bar = turn_milling((Mode(600.0, 0.05, 1.0, X),))
    first = axis_state_at(bar, 0.0, 0)
    given = engagement(bar, conditions_from_axes(bar, first), np.linspace(0.0, 2e-3, 5))
    state, _ = step(config, initial(bar, config, 0), [first], [given])
    with pytest.raises(ValueError, match="engagements"):
        step(config, state, [axis_state_at(bar, 0.01, 10_000_000)])
