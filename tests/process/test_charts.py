"""Spindle charts: constant torque, constant power, ratings for a time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnmill_core.operation_limits import Limits, Rating
from turnmill_core.process.charts import available_torque, rated_power, rated_torque, top_speed

LONG = Rating("continuous", (100.0, 400.0, 1000.0), (2000.0, 8000.0, 8000.0))
SHORT = Rating("10 min", (100.0, 500.0, 900.0), (3000.0, 15000.0, 15000.0), duration=600.0)


@given(st.floats(1e-3, 1000.0))
def test_torque_is_constant_up_to_the_base_speed_and_power_above(speed: float) -> None:
    torque, power = float(rated_torque(LONG, speed)), float(rated_power(LONG, speed))
    assert power == pytest.approx(torque * speed)
    if speed <= 400:
        assert torque == pytest.approx(20.0)
    else:
        assert power == pytest.approx(8000.0)


def test_at_rest_and_above_the_top_speed() -> None:
    np.testing.assert_allclose(rated_torque(LONG, [0.0, -50.0, 1000.0, 1001.0]), [20.0, 20.0, 8.0, 0.0])
    assert top_speed((LONG, SHORT)) == 1000.0
    assert math.isinf(top_speed(()))


def test_a_short_cut_may_use_the_short_time_rating() -> None:
    both, speeds = (LONG, SHORT), np.array([50.0, 450.0, 950.0])
    np.testing.assert_allclose(available_torque(both, "peak", speeds, 601.0), rated_torque(LONG, speeds))
    expected = [30.0, 30.0, 8000 / 950]  # above its top speed the continuous rating is left
    np.testing.assert_allclose(available_torque(both, "peak", speeds, 600.0), expected)
    assert np.all(np.isinf(available_torque(both, "mean", speeds)))


def test_a_chart_needs_a_continuous_rating_and_sense() -> None:
    with pytest.raises(ValueError, match="continuous rating"):
        Limits(tool_spindle=(SHORT,))
    with pytest.raises(ValueError, match="strictly ascending"):
        Rating("x", (2.0, 1.0), (1.0, 1.0))
    with pytest.raises(ValueError, match="power of rating x"):
        Rating("x", (1.0,), (0.0,))
    with pytest.raises(ValueError, match="chip_load_max"):
        Limits(chip_load_min=2e-4, chip_load_max=1e-4)
