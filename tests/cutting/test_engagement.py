"""Engagement: closed angles, a brute-force point cloud, the volume balance, the time ratio."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cutting.cases import AL6061, MM, milling, table_31, turn_milling
from turnmill_core.cutting.engagement import Engagement, cutting_time_share, engagement, removal
from turnmill_core.cutting.feed import feed_angle
from turnmill_core.operation import Operation, Tool

TOOL = Tool("t", 20 * MM, 4, math.radians(30), 40 * MM)


def arcs(op: Operation, *heights: float) -> Engagement:
    return engagement(op, op.conditions, np.array(heights))


@pytest.mark.parametrize(("span_mm", "start", "stop"), [
    ((2, 10), 0.0, math.acos(0.2)),  # up-milling, ae = 8 mm: erratum M10, exit 1.3694 rad
    ((-10, -2), math.acos(-0.2), math.pi),  # down-milling
    ((-10, 10), 0.0, math.pi),  # slot
    ((-5, 5), math.acos(0.5), math.acos(-0.5)),  # centred
    ((-25, 25), 0.0, math.pi),  # wider than the tool
])
def test_milling_angles(span_mm: tuple[float, float], start: float, stop: float) -> None:
    op = milling(TOOL, AL6061, 3 * MM, 0.1 * MM, (span_mm[0] * MM, span_mm[1] * MM))
    found = arcs(op, 0.0, 0.0029, 0.0031)
    assert found.start[:2, 0] == pytest.approx(np.full(2, start), abs=1e-12)
    assert found.exit[:2, 0] == pytest.approx(np.full(2, stop), abs=1e-12)
    assert found.angle[2] == 0  # above the material
    assert np.all(found.start[:, 1] == found.exit[:, 1])


def test_erratum_m10_number() -> None:
    op = milling(TOOL, AL6061, 3 * MM, 0.1 * MM, (2 * MM, 10 * MM))
    assert arcs(op, 0.0).exit[0, 0] == pytest.approx(1.3694, abs=5e-5)


def test_turn_milling_starts_at_the_extreme_point_across_the_resultant_feed() -> None:
    op = table_31()
    epsilon = feed_angle(op, op.conditions, np.zeros(1))[0]
    assert epsilon == pytest.approx(math.atan2(4, 2 * 2 * math.pi * 51.5), rel=1e-12)
    found = arcs(op, 0.0)
    assert found.start[0, 0] == pytest.approx(-epsilon)
    # the wall is a straight line along the feed, to the curvature of the bar over the contact
    assert found.exit[0, 0] == pytest.approx(math.acos(1 - 2 * math.cos(epsilon) / 8) - epsilon, abs=1e-4)
    assert found.angle[0] == pytest.approx(math.acos(1 - 2 / 8), abs=1e-4)


def test_past_ninety_degrees_two_arcs_leave_the_air_beside_the_bar() -> None:
    op = turn_milling(TOOL, AL6061, 100 * MM, 0.5 * MM, 19 * MM, 3000, 5)
    found = arcs(op, 0.0, 0.2 * MM)
    assert np.all(found.exit > found.start)
    assert np.all(found.start[:, 1] > found.exit[:, 0])
    width = np.sqrt(50**2 - (49.5 + np.array([0.0, 0.2])) ** 2)
    assert 10 * np.sin(found.exit[:, 0]) == pytest.approx(width)
    assert 10 * np.sin(found.start[:, 1]) == pytest.approx(width)


def test_down_milling_mirrors_up_milling() -> None:
    up = turn_milling(TOOL, AL6061, 60 * MM, 2 * MM, 18 * MM, 3000, 5, "up")
    down = turn_milling(TOOL, AL6061, 60 * MM, 2 * MM, 18 * MM, 3000, 5, "down")
    z = np.linspace(0, 0.0019, 9)
    a, b = engagement(up, up.conditions, z), engagement(down, down.conditions, z)
    two = a.exit[:, 1] > a.start[:, 1]
    assert two.any()
    assert b.start[two] == pytest.approx(math.pi - a.exit[two][:, ::-1])
    assert b.exit[~two][:, 0] == pytest.approx(math.pi - a.start[~two][:, 0])
    assert b.angle == pytest.approx(a.angle)
    up_volume, down_volume = removal(up, up.conditions), removal(down, down.conditions)
    assert (down_volume.side, down_volume.bottom) == pytest.approx((up_volume.side, up_volume.bottom), rel=1e-9)


@pytest.mark.parametrize(
    "change", [{"depth": 0.0}, {"depth": -0.001}, {"tool_speed": 0.0}, {"cross_feed_span": (0, 0)}])
def test_no_contact_gives_empty_arcs_and_no_volume(change: dict[str, object]) -> None:
    op = table_31()
    conditions = dataclasses.replace(op.conditions, **change)
    assert not engagement(op, conditions, np.array([0.0, 0.0005])).angle.any()
    assert removal(op, conditions).total == 0
    assert removal(op, conditions).bottom_share == 0
    assert cutting_time_share(op, conditions) == 0


@pytest.mark.parametrize(("sense", "axial_feed", "bar", "depth", "rpm"), [
    ("up", 2, 105, 1.0, 2), ("down", 2, 105, 1.0, 2), ("up", 0.3, 90, 0.5, 20), ("up", 8, 50, 5.5, 10),
    ("up", 7.9, 40, 0.5, 30), ("up", 14, 50, 1.0, 10), ("down", 14, 30, 1.0, -10), ("up", 5, 100, 12, 6)])
def test_volume_balance(sense: str, axial_feed: float, bar: float, depth: float, rpm: float) -> None:
    op = turn_milling(TOOL, AL6061, bar * MM, depth * MM, axial_feed * MM, 3000, rpm, sense)
    volume = removal(op, op.conditions)
    expected = abs(rpm) / 60 * axial_feed * MM * depth * MM * math.pi * (bar - depth) * MM
    assert volume.total == pytest.approx(expected, rel=1e-12)
    assert volume.side + volume.bottom == pytest.approx(volume.total, rel=1e-3)


@settings(max_examples=60, deadline=None)
@given(st.floats(0.1, 10), st.floats(40, 200), st.floats(0.1, 8), st.booleans())
def test_volume_balance_everywhere(axial_feed: float, bar: float, depth: float, up: bool) -> None:
    op = turn_milling(TOOL, AL6061, bar * MM, depth * MM, axial_feed * MM, 3000, 5, "up" if up else "down")
    volume = removal(op, op.conditions)
    assert volume.side + volume.bottom == pytest.approx(volume.total, rel=1e-3)
    assert 0 <= volume.bottom_share < 1


def test_milling_removes_through_the_side_only() -> None:
    op = milling(TOOL, AL6061, 3 * MM, 0.1 * MM, (2 * MM, 10 * MM))
    volume = removal(op, op.conditions)
    assert volume.bottom == 0
    assert volume.side == pytest.approx(volume.total, rel=1e-12)
    assert volume.total == pytest.approx(0.1e-3 * 4 * 50 * 8e-3 * 3e-3)


def test_a_span_wider_than_the_tool_removes_a_slot() -> None:
    wide = milling(TOOL, AL6061, 3 * MM, 0.1 * MM, (-25 * MM, 25 * MM))
    assert removal(wide, wide.conditions).total == pytest.approx(0.1e-3 * 4 * 50 * 20e-3 * 3e-3)
    assert removal(wide, wide.conditions).side == pytest.approx(removal(wide, wide.conditions).total, rel=1e-12)


def test_workpiece_at_rest_removes_the_segment_of_the_bar() -> None:
    op = turn_milling(TOOL, AL6061, 60 * MM, 1 * MM, 4 * MM, 3000, 10)
    c = dataclasses.replace(op.conditions, workpiece_speed=0.0, feed_speed=0.02)
    angle = 2 * math.acos(29 / 30)
    segment = (30e-3) ** 2 * (angle - math.sin(angle)) / 2
    assert removal(op, c).total == pytest.approx(0.02 * segment, rel=1e-6)
    assert removal(op, c).side == pytest.approx(0.02 * segment, rel=1e-6)


def entries(op: Operation, count: int = 150) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where points of the turning bar first meet the tool, by stepping every point along its path.

    Returns the entry angle phi, the entry height and whether it came through the bottom, for points
    spread evenly over one feed pitch and over the removed ring (equal volumes), in up-milling.
    """
    c, radius, bar = op.conditions, op.tool.radius, op.workpiece.radius
    tip = bar - c.depth
    cell = (np.arange(count) + 0.5) / count
    r = np.sqrt(tip**2 + cell * (bar**2 - tip**2))[:, None, None]
    # axial distance ahead of the tool axis when the point stands straight under it, on its last free pass and the next
    ahead = (radius + 0.1 * op.axial_feed - cell * op.axial_feed)[None, :, None]
    theta = np.arange(-0.2, 0.2, 2e-4)
    phi = np.full((count, count), np.nan)
    height, bottom = phi.copy(), np.zeros((count, count), bool)
    for turn in range(3):
        x, y = r * np.cos(theta), r * np.sin(theta)  # machine frame, C axis at the origin
        y_tool = ahead - (turn - 1) * op.axial_feed - op.axial_feed * theta / (2 * math.pi)
        x_tool, z_tool = -y, x - tip
        inside = (x_tool**2 + y_tool**2 <= radius**2) & (z_tool >= 0)
        hit = inside.any(axis=2) & np.isnan(phi)
        first = inside.argmax(axis=2)
        pick = np.take_along_axis(np.broadcast_to(x_tool, inside.shape), first[..., None], 2)[..., 0]
        pick_y = np.take_along_axis(y_tool * np.ones_like(r), first[..., None], 2)[..., 0]
        pick_z = np.take_along_axis(np.broadcast_to(z_tool, inside.shape), first[..., None], 2)[..., 0]
        phi[hit], height[hit] = np.arctan2(pick, pick_y)[hit], pick_z[hit]
        bottom[hit] = (np.hypot(pick, pick_y) < radius - 2e-4 * bar)[hit] & (pick_z < 1e-4 * bar)[hit]
    assert not np.isnan(phi).any()
    return phi, height, bottom


@pytest.mark.parametrize(("axial_feed", "depth"), [(2.0, 1.0), (5.0, 1.5)])
def test_engagement_against_a_point_cloud_of_the_turning_bar(axial_feed: float, depth: float) -> None:
    tool = Tool("t", 16 * MM, 2, flute_length=30 * MM)
    op = turn_milling(tool, AL6061, 105 * MM, depth * MM, axial_feed * MM, 500, 2)
    phi, height, bottom = entries(op)
    side = ~bottom
    volume = removal(op, op.conditions)
    assert bottom.mean() == pytest.approx(volume.bottom_share, abs=0.005)
    within = engagement(op, op.conditions, np.maximum(height[side], 0.0))
    assert np.all(phi[side] < within.exit.max(axis=1) + 0.004)
    assert np.all(phi[side] > within.start[:, 0] - 0.004)
    edges = np.linspace(0, depth * MM, 11)
    for low, high in pairwise(edges[:-1]):
        found = phi[side & (height >= low) & (height < high)]
        closed = engagement(op, op.conditions, np.linspace(low, high, 50))
        # material arrives over the arc as the chip's area does: flux R(z) sin(phi) from start to exit
        for share in (0.1, 0.5, 0.9, 0.99):
            feed = np.array([op.conditions.workpiece_speed * (op.conditions.effective_radius + (low + high) / 2),
                             op.conditions.feed_speed])
            angle = np.linspace(closed.start.min(), closed.exit.max(), 4001)
            inside = (angle[:, None] > closed.start[:, 0]) & (angle[:, None] < closed.exit[:, 0])
            flux = np.cumsum(inside.sum(axis=1) * (feed[0] * np.sin(angle) + feed[1] * np.cos(angle)))
            expected = np.interp(share * flux[-1], flux, angle)
            assert np.quantile(found, share) == pytest.approx(expected, abs=0.01 * closed.exit.max())


def test_time_share_without_helix_is_the_engagement_angle_over_the_pitch() -> None:
    op = table_31(helix_deg=0)
    angle = arcs(op, 0.0).angle[0]
    # the feed angle varies a little along z
    assert cutting_time_share(op, op.conditions) == pytest.approx(2 * angle / (2 * math.pi), rel=3e-4)


def test_time_share_with_helix_by_counting() -> None:
    op = table_31()
    z = np.linspace(0, op.conditions.depth, 300, endpoint=False)
    a = engagement(op, op.conditions, z)
    spindle = np.linspace(0, 2 * math.pi, 20000, endpoint=False)[:, None]
    cutting = np.zeros(spindle.size, bool)
    for tooth in (0, math.pi):
        phi = spindle + tooth - z * math.tan(op.tool.helix_angle) / op.tool.radius
        phi = (phi + 1) % (2 * math.pi) - 1
        cutting |= ((phi > a.start[:, 0]) & (phi < a.exit[:, 0])).any(axis=1)
    assert cutting_time_share(op, op.conditions) == pytest.approx(cutting.mean(), abs=2e-4)


def test_slot_with_two_teeth_cuts_all_the_time() -> None:
    op = milling(Tool("t", 20 * MM, 2), AL6061, 2 * MM, 0.1 * MM, (-10 * MM, 10 * MM))
    assert cutting_time_share(op, op.conditions) == pytest.approx(1.0)
