"""Spectra against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnmill_core.monitoring.spectrum import lines, spectrum

RATE = 12800.0


def sine(frequency: float, amplitude: float, count: int = 2560, phase: float = 0.4) -> np.ndarray:
    return amplitude * np.cos(2 * math.pi * frequency * np.arange(count) / RATE + phase)


def test_sum_of_power_is_the_mean_square() -> None:
    x = np.random.default_rng(1).standard_normal(4096)
    w = np.sin(np.pi * np.arange(4096) / 4096) ** 4
    expected = np.sum(w * (x - x.mean()) ** 2) / np.sum(w)
    assert spectrum(x, RATE, RATE / 2).power.sum() == pytest.approx(expected, rel=0.01)


@settings(max_examples=40, deadline=None)
@given(st.floats(100, 4000), st.floats(0.01, 10), st.floats(0, 6.28))
def test_line_has_frequency_and_energy_of_its_sinusoid(frequency: float, amplitude: float, phase: float) -> None:
    found = lines(spectrum(sine(frequency, amplitude, phase=phase), RATE, 5000.0), 40.0, 16.0, 1)[0]
    assert found.frequency == pytest.approx(frequency, abs=0.03 * RATE / 2560)
    assert found.energy == pytest.approx(amplitude**2 / 2, rel=0.02)


def test_floor_is_the_noise_density_and_lines_hardly_move_it() -> None:
    noise = 0.1 * np.random.default_rng(2).standard_normal(12800)
    s = spectrum(noise + sine(500, 1.0, 12800) + sine(900, 1.0, 12800), RATE, 5000.0)
    assert s.floor.mean() / s.step == pytest.approx(0.01 / (RATE / 2), rel=0.25)


def test_noise_alone_has_hardly_any_lines() -> None:
    found = [lines(spectrum(np.random.default_rng(k).standard_normal(2560), RATE, 5000.0), 40.0, 16.0, 5)
             for k in range(300)]
    assert sum(len(f) > 0 for f in found) <= 6
