"""Windowed spectra, their noise floor and lines."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal

from turnmill_core.monitoring._kernels.spectrum import block_medians, largest_near, strongest_peaks, tapered

Array = NDArray[np.float64]

PAD = 2
"""Zero padding of every spectrum: bins per reciprocal window length."""

LINE_RATIO = 16.0
"""A peak counts as a line above this power over the floor: noise alone passes it once in about 500 windows."""


SURGE, CUT = 12.0, 4e-3
"""Growth [1/s] and end [s] of a window for lines that grow: chatter may triple within a tenth of a second."""


@dataclass(frozen=True)
class Spectrum:
    """One-sided power spectrum of a Hann window.

    step [Hz] between bins; power: mean square of the weighted signal per bin (the sum over all
    bins is the mean square of the signal with weights w^2 / sum w^2); floor: mean noise power per
    bin, from medians, which lines hardly move; resolution [Hz] = 1 / window length.
    """

    step: float
    power: Array
    floor: Array

    @property
    def resolution(self) -> float:
        """Reciprocal of the window length [Hz]."""
        return self.step * PAD

    @property
    def frequency(self) -> Array:
        """Frequency of every bin [Hz]."""
        return np.arange(float(len(self.power))) * self.step


@dataclass(frozen=True)
class Line:
    """A narrow peak: frequency [Hz]; energy, mean square of its sinusoid above the floor; ratio [1], power / floor."""

    frequency: float
    energy: float
    ratio: float


@lru_cache(maxsize=32)
def _hann(count: int) -> tuple[Array, float]:
    """Hann window and the sum of its squares."""
    w = np.asarray(signal.windows.hann(count, sym=False), dtype=np.float64)
    w.flags.writeable = False
    return w, float(np.sum(w**2))


@lru_cache(maxsize=32)
def _rising(count: int, rate: float) -> tuple[Array, float]:
    """Window that grows as exp(SURGE t) and falls to zero in its last CUT, and the sum of its squares."""
    before_end = (np.arange(count) - count + 0.5) / rate
    w = np.exp(SURGE * before_end) * np.sin(np.minimum(1.0, -before_end / CUT) * math.pi / 2) ** 2
    w.flags.writeable = False
    return w, float(np.sum(w**2))


def spectrum(x: Array, rate: float, top: float, rising: bool = False) -> Spectrum:
    """Power spectrum of `x` (samples at `rate` Hz, mean removed) from 0 to `top` [Hz].

    rising: seen through a window that grows exponentially to the end of `x`, matched to a line that does so.
    """
    w, squares = _rising(len(x), rate) if rising else _hann(len(x))
    count = fft.next_fast_len(PAD * len(x), real=True)
    step = rate / count
    keep = min(count // 2, int(top / step)) + 1
    amplitude = fft.rfft(tapered(x, w, count))[:keep]
    power = (amplitude.real**2 + amplitude.imag**2) * (2 / (count * squares))
    return Spectrum(rate / count, power, noise_floor(power, max(8, round(40 * count / len(x)))))


def noise_floor(power: Array, block: int) -> Array:
    """Mean noise power per bin: medians over blocks of bins, over ln 2, joined by straight lines."""
    floor: Array = block_medians(power, block)
    return np.maximum(floor / math.log(2), sys.float_info.min)


def lines(s: Spectrum, lowest: float, ratio: float, most: int) -> tuple[Line, ...]:
    """The `most` strongest peaks above `lowest` [Hz] whose power is over `ratio` times the floor, strongest first.

    Frequency by a parabola through the logarithm of three bins (bias below 0.02 bins for Hann);
    energy from the main lobe, less the floor in it.
    """
    bins, energy = strongest_peaks(s.power, s.floor, math.ceil(lowest / s.step), ratio, most, 2 * PAD)
    return tuple(Line(peak(s, k), e, float(s.power[k] / s.floor[k]))
                 for k, e in zip(bins.tolist(), energy.tolist(), strict=True))


def peak(s: Spectrum, k: int) -> float:
    """Frequency of the peak at bin `k` [Hz], by a parabola through the logarithm of three bins."""
    if not 0 < k < len(s.power) - 1:
        return k * s.step
    a, b, c = (math.log(max(p, sys.float_info.min)) for p in s.power[k - 1: k + 2].tolist())
    bend = a - 2 * b + c
    shift = 0.5 * (a - c) / bend if bend < 0 else 0.0
    return (k + min(0.5, max(-0.5, shift))) * s.step


def near(values: Array, s: Spectrum, frequencies: Array, tolerance: float) -> Array:
    """Largest of `values` (one per bin) within `tolerance` [Hz] of each frequency; 0 outside the spectrum."""
    found: Array = largest_near(values, frequencies / s.step, max(0, round(tolerance / s.step)))
    return found
