"""Feed of the tool, the turning workpiece and the tilting head relative to the material."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from turnmill_core.cutting.cutter import cutter_elements
from turnmill_core.cutting.feed import feed_at, feed_velocity, located_feed, normal_feed, tool_motion
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import machine_from_tool, nominal_axes
from turnmill_core.operation import Operation, Shape

from .cases import AL6061, MM, milling, table_31, turn_milling
from .sweeping import SHAPES, operation

TILTING = AxisState(0, (31 * MM, 4 * MM, -20 * MM, 1.3, 0.4, 0.0), (-2e-3, 1e-3, -3e-3, 0.2, 1.5, 300.0))


def moved(axes: AxisState, time: float) -> AxisState:
    return replace(axes, position=tuple(p + time * v for p, v in zip(axes.position, axes.velocity, strict=True)))


def material_velocity(op: Operation, axes: AxisState, point: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Velocity of the tool at `point` of its frame against the material there, from two positions, machine frame."""
    places = []
    for time in (-step, step):
        a = moved(axes, time)
        b, c = a.position[3:5]
        axis = np.array([math.sin(b), 0.0, math.cos(b)])
        # the tool does not spin here: what is fixed in it tilts with b about y
        first = np.array([math.cos(b), 0.0, -math.sin(b)])
        place = np.asarray(a.position[:3]) - op.workpiece.datum + point @ np.stack([first, [0.0, 1.0, 0.0], axis])
        turn = np.array([[math.cos(c), math.sin(c), 0], [-math.sin(c), math.cos(c), 0], [0, 0, 1.0]])
        places.append(turn @ place)
    c = axes.position[4]
    back = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1.0]])
    return np.asarray(back @ (places[1] - places[0]) / (2 * step))


def test_every_axis_counts_at_every_point_of_the_tool() -> None:
    """Against the path of a point of the tool in the turning workpiece, by differences (Eq. 3.39)."""
    op = operation(Shape())
    motion = tool_motion(op, TILTING)
    b = TILTING.position[3]
    fixed = np.stack([[math.cos(b), 0.0, -math.sin(b)], [0.0, 1.0, 0.0], [math.sin(b), 0.0, math.cos(b)]])
    for point in np.random.default_rng(1).uniform(-0.01, 0.01, (5, 3)):
        there = motion.rotation @ feed_at(motion, motion.rotation.T @ (point @ fixed))
        assert there == pytest.approx(material_velocity(op, TILTING, point), rel=1e-7, abs=1e-9)


def test_the_frame_is_right_handed_with_its_axis_along_the_tool() -> None:
    rotation = tool_motion(operation(Shape()), TILTING).rotation
    assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert rotation[:, 2] == pytest.approx([math.sin(1.3), 0.0, math.cos(1.3)])


@pytest.mark.parametrize("rpm", [2, -2])
@pytest.mark.parametrize("sense", ["up", "down"])
def test_orthogonal_turn_milling_is_the_closed_form(rpm: float, sense: str) -> None:
    op = turn_milling(table_31().tool, AL6061, 105 * MM, 1 * MM, 2 * MM, 500, rpm, sense)
    motion = tool_motion(op, nominal_axes(op))
    assert motion.rotation == pytest.approx(machine_from_tool(op, op.conditions), abs=1e-15)
    height = np.array([0.0, 0.5 * MM, 1 * MM])
    points = np.stack([np.zeros(3), np.zeros(3), height], axis=1)
    assert feed_at(motion, points)[:, :2] == pytest.approx(feed_velocity(op, op.conditions, height), rel=1e-12)


def test_milling_frame_lies_on_the_feed() -> None:
    op = milling(table_31().tool, AL6061, 2 * MM, 0.1 * MM, (-8 * MM, 8 * MM))
    motion = tool_motion(op, AxisState(0, (0.0, 0.01, -2 * MM, 0.0, 0.0, 0.0), (3e-3, 4e-3, 0.0, 0.0, 0.0, 50.0)))
    assert motion.rotation[:, 0] == pytest.approx([0.6, 0.8, 0.0])
    assert motion.velocity == pytest.approx([5e-3, 0.0, 0.0], abs=1e-15)
    still = tool_motion(op, AxisState(0, (0.0,) * 6, (0.0, 0.0, -1e-3, 0.0, 0.0, 50.0)))
    assert still.rotation == pytest.approx(np.eye(3))


@pytest.mark.parametrize("kind", SHAPES)
def test_normal_feed_is_the_feed_on_the_normal(kind: str) -> None:
    op = operation(SHAPES[kind])
    motion = tool_motion(op, TILTING)
    edges = cutter_elements(op.tool, 12 * MM, 20)
    a, b, c = normal_feed(motion, edges).T
    for phi in (0.3, 2.0, 4.4):
        normal = np.stack([edges.sin_kappa * math.sin(phi), edges.sin_kappa * math.cos(phi), -edges.cos_kappa], axis=1)
        place = np.stack([edges.radius * math.sin(phi), edges.radius * math.cos(phi), edges.height], axis=1)
        on_normal = (feed_at(motion, place) * normal).sum(axis=1)
        assert a * math.sin(phi) + b * math.cos(phi) + c == pytest.approx(on_normal, rel=1e-12, abs=1e-15)


def test_cutter_locations_give_the_same_feed_in_the_limit() -> None:
    """Eq. 3.22-3.39 from two locations against the velocities themselves; the difference falls with the step."""
    op = operation(Shape())
    height = np.array([0.0, 3 * MM, 9 * MM])
    motion = tool_motion(op, TILTING)
    exact = feed_at(motion, np.stack([0 * height, 0 * height, height], axis=1)) @ motion.rotation.T
    speed = math.dist(TILTING.velocity[:3], (0, 0, 0))
    errors = []
    for step in (1e-3, 1e-4):
        ends = [moved(TILTING, t).position for t in (0.0, step)]
        tips = [(p[0], p[1], p[2]) for p in ends]
        axes = [(math.sin(p[3]), 0.0, math.cos(p[3])) for p in ends]
        rotation, feed = located_feed((tips[0], tips[1]), (axes[0], axes[1]), speed, TILTING.velocity[4], height)
        assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-12)
        assert abs(feed[0, 1]) < 1e-9  # x_T lies on the tip's own feed (Eq. 3.32)
        errors.append(np.abs(feed @ rotation.T - exact).max())
    assert errors[0] < 2e-4
    assert errors[1] == pytest.approx(errors[0] / 10, rel=0.05)


def test_tilting_head_adds_a_vector_product_of_height() -> None:
    """Erratum M4: omega p x (z axis); half a turn in one step is not lost, as it would be with atan of a ratio."""
    still = (0.03, 0.0, 0.0)
    beside = (0.03, 0.0, -1e-3)
    axes = ((1.0, 0.0, 0.0), (math.cos(2.0), 0.0, math.sin(2.0)))
    rotation, feed = located_feed((still, beside), axes, 1e-3, 0.0, np.array([0.0, 0.01]))
    assert feed[0] @ rotation.T == pytest.approx([0.0, 0.0, -1e-3])
    assert (feed[1] - feed[0]) @ rotation.T == pytest.approx([0.0, 0.0, 2.0 * 0.01])


@pytest.mark.parametrize(("tips", "speed", "message"), [
    (((0.03, 0.0, 0.0), (0.03, 0.0, 0.0)), 1e-3, "distance of the cutter locations is 0.0 m"),
    (((0.03, 0.0, 0.0), (0.03, 0.0, 0.1)), 0.0, "feed speed is 0.0 m/s"),
    (((0.03, 0.0, 0.0), (0.03, 0.0, 0.1)), -1.0, "feed speed is -1.0 m/s"),
    (((0.03, 0.0, 0.0), (0.02, 0.0, 0.0)), 1e-3, "expected one across the tool axis"),
])
def test_locations_without_a_direction_are_refused(
    tips: tuple[tuple[float, float, float], tuple[float, float, float]], speed: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        located_feed(tips, ((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)), speed, 0.0, np.zeros(1))
