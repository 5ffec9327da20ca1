"""Strokes: the first point of a path that leaves them is named."""

from __future__ import annotations

import math

import numpy as np
import pytest

from turnmill_core.machine.limits import NT3150_LIMITS, AxisLimits, check_strokes, first_violation


def test_strokes_of_table_4_5() -> None:
    lengths = np.asarray(NT3150_LIMITS.upper) - np.asarray(NT3150_LIMITS.lower)
    assert lengths[:3] == pytest.approx([1.370, 0.250, 0.570])
    assert np.degrees(lengths[3]) == pytest.approx(240)
    assert math.isinf(lengths[4])


def test_a_path_within_the_strokes() -> None:
    drives = np.zeros((5, 5))
    drives[:, 4] = 1e4  # C turns on
    drives[2, 1] = 0.125
    assert first_violation(NT3150_LIMITS, drives) is None
    check_strokes(NT3150_LIMITS, drives)


def test_the_first_violating_point_is_reported() -> None:
    drives = np.zeros((6, 5))
    drives[3:, 1] = -0.126
    drives[4, 0] = 9.0
    found = first_violation(NT3150_LIMITS, drives)
    assert found is not None
    assert (found.index, found.axis, found.count) == (3, "y", 3)
    assert found.text == "path point 4: axis Y at -126 mm, expected -125 to 125 mm (3 points outside)"
    drives[3, 3] = math.radians(150)
    drives[:, 1] = 0
    with pytest.raises(ValueError, match=r"path point 4: axis B at 150 deg, expected -120 to 120 deg \(2 points"):
        check_strokes(NT3150_LIMITS, drives)


def test_a_position_that_is_no_number_is_outside() -> None:
    drives = np.zeros((2, 5))
    drives[1, 4] = math.nan
    found = first_violation(NT3150_LIMITS, drives)
    assert found is not None
    assert (found.index, found.axis) == (1, "c")


def test_limits_must_be_in_order() -> None:
    with pytest.raises(ValueError, match="limits of drive y"):
        AxisLimits((0.0, 1.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0, 1.0))
