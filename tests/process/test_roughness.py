"""Roughness figures against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from turnmill_core.process.roughness import profile_roughness, surface_roughness, waviness

N = 8000
PLACE = np.arange(N) * 1e-6


def test_sine_in_closed_form() -> None:
    """Ra = 2 A / pi, Rq = A / sqrt(2), Rz = Rt = 2 A, Rsk = 0, Rku = 3/2."""
    found = profile_roughness(3e-6 * np.sin(2 * math.pi * PLACE / 0.1e-3), 1e-6)
    assert found.mean_deviation == pytest.approx(6e-6 / math.pi, rel=1e-3)
    assert found.rms == pytest.approx(3e-6 / math.sqrt(2), rel=1e-9)
    assert found.height == pytest.approx(6e-6, rel=1e-3)
    assert found.total == pytest.approx(6e-6, rel=1e-3)
    assert found.skewness == pytest.approx(0, abs=1e-9)
    assert found.kurtosis == pytest.approx(1.5, rel=1e-9)


def test_saw_tooth_in_closed_form() -> None:
    """Ra = H / 4, Rq = H / sqrt(12), Rku = 9/5."""
    found = profile_roughness(np.mod(PLACE, 0.4e-3) / 0.4e-3 * 18.8e-6, 1e-6)
    assert found.mean_deviation == pytest.approx(18.8e-6 / 4, rel=1e-3)
    assert found.rms == pytest.approx(18.8e-6 / math.sqrt(12), rel=1e-3)
    assert found.kurtosis == pytest.approx(1.8, rel=1e-3)


@pytest.mark.parametrize(("wavelength", "left"), [(0.8e-3, 0.5), (0.1e-3, 1.0), (8e-3, 0.0069)])
def test_filter_takes_long_waves_off(wavelength: float, left: float) -> None:
    """Half of the amplitude is left at the cut-off (ISO 16610-21)."""
    wave = np.sin(2 * math.pi * PLACE / wavelength)
    found = profile_roughness(wave, 1e-6, 0.8e-3)
    assert found.rms * math.sqrt(2) == pytest.approx(left, abs=2e-4)
    np.testing.assert_allclose(waviness(wave + 3.0, 1e-6, 0.8e-3), (1 - found.rms * math.sqrt(2)) * wave + 3, atol=1e-9)


def test_surface_figures() -> None:
    """A step of two levels: Sa = Sq = half of it, Sz all of it, Sku = 1; a plane has no shape."""
    height = np.where(np.arange(100)[:, None] < 50, 0.0, 2e-6) * np.ones((1, 30))
    found = surface_roughness(height)
    assert (found.mean_deviation, found.rms, found.height) == pytest.approx((1e-6, 1e-6, 2e-6))
    assert found.kurtosis == pytest.approx(1)
    assert math.isnan(surface_roughness(np.ones((4, 4))).kurtosis)


def test_bad_questions() -> None:
    with pytest.raises(ValueError, match="cut-off"):
        waviness(PLACE, 1e-6, 1e-6)
    with pytest.raises(ValueError, match="profile"):
        profile_roughness(PLACE[:4], 1e-6)
