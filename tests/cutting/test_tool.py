"""Tool: lag, offsets, edge length, predecessors, bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest

from turnmill_core.cutting.tool import edge_elements, lag_angle, predecessors, tooth_angles, tooth_offsets
from turnmill_core.operation import Tool


def test_edge_length_is_the_length_of_the_helix() -> None:
    tool = Tool("t", 0.016, 2, math.radians(25))
    edges = edge_elements(tool, 0.012, 40)
    z = np.linspace(0, 0.012, 20001)
    psi = lag_angle(tool, z)
    curve = np.stack([tool.radius * np.cos(psi), tool.radius * np.sin(psi), z], axis=1)
    length = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
    assert edges.length.sum(axis=1) == pytest.approx([length, length], rel=1e-8)
    assert edges.width.sum() == pytest.approx(0.012, rel=1e-12)
    assert edges.height[0] == pytest.approx(0.012 / 80)


def test_one_lead_of_the_helix_is_one_turn_of_lag() -> None:
    tool = Tool("t", 0.02, 3, math.radians(30))
    lead = math.pi * tool.diameter / math.tan(tool.helix_angle)
    assert lag_angle(tool, np.array([lead]))[0] == pytest.approx(2 * math.pi)


def test_tooth_angles_stand_ahead_by_the_pitches_and_behind_by_the_lag() -> None:
    tool = Tool("t", 0.02, 3, math.radians(30), pitch_angles=(2.0, 2.2, 2 * math.pi - 4.2))
    angles = tooth_angles(tool, np.array([0.5]), np.array([0.0, 0.01]))
    assert angles[0, :, 0] == pytest.approx([0.5, 2.5, 4.7])
    assert angles[0, :, 0] - angles[0, :, 1] == pytest.approx(np.full(3, 0.01 * math.tan(math.radians(30)) / 0.01))
    assert tooth_offsets(tool) == pytest.approx([0.0, 2.0, 4.2])


def test_predecessors_without_runout_are_the_teeth_just_ahead() -> None:
    tool = Tool("t", 0.02, 3, pitch_angles=(2.0, 2.2, 2 * math.pi - 4.2))
    angle, step = predecessors(tool, edge_elements(tool, 0.01, 5))
    assert angle.shape == (5, 3, 1)
    assert angle[3, :, 0] == pytest.approx(tool.pitch)
    assert np.all(step == 0)


def test_predecessors_with_runout_end_with_the_tooth_itself() -> None:
    tool = Tool("t", 0.02, 3, pitch_angles=(2.0, 2.2, 2 * math.pi - 4.2), runout=(0.0, 5e-6, -3e-6))
    angle, step = (a[0] for a in predecessors(tool, edge_elements(tool, 0.01, 5)))
    assert angle[:, -1] == pytest.approx(np.full(3, 2 * math.pi))
    assert step == pytest.approx(np.array([[-5e-6, 3e-6, 0], [8e-6, 5e-6, 0], [-3e-6, -8e-6, 0]]))
    assert angle[1] == pytest.approx([2.2, 2 * math.pi - 2.0, 2 * math.pi])


def test_values_are_read_only() -> None:
    edges = edge_elements(Tool("t", 0.02, 2), 0.001)
    with pytest.raises(ValueError, match="read-only"):
        edges.height[0] = 1.0


@pytest.mark.parametrize(("depth", "elements", "message"), [
    (0.0, 10, "depth is 0.0 m"), (0.05, 10, "depth is 0.05 m.*flute length"), (0.001, 0, "elements is 0")])
def test_bad_input_names_the_field(depth: float, elements: int, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        edge_elements(Tool("t", 0.02, 2, flute_length=0.03), depth, elements)
