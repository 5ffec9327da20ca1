"""Synchronous and asynchronous parts of a window.

A window is laid out by angle: one row per revolution, one column per angle. Per column the mean and
the linear trend over the revolutions are the synchronous part (synchronous averaging, with a trend
for a cut that grows); the rest is asynchronous. Half-order lines of a tool with an odd number of
teeth lie midway between spindle harmonics: there the averaging runs over two revolutions.

Sums run through einsum, not BLAS: the same bits whatever the number of threads.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage, signal

from turnmill_core.monitoring._kernels.drift import phase_drift
from turnmill_core.monitoring._kernels.resampling import resampled, spline_at, spline_coefficients
from turnmill_core.monitoring._kernels.sinusoids import normal_equations, waves
from turnmill_core.monitoring._kernels.synchronous import between, harmonic_energy, row_fits
from turnmill_core.monitoring.spectrum import Array, Spectrum

LAYOUT = 2.5
"""Samples of a layout per period of the highest judged frequency."""


@dataclass(frozen=True)
class Prepared:
    """Window at a rate suited to the band.

    samples (mean removed), rate [Hz], top of the band [Hz]; spline: coefficients of the cubic spline through them;
    sampled [Hz]: rate at which the sensor was, where that limits the band (0: it does not).
    """

    samples: Array
    rate: float
    top: float
    spline: Array
    sampled: float = 0.0


def prepare(x: Array, rate: float, top: float) -> Prepared:
    """Window `x` without what lies above its highest judged frequency, at four times that frequency or a little more.

    top [Hz]: highest judged frequency, at most 0.45 rate. Four samples a period let cubic splines
    interpolate; the low-pass (flat to `top`, 50 dB down from 1.5 top) lets the layout be coarser.
    """
    sampled, top = rate if top > 0.45 * rate else 0.0, min(top, 0.45 * rate)
    up, down = max(1, math.ceil(4 * top / rate)), max(1, int(rate / (4 * top)))
    taps = _low_pass(top / (rate * up), up)
    samples = resampled(x - x.mean(), taps, up, down)
    return Prepared(samples, rate * up / down, top, spline_coefficients(samples), sampled)


@lru_cache(maxsize=16)
def _low_pass(edge: float, up: int) -> Array:
    """Kaiser low-pass for a band edge in cycles per sample (at the raised rate): flat below, 50 dB down at 1.5 edge.

    No band edge lies above 0.45 of the original rate, so the stop band begins at most at 0.55 of it.
    """
    stop = min(1.5 * edge, 0.55 / up)
    count, beta = signal.kaiserord(50.0, 2 * (stop - edge))
    taps: Array = signal.firwin(count | 1, edge + stop, window=("kaiser", beta))
    taps.flags.writeable = False
    return taps


def resampled_turns(turns: Array, count: int, ratio: float) -> Array:
    """Revolutions at `count` samples taken at `ratio` times the rate of `turns`."""
    at = np.arange(count) / ratio
    inside = np.minimum(at, len(turns) - 1.0)
    found: Array = np.interp(inside, np.arange(len(turns)), turns) + (at - inside) * (turns[-1] - turns[-2])
    return found


@dataclass(frozen=True)
class Layout:
    """The newest whole revolutions of a window, by angle.

    frequency [Hz]: mean spindle frequency; values: one per angle step, `points` a revolution,
    oldest first; times [s] of the values since the window's first sample.
    """

    frequency: float
    revolutions: int
    points: int
    values: Array
    times: Array

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.revolutions / self.frequency


def lay_out(p: Prepared, turns: Array, multiple: int) -> Layout:
    """Window by angle; turns: revolutions of the tool at every sample, ascending.

    The revolutions kept are a whole `multiple`. Raises ValueError where the window holds fewer than
    three multiples.
    """
    total = float(turns[-1] - turns[0])
    revolutions = int(total / multiple + 1e-9) * multiple
    if revolutions < 3 * multiple:
        raise ValueError(f"window holds {total:.3g} revolutions, expected at least {3 * multiple}")
    frequency = total * p.rate / (len(turns) - 1)
    points = fft.next_fast_len(math.ceil(LAYOUT * p.top / frequency), real=True)
    values, index = spline_at(p.spline, turns, float(turns[-1] - revolutions), 1 / points, revolutions * points)
    return Layout(frequency, revolutions, points, values, index / p.rate)


@dataclass(frozen=True)
class Synchronous:
    """Part of a window that repeats every `period` revolutions.

    wave: its values in the order of the layout; mean, trend: complex amplitudes at multiples 0, 1,
    2 ... of the spindle frequency over `period`, and their change per revolution; the peak
    amplitude of a harmonic is |mean|; rows: number of periods averaged; bend: what they change with the square of the
    revolution's number.
    """

    period: int
    rows: int
    wave: Array
    mean: NDArray[np.complex128]
    trend: NDArray[np.complex128]
    bend: NDArray[np.complex128]

    def energy(self) -> Array:
        """Mean square of every harmonic with its trend, in the weights of a Spectrum (Hann squared)."""
        found: Array = harmonic_energy(self.mean, self.trend, self.rows, self.period)
        return found


def synchronous(layout: Layout, values: Array, period: int) -> Synchronous:
    """Synchronous part of `values` (laid out like `layout`) over `period` revolutions, with linear trend."""
    table = values.reshape(layout.revolutions // period, period * layout.points)
    fits, wave = row_fits(table)
    mean, trend, bend = fft.rfft(fits) * (2 / (period * layout.points))
    return Synchronous(period, len(table), wave, mean, trend / period, bend / period**2)


def sinusoids(layout: Layout, values: Array, frequencies: Sequence[float]) -> Array:
    """Part of `values` in sinusoids whose amplitudes change linearly (least squares), one at each frequency [Hz].

    A strong asynchronous line that is left in leaks into the averages over the revolutions.
    """
    if not frequencies:
        return np.zeros_like(values)
    columns = waves(layout.times, np.array(frequencies))
    gram, right = normal_equations(columns, values)
    gram[np.diag_indices(len(gram))] *= 1 + 1e-9
    found: Array = np.einsum("i,ij->j", np.linalg.solve(gram, right), columns)
    return found


@dataclass(frozen=True)
class Drift:
    """Departure of the tool's rotation from the assumed one, in turns from the window's middle.

    True turns = turns (1 + speed) + ramp turns^2; speed: relative error of the speed; ramp: half its
    change per revolution.
    """

    speed: float = 0.0
    ramp: float = 0.0


def drift(layout: Layout, one: Synchronous, harmonics: NDArray[np.int64], noise: Array) -> Drift:
    """Drift seen in the phases of the harmonics (multiples of the spindle frequency) of a synchronous part.

    one: over single revolutions of `layout`. A wrong speed turns the phase of harmonic h by 2 pi h error each
    revolution, a wrong ramp bends it. Per harmonic from least squares over the revolutions (mean, trend,
    bend), then weighted medians over the harmonics above the noise, so that a line near one harmonic
    moves it little; noise: mean square that noise alone gives each. Zero without any such harmonic.
    """
    return Drift(*phase_drift(one.mean, one.trend, one.bend, harmonics, noise))


def followed(turns: Array, revolutions: int, found: Drift) -> Array:
    """Turns corrected by a drift found in the newest `revolutions`."""
    since = turns - (turns[-1] - revolutions / 2)
    corrected: Array = turns + found.speed * since + found.ramp * since**2
    return corrected


def uniform_in_time(layout: Layout, values: Array, rate: float) -> tuple[Array, float]:
    """`values` at uniform steps of time and their rate [Hz], for a window in which the speed changes."""
    times = np.arange(layout.times[0], layout.times[-1], 1 / rate)
    index = np.interp(times, layout.times, np.arange(len(values)))
    found: Array = ndimage.map_coordinates(values, index[None, :], order=3, mode="nearest")
    return found, rate


def harmonic_noise(floor: Spectrum, count: int, frequency: float, period: int, duration: float) -> Array:
    """Mean square that broadband noise gives to each fitted harmonic (mean and trend), from a noise floor.

    count: number of harmonics, multiples of frequency / period [Hz]; duration [s] of the window.
    """
    noise: Array = between(floor.floor, frequency / (period * floor.step), count)
    noise *= 1.5 / (floor.step * duration)
    return noise
