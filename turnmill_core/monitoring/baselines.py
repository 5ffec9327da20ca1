"""Published chatter indicators, to stand beside ours in every table. Each gives one number per window.

They are written from the published descriptions, and where these leave a choice open it is the one that did best on
training signals. They get what we get and more: x (n,), samples at `rate` [Hz], and turns (n,), the true revolutions
of the spindle at the samples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, signal

from turnmill_core.monitoring._kernels.synchronous import kalman_comb
from turnmill_core.monitoring.spectrum import Array, spectrum

LOWEST, TOP = 40.0, 5000.0
"""Band that is listened to [Hz], the same as the monitor's."""

MEMORY = 6.0
"""Time constant of the Kalman comb [revolutions]."""

PHASES = 16
"""Phases of the revolution at which once-per-revolution samples are taken."""


def fft_energy_ratio(x: Array, turns: Array, rate: float) -> float:
    """Energy that is not at spindle harmonics over all energy, from a Hann spectrum.

    x (n,): samples at `rate` [Hz]; turns (n,): revolutions.
    """
    away, total = _asynchronous(x, turns, rate)
    return float(away.sum()) / total if total > 0 else 0.0


def concentration(x: Array, turns: Array, rate: float) -> float:
    """Decades of the share of all energy that a bin away from spindle harmonics holds, if it is occupied.

    x (n,): samples at `rate` [Hz]; turns (n,): revolutions. Number of occupied bins: exp of the entropy of the energy
    over the bins. -12 at least.
    """
    away, total = _asynchronous(x, turns, rate)
    energy = float(away.sum())
    if energy <= 1e-12 * total:
        return -12.0
    share = away[away > 0] / energy
    return max(-12.0, (math.log(energy / total) + float(np.sum(share * np.log(share)))) / math.log(10))


def _asynchronous(x: Array, turns: Array, rate: float) -> tuple[Array, float]:
    """Power of the bins away from spindle harmonics, and of all, between LOWEST and TOP.

    Multiples of the mean spindle frequency are taken out with the main lobe, two reciprocal window lengths on
    either side.
    """
    s = spectrum(x, rate, min(TOP, 0.45 * rate))
    f, spindle = s.frequency, _spindle_frequency(turns, rate)
    away = np.abs(f - np.round(f / spindle) * spindle) > 2 * s.resolution
    band = f >= LOWEST
    return s.power[band & away], float(s.power[band].sum())


def once_per_revolution_variance(x: Array, turns: Array) -> float:
    """Variance of samples taken once per revolution over the variance of all (Schmitz 2003).

    Near 0 for a synchronous signal, near 1 for an asynchronous one; mean over PHASES phases of the revolution.
    x (n,): samples; turns (n,): revolutions, at equal angles of which x is interpolated. NaN below three.
    """
    revolutions = int(turns[-1] - turns[0])
    if revolutions < 3:
        return math.nan
    total = float(np.var(x))
    if total == 0:
        return 0.0
    at = turns[0] + np.arange(revolutions)[:, None] + np.arange(PHASES) / PHASES
    places = np.interp(at.ravel(), turns, np.arange(len(turns)))
    picked = ndimage.map_coordinates(x, places[None, :], order=3, mode="nearest").reshape(at.shape)
    return float(np.var(picked, axis=0, ddof=1).mean()) / total


def kalman_energy_ratios(x: Array, turns: Array, rate: float, teeth: int, ends: Sequence[int], length: int) -> Array:
    """Energy of the strongest chatter component over it and the periodic part (after Caliskan, Kilic, Altintas 2018).

    x (n,): samples at `rate` [Hz]; turns (n,): revolutions; teeth: of the tool.
    A Kalman filter takes out all spindle harmonics below TOP: each is a rotating state that is corrected by its share
    of the innovation at each sample, the steady state for equal noise on all harmonics, with a time constant of
    MEMORY. Band-pass filters split what is left between consecutive tooth passing harmonics. Energies are means of
    the Teager-Kaiser operator x[n]^2 - x[n-1] x[n+1] over windows of `length` samples that end before each of `ends`.
    The published detector takes 0.2 as its threshold.
    """
    spindle = _spindle_frequency(turns, rate)
    fastest = max(spindle / rate, float(np.max(np.diff(turns), initial=1e-9)))
    count = max(1, min(math.ceil(TOP / spindle), int(0.45 / fastest)))
    centred = x - float(np.mean(x))
    left = kalman_comb(centred, turns, count, min(spindle / rate / MEMORY, 0.5 / count))
    end = np.clip(np.asarray(ends), 2, len(x)) - 2
    begin = np.maximum(0, end - length)

    def energies(v: Array) -> Array:
        summed = np.concatenate([[0.0], np.cumsum(v[1:-1] ** 2 - v[:-2] * v[2:])])
        found: Array = np.maximum(0.0, summed[end] - summed[begin])
        return found

    strongest = np.zeros(len(end))
    for low, high in _bands(teeth * spindle, min(TOP, 0.45 * rate)):
        band = signal.sosfilt(signal.butter(2, [low, high], "bandpass", fs=rate, output="sos"), left)
        strongest = np.maximum(strongest, energies(band))
    total = strongest + energies(centred - left)
    ratio: Array = np.divide(strongest, total, out=np.zeros(len(end)), where=total > 0)
    return ratio


def _bands(tooth: float, top: float) -> list[tuple[float, float]]:
    """Bands [Hz] between consecutive tooth passing harmonics from LOWEST to `top`; none narrower than a fifth."""
    edges = [(max(LOWEST, k * tooth), min((k + 1) * tooth, top)) for k in range(math.ceil(top / tooth))]
    return [(low, high) for low, high in edges if high - low > 0.2 * tooth]


def _spindle_frequency(turns: NDArray[np.float64], rate: float) -> float:
    return float(turns[-1] - turns[0]) * rate / (len(turns) - 1)
