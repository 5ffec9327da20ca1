"""The compiled loops against their plain versions and against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import ndimage, signal

from turnmill_core.monitoring._kernels import drift, family, lattice, resampling, sinusoids, spectrum, synchronous

RNG = np.random.default_rng(3)


def test_spline_is_that_of_scipy_at_the_angles() -> None:
    x = RNG.standard_normal(300)
    turns = np.cumsum(RNG.uniform(0.02, 0.03, 300))
    coefficients = ndimage.spline_filter1d(x, 3, mode="mirror")
    arguments = (coefficients, turns, float(turns[-1] - 4), 1 / 50, 200)
    values, places = resampling.spline_at(*arguments)
    expected = np.interp(turns[-1] - 4 + (np.arange(200) + 1) / 50, turns, np.arange(300))
    assert places == pytest.approx(expected, abs=1e-9)
    assert values == pytest.approx(ndimage.map_coordinates(x, expected[None, :], order=3, mode="mirror"), abs=1e-9)
    assert np.allclose(resampling.spline_at.py_func(*arguments), (values, places), rtol=1e-12)


@pytest.mark.parametrize(("count", "up", "down"), [(400, 1, 2), (300, 2, 1), (250, 3, 2), (200, 2, 3), (7, 1, 3)])
def test_resampling_is_that_of_scipy(count: int, up: int, down: int) -> None:
    x, taps = RNG.standard_normal(count), signal.firwin(41, 0.3 / max(up, down))
    found = resampling.resampled(x, taps, up, down)
    assert found == pytest.approx(signal.resample_poly(x, up, down, window=taps), abs=1e-12)
    assert np.allclose(resampling.resampled.py_func(x, taps, up, down), found, rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [2, 3, 5, 200])
def test_spline_coefficients_are_those_of_scipy(count: int) -> None:
    x = RNG.standard_normal(count)
    found = resampling.spline_coefficients(x)
    assert found == pytest.approx(ndimage.spline_filter1d(x, 3, mode="mirror"), abs=1e-12)
    assert np.allclose(resampling.spline_coefficients.py_func(x), found, rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 9, 80])
def test_upper_median_has_its_rank(count: int) -> None:
    for kernel in (spectrum.upper_median, spectrum.upper_median.py_func):
        for values in (RNG.standard_normal(count), RNG.integers(0, 3, count).astype(float)):
            expected = np.sort(values)[count // 2]
            assert kernel(values) == expected


@pytest.mark.parametrize(("count", "block"), [(400, 40), (97, 40), (30, 40)])
def test_block_medians_are_joined_by_straight_lines(count: int, block: int) -> None:
    power = RNG.standard_exponential(count)
    blocks, size = max(1, count // block), min(block, count)
    medians = np.sort(power[: blocks * size].reshape(blocks, size), axis=1)[:, size // 2]
    expected = np.interp(np.arange(count), (np.arange(blocks) + 0.5) * block, medians)
    assert spectrum.block_medians(power, block) == pytest.approx(expected)
    assert spectrum.block_medians.py_func(power, block) == pytest.approx(expected)


def test_strongest_peaks_take_their_lobes() -> None:
    power, floor = np.full(60, 1.0), np.full(60, 0.5)
    power[[3, 20, 22, 40]] = 90.0, 50.0, 60.0, 70.0
    power[41] = 8.0
    for kernel in (spectrum.strongest_peaks, spectrum.strongest_peaks.py_func):
        bins, energy = kernel(power, floor, 5, 16.0, 9, 3)
        assert bins.tolist() == [40, 22]
        assert energy == pytest.approx([69.5 + 7.5 + 5 * 0.5, 59.5 + 49.5 + 5 * 0.5])
        assert kernel(power, floor, 0, 16.0, 1, 3)[0].tolist() == [3]
        assert len(kernel(power, floor, 41, 16.0, 9, 3)[0]) == 0


def test_side_lobes_of_a_hann_window_are_no_peaks() -> None:
    count, pad = 2000, 2
    t = np.arange(count) / count
    x = np.cos(2 * math.pi * 200.3 * t) + 3e-3 * np.cos(2 * math.pi * 208.3 * t)
    power = np.abs(np.fft.rfft(np.hanning(count) * x, pad * count)) ** 2
    for kernel in (spectrum.strongest_peaks, spectrum.strongest_peaks.py_func):
        bins, _ = kernel(power, np.full(len(power), 1e-12), 5, 16.0, 9, 2 * pad)
        assert (bins / pad).tolist() == pytest.approx([200.3, 208.3], abs=0.31)


def test_lattice_evidence_is_the_likelihood_of_lines() -> None:
    ratios, spread = np.array([0.99, 1.0, 1.02]), np.full(2, 0.5)
    for kernel in (lattice.lattice_evidence, lattice.lattice_evidence.py_func):
        one = kernel(np.array([200.3]), spread[:1], 100.0, ratios, 0.1, True, 5.0)
        away = np.array([200.3 - 198.0, 0.3, 204.0 - 200.3]) / 0.5
        density = 0.9 * ratios * 100.0 * np.exp(-0.5 * away**2) / (0.5 * math.sqrt(2 * math.pi))
        assert one == pytest.approx(np.log(np.maximum(density, 0.1)))
        two = kernel(np.array([237.0, 337.2]), spread, 100.0, ratios, 0.1, False, 5.0)
        sigma = 0.5 * math.sqrt(2)
        joins = 0.9 * 0.5 * 100.0 * math.exp(-0.5 * (0.2 / sigma) ** 2) / (sigma * math.sqrt(2 * math.pi))
        assert two[1] == pytest.approx(math.log(0.1) + math.log(joins))
        assert two[1] > two[0] > two[2]
        mirrored = kernel(np.array([237.0, 163.0]), spread, 100.0, ratios, 0.1, False, 5.0)
        assert mirrored[1] > 0 > kernel(np.array([237.0, 163.0]), spread, 100.0, ratios, 0.1, False, 3.0)[1]


def test_row_fits_are_least_squares() -> None:
    table = RNG.standard_normal((9, 5))
    fits, wave = synchronous.row_fits(table)
    r = np.arange(9) - 4.0
    basis = np.stack([np.ones(9), r, r**2 - np.mean(r**2)], axis=1)
    assert fits == pytest.approx(np.linalg.lstsq(basis, table, rcond=None)[0], abs=1e-12)
    assert wave.reshape(9, 5) == pytest.approx(basis[:, :2] @ fits[:2], abs=1e-12)
    for plain, compiled in zip(synchronous.row_fits.py_func(table), (fits, wave), strict=True):
        assert np.allclose(plain, compiled, rtol=1e-12)


@pytest.mark.parametrize("count", [2, 5, 8])
def test_half_means_leave_the_middle_out(count: int) -> None:
    table = RNG.standard_normal((count, 4))
    expected = np.stack([table[: count // 2].mean(axis=0), table[-(count // 2):].mean(axis=0)])
    assert synchronous.half_means(table) == pytest.approx(expected)
    assert synchronous.half_means.py_func(table) == pytest.approx(expected)


def test_harmonics_that_tell_the_speed() -> None:
    def told(powers: dict[int, float], share: float = 0.05) -> list[int]:
        mean = np.full(40, 1e-3, dtype=complex)
        for h, power in powers.items():
            mean[h] = math.sqrt(power) * np.exp(1j * h)
        results = [kernel(mean, np.full(40, 1e-4), 20, 4, share).tolist()
                   for kernel in (drift.telling_harmonics, drift.telling_harmonics.py_func)]
        assert results[0] == results[1]
        return results[0]

    tooth, every = [4, 8, 12, 16], list(range(1, 20))
    assert told({4: 1.0, 1: 5.0, 2: 5.0, 3: 5.0}) == tooth
    assert told({1: 5.0, 2: 5.0, 3: 5.0, 5: 5.0}) == every
    assert told({1: 5.0, 2: 5.0, 3: 5.0, 25: 5.0}) == tooth
    assert told({1: 50.0, 2: 5.0, 3: 5.0, 5: 5.0}) == tooth


def test_weighted_median_and_drift_of_phases() -> None:
    for kernel in (drift.weighted_median, drift.weighted_median.py_func):
        assert kernel(np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 1.5])) == 2.0
        assert kernel(np.array([3.0, 1.0, 2.0]), np.array([9.0, 1.0, 1.5])) == 3.0
    mean = 2.0 * np.exp(1j * np.arange(12.0))
    order = np.arange(12)
    trend, bend = (2j * math.pi * order * turned * mean for turned in (1e-3, 2e-5))
    mean[8] = 1e-9
    harmonics = np.array([4, 8])
    for kernel in (drift.phase_drift, drift.phase_drift.py_func):
        assert kernel(mean, trend, bend, harmonics, np.full(2, 1e-6)) == pytest.approx((1e-3, 2e-5))
        assert kernel(mean, trend, bend, harmonics, np.full(2, 1e6)) == (0.0, 0.0)


def test_tapered_has_no_mean_and_is_followed_by_zeros() -> None:
    x, window = 5 + RNG.standard_normal(30), np.hanning(30)
    expected = np.append((x - x.mean()) * window, np.zeros(10))
    for kernel in (spectrum.tapered, spectrum.tapered.py_func):
        assert kernel(x, window, 40) == pytest.approx(expected, abs=1e-12)


def test_largest_near_a_place() -> None:
    values = np.arange(10.0) % 4
    for kernel in (spectrum.largest_near, spectrum.largest_near.py_func):
        assert kernel(values, np.array([4.6, 2.4, 9.0, -3.0, 8.4]), 1).tolist() == [2.0, 3.0, 0.0, 0.0, 3.0]


@pytest.mark.parametrize("jitter", [0.0, 1e-6])
def test_waves_are_sinusoids_and_their_ramps(jitter: float) -> None:
    times = 0.3 + np.arange(700) * 8e-5 + jitter * RNG.uniform(0, 1, 700)
    phase = 2 * math.pi * np.outer([871.3, 4000.0], times)
    ramp = np.linspace(-1, 1, 700)
    expected = np.concatenate([np.cos(phase), np.sin(phase), np.cos(phase) * ramp, np.sin(phase) * ramp])
    for kernel in (sinusoids.waves, sinusoids.waves.py_func):
        assert kernel(times, np.array([871.3, 4000.0])) == pytest.approx(expected, abs=1e-9)


def test_normal_equations() -> None:
    columns, values = RNG.standard_normal((3, 21)), RNG.standard_normal(21)
    for kernel in (sinusoids.normal_equations, sinusoids.normal_equations.py_func):
        gram, right = kernel(columns, values)
        assert gram == pytest.approx(columns @ columns.T)
        assert right == pytest.approx(columns @ values)
    assert sinusoids.dot.py_func(columns[0], values) == sinusoids.dot(columns[0], values)


def test_energy_of_a_harmonic_with_a_trend() -> None:
    mean, trend = RNG.standard_normal((2, 4)) + 1j * RNG.standard_normal((2, 4))
    at, w = (np.arange(6) - 2.5) * 2, np.sin(math.pi * (np.arange(6) + 0.5) / 6) ** 4
    expected = (np.abs(mean) ** 2 + np.sum(w * at**2) / np.sum(w) * np.abs(trend) ** 2) / 2
    expected[0] = 0.0
    for kernel in (synchronous.harmonic_energy, synchronous.harmonic_energy.py_func):
        assert kernel(mean, trend, 6, 2) == pytest.approx(expected)


def test_between_neighbours_and_beyond_the_last() -> None:
    values = RNG.standard_normal(20)
    for spacing in (0.37, 1.0, 2.0):
        expected = np.interp(spacing * np.arange(60), np.arange(20), values, right=0.0)
        assert synchronous.between(values, spacing, 60) == pytest.approx(expected)
        assert synchronous.between.py_func(values, spacing, 60) == pytest.approx(expected)


def test_family_holds_its_lines_and_those_of_its_multiples() -> None:
    first, tooth, spindle = 870.0, 200.0, 50.0
    frequency = np.array([870.0, 1070.5, 270.0, 130.0, 1540.0, 920.0, 333.0])
    energy = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0])
    own, multiples, explained = family.family_sums(frequency, energy, first, tooth, spindle, 2.0)
    assert own.tolist() == [True, True, True, True, False, False, False]
    assert (multiples, explained) == (31.0, 63.0)
    plain = family.family_sums.py_func(frequency, energy, first, tooth, spindle, 2.0)
    assert plain[0].tolist() == own.tolist()
    assert plain[1:] == (multiples, explained)


@pytest.mark.parametrize(("frequency", "away"), [(130.0, 0.0), (70.0, 0.0), (100.0, 30.0), (875.0, 5.0)])
def test_distance_knows_mirrored_lines(frequency: float, away: float) -> None:
    assert family.distance(frequency, 870.0, 200.0) == pytest.approx(away)
    assert family.distance.py_func(frequency, 870.0, 200.0) == pytest.approx(away)
