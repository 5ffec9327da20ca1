"""Loads along the edges add up to those of the revolution, and lie where they must."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.cutting.cases import AL6061, MM, milling, table_31, table_32
from turnmill_core.cutting.chip import prepare_cut
from turnmill_core.cutting.distribution import distribution
from turnmill_core.cutting.forces import revolution
from turnmill_core.operation import Operation, Shape, Tool

SLOT = milling(Tool("t", 20 * MM, 4, math.radians(30)), AL6061, 5 * MM, 0.1 * MM, (-10 * MM, 10 * MM))
UNEQUAL = milling(
    Tool("t", 20 * MM, 3, math.radians(30), pitch_angles=(2.0, 2.2, 2 * math.pi - 4.2), runout=(0.0, 1e-5, -1e-5)),
    AL6061, 5 * MM, 0.1 * MM, (2 * MM, 10 * MM))


@pytest.mark.parametrize("op", [SLOT, UNEQUAL, table_31(), table_32()], ids=["slot", "unequal", "table 3.1", "3.2"])
@pytest.mark.parametrize("chip", ["static", "exact"])
def test_the_pieces_add_up_to_the_revolution(op: Operation, chip: str) -> None:
    found = distribution(op, op.conditions, 90, 20, chip)  # type: ignore[arg-type]
    whole = revolution(op, op.conditions, 90, 20, chip)  # type: ignore[arg-type]
    assert found is not None
    assert found.force.shape == (90, op.tool.teeth, 20, 3)
    assert found.force.sum(axis=(1, 2)) == pytest.approx(whole.force_tool, abs=1e-9 * np.abs(whole.force_tool).max())
    assert found.tool_torque.sum(axis=(1, 2)) == pytest.approx(whole.tool_torque, abs=1e-12)
    assert found.chip.max() <= whole.chip_thickness_max * (1 + 1e-12)
    assert ((found.chip > 0) | (found.force == 0).all(axis=-1)).all()


def test_each_tooth_does_the_same_a_pitch_later() -> None:
    found = distribution(SLOT, SLOT.conditions, 360, 10)
    assert found is not None
    per_tooth = found.force.sum(axis=2)
    assert per_tooth[:, 1] == pytest.approx(np.roll(per_tooth[:, 0], -90, axis=0), abs=1e-9)


def test_a_straight_edge_in_a_block_is_loaded_evenly() -> None:
    op = milling(Tool("t", 20 * MM, 2), AL6061, 5 * MM, 0.1 * MM, (0.0, 10 * MM))
    found = distribution(op, op.conditions, 72, 8)
    assert found is not None
    assert found.force == pytest.approx(np.repeat(found.force[:, :, :1], 8, axis=2))


def test_the_turning_bar_loads_the_edge_most_at_the_tip() -> None:
    """The cut gets narrower towards the bar's surface (Table 3.1)."""
    op = table_31()
    found = distribution(op, op.conditions, 720, 40)
    assert found is not None
    torque = found.tool_torque.mean(axis=0).sum(axis=0)
    assert torque[0] > 0
    assert (np.diff(torque[30:]) < 0).all()
    arcs = prepare_cut(op, op.conditions, 40).engagement
    assert torque[-1] / torque[0] == pytest.approx(arcs.angle[-1] ** 2 / arcs.angle[0] ** 2, rel=0.5)


def test_a_ball_has_its_loads_along_the_sphere() -> None:
    tool = Tool("ball", 10 * MM, 2, math.radians(20), 20 * MM, shape=Shape(corner_radius=5 * MM))
    op = milling(tool, AL6061, 2 * MM, 0.1 * MM, (0.0, 5 * MM))
    found = distribution(op, op.conditions, 180, 30)
    assert found is not None
    assert found.elements.height.max() < 2 * MM
    assert found.elements.radius.max() == pytest.approx(4 * MM, rel=0.02)
    assert found.chip.max() > 0


def test_nothing_without_contact() -> None:
    op = table_31()
    assert distribution(op, dataclasses.replace(op.conditions, depth=-1 * MM)) is None
