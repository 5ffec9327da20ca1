"""Simulated controller: exact integrals, continuity, independence of steps."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from tests.machine.cases import RPM, milling, turn_milling
from turnmill_core.machine.axes import AXES
from turnmill_core.machine.conditions import conditions_from_axes, nominal_axes
from turnmill_core.machine.controller import DEFAULT_DURATION, axis_state_at, schedule_duration
from turnmill_core.operation import Operation, SchedulePoint


@st.composite
def schedules(draw: st.DrawFn, turning: bool) -> tuple[SchedulePoint, ...]:
    steps = draw(st.lists(st.floats(0.05, 3.0), min_size=2, max_size=5))
    first = draw(st.sampled_from([0.0, 0.7]))
    times = first + np.concatenate([[0.0], np.cumsum(steps[1:])])
    return tuple(
        SchedulePoint(
            float(t), draw(st.floats(0, 600)), draw(st.floats(-3, 3)) if turning else 0.0, draw(st.floats(-5e-3, 5e-3)))
        for t in times
    )


@st.composite
def scheduled(draw: st.DrawFn) -> Operation:
    turning = draw(st.booleans())
    schedule = draw(schedules(turning))
    sense = draw(st.sampled_from(["up", "down"]))
    return turn_milling(sense=sense, schedule=schedule) if turning else milling(sense=sense, schedule=schedule)


RAMP = turn_milling(schedule=(
    SchedulePoint(0.0, 300.0, 0.5, -1e-3), SchedulePoint(2.0, 400.0, -1.5, 1e-3), SchedulePoint(3.0, 400.0, -1.5, 1e-3),
))


@given(scheduled(), st.floats(0, 12))
def test_velocity_is_the_derivative_of_position(op: Operation, t: float) -> None:
    """Central difference of a piecewise quadratic is exact inside a segment."""
    h = 1e-4
    times = [0.0, *(p.time for p in op.schedule)]
    assume(t > h and all(abs(t - knot) > 2 * h for knot in times))
    # |Omega_c| has a kink where the workpiece speed changes sign
    before, here, after = (axis_state_at(op, t + d, 0) for d in (-h, 0.0, h))
    assume(before.velocity[4] * after.velocity[4] >= 0)
    slope = (np.array(after.position) - before.position) / (2 * h)
    assert np.allclose(slope, here.velocity, rtol=1e-7, atol=1e-7)


@given(scheduled())
def test_positions_and_speeds_are_continuous_at_the_points(op: Operation) -> None:
    for point in op.schedule:
        assume(point.time > 0)
        before, after = axis_state_at(op, point.time - 1e-9, 0), axis_state_at(op, point.time, 0)
        assert np.allclose(before.position, after.position, rtol=0, atol=2e-6)
        assert before.velocity[4:] == pytest.approx(after.velocity[4:], abs=1e-4)
        assert after.velocity[5] == pytest.approx(point.tool_speed)


@given(scheduled(), st.floats(0, 12))
def test_spindle_angles_and_feed_against_quadrature(op: Operation, t: float) -> None:
    knots = sorted({min(p.time, t) for p in op.schedule})

    def integral(axis: int) -> float:
        cuts = [0.0, *knots, t]
        return sum(
            quad(lambda u: axis_state_at(op, u, 0).velocity[axis], a, b, limit=200)[0]
            for a, b in pairwise(cuts) if b > a)

    start, end = axis_state_at(op, 0.0, 0), axis_state_at(op, t, 0)
    for axis in (2 if op.workpiece.is_bar else 0, 4, 5):
        travelled = end.position[axis] - start.position[axis]
        assert travelled == pytest.approx(integral(axis), rel=1e-7, abs=1e-7), AXES[axis]


def test_a_ramp_by_hand() -> None:
    """Tool 300 to 400 rad/s in 2 s; workpiece 0.5 to -1.5 rad/s, through zero at 0.5 s; 8 mm/rev."""
    at = axis_state_at(RAMP, 2.0, 42)
    assert at.stamp_ns == 42
    assert at.position[5] == pytest.approx(700.0)
    assert at.position[4] == pytest.approx(-1.0)
    turned = 0.5 * 0.5 / 2 + 1.5 * 1.5 / 2
    assert at.position[2] - axis_state_at(RAMP, 0.0, 0).position[2] == pytest.approx(-8e-3 * turned / (2 * math.pi))
    assert at.position[0] == pytest.approx(0.025 - 1e-3)
    middle = axis_state_at(RAMP, 1.0, 0)
    assert middle.velocity[:6] == pytest.approx((-1e-3, 0, -8e-3 * 0.5 / (2 * math.pi), 0, -0.5, 350.0))
    assert conditions_from_axes(RAMP, middle).depth == pytest.approx(0.0, abs=1e-15)


def test_after_the_last_point_the_set_values_hold() -> None:
    end, later = axis_state_at(RAMP, 3.0, 0), axis_state_at(RAMP, 13.0, 0)
    assert later.velocity == end.velocity
    assert later.position[5] - end.position[5] == pytest.approx(4000.0)
    assert later.position[0] == end.position[0]
    assert schedule_duration(RAMP) == 3.0


@pytest.mark.parametrize("op", [turn_milling(), turn_milling(sense="down"), milling(), milling(sense="down")])
def test_without_a_schedule_the_nominal_cut_is_held(op: Operation) -> None:
    assert schedule_duration(op) == DEFAULT_DURATION
    assert axis_state_at(op, 0.0, 7) == nominal_axes(op, stamp_ns=7)
    for t in (0.0, 1.0, DEFAULT_DURATION):
        cut = conditions_from_axes(op, axis_state_at(op, t, 0))
        assert cut.cross_feed_span == pytest.approx(op.conditions.cross_feed_span, abs=1e-12)
        assert cut.depth == pytest.approx(op.conditions.depth)
        assert cut.tool_speed == op.conditions.tool_speed


def test_feed_runs_off_the_far_end_into_no_contact() -> None:
    """120 mm of bar at 8 mm/rev and 6 rpm (0.8 mm/s): full cut for (120 - 8)/0.8 = 140 s, air 10 s later."""
    op = turn_milling(feed=0.008, length=0.12)
    full, leaving, gone = (conditions_from_axes(op, axis_state_at(op, t, 0)) for t in (139.9, 145.0, 150.1))
    assert full.radial_immersion == pytest.approx(8e-3)
    assert leaving.radial_immersion == pytest.approx(4e-3)
    assert not gone.in_cut


def test_conditions_follow_the_schedule() -> None:
    op = turn_milling(schedule=(
        SchedulePoint(0.0, 3350 * RPM, 6 * RPM, -1e-3), SchedulePoint(1.0, 3350 * RPM, 21 * RPM, 1e-3)))
    air, half, cut = (conditions_from_axes(op, axis_state_at(op, t, 0)) for t in (0.0, 0.5, 2.0))
    assert not air.in_cut
    assert air.depth == pytest.approx(-1e-3)
    assert half.workpiece_speed == pytest.approx(13.5 * RPM)
    assert cut.in_cut
    assert cut.radial_immersion == pytest.approx(op.axial_feed)
    assert cut.feed_speed == pytest.approx(2.8e-3)


@pytest.mark.parametrize("t", [-1e-9, math.nan, math.inf])
def test_time_before_the_start_is_refused(t: float) -> None:
    with pytest.raises(ValueError, match="time"):
        axis_state_at(RAMP, t, 0)
