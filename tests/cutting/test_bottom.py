"""Bottom edges: volume, power, signs, and what they do to the axial force of Table 3.1."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.cutting.cases import AL6061, MM, milling, table_31, turn_milling
from turnmill_core.cutting.bottom import bottom_loads
from turnmill_core.cutting.engagement import bottom_rate
from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.operation import Operation, Tool

SHARP = dataclasses.replace(AL6061, Kte=0.0, Kre=0.0, Kae=0.0)
CASES = [
    table_31(), table_31(pitch_angles=(2.5, 2 * math.pi - 2.5)),
    turn_milling(Tool("t", 20 * MM, 3), AL6061, 50 * MM, 1 * MM, 8 * MM, 3000, 10, "down"),
    turn_milling(Tool("t", 20 * MM, 4), AL6061, 100 * MM, 0.5 * MM, 18 * MM, 3000, -5, "up"),
    turn_milling(Tool("t", 20 * MM, 4), AL6061, 40 * MM, 2 * MM, 20 * MM, 3000, 5, "slot"),
]


@pytest.mark.parametrize("op", CASES)
def test_specific_power_times_the_volume_through_the_bottom(op: Operation) -> None:
    """Without edge forces the bottom edges' power is K_tc times the volume they remove."""
    sharp = dataclasses.replace(op, material=SHARP)
    loads = bottom_loads(sharp, op.conditions, 1440, 40)
    power = loads.tool_torque.mean() * op.conditions.tool_speed
    assert power == pytest.approx(SHARP.Ktc * bottom_rate(op, op.conditions), rel=2e-3)


@pytest.mark.parametrize("op", CASES)
def test_power_of_the_drives_is_the_power_of_the_bottom_edges(op: Operation) -> None:
    """Force times velocity of the edge in the material, piece by piece on a polar grid of the end face."""
    c, tool = op.conditions, op.tool
    loads = bottom_loads(op, c, 1440, 60)
    sense = 1 if sum(c.cross_feed_span) >= 0 else -1
    drives = (c.tool_speed * loads.tool_torque.mean() + abs(c.workpiece_speed) * loads.workpiece_torque.mean()
              - sense * c.feed_speed * loads.force_tool.mean(axis=0)[1])
    lead = op.axial_feed / (2 * math.pi)
    phi = (np.arange(2880) * 2 * math.pi / 2880)[:, None]
    rho = ((np.arange(400) + 0.5) / 400 * tool.radius)[None, :]
    x, y = rho * np.sin(phi), sense * rho * np.cos(phi)
    place = y - lead * np.arctan(x / c.effective_radius) - tool.radius * (
        np.sqrt(1 + lead**2 / (c.effective_radius**2 + x**2)) - 1)
    wall = tool.radius - op.axial_feed if op.axial_feed < 2 * tool.radius else -math.inf
    bar = op.workpiece.radius
    held = (x > 0) & (np.hypot(x, c.effective_radius) < bar) & (place > wall)
    power = 0.0
    for pitch in tool.pitch:
        h = abs(c.workpiece_speed) * x * pitch / c.tool_speed
        ft = held * (op.material.Ktc * h + op.material.Kte) * tool.radius / 400
        fn = held * (op.material.Krc * h + op.material.Kre) * tool.radius / 400
        edge_x = rho * c.tool_speed * np.cos(phi) + abs(c.workpiece_speed) * c.effective_radius
        edge_y = -rho * c.tool_speed * np.sin(phi) + sense * c.feed_speed
        power += float((ft * np.cos(phi) * edge_x - ft * np.sin(phi) * edge_y
                        + fn * abs(c.workpiece_speed) * x).sum() / 2880)
    assert drives == pytest.approx(power, rel=5e-3)


def test_lifts_the_tool_and_resists_both_spindles() -> None:
    loads = bottom_loads(table_31(), table_31().conditions)
    assert loads.force_tool[:, 2].min() == 0
    assert loads.force_tool[:, 2].max() > 0
    assert loads.tool_torque.mean() > 0
    assert loads.workpiece_torque.mean() > 0
    # at the exit of the arc, where the edge is widest in x
    x = 8 * MM * math.sin(math.radians(41.06))
    assert loads.chip_thickness_max == pytest.approx(2 * math.pi / 30 * x * 0.06, rel=0.02)


def test_axial_force_of_table_31_changes_by_more_than_a_third() -> None:
    """The thesis blames a 35 % error of F_z on the bottom and axial runout: the bottom edges are large enough."""
    op = table_31()
    side = cutting_loads(op, op.conditions).force_tool_mean[2]
    bottom = bottom_loads(op, op.conditions, 1440).force_tool[:, 2].mean()
    assert side < 0 < bottom
    assert -bottom / side > 0.35
    with_bottom = cutting_loads(op, op.conditions, bottom=True)
    assert with_bottom.force_tool_mean[2] == pytest.approx(side + bottom, rel=1e-9)
    assert with_bottom.bottom_share == cutting_loads(op, op.conditions).bottom_share


def test_none_in_milling_at_rest_and_without_contact() -> None:
    flat = milling(Tool("t", 20 * MM, 4), AL6061, 2 * MM, 0.1 * MM, (0, 10 * MM))
    bar = table_31()
    for op, c in ((flat, flat.conditions), (bar, dataclasses.replace(bar.conditions, depth=-1e-3)),
                  (bar, dataclasses.replace(bar.conditions, workpiece_speed=0.0))):
        loads = bottom_loads(op, c)
        assert not loads.force_tool.any()
        assert not loads.tool_torque.any()
        assert loads.chip_thickness_max == 0


def test_bad_counts() -> None:
    op = table_31()
    with pytest.raises(ValueError, match="elements is 0"):
        bottom_loads(op, op.conditions, 10, 0)
