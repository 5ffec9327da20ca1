"""Operations with eccentricity and tilt: lowest point, axis states and back."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.machine.cases import turn_milling
from turnmill_core.cutting.cutter import outer_radius
from turnmill_core.cutting.steady import steady_axes
from turnmill_core.machine.conditions import conditions_from_axes, lowest_point, nominal_axes
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.machine.turn_milling_paths import cut_from_operation, orthogonal_path
from turnmill_core.operation import Operation, Shape, Tool

MM, DEG = 1e-3, math.pi / 180
SHAPES = {
    "cylinder": Shape(), "ball": Shape(corner_radius=10 * MM), "bull nose": Shape(corner_radius=3 * MM),
    "taper": Shape(taper_angle=5 * DEG), "drill": Shape(tip_angle=20 * DEG),
    "general": Shape(corner_radius=2 * MM, tip_angle=10 * DEG, taper_angle=4 * DEG),
}


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("tilt_deg", [-30.0, -3.0, 0.0, 2.0, 15.0, 60.0])
def test_lowest_point_against_a_search_along_the_profile(shape: Shape, tilt_deg: float) -> None:
    tool = Tool("t", 20 * MM, 2, flute_length=40 * MM, shape=shape)
    height = np.concatenate([[0.0], 40 * MM * np.linspace(0, 1, 40_001)[1:] ** 2])
    tilt = tilt_deg * DEG
    searched = (height * math.cos(tilt) - outer_radius(tool, height) * abs(math.sin(tilt))).min()
    assert lowest_point(tool, tilt) == pytest.approx(min(searched, 0.0), abs=2e-8)


def test_lowest_point_of_a_cylinder_and_a_ball_in_closed_form() -> None:
    assert lowest_point(Tool("t", 20 * MM, 2), 0.1) == pytest.approx(-10 * MM * math.sin(0.1))
    ball = Tool("b", 20 * MM, 2, shape=SHAPES["ball"])
    assert lowest_point(ball, -0.4) == pytest.approx(10 * MM * (math.cos(0.4) - 1))


def inclined(tilt: float = 3 * DEG, eccentricity: float = 2 * MM, sense: str = "up") -> Operation:
    return dataclasses.replace(turn_milling(sense=sense), tilt=tilt, eccentricity=eccentricity)


@pytest.mark.parametrize("sense", ["up", "down"])
@pytest.mark.parametrize(("tilt", "eccentricity"), [(0.0, 3 * MM), (4 * DEG, 0.0), (-2 * DEG, -1 * MM)])
def test_conditions_of_the_operation_s_own_place_and_tilt(tilt: float, eccentricity: float, sense: str) -> None:
    op = inclined(tilt, eccentricity, sense)
    axes = nominal_axes(op)
    assert axes.position[1] == pytest.approx(op.workpiece.datum[1] + eccentricity)
    assert axes.position[3] == pytest.approx(math.pi / 2 + tilt)
    found = conditions_from_axes(op, axes)
    assert found.depth == pytest.approx(op.conditions.depth)
    assert found.cross_feed_span == pytest.approx(op.conditions.cross_feed_span)
    driven = axis_state_at(op, 0.0, 0)
    assert driven.position == pytest.approx(axes.position)
    assert steady_axes(op, op.conditions).position[:2] == pytest.approx(axes.position[:2])


def test_another_place_or_tilt_is_refused() -> None:
    op = inclined()
    upright = nominal_axes(dataclasses.replace(op, tilt=0.0))
    with pytest.raises(ValueError, match=r"axis b.* is 1\.5707.*expected 1\.62316 within 0\.1 deg"):
        conditions_from_axes(op, upright)
    centred = nominal_axes(dataclasses.replace(op, eccentricity=0.0))
    with pytest.raises(ValueError, match=r"axis y.*expected 0\.002 within"):
        conditions_from_axes(op, centred)


def test_paths_take_the_operation_s_eccentricity_and_no_tilt() -> None:
    op = inclined(tilt=0.0)
    assert {p.tip[1] for p in orthogonal_path(cut_from_operation(op)).points} == {2 * MM}
    assert cut_from_operation(op, 0.0).eccentricity == 0
    with pytest.raises(ValueError, match="tilt"):
        cut_from_operation(inclined())
