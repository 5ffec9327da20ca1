"""Chip: feed per height, pitch and runout, the exact chip against polygons of simulated tooth paths."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cutting.cases import AL6061, MM, RPM, milling, table_31, table_32, turn_milling
from turnmill_core.cutting.chip import (
    exact_chip,
    feed_per_tooth,
    prepare_cut,
    static_chip,
    tool_speed_for_cutting_speed,
    tool_speed_for_feed_per_tooth,
)
from turnmill_core.cutting.engagement import removal
from turnmill_core.cutting.feed import feed_velocity, to_feed_frame
from turnmill_core.operation import Operation, Tool


def angles(op: Operation, count: int, elements: int) -> np.ndarray:
    cut = prepare_cut(op, op.conditions, elements)
    spindle = np.arange(count) * (2 * math.pi / count)
    return spindle[:, None, None] + cut.elements.offset[None, :, None] - cut.elements.lag[None]


def test_feed_grows_with_the_distance_from_the_c_axis() -> None:
    op = table_31()
    feed = feed_velocity(op, op.conditions, np.array([0.0, 1 * MM]))
    assert feed[:, 0] == pytest.approx(2 * 2 * math.pi / 60 * np.array([51.5 * MM, 52.5 * MM]))
    assert feed[:, 1] == pytest.approx(4 * MM / 60)


def test_down_milling_feeds_to_the_other_side() -> None:
    op = turn_milling(Tool("t", 16 * MM, 2), AL6061, 105 * MM, 1 * MM, 2 * MM, 500, 2, "down")
    assert feed_velocity(op, op.conditions, np.zeros(1))[0, 1] == pytest.approx(-4 * MM / 60)


def test_feed_frame_puts_the_resultant_on_x() -> None:
    feed = np.array([3.0, 4.0, 0.0])
    assert to_feed_frame(feed, math.atan2(4, 3)) == pytest.approx([5, 0, 0])


def test_milling_chip_is_feed_per_tooth_times_sine() -> None:
    op = milling(Tool("t", 20 * MM, 4), AL6061, 2 * MM, 0.12 * MM, (0, 10 * MM))
    phi = np.linspace(0, math.pi / 2, 7)[:, None, None] * np.ones((1, 4, 3))
    chip = static_chip(prepare_cut(op, op.conditions, 3), phi)
    assert chip == pytest.approx(0.12 * MM * np.sin(phi))


def test_static_chip_times_edge_speed_is_the_volume_of_the_side() -> None:
    """Summed over a revolution, chip area times R dphi is what the side edges remove."""
    op = table_31(pitch_angles=(3.0, 2 * math.pi - 3.0))
    cut = prepare_cut(op, op.conditions, 400)
    s, e = cut.engagement.start, cut.engagement.exit
    # chip of tooth j: (f . n) tau_j, integrated over the arcs in closed form
    per_second = cut.feed[:, :1] * (np.cos(s) - np.cos(e)) + cut.feed[:, 1:2] * (np.sin(e) - np.sin(s))
    area = op.tool.radius * (per_second.sum(axis=1) * cut.elements.width).sum() * cut.delay[0].sum()
    revolutions = op.conditions.tool_speed / (2 * math.pi)
    assert area * revolutions == pytest.approx(removal(op, op.conditions).side, rel=2e-4)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-20e-6, 20e-6), min_size=3, max_size=3))
def test_runout_moves_the_chip_between_the_teeth_and_keeps_their_sum(runout: list[float]) -> None:
    op = milling(Tool("t", 20 * MM, 3, runout=tuple(runout)), AL6061, 2 * MM, 0.1 * MM, (-10 * MM, 10 * MM))
    chip = static_chip(prepare_cut(op, op.conditions, 1), np.full((1, 3, 1), math.pi / 2))[0, :, 0]
    assert chip.sum() == pytest.approx(3 * 0.1 * MM, rel=1e-9)
    assert chip == pytest.approx(0.1 * MM + np.array(runout) - np.roll(runout, -1), abs=1e-15)


def test_a_tooth_far_inside_misses_and_the_next_takes_its_chip() -> None:
    op = milling(Tool("t", 20 * MM, 2, runout=(0.0, -0.15 * MM)), AL6061, 2 * MM, 0.1 * MM, (-10 * MM, 10 * MM))
    chip = static_chip(prepare_cut(op, op.conditions, 1), np.full((1, 2, 1), math.pi / 2))[0, :, 0]
    assert chip == pytest.approx([0.2 * MM, 0.0])


def test_exact_chip_tends_to_the_static_chip_with_small_feeds() -> None:
    difference = []
    for feed in (0.2 * MM, 0.1 * MM, 0.05 * MM):
        op = milling(Tool("t", 20 * MM, 4), AL6061, 2 * MM, feed, (-10 * MM, 10 * MM))
        phi = np.linspace(0.2, math.pi - 0.2, 50)[:, None, None] * np.ones((1, 4, 1))
        cut = prepare_cut(op, op.conditions, 1)
        difference.append(np.abs(exact_chip(cut, phi) / static_chip(cut, phi) - 1).max())
    order = np.polyfit(np.log([4, 2, 1]), np.log(difference), 1)[0]
    assert order == pytest.approx(1, abs=0.05)


def simulated_chip(op: Operation, height: float, phi: float, tooth: int, passes: int = 2) -> float:
    """Material on the tooth's normal, found without any formula for the chip.

    The tooth paths are polygons in the moving material; the ray from the tool axis is sampled and a
    point is material when no earlier tooth has been beyond it, and the wall and the bar hold it.
    """
    tool, c = op.tool, op.conditions
    feed = feed_velocity(op, c, np.array([height]))[0]
    offsets = np.concatenate(([0], np.cumsum(tool.pitch)[:-1]))
    runout = np.asarray(tool.runout or (0.0,) * tool.teeth)
    now = (phi - offsets[tooth]) / c.tool_speed  # the tooth is at phi; tool centre at feed * time
    direction = np.array([math.sin(phi), math.cos(phi)])
    reach = tool.radius + runout[tooth]
    ray = np.linspace(reach - 1.5 * MM, reach, 3001)
    material = np.ones(ray.size, bool)
    for other in range(tool.teeth):
        for turn in range(passes):
            # times around which the other tooth swept across this ray
            ahead = (offsets[other] - offsets[tooth]) % (2 * math.pi)
            passed = ahead + 2 * math.pi * turn
            if passed == 0:
                continue
            t = now - passed / c.tool_speed + np.linspace(-0.3, 0.3, 1501) / c.tool_speed
            angle = c.tool_speed * t + offsets[other]
            path = feed * t[:, None] + (tool.radius + runout[other]) * np.stack([np.sin(angle), np.cos(angle)], 1)
            # the path as a radius over the direction seen from the centre at `now`
            seen = path - feed * now
            bearing = np.arctan2(seen @ np.array([direction[1], -direction[0]]), seen @ direction)
            order = np.argsort(bearing)
            material &= ray > np.interp(0.0, bearing[order], np.hypot(*seen.T)[order], left=0.0, right=0.0)
    if op.process == "turn-milling":
        # previous revolution: the same tool as a disc, one axial feed behind, seen as it passed in the turning bar
        longest = tool.radius + runout.max()
        lever = c.effective_radius + height
        x, y = ray * direction[0], ray * direction[1]
        angle0, r = np.arctan2(x, lever), np.hypot(x, lever)
        for theta in np.linspace(-0.2, 0.2, 401):  # bar angle before the middle plane
            y_then = y + op.axial_feed + op.axial_feed / (2 * math.pi) * (theta - angle0)
            x_then, z_then = r * math.sin(theta), r * math.cos(theta) - c.effective_radius
            material &= ~((x_then**2 + y_then**2 < longest**2) & (z_then > 0))
        material &= r < op.workpiece.radius
    assert not material[0]
    return float(material.sum() * (ray[1] - ray[0]))


@pytest.mark.parametrize(("op", "height"), [
    (table_32(0), 0.1 * MM), (table_31(0), 0.5 * MM), (table_31(0), 0.85 * MM),
    (table_31(0, runout=(10e-6, -15e-6)), 0.3 * MM), (table_31(0, pitch_angles=(2.9, 2 * math.pi - 2.9)), 0.3 * MM)])
def test_exact_chip_against_simulated_tooth_paths(op: Operation, height: float) -> None:
    cut = prepare_cut(op, op.conditions, 200)
    level = int(np.argmin(np.abs(cut.elements.height - height)))
    for tooth in range(2):
        for phi in np.linspace(0.03, 0.9, 7):
            expected = simulated_chip(op, float(cut.elements.height[level]), float(phi), tooth)
            all_phi = np.full((1, op.tool.teeth, 200), phi)
            found = exact_chip(cut, all_phi)[0, tooth, level]
            assert found == pytest.approx(expected, abs=1.5e-6)


def test_exact_chip_area_is_the_volume_removed() -> None:
    """The strips between successive tooth paths fill the material that passes the flank.

    They also hold what rose through the bottom since the last tooth passed, while it lies outside that
    tooth's path: per time, the integral over y of Omega_c x f tau / 2. The wall is taken as smooth:
    the cusps that the teeth leave on it, (f tau)^2 / (24 R) high on average, are left out of the chip.
    """
    for op in (table_31(0), table_31(0, runout=(10e-6, -15e-6)), table_32(0)):
        cut = prepare_cut(op, op.conditions, 80)
        phi = angles(op, 3600, 80)
        h = exact_chip(cut, phi)
        # area swept by the chip's section: its points move with rho Omega_t + f.e along the path
        along = (cut.feed[:, 0] * np.cos(phi) - cut.feed[:, 1] * np.sin(phi)) / op.conditions.tool_speed
        area = (h * (cut.elements.radius + cut.elements.runout[:, None] - h / 2) + h * along) * cut.elements.width
        rate = area.sum() / 3600 * op.conditions.tool_speed
        c, radius = op.conditions, op.tool.radius
        exit_angle = math.acos(1 - op.axial_feed / radius)
        tau = 2 * math.pi / (op.tool.teeth * c.tool_speed)
        stride = cut.feed[0, 0] * tau
        risen = c.workpiece_speed * radius**2 * (exit_angle - math.sin(2 * exit_angle) / 2) / 2 * stride / 2
        cusps = stride**2 / (24 * radius) / op.axial_feed
        side = removal(op, c).side
        assert rate == pytest.approx((side + risen) * (1 - cusps), rel=0.004)


def test_chip_load_and_cutting_speed_limits() -> None:
    op = turn_milling(Tool("t", 20 * MM, 2), AL6061, 50 * MM, 1 * MM, 8 * MM, 4000, 20)
    speed = tool_speed_for_feed_per_tooth(op, op.conditions, 0.4 * MM)
    at_limit = dataclasses.replace(op.conditions, tool_speed=speed)
    assert feed_per_tooth(op, at_limit) == pytest.approx(0.4 * MM)
    assert tool_speed_for_cutting_speed(op, 10.0) * 10 * MM == pytest.approx(10.0)
    assert feed_per_tooth(op, dataclasses.replace(op.conditions, tool_speed=0.0)) == 0


def test_feed_per_tooth_of_milling() -> None:
    op = milling(Tool("t", 20 * MM, 4), AL6061, 2 * MM, 0.12 * MM, (0, 10 * MM), 3000)
    assert feed_per_tooth(op, op.conditions) == pytest.approx(0.12 * MM)
    assert op.conditions.tool_speed == pytest.approx(3000 * RPM)


def test_not_in_cut_is_an_error_here() -> None:
    op = table_31()
    with pytest.raises(ValueError, match=r"depth is -0\.001 m"):
        prepare_cut(op, dataclasses.replace(op.conditions, depth=-0.001))
