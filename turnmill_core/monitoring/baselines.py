"""Published chatter indicators, to stand beside ours in every table. Each gives one number per window.

They get what we get and more: the samples x (n,) at `rate` [Hz], and the spindle_frequency [Hz] that our monitor
refined, or the true rotation of the spindle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from turnmill_core.monitoring import _kernels
from turnmill_core.monitoring.spectrum import Array, spectrum


def fft_energy_ratio(
    x: Array, rate: float, spindle_frequency: float, top: float = 5000.0, lowest: float = 40.0,
) -> float:
    """Energy that is not at spindle harmonics over all energy, from a Hann spectrum.

    Multiples of spindle_frequency [Hz] are taken out of x (n,), at `rate` [Hz], with the main lobe, two reciprocal
    window lengths on either side. Between `lowest` and `top` [Hz].
    """
    s = spectrum(x, rate, min(top, 0.45 * rate))
    f = s.frequency
    away = np.abs(f - np.round(f / spindle_frequency) * spindle_frequency) > 2 * s.resolution
    band = f >= lowest
    total = float(s.power[band].sum())
    return float(s.power[band & away].sum()) / total if total > 0 else 0.0


def once_per_revolution_variance(x: Array, rate: float, spindle_frequency: float) -> float:
    """Variance of samples taken once per revolution over the variance of all (Schmitz 2003).

    Near 0 for a synchronous signal, near 1 for an asynchronous one; mean over 16 phases of the
    revolution. x: samples (n,) at `rate` [Hz]; spindle_frequency [Hz]. NaN below three revolutions.
    """
    revolutions = int(len(x) * spindle_frequency / rate)
    if revolutions < 3:
        return math.nan
    total = float(np.var(x))
    if total == 0:
        return 0.0
    at = (np.arange(revolutions)[:, None] + np.arange(16) / 16) * rate / spindle_frequency
    picked = np.interp(at, np.arange(len(x)), x)
    return float(np.var(picked, axis=0, ddof=1).mean()) / total


def kalman_energy_ratios(x: NDArray[np.float64], turns: NDArray[np.float64], ends: Sequence[int], length: int,
                         harmonics: int = 40, gain: float = 0.003) -> Array:
    """Energy of what a comb of tracked harmonics leaves over all energy (after Caliskan, Kilic, Altintas 2018).

    Every harmonic of the spindle is a rotating state that is corrected by its share of the innovation at each
    sample: the steady state of a Kalman filter with equal noise on all harmonics. Energies are means of the
    Teager-Kaiser operator x[n]^2 - x[n-1] x[n+1]; the ratio is that of the residual over residual and periodic part.
    The published detector takes 0.2 as its threshold and splits the residual into bands; here all of it is one.
    It runs through a signal x (n,) with `turns` (n,), revolutions of the spindle, and is read for windows of `length`
    samples that end before each of `ends`; `harmonics` multiples of the spindle frequency are
    tracked; gain: correction per sample, the reciprocal of a time constant in samples.
    """
    fastest = float(np.max(np.diff(turns), initial=1e-9))
    count = max(1, min(harmonics, int(0.45 / fastest)))
    centred = x - float(np.mean(x))
    left = _kernels.kalman_comb(centred, turns, count, min(gain, 0.5 / count))
    chatter, periodic = (np.concatenate([[0.0], np.cumsum(_teager_kaiser(v))]) for v in (left, centred - left))
    end = np.clip(np.asarray(ends), 2, len(x)) - 2
    begin = np.maximum(0, end - length)
    energy = np.maximum(0.0, chatter[end] - chatter[begin])
    total = energy + np.maximum(0.0, periodic[end] - periodic[begin])
    ratio: Array = np.divide(energy, total, out=np.zeros(len(end)), where=total > 0)
    return ratio


def _teager_kaiser(x: Array) -> Array:
    """Teager-Kaiser energy operator of x (n,): (n - 2,)."""
    found: Array = x[1:-1] ** 2 - x[:-2] * x[2:]
    return found
