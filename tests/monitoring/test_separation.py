"""Separation and speed against signals that are synchronous, asynchronous or drifting by construction."""

from __future__ import annotations

import math

import numpy as np
import pytest

from turnmill_core.monitoring.separation import (
    drift,
    followed,
    lay_out,
    prepare,
    sinusoids,
    synchronous,
    uniform_in_time,
)
from turnmill_core.monitoring.speed import (
    Pages,
    SpindleSpeed,
    constant_rotation,
    joined,
    remember,
    rotation,
    speed_at,
)

RATE, F = 12800.0, 55.83


def window(x: np.ndarray, frequency: float = F, multiple: int = 1):
    p = prepare(x, RATE, 5000.0)
    return p, lay_out(p, constant_rotation(2 * math.pi * frequency, len(p.samples), p.rate).turns, multiple)


def time(seconds: float = 0.2) -> np.ndarray:
    return np.arange(round(seconds * RATE)) / RATE


def test_synchronous_signal_leaves_nothing() -> None:
    t = time()
    x = sum(np.cos(2 * math.pi * F * h * t + h) / h for h in (1, 3, 4, 8, 12))
    _, layout = window(x)
    left = layout.values - synchronous(layout, layout.values, 1).wave
    inner = left[len(left) // 10: -len(left) // 10]
    assert np.var(inner) < 1e-5 * np.var(x)


def test_energies_of_harmonics() -> None:
    t = time()
    _, layout = window(np.cos(2 * math.pi * 4 * F * t) + 0.5 * np.cos(2 * math.pi * 6 * F * t))
    energy = synchronous(layout, layout.values, 1).energy()
    assert energy[4] == pytest.approx(0.5, rel=0.01)
    assert energy[6] == pytest.approx(0.125, rel=0.01)


def test_half_order_line_of_three_teeth_is_asynchronous_over_one_turn_and_synchronous_over_two() -> None:
    _, layout = window(np.cos(2 * math.pi * 1.5 * F * time(0.25)), multiple=2)
    one = layout.values - synchronous(layout, layout.values, 1).wave
    two = layout.values - synchronous(layout, layout.values, 2).wave
    assert np.var(one) > 0.9 * np.var(layout.values)
    assert np.var(two) < 1e-3 * np.var(layout.values)
    assert synchronous(layout, layout.values, 2).energy()[3] == pytest.approx(0.5, rel=0.02)


def test_strong_line_is_taken_out() -> None:
    _, layout = window(np.cos(2 * math.pi * 4 * F * time()) + np.cos(2 * math.pi * 871.3 * time()))
    cleaned = layout.values - sinusoids(layout, layout.values, [871.3])
    energy = synchronous(layout, cleaned, 1).energy()
    assert energy[4] == pytest.approx(0.5, rel=0.02)
    assert energy[np.arange(len(energy)) != 4].sum() < 0.005


@pytest.mark.parametrize("error", [-1e-3, 2e-4, 1e-3])
def test_speed_error_from_phases(error: float) -> None:
    t = time()
    x = sum(np.cos(2 * math.pi * F * (1 + error) * h * t) / h for h in (4, 8, 12))
    _, layout = window(x)
    harmonics = np.array([4, 8, 12])
    found = drift(layout, synchronous(layout, layout.values, 1), harmonics, np.full(3, 1e-9))
    assert found.speed == pytest.approx(error, rel=0.15, abs=2e-5)


def test_ramp_from_phases() -> None:
    t = time()
    turns = F * t + 8.0 * (t - 0.1) ** 2
    x = sum(np.cos(2 * math.pi * h * turns) / h for h in (4, 8))
    p, layout = window(x)
    assumed = constant_rotation(2 * math.pi * F, len(p.samples), p.rate).turns
    for _ in range(3):
        found = drift(layout, synchronous(layout, layout.values, 1), np.array([4, 8]), np.full(2, 1e-9))
        assumed = followed(assumed, layout.revolutions, found)
        layout = lay_out(p, assumed, 1)
    inner = slice(len(assumed) // 10, -len(assumed) // 10)
    true = np.interp(np.arange(len(assumed)) / p.rate, t, turns)
    assert np.ptp((assumed - true)[inner]) < 2e-3


def test_layout_back_to_time() -> None:
    x = np.cos(2 * math.pi * 300 * time())
    _, layout = window(x)
    back, rate = uniform_in_time(layout, layout.values, 12500.0)
    expected = np.cos(2 * math.pi * 300 * (layout.times[0] + np.arange(len(back)) / rate))
    assert np.abs(back - expected)[50:-50].max() < 5e-3


def test_rotation_is_the_exact_integral_of_linear_speeds() -> None:
    pages: Pages = ()
    for k in range(150):
        pages = remember(pages, SpindleSpeed(k * 4_000_000, 300 + 52.36 * k * 0.004))
    held = joined(pages)
    assert (len(pages), len(held)) == (3, 150)
    found = rotation(held, 10_000_000, 10_000_000 + round(0.2e9), 2561, RATE, 10**9)
    assert found is not None
    t = np.arange(2561) / RATE
    expected = ((300 + 52.36 * 0.01) * t + 52.36 * t**2 / 2) / (2 * math.pi)
    assert found.turns == pytest.approx(expected, abs=1e-12)
    assert speed_at(held, 10_000_000, 10**9) == pytest.approx(300 + 52.36 * 0.01)


def test_uncovered_windows_have_no_rotation() -> None:
    held = (SpindleSpeed(0, 300.0), SpindleSpeed(10_000_000, 300.0))
    assert rotation(held, 0, 20_000_000, 100, RATE, 10**9) is None
    assert rotation(held, 0, 10_000_000, 100, RATE, 5_000_000) is None
    assert math.isnan(speed_at(held, 20_000_000, 10**9))


def test_only_newer_finite_speeds_are_remembered_and_not_for_ever() -> None:
    pages = ((SpindleSpeed(0, 300.0), SpindleSpeed(10_000_000, 300.0)),)
    assert remember(pages, SpindleSpeed(5_000_000, 1.0)) == pages
    assert remember(pages, SpindleSpeed(20_000_000, math.nan)) == pages
    for k in range(2, 5000):
        pages = remember(pages, SpindleSpeed(k * 10_000_000, 300.0))
    assert 1000 <= len(joined(pages)) < 1100
