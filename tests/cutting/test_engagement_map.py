"""Numeric engagement: against the closed form, a brute-force point cloud, and the volume it must account for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from turnmill_core.cutting.engagement import engagement
from turnmill_core.cutting.engagement_map import EngagementMap, engage, engagement_along, engagement_map
from turnmill_core.cutting.steady import steady_map
from turnmill_core.cutting.swept import fresh_workpiece
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import lowest_point
from turnmill_core.operation import Operation, Shape, Tool, Workpiece

from .cases import AL6061, MM, milling, table_31, table_32, turn_milling
from .sweeping import BAR, DEPTH, FEED, SHAPES, R, endless, finished_radius, inside, operation, state, steady, to_tool

DEG = math.pi / 180
CUTS = ("straight", "eccentric", "tilted", "tangential")


def pose(op: Operation, cut: str) -> tuple[float, float, float]:
    """x, y of the tip and b of a cut that takes DEPTH off the bar."""
    if cut == "tangential":
        return -12 * MM, BAR - DEPTH + R, math.pi / 2
    b = 80 * DEG if cut == "tilted" else math.pi / 2
    return BAR - DEPTH - lowest_point(op.tool, b - math.pi / 2), 3 * MM if cut == "eccentric" else 0.0, b


@pytest.mark.parametrize("op", [
    table_31(), table_32(), turn_milling(table_31().tool, AL6061, 105 * MM, 1 * MM, 2 * MM, 500, -2, "down"),
    milling(table_31().tool, AL6061, 2 * MM, 0.1 * MM, (-3 * MM, 5 * MM))])
def test_a_cylinder_has_the_arcs_of_the_closed_form(op: Operation) -> None:
    cut = steady_map(op, op.conditions, 40, bottom=0)
    expected = engagement(op, op.conditions, cut.arcs.height)
    within = cut.arcs.height < 0.97 * op.conditions.depth  # the arc ends in a point there
    for found, truth in ((cut.arcs.start, expected.start), (cut.arcs.exit, expected.exit)):
        assert found[within, 0] == pytest.approx(truth[within, 0], abs=0.02 * DEG)


@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("kind", SHAPES)
def test_the_engaged_surface_takes_the_volume_that_disappears(kind: str, cut: str) -> None:
    """Within 0.1 %: the flux through the engaged surface against what the helical motion leaves of the bar."""
    op = operation(SHAPES[kind])
    x, y, b = pose(op, cut)
    workpiece, end = steady(op, x, y, b)
    found = engagement_map(op, workpiece, end, 600, 200).removal
    left = finished_radius(kind, x, y, b, (np.arange(48) + 0.5) / 48 * FEED)
    total = abs(op.conditions.workpiece_speed) / 2 * FEED * np.mean(BAR**2 - left**2)
    assert found.total == pytest.approx(total, rel=1e-3)
    assert (found.bottom > 0) == (kind != "ball" and cut != "tangential")
    # few elements are enough for forces
    assert engagement_map(op, workpiece, end).removal.total == pytest.approx(total, rel=6e-3)


def cloud(kind: str, op: Operation, x: float, y: float, b: float, heights: np.ndarray, seed: int
          ) -> list[tuple[np.ndarray, np.ndarray]]:
    """Angles of points that the tool is about to cut, by height: brute force.

    Points a picometre outside the tool now, which it holds a moment later, and at no time before in one
    and a half workpiece revolutions. In the tool frame of x_T, y_T.
    """
    speed = op.conditions.workpiece_speed
    period = 2 * math.pi / abs(speed)
    rng = np.random.default_rng(seed)
    phi = rng.uniform(0, 2 * math.pi, (len(heights), 2500))
    radius = {"cylinder": np.full_like(heights, R), "ball": np.sqrt(R**2 - np.maximum(R - heights, 0.0) ** 2)}[kind]
    tangent = np.maximum(R - heights, 0.0) / R if kind == "ball" else np.zeros_like(heights)  # cos kappa
    shift = 1e-12
    r = (radius + shift * np.sqrt(1 - tangent**2))[:, None]
    z = (heights - shift * tangent)[:, None] * np.ones_like(phi)
    sense = -math.copysign(1.0, speed)
    axis, across = np.array([math.sin(b), 0, math.cos(b)]), np.array([0.0, sense, 0.0])
    third = np.cross(axis, across)
    now = (r * np.sin(phi))[..., None] * across + (r * np.cos(phi))[..., None] * third + z[..., None] * axis
    now = now + np.array([x, y, 0.0])
    there = (np.hypot(now[..., 0], now[..., 1]) < BAR).ravel()

    def held(points: np.ndarray, time: float) -> np.ndarray:
        s = state(op, x, y, b, time)
        c = s.position[4]
        turn = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1.0]])
        return inside(kind, to_tool(points @ turn.T, np.asarray(s.position[:3]), b))

    points = now.reshape(-1, 3)
    soon = np.zeros(len(points), dtype=bool)
    for time in np.geomspace(1e-6, 1e-3, 40) * MM / (abs(speed) * BAR):
        soon |= held(points, time)
    chosen = np.flatnonzero(there & soon)
    window = 0.4 / abs(speed)
    for middle in (0.0, -period):
        for time in np.arange(middle - window, min(middle + window, 0.0) + 1e-12, 0.05 * MM / (abs(speed) * BAR)):
            if len(chosen):
                chosen = chosen[~held(points[chosen], min(time, 0.0))]
    row = chosen // phi.shape[1]
    return [(np.sort(phi.ravel()[chosen[row == k]]), heights[k]) for k in range(len(heights))]


@pytest.mark.parametrize(("kind", "b", "y"), [("ball", 80.0, 0.0), ("ball", 90.0, 3.0), ("cylinder", 84.0, 0.0)])
def test_arcs_are_those_of_a_swept_point_cloud(kind: str, b: float, y: float) -> None:
    """B tilt and ball tool: start and exit within 0.5 degrees of the points that are being cut."""
    op = operation(SHAPES[kind])
    x = BAR - DEPTH - lowest_point(op.tool, (b - 90) * DEG)
    workpiece, end = steady(op, x, y * MM, b * DEG)
    cut = engagement_map(op, workpiece, end, 60, bottom=0)
    rows = np.flatnonzero(cut.arcs.angle > 5 * DEG)
    rows = rows[1::max(1, len(rows) // 4)]
    assert len(rows) >= 3
    for (angles, _), row in zip(cloud(kind, op, x, y * MM, b * DEG, cut.arcs.height[rows], 5), rows, strict=True):
        start, stop = cut.arcs.start[row], cut.arcs.exit[row]
        arcs = [(s, e) for s, e in zip(start, stop, strict=True) if e > s]
        for s, e in arcs:
            middle = (s + e) / 2
            turned = middle + (angles - middle + math.pi) % (2 * math.pi) - math.pi  # the turn of this arc
            mine = turned[(turned > s - 4 * DEG) & (turned < e + 4 * DEG)]
            assert mine.min() == pytest.approx(s, abs=0.5 * DEG)
            assert mine.max() == pytest.approx(e, abs=0.5 * DEG)
        near = 0.5 * DEG
        covered = sum(((angles - s + near) % (2 * math.pi) < e - s + 2 * near).sum() for s, e in arcs)
        assert covered >= 0.98 * len(angles)


@pytest.mark.parametrize("kind", ["cylinder", "ball"])
def test_the_first_revolution_of_a_plunge_cuts_a_whole_groove(kind: str) -> None:
    """No feed: plunge and one turn of the workpiece remove a groove as wide as the tool, to 0.3 %."""
    op = operation(SHAPES[kind])
    speed = op.conditions.workpiece_speed
    period, plunge = 2 * math.pi / speed, 0.25
    times = np.concatenate([np.linspace(0, plunge, 40), plunge + np.linspace(0, 1.15 * period, 140)[1:]])

    def at(time: float) -> AxisState:
        share = min(time / plunge, 1.0)
        x = BAR + 0.1 * MM - share * (DEPTH + 0.1 * MM)
        rate = -(DEPTH + 0.1 * MM) / plunge if time < plunge else 0.0
        return AxisState(round(time * 1e9), (x, 0.0, 0.0, math.pi / 2, speed * time, 0.0),
                         (rate, 0.0, 0.0, 0.0, speed, 300.0))

    cuts = list(engagement_along(op, map(at, times.tolist()), endless(op, R / 10), elements=70, bottom=30))
    rates = np.array([c.removal.total for c in cuts])
    removed = np.trapezoid(rates, times)
    u = np.linspace(-R, R, 20001)
    left = np.minimum(BAR, BAR - DEPTH + (R - np.sqrt(R**2 - u**2) if kind == "ball" else 0 * u))
    assert removed == pytest.approx(np.trapezoid(math.pi * (BAR**2 - left**2), u), rel=3e-3)
    assert cuts[-1].removal.total == pytest.approx(0.0, abs=1e-3 * rates.max())  # nothing is left on the second turn
    if kind == "cylinder":
        plunging = cuts[25].removal
        assert plunging.bottom > plunging.side
        after = cuts[60]  # both sides of the tool, as wide as the bar is at its tip
        half = math.asin(math.sqrt(BAR**2 - (BAR - DEPTH + after.arcs.height[-30]) ** 2) / R)
        assert after.arcs.angle[-30] == pytest.approx(2 * half, abs=0.01)


def test_feed_beyond_the_radius_leaves_two_arcs() -> None:
    """The wall of the revolution before lies behind the tool axis: two arcs where the bar is narrower than the tool."""
    wide = turn_milling(Tool("t", 20 * MM, 2), AL6061, 40 * MM, 1.5 * MM, 19 * MM, 3000, 10)
    cut = steady_map(wide, wide.conditions, 40, 0)
    two = cut.arcs.exit[:, 1] > cut.arcs.start[:, 1]
    assert two.any()
    speed = wide.conditions.workpiece_speed
    total = abs(speed) / 2 * 19 * MM * (20**2 - 18.5**2) * MM**2
    fine = steady_map(wide, wide.conditions, 300, 200)
    assert fine.removal.total == pytest.approx(total, rel=1e-3)


def test_stepped_stock_is_met_at_its_shoulder() -> None:
    """On the thinner end there is no contact; at the shoulder the tool meets the step as deep as it is."""
    profile = ((0.0, 26 * MM), (-60 * MM, 26 * MM), (-60 * MM, BAR), (-200 * MM, BAR))
    op = replace(operation(Shape()), workpiece=Workpiece("bar", diameter=2 * BAR, length=0.2, profile=profile))
    workpiece = fresh_workpiece(op)
    workpiece, before = engage(op, workpiece, state(op, 27 * MM, z=-40 * MM))
    workpiece, at = engage(op, workpiece, state(op, 27 * MM, z=-40 * MM, time=45.0))  # 15 mm further
    assert not before.in_cut
    assert at.in_cut
    assert at.arcs.height[at.arcs.angle > 0].max() == pytest.approx(3 * MM, abs=0.1 * MM)
    cone = Workpiece("bar", diameter=2 * BAR, length=0.2, profile=((0.0, 20 * MM), (-0.2, BAR)))
    curved = replace(op, workpiece=cone)
    cut = engagement_map(curved, fresh_workpiece(curved), state(op, 27 * MM, z=-0.15))
    deepest = 20 + 10 * 158 / 200 - 27  # mm, at the tool's edge towards the thicker end
    assert cut.arcs.height[cut.arcs.angle > 0].max() == pytest.approx(deepest * MM, abs=0.15 * MM)


def assert_no_cut(cut: EngagementMap) -> None:
    assert not cut.in_cut
    assert cut.removal.total == 0
    assert not cut.arcs.angle.any()


def test_a_tool_that_touches_nothing_has_an_empty_map() -> None:
    op = operation(SHAPES["ball"])
    for x, y, b in ((35 * MM, 0.0, 90.0), (29 * MM, 80 * MM, 90.0), (36 * MM, 0.0, 60.0)):
        workpiece, end = steady(op, x, y, b * DEG)
        assert_no_cut(engagement_map(op, workpiece, end))
    still = AxisState(0, (29 * MM, 0, 0, math.pi / 2, 0, 0), (0.0, 0, 0, 0, 0, 300.0))
    assert_no_cut(engagement_map(op, fresh_workpiece(op), still))


def test_going_back_the_way_it_came_cuts_nothing() -> None:
    """Negative feed in milling: over the floor that is already cut."""
    op = milling(Tool("t", 16 * MM, 2, flute_length=30 * MM, shape=SHAPES["bull nose"]), AL6061, 2 * MM, 0.1 * MM,
                 (-8 * MM, 8 * MM))
    workpiece, there, back = fresh_workpiece(op), (0.02, 0.0, 0.0), (-0.02, 0.0, 0.0)
    for x in (-20, 10, 40):
        axes = AxisState(0, (x * MM, 50 * MM, -2 * MM, 0, 0, 0), (*there, 0, 0, 300.0))
        workpiece, cut = engage(op, workpiece, axes)
    assert cut.removal.total == pytest.approx(0.02 * (16 * 2 - (2 - math.pi / 2) * 2**2 + 0) * MM**2, rel=0.2)
    axes = AxisState(1, (20 * MM, 50 * MM, -2 * MM, 0, 0, 0), (*back, 0, 0, 300.0))
    workpiece, cut = engage(op, workpiece, axes)
    assert_no_cut(cut)


@pytest.mark.parametrize(("tool", "position", "velocity", "message"), [
    (Tool("t", 16 * MM, 2, flute_length=1 * MM), (27 * MM, 0, 0), (0, 0, 0, 0, 1.0, 300.0), "above its flutes"),
    (Tool("t", 16 * MM, 2), (29 * MM, 0, 0), (0, 0, 0, 0, 1.0, -300.0), "tool spindle speed"),
    (Tool("t", 16 * MM, 2), (29 * MM, 0, 0), (0, 0, 0, 0, math.inf, 300.0), "axis velocities"),
    (Tool("t", 16 * MM, 2, shape=Shape(taper_angle=0.1)), (29 * MM, 0, 0), (0, 0, 0, 0, 1.0, 300.0),
     "expected a finite length of a tapered tool"),
])
def test_what_is_not_described_is_refused(
    tool: Tool, position: tuple[float, float, float], velocity: tuple[float, ...], message: str
) -> None:
    op = turn_milling(tool, AL6061, 2 * BAR, 0.5 * MM, FEED, 3000, 10)
    axes = AxisState(0, (*position, math.pi / 2, 0.0, 0.0), velocity)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=message):
        engage(op, endless(op), axes)
