"""Delay models against closed forms, limits and the errata."""

from __future__ import annotations

import numpy as np
import pytest

from turnmill_core.stability.delay import (
    DELAY_CURVES,
    delay_curve,
    delay_variation,
    discrete_delay,
    first_principles_delay,
    mean_delay,
    tooth_period,
)

RPM = np.pi / 30


def test_without_workpiece_rotation_the_mean_delay_is_the_tooth_period() -> None:
    pitch = (2.0, 2 * np.pi - 2.0)
    np.testing.assert_array_equal(mean_delay(pitch, 350.0, 0.0), tooth_period(pitch, 350.0))


def test_figure_4_28_is_3000_rpm_of_the_workpiece_at_6000_rpm_of_a_two_fluted_tool() -> None:
    """Erratum D1: the thesis reads 7.48 to 7.51 ms."""
    assert mean_delay((np.pi, np.pi), 6000 * RPM, 3000 * RPM)[0] == pytest.approx(7.5e-3, rel=1e-12)


def test_from_6_to_21_rpm_the_delay_grows_by_less_than_half_a_percent() -> None:
    """Erratum D2: the text says 4 %."""
    slow, fast = (mean_delay((np.pi, np.pi), 3350 * RPM, w * RPM)[0] for w in (6, 21))
    assert fast / slow - 1 == pytest.approx(0.00447, abs=1e-5)


def test_the_sense_of_the_workpiece_does_not_matter_to_the_mean() -> None:
    np.testing.assert_array_equal(mean_delay((np.pi, np.pi), 300.0, -2.0), mean_delay((np.pi, np.pi), 300.0, 2.0))


def test_rotation_shortens_the_delay_in_up_milling_and_lengthens_it_in_down_milling() -> None:
    up, down = first_principles_delay(np.pi, 100.0, 0.01, 0.05, [0.3, np.pi - 0.3])
    assert up < np.pi / 100 < down
    assert up + down == pytest.approx(2 * np.pi / 100)


def test_the_exact_delay_finds_the_preceding_tooth_on_the_same_material_point() -> None:
    """Geometry itself: the ray at phi from the present tool centre meets the preceding tooth's circle."""
    pitch, speed, radius, surface, angle = np.pi / 2, 300.0, 0.01, 0.3, 0.8
    tau = float(first_principles_delay(pitch, speed, radius, surface, angle, exact=True))
    before = angle + speed * (pitch / speed - tau)  # angle of the preceding tooth tau ago
    point = radius * np.array([np.sin(before), np.cos(before)]) - np.array([surface * tau, 0.0])
    assert point[0] * np.cos(angle) - point[1] * np.sin(angle) == pytest.approx(0.0, abs=1e-15)


def test_the_first_order_delay_is_the_limit_of_the_exact_one() -> None:
    error = []
    for surface in (0.04, 0.02, 0.01):
        exact, first = (first_principles_delay(np.pi, 350.0, 0.01, surface, 0.5, exact=e) for e in (True, False))
        error.append(abs(float(exact - first)))
    slope = np.polyfit(np.log([4, 2, 1]), np.log(error), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("speed", [0.0, -1.0, np.nan])
def test_a_tool_that_stands_still_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match="tool speed"):
        mean_delay((np.pi, np.pi), speed, 1.0)


def test_a_surface_as_fast_as_the_edge_is_refused() -> None:
    with pytest.raises(ValueError, match="surface speed"):
        first_principles_delay(np.pi, 100.0, 0.01, 1.0, 0.0)
    with pytest.raises(ValueError, match="tool radius"):
        delay_variation(0.0, 100.0, 1.0)


def test_the_discrete_model_with_matching_points_is_the_mean() -> None:
    """Erratum D1: no ripple."""
    angle = np.linspace(0, np.pi, 50)
    found = discrete_delay(np.pi / 2, 6000 * RPM, 600 * RPM, 6e-3, 18e-3, 1e-3, angle, literal=False)
    np.testing.assert_allclose(found, mean_delay(np.pi / 2, 6000 * RPM, 600 * RPM), rtol=1e-12)


def test_the_discrete_model_as_printed_gives_the_range_of_figure_4_28() -> None:
    """7.48 to 7.51 ms at 6000 and 3000 rpm, two teeth, Table 4.3's diameters and depth."""
    found = discrete_delay(np.pi, 6000 * RPM, 3000 * RPM, 6e-3, 18e-3, 1e-3, np.linspace(0, np.pi, 400)) * 1e3
    assert 7.475 < found.min() < 7.5
    assert 7.5 <= found.max() < 7.515


def test_the_ripple_of_the_printed_model_grows_as_tool_and_bar_get_alike() -> None:
    """Section 4.3.4.2: more severe as the diameters come close."""
    angle = np.linspace(0, np.pi, 200)
    ripple = [np.ptp(discrete_delay(np.pi / 2, 6000 * RPM, 1500 * RPM, 6e-3, 6e-3 * ratio, 1e-3, angle))
              for ratio in (8.33, 4.0, 2.0)]
    assert ripple[0] < ripple[1] < ripple[2]


@pytest.mark.parametrize("model", DELAY_CURVES)
def test_every_model_is_the_tooth_period_where_the_workpiece_stands(model: str) -> None:
    """The printed discrete model keeps its ripple even then: its two points never match."""
    found = delay_curve(model, np.pi, 350.0, 0.0, 10e-3, 23e-3, 1e-3, [0.0, 0.7, 1.4])  # type: ignore[arg-type]
    np.testing.assert_allclose(found, np.pi / 350.0, rtol=0.02 if model == "discrete-literal" else 1e-12)
    assert (np.ptp(found) > 0) == (model == "discrete-literal")


def test_exact_and_first_order_lie_close_and_mean_lies_apart() -> None:
    arguments = (np.pi, 350.0, 12.0, 10e-3, 23e-3, 1e-3, [0.0, 0.7, 1.4])
    first, exact, mean = (delay_curve(m, *arguments) for m in ("first-principles", "exact", "mean"))  # type: ignore[arg-type]
    assert np.abs(first - exact).max() < 0.2 * np.abs(first - mean).max()


def test_unknown_models_and_impossible_depths_are_refused() -> None:
    with pytest.raises(ValueError, match="delay model"):
        delay_curve("thesis", np.pi, 350.0, 1.0, 10e-3, 23e-3, 1e-3, 0.0)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="depth"):
        discrete_delay(np.pi, 350.0, 1.0, 10e-3, 23e-3, 23e-3, 0.0)
