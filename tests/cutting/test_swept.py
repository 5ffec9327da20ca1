"""The workpiece in process: what the tool has swept is gone, everything else is there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from turnmill_core.cutting._kernels import sweep
from turnmill_core.cutting.cutter import outer_radius
from turnmill_core.cutting.swept import fresh_workpiece, material_at, poses_at, profile_of, stock_of, swept_by
from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Operation, Shape, Tool, Workpiece

from .cases import AL6061, MM, milling
from .sweeping import BAR, SHAPES, R, endless, inside, operation, state, to_tool


def test_the_kernel_has_the_shape_of_the_tool() -> None:
    rng = np.random.default_rng(2)
    radius, height = rng.uniform(0, 10 * MM, 3000), rng.uniform(-1 * MM, 14 * MM, 3000)
    shapes = (*SHAPES.values(), Shape(corner_radius=1 * MM, tip_angle=0.4, taper_angle=0.2), Shape(taper_angle=-0.1),
              Shape(corner_radius=6 * MM, corner_radial=2 * MM, corner_axial=5.9 * MM),
              Shape(bottom_clearance=0.05, wiper_length=1 * MM))
    for shape in shapes:
        tool = Tool("t", 2 * R, 2, flute_length=12 * MM, shape=shape)
        profile = profile_of(tool, 0.1 * MM)
        held = np.array([sweep.within.py_func(profile, r * r, z) for r, z in zip(radius, height, strict=True)])
        lowest = np.maximum(0.0, (7 * MM - radius) * math.tan(0.05)) if shape.bottom_clearance else 0.0
        expected = (height >= lowest) & (height <= 12 * MM) & (radius <= outer_radius(tool, np.maximum(height, 0.0)))
        assert np.array_equal(held, expected)


@pytest.mark.parametrize("kind", SHAPES)
def test_material_is_what_no_pose_held(kind: str) -> None:
    """Against every pose, one by one, straight from the tool's definition; tilted, eccentric, along a helix."""
    op = operation(SHAPES[kind])
    b, x, y, turns = 1.45, 28.5 * MM, 2 * MM, 1.1
    period = 2 * math.pi / op.conditions.workpiece_speed
    workpiece = swept_by(op, replace(endless(op), last=state(op, x, y, b, 0.0)), state(op, x, y, b, turns * period))
    rng = np.random.default_rng(3)
    angle, radius = rng.uniform(-math.pi, math.pi, 4000), rng.uniform(27.5 * MM, BAR, 4000)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(-12 * MM, 10 * MM, 4000)], axis=1)
    left = material_at(workpiece, points)
    gone = np.zeros(4000, dtype=bool)
    for time in np.linspace(0.0, turns * period, 4000):
        s = state(op, x, y, b, time)
        c = s.position[4]
        turned = points @ np.array([[math.cos(c), math.sin(c), 0], [-math.sin(c), math.cos(c), 0], [0, 0, 1.0]])
        gone |= inside(kind, to_tool(turned, np.asarray(s.position[:3]), b))
    assert 0.1 < gone.mean() < 0.9
    assert np.mean(left == gone) < 5e-4  # those on the surface


def test_undercuts_are_held() -> None:
    """A tilted tool leaves material above the place that it has cut, as seen from the workpiece axis."""
    op = operation(Shape())
    b = math.radians(60)
    workpiece = swept_by(op, replace(endless(op), last=state(op, 23 * MM, 0.0, b, -0.01)), state(op, 23 * MM, 0.0, b))
    axis, across = np.array([math.sin(b), 0, math.cos(b)]), np.array([math.cos(b), 0, -math.sin(b)])
    beside = np.array([23 * MM, 0, 0]) + across * 7.9 * MM + axis * 0.2 * MM  # just inside the flank
    above = beside + np.array([0.5 * MM, 0, 0])
    assert not material_at(workpiece, [beside])[0]
    assert material_at(workpiece, [above])[0]


def test_poses_turn_with_the_workpiece() -> None:
    op = operation(Shape())
    tip_axis = poses_at(op, np.array([0.03, 0.01, -0.02, math.pi / 2, math.pi / 2, 0.0]))[:, 0]
    assert tip_axis == pytest.approx([0.01, -0.03, -0.02, 0.0, -1.0, 0.0], abs=1e-15)


def test_poses_far_from_the_stock_are_not_kept_and_small_moves_wait() -> None:
    op = operation(Shape())
    workpiece = swept_by(op, fresh_workpiece(op), state(op, 40 * MM))
    assert workpiece.poses == 0
    away = swept_by(op, workpiece, state(op, 31 * MM, time=10.0))
    assert away.poses == 0
    tiny = replace(away.last, position=(31 * MM + 1e-6, *away.last.position[1:])) if away.last else None
    assert tiny is not None
    assert swept_by(op, away, tiny) is away
    cut = swept_by(op, away, state(op, 29 * MM, time=10.1, z=-5 * MM))
    assert cut.poses > 0
    assert away.poses == 0  # a value: the one before is as it was


def test_stock_may_be_stepped_curved_or_a_block() -> None:
    profile = ((0.0, 20 * MM), (-50 * MM, 20 * MM), (-50 * MM, 30 * MM), (-150 * MM, 25 * MM))
    bar = Workpiece("bar", diameter=60 * MM, length=150 * MM, profile=profile)
    op = replace(operation(Shape()), workpiece=bar)
    places = ((19, -20), (21, -20), (29, -51), (31, -51), (27.4, -100), (27.6, -100), (10, 1), (10, -151))
    points = [(r * MM, 0.0, z * MM) for r, z in places]
    assert material_at(fresh_workpiece(op), points).tolist() == [True, False, True, False, True, False, False, False]
    block = milling(Tool("t", 16 * MM, 2), AL6061, 2 * MM, 0.1 * MM, (-8 * MM, 8 * MM))
    corners = [(0.1 * MM, 99.9 * MM, -0.1 * MM), (-0.1 * MM, 50 * MM, -1 * MM), (100 * MM, 50 * MM, 0.1 * MM)]
    assert material_at(fresh_workpiece(block), corners).tolist() == [True, False, False]
    assert stock_of(block).box.tolist() == [0.0, 0.2, 0.0, 0.1, -0.05, 0.0]


def bar(**other: object) -> Workpiece:
    return Workpiece("bar", diameter=60 * MM, length=150 * MM, **other)  # type: ignore[arg-type]


@pytest.mark.parametrize(("profile", "message"), [
    (((0.0, 30 * MM),), "at least two points"),
    (((0.0, 30 * MM), (-100 * MM, 30 * MM)), "expected from 0 to -0.15 m"),
    (((0.0, 30 * MM), (-100 * MM, 20 * MM), (-90 * MM, 20 * MM), (-150 * MM, 20 * MM)), "values that do not rise"),
    (((0.0, 20 * MM), (-150 * MM, 25 * MM)), "a largest radius of 0.03 m"),
    (((0.0, 30 * MM), (-150 * MM, 0.0)), "numbers > 0"),
])
def test_stock_that_cannot_be_is_refused(profile: tuple[tuple[float, float], ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        bar(profile=profile)


def test_bad_moves_are_refused() -> None:
    op: Operation = operation(Shape())
    with pytest.raises(ValueError, match="axis positions"):
        swept_by(op, fresh_workpiece(op), AxisState(0, (math.nan, 0, 0, 0, 0, 0), (0.0,) * 6))
    with pytest.raises(ValueError, match=r"spacing is 0\.1 m, expected in \(0, 0\.008\] m"):
        fresh_workpiece(op, 0.1)
    far = replace(fresh_workpiece(op), last=state(op, 29 * MM))
    with pytest.raises(ValueError, match=r"number of tool poses .* a shorter path"):
        swept_by(op, far, state(op, 29 * MM, time=1e6))
