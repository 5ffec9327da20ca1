"""The compiled loops against their plain versions and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from turnmill_core.monitoring import _kernels

RNG = np.random.default_rng(3)


def test_spline_is_that_of_scipy_at_the_angles() -> None:
    x = RNG.standard_normal(300)
    turns = np.cumsum(RNG.uniform(0.02, 0.03, 300))
    coefficients = ndimage.spline_filter1d(x, 3, mode="mirror")
    arguments = (coefficients, turns, float(turns[-1] - 4), 1 / 50, 200)
    values, places = _kernels.spline_at(*arguments)
    expected = np.interp(turns[-1] - 4 + (np.arange(200) + 1) / 50, turns, np.arange(300))
    assert places == pytest.approx(expected, abs=1e-9)
    assert values == pytest.approx(ndimage.map_coordinates(x, expected[None, :], order=3, mode="mirror"), abs=1e-9)
    assert np.allclose(_kernels.spline_at.py_func(*arguments), (values, places), rtol=1e-12)


def test_row_fits_are_least_squares() -> None:
    table = RNG.standard_normal((9, 5))
    found = _kernels.row_fits(table)
    r = np.arange(9) - 4.0
    basis = np.stack([np.ones(9), r, r**2 - np.mean(r**2)], axis=1)
    assert np.array(found) == pytest.approx(np.linalg.lstsq(basis, table, rcond=None)[0], abs=1e-12)
    assert np.allclose(_kernels.row_fits.py_func(table), found, rtol=1e-12)


def test_family_holds_its_lines_and_those_of_its_multiples() -> None:
    first, tooth, spindle = 870.0, 200.0, 50.0
    frequency = np.array([870.0, 1070.5, 270.0, 130.0, 1540.0, 920.0, 333.0])
    energy = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0])
    own, multiples, explained = _kernels.family_sums(frequency, energy, first, tooth, spindle, 2.0)
    assert own.tolist() == [True, True, True, True, False, False, False]
    assert (multiples, explained) == (31.0, 63.0)
    plain = _kernels.family_sums.py_func(frequency, energy, first, tooth, spindle, 2.0)
    assert plain[0].tolist() == own.tolist()
    assert plain[1:] == (multiples, explained)


@pytest.mark.parametrize(("frequency", "away"), [(130.0, 0.0), (70.0, 0.0), (100.0, 30.0), (875.0, 5.0)])
def test_distance_knows_mirrored_lines(frequency: float, away: float) -> None:
    assert _kernels.distance(frequency, 870.0, 200.0) == pytest.approx(away)
    assert _kernels.distance.py_func(frequency, 870.0, 200.0) == pytest.approx(away)
