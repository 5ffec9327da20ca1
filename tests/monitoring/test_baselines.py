"""Baselines against hand-made cases and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import RATE, comb, hopf, noise, phase
from turnmill_core.monitoring._kernels.synchronous import kalman_comb
from turnmill_core.monitoring.baselines import (
    concentration,
    fft_energy_ratio,
    kalman_energy_ratios,
    once_per_revolution_variance,
)
from turnmill_core.monitoring.entropy import largest_entropy, sequential_test

SPEED = 3350 * 2 * math.pi / 60


def _kalman(x: np.ndarray, turns: np.ndarray) -> float:
    return float(kalman_energy_ratios(x, turns, RATE, 4, [len(x)], round(0.2 * RATE))[0])


def _fft(x: np.ndarray, turns: np.ndarray) -> float:
    return fft_energy_ratio(x, turns, RATE)


def test_compiled_kalman_comb_does_what_its_plain_version_does() -> None:
    t = phase(3350 * 2 * math.pi / 60, 0.1)
    x = comb(t, 4) + noise(len(t), 0.1, 1)
    assert np.allclose(kalman_comb(x, t, 12, 0.003), kalman_comb.py_func(x, t, 12, 0.003), atol=1e-9)


def test_kalman_comb_follows_a_harmonic_and_leaves_what_is_between() -> None:
    t = phase(3000 * 2 * math.pi / 60, 1.0)
    other = np.cos(2 * math.pi * 77.3 * np.arange(len(t)) / RATE)
    left = kalman_comb(np.cos(2 * math.pi * 3 * t) + other, t, 8, 0.003)
    assert np.std(left[-4000:] - other[-4000:]) < 0.15


@pytest.mark.parametrize("indicator", [_fft, once_per_revolution_variance, _kalman])
def test_baselines_tell_clear_chatter_from_a_clear_cut(indicator) -> None:
    t = phase(SPEED, 0.6)
    stable = comb(t, 4) + noise(len(t), 0.02, 1)
    chatter = stable + hopf(t, 4, 885.0, 1.0)
    assert indicator(stable, t) < 0.1
    assert indicator(chatter, t) > 0.2


def test_once_per_revolution_samples_follow_a_ramp() -> None:
    n = np.arange(int(0.5 * RATE))
    turns = 50 * n / RATE * (1 + 0.05 * n / len(n))
    x = np.cos(2 * math.pi * 20 * turns)
    assert once_per_revolution_variance(x, turns) < 1e-3
    other = np.cos(2 * math.pi * 333.3 * n / RATE)
    assert once_per_revolution_variance(other, turns) == pytest.approx(1.0, abs=0.1)
    assert math.isnan(once_per_revolution_variance(x[:700], turns[:700]))


def test_kalman_comb_reaches_all_harmonics_of_a_slow_spindle_and_follows_the_strongest_component() -> None:
    t = phase(1500 * 2 * math.pi / 60, 2.0)
    stable = sum(np.cos(2 * math.pi * 6 * k * t) / k for k in range(1, 25))
    assert _kalman_six(stable, t) < 0.01
    weak = stable + 0.1 * np.cos(2 * math.pi * 1234.5 * np.arange(len(t)) / RATE)
    strong = stable + 2.0 * np.cos(2 * math.pi * 1234.5 * np.arange(len(t)) / RATE)
    assert _kalman_six(weak, t) < 0.2 < _kalman_six(strong, t)


def _kalman_six(x: np.ndarray, turns: np.ndarray) -> float:
    return float(kalman_energy_ratios(x, turns, RATE, 6, [len(x)], round(0.2 * RATE))[0])


def test_concentration_is_high_for_a_line_and_low_for_noise_of_the_same_energy() -> None:
    t = phase(SPEED, 0.375)
    stable = comb(t, 4)
    line = stable + 0.5 * np.cos(2 * math.pi * 885.0 * np.arange(len(t)) / RATE)
    rough = stable + noise(len(t), 0.5 / math.sqrt(2), 2)
    assert concentration(line, t, RATE) > concentration(rough, t, RATE) + 1.5
    assert concentration(np.zeros(len(t)), t, RATE) == -12.0


def test_largest_entropy_gives_known_densities() -> None:
    rng = np.random.default_rng(3)
    grid = np.linspace(-8.0, 8.0, 161)
    normal = largest_entropy(rng.standard_normal(200_000), -8.0, 8.0, moments=2)
    assert normal.logarithm(grid[60:101]) == pytest.approx(
        -grid[60:101] ** 2 / 2 - 0.5 * math.log(2 * math.pi), abs=0.03)
    uniform = largest_entropy(np.linspace(-8, 8, 4001), -8.0, 8.0)
    assert uniform.logarithm(grid) == pytest.approx(math.log(1 / 16), abs=0.02)
    skewed = largest_entropy(rng.gamma(4.0, 1.0, 20_000) - 4.0, -8.0, 8.0)
    assert np.trapezoid(np.exp(skewed.logarithm(grid)), grid) == pytest.approx(1.0, abs=1e-3)
    assert np.trapezoid(grid * np.exp(skewed.logarithm(grid)), grid) == pytest.approx(0.0, abs=0.05)
    with pytest.raises(ValueError, match="0 values"):
        largest_entropy(np.zeros(0), 0.0, 1.0)


def test_sequential_test_keeps_its_probability_of_error() -> None:
    rng = np.random.default_rng(4)
    off = 0
    for _ in range(300):
        x = rng.normal(0.0, 1.0, 60)
        off += bool((sequential_test(x - 0.5, np.ones(60, dtype=bool), 0.01, 0.01) >= 1).any())
    assert off < 0.2 * 300
    on = sequential_test(rng.normal(1.0, 1.0, 60) - 0.5, np.ones(60, dtype=bool), 0.01, 0.01)
    assert on[-1] >= 0.5
    assert (on >= 1).any()
    assert sequential_test(np.ones(8), np.zeros(8, dtype=bool), 0.01, 0.01).max() == 0


def test_sequential_test_begins_anew_where_nothing_is_heard() -> None:
    heard = np.array([True] * 6 + [False] + [True] * 6)
    found = sequential_test(np.ones(13), heard, 0.01, 0.01)
    bound = math.log(99)
    assert found == pytest.approx([min(k, 5) / bound if k < 6 else 6 / bound for k in range(1, 7)]
                                  + [0.0] + [k / bound for k in range(1, 7)], abs=0.3)
    assert found[4] >= 1 > found[3]
