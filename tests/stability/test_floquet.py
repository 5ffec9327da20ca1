"""Verdicts from multipliers and solutions that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnmill_core.prediction import PredictedType
from turnmill_core.stability.floquet import chatter_family, classify, spectrum_lines, verdict


@pytest.mark.parametrize(("multipliers", "kind"), [
    ([0.9, -0.5], PredictedType.STABLE), ([-1.1, 0.5], PredictedType.FLIP), ([-0.9, 0.5], PredictedType.STABLE),
    ([0.8 + 0.8j, 0.8 - 0.8j], PredictedType.HOPF), ([-1.1 + 1e-3j, -1.1 - 1e-3j], PredictedType.HOPF),
    ([-1.2, -1.1], PredictedType.FLIP), ([0.3j, -0.3j], PredictedType.STABLE),
])
def test_classification(multipliers: list[complex], kind: PredictedType) -> None:
    assert classify(multipliers) is kind


def test_secondary_flip_counts_two_multipliers() -> None:
    assert verdict([-1.2, -1.1, 0.5], np.ones((8, 3), complex), 1.0).flips == 2


def test_hopf_family_is_f_plus_multiples_of_the_tooth_frequency() -> None:
    """Eq. 4.107: 871 Hz at 111.7 Hz tooth frequency, the numbers of Figure 4.54."""
    period = 1 / 111.7
    family = chatter_family(np.exp(2j * np.pi * 871.0 * period), period, 1500.0)
    for q in range(-7, 6):
        assert np.min(np.abs(family - (871.0 + q * 111.7))) < 1e-6
    assert np.all(family <= 1500.0)
    off = np.minimum(*(np.abs(q - np.round(q)) for q in ((family - 871) / 111.7, (family + 871) / 111.7)))
    assert np.all(off < 1e-6)


def test_flip_family_is_odd_halves_of_the_tooth_frequency() -> None:
    """Eq. 4.108 with erratum D4."""
    np.testing.assert_allclose(chatter_family(-1.3, 0.01, 400.0), [50, 150, 250, 350])


@given(st.floats(200.0, 1400.0), st.floats(0.8, 1.5), st.sampled_from([-1, 1]))
def test_the_dominant_line_is_the_strongest_of_the_solution(f: float, growth: float, side: int) -> None:
    """d(t) = (exp(2 pi i f t) + 0.3 exp(2 pi i (f +- f_t) t)) growth^(t/T): f wins, wherever it is folded."""
    period, k = 1 / 131.0, 64
    t = np.arange(k) / k * period
    carrier = np.exp(2j * np.pi * f * t) + 0.3 * np.exp(2j * np.pi * (f + side * 131.0) * t)
    d = np.outer(carrier * growth ** (t / period), [1.0, 0.4, 0.0])
    mu = growth * np.exp(2j * np.pi * f * period)
    lines = spectrum_lines(complex(mu), d, period)
    assert lines[0].frequency == pytest.approx(f, rel=1e-9)
    assert lines[0].share == pytest.approx(1 / 1.09, rel=1e-6)
    assert sum(line.share for line in lines) == pytest.approx(1.0)


def test_no_chatter_frequency_where_stable() -> None:
    found = verdict([0.5, 0.2], np.ones((8, 3), complex), 1.0)
    assert np.isnan(found.chatter_frequency)
    assert found.spectral_radius == 0.5


def test_multipliers_that_are_not_finite_are_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        classify([np.nan, 0.5])
